r"""Images of points before a camera with lenslets, and how they change with whatever changes of it.

A point's light is a product of matrices, and a raw image what pixels take of its square,

.. math:: I = R\,|U|^2, \quad U = A(E_y P E_x^T), \quad
          \delta I = R\,2\,\mathrm{Re}(U^* \delta U) + \delta R\,|U|^2

with P the wave in the main lens, E phases of nodes there times those of places before the lenslets, and A
the way past these, whose steps are each linear in a matrix (`passed`). How all matrices change with a length,
the wavelength or a term of the phase is the difference of two cameras a little apart, sampled alike; all else
is differentiated. What is made of the image is followed back to them once, so that each camera more
costs no product of large matrices.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.camera import CameraOptics, HasOptics
from lumigraph.operators.fineness import COARSEST
from lumigraph.operators.line_parts import Key
from lumigraph.operators.paraxial import resolved
from lumigraph.operators.part_sight import Sight, Spot, Turn
from lumigraph.operators.passed import Passed, Slopes, passed
from lumigraph.operators.point_changes import has_changes
from lumigraph.scene import Points

FINEST = 1e-3
"""Accuracy that can be asked for: finer ones would need many samples across the main lens."""

Pair = tuple[HasOptics, HasOptics]
"""Cameras a little to either side."""


@dataclass(frozen=True, eq=False)
class PartImages:
    """How a camera sees points, with derivatives by what differs between pairs of cameras.

    Points shine as samples of the camera's own object grid, as `simulate` has them.

    Parameters
    ----------
    camera
        With lenslets of any shape and focal lengths, paraxial, behind a thin lens for all fields.
    pairs
        (n,), cameras a little to either side of it: by a length, a term of the phase, the wavelength.
    accuracy
        Relative rms error of points' images.

    Raises
    ------
    GeometryError
        Another camera; one of a pair that has another number of pixels or lenslets.
    SamplingError
        An accuracy out of 1e-3 to 1e-2.
    """

    camera: CameraOptics
    pairs: tuple[tuple[CameraOptics, CameraOptics], ...]
    accuracy: float = 1e-2

    def __post_init__(self) -> None:
        if not FINEST <= self.accuracy <= COARSEST:
            raise SamplingError(
                f"accuracy is {self.accuracy:g} but must lie between {FINEST:g} and {COARSEST:g}."
            )
        for one in (self.camera, *(end for pair in self.pairs for end in pair)):
            _require_paraxial(one)
            _require_as_many(one, self.camera)

    @classmethod
    def of(cls, camera: HasOptics, pairs: Sequence[Pair], accuracy: float = 1e-2) -> "PartImages":
        """Of instruments."""
        plain = tuple((resolved(a.optics(), accuracy), resolved(b.optics(), accuracy)) for a, b in pairs)
        return cls(resolved(camera.optics(), accuracy), plain, accuracy)

    @property
    def shape(self) -> tuple[int, int]:
        """Of a raw image."""
        return self.camera.sensor.shape

    @single_products()
    def forward(self, points: Points) -> np.ndarray:
        """Raw image (ny, nx) of points."""
        own = Sight.of(self.camera, points, self.accuracy)
        light = np.zeros(own.shape)
        for spot in own.spots(points):
            light[spot.window] += spot.intensity * np.abs(_Waves.of(own, spot).field) ** 2
        return own.read.forward(light)

    @single_products()
    def derivative(self, points: Points, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward`, so many times (n,) from the first to the last camera of each pair."""
        if np.shape(change) != (len(self.pairs),):
            raise GeometryError(f"change has shape {np.shape(change)} but must be ({len(self.pairs)},).")
        own = Sight.of(self.camera, points, self.accuracy)
        light, moved, spots = np.zeros(own.shape), np.zeros(own.shape), own.spots(points)
        by = _Change.of(
            own, zip(np.asarray(change, np.float64).tolist(), self._ends(own), strict=True), spots
        )
        for spot in spots:
            waves = _Waves.of(own, spot)
            light[spot.window] += spot.intensity * np.abs(waves.field) ** 2
            moved[spot.window] += 2 * spot.intensity * np.real(waves.field.conj() * waves.changed(own, by))
        return own.read.forward(moved) + by.sum(lambda one: one.read.forward(light))

    @single_products()
    def gradient(self, points: Points, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels."""
        if np.shape(weights) != self.shape:
            raise GeometryError(f"weights have shape {np.shape(weights)} but the raw image {self.shape}.")
        own = Sight.of(self.camera, points, self.accuracy)
        seen, by = own.read.adjoint(np.asarray(weights, np.float64)), _Slopes(np.zeros(own.shape))
        found, ends = np.zeros(len(self.pairs)), list(self._ends(own))
        for dz, spots in groupby(own.spots(points), lambda spot: spot.dz):
            pupil = sum((by.add(own, _Waves.of(own, spot), seen) for spot in spots), np.zeros(()))
            found += [_times(pupil, *(one.anew.pupil(dz) for one in both)) for both in ends]
        return 2 * (found + [by.along(first.anew, last.anew, weights) for first, last in ends])

    def _ends(self, own: Sight) -> Iterator[tuple[Sight, Sight]]:
        """Cameras of each pair."""
        return ((own.alike(first), own.alike(last)) for first, last in self.pairs)


Both = tuple[Sight, Sight]
"""Of a pair."""


@dataclass(frozen=True, slots=True, eq=False)
class _Waves:
    """A point's light on its way.

    Parameters
    ----------
    spot
        The point's.
    turns, phases
        Along both axes, and the factors (places, nodes) of these.
    right
        From the pupil along x: (nodes, places).
    passed
        Past the lenslets.
    """

    spot: Spot
    turns: tuple[Turn, Turn]
    phases: tuple[np.ndarray, ...]
    right: np.ndarray
    passed: Passed

    @classmethod
    def of(cls, own: Sight, spot: Spot) -> "_Waves":
        turns = own.turns(spot)
        y, x = phases = tuple(np.exp(1j * np.outer(*turn)) for turn in turns)
        right = own.pupil(spot.dz) @ x.T
        return cls(spot, turns, phases, right, passed(own.lenslets, y @ right, *spot.cells))

    @property
    def field(self) -> np.ndarray:
        """On the samples (y, x)."""
        return self.passed.field

    def changed(self, own: Sight, by: "_Change") -> np.ndarray:
        """Change of the field with the camera."""
        moved, pupil = [], own.pupil(self.spot.dz)
        for k, turn in enumerate(self.turns):
            places, nodes = (by.sum(lambda one, k=k, j=j: one.turns(self.spot)[k][j]) for j in (0, 1))
            moved.append(1j * (np.outer(places, turn[1]) + np.outer(turn[0], nodes)) * self.phases[k])
        y, x = self.phases
        light = moved[0] @ self.right + y @ (by.pupil(self.spot.dz) @ x.T + pupil @ moved[1].T)
        return self.passed.changed(light, by.pieces.__getitem__)


@dataclass(frozen=True, slots=True, eq=False)
class _Change:
    """Of a camera: so many times from the first to the last of each pair.

    Parameters
    ----------
    pairs
        Times, and cameras.
    pieces
        Change of the lenslets' matrices.
    """

    pairs: tuple[tuple[float, Both], ...]
    pieces: dict[Key, np.ndarray]
    _pupils: dict[float, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(cls, own: Sight, pairs: Iterable[tuple[float, Both]], spots: Sequence[Spot]) -> "_Change":
        """For some points."""
        lit = {key for spot in spots for key in own.lenslets.keys(*spot.cells)}
        known, pieces = [], {key: np.zeros_like(own.lenslets.piece(key)) for key in lit}
        for weight, both in pairs:
            first, last = (one.lenslets for one in both)
            for key in lit if first is not last else ():
                pieces[key] += weight * (last.piece(key) - first.piece(key))
            known.append((weight, (both[0].anew, both[1].anew)))
        return cls(tuple(known), pieces)

    def sum(self, of: Callable[[Sight], np.ndarray]) -> Any:
        """Change of what is made of a camera."""
        return sum(weight * (of(last) - of(first)) for weight, (first, last) in self.pairs)

    def pupil(self, dz: float) -> np.ndarray:
        """Of the wave in the main lens."""
        if dz not in self._pupils:
            self._pupils.clear()
            self._pupils[dz] = self.sum(lambda one: one.anew.pupil(dz))
        return self._pupils[dz]


@dataclass(slots=True, eq=False)
class _Slopes:
    """What a sum of weighed samples changes by as what cameras do to points (halved).

    Parameters
    ----------
    light
        Of all samples.
    """

    light: np.ndarray
    _pieces: Slopes = field(default_factory=Slopes)
    _turns: list[tuple[Spot, list[Turn]]] = field(default_factory=list)

    def add(self, own: Sight, waves: _Waves, seen: np.ndarray) -> np.ndarray:
        """Those of a point, by weights of all samples; returned, those by the pupil (nodes, nodes)."""
        spot, (y, x) = waves.spot, waves.phases
        self.light[spot.window] += spot.intensity * np.abs(waves.field) ** 2
        light = waves.passed.back(spot.intensity * seen[spot.window] * waves.field.conj(), self._pieces)
        above = y.T @ light
        ways = light @ waves.right.T, above.T @ own.pupil(spot.dz)
        self._turns.append((spot, [self._turn(waves, k, way) for k, way in enumerate(ways)]))
        return above @ x

    @staticmethod
    def _turn(waves: _Waves, which: int, by: np.ndarray) -> Turn:
        """By places and nodes along an axis, of those by the phases' factors."""
        by, (places, nodes) = by * 1j * waves.phases[which], waves.turns[which]
        return np.real(by @ nodes), np.real(places @ by)

    def along(self, first: Sight, last: Sight, weights: np.ndarray) -> float:
        """From one camera to another close by; weights (ny, nx) are of the pixels."""
        found, both = 0.0, (first, last)
        if first.lenslets is not last.lenslets:
            for key, by in self._pieces.of.items():
                found += _times(by, *(one.lenslets.piece(key) for one in both))
        for spot, turns in self._turns:
            for by, *ends in zip(turns, *(one.turns(spot) for one in both), strict=True):
                found += sum(_times(*pieces) for pieces in zip(by, *ends, strict=True))
        if first.read is not last.read:
            found += _times(weights, *(one.read.forward(self.light) for one in both)) / 2
        return found


def _times(by: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """What a change from low to high comes to."""
    return 0.0 if low is high else float(np.sum(by * (high - low)).real)


def _require_paraxial(camera: CameraOptics) -> None:
    """Refuse cameras whose light behind lenslets is no product along two axes."""
    array = camera.array
    if not has_changes(camera) or array is None or array.scatter is not None or camera.lean is not None:
        raise GeometryError(
            "derivatives by a camera's parts are of paraxial cameras with lenslets, as drawn and upright, "
            "behind a thin lens. Use model = 'paraxial' without over_field, prescription, tilts and scatter."
        )


def _require_as_many(camera: CameraOptics, other: CameraOptics) -> None:
    """Refuse cameras between which more differs than numbers that change by little."""
    counts = []
    for one in (camera, other):
        extent, pitches = (one.array.extent, one.array.lattice.pitches) if one.array else (None, ())
        counts.append(tuple(round(e / p) for e, p in zip(extent or (), pitches, strict=False)))
    if camera.sensor.shape != other.sensor.shape or counts[0] != counts[1]:
        raise GeometryError(
            f"cameras have {camera.sensor.shape} and {other.sensor.shape} pixels, {counts[0]} and "
            f"{counts[1]} lenslets, but derivatives need as many. Give lenslets.count and sensor.shape."
        )
