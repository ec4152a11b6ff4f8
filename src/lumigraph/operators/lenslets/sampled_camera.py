"""A camera with lenslets before points: waves, matrices and phases that their images are products of.

Cameras that hardly differ are sampled alike, so that what they do to light can be compared number by number.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from lumigraph.core.linear import Linear
from lumigraph.operators.lenslets.individual_lenslets import IndividualLenslets
from lumigraph.operators.lenslets.lines import LineRelay
from lumigraph.operators.lenslets.point_changes import PUPIL
from lumigraph.operators.lenslets.point_light import PointLight, SampledPupilLight, by_distance
from lumigraph.operators.lenslets.points import SPARE, farthest, lit_cells, on_lenslets, share
from lumigraph.operators.lenslets.relay import SeparableRelay
from lumigraph.operators.lenslets.transmitted import Parted
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.tiles import readout
from lumigraph.scene import Points

EDGE = 0.8
"""Samples across the main lens, times the accuracy: by the stop's edge 512 are 1.3e-3 off, 1024 6.6e-4."""

SLACK = 1.01
"""Factor of the stop's reach over the field, where that is known at few fields."""

Turn = tuple[np.ndarray, np.ndarray]
"""Of places and of the pupil's nodes along an axis: the phase of a point's light is their product."""


Lit = tuple[tuple[range, range], tuple[slice, slice]]
"""Cells along y and along x, and their samples."""


@dataclass(frozen=True, slots=True)
class SourcePoint:
    """A point's number, its place (y, x, dz), its light, the cells that it lights, and their samples."""

    number: int
    position: np.ndarray
    intensity: float
    cells: tuple[range, range] = (range(0), range(0))
    window: tuple[slice, slice] = (slice(0), slice(0))

    @property
    def dz(self) -> float:
        """[m]."""
        return float(self.position[2])

    def before(self, points: Points) -> "SourcePoint":
        """Where it is among others, in the same cells."""
        k = self.number
        return replace(self, position=points.positions[k], intensity=float(points.intensities[k]))


@dataclass(frozen=True, eq=False)
class SampledCamera:
    """A camera before points, and how finely all is sampled.

    Parameters
    ----------
    optics
        Of the plane that is blurred most.
    nodes
        Across the main lens.
    like
        Another that hardly differs: what is the same is taken from it.
    reach
        How far nodes lie from the axis, over half of the main lens' diameter: as far as stops of all fields.
    """

    optics: Optics
    nodes: int
    like: "SampledCamera | None" = None
    reach: float = 1.0

    @classmethod
    def of(cls, camera: CameraOptics, points: Points, accuracy: float, fewest: int = PUPIL) -> Self:
        """As finely as the accuracy and the points ask for, by so many nodes across the lens at least."""
        distances = camera.object_distance + points.positions[:, 2]
        blurred = max(distances.tolist(), key=lambda z: _cells.blur(camera, z))
        optics = Optics.of(camera, blurred, SPARE * accuracy)
        places = on_lenslets(optics, points.positions[:, :2], distances)
        least = 3 * farthest(optics, places) / _cells.airy(camera), EDGE / accuracy
        # Even: the stop's edge then touches no sample's side, on one or the other side of it by rounding.
        nodes = max(fewest, *(2 * math.ceil(count / 2) for count in least))
        return cls(optics.alike(camera), nodes, reach=reach_of(camera))

    def alike(self, camera: CameraOptics) -> Self:
        """Of a camera that hardly differs, as finely sampled."""
        return replace(self, optics=self.optics.alike(camera), like=self)

    @property
    def anew(self) -> Self:
        """The same, which knows nothing yet."""
        return replace(self)

    @property
    def own(self) -> "SampledCamera":
        """That which it is like, or itself."""
        return self if self.like is None else self.like

    @property
    def shape(self) -> tuple[int, int]:
        """Of all samples."""
        cells = self.optics.cells
        y, x = (n * k for n, k in zip(cells.image, cells.samples, strict=True))
        return y, x

    @cached_property
    def read(self) -> Linear:
        """What pixels take of the samples."""
        if self.like is not None and self.like._seen == self._seen:
            return self.like.read
        return readout(self.optics)

    @cached_property
    def lenslets(self) -> Parted:
        """What they do to light."""
        if self.like is not None and self.like._behind == self._behind:
            return self.like.lenslets
        like: Any = None if self.like is None else self.like.lenslets
        if self.optics.array.scatter is not None:
            return IndividualLenslets(self.optics, np.complex128, like)
        if self.optics.straight:
            return SeparableRelay(self.optics, np.complex128, like)
        return LineRelay(self.optics, np.complex128, like)

    def pupil(self, spot: SourcePoint) -> np.ndarray:
        """Wave (nodes, nodes) in the main lens, of a point of 1 in the place of another."""
        if self.like is not None and self.like.before == self.before:
            return self.like.pupil(spot)
        if (key := self.seen_from(spot)) not in self._pupils:
            self._pupils.clear()  # one depth, or field, comes after another
            light = self._light(spot)
            self._pupils[key] = light.behind()[1] * math.sqrt(share(self._at(spot.dz)))
        return self._pupils[key]

    def seen_from(self, spot: SourcePoint) -> tuple[float, ...]:
        """Depth, and field (y, x) if the lens changes over it: what a point's wave there follows from."""
        if not self._varies:
            return (spot.dz,)
        distance = self._at(spot.dz).distance
        return spot.dz, float(spot.position[0]) / distance, float(spot.position[1]) / distance

    def spots(self, points: Points) -> list[SourcePoint]:
        """Of each point, by depth."""
        found = []
        for k in np.argsort(points.positions[:, 2], kind="stable"):
            spot = SourcePoint(int(k), points.positions[k], float(points.intensities[k]))
            cells, window = self._lit(spot)
            found.append(replace(spot, cells=cells, window=window))
        return found

    def light(self, spot: SourcePoint) -> PointLight:
        """A point's, in the lenslet plane."""
        return self._light(spot)

    def _lit(self, spot: SourcePoint) -> Lit:
        """Cells that a point lights."""
        optics = self._at(spot.dz)
        cells = lit_cells(optics, self.light(spot), self._place(optics, spot.position))
        y, x = (
            slice(mine.start * n, mine.stop * n) for mine, n in zip(cells, optics.cells.samples, strict=True)
        )
        return cells, (y, x)

    def turns(self, spot: SourcePoint) -> tuple[Turn, Turn]:
        """Along y and along x [rad/m and m]."""
        optics = self._at(spot.dz)
        turn = -2 * np.pi / (optics.camera.wavelength * optics.camera.separation)
        grid, place = self._light(spot).grid, self._place(optics, spot.position)
        y, x = self.lenslets.places(*spot.cells)
        return (turn * (y - place[0]), grid.y), (turn * (x - place[1]), grid.x)

    def moves(self, spot: SourcePoint) -> list[Turn]:
        """Phases in the main lens as a point moves by y, x and dz, each one along y and one along x [rad/m].

        How much light a sample of the object stands for, by its depth, stays as it is.
        """
        optics = self._at(spot.dz)
        turn = 2 * np.pi / (optics.camera.wavelength * optics.camera.separation)
        grid, place = self._light(spot).grid, self._place(optics, spot.position)
        (y, x), found = (grid.y, grid.x), []
        for move in np.eye(2):
            down, across = turn * self._place(optics, move)
            found.append((down * y, across * x))
        nearer = -turn * place / optics.distance  # a deeper point's image is nearer to the axis
        bent = (by_distance(optics.camera, optics.distance, nodes) for nodes in (y, x))
        down, across = (n * nodes + more for n, nodes, more in zip(nearer, (y, x), bent, strict=True))
        return [*found, (down, across)]

    @cached_property
    def _pupils(self) -> dict[tuple[float, ...], np.ndarray]:
        return {}

    @cached_property
    def _varies(self) -> bool:
        """Whether the main lens changes over the field."""
        return field_lenses.plate_of(self.optics.camera) is not None

    @cached_property
    def before(self) -> tuple[Any, ...]:
        """All that waves in the main lens, and how bright they are, follow from."""
        one = self.optics.camera
        lens = tuple(one.lens.elements if self._varies else _cells.lens(one).elements)
        given = one.wavelength, one.object_distance, one.separation, one.pupil_diameter, one.object_pitch
        return lens, given, self.optics.image_scale

    @cached_property
    def _behind(self) -> tuple[Any, ...]:
        """All that lenslets' matrices follow from."""
        one, of = self.optics, self.optics.camera
        distances = of.wavelength, of.separation, of.lenslet_distance
        return one.array, one.cells, one.axes, distances, _cells.accepted(of), of.surface

    @cached_property
    def _seen(self) -> tuple[Any, ...]:
        """All that what pixels take follows from."""
        one, sensor = self.optics, self.optics.camera.sensor
        return one.cells, one.image_scale, one.rotation, sensor.grid, sensor.fill_factor

    def _at(self, dz: float) -> Optics:
        return replace(self.optics, distance=self.optics.camera.object_distance + dz)

    @staticmethod
    def _place(optics: Optics, position: np.ndarray) -> np.ndarray:
        """Of a point's image in the lenslet plane [m]."""
        return on_lenslets(optics, position[None, :2], optics.distance)[0]

    def _light(self, spot: SourcePoint) -> SampledPupilLight:
        """Of a point."""
        distance, camera, (_, *field) = self._at(spot.dz).distance, self.optics.camera, self.seen_from(spot)
        mine = field_lenses.at(camera, *field) if field else camera
        return SampledPupilLight(mine, _cells.lens(mine), distance, 0.0, self.nodes, self.reach)


def reach_of(camera: CameraOptics) -> float:
    """As of `SampledCamera`, of all fields and of cameras that hardly differ."""
    farthest = max(_cells.stop_reach(one.lens) for one in field_lenses.some(camera))
    return farthest if field_lenses.plate_of(camera) is None else SLACK * farthest
