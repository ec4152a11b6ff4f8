r"""Single points before a camera with lenslets: images, derivatives by place, and the way back to its parts.

A point that moves turns the wave in the main lens: with U = A P, as `part_images` has it, it changes by
U_k = A(i f_k P), f_k a phase of first and second order there, and the image by 2 Re(U* U_k). A number that
is made of both is followed back through four fields at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.operators.lenslets.part_images import PartImages
from lumigraph.operators.lenslets.part_waves import Both, PointWaves, Where, factor, read_anew
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.scene import Points

Back = Callable[[np.ndarray], None]
"""Takes slopes (4, ny, nx) of a number by an image and its derivatives."""

Follow = Callable[[list[np.ndarray]], None]
"""Takes slopes by a field and its three derivatives (y, x)."""


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

    images: PartImages
    points: Points
    moved: Sequence[Where]

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.moved))

    @property
    def depths(self) -> Sequence[float]:
        """Of each point [m]."""
        return self.points.positions[:, 2].tolist()

    @single_products()
    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image of a point and its derivatives by y, x and dz (4, ny, nx) [1/m], and the way back from there.

        As of `place_changes`: how much light a sample stands for, by its depth, is not differentiated.
        """
        spot = self._spot(number)
        (still, *moves), follow = self._fields(spot)
        light = np.zeros((4, *self._own.shape))
        light[(0, *spot.window)] = spot.intensity * np.abs(still) ** 2
        for k, move in enumerate(moves):
            light[(k + 1, *spot.window)] = 2 * spot.intensity * np.real(still.conj() * move)
        pixels = np.stack([self._own.read.forward(one) for one in light])

        def back(given: np.ndarray) -> None:
            seen = [spot.intensity * self._own.read.adjoint(one)[spot.window] for one in given]
            by = [np.multiply(seen, np.conj([still, *moves])).sum(0)]
            follow(by + [part * still.conj() for part in seen[1:]])
            self._see_anew(number, float(np.vdot(given, pixels)) / spot.intensity, light, given)

        return pixels, single_products()(back)

    @single_products()
    def along(self) -> np.ndarray:
        """(n,) changes of the sum of all numbers, from the first to the last camera of each pair."""
        return self._found + self._by_pairs.along()

    def _fields(self, spot: SourcePoint) -> tuple[list[np.ndarray], Follow]:
        """A point's field and its derivatives by place, and what takes slopes by them."""
        own, moves = self._own, self._own.moves(spot)
        still = PointWaves.of(own, spot)
        waves = [still.turned(own, move) for move in moves]

        def follow(by: list[np.ndarray]) -> None:
            found = self._by_pairs.slopes
            by_own, turned = found.add(still, by[0]), []
            for one, slopes, move in zip(waves, by[1:], moves, strict=True):
                by_pupil = found.add(one, slopes)
                by_own += by_pupil * factor(move)
                phase = np.real(1j * by_pupil * still.pupil)
                turned.append((phase.sum(1), phase.sum(0)))
            found.add_moves(spot, turned)
            self._by_pairs.add_pupil(spot, by_own)

        return [still.field, *(one.field for one in waves)], follow

    def _see_anew(self, number: int, brighter: float, light: np.ndarray, given: np.ndarray) -> None:
        """Adds what a point's brightness and what pixels take of the light bring."""
        for k, (both, where) in enumerate(zip(self._ends, self.moved, strict=True)):
            low, high = (points.intensities[number] for points in where)
            self._found[k] += brighter * (high - low)
            self._found[k] += sum(read_anew(both, *pair) for pair in zip(light, given, strict=True))

    def _spot(self, number: int) -> SourcePoint:
        return self._spots[number]

    @property
    def _own(self) -> SampledCamera:
        return self._seen[0]

    @cached_property
    def _by_pairs(self) -> Any:
        return self.images.by_pairs(self._own, self._ends, self._seen[2])

    @cached_property
    def _seen(self) -> tuple[SampledCamera, Points, list[Where | None]]:
        return self.images.before(self.points, self.moved)

    @cached_property
    def _ends(self) -> list[Both]:
        return self.images.ends(self._own)

    @cached_property
    def _spots(self) -> dict[int, SourcePoint]:
        return {spot.number: spot for spot in self._own.spots(self._seen[1])}


STEPS = 1 / 256, 1 / 32
"""Of differences of fields: of λz/D across and λ(z/D)² along. The stop's edge turns by 0.025 rad."""


class SteppedPoints(PartPoints):
    """Before main lenses that change over the field, or are of glass: fields are compared between places.

    Each point comes with six others beside it, a step to either side along each axis.
    """

    @cached_property
    def _seen(self) -> tuple[SampledCamera, Points, list[Where | None]]:
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

    def _spot(self, number: int) -> SourcePoint:
        return self._spots[7 * number]

    def _fields(self, spot: SourcePoint) -> tuple[list[np.ndarray], Follow]:
        """As of points whose waves in the main lens only turn; no light is won or lost with depth."""
        some = (self._spots[spot.number + k] for k in range(7))
        waves = [
            self.images.waves(self._own, replace(one, cells=spot.cells, window=spot.window)) for one in some
        ]
        distance = [self._own.optics.camera.object_distance + one.spot.dz for one in waves]
        steps = np.repeat(self._steps[spot.number // 7], 2) * np.tile([-2, 2], 3)
        shares = [1.0, *(far / distance[0] / step for far, step in zip(distance[1:], steps, strict=True))]
        fields = [share * one.field for share, one in zip(shares, waves, strict=True)]

        def follow(by: list[np.ndarray]) -> None:
            each = [by[0], *(one for one in by[1:] for _ in range(2))]
            for one, share, slopes in zip(waves, shares, each, strict=True):
                self._by_pairs.add(one, share * slopes)

        sides = zip(fields[1::2], fields[2::2], strict=True)
        return [fields[0], *(low + high for low, high in sides)], follow
