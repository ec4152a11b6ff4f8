"""A camera without lenslets before points: light goes straight to the pixels.

Samples of the image are those of `single_lens`; those of cameras that hardly differ stay where they are.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, cast

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.array_libraries import Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.illuminated import IlluminatedCells
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint, reach_of
from lumigraph.operators.lenslets.square import Ways
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


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """Samples of the image.

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

    def alike(self, camera: CameraOptics) -> "Film":
        """The samples of a camera that hardly differs."""
        return replace(self, camera=camera)


@dataclass(frozen=True, slots=True)
class NoLenslets:
    """Nothing in the place of lenslets: light stays as it is."""

    film: Film

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Places of samples [m]."""
        y, x = (
            span.positions[part.start : part.stop]
            for span, part in zip(self.film.spans, (rows, columns), strict=True)
        )
        return y, x

    def lit(self, light: np.ndarray, cells: Ways) -> None:
        """No choice."""

    def keys(self, cells: Ways) -> list[Any]:
        """No arrays."""
        return []

    def grouped(self, keys: Iterable[Any]) -> list[list[Any]]:
        """No arrays."""
        return []

    def numbers(self, keys: Iterable[Any]) -> dict[Any, np.ndarray]:
        """No numbers."""
        return {}

    def prepared(self, keys: Iterable[Any]) -> dict[Any, np.ndarray]:
        """No arrays."""
        return {}

    def amplitude(self, xp: ArrayLibrary, prepared: Numbers, light: Array, cells: Ways, lit: Any) -> Array:
        """The light itself."""
        return light


@dataclass(frozen=True, eq=False)
class FilmCamera(SampledCamera):
    """A camera without lenslets before points, and how finely all is sampled."""

    @classmethod
    def of(
        cls, camera: CameraOptics, points: Points, accuracy: float, *, beside: float = 0.0,
        precision: type[np.complexfloating] = np.complex128,
    ) -> Self:  # fmt: skip
        """A camera sampled as finely as the accuracy and the points ask for."""
        distances, pixels = camera.object_distance + points.positions[:, 2], camera.sensor.grid
        blur, airy = max(_cells.blur(camera, z) for z in distances.tolist()), _cells.airy(camera)
        far = WIDER * blur + TAIL / math.sqrt(accuracy) * airy
        half = (pixels.size[0] / 2, pixels.size[1] / 2)
        y, x = (
            Span.around(-at - side, -at + side, image_pitch(camera))  # a readout is turned by 180°
            for at, side in zip(pixels.center, half, strict=True)
        )
        film = Film(camera, float(distances[0]), (y, x), far)
        made = cls(cast(Any, film), 0, reach_of(camera), precision)
        nodes = [made._nodes_for(source, beside) for source in made.sources(points)]
        return replace(made, nodes=max(nodes))

    @property
    def shape(self) -> tuple[int, int]:
        """Number of samples of the image (y, x)."""
        y, x = (span.count for span in self.film.spans)
        return y, x

    @cached_property
    def read(self) -> Linear:
        """Means over pixels of the image's samples."""
        if isinstance(self.like, FilmCamera) and self.like._seen == self._seen:
            return self.like.read
        sensor, (y, x) = self.film.camera.sensor, self.film.spans
        center = tuple((span.first + span.count // 2) * span.pitch for span in (y, x))
        plane = Grid((y.count, x.count), (y.pitch, x.pitch), (center[0], center[1]))
        return averaged(plane, sensor.grid, sensor.fill_factor)

    @cached_property
    def lenslets(self) -> Any:
        """Nothing: the same before all cameras."""
        return NoLenslets(self.film) if self.like is None else self.like.lenslets

    def _nodes_for(self, source: SourcePoint, beside: float) -> int:
        optics, lens = self._at(source.dz), self._lens(source)
        widest = math.sqrt(2) * self.film.far + beside
        widest += main_lens.widest_ray(optics.camera, lens, optics.distance)
        return main_lens.samples_across(optics.camera, widest, main_lens.opening_of(lens).slack)

    def _illuminated(self, source: SourcePoint) -> IlluminatedCells:
        parts = []
        place = self._place(self._at(source.dz), source.position).tolist()
        for at, span in zip(place, self.film.spans, strict=True):
            ends = (
                math.floor((at - self.film.far) / span.pitch),
                math.ceil((at + self.film.far) / span.pitch),
            )
            first, last = (min(max(0, end - span.first), span.count) for end in ends)
            parts.append(range(first, last))
        y, x = parts
        return IlluminatedCells((y, x), (slice(y.start, y.stop), slice(x.start, x.stop)))

    @cached_property
    def _seen(self) -> tuple[Any, ...]:
        sensor = self.film.camera.sensor
        return sensor.grid, sensor.fill_factor

    @property
    def film(self) -> Film:
        """Samples of the image: in the place of `optics`."""
        return cast(Film, self.optics)
