r"""Single points before a camera: images, derivatives by place, and the way back to the camera's parts.

A point that moves turns the wave in the main lens: with U = A P, as `point_images` has it, it changes by
U_k = A(i f_k P), f_k a phase of first and second order there, and the image by 2 Re(U* U_k). Images and
derivatives are one function of a camera's numbers, which is followed back as a whole.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.gradient import Both, Gradient, Moved, read_anew
from lumigraph.operators.lenslets.moving_point import (
    intensities,
    moving_intensity,
    moving_numbers,
    own_changes,
)
from lumigraph.operators.lenslets.point_images import PointImages
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.scene import Points

Back = Callable[[np.ndarray], None]
"""Takes slopes (4, ny, nx) of a number by an image and its derivatives."""


@dataclass(eq=False)
class PartPoints:
    """Points one by one, before a camera and before the pairs of cameras around it.

    Parameters
    ----------
    images
        The cameras'.
    points
        Nearer ones first.
    moved
        (n,), the same before the cameras of each pair, as far from the planes in focus.
    """

    images: PointImages
    points: Points
    moved: Sequence[Moved]

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.moved))

    @property
    def depths(self) -> Sequence[float]:
        """Depth of each point [m]."""
        return self.points.positions[:, 2].tolist()

    @single_products()
    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image of a point and its derivatives by y, x and dz (4, ny, nx) [1/m], and the way back from there.

        How much light a sample stands for, by its depth, is not differentiated.
        """
        source = self._source(number)
        light = np.zeros((4, *self._own.shape))
        light[(slice(None), *source.window)] = source.intensity * self._intensity(source)
        pixels = np.stack([self._own.read.forward(one) for one in light])

        def back(given: np.ndarray) -> None:
            asked = np.stack([self._own.read.adjoint(one)[source.window] for one in given])
            self._follow(source, source.intensity * asked)
            self._see_anew(number, float(np.vdot(given, pixels)) / source.intensity, light, given)

        return pixels, single_products()(back)

    @single_products()
    def along(self) -> np.ndarray:
        """(n,) changes of the sum of all numbers, from the first to the last camera of each pair."""
        return self._found + self._gradient.along()

    def _intensity(self, source: SourcePoint) -> np.ndarray:
        """Intensity of a point of 1 and its derivatives (4, y, x)."""
        return own_changes(self._own, source)

    def _follow(self, source: SourcePoint, asked: np.ndarray) -> None:
        """Follow slopes (4, y, x) by the intensity and its derivatives back."""
        own, lit = self._own, self._own.lit(source)

        def loss(xp: ArrayLibrary, numbers: Numbers, prepared: Numbers) -> Array:
            return (moving_intensity(own, xp, numbers, prepared, source, lit) * asked).sum()

        self._gradient.follow(source, moving_numbers(own, source), loss)

    def _see_anew(self, number: int, brighter: float, light: np.ndarray, given: np.ndarray) -> None:
        """Adds what a point's brightness and what pixels take of the light bring."""
        for k, where in enumerate(self.moved):
            low, high = (points.intensities[number] for points in where)
            self._found[k] += brighter * (high - low)
        for plane, slopes in zip(light, given, strict=True):
            self._found += read_anew(self._own, self._ends, plane, slopes)

    def _source(self, number: int) -> SourcePoint:
        return self._sources[number]

    @property
    def _own(self) -> SampledCamera:
        return self._seen[0]

    @cached_property
    def _gradient(self) -> Gradient:
        return self.images.by_pairs(self._own, self._ends, self._seen[2])

    @cached_property
    def _seen(self) -> tuple[SampledCamera, Points, list[Moved | None]]:
        return self.images.before(self.points, self.moved)

    @cached_property
    def _ends(self) -> list[Both]:
        return self.images.ends(self._own)

    @cached_property
    def _sources(self) -> dict[int, SourcePoint]:
        return {source.number: source for source in self._own.sources(self._seen[1])}


STEPS = 1 / 256, 1 / 32
"""Steps of differences of fields: of λz/D across and λ(z/D)² along. The stop's edge turns by 0.025 rad."""


class SteppedPoints(PartPoints):
    """Points before main lenses that change over the field, or are of glass: fields of places are compared.

    Each point comes with six others beside it, a step to either side along each axis.
    """

    @cached_property
    def _seen(self) -> tuple[SampledCamera, Points, list[Moved | None]]:
        moved = [(self._beside(low), self._beside(high)) for low, high in self.moved]
        return self.images.before(self._beside(self.points), moved)

    @cached_property
    def _steps(self) -> np.ndarray:
        """(points, 3) [m]."""
        camera = self.images.camera
        ratio = (camera.object_distance + self.points.positions[:, 2]) / camera.pupil_diameter
        across, along = STEPS[0] * camera.wavelength * ratio, STEPS[1] * camera.wavelength * ratio**2
        return np.stack([across, across, along], axis=1)

    def _beside(self, points: Points) -> Points:
        moves = np.array([[0.0] * 3, *(side * one for one in np.eye(3) for side in (-1, 1))])
        places = points.positions[:, None] + moves * self._steps[:, None]
        return Points(places.reshape(-1, 3), np.repeat(points.intensities, len(moves)))

    def _source(self, number: int) -> SourcePoint:
        return self._sources[7 * number]

    def _some(self, source: SourcePoint) -> list[SourcePoint]:
        """A point and those beside it, in the same cells."""
        return [replace(self._sources[source.number + k], lit=source.lit) for k in range(7)]

    def _shares(self, source: SourcePoint) -> list[float]:
        """Factors of the fields, in their differences: no light is won or lost with depth."""
        distance = [self._own.optics.camera.object_distance + one.dz for one in self._some(source)]
        steps = np.repeat(self._steps[source.number // 7], 2) * np.tile([-2, 2], 3)
        return [1.0, *(far / distance[0] / step for far, step in zip(distance[1:], steps, strict=True))]

    def _intensity(self, source: SourcePoint) -> np.ndarray:
        still, *rest = (
            share * self._own.own_field(one)[0]
            for share, one in zip(self._shares(source), self._some(source), strict=True)
        )
        return intensities(
            NUMPY, still, [low + high for low, high in zip(rest[::2], rest[1::2], strict=True)]
        )

    def _follow(self, source: SourcePoint, asked: np.ndarray) -> None:
        """Follow slopes back one field after the other: each is linear in what is asked of the others."""
        some, shares = self._some(source), self._shares(source)
        fields = [share * self._own.own_field(one)[0] for share, one in zip(shares, some, strict=True)]
        still, moves = fields[0], [fields[k] + fields[k + 1] for k in (1, 3, 5)]
        by = [2 * (asked[0] * still + sum(one * move for one, move in zip(asked[1:], moves, strict=True)))]
        by += [2 * one * still for one in asked[1:] for _ in range(2)]
        for one, share, slope in zip(some, shares, by, strict=True):
            self._follow_field(one, share * slope)

    def _follow_field(self, source: SourcePoint, by: np.ndarray) -> None:
        """Follow slopes by a field's real and imaginary part."""
        own, lit = self._own, self._own.lit(source)

        def loss(xp: ArrayLibrary, numbers: Numbers, prepared: Numbers) -> Array:
            field = own.field(xp, numbers, prepared, source, lit)
            return (xp.real(field) * by.real + xp.imag(field) * by.imag).sum()

        self._gradient.follow(source, own.numbers(source), loss)
