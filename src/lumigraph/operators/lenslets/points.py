"""Raw images of points before a camera with lenslets, wherever they are: each its own, straight away.

A point lights few lenslets; cells of the image that get less than the accuracy asks for are left dark.
"""

from dataclasses import replace

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.operators.lenslets.cameras import sampled
from lumigraph.operators.lenslets.illuminated import amplitude, farthest, illuminated, on_lenslets
from lumigraph.operators.lenslets.point_images import squared
from lumigraph.operators.lenslets.relay import Relay, RelaySet, relay
from lumigraph.operators.lenslets.sampled_camera import SPARE
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.glass_distortion import seen_points
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sampling_rules import COARSEST, FINEST
from lumigraph.operators.sampling.tiles import readout
from lumigraph.scene import Points

FINER, ALIKE = 4.0, 1.05
"""How much more exact the image is that one is set beside; how much more it is off than the two are apart."""

COARSER, AS_WELL = 4.0, 0.6
"""Where none is finer, how much less exact the image is, and the part of the error that it has as well."""

OUTSIDE = 0.1
"""Factor of the accuracy for points beyond the array: the little of their light that arrives is all."""

TELLING = 1e-3
"""Accuracy to which images are computed that tell lenses apart, at best: they are off alike."""


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
            total += _plane_image(lenslets, float(dz), positions[within], intensities[within])
        if not within.all():
            finer = known.of(camera, float(dz), max(accuracy * OUTSIDE, FINEST))
            total += _plane_image(finer, float(dz), positions[~within], intensities[~within])
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
    """True for places (n, 2) that lie in cells of the array."""
    cells = optics.cells
    low = np.array(cells.edge)
    return np.all((places >= low) & (places <= low + np.array(cells.size) * cells.count), axis=1)


def _plane_image(lenslets: Relay, dz: float, positions: np.ndarray, intensities: np.ndarray) -> np.ndarray:
    """Raw image (ny, nx) of points (n, 2) of one depth."""
    optics = lenslets.optics
    points = Points(np.column_stack([positions, np.full(len(positions), dz)]), intensities)
    own = sampled(optics.camera).with_cells(optics, points, precision=np.complex64, known=lenslets)
    image = np.zeros(own.shape)
    for source in own.sources(points):
        field, _ = own.own_field(source)
        image[source.window] += source.intensity * squared(field)
    return readout(optics).forward(image.astype(np.float32))


TOLD = ((0.13, -0.21), (-0.38, 0.44))
"""Places in a lenslet, of its pitch, of the points whose images tell lenses apart."""


def seen(camera: CameraOptics, distance: float, accuracy: float) -> field_lenses.Image:
    """Images of two points amid the array by lenses of a camera; see `field_lenses`."""
    optics = Optics.of(camera, distance, max(accuracy, TELLING))
    lenslets, pitch = relay(optics), optics.array.lattice.pitch
    middle = np.array(optics.cells.middle(optics.cells.kind))
    places = [middle + pitch * np.array(part) for part in TOLD]
    reach = farthest(optics, np.array(places))

    lit = []
    for one in field_lenses.some(camera):
        mine = replace(optics, camera=one)
        lit.append(illuminated(mine, _cells.lens(one), places[0]).cells)
    rows, columns = (range(min(r[k].start for r in lit), max(r[k].stop for r in lit)) for k in (0, 1))
    y, x = lenslets.places(rows, columns)

    def image(one: CameraOptics) -> np.ndarray:
        fields = []
        for p in places:
            light = amplitude(one, _cells.lens(one), distance, reach, (y - p[0], x - p[1]))
            fields.append(lenslets.field(light.astype(np.complex64), rows, columns))
        return np.concatenate([np.abs(field).ravel() ** 2 for field in fields])

    return image
