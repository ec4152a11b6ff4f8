r"""Images of points before exact lenslets, and how they change with whatever changes of a camera.

As `part_images` has it, :math:`I = R\,|U|^2`. The light U in the lenslet plane is a sum over directions
(`exact_waves`), of a stop whose phase, strength and edge are smooth in them: from one camera to another close
by they change by few numbers. Lenslets are sums of terms, singular vectors; those of other cameras are as
many, and turned so that they go over into the camera's own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import numpy as np
from numpy.polynomial import chebyshev

from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError
from lumigraph.operators import cells as _cells
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.exact import interpolated
from lumigraph.operators.exact_light import Oblique
from lumigraph.operators.exact_waves import Beams
from lumigraph.operators.line_parts import Key
from lumigraph.operators.paraxial import is_possible
from lumigraph.operators.part_images import Images, Weighed, check_parts
from lumigraph.operators.part_points import SteppedPoints
from lumigraph.operators.part_sight import Sight, Spot
from lumigraph.operators.part_waves import Where, before, times
from lumigraph.operators.passed import Slopes
from lumigraph.operators.point_changes import PUPIL
from lumigraph.operators.points import share
from lumigraph.operators.relay import Straight
from lumigraph.scene import Points

SMOOTH = 24
"""Numbers along an axis of directions that changes of the stop's phase and strength follow from."""

TOGETHER = 4
"""Cells along an axis whose points take the lenslets' terms to be the same."""

Pieces = Callable[[Key], np.ndarray]

Numbers = list[np.ndarray]
"""What a point's light follows from, as far as cameras close by differ by it."""

Both = tuple["ExactSight", "ExactSight"]


@dataclass(frozen=True, eq=False)
class ExactImages(Images):
    """Of an exact camera; see `Images`.

    Parameters
    ----------
    camera
        With square lenslets, exact, behind a thin lens for all fields.
    pairs, accuracy
        As of `Images`.

    Raises
    ------
    GeometryError
        Another camera; one of a pair that has another number of pixels or lenslets.
    SamplingError
        An accuracy out of 1e-3 to 1e-2.
    """

    def __post_init__(self) -> None:
        check_parts(self.camera, self.pairs, self.accuracy, require_exact)

    def before(
        self, points: Points, moved: Sequence[Where] | None = None, fewest: int = PUPIL
    ) -> tuple["ExactSight", Points, list[Where | None]]:
        """As of `Images`."""
        where: list[Where | None] = [None] * len(self.pairs) if moved is None else [*moved]
        return ExactSight.of(self.camera, points, self.accuracy, fewest), points, where

    def ends(self, own: "ExactSight") -> list[Both]:
        """As of `Images`."""
        return [(own.alike(first), own.alike(last)) for first, last in self.pairs]

    def waves(self, own: "ExactSight", spot: Spot) -> "_Seen":
        """As of `Images`."""
        return _Seen.of(own, spot)

    def changing(
        self, own: "ExactSight", spots: Sequence[Spot], pairs: Sequence[Weighed]
    ) -> Callable[["_Seen"], np.ndarray]:
        """As of `Images`."""
        pieces = _changed_pieces(own, spots, [(weight, cast(Both, both)) for weight, both, _ in pairs])

        def changed(seen: "_Seen") -> np.ndarray:
            ends = [(weight, *_both(seen, cast(Both, both), where)) for weight, both, where in pairs]
            by = [
                sum((w * (high[k] - low[k]) for w, low, high in ends), 0 * own)
                for k, own in enumerate(seen.own)
            ]
            return seen.changed(by, pieces.__getitem__)

        return changed

    def slopes(self, own: "ExactSight", ends: list[Both], where: list[Where | None]) -> "_Told":
        """As of `Images`."""
        return _Told(ends, where, np.zeros(len(ends)))


@dataclass(eq=False)
class _Told:
    """`part_images.Told` by what a point's light follows from, and by lenslets' matrices."""

    ends: list[Both]
    where: list[Where | None]
    found: np.ndarray
    by: Slopes = field(default_factory=Slopes)

    def add(self, waves: "_Seen", by: np.ndarray) -> None:
        mine = waves.back(by, self.by)
        for k, pair in enumerate(zip(self.ends, self.where, strict=True)):
            self.found[k] += sum(times(*pieces) for pieces in zip(mine, *_both(waves, *pair), strict=True))

    def along(self) -> np.ndarray:
        return 2 * (self.found + [_slopes_along(self.by, both) for both in self.ends])


class ExactSight(Sight):
    """An exact camera before points, and how finely all is sampled."""

    def light(self, spot: Spot) -> Oblique:
        """As `Sight.light`."""
        optics = self._at(spot.dz)
        y, x = self._place(optics, spot.position).tolist()
        return Oblique(optics.camera, _cells.lens(optics.camera), optics.distance, self.nodes, (y, x))

    def strength(self, spot: Spot) -> float:
        """Logarithm of how strong the light of a point of 1 is."""
        return float(np.log(share(self._at(spot.dz)))) / 2

    def around(self, spot: Spot, light: Oblique) -> tuple[np.ndarray, np.ndarray]:
        """Phases (along y, along x) of the places where light is needed [rad, by the cosine]."""
        k = 2 * np.pi / light.camera.wavelength
        y, x = (at - to for at, to in zip(self.lenslets.places(*spot.cells), light.place, strict=True))
        return k * y, k * x

    def piece(self, key: Key) -> np.ndarray:
        """A matrix (terms, samples, window), by axis, cell, and the cells that it is taken alike for."""
        which, cell, rows, columns = cast(tuple[int, int, range, range], key)
        relay = cast(Straight, self.lenslets)
        box = relay.box(rows, columns)
        if self.like is not None and self.like.lenslets is not relay:
            own = cast(Straight, self.like.lenslets)
            relay.align(box, own, own.box(rows, columns))
        return relay.matrix(which, cell, box)


@dataclass(frozen=True, eq=False)
class _Seen:
    """A point's light, before and behind the lenslets.

    Parameters
    ----------
    sight, spot
        The camera's, and the point's.
    within
        How far inside the stop's edge directions are [samples], and a half.
    beams, passed
        In the lenslet plane, and to the samples.
    """

    sight: ExactSight
    spot: Spot
    within: np.ndarray
    beams: Beams
    passed: "_Passed"

    @classmethod
    def of(cls, sight: ExactSight, spot: Spot) -> "_Seen":
        """Of a point before a camera."""
        light = sight.light(spot)
        y, x = light.directions
        over = light.over(y[:, None], x)
        stop = over.amplitude * np.exp(sight.strength(spot))
        beams = Beams.of(sight.around(spot, light), (y, x), stop, over.bends)
        return cls(sight, spot, over.within, beams, _Passed.of(sight, beams.light, spot.cells))

    @property
    def field(self) -> np.ndarray:
        """On the samples (y, x)."""
        return self.passed.field

    @cached_property
    def own(self) -> Numbers:
        """Of the camera itself."""
        return self._numbers(self.sight, self.spot)

    def numbers(self, other: ExactSight, spot: Spot | None = None) -> Numbers:
        """Of a camera close by, and of a point close by; `own` where nothing differs."""
        same = other.before == self.sight.before and other.lenslets is self.sight.lenslets
        if same and (spot is None or spot is self.spot):
            return self.own
        return self._numbers(other, self.spot if spot is None else spot)

    def changed(self, by: Numbers, change: Pieces) -> np.ndarray:
        """Change (y, x) of the field with these numbers and with the lenslets' matrices."""
        down, across, *directions, smooth, within = by
        phase, strength, *bends = self._smooth @ smooth @ self._smooth.T
        stop = self.beams.stop * (strength + 1j * phase)
        stop[self._grey] += self.beams.stop[self._grey] / self.within[self._grey] * within
        moves = (down, across), (directions[0], directions[1]), stop, np.stack(bends)
        return self.passed.changed(self.beams.changed(moves), change)

    def back(self, by: np.ndarray, slopes: Slopes) -> Numbers:
        """Slopes by the numbers, of those by the field; those by matrices are added."""
        (down, across), directions, slope, bends = self.beams.back(self.passed.back(by, slopes))
        slope = slope * self.beams.stop
        stronger = np.real(slope)
        smooth = self._smooth.T @ np.stack([-np.imag(slope), stronger, *bends]) @ self._smooth
        return [down, across, *directions, smooth, stronger[self._grey] / self.within[self._grey]]

    def _numbers(self, sight: ExactSight, spot: Spot) -> Numbers:
        light = sight.light(spot)
        nodes, _ = interpolated(SMOOTH)
        y, x = ((d[-1] + d[0]) / 2 + (d[-1] - d[0]) / 2 * nodes for d in light.directions)
        over = light.over(y[:, None], x)
        smooth = np.stack([over.phase, over.strength + sight.strength(spot), *over.bends])
        grey = light.over(*(d[k] for d, k in zip(light.directions, self._grey, strict=True)))
        return [*sight.around(spot, light), *light.directions, smooth, grey.within]

    @cached_property
    def _grey(self) -> tuple[np.ndarray, ...]:
        """Directions at the stop's edge, which are let through in part."""
        return np.nonzero((self.within > 0) & (self.within < 1))

    @cached_property
    def _smooth(self) -> np.ndarray:
        """From numbers at the nodes to all directions of an axis, which stand evenly."""
        at = np.linspace(-1, 1, len(self.within))
        return chebyshev.chebvander(at, SMOOTH - 1) @ interpolated(SMOOTH)[1]


@dataclass(frozen=True, slots=True, eq=False)
class _Passed:
    """Light behind lenslets, of several terms: as `passed.Passed`, along y (`down`), then along x."""

    sight: ExactSight
    cells: tuple[range, range]
    light: np.ndarray
    down: np.ndarray
    field: np.ndarray

    @classmethod
    def of(cls, sight: ExactSight, light: np.ndarray, cells: tuple[range, range]) -> "_Passed":
        """To the samples of some cells."""
        down = _along(sight, sight.piece, (0, cells), light[None])
        across = _along(sight, sight.piece, (1, cells), down.transpose(0, 2, 1))
        return cls(sight, cells, light, down, across.sum(0).T)

    def changed(self, light: np.ndarray, change: Pieces) -> np.ndarray:
        """As `passed.Passed.changed`."""
        own, sight, first, then = self.sight.piece, self.sight, (0, self.cells), (1, self.cells)
        down = _along(sight, change, first, self.light[None]) + _along(sight, own, first, light[None])
        moved = _along(sight, change, then, self.down.transpose(0, 2, 1))
        return (moved + _along(sight, own, then, down.transpose(0, 2, 1))).sum(0).T

    def back(self, by: np.ndarray, slopes: Slopes) -> np.ndarray:
        """As `passed.Passed.back`."""
        down = self._back(1, self.down.transpose(0, 2, 1), by.T[None], slopes)
        return self._back(0, self.light[None], down.transpose(0, 2, 1), slopes).sum(0)

    def _back(self, which: int, light: np.ndarray, by: np.ndarray, slopes: Slopes) -> np.ndarray:
        """Along an axis, of light (terms, places, n) and of slopes by the samples (terms, samples, n)."""
        found: list[np.ndarray] = []
        lenslets, n = cast(Straight, self.sight.lenslets), self.sight.optics.axes[which].samples
        for k, key in enumerate(_keys(which, self.cells)):
            part, window, piece = by[:, k * n : (k + 1) * n], lenslets.window(which, k), self.sight.piece(key)
            slopes.add(key, part @ light[:, window].transpose(0, 2, 1))
            if not found:
                found.append(np.zeros((len(piece), *light.shape[1:]), complex))
            found[0][:, window] += piece.transpose(0, 2, 1) @ part
        return found[0]


def _along(
    sight: ExactSight, pieces: Pieces, where: tuple[int, tuple[range, range]], light: np.ndarray
) -> np.ndarray:
    """Amplitudes (terms, samples, n) of some cells along an axis, of light (1 or terms, places, n)."""
    lenslets, (which, cells) = cast(Straight, sight.lenslets), where
    parts = [pieces(key) @ light[:, lenslets.window(which, k)] for k, key in enumerate(_keys(which, cells))]
    return np.concatenate(parts, axis=1)


def _keys(which: int, cells: tuple[range, range]) -> list[Key]:
    """Of the matrices along an axis; cells beside each other have those of all around them."""
    wide = (range(c.start // TOGETHER * TOGETHER, -(-c.stop // TOGETHER) * TOGETHER) for c in cells)
    rows, columns = wide
    return [(which, cell, rows, columns) for cell in cells[which]]


class ExactPoints(SteppedPoints):
    """Points one by one, before an exact camera."""

    @cached_property
    def _lenslets(self) -> Slopes:
        return Slopes()

    @single_products()
    def along(self) -> np.ndarray:
        """As of paraxial cameras."""
        ends = cast(list[Both], self._ends)
        return self._found + 2 * np.array([_slopes_along(self._lenslets, both) for both in ends])

    def _wave(self, spot: Spot) -> _Seen:
        return _Seen.of(cast(ExactSight, self._own), spot)

    def _return(self, wave: _Seen, by: np.ndarray) -> None:
        slopes = wave.back(by, self._lenslets)
        for k, pair in enumerate(zip(cast(list[Both], self._ends), self._moved, strict=True)):
            self._found[k] += 2 * sum(
                times(*pieces) for pieces in zip(slopes, *_both(wave, *pair), strict=True)
            )


def _both(wave: _Seen, both: Both, where: Where | None) -> tuple[Numbers, Numbers]:
    """Of the cameras of a pair, and of the point where it is before them."""
    low, high = (wave.numbers(one, mine) for one, mine in zip(both, before(wave.spot, where), strict=True))
    return low, high


def _changed_pieces(
    own: ExactSight, spots: Sequence[Spot], pairs: Sequence[tuple[float, Both]]
) -> dict[Key, np.ndarray]:
    """Change of all matrices that points see."""
    keys = {key for spot in spots for which in (0, 1) for key in _keys(which, spot.cells)}
    found = {key: np.zeros_like(own.piece(key)) for key in keys}
    for weight, (low, high) in pairs:
        if low.lenslets is not high.lenslets:
            first, last = low.anew, high.anew
            for key in keys:
                found[key] += weight * (last.piece(key) - first.piece(key))
    return found


def _slopes_along(slopes: Slopes, both: Both) -> float:
    """What changes with the lenslets' matrices, from one camera to another (halved)."""
    if both[0].lenslets is both[1].lenslets:
        return 0.0
    first, last = both[0].anew, both[1].anew
    return sum(times(by, first.piece(key), last.piece(key)) for key, by in slopes.of.items())


def require_exact(camera: CameraOptics) -> None:
    """Refuse cameras that `ExactImages` are not of."""
    array = camera.array
    plain = array is not None and array.scatter is None and camera.objects is None
    if not (plain and camera.model == "exact" and is_possible(camera)):
        raise GeometryError(
            "derivatives by a camera's parts with model = 'exact' are of square lenslets of one focal length "
            "that are alike, behind a thin lens, and all cameras have that model. Leave over_field, "
            "prescription and scatter out, or use model = 'paraxial' for all."
        )
