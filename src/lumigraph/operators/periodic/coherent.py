r"""Raw images of planes in coherent light: object, stop, lenslets and image, each by its own quadrature.

The main lens' stop is a tensor rule of Gauss-Legendre nodes, whose light is

.. math:: U(u) = \frac{1}{\lambda z} \int a(x) \, e^{i \pi (u - x)^2 / (\lambda z)} \, d^2x

of the object's samples; it goes to wherever the lenslets' quadratures ask for it. No grid repeats the light,
and no edge is missed.
"""

import math
import time
from collections.abc import Iterator

import numpy as np
from numpy.polynomial import legendre

from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Needs, Progress, Stage, silent, within
from lumigraph.elements import ThinLens, ZernikePlate
from lumigraph.errors import SamplingError
from lumigraph.operators.lenslets.relay import relay
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.band import HALF_WIDTH
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.resampling import averaged
from lumigraph.operators.sampling.tiles import readout

TOGETHER = 2.0**22
"""Places in the plane behind the main lens whose light is held at a time."""

_IN_STOP = 0.5  # of the time, that light takes to the stop
OVERSAMPLING = 1.5
"""How much closer than λL/(2D) a single lens' image is sampled, for a short kernel to the pixels."""


def is_followed(camera: HasOptics) -> bool:
    """True if coherent light is followed exactly: by a lens and plates, to lenslets that are not turned."""
    plain = camera.optics()
    if plain.lattice is not None and plain.lattice.rotation:
        return False
    return all(isinstance(element, ThinLens | ZernikePlate) for element in plain.lens.elements)


def coherent_image(
    camera: HasOptics, amplitude: np.ndarray, grid: Grid, dz: float, accuracy: float,
    progress: Progress = silent, *, times: int = 1,
) -> np.ndarray:  # fmt: skip
    """Raw image (ny, nx) of a plane's complex amplitude (..., y, x), which one wave along the axis has lit.

    Parameters
    ----------
    camera
        One that `is_followed`.
    amplitude, grid, dz
        Samples of the plane, where they stand, and its depth from the focused plane [m]. Intensities of
        leading axes add: they are coherent modes.
    accuracy
        How far lenslets' light is followed, as for incoherent light.
    progress
        Called as ``progress(fraction)``, with the number of modes and the memory of their light.
    times
        Number of such images that are made one after the other, for the time that `progress` is told.
    """
    plain = camera.optics()
    distance, modes = plain.object_distance + dz, np.reshape(amplitude, (-1, *grid.shape))
    if plain.lattice is None:
        return _on_sensor(plain, modes, (grid, distance), progress)
    optics = Optics.of(plain, distance, accuracy)
    lenslets, (rows, columns), (ky, kx) = relay(optics), optics.cells.image, optics.cells.samples
    y, x = lenslets.places(range(rows), range(columns))
    stop = _Stop(plain, distance, grid, _farthest(y, x))
    lights = stop.lights(modes, within(progress, 0.0, _IN_STOP), times)
    image, rest = np.zeros((rows * ky, columns * kx), np.float32), within(progress, _IN_STOP, 1.0)
    step = max(1, int(rows * TOGETHER / (len(y) * len(x))))
    for first in range(0, rows, step):
        mine = range(first, min(first + step, rows))
        y, x = lenslets.places(mine, range(columns))
        for light in stop.behind(lights, y, x):
            field = lenslets.field(light, mine, range(columns))
            image[mine.start * ky : mine.stop * ky] += np.abs(field) ** 2
        rest(Stage(mine.stop / rows, stop.needs(len(modes))))
    return readout(optics).forward(image / np.float32(optics.image_scale**2))


def _on_sensor(
    camera: CameraOptics, modes: np.ndarray, plane: tuple[Grid, float], progress: Progress
) -> np.ndarray:
    """Raw image of a camera without lenslets; `plane`: samples and distance of the modes."""
    (grid, distance), rest = plane, within(progress, _IN_STOP, 1.0)
    pixels, pitch = camera.sensor.grid, _cells.airy(camera) / (2 * OVERSAMPLING)
    ny, nx = (math.ceil(size / pitch) + 2 * HALF_WIDTH + 2 for size in pixels.size)
    image_grid = Grid(
        (ny, nx), (pitch, pitch), (-pixels.center[0], -pixels.center[1])
    )  # pixels are turned by 180°
    stop, image = (
        _Stop(camera, distance, grid, _farthest(image_grid.y, image_grid.x)),
        np.zeros((ny, nx), np.float32),
    )
    lights, step = stop.lights(modes, within(progress, 0.0, _IN_STOP)), max(1, int(TOGETHER / nx))
    for first in range(0, ny, step):
        mine = slice(first, first + step)
        for light in stop.behind(lights, image_grid.y[mine], image_grid.x):
            image[mine] += np.abs(light) ** 2
        rest(Stage(min(1.0, (first + step) / ny), stop.needs(len(modes))))
    return averaged(image_grid, pixels, camera.sensor.fill_factor).forward(image)


def _farthest(y: np.ndarray, x: np.ndarray) -> float:
    """Farthest coordinate of places along an axis [m]."""
    return float(max(np.abs(y).max(), np.abs(x).max()))


class _Stop:
    """Light in the main lens' stop, on nodes (v, u) of a disc, of a plane of samples at a distance [m].

    `farthest` is how far from the axis its light is asked for behind the lens [m].
    """

    def __init__(self, camera: CameraOptics, distance: float, grid: Grid, farthest: float) -> None:
        self.camera, self.distance, self.grid = camera, distance, grid
        half = camera.pupil_diameter / 2
        angles, x, share = disc(self._count(farthest))
        self.v, self.u = half * np.sin(angles), half * x
        self.weight = share * (math.pi * half**2)

    def size(self, count: int) -> float:
        """Bytes of the light of some modes."""
        return 8.0 * count * len(self.v) * len(self.u)

    def needs(self, count: int) -> str:
        """Number of modes and their memory, in words."""
        return f"{count} modes, {memory.told(self.size(count))}" if count > 1 else ""

    def lights(self, modes: np.ndarray, progress: Progress, times: int = 1) -> list[np.ndarray]:
        """Light of each of several planes (modes, y, x), where they fit in memory."""
        memory.require(
            self.size(len(modes)), f"light of {len(modes)} modes in the stop",
            "Use fewer modes, a smaller object or a smaller stop.", SamplingError,
        )  # fmt: skip
        found = [self._first(modes, progress, times)]
        for mode in modes[1:]:
            progress(Stage(len(found) / len(modes), self.needs(len(modes))))
            found.append(self.light(mode))
        return found

    def _first(self, modes: np.ndarray, progress: Progress, times: int) -> np.ndarray:
        """Light of the first mode, whose time says what all of them take."""
        began = time.perf_counter()
        found = self.light(modes[0])
        seconds = (time.perf_counter() - began) * len(modes) / _IN_STOP * times
        if len(modes) > 1:
            progress(Needs(0.0, f"{self.needs(len(modes))}, about {max(seconds, 1):.0f} s"))
        return found

    def light(self, amplitude: np.ndarray) -> np.ndarray:
        """Light at the nodes, times their weights: for an even amplitude of 1, 1 arrives on the lenslets."""
        squared, grid = self.camera.wavelength * self.distance, self.grid
        down, across = (
            np.exp(1j * np.pi / squared * (c**2 - 2 * nodes[:, None] * c)).astype(np.complex64)
            for nodes, c in ((self.v, grid.y), (self.u, grid.x))
        )
        found = down @ np.asarray(amplitude, np.complex64) @ across.T
        scale = math.prod(grid.pitch) / squared * self.camera.separation / self.distance
        phase = _phase(self.camera, self.distance, self.v[:, None], self.u)
        return (found * np.exp(1j * phase) * (self.weight * scale)).astype(np.complex64)

    def behind(self, lights: list[np.ndarray], y: np.ndarray, x: np.ndarray) -> Iterator[np.ndarray]:
        """Amplitudes at places (y, x) at the distance L behind the lens, without the phase exp(iπw²/(λL))."""
        squared = self.camera.wavelength * self.camera.separation
        down, across = (
            np.exp(-2j * np.pi / squared * np.multiply.outer(at, nodes)).astype(np.complex64)
            for at, nodes in ((y, self.v), (x, self.u))
        )
        for light in lights:
            yield down @ (light @ across.T) / np.float32(squared)

    def _count(self, farthest: float) -> int:
        """Nodes along each axis: as many as the phase has radians from the middle to the edge, and some."""
        camera, grid, half = self.camera, self.grid, self.camera.pupil_diameter / 2
        seen = max(size / 2 + abs(center) for size, center in zip(grid.size, grid.center, strict=True))
        tilt = 2 * math.pi / camera.wavelength * half * (seen / self.distance + farthest / camera.separation)
        edge = half * np.array([0.98, 1.0])
        bend = np.abs(np.diff(_phase(camera, self.distance, np.zeros(2), edge)))[0] / 0.02
        radians = tilt + float(bend)
        count = 48 + math.ceil(1.1 * radians + 4 * radians ** (1 / 3))
        memory.require(
            64.0 * count**2, "light in the stop", "Use a smaller object or sensor, or a smaller stop.",
            SamplingError,
        )  # fmt: skip
        return count


def _phase(camera: CameraOptics, distance: float, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Phase [rad] in the stop of what is no tilt: defocus and aberrations, of a plane at a distance [m]."""
    power, plates = 1 / distance + 1 / camera.separation, 0.0
    for element in camera.lens.elements:
        if isinstance(element, ThinLens):
            power -= 1 / element.focal_length
        elif isinstance(element, ZernikePlate):
            plates = plates + element.phase(y, x)
    return np.pi / camera.wavelength * power * (y**2 + x**2) + plates


def disc(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (count,), places along x (count,), and weights (angles, places) of means over the unit disc.

    Nodes stand at (sin angle, place). Exact for polynomials of a degree below `count` along x.

    Examples
    --------
    >>> t, x, w = disc(12)
    >>> round(float(w.sum()), 12), round(float(np.sin(t) ** 2 @ w @ x**2), 8)  # 1, and 1/24
    (1.0, 0.04166667)
    """
    x, weight = legendre.leggauss(count)
    angles, chord = np.pi / 2 * x, np.cos(np.pi / 2 * x)
    at_nodes, at_ends = legendre.legvander(x, count - 1), legendre.legvander(chord, count)
    # The integral of P_k over a chord is 2 (P_{k+1} - P_{k-1}) / (2k + 1) for even k, and 0 for odd.
    integrals = at_ends[:, 1:].copy()
    integrals[:, 1:] -= at_ends[:, : count - 1]
    integrals[:, 1::2] = 0
    rows = integrals @ (at_nodes.T * weight)
    return angles, x, rows * (np.pi / 2 * weight * chord)[:, None] / np.pi
