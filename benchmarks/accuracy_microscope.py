"""Accuracy of light-field microscopes, against sums of quadratures that share no code with their operators.

The objective's field is a Debye integral, scalar or Richards and Wolf's of three dipoles, by Gauss-Legendre
over the angle and a spline over the radius; lenslets and pixels are those of `references.Relay`, each with
nodes of its own, for which nothing wraps round and no edge is missed.
"""

import math
from collections.abc import Iterator, Sequence
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1

import lumigraph as lg
from benchmarks import references
from lumigraph.elements import LensletArray

Place = tuple[float, float]

FINE = references.Fineness(lenslet=640, pixel=12, pupil=1200, spline=32)
BEYOND = 8
"""Lenslets that the reference has beyond those that the sensor sees, to each side: arrays go on there.

Points beside the sensor light them: with 2 of them and 6 nodes in a pixel, 20x/0.5 was off by up to 1.1e-3.
"""


class Dipoles:
    """Fields that the objective makes at the lenslets, of a point at a depth: together 1 of light."""

    def __init__(self, scope: Any, dz: float, farthest: float, fineness: references.Fineness = FINE) -> None:
        self.scope = scope
        (objective,) = scope.objectives
        n, k = objective.index, 2 * np.pi / objective.wavelength
        half = math.asin(objective.numerical_aperture / n)
        unit, weight = np.polynomial.legendre.leggauss(fineness.pupil)
        theta, weight = half * (unit + 1) / 2, half / 2 * weight
        sine, cosine = np.sin(theta), np.cos(theta)
        wave = np.sqrt(cosine) * sine * weight * np.exp(1j * k * n * cosine * dz)
        wave *= np.exp(-1j * k * objective.image_defocus * (n * sine) ** 2 / 2)
        r = np.arange(
            0, farthest, objective.wavelength / (2 * objective.numerical_aperture) / fineness.spline
        )
        argument = k * n * np.outer(r, sine)
        zeroth = j0(argument)
        self.is_vector = objective.model == "vector"
        if self.is_vector:
            first = j1(argument)
            second = np.where(
                argument > 1e-3, 2 * first / np.maximum(argument, 1e-9) - zeroth, argument**2 / 8
            )
            parts = {"sum": zeroth @ (wave * (1 + cosine)), "axial": first @ (wave * sine)}
            parts["difference"] = second @ (wave * (1 - cosine))
        else:
            parts = {"even": zeroth @ wave}
        self.radial = {name: CubicSpline(r, values) for name, values in parts.items()}
        density = (1 + cosine**2) + sine**2 if self.is_vector else np.ones_like(cosine)
        # Parseval over the pupil, q = n sin θ: of what each dipole sends, ∫|E|² sin θ dθ.
        total = 2 * np.pi * (density * sine * weight).sum()
        self.scale = k * n / math.sqrt(total) / scope.magnification

    def fields(self, point: Place) -> Iterator[Any]:
        """Functions ``(y, x)`` of the lenslet plane, one for each field that adds as intensity."""
        M = self.scope.magnification

        def polar(y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            dy, dx = (y / M + point[0])[:, None], x / M + point[1]  # the image is turned by 180°
            return np.hypot(dy, dx), np.arctan2(dy, dx)

        def part(name: str, azimuth: Any) -> Any:
            def field(y: np.ndarray, x: np.ndarray) -> np.ndarray:
                r, phi = polar(y, x)
                return self.scale * self.radial[name](r) * azimuth(phi)

            return field

        if not self.is_vector:
            yield part("even", lambda phi: 1.0)
            return
        for along, across in ((np.cos, np.sin), (lambda p: -np.cos(p), np.sin)):  # dipoles along x and y

            def parallel(y: np.ndarray, x: np.ndarray, along: Any = along) -> np.ndarray:
                r, phi = polar(y, x)
                bent = self.radial["difference"](r) * along(2 * phi)
                return self.scale / 2 * (self.radial["sum"](r) + bent)

            def crossed(y: np.ndarray, x: np.ndarray, across: Any = across) -> np.ndarray:
                r, phi = polar(y, x)
                return self.scale / 2 * self.radial["difference"](r) * across(2 * phi)

            yield from (parallel, crossed)
        for trigonometric in (np.cos, np.sin):  # and along the axis
            yield part("axial", trigonometric)


def points(
    scope: Any, dz: float, at: Sequence[Place], fineness: references.Fineness = FINE, beyond: int = BEYOND
) -> list[np.ndarray]:
    """Raw image (ny, nx) of each point, as a sample of the microscope's ``object_grid`` of intensity 1."""
    part, grid = scope.lenslets, scope.sensor.grid
    array = LensletArray(
        part.lattice(), part.focal_length[0], shape=part.shape, fill_factor=part.fill_factor,
        extent=tuple(e + 2 * beyond * part.pitch for e in part.extent),
    )  # fmt: skip
    pitch = tuple(p / scope.relay_magnification for p in grid.pitch)
    camera: Any = SimpleNamespace(
        wavelength=scope.wavelength, lenslet_distance=scope.lenslet_distance,
        relay_train=lambda: SimpleNamespace(elements=(array,)),
        sensor=SimpleNamespace(grid=type(grid)(grid.shape, pitch)),
    )  # fmt: skip
    relay = references.Relay(camera, fineness)
    assert array.extent is not None  # the catalogue's arrays are finite
    farthest = 1.2 * math.hypot(*array.extent) / scope.magnification
    light, share = Dipoles(scope, dz, farthest, fineness), (part.pitch / 5) ** 2
    (objective,) = scope.objectives
    band = objective.numerical_aperture / scope.magnification / scope.wavelength
    lights = [list(light.fields(point)) for point in at]
    fields = relay.fields([field for own in lights for field in own], band)
    return [share * sum(relay.pixels(np.abs(next(fields)) ** 2) for _ in own) for own in lights]


def _scope(lenslets: dict, sensor: dict, **objective: Any) -> lg.LightFieldMicroscope:
    return lg.LightFieldMicroscope(
        wavelength=525e-9, objective=objective, lenslets={"count": (7, 7), **lenslets}, sensor=sensor
    )


MICROSCOPES = {
    "microscope, 20x/0.5": lambda: _scope(
        {"pitch": 125e-6, "focal_length": 2.5e-3}, {"pixel_pitch": 8e-6},
        magnification=20.0, numerical_aperture=0.5,
    ),
    "microscope, 20x/0.5, whole pixels": lambda: _scope(
        {"pitch": 125e-6, "focal_length": 2.5e-3}, {"pixel_pitch": 125e-6 / 15},
        magnification=20.0, numerical_aperture=0.5,
    ),
    "microscope, 60x/1.2, vector": lambda: lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        lenslets={"count": (7, 7)}, sensor={"shape": (109, 109)}
    ),
}  # fmt: skip
DEPTHS = (-9e-6, 0.0, 4e-6)
SAMPLES = 3
ANYWHERE = {"middle": [(0.1, -0.23), (0.45, 0.5)], "border": [(2.7, 1.2)], "outside": [(4.2, 0.3)]}
"""Points, in lenslets as the object has them."""
INDICES = {"middle": [(10, 10), (9, 11)], "border": [(18, 11)]}
"""Samples of slices."""


def errors(name: str, path: str, dz: float, accuracy: float) -> dict[str, float]:
    """Relative rms error of points anywhere or of samples of slices, the worst of each place."""
    scope = MICROSCOPES[name]()
    if path == "points":
        places = {
            k: [(y * scope.lenslet_size, x * scope.lenslet_size) for y, x in at] for k, at in ANYWHERE.items()
        }
        images = {p: scope.point_image(*p, dz, accuracy=accuracy) for at in places.values() for p in at}
    else:
        operator = scope.operator((dz,), SAMPLES, accuracy=accuracy)
        grid, scale = (
            operator.object_grid,
            (SAMPLES / 5) ** 2,
        )  # of a sample's light to that of `object_grid`'s
        found = {
            k: {(float(grid.y[i]), float(grid.x[j])): (0, i, j) for i, j in at} for k, at in INDICES.items()
        }
        places = {k: list(at) for k, at in found.items()}
        images = {p: operator.psf(index) * scale for at in found.values() for p, index in at.items()}
    every = [p for at in places.values() for p in at]
    truth = dict(zip(every, _truth(name, dz, tuple(every)), strict=True))
    return {k: max(_relative(images[p], truth[p]) for p in at) for k, at in places.items()}


@cache
def _truth(name: str, dz: float, at: tuple[Place, ...]) -> list[np.ndarray]:
    return points(MICROSCOPES[name](), dz, at)


def _relative(image: np.ndarray, reference: np.ndarray) -> float:
    return float(np.linalg.norm(image - reference) / np.linalg.norm(reference))
