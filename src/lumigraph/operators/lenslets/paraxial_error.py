"""Error of parabolic lenses and Fresnel's distances: by exact and paraxial waves along one axis.

A point's image behind a few cylindrical lenslets is computed both ways, in the middle of the array and nearer
to its edge, and both are averaged over pixels. An image of two axes is off by √2 times as much.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from lumigraph.elements import PupilMask
from lumigraph.elements.surface import GlassSurface
from lumigraph.operators.lenslets.cell_response import bent, focal_lengths, legendre, sphere
from lumigraph.operators.lenslets.exact_light import image_distance
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.field_lenses import plate_of

NODE = math.cos(math.pi / 6)
"""Of half the array, where the field is known beside the middle: Chebyshev's three nodes."""

FIELD = 0.5
"""Part of the accuracy that the field may take before it is interpolated."""

TOWARDS_EDGE = 0.7
"""Where a field's effect is its rms over the field, over where its edge is."""

PLACE = 0.15
"""Of the point's image from a lenslet's middle [pitches]."""


def paraxial_error(camera: CameraOptics) -> float:
    """Relative rms by which the paraxial model is off, of a camera with lenslets: estimated."""
    bench = _ParaxialBench.of(camera)
    return _apart(bench, (False, 0.0), ((True, 0.0), (True, TOWARDS_EDGE)))


def field_error(camera: CameraOptics) -> float:
    """Relative rms by which the exact image in the middle of the array is off elsewhere: estimated."""
    return _apart(_ParaxialBench.of(camera), (True, 0.0), ((True, TOWARDS_EDGE),))


def interpolated_error(camera: CameraOptics) -> float:
    """The same of exact images that are interpolated between three places."""
    bench = _ParaxialBench.of(camera)
    known = [_image(bench, True, place) for place in (-NODE, 0.0, NODE)]
    squares = []
    for at in (0.45, 0.98):
        parts = [w * image for w, image in zip(weights(np.asarray(at)), known, strict=True)]
        squares.append(_apart_by(np.sum(parts, axis=0), _image(bench, True, at)))
    return math.sqrt(2 * float(np.mean(squares)))


def field_matters(camera: CameraOptics, accuracy: float) -> bool:
    """True if an exact operator has to be interpolated over the field, and gains by it."""
    off = field_error(camera)
    return off > FIELD * accuracy and interpolated_error(camera) < off


def left_by_field(camera: CameraOptics, accuracy: float) -> float:
    """Relative rms that an exact operator is off because cells differ over the field: estimated."""
    return interpolated_error(camera) if field_matters(camera, accuracy) else field_error(camera)


def weights(place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights of images at -NODE, 0 and NODE, for the one at a place from -1 to 1: Lagrange's parabolas."""
    t = place / NODE
    return t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2


def half_field(camera: CameraOptics) -> float:
    """Half the larger side of the array [m]."""
    array = _cells.lenslet_array(camera)
    return max(array.extent or camera.sensor.grid.size) / 2


def resolved(camera: CameraOptics, accuracy: float) -> CameraOptics:
    """Camera whose model is chosen: exact where the paraxial misses the accuracy and exact is possible."""
    if camera.model != "auto":
        return camera
    exact = camera.array is not None and is_possible(camera) and paraxial_error(camera) > accuracy
    return replace(camera, model="exact" if exact else "paraxial")


def is_possible(camera: CameraOptics) -> bool:
    """True if lenslets can be exact: square, of one focal length, or none; behind one bare lens."""
    array = camera.array
    if plate_of(camera) is not None or any(isinstance(part, PupilMask) for part in camera.lens.elements):
        return False
    return array is None or (array.shape == "square" and len(focal_lengths(array)) == 1)


@dataclass(frozen=True, slots=True)
class _ParaxialBench:
    """Values that the estimate depends on, all in metres: plain, as keys of what was computed."""

    wavelength: float
    separation: float
    image_distance: float
    lenslet_distance: float
    focal_length: float
    diameter: float
    lenslet: float
    edge: float
    pixel: float
    around: int
    surface: GlassSurface | None

    @classmethod
    def of(cls, camera: CameraOptics) -> "_ParaxialBench":
        array = _cells.lenslet_array(camera)
        return cls(
            camera.wavelength, camera.separation, image_distance(camera, camera.object_distance),
            _cells.lenslet_distance(camera), min(focal_lengths(array), key=abs), camera.pupil_diameter,
            array.lattice.pitch * array.fill_factor, half_field(camera),
            camera.sensor.pixel_pitch,
            2 + math.ceil(_cells.blur(camera, camera.object_distance) / array.lattice.pitch), camera.surface,
        )  # fmt: skip

    def bent(self, squared: np.ndarray) -> np.ndarray:
        """Path that a lenslet takes away [m], beyond the paraxial."""
        if self.surface is None:
            return bent(squared, self.focal_length, self.lenslet_distance)
        return self.surface.path(squared, self.lenslet / 2, self.focal_length)


def _apart(bench: _ParaxialBench, one: tuple[bool, float], others: tuple[tuple[bool, float], ...]) -> float:
    mine = _image(bench, *one)
    found = [_image(bench, *other) for other in others]
    return math.sqrt(2 * float(np.mean([_apart_by(mine, other) for other in found])))


def _apart_by(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sum((found - expected) ** 2) / np.sum(expected**2))


@lru_cache(maxsize=64)
def _image(bench: _ParaxialBench, exact: bool, towards: float) -> np.ndarray:
    """Intensity on pixels along one axis, of a point imaged beside the middle of the lenslet there."""
    b, f, pitch, around, pixel = (
        bench.lenslet_distance, bench.focal_length, bench.lenslet, bench.around, bench.pixel
    )  # fmt: skip
    wavelength, L, D = bench.wavelength, bench.separation, bench.diameter
    k, middle, scale = 2 * np.pi / wavelength, towards * bench.edge, 1 + b / L
    at = np.arange(-around * pitch, around * pitch, min(wavelength * b / pitch / 6, pixel / 2))
    seen, total = (middle + at) * scale, np.zeros(len(at), complex)
    for lenslet in range(-around, around + 1):
        turns = (pitch / abs(f) + (2 * around + 1) * pitch / b + D / L) * pitch / wavelength
        off, weight = legendre(-pitch / 2, pitch / 2, 24 + math.ceil(2 * turns))
        there = middle + lenslet * pitch + off
        path = bench.bent(off**2) if exact else off**2 / (2 * f)
        light = _light(bench, there, middle + PLACE * pitch, exact) * weight * np.exp(-1j * k * path)
        squared = (seen[:, None] - there) ** 2
        way = sphere(squared, b) if exact else squared / (2 * b)
        fade = (1 + exact * squared / b**2) ** -0.75
        total += (fade * np.exp(1j * k * way)) @ light
    image = np.abs(total) ** 2
    width = max(1, round(pixel / scale / (at[1] - at[0])))
    return np.convolve(image, np.ones(width), mode="same")


def _light(bench: _ParaxialBench, at: np.ndarray, image: float, exact: bool) -> np.ndarray:
    """Amplitude in the lenslet plane of light from the stop to a point before or behind that plane."""
    wavelength, L, distance, D = bench.wavelength, bench.separation, bench.image_distance, bench.diameter
    k, near = 2 * np.pi / wavelength, image * distance / L
    turns = (
        abs(1 / L - 1 / distance) * D**2 / 4 + 2 * D * np.ptp(at) / L + 8 * D * np.abs(at - image).max() / L
    )
    u, weight = legendre(-D / 2, D / 2, 48 + math.ceil(turns / wavelength))
    squared, arrived = (at[:, None] - u) ** 2, (u - near) ** 2
    if not exact:
        return np.exp(1j * k * (squared / (2 * L) - arrived / (2 * distance))) @ weight
    way = sphere(squared, L) - sphere(arrived, distance)
    return ((1 + squared / L**2) ** -0.75 * np.exp(1j * k * way)) @ weight
