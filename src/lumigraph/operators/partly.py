"""Raw images of planes whose points are hidden in part by screens, before a camera with lenslets.

Points whose cone passes all screens are seen by the periodic operator; those that are hidden in full give
nothing; of the others each has its own wave in the main lens, with what the screens leave of it, and its own
image. All are mutually incoherent.
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress
from lumigraph.core.threads import each
from lumigraph.errors import SamplingWarning
from lumigraph.operators import cells as _cells
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.cell_response import MIDDLE
from lumigraph.operators.let import Let
from lumigraph.operators.optics import Optics
from lumigraph.operators.periodic import PeriodicOperator
from lumigraph.operators.points import on_lenslets
from lumigraph.operators.relay import Straight, relay
from lumigraph.operators.screens import OPEN, PARTLY, Screen, Shadow
from lumigraph.operators.tiles import readout
from lumigraph.scene import Points, sources

ACCURACY = 1e-2
"""Of the images of points that are hidden in part."""

WIDER = 1.3
"""Samples across the main lens, over those that its light needs."""

MORE = 0
"""Cells on each side, beside those that a point lights where nothing hides it: edges send light aside."""

DIM = 1e-3
"""Points that are dimmer than this, of the brightest, times the accuracy over 1e-3, are left out."""

_AT_A_TIME = 16
"""Points whose waves are held together."""

_LOOKS = 4
"""Places in a sample, along each axis, that neighbouring points look past the screens from."""

Pair = tuple[int, int]


def plane_image(
    operator: PeriodicOperator,
    camera: CameraOptics,
    dz: float,
    intensity: np.ndarray,
    screens: Sequence[Screen],
    progress: Progress,
) -> tuple[np.ndarray, np.ndarray]:
    """Raw images (ny, nx) of a plane behind screens: of points that are seen in full, and of those in part.

    Parameters
    ----------
    operator
        Of the plane, where nothing hides it.
    camera, dz
        That it is of, and the plane's depth [m].
    intensity
        (y, x) on the operator's samples.
    screens
        Those that stand before the plane are seen.
    progress
        Called with the part that is done.
    """
    (plane,), cells = operator.planes, operator.cells
    ring = (cells.ring[0] + plane.matrix.margin[0], cells.ring[1] + plane.matrix.margin[1])
    places, distance = cells.grid(cells.points, 1.0, ring), camera.object_distance + dz
    points = PartlyHidden(camera, distance, screens, max(places.pitch) * distance / camera.separation)
    passed = points.passed(places.y, places.x)
    sent = arrays.to_numpy(plane.spread.forward(intensity))
    seen = replace(plane, spread=Let((passed == OPEN).astype(np.float32)) @ plane.spread)
    if plane.beyond is not None and operator.object_grid is not None:
        let = Let(_through(operator.object_grid, points, screens))
        seen = replace(seen, beyond=replace(plane.beyond, spread=plane.beyond.spread @ let))
    image = replace(operator, planes=(seen,)).forward(intensity)
    bright = DIM * operator.accuracy / 1e-3 * np.abs(sent).max(initial=0)
    rows, columns = np.nonzero((passed == PARTLY) & (np.abs(sent) > bright))
    light = sent[rows, columns] * math.prod(places.pitch)
    return image, points.image(np.stack([places.y[rows], places.x[columns]], 1), light, progress)


def _through(grid: Grid, points: "PartlyHidden", screens: Sequence[Screen]) -> np.ndarray:
    """1 for samples (y, x) of a plane that are seen, 0 for hidden ones, 1/2 in part: for faint light."""
    through, optics = np.ones(grid.shape, np.float32), points.optics
    for screen in screens:
        if screen.distance < optics.distance:
            shadow = Shadow(screen, optics.distance, optics.camera.wavelength, points.pupil)
            through *= 1 - shadow.passes(grid.y, grid.x) / 2
    return through.astype(np.float32)


def points_image(
    camera: CameraOptics, points: Points, screens: Sequence[Screen], progress: Progress
) -> np.ndarray:
    """Raw image (ny, nx) of points of one depth behind screens."""
    distance = camera.object_distance + float(points.positions[0, 2])
    behind = PartlyHidden(camera, distance, screens)
    share = (camera.object_pitch * camera.separation / distance) ** 2
    places = on_lenslets(behind.optics, points.positions[:, :2], distance)
    return behind.image(places, share * points.intensities, progress)


class PartlyHidden:
    """Points of one plane whose light screens stop in part, before a camera with lenslets.

    Parameters
    ----------
    camera, distance
        The camera, and the plane to its main lens [m].
    screens
        Those that stand before the plane are seen.
    step
        Between the points, where they are samples of a plane [m].
    """

    def __init__(
        self, camera: CameraOptics, distance: float, screens: Sequence[Screen], step: float = 0.0
    ) -> None:
        self.optics, self.step = Optics.of(camera, distance, ACCURACY), step
        optics = self.optics
        (y, x), cells = optics.axes, optics.cells
        self.reach = [r + MORE for r in optics.reach]
        widest = max(
            (2 * r + 1) * size + 2 * axis.neighbourhood
            for r, size, axis in zip(self.reach, cells.size, (y, x), strict=True)
        )
        count = 2 * math.ceil(WIDER * widest / _cells.airy(camera) / 2)
        self.pupil, self.wave = _pupil(camera, distance, count)
        self.cast = [
            Shadow(screen.turned(optics.rotation), distance, camera.wavelength, self.pupil)
            for screen in screens
            if screen.distance < distance
        ]
        self.relay = relay(optics)
        self._behind: dict[tuple[int, int], np.ndarray] = {}

    def passed(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """`OPEN`, `PARTLY` or `HIDDEN` (y, x) for points imaged at all y and x of the lenslet plane [m]."""
        scale = -self.optics.distance / self.optics.camera.separation
        found = [shadow.passes(scale * y, scale * x) for shadow in self.cast]
        return np.maximum.reduce([np.full((len(y), len(x)), OPEN, np.uint8), *found])

    def image(self, places: np.ndarray, light: np.ndarray, progress: Progress) -> np.ndarray:
        """Raw image (ny, nx) of points imaged at places (n, 2), of so much light each."""
        optics, cells = self.optics, self.optics.cells
        total = np.zeros([n * k for n, k in zip(cells.image, cells.samples, strict=True)], np.float32)
        groups = list(self._groups(places))
        pieces = ((rows, columns, places[mine], light[mine]) for rows, columns, mine in groups)
        for k, (corner, image) in enumerate(each(lambda piece: self._piece(*piece), pieces)):
            total[corner[0] : corner[0] + image.shape[0], corner[1] : corner[1] + image.shape[1]] += image
            progress((k + 1) / len(groups))
        return readout(optics).forward(total / np.float32(optics.image_scale**2))

    def _groups(self, places: np.ndarray) -> Iterator[tuple[range, range, np.ndarray]]:
        """Rows and columns of cells that points light, and the numbers of these points."""
        cells = self.optics.cells
        number = np.floor((places - cells.edge) / cells.size).astype(int) + cells.ring
        keys, inverse = np.unique(number, axis=0, return_inverse=True)
        for k, cell in enumerate(keys.tolist()):
            rows, columns = (
                range(max(0, c - r), min(n, c + r + 1))
                for c, r, n in zip(cell, self.reach, cells.image, strict=True)
            )
            if rows and columns:
                yield rows, columns, np.flatnonzero(inverse.ravel() == k)

    def _piece(
        self, rows: range, columns: range, places: np.ndarray, light: np.ndarray
    ) -> tuple[Pair, np.ndarray]:
        """First sample and image (samples, samples) on some cells."""
        (ky, kx) = self.optics.cells.samples
        middle = places.mean(0)
        image = np.zeros((len(rows) * ky, len(columns) * kx), np.float32)
        for start in range(0, len(places), _AT_A_TIME):
            mine = slice(start, start + _AT_A_TIME)
            waves = np.stack([self._wave(place, place - middle) for place in places[mine]])
            for share, field in zip(light[mine], self._fields(waves, rows, columns, middle), strict=True):
                image += np.float32(share) * (np.real(field) ** 2 + np.imag(field) ** 2)
        return (rows.start * ky, columns.start * kx), image

    def _wave(self, place: np.ndarray, off: np.ndarray) -> np.ndarray:
        """In the main lens (pupil, pupil), of a point whose image is `off` the origin [m]."""
        wave, at = self.wave, self._seen_from(place)
        for shadow in self.cast:
            wave = wave * shadow.amplitude(float(at[0]), float(at[1]))
        down, across = (np.exp(-self._turn * self.pupil * d).astype(np.complex64) for d in off)
        return down[:, None] * wave * across

    def _seen_from(self, place: np.ndarray) -> np.ndarray:
        """Where in its sample a point imaged at a place looks past the screens from [m].

        Points next to each other look from different places, so that their mean is one over areas, as fringes
        finer than samples need it.
        """
        at = place * (-self.optics.distance / self.optics.camera.separation)
        if not self.step:
            return at
        y, x = np.floor(at / self.step).astype(int)
        order = np.array([2 * y + x, y + 2 * x]) % _LOOKS
        return at + ((order + 0.5) / _LOOKS - 0.5) * self.step

    @property
    def _turn(self) -> complex:
        return -2j * np.pi / (self.optics.camera.wavelength * self.optics.camera.separation)

    def _fields(
        self, waves: np.ndarray, rows: range, columns: range, middle: np.ndarray
    ) -> Iterator[np.ndarray]:
        """Amplitude on the samples of some cells, of each wave in the main lens."""
        y, x = self.relay.places(rows, columns)
        down, across = (
            np.exp(self._turn * np.outer(at - m, self.pupil)).astype(np.complex64)
            for at, m in zip((y, x), middle, strict=True)
        )
        if isinstance(self.relay, Straight):
            down = self.relay.along(0, down[None], rows, MIDDLE)[0]
            across = self.relay.along(1, across[None], columns, MIDDLE)[0]
            yield from down @ (waves @ across.T)
            return
        for wave in waves:
            yield self.relay.field(down @ (wave @ across.T), rows, columns)


def _pupil(camera: CameraOptics, distance: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples along the main lens [m], and the wave there (pupil, pupil) of a point, for light of 1."""
    lens, step = _cells.lens(camera), camera.pupil_diameter / count
    squared = camera.wavelength * camera.separation
    grid = Grid((count + 2, count + 2), (step, step), (step / 2, step / 2))
    with warnings.catch_warnings():  # what is sampled is the product of all phases
        warnings.simplefilter("ignore", SamplingWarning)
        point = sources.point_source(grid, camera.wavelength, distance, paraxial=True)
        wave = lens(point).data
    wave = wave * np.outer(*(np.exp(1j * np.pi * c**2 / squared) for c in (grid.y, grid.x)))
    bright = np.abs(wave)  # grey at the edge, as the part of a sample that is open
    light = bright.sum() * bright.max() * (squared / step) ** 2
    return grid.y, (wave / math.sqrt(light)).astype(np.complex64)
