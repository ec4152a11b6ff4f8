"""Raw images of planes whose points are hidden in part by screens, before a camera with lenslets.

Samples whose cone passes all screens are seen by the periodic operator; those that are hidden in full give
nothing; of the others each piece has its own wave in the main lens, with what the screens leave of it, and
its own image. All are mutually incoherent.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress
from lumigraph.core.threads import each
from lumigraph.operators.lenslets.points import on_lenslets
from lumigraph.operators.lenslets.relay import SeparableRelay, relay
from lumigraph.operators.periodic.incoherent import PeriodicOperator
from lumigraph.operators.periodic.screens import OPEN, PARTLY, Screen, Shadow
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.cell_axis import MIDDLE
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sample_weights import SampleWeights
from lumigraph.operators.sampling.tiles import readout
from lumigraph.scene import Points

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

FINEST_PIECE = 0.6
"""Largest piece of a plane that sends one wave, over the distance of an operator's points.

These are band-limited; what an edge close before a plane leaves of it is not. Charts with samples of 0.26 to
1.2 of that distance, of which such an edge lets 7 % pass, are off by 2e-3 to 7e-3; by larger pieces 1e-2 to
3e-2.
"""

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
    (plane,), grid, distance = operator.planes, operator.object_grid, camera.object_distance + dz
    assert grid is not None  # of a plane
    points = PartlyHidden(camera, distance, screens)
    passed = points.passed(screens, grid)
    seen = replace(plane, spread=plane.spread @ SampleWeights((passed == OPEN).astype(np.float32)))
    if plane.beyond is not None:  # faint: half of it passes in part
        let = SampleWeights((1 - passed / 2).astype(np.float32))
        seen = replace(seen, beyond=replace(plane.beyond, spread=plane.beyond.spread @ let))
    image = replace(operator, planes=(seen,)).forward(intensity)
    bright = DIM * operator.accuracy / 1e-3 * np.abs(intensity).max(initial=0)
    lit = np.where((passed == PARTLY) & (np.abs(intensity) > bright), intensity, 0)
    positions, light = _pieces(grid, lit, FINEST_PIECE * points.finest)
    light *= math.prod(grid.pitch) * (camera.separation / distance) ** 2
    return image, points.image(on_lenslets(points.optics, positions, distance), light, progress)


def _pieces(grid: Grid, lit: np.ndarray, largest: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) [m] and light (n,) of a plane's bright samples, in pieces no larger than so much.

    Larger samples are divided; those that the main lens resolves count as no larger than what it does. Some
    smaller ones are taken together, in the middle of their light, to half a sample: shadows know places along
    each axis.
    """
    together = [max(1, math.floor(largest / p)) for p in grid.pitch]
    ny, nx = (math.ceil(n / t) for n, t in zip(lit.shape, together, strict=True))
    whole = np.zeros((ny * together[0], nx * together[1]))
    whole[: lit.shape[0], : lit.shape[1]] = lit
    light = whole.reshape(ny, together[0], nx, together[1])
    rows, columns = np.nonzero(total := light.sum((1, 3)))
    places = []
    for axis, number in enumerate((rows, columns)):
        steps = np.arange(together[axis]).reshape((-1, 1, 1) if axis == 0 else (-1,))
        middle = (light * steps).sum((1, 3))[rows, columns] / total[rows, columns]
        middle = np.clip(np.round(2 * middle) / 2, 0, together[axis] - 1)
        first = (grid.y, grid.x)[axis][0] + number * together[axis] * grid.pitch[axis]
        places.append(first + middle * grid.pitch[axis])
    sizes = [min(p, largest * _cells.OVERSAMPLING / FINEST_PIECE) for p in grid.pitch]
    parts = [max(1, math.ceil(size / largest - 1e-6)) for size in sizes]
    inside = [((np.arange(k) + 0.5) / k - 0.5) * size for k, size in zip(parts, sizes, strict=True)]
    found = [np.stack([places[0] + y, places[1] + x], 1) for y in inside[0] for x in inside[1]]
    return np.concatenate(found), np.tile(total[rows, columns] / math.prod(parts), math.prod(parts))


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
    """

    def __init__(self, camera: CameraOptics, distance: float, screens: Sequence[Screen]) -> None:
        self.optics = optics = Optics.of(camera, distance, ACCURACY)
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

    @property
    def finest(self) -> float:
        """Distance of an operator's points in the plane [m]."""
        axes, scale = self.optics.axes, self.optics.distance / self.optics.camera.separation
        return max(axis.size / axis.points for axis in axes) * scale

    def passed(self, screens: Sequence[Screen], grid: Grid) -> np.ndarray:
        """`OPEN`, `PARTLY` or `HIDDEN` (y, x) for samples of the plane, past screens as they stand."""
        found = np.full(grid.shape, OPEN, np.uint8)
        for screen in screens:
            if screen.distance < self.optics.distance:
                shadow = Shadow(screen, self.optics.distance, self.optics.camera.wavelength, self.pupil)
                found = np.maximum(found, shadow.passes(grid.y, grid.x))
        return found

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
        wave, at = self.wave, place * (-self.optics.distance / self.optics.camera.separation)
        for shadow in self.cast:
            wave = wave * shadow.amplitude(float(at[0]), float(at[1]))
        down, across = (np.exp(-self._turn * self.pupil * d).astype(np.complex64) for d in off)
        return down[:, None] * wave * across

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
        if isinstance(self.relay, SeparableRelay):
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
    wave = _cells.over_lens(camera, lens, distance, grid)
    bright = np.abs(wave)  # grey at the edge, as the part of a sample that is open
    light = bright.sum() * bright.max() * (squared / step) ** 2
    return grid.y, (wave / math.sqrt(light)).astype(np.complex64)
