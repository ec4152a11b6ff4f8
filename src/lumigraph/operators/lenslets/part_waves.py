"""A point's light on its way through a camera with lenslets: how it changes, and the way back."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.operators.lenslets.line_parts import Key
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint, Turn
from lumigraph.operators.lenslets.transmitted import LensletGradient as ByPieces
from lumigraph.operators.lenslets.transmitted import TransmittedLight, changed_pieces, passed, times
from lumigraph.scene import Points

Both = tuple[SampledCamera, SampledCamera]
"""Of a pair."""

Where = tuple[Points, Points]
"""Where points are before both, and how bright."""

Phases = Callable[[SampledCamera, SourcePoint], Sequence[Turn]]
"""Phases of a point's light, each the product or the sum of two parts."""


@dataclass(frozen=True, slots=True, eq=False)
class PointWaves:
    """A point's light on its way.

    Parameters
    ----------
    spot
        The point's.
    turns, phases
        Along both axes, and the factors (places, nodes) of these.
    pupil, right
        Wave in the main lens (nodes, nodes), and from there along x: (nodes, places).
    passed
        Past the lenslets.
    """

    spot: SourcePoint
    turns: tuple[Turn, Turn]
    phases: tuple[np.ndarray, ...]
    pupil: np.ndarray
    right: np.ndarray
    passed: TransmittedLight

    @classmethod
    def of(cls, own: SampledCamera, spot: SourcePoint) -> "PointWaves":
        """Of a point before a camera."""
        turns = own.turns(spot)
        phases = tuple(np.exp(1j * np.outer(*turn)) for turn in turns)
        return cls._of(own, spot, (turns, phases), own.pupil(spot))

    def turned(self, own: SampledCamera, phase: Turn) -> "PointWaves":
        """How they change with a phase in the main lens, a sum of one along y and one along x [rad]."""
        return self._of(own, self.spot, (self.turns, self.phases), factor(phase) * self.pupil)

    @classmethod
    def _of(cls, own: SampledCamera, spot: SourcePoint, ways: Any, pupil: np.ndarray) -> "PointWaves":
        turns, (y, x) = ways
        right = pupil @ x.T
        return cls(spot, turns, (y, x), pupil, right, passed(own.lenslets, y @ right, *spot.cells))

    @property
    def field(self) -> np.ndarray:
        """On the samples (y, x)."""
        return self.passed.field

    def changed(self, own: SampledCamera, by: "CameraChange") -> np.ndarray:
        """Change of the field with the camera."""
        moved = []
        for k, (turn, (places, nodes)) in enumerate(zip(self.turns, by.turns(self), strict=True)):
            moved.append(1j * (np.outer(places, turn[1]) + np.outer(turn[0], nodes)) * self.phases[k])
        y, x = self.phases
        light = moved[0] @ self.right + y @ (by.pupil(own, self.spot) @ x.T + self.pupil @ moved[1].T)
        return self.passed.changed(light, by.pieces.__getitem__)


@dataclass(frozen=True, slots=True, eq=False)
class CameraChange:
    """Of a camera: so many times from the first to the last of each pair.

    Parameters
    ----------
    pairs
        Times, cameras, and where points are before both.
    pieces
        Change of the lenslets' matrices.
    """

    pairs: tuple[tuple[float, Both, Where | None], ...]
    pieces: dict[Key, np.ndarray]
    _pupils: dict[tuple[float, ...], np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        own: SampledCamera,
        pairs: Iterable[tuple[float, Both, Where | None]],
        spots: Sequence[SourcePoint],
    ) -> "CameraChange":
        """For some points."""
        lit = {key for spot in spots for key in own.lenslets.keys(*spot.cells)}
        known = [(weight, (both[0].anew, both[1].anew), where) for weight, both, where in pairs]
        lenslets = ((weight, low.lenslets, high.lenslets) for weight, (low, high), _ in known)
        return cls(tuple(known), changed_pieces(own.lenslets, list(lenslets), lit))

    def sum(self, of: Callable[[SampledCamera], np.ndarray]) -> Any:
        """Change of what is made of a camera."""
        return sum(weight * (of(last) - of(first)) for weight, (first, last), _ in self.pairs)

    def turns(self, waves: PointWaves) -> list[Turn]:
        """Of a point's `SampledCamera.turns`, along y and along x."""
        found = [[np.zeros(len(part)) for part in turn] for turn in waves.turns]
        for weight, both, where in self.pairs:
            first, last = map(SampledCamera.turns, both, before(waves.spot, where))
            for axis, part in np.ndindex(2, 2):
                found[axis][part] += weight * (last[axis][part] - first[axis][part])
        return [(places, nodes) for places, nodes in found]

    def pupil(self, own: SampledCamera, spot: SourcePoint) -> np.ndarray:
        """Of a point's wave in the main lens."""
        if (key := own.seen_from(spot)) not in self._pupils:
            self._pupils.clear()
            found = np.zeros_like(own.pupil(spot))
            for weight, both, where in self.pairs:
                first, last = pupils(spot, both, where)
                if first is not last:
                    found += weight * (last - first)
            self._pupils[key] = found
        return self._pupils[key]


@dataclass(slots=True, eq=False)
class PointGradient:
    """What a number made of images changes by as what cameras do to points (halved)."""

    _pieces: ByPieces = field(default_factory=ByPieces)
    _of: list[tuple[Phases, SourcePoint, list[Turn]]] = field(default_factory=list)

    def add(self, waves: PointWaves, by: np.ndarray) -> np.ndarray:
        """Those by a point's field (y, x); returned, those by the wave in the main lens (nodes, nodes)."""
        y, x = waves.phases
        light = waves.passed.back(by, self._pieces)
        above = y.T @ light
        ways = light @ waves.right.T, above.T @ waves.pupil
        self._of.append(
            (SampledCamera.turns, waves.spot, [self._turn(waves, k, way) for k, way in enumerate(ways)])
        )
        return above @ x

    def add_moves(self, spot: SourcePoint, by: list[Turn]) -> None:
        """Those by a point's `SampledCamera.moves`."""
        self._of.append((SampledCamera.moves, spot, by))

    @staticmethod
    def _turn(waves: PointWaves, which: int, by: np.ndarray) -> Turn:
        """By places and nodes along an axis, of those by the phases' factors."""
        by, (places, nodes) = by * 1j * waves.phases[which], waves.turns[which]
        return np.real(by @ nodes), np.real(places @ by)

    def between(self, both: Both, pupil: np.ndarray, where: Where | None = None) -> float:
        """From one camera to the other (not halved); `pupil`, slopes by the wave there of the only depth."""
        found = times(pupil, *pupils(self._of[0][1], both, where))
        return 2 * (found + self.along(both, where))

    def along(self, both: Both, where: Where | None = None) -> float:
        """From one camera to another close by, before which points are elsewhere."""
        first, last = both
        found = self._pieces.along(first.own.lenslets, first.lenslets, last.lenslets)
        for of, spot, slopes in self._of:
            for by, *ends in zip(slopes, *map(of, (first, last), before(spot, where)), strict=True):
                found += sum(times(*pieces) for pieces in zip(by, *ends, strict=True))
        return found


@dataclass(eq=False)
class PairChanges:
    """What a number made of images changes by between the cameras of each pair, point after point.

    Parameters
    ----------
    own
        The camera itself.
    ends, moved
        (n,), the cameras, and where points are before both.
    """

    own: SampledCamera
    ends: Sequence[Both]
    moved: Sequence[Where | None]
    slopes: PointGradient = field(default_factory=PointGradient)
    _pupil: tuple[SourcePoint, np.ndarray] | None = None

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.ends))

    def add(self, waves: PointWaves, by: np.ndarray) -> None:
        """Slopes by a point's field (y, x)."""
        self.add_pupil(waves.spot, self.slopes.add(waves, by))

    def add_pupil(self, spot: SourcePoint, by: np.ndarray) -> None:
        """Slopes by the wave in the main lens, of one depth or field after the other."""
        if self._pupil is not None and self.own.seen_from(self._pupil[0]) == self.own.seen_from(spot):
            self._pupil[1][...] += by
            return
        self._leave()
        self._pupil = spot, by

    def along(self) -> np.ndarray:
        """(n,), from the first to the last camera of each pair."""
        self._leave()
        pairs = zip(self.ends, self.moved, strict=True)
        found = [self.slopes.along((first.anew, last.anew), where) for (first, last), where in pairs]
        return 2 * (self._found + found)

    def _leave(self) -> None:
        if self._pupil is not None:
            spot, by = self._pupil
            pairs = zip(self.ends, self.moved, strict=True)
            self._found += [times(by, *pupils(spot, *pair)) for pair in pairs]
            self._pupil = None


def before(spot: SourcePoint, where: Where | None) -> tuple[SourcePoint, SourcePoint]:
    """A point before both of a pair."""
    return (spot, spot) if where is None else (spot.before(where[0]), spot.before(where[1]))


def pupils(spot: SourcePoint, both: Both, where: Where | None) -> tuple[np.ndarray, np.ndarray]:
    """Its waves in the main lenses."""
    first, last = (one.anew.pupil(mine) for one, mine in zip(both, before(spot, where), strict=True))
    return first, last


def factor(change: Turn) -> np.ndarray:
    """By which a wave changes with a phase that is a sum of one along y and one along x [rad]."""
    return 1j * (change[0][:, None] + change[1])


def read_anew(both: Both, light: np.ndarray, weights: np.ndarray) -> float:
    """What weighed pixels change by as what they take of the samples' light does."""
    first, last = both
    if first.read is last.read:
        return 0.0
    return times(weights, *(one.read.forward(light) for one in both))
