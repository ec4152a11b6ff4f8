"""Raw images of points by full propagations, without the periodic operator or any part of it.

Both are paraxial, as the operator is. No window cuts them: what the stop and the array let through ends
with them, so that all of it is on their grids.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j0

import lumigraph as lg
from lumigraph.errors import SamplingWarning
from lumigraph.scene import sources

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Fineness:
    """Samples across the main lens, across a lenslet's pitch, and across a pixel."""

    pupil: int = 768
    lenslet: int = 96
    pixel: int = 6


def by_propagation(
    camera: Any, dz: float, points: Sequence[Point], fineness: Fineness, *, paraxial: bool = True
) -> list[np.ndarray]:
    """Raw image (ny, nx) of each point, for 1 of light on the lenslets, by `lumigraph.propagate`.

    A spherical wave before the main lens, the camera's own elements, and the Fresnel integral as a matrix
    DFT both ways; or, not paraxial, exact spheres and the exact spectrum of plane waves.
    """
    array = camera.relay_train().elements[0]
    width = [e + 2 * camera.lenslets.pitch for e in array.extent]  # hexagons reach beyond the extent
    step = camera.lenslets.pitch / fineness.lenslet
    pupil = lg.Grid.square(fineness.pupil + 8, camera.pupil_diameter / fineness.pupil)
    shape = tuple(2 * round(w / step / 2) for w in width)
    lenslets = lg.Grid((shape[0], shape[1]), step, (step / 2, step / 2))
    sensor, method = _fine(camera, fineness.pixel), "fresnel" if paraxial else "zoom"
    images = []
    with warnings.catch_warnings():  # what is sampled is the product of all phases
        warnings.simplefilter("ignore", SamplingWarning)
        for point in points:
            distance = camera.object_distance + dz
            field = sources.point_source(pupil, camera.wavelength, distance, point, paraxial=paraxial)
            field = camera.lens_train()(field)
            amplitude = np.abs(field.data)  # even; grey at the edge, where its square would lack light
            light = float(amplitude.sum() * amplitude.max() * np.prod(pupil.pitch))
            field = array(lg.propagate(field, camera.separation, method, grid=lenslets))
            field = lg.propagate(field, camera.lenslet_distance, method, grid=sensor)
            images.append(_pixels(np.abs(field.data) ** 2 / light, fineness.pixel))
    return images


def by_quadrature(
    camera: Any, dz: float, points: Sequence[Point], nodes: int, pixel: int = 6
) -> list[np.ndarray]:
    """The same for a round main lens and square lenslets of one kind along the axes.

    The light of the lens is a Hankel transform; behind the lenslets the integral goes over each lenslet's own
    Gauss-Legendre nodes, so that there is no grid whose samples could miss an edge.
    """
    array, L, b = camera.relay_train().elements[0], camera.separation, camera.lenslet_distance
    sensor, squared = _fine(camera, pixel), camera.wavelength * b
    down, across = (_relay(array, k, (sensor.y, sensor.x)[k], nodes, (camera.wavelength, b)) for k in (0, 1))
    lens, images = _Hankel(camera, dz), []
    for y, x in points:
        moved = [c * L / (camera.object_distance + dz) for c in (y, x)]
        radius = np.hypot((down[0] + moved[0])[:, None], across[0] + moved[1])
        bend = [np.exp(1j * np.pi * at**2 / (camera.wavelength * L)) for at in (down[0], across[0])]
        field = (down[1] * bend[0]) @ lens(radius) @ (across[1] * bend[1]).T / squared
        images.append(_pixels(np.abs(field) ** 2, pixel))
    return images


def _relay(
    array: Any, axis: int, at: np.ndarray, nodes: int, optics: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of all lenslets along an axis, and the matrix (at, nodes) of lenslets and the way behind."""
    (wavelength, b), pitch = optics, array.lattice.pitch
    limit, origin = array.extent[axis] / 2 * (1 + 1e-9), array.lattice.origin[axis]
    centers = origin + np.arange(-200, 201) * pitch
    centers = centers[np.abs(centers) <= limit]
    unit, weight = np.polynomial.legendre.leggauss(nodes)
    half = array.fill_factor * pitch / 2
    places = (centers[:, None] + half * unit).ravel()
    lens = np.tile(
        half * weight * np.exp(-1j * np.pi * (half * unit) ** 2 / (wavelength * array.focal_length)),
        len(centers),
    )
    return places, np.exp(1j * np.pi * (at[:, None] - places) ** 2 / (wavelength * b)) * lens


class _Hankel:
    """Amplitude behind a round lens at a radius [m] from a point's image, for 1 of light."""

    def __init__(self, camera: Any, dz: float) -> None:
        wavelength, L, half = camera.wavelength, camera.separation, camera.pupil_diameter / 2
        (lens,) = camera.lens_train().elements
        power = 1 / (camera.object_distance + dz) + 1 / L - 1 / lens.focal_length
        unit, weight = np.polynomial.legendre.leggauss(1200)
        rho, weight = half * (unit + 1) / 2, half / 2 * weight
        pupil = np.exp(1j * np.pi * power * rho**2 / wavelength) * 2 * np.pi * rho * weight
        farthest = 2 * max(camera.lenslets.reach)  # from one corner of the array to the other
        at = np.linspace(0, 1.5 * farthest, 2 + int(1.5 * farthest / (wavelength * L / half / 96)))
        values = np.concatenate(
            [
                j0(2 * np.pi / (wavelength * L) * np.outer(part, rho)) @ pupil
                for part in np.array_split(at, 20)
            ]
        )
        self._spline = CubicSpline(at, values / (wavelength * L * half * np.sqrt(np.pi)))

    def __call__(self, radius: np.ndarray) -> np.ndarray:
        return self._spline(radius)


def _fine(camera: Any, pixel: int) -> lg.Grid:
    """Samples `pixel` to a side in each pixel, where light falls: the raw image is turned by 180°."""
    grid = camera.sensor.grid
    step = grid.pitch[0] / pixel
    shape = grid.shape[0] * pixel, grid.shape[1] * pixel
    first = [-at[-1] - grid.pitch[0] / 2 + step / 2 for at in (grid.y, grid.x)]
    return lg.Grid(shape, step, (first[0] + shape[0] // 2 * step, first[1] + shape[1] // 2 * step))


def _pixels(intensity: np.ndarray, pixel: int) -> np.ndarray:
    """Means over pixels (ny, nx), upright: the spectrum times that of a sample's square, then sums."""
    spectrum = np.fft.rfft2(intensity)
    spectrum *= np.sinc(np.fft.fftfreq(intensity.shape[0]))[:, None] * np.sinc(
        np.fft.rfftfreq(intensity.shape[1])
    )
    smooth = np.fft.irfft2(spectrum, intensity.shape)
    ny, nx = (n // pixel for n in intensity.shape)
    return smooth.reshape(ny, pixel, nx, pixel).mean((1, 3))[::-1, ::-1]
