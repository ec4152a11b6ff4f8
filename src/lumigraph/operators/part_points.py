r"""Single points before a camera with lenslets: images, derivatives by place, and the way back to its parts.

A point that moves turns the wave in the main lens: with U = A P, as `part_images` has it, it changes by
U_k = A(i f_k P), f_k a phase of first and second order there, and the image by 2 Re(U* U_k). A number that
is made of both is followed back through four fields at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.operators.part_images import PartImages
from lumigraph.operators.part_sight import Sight, Spot
from lumigraph.operators.part_waves import Both, Slopes, Waves, Where, factor, read_anew, times
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

    images: PartImages
    points: Points
    moved: Sequence[Where]
    _slopes: Slopes = field(default_factory=Slopes)
    _pupil: tuple[float, np.ndarray] | None = None

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.moved))

    @single_products()
    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image of a point and its derivatives by y, x and dz (4, ny, nx) [1/m], and the way back from there.

        As of `place_changes`: how much light a sample stands for, by its depth, is not differentiated.
        """
        own, spot = self._own, self._spots[number]
        still = Waves.of(own, spot)
        waves = [still, *(still.turned(own, move) for move in own.moves(spot))]
        light = np.zeros((4, *own.shape))
        for k, one in enumerate(waves):
            both = np.real(still.field.conj() * one.field)
            light[(k, *spot.window)] = spot.intensity * (2 if k else 1) * both
        pixels = np.stack([own.read.forward(one) for one in light])
        return pixels, partial(self._back, spot, waves, light, pixels)

    @single_products()
    def along(self) -> np.ndarray:
        """(n,) changes of the sum of all numbers, from the first to the last camera of each pair."""
        self._leave_depth()
        slopes = [
            self._slopes.along(first.anew, last.anew, where)
            for (first, last), where in zip(self._ends, self.moved, strict=True)
        ]
        return self._found + 2 * np.array(slopes)

    @single_products()
    def _back(
        self, spot: Spot, waves: list[Waves], light: np.ndarray, pixels: np.ndarray, given: np.ndarray
    ) -> None:
        seen = [spot.intensity * self._own.read.adjoint(one)[spot.window] for one in given]
        fields = [one.field.conj() for one in waves]
        by_own = self._slopes.add(waves[0], np.multiply(seen, fields).sum(0))
        moves = []
        for one, part, move in zip(waves[1:], seen[1:], self._own.moves(spot), strict=True):
            by = self._slopes.add(one, part * fields[0])
            by_own += by * factor(move)
            turned = np.real(1j * by * waves[0].pupil)
            moves.append((turned.sum(1), turned.sum(0)))
        self._slopes.add_moves(spot, moves)
        self._by_pupil(spot.dz, by_own)
        brighter = float(np.vdot(given, pixels)) / spot.intensity
        for k, (both, where) in enumerate(zip(self._ends, self.moved, strict=True)):
            low, high = (points.intensities[spot.number] for points in where)
            self._found[k] += brighter * (high - low)
            self._found[k] += sum(read_anew(both, *pair) for pair in zip(light, given, strict=True))

    def _by_pupil(self, dz: float, by: np.ndarray) -> None:
        """Adds slopes by the wave in the main lens, of one depth after the other."""
        if self._pupil is not None and self._pupil[0] == dz:
            self._pupil[1][...] += by
            return
        self._leave_depth()
        self._pupil = dz, by

    def _leave_depth(self) -> None:
        if self._pupil is not None:
            dz, by = self._pupil
            self._found += [2 * times(by, *(one.anew.pupil(dz) for one in both)) for both in self._ends]
            self._pupil = None

    @cached_property
    def _own(self) -> Sight:
        return Sight.of(self.images.camera, self.points, self.images.accuracy)

    @cached_property
    def _ends(self) -> list[Both]:
        return self.images.ends(self._own)

    @cached_property
    def _spots(self) -> dict[int, Spot]:
        return {spot.number: spot for spot in self._own.spots(self.points)}
