"""A camera before points: how finely all is sampled, decided once from plain numbers, and what these are.

Cameras that hardly differ are sampled alike, so that what they do to light can be compared number by number.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.elements import Train
from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.illuminated import (
    IlluminatedCells,
    illuminated,
    on_lenslets,
    share,
)
from lumigraph.operators.lenslets.models import lenslets_of
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.tiles import readout
from lumigraph.scene import Points

SPARE = 0.5
"""Part of the accuracy that single points are computed to: they cost little, and stand near borders too."""

SLACK = 1.01
"""Factor of the stops' reach over the field, where that is known at few fields."""

Phase = tuple[np.ndarray, np.ndarray]
"""Phase of a point's light along an axis: the product of places and of the pupil's nodes [rad/m and m]."""


@dataclass(frozen=True, slots=True)
class SourcePoint:
    """A point's number, its place (y, x, dz) [m], its intensity, and the cells that it lights."""

    number: int
    position: np.ndarray
    intensity: float
    lit: IlluminatedCells

    @property
    def dz(self) -> float:
        """Depth from the focused plane [m]."""
        return float(self.position[2])

    @property
    def window(self) -> tuple[slice, slice]:
        """Samples (y, x) that it lights."""
        return self.lit.window

    def among(self, points: Points) -> "SourcePoint":
        """The point where it is among others, in the same cells."""
        k = self.number
        return replace(self, position=points.positions[k], intensity=float(points.intensities[k]))


@dataclass(frozen=True, eq=False)
class SampledCamera:
    """A camera with lenslets before points, and how finely all is sampled.

    Parameters
    ----------
    optics
        Of the plane that is blurred most.
    nodes
        Samples across the main lens.
    reach
        Farthest place of all fields' stops from the axis, over half of the main lens' diameter.
    precision
        Of amplitudes behind lenslets.
    like
        Another that hardly differs: what is the same is taken from it.
    known
        Lenslets of the camera that are used again.
    """

    optics: Optics
    nodes: int
    reach: float = 1.0
    precision: type[np.complexfloating] = np.complex128
    like: "SampledCamera | None" = None
    known: Any = None

    @classmethod
    def of(
        cls, camera: CameraOptics, points: Points, accuracy: float, *, beside: float = 0.0,
        precision: type[np.complexfloating] = np.complex128,
    ) -> Self:  # fmt: skip
        """A camera sampled as finely as the accuracy and the points ask for, or others `beside` these [m]."""
        distances = camera.object_distance + points.positions[:, 2]
        blurred = max(distances.tolist(), key=lambda z: _cells.blur(camera, z))
        optics = Optics.of(camera, blurred, accuracy)
        return cls.with_cells(optics.alike(camera), points, beside=beside, precision=precision)

    @classmethod
    def with_cells(
        cls, optics: Optics, points: Points, *, beside: float = 0.0,
        precision: type[np.complexfloating] = np.complex128, known: Any = None,
    ) -> Self:  # fmt: skip
        """A camera whose image is sampled in given cells, with lenslets that are `known` or not."""
        made = cls(optics, 0, reach_of(optics.camera), precision, known=known)
        nodes = [made._nodes_for(source, beside) for source in made.sources(points)]
        return replace(made, nodes=max(nodes))

    def sources(self, points: Points) -> list[SourcePoint]:
        """Points, nearer ones first, and the cells that they light."""
        found = []
        for k in np.argsort(points.positions[:, 2], kind="stable").tolist():
            source = SourcePoint(k, points.positions[k], float(points.intensities[k]), IlluminatedCells())
            found.append(replace(source, lit=self._illuminated(source)))
        return found

    def _illuminated(self, source: SourcePoint) -> IlluminatedCells:
        """Cells that a point lights."""
        optics = self._at(source.dz)
        return illuminated(optics, self._lens(source), self._place(optics, source.position))

    def _nodes_for(self, source: SourcePoint, beside: float) -> int:
        """Samples across the main lens for the light that the lenslets need of a point."""
        optics, lens = self._at(source.dz), self._lens(source)
        place = self._place(optics, source.position)
        far = [np.abs(at - to).max(initial=0) for at, to in
               zip(self.lenslets.places(*source.lit.cells), place, strict=True)]  # fmt: skip
        widest = math.hypot(*far) + beside + main_lens.widest_ray(optics.camera, lens, optics.distance)
        return main_lens.samples_across(optics.camera, widest, main_lens.opening_of(lens).slack)

    def alike(self, camera: CameraOptics) -> Self:
        """A camera that hardly differs, as finely sampled."""
        return replace(self, optics=self.optics.alike(camera), like=self, known=None)

    @property
    def own(self) -> "SampledCamera":
        """The camera that it is like, or itself."""
        return self if self.like is None else self.like

    @property
    def shape(self) -> tuple[int, int]:
        """Number of samples of the image (y, x)."""
        cells = self.optics.cells
        y, x = (n * k for n, k in zip(cells.image, cells.samples, strict=True))
        return y, x

    @cached_property
    def read(self) -> Linear:
        """Means over pixels of the image's samples."""
        if self.like is not None and self.like._seen == self._seen:
            return self.like.read
        return readout(self.optics)

    @cached_property
    def lenslets(self) -> Any:
        """Light in the lenslet plane to light on the image."""
        if self.known is not None:
            return self.known
        if self.like is not None and self.like._behind == self._behind:
            return self.like.lenslets
        like = None if self.like is None else self.like.lenslets
        return lenslets_of(self.optics, self.precision, like)

    def keys(self, source: SourcePoint) -> list[Any]:
        """Names of the lenslets' arrays that a point's light is computed with."""
        return self.lenslets.keys(source.lit.cells)

    def seen_from(self, source: SourcePoint) -> tuple[float, ...]:
        """Depth, and field (y, x) if the lens changes over it: what a point's wave there follows from."""
        if not self._varies:
            return (source.dz,)
        distance = self._at(source.dz).distance
        return source.dz, float(source.position[0]) / distance, float(source.position[1]) / distance

    def numbers(self, source: SourcePoint) -> dict[str, Any]:
        """Numbers that a point's light in the lenslet plane follows from."""
        (down, above), (across, beside) = self.phases(source)
        optics = self._at(source.dz)
        wave = main_lens.wave_numbers(optics.camera, self._lens(source), optics.distance, self.grid)
        wave["strength"] = wave["strength"] * math.sqrt(share(optics))
        return {"y": down, "above": above, "x": across, "beside": beside} | wave

    def lit(self, source: SourcePoint) -> Any:
        """Choice of the lenslets that a point does not leave dark."""
        light = self.light(NUMPY, self.numbers(source), source)
        return self.lenslets.lit(light, source.lit.cells)

    @property
    def anew(self) -> Self:
        """The same camera, which knows nothing yet."""
        return replace(self)

    def light(self, xp: ArrayLibrary, numbers: Numbers, source: SourcePoint) -> Array:
        """Light (..., y, x) of a point in the lenslet plane, without the phase exp(iπw²/(λL))."""
        down = xp.exp(1j * (numbers["y"][:, None] * numbers["above"]))
        across = xp.exp(1j * (numbers["beside"][:, None] * numbers["x"]))
        wave = numbers["wave"] if "wave" in numbers else main_lens.wave(xp, numbers)
        return down @ (wave @ across)

    def field(
        self, xp: ArrayLibrary, numbers: Numbers, prepared: Numbers, source: SourcePoint, lit: Any
    ) -> Array:
        """Amplitude (..., y, x) of a point on the samples that it lights."""
        light = self.light(xp, numbers, source)
        return self.lenslets.amplitude(xp, prepared, light, source.lit.cells, lit)

    def own_field(self, source: SourcePoint, numbers: Numbers | None = None) -> tuple[np.ndarray, Any]:
        """The same in plain numbers, and the lenslets that are not dark."""
        light = self.light(NUMPY, self.numbers(source) if numbers is None else numbers, source)
        still = light.reshape(-1, *light.shape[-2:])[0]
        lit = self.lenslets.lit(still, source.lit.cells)
        prepared = self.lenslets.prepared(self.keys(source))
        light = light.astype(self.precision)
        return self.lenslets.amplitude(NUMPY, prepared, light, source.lit.cells, lit), lit

    def phases(self, source: SourcePoint) -> tuple[Phase, Phase]:
        """Phases of a point's light along y and along x."""
        optics = self._at(source.dz)
        turn = -2 * np.pi / (optics.camera.wavelength * optics.camera.separation)
        grid, place = self.grid, self._place(optics, source.position)
        y, x = self.lenslets.places(*source.lit.cells)
        return (turn * (y - place[0]), grid.y), (turn * (x - place[1]), grid.x)

    def moves(self, source: SourcePoint) -> list[Phase]:
        """Slopes of the lens' phase by a point's y, x and dz, sums of one along y and one along x [rad/m].

        How much light a sample of the object stands for, by its depth, stays as it is.
        """
        optics, camera = self._at(source.dz), self.optics.camera
        turn = 2 * np.pi / (camera.wavelength * camera.separation)
        grid, place = self.grid, self._place(optics, source.position)
        (y, x), found = (grid.y, grid.x), []
        for move in np.eye(2):
            down, across = turn * self._place(optics, move)
            found.append((down * y, across * x))
        nearer = -turn * place / optics.distance  # a deeper point's image is nearer to the axis
        bend = -np.pi / camera.wavelength / optics.distance**2
        down, across = (n * nodes + bend * nodes**2 for n, nodes in zip(nearer, (y, x), strict=True))
        return [*found, (down, across)]

    def move_numbers(self, source: SourcePoint) -> dict[str, np.ndarray]:
        """Numbers of `moves`, (3, nodes) along y and along x."""
        moves = self.moves(source)
        return {"move y": np.stack([y for y, _ in moves]), "move x": np.stack([x for _, x in moves])}

    @property
    def grid(self) -> Grid:
        """Nodes across the main lens."""
        return main_lens.pupil_grid(self.optics.camera, self.nodes, self.reach)

    @cached_property
    def _varies(self) -> bool:
        """True if the main lens changes over the field."""
        return field_lenses.plate_of(self.optics.camera) is not None

    @cached_property
    def _behind(self) -> tuple[Any, ...]:
        """All that lenslets' matrices follow from."""
        one, of = self.optics, self.optics.camera
        distances = of.wavelength, of.separation, of.lenslet_distance
        return one.array, one.cells, one.axes, distances, _cells.accepted(of), of.surface

    @cached_property
    def _seen(self) -> tuple[Any, ...]:
        """All that means over pixels follow from."""
        one, sensor = self.optics, self.optics.camera.sensor
        return one.cells, one.image_scale, one.rotation, sensor.grid, sensor.fill_factor

    def _at(self, dz: float) -> Optics:
        return replace(self.optics, distance=self.optics.camera.object_distance + dz)

    @staticmethod
    def _place(optics: Optics, position: np.ndarray) -> np.ndarray:
        """Place of a point's image in the lenslet plane [m]."""
        return on_lenslets(optics, position[None, :2], optics.distance)[0]

    def _lens(self, source: SourcePoint) -> Train:
        """Main lens as a point sees it, turned with the lenslets."""
        return lens_before(self.optics.camera, *self.seen_from(source)[1:])


def reach_of(camera: CameraOptics) -> float:
    """Farthest place of the stops of all fields from the axis, over half of the main lens' diameter."""
    farthest = max(_cells.stop_reach(one.lens) for one in field_lenses.some(camera))
    return farthest if field_lenses.plate_of(camera) is None else SLACK * farthest


def lens_before(camera: CameraOptics, *field: float) -> Train:
    """Main lens as it is at a field (y, x), turned with the lenslets."""
    return _cells.lens(field_lenses.at(camera, *field) if field else camera)
