"""Raw images of points before a camera with lenslets, wherever they are: each its own, straight away.

A point lights few lenslets; cells of the image that get less than the accuracy asks for are left dark.
"""

import math
from collections.abc import Iterator
from itertools import repeat

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.operators.lenslets.point_light import PointLight, SampledPupilLight, point_light
from lumigraph.operators.lenslets.relay import Relay, RelaySet, relay
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.glass_distortion import seen_points
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sampling_rules import COARSEST, FINEST
from lumigraph.operators.sampling.tiles import readout
from lumigraph.scene import Points

LEFT_OUT = 0.3
"""Part of the accuracy that cells may have that are left dark."""

FINER, ALIKE = 4.0, 1.05
"""How much more exact the image is that one is set beside; how much more it is off than the two are apart."""

COARSER, AS_WELL = 4.0, 0.6
"""Where none is finer, how much less exact the image is, and the part of the error that it has as well."""

OUTSIDE = 0.1
"""Factor of the accuracy for points beyond the array: the little of their light that arrives is all."""

SPARE = 0.5
"""Of the accuracy, what single points are computed to: they cost little, and stand near borders too."""

TELLING = 1e-3
"""Accuracy to which images are computed that tell lenses apart, at best: they are off alike."""

_PER_CELL = 4
"""Samples along a cell that tell how bright it is."""


@single_products()
def points_image(
    camera: HasOptics, points: Points, accuracy: float, known: RelaySet | None = None
) -> np.ndarray:
    """Raw image (ny, nx), to a relative rms error of `accuracy`; relays that are `known` are used again."""
    camera, points = seen_points(camera.optics(), points)
    known = RelaySet() if known is None else known
    total = np.zeros(camera.sensor.shape, np.float32)
    for dz in np.unique(points.positions[:, 2]):
        mine = points.positions[:, 2] == dz
        positions, intensities = points.positions[mine, :2], points.intensities[mine]
        lenslets = known.of(camera, float(dz), max(SPARE * accuracy, FINEST))
        within = _within(lenslets.optics, on_lenslets(lenslets.optics, positions, lenslets.optics.distance))
        if within.any():
            total += _plane_image(lenslets, positions[within], intensities[within])
        if not within.all():
            finer = known.of(camera, float(dz), max(accuracy * OUTSIDE, FINEST))
            total += _plane_image(finer, positions[~within], intensities[~within])
    return total


def image_and_error(camera: HasOptics, points: Points, accuracy: float) -> tuple[np.ndarray, float]:
    """`points_image`, and its relative rms error: of the brightest point, beside a finer image of it."""
    camera, points = seen_points(camera.optics(), points)
    known = RelaySet()
    image = points_image(camera, points, accuracy, known)
    if not np.any(points.intensities):
        return image, 0.0
    optics = Optics.of(camera, camera.object_distance, accuracy)
    places = on_lenslets(optics, points.positions[:, :2], camera.object_distance + points.positions[:, 2])
    within = _within(optics, places)
    k = int(np.argmax(np.where(within, points.intensities, 0)))  # some point, if none is
    one = Points(points.positions[k : k + 1], points.intensities[k : k + 1])
    alone = image if len(points.intensities) == 1 else points_image(camera, one, accuracy, known)
    other, more = accuracy / FINER, ALIKE
    if other * (SPARE if within[k] else OUTSIDE) < FINEST:
        other = min(accuracy * COARSER, COARSEST / SPARE)
        more = 1 / (other / accuracy - AS_WELL)
    off = np.linalg.norm(points_image(camera, one, other) - alone)
    return image, more * float(off) / (float(np.linalg.norm(alone)) or 1.0)


def _within(optics: Optics, places: np.ndarray) -> np.ndarray:
    """Which places (n, 2) lie in cells of the array."""
    cells = optics.cells
    low = np.array(cells.edge)
    return np.all((places >= low) & (places <= low + np.array(cells.size) * cells.count), axis=1)


def _plane_image(lenslets: Relay, positions: np.ndarray, intensities: np.ndarray) -> np.ndarray:
    """Raw image (ny, nx) of points (n, 2) of one depth."""
    optics = lenslets.optics
    image = np.zeros([n * k for n, k in zip(optics.cells.image, optics.cells.samples, strict=True)])
    places = on_lenslets(optics, positions, optics.distance)
    lights = _lights(optics, positions, places, farthest(optics, places))
    for light, place, intensity in zip(lights, places, intensities, strict=True):
        _add(image, lenslets, light, place, float(intensity))
    return readout(optics).forward(image.astype(np.float32))


def _lights(
    optics: Optics, positions: np.ndarray, places: np.ndarray, farthest: float
) -> Iterator[PointLight]:
    """Of each point (n, 2), imaged at its place: as exactly oblique, or aberrated, as it is there."""
    camera, distance = optics.camera, optics.distance
    varies = field_lenses.plate_of(camera) is not None
    if camera.model != "exact" and not varies:
        yield from repeat(point_light(camera, distance, farthest), len(places))
        return
    for position, place in zip(positions.tolist(), places.tolist(), strict=True):
        mine = field_lenses.at(camera, position[0] / distance, position[1] / distance) if varies else camera
        yield point_light(mine, distance, farthest, (place[0], place[1]))


def on_lenslets(optics: Optics, positions: np.ndarray, distance: float | np.ndarray) -> np.ndarray:
    """Images (n, 2) in the lenslet plane of points (n, 2) [m], in the frame that turns with the lenslets."""
    sin, cos = math.sin(optics.rotation), math.cos(optics.rotation)
    y, x = -optics.camera.separation / distance * positions.T
    return np.stack([y * cos - x * sin, y * sin + x * cos], axis=1)


def farthest(optics: Optics, places: np.ndarray) -> float:
    """From any of the places to any light that the image's cells see [m]."""
    cells, reach = optics.cells, 0.0
    for edge, n, ring, size, axis, at in zip(
        cells.edge, cells.count, cells.ring, cells.size, optics.axes, places.T, strict=True
    ):
        low = edge - ring * size - axis.neighbourhood - size
        high = edge + (n + ring) * size + axis.neighbourhood + size
        reach = math.hypot(reach, max(high - at.min(), at.max() - low))
    return reach


def _add(image: np.ndarray, lenslets: Relay, light: PointLight, place: np.ndarray, intensity: float) -> None:
    """A point's image, added to the samples of all cells."""
    optics = lenslets.optics
    rows, columns = lit_cells(optics, light, place)
    y, x = lenslets.places(rows, columns)
    field = lenslets.field(light.at(y - place[0], x - place[1]).astype(np.complex64), rows, columns)
    (ky, kx) = optics.cells.samples
    image[rows.start * ky : rows.stop * ky, columns.start * kx : columns.stop * kx] += (
        intensity * share(optics) * np.abs(field) ** 2
    )


def share(optics: Optics) -> float:
    """Intensity of the image over that of light of 1, of a point of intensity 1."""
    size = optics.camera.object_pitch * optics.camera.separation / optics.distance
    return (size / optics.image_scale) ** 2


def lit_cells(optics: Optics, light: PointLight, place: np.ndarray) -> tuple[range, range]:
    """Rows and columns of the image's cells that all but `LEFT_OUT` of the accuracy lies in."""
    cells, far = optics.cells, []
    axes = [
        edge - ring * size + (np.arange((n + 2 * ring) * _PER_CELL) + 0.5) / _PER_CELL * size - at
        for edge, ring, size, n, at in zip(
            cells.edge, cells.ring, cells.size, cells.count, place, strict=True
        )
    ]
    bright = np.abs(light.at(axes[0], axes[1])) ** 2
    (ny, nx) = cells.image
    bright = bright.reshape(ny, _PER_CELL, nx, _PER_CELL).mean((1, 3)) ** 2
    (ry, rx) = cells.ring  # where there are no lenslets
    bright[:ry], bright[ny - ry :], bright[:, :rx], bright[:, nx - rx :] = 0, 0, 0, 0
    budget = (LEFT_OUT * optics.fineness.accuracy) ** 2 * bright.sum() / 4
    for k, n in enumerate(cells.image):
        spill = math.ceil((optics.spill + optics.fineness.ring * optics.array.lattice.pitch) / cells.size[k])
        line = bright.sum(1 - k)
        first = int(np.searchsorted(np.cumsum(line), budget))
        last = n - 1 - int(np.searchsorted(np.cumsum(line[::-1]), budget))
        far.append(range(max(0, first - spill), min(n, last + spill + 1)))
    return far[0], far[1]


TOLD = ((0.13, -0.21), (-0.38, 0.44))
"""Places in a lenslet, of its pitch, of the points whose images tell lenses apart."""

COARSE_PUPIL = 256
"""Samples across lenses that are set beside each other: all are sampled alike."""


def seen(camera: CameraOptics, distance: float, accuracy: float) -> field_lenses.Image:
    """Images of two points amid the array by lenses of a camera; see `varying`."""
    optics = Optics.of(camera, distance, max(accuracy, TELLING))
    lenslets, pitch = relay(optics), optics.array.lattice.pitch
    middle = np.array(optics.cells.middle(optics.cells.kind))
    places = [middle + pitch * np.array(part) for part in TOLD]
    reach = farthest(optics, np.array(places))

    def light(one: CameraOptics) -> PointLight:
        return SampledPupilLight(one, _cells.lens(one), distance, reach, COARSE_PUPIL)  # all in one way

    lit = [lit_cells(optics, light(one), places[0]) for one in field_lenses.some(camera)]
    rows, columns = (range(min(r[k].start for r in lit), max(r[k].stop for r in lit)) for k in (0, 1))
    y, x = lenslets.places(rows, columns)

    def image(one: CameraOptics) -> np.ndarray:
        of = light(one)
        fields = (
            lenslets.field(of.at(y - p[0], x - p[1]).astype(np.complex64), rows, columns) for p in places
        )
        return np.concatenate([np.abs(field).ravel() ** 2 for field in fields])

    return image
