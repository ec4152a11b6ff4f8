"""A camera without lenslets before points, as `part_sight` has those with: light goes straight to the pixels.

Samples of the image are those of `single_lens`; those of cameras that hardly differ stay where they are.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.operators.lenslets.line_parts import Key
from lumigraph.operators.lenslets.point_changes import PUPIL
from lumigraph.operators.lenslets.sampled_camera import EDGE, Lit, SampledCamera, SourcePoint, reach_of
from lumigraph.operators.lenslets.transmitted import LensletGradient
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.band import Span
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.resampling import averaged
from lumigraph.operators.single_lens import image_pitch
from lumigraph.scene import Points

WIDER, TAIL = 1.5, 4.0
"""How far light is followed: so many radii of a blur, and so many λL/D over the accuracy's root beyond.

An Airy disc's rms beyond r [λL/D] is 0.08/r² of its own.
"""

PERIOD = 3.0
"""Nodes across the main lens for each λL/D that light is followed to: it comes again beyond."""


@dataclass(frozen=True, slots=True, eq=False)
class FilmGrid:
    """Where the image is sampled.

    Parameters
    ----------
    camera
        Without lenslets.
    distance
        Of the plane in question from the main lens [m].
    spans
        Samples along y and along x.
    far
        How far from its middle a point's light is followed [m].
    """

    camera: CameraOptics
    distance: float
    spans: tuple[Span, Span]
    far: float

    rotation = 0.0
    image_scale = 1.0

    def alike(self, camera: CameraOptics) -> "FilmGrid":
        """Of a camera that hardly differs."""
        return replace(self, camera=camera)


@dataclass(frozen=True, slots=True)
class NoLenslets:
    """In the place of lenslets: light stays as it is."""

    film: FilmGrid

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Of samples [m]."""
        y, x = (
            span.positions[part.start : part.stop]
            for span, part in zip(self.film.spans, (rows, columns), strict=True)
        )
        return y, x

    def keys(self, rows: range, columns: range) -> set[Key]:
        """No matrices."""
        return set()

    def passed(self, light: np.ndarray, rows: range, columns: range) -> "UnchangedLight":
        """Light at those places."""
        return UnchangedLight(light)


@dataclass(frozen=True, slots=True, eq=False)
class UnchangedLight:
    """`Passed` where there are no lenslets."""

    field: np.ndarray

    def changed(self, light: np.ndarray, change: Any) -> np.ndarray:
        """As `Passed.changed`."""
        return light

    def back(self, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """As `Passed.back`."""
        return by


@dataclass(frozen=True, eq=False)
class SampledLens(SampledCamera):
    """As `SampledCamera`, of a camera without lenslets."""

    @classmethod
    def of(cls, camera: CameraOptics, points: Points, accuracy: float, fewest: int = PUPIL) -> "SampledLens":
        """As finely as the accuracy and the points ask for."""
        distances, pixels = camera.object_distance + points.positions[:, 2], camera.sensor.grid
        blur, airy = max(_cells.blur(camera, z) for z in distances.tolist()), _cells.airy(camera)
        far = WIDER * blur + TAIL / math.sqrt(accuracy) * airy
        half = (pixels.size[0] / 2, pixels.size[1] / 2)
        y, x = (
            Span.around(-at - side, -at + side, image_pitch(camera))  # a readout is turned by 180°
            for at, side in zip(pixels.center, half, strict=True)
        )
        nodes = max(fewest, *(2 * math.ceil(n / 2) for n in (PERIOD * far / airy, EDGE / accuracy)))
        film = FilmGrid(camera, float(distances[0]), (y, x), far)
        return cls(cast(Any, film), nodes, reach=reach_of(camera))

    @property
    def shape(self) -> tuple[int, int]:
        """As of cameras with lenslets."""
        y, x = (span.count for span in self.film.spans)
        return y, x

    @cached_property
    def read(self) -> Linear:
        """As of cameras with lenslets."""
        if isinstance(self.like, SampledLens) and self.like._seen == self._seen:
            return self.like.read
        sensor, (y, x) = self.film.camera.sensor, self.film.spans
        center = tuple((span.first + span.count // 2) * span.pitch for span in (y, x))
        plane = Grid((y.count, x.count), (y.pitch, x.pitch), (center[0], center[1]))
        return averaged(plane, sensor.grid, sensor.fill_factor)

    @cached_property
    def lenslets(self) -> Any:
        """None: the same before all cameras."""
        return NoLenslets(self.film) if self.like is None else self.like.lenslets

    def _lit(self, spot: SourcePoint) -> Lit:
        parts = []
        place = self._place(self._at(spot.dz), spot.position).tolist()
        for at, span in zip(place, self.film.spans, strict=True):
            ends = (
                math.floor((at - self.film.far) / span.pitch),
                math.ceil((at + self.film.far) / span.pitch),
            )
            first, last = (min(max(0, end - span.first), span.count) for end in ends)
            parts.append(range(first, last))
        y, x = parts
        return (y, x), (slice(y.start, y.stop), slice(x.start, x.stop))

    @cached_property
    def _seen(self) -> tuple[Any, ...]:
        sensor = self.film.camera.sensor
        return sensor.grid, sensor.fill_factor

    @property
    def film(self) -> FilmGrid:
        """Its samples: in the place of `optics`."""
        return cast(FilmGrid, self.optics)
