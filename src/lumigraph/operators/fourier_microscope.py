r"""Raw image of a volume by a Fourier light-field microscope, and the adjoint.

Each lenslet stands in the image of the pupil and images the whole field by its share of the light. Moving a
point moves its image behind every lenslet by the same amount, so that each depth is a plain convolution for
each lenslet, with the image of a point on the axis (docs/theory/microscope.md). A lenslet that is weaker than
1/b focuses points at a depth n (1/b - 1/f_j) (f_F/M)², farther away.

C. Guo et al., "Fourier light-field microscopy", Opt. Express 27, 25573 (2019).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
import scipy.fft

from lumigraph.core import arrays, checks, memory
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear, Shape
from lumigraph.elements.objective import Objective
from lumigraph.errors import GeometryError, SamplingError

Window = tuple[slice, slice]
Fine = tuple[int, int]
"""Samples across a lenslet, nodes across a pixel."""

TAIL = 4.0
"""Half width of the window of a point's image beyond its displacement, in λ f_µ/d."""


@dataclass(frozen=True, slots=True, eq=False)
class Mosaic:
    """Lenslets in the pupil and the pixels behind them, in lengths at the lenslets.

    Parameters
    ----------
    centers
        Of the lenslets (k, 2) as (y, x) [m], the pupil's middle at (0, 0).
    width
        Of a lenslet, d [m].
    focal_lengths
        Of the lenslets (k,), f_j [m].
    distance
        Lenslets to the plane that the sensor sees, b [m].
    fourier_lens
        f_F [m].
    magnification
        M, from the object to the native image.
    pixel_pitch, shape
        Of the sensor, whose middle stands behind the pupil's.
    pitch
        Of the lenslets [m].
    """

    centers: np.ndarray
    width: float
    focal_lengths: np.ndarray
    distance: float
    fourier_lens: float
    magnification: float
    pixel_pitch: float
    shape: tuple[int, int]
    pitch: float

    def of(self, lenslets: np.ndarray) -> "Mosaic":
        """The mosaic with some of the lenslets (k,)."""
        return replace(self, centers=self.centers[lenslets], focal_lengths=self.focal_lengths[lenslets])

    @property
    def total_magnification(self) -> float:
        """Magnification from the object to the sensor, M b/f_F."""
        return self.magnification * self.distance / self.fourier_lens

    @property
    def defocus(self) -> np.ndarray:
        """Defocus of each lenslet, 1/b - 1/f_j [1/m]."""
        return 1 / self.distance - 1 / self.focal_lengths

    @property
    def field(self) -> int:
        """Pixels across a lenslet's image."""
        return max(1, math.floor(self.pitch / self.pixel_pitch))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FourierMicroscopeOperator(Linear):
    """A volume (z, y, x) to a raw image (ny, nx) of a Fourier light-field microscope, and back.

    Parameters
    ----------
    images
        Images of a point on the axis (z, lenslets, w, w), float32, about each lenslet's pixel.
    corners
        Pixel (row, column) (lenslets, 2) where a lenslet's convolution begins.
    raw_shape, plane
        Pixels (ny, nx) of the raw image; samples (y, x) of the object, as fine as the pixels.
    """

    images: np.ndarray
    corners: np.ndarray
    raw_shape: tuple[int, int]
    plane: tuple[int, int]
    _spectra: dict = field(default_factory=dict)

    title: ClassVar[str] = "Operator of a Fourier microscope"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Pixels (ny, nx) of the raw image, samples (y, x) or (z, y, x) of the object."""
        return self.raw_shape, (() if self.depths is None else (len(self.images),)) + self.plane

    @property
    def memory_bytes(self) -> float:
        """Memory of the points' images and their spectra [bytes]."""
        ny, nx = self._size
        return self.images.nbytes + 8.0 * math.prod(self.images.shape[:2]) * ny * (nx // 2 + 1)

    @property
    def error(self) -> float:
        """Relative error: unknown, NaN."""
        return math.nan

    def _forward(self, intensity: Array) -> Array:
        volume = intensity if self.depths is not None else intensity[None, ...]
        xp, spectra = arrays.namespace(volume), self._of(volume)
        spectrum = 0.0
        for k in range(len(self.images)):
            spectrum = spectrum + spectra[k, ...] * arrays.rfft2(volume[k, ...], self._size)
        pieces = arrays.irfft2(spectrum, self._size)
        raw = xp.zeros(self.raw_shape, dtype=volume.dtype, device=arrays.device(volume))
        for j, (inside, own) in enumerate(self._windows()):
            window = raw[inside]
            window += pieces[(j, *own)]
        return raw

    def _adjoint(self, raw: Array) -> Array:
        xp, spectra = arrays.namespace(raw), self._of(raw)
        size, shape = self._size, self.plane
        pieces = xp.zeros((len(self.corners), *size), dtype=raw.dtype, device=arrays.device(raw))
        for j, (inside, own) in enumerate(self._windows()):
            pieces[(j, *own)] = raw[inside]
        given = arrays.rfft2(pieces, size)
        planes = []
        for k in range(len(self.images)):
            spectrum = xp.sum(xp.conj(spectra[k, ...]) * given, axis=0)
            planes.append(arrays.irfft2(spectrum, size)[: shape[0], : shape[1]])
        return planes[0] if self.depths is None else xp.stack(planes)

    def by_images(self, plane: np.ndarray, raw: np.ndarray) -> np.ndarray:
        """Slopes by the points' images (lenslets, w, w) of a plane's raw image whose slopes are given."""
        pieces, w = np.zeros((len(self.corners), *self._size)), self.images.shape[-1]
        for j, (inside, own) in enumerate(self._windows()):
            pieces[(j, *own)] = raw[inside]
        given = np.conj(np.fft.rfft2(plane, self._size)) * np.fft.rfft2(pieces)
        return np.fft.irfft2(given, self._size)[:, :w, :w]

    @property
    def _size(self) -> tuple[int, int]:
        """Size (y, x) of the convolutions: field and image together, rounded up to a smooth number."""
        w = self.images.shape[-1]
        ny, nx = (scipy.fft.next_fast_len(n + w - 1) or n + w - 1 for n in self.plane)
        return ny, nx

    def _of(self, like: Array) -> Array:
        key = arrays.placement(like)
        if key not in self._spectra:
            spectra = arrays.rfft2(self.images.astype(np.float64), self._size)
            self._spectra[key] = arrays.like(spectra, like)
        return self._spectra[key]

    def _windows(self) -> list[tuple[Window, Window]]:
        """Windows of each lenslet: the pixels of the raw image, and the part of its convolution on them."""
        w = self.images.shape[-1]
        size = self.plane[0] + w - 1, self.plane[1] + w - 1
        return [overlap(corner, size, self.raw_shape) for corner in self.corners.tolist()]


def overlap(corner: Sequence[int], size: tuple[int, int], shape: tuple[int, int]) -> tuple[Window, Window]:
    """Pixels of a raw image that a window from a corner on covers, and which of its own these are."""
    raw, own = [], []
    for first, length, n in zip(corner, size, shape, strict=True):
        start, stop = (min(max(0, at), n) for at in (first, first + length))
        raw.append(slice(start, stop))
        own.append(slice(start - first, stop - first))
    return (raw[0], raw[1]), (own[0], own[1])


def fourier_operator(
    objectives: Sequence[Objective],
    mosaic: Mosaic,
    depths: Sequence[float] | None = None,
    across: int | None = None,
) -> FourierMicroscopeOperator:
    """Operator from slices at `depths`, or from the focused plane, to a Fourier microscope's raw image.

    Light is scalar here: each lenslet accepts a small cone. The object has `across` samples along either
    side, around the axis; as many as the field for None.

    Raises
    ------
    SamplingError
        The images of points do not fit in memory.
    GeometryError
        No depths, or none of the lenslets stands in the pupil.
    """
    planes = (0.0,) if depths is None else tuple(checks.finite("a depth", dz) for dz in depths)
    if not planes:
        raise GeometryError("there are no depths. Give at least one, such as 0.0 for the focused plane.")
    mosaic = lit_lenslets(objectives[0], mosaic)
    half, lit = half_window(objectives[0], mosaic, planes), mosaic.centers
    n = mosaic.field if across is None else across
    # With their spectra, in double precision at first, of a window that holds the object too.
    needed = 24.0 * len(planes) * len(lit) * (2 * half + 1 + n) ** 2
    memory.require(needed, "the images of points", "Use fewer slices or larger pixels.", SamplingError)
    images = np.zeros((len(planes), len(lit), 2 * half + 1, 2 * half + 1), np.float32)
    middle = np.asarray(mosaic.shape) // 2
    # Two images one after the other: upright on the sensor, which is not turned.
    places = lit / mosaic.pixel_pitch + middle
    nearest = np.round(places).astype(int)
    for objective in objectives:
        for j, rest in enumerate(places - nearest):
            view = View.of(objective, mosaic, j, half)
            for k, dz in enumerate(planes):
                images[k, j] += image_behind(view, objective, rest, dz) / len(objectives)
    pitch = mosaic.pixel_pitch / mosaic.total_magnification
    # Sample n // 2 of the object stands on the axis, and its image on the lenslet's pixel.
    corners = nearest - half - n // 2
    return FourierMicroscopeOperator(
        images, corners, mosaic.shape, (n, n),
        object_grid=Grid((n, n), (pitch, pitch)), depths=None if depths is None else planes,
    )  # fmt: skip


def lit_lenslets(objective: Objective, mosaic: Mosaic) -> Mosaic:
    """The lenslets that the pupil lights at least in part."""
    return mosaic.of(lit_ones(objective, mosaic))


def lit_ones(objective: Objective, mosaic: Mosaic) -> np.ndarray:
    """Mask (k,) of lenslets that the pupil lights at least in part."""
    radius = mosaic.fourier_lens * objective.aperture / mosaic.magnification
    nearest = np.maximum(np.abs(mosaic.centers) - mosaic.width / 2, 0)
    lit = np.hypot(*nearest.T) < radius
    if not lit.any():
        raise GeometryError(
            f"no lenslet stands in the pupil, which is {2 * radius * 1e3:.4g} mm wide. "
            "Check fourier_lens and count."
        )
    return lit


def half_window(objective: Objective, mosaic: Mosaic, depths: Sequence[float]) -> int:
    """Pixels to each side that hold a point's images at all depths."""
    tangent = objective.aperture / math.sqrt(objective.medium**2 - objective.aperture**2)
    moved = max(abs(dz) for dz in depths) * tangent + objective.spread()
    blur = mosaic.distance * float(np.abs(mosaic.defocus).max()) * mosaic.width / 2
    spread = TAIL * objective.wavelength * mosaic.distance / mosaic.width
    return math.ceil((moved * mosaic.total_magnification + blur + spread) / mosaic.pixel_pitch)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The pupil as a lenslet sees it, and pixels behind it.

    Parameters
    ----------
    u
        Samples across the lenslet, from its middle [m].
    q
        n sin θ along y and x of the rays that go through them.
    amplitude
        (n, n), of a point on the axis, of 1 in the pupil's middle; with the phase of the lenslet's defocus.
    turn
        Phase over samples' place per pixel that the image is away [rad/m].
    half, over
        Pixels to each side, Gauss-Legendre nodes along each of them.
    scale
        Of intensities: a lenslet that is open all over, with cos θ = 1, gives 1 in all (Parseval).
    """

    u: np.ndarray
    q: tuple[np.ndarray, np.ndarray]
    amplitude: np.ndarray
    turn: float
    half: int
    over: int
    scale: float

    @classmethod
    def of(
        cls,
        objective: Objective,
        mosaic: Mosaic,
        lenslet: int,
        half: int,
        fine: Fine | None = None,
    ) -> "View":
        """View of the lenslet of a number, by as many samples and nodes as are needed, or as are given."""
        wave, f, width = objective.wavelength, mosaic.distance, mosaic.width
        center, bend = mosaic.centers[lenslet], np.pi * mosaic.defocus[lenslet] / wave
        per_pixel = 2.2 * mosaic.pixel_pitch * width / (wave * f)
        n, over = fine or (math.ceil((2 * half + 1) * per_pixel) + 8, 1 + math.ceil(per_pixel))
        u = ((np.arange(n) - (n - 1) / 2) / n) * width
        # The pupil's image is upside down.
        step = mosaic.magnification / mosaic.fourier_lens
        qy, qx = -(center[0] + u[:, None]) * step, -(center[1] + u) * step
        q = np.hypot(qy, qx)
        inside = np.clip((objective.aperture - q) / (width / n * step) + 0.5, 0, 1)
        within = np.minimum(1, objective.aperture / np.maximum(q, 1e-300))
        cosine = np.sqrt(1 - (q * within / objective.medium) ** 2)
        amplitude = inside / np.sqrt(cosine) * np.exp(1j * bend * (u[:, None] ** 2 + u**2))
        scale = (mosaic.pixel_pitch * width / (2 * wave * f * n**2)) ** 2
        turn = 2 * np.pi * mosaic.pixel_pitch / (wave * f)
        return cls(u, (qy * within, qx * within), amplitude, turn, half, over, scale)

    def waves(self, middle: float) -> np.ndarray:
        """Waves (pixels · over, n) from the samples to the nodes of pixels around a place [px]."""
        nodes = legendre(self.over)[0] / 2
        fine = np.arange(-self.half, self.half + 1)[:, None] + nodes
        return np.exp(-1j * self.turn * np.outer(fine.ravel() - middle, self.u))

    def pixels(self, light: np.ndarray) -> np.ndarray:
        """Pixels of intensities on their nodes."""
        count, weights = 2 * self.half + 1, legendre(self.over)[1]
        parts = light.reshape(count, self.over, count, self.over)
        return np.einsum("yixj,i,j->yx", parts, weights, weights, optimize=True) * self.scale


@lru_cache(maxsize=64)
def legendre(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss and Legendre from -1 to 1."""
    return np.polynomial.legendre.leggauss(count)


def image_behind(view: View, objective: Objective, rest: np.ndarray, dz: float) -> np.ndarray:
    """Image (2 half + 1)² behind a lenslet, of a point that sends 1 through a whole one on the axis.

    Around the pixel that stands `rest` [px] before the point's place, at depth `dz` [m].
    """
    pupil = view.amplitude * np.exp(1j * objective.phase(*view.q, dz))
    field = view.waves(rest[0]) @ pupil @ view.waves(rest[1]).T
    return view.pixels(np.square(np.abs(field)))
