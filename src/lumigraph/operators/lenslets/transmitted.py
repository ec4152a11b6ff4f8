"""Light on its way through lenslets: how what comes of it changes with it and with them, and the transpose.

Each step is linear in the light and in one matrix of the lenslets. What a sum of changes by is followed back
without conjugates: it is Re of the products with changes, added up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from lumigraph.operators.lenslets.individual_lenslets import IndividualLenslets, Ways
from lumigraph.operators.lenslets.individual_lenslets import One as Cell
from lumigraph.operators.lenslets.line_parts import ON_LINES, Key, Pieces
from lumigraph.operators.lenslets.lines import LensletPatch, LineRelay, by_row, of_kinds
from lumigraph.operators.lenslets.relay import SeparableRelay

Parted = SeparableRelay | LineRelay | IndividualLenslets
"""Relays whose light can be followed back."""


@dataclass(slots=True, eq=False)
class LensletGradient:
    """What something changes by with lenslets' matrices."""

    of: dict[Key, np.ndarray] = field(default_factory=dict)
    _compared: dict[Key, np.ndarray] = field(default_factory=dict)

    def add(self, key: Key, by: np.ndarray) -> None:
        """With a whole matrix."""
        self.of[key] = self.of[key] + by if key in self.of else by

    def add_columns(self, key: Key, by: np.ndarray, inside: slice, like: np.ndarray) -> None:
        """With some columns of one that is `like` another."""
        if key not in self.of:
            self.of[key] = np.zeros_like(like)
        self.of[key][:, inside] += by

    def along(self, own: "Parted", first: "Parted", last: "Parted") -> float:
        """From one camera's lenslets to those of another, both close to the camera's own (halved)."""
        if first is last:
            return 0.0
        if self.of:  # once for all pairs
            for key, by in (own.back(self.of) if isinstance(own, SeparableRelay) else self.of).items():
                self._compared[key] = self._compared.get(key, 0.0) + by
            self.of = {}
        return sum(times(by, first.piece(key), last.piece(key)) for key, by in self._compared.items())


def changed_pieces(
    own: "Parted", pairs: Sequence[tuple[float, "Parted", "Parted"]], keys: set[Key]
) -> dict[Key, np.ndarray]:
    """Change of matrices, so many times from the first to the last of each pair, all close to the own."""
    compared = own.compared(keys) if isinstance(own, SeparableRelay) else keys
    found = {key: np.zeros_like(own.piece(key)) for key in compared}
    for weight, first, last in pairs:
        for key in found if first is not last else ():
            found[key] += weight * (last.piece(key) - first.piece(key))
    return own.changed(found, keys) if isinstance(own, SeparableRelay) else found


def times(by: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """What a change from low to high comes to."""
    return 0.0 if low is high else float(np.dot(by.ravel(), (high - low).ravel()).real)


class TransmittedLight(Protocol):
    """Light behind the lenslets, and what it follows from."""

    @property
    def field(self) -> np.ndarray:
        """On the samples (y, x)."""
        ...

    def changed(self, light: np.ndarray, change: Pieces) -> np.ndarray:
        """How the field changes with light (y, x) before the lenslets, and with their matrices."""
        ...

    def back(self, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """Slopes by the light, of those by the field (y, x); those by matrices are added."""
        ...


def passed(relay: Parted, light: np.ndarray, rows: range, columns: range) -> TransmittedLight:
    """Light (y, x) at a relay's places, to the samples of some cells."""
    if isinstance(relay, SeparableRelay):
        return _SquareLenslets.of(relay, light, (rows, columns))
    if isinstance(relay, IndividualLenslets):
        return _DifferingLenslets.of(relay, light, (rows, columns))
    if isinstance(relay, LineRelay):
        return _AnyShape.of(relay, light, (rows, columns))
    return relay.passed(light, rows, columns)


@dataclass(frozen=True, slots=True, eq=False)
class _SquareLenslets:
    """Behind square lenslets: along y (`down`; terms, samples, places), then along x; a sum of terms."""

    relay: SeparableRelay
    cells: Ways
    light: np.ndarray
    down: np.ndarray
    field: np.ndarray

    @classmethod
    def of(cls, relay: SeparableRelay, light: np.ndarray, cells: Ways) -> "_SquareLenslets":
        down = _along(relay, relay.piece, (0, cells), light[None])
        across = _along(relay, relay.piece, (1, cells), down.transpose(0, 2, 1))
        return cls(relay, cells, light, down, across.sum(0).T)

    def changed(self, light: np.ndarray, change: Pieces) -> np.ndarray:
        """As `TransmittedLight.changed`."""
        relay, own, first, then = self.relay, self.relay.piece, (0, self.cells), (1, self.cells)
        down = _along(relay, change, first, self.light[None]) + _along(relay, own, first, light[None])
        moved = _along(relay, change, then, self.down.transpose(0, 2, 1))
        return (moved + _along(relay, own, then, down.transpose(0, 2, 1))).sum(0).T

    def back(self, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """As `TransmittedLight.back`."""
        down = self._back(1, self.down.transpose(0, 2, 1), by.T[None], slopes)
        return self._back(0, self.light[None], down.transpose(0, 2, 1), slopes).sum(0)

    def _back(self, which: int, light: np.ndarray, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """Along an axis, of light (1 or terms, places, n) and slopes by the samples (terms, samples, n)."""
        found = np.zeros((len(self.down), *light.shape[1:]), complex)
        n = self.relay.optics.axes[which].samples
        for k, key in enumerate(self.relay.of_cells(which, self.cells)):
            part, window = by[:, k * n : (k + 1) * n], self.relay.window(which, k)
            slopes.add(key, part @ light[:, window].transpose(0, 2, 1))
            found[:, window] += self.relay.piece(key).transpose(0, 2, 1) @ part
        return found


def _along(relay: SeparableRelay, pieces: Pieces, where: tuple[int, Ways], light: np.ndarray) -> np.ndarray:
    """Amplitudes (terms, samples, n) of some cells along an axis, of light (1 or terms, places, n)."""
    which, cells = where
    keys = enumerate(relay.of_cells(which, cells))
    return np.concatenate([pieces(key) @ light[:, relay.window(which, k)] for k, key in keys], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class _AlikeLenslets:
    """Lenslets of a kind: light on the lines (lines, window, n), and along x (lines, k, n)."""

    kind: int
    members: Sequence[LensletPatch]
    seen: np.ndarray
    along: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class _AnyShape:
    """Behind lenslets of any shape.

    Parameters
    ----------
    alike
        Those that are lit.
    few
        Few numbers (k along y, k along x) of each.
    """

    relay: LineRelay
    cells: tuple[range, range]
    light: np.ndarray
    alike: list[_AlikeLenslets]
    few: dict[LensletPatch, np.ndarray]
    field: np.ndarray

    @classmethod
    def of(cls, relay: LineRelay, light: np.ndarray, cells: tuple[range, range]) -> "_AnyShape":
        alike, few, own = [], {}, relay.piece
        for some in relay.lit(light, *cells):
            for kind, mine in of_kinds(some):
                seen = relay.on_lines(own, light, mine)
                alike.append(_AlikeLenslets(kind, mine, seen, relay.along(own, kind, seen)))
                few.update(zip(mine, relay.down(own, kind, alike[-1].along), strict=True))
        relay.add(field := relay.dark(*cells), (own, own), few, cells)
        return cls(relay, cells, light, alike, few, field)

    def changed(self, light: np.ndarray, change: Pieces) -> np.ndarray:
        """As `TransmittedLight.changed`."""
        relay, own, few = self.relay, self.relay.piece, {}
        for one in self.alike:
            seen = relay.on_lines(change, self.light, one.members) + relay.on_lines(own, light, one.members)
            along = relay.along(change, one.kind, one.seen) + relay.along(own, one.kind, seen)
            moved = relay.down(change, one.kind, one.along) + relay.down(own, one.kind, along)
            few.update(zip(one.members, moved, strict=True))
        relay.add(found := relay.dark(*self.cells), (own, own), few, self.cells)
        for ways in ((change, own), (own, change)):
            relay.add(found, ways, self.few, self.cells)
        return found

    def back(self, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """As `TransmittedLight.back`."""
        found, few = np.zeros_like(self.light), self._few_back(by, slopes)
        for one in self.alike:
            mine = np.stack([few[member] for member in one.members], axis=-1)
            seen = self._along_back(one, self._down_back(one, mine, slopes), slopes)
            window = self.relay.around(self.light, one.members)
            slopes.add(ON_LINES, _times(seen, window))
            around = np.tensordot(self.relay.piece(ON_LINES).T, seen, axes=1)
            for k, member in enumerate(one.members):
                found[member.top :, member.left :][: len(window), : window.shape[1]] += around[..., k]
        return found

    def _few_back(self, by: np.ndarray, slopes: LensletGradient) -> dict[LensletPatch, np.ndarray]:
        """By few numbers, of slopes by the samples."""
        relay, own, (rows, columns), found = self.relay, self.relay.piece, self.cells, {}
        for y, row in by_row(self.few):
            mine, behind = relay.cut(0, y, rows), relay.behind(own, row, columns)
            part, carrier = by[mine.there], mine.of(own)
            slopes.add_columns(mine.key, behind @ part.T, mine.inside, own(mine.key))
            part = carrier @ part
            for one, few in row:
                mine = relay.cut(1, one.x, columns)
                there = part[:, mine.there]
                slopes.add_columns(mine.key, few.T @ there, mine.inside, own(mine.key))
                found[one] = there @ mine.of(own).T
        return found

    def _down_back(self, one: _AlikeLenslets, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """By what the lines bring along x, of slopes by few numbers (k along y, k along x, n)."""
        key = "down", one.kind
        slopes.add(key, _times(by, one.along))
        return np.tensordot(self.relay.piece(key).T, by, axes=1)

    def _along_back(self, one: _AlikeLenslets, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """By the light on the lines, of slopes by what these bring along x."""
        key, found = ("along", one.kind), np.empty_like(one.seen)
        across = self.relay.piece(key)
        mine = np.empty_like(across)
        for chord, lines in enumerate(self.relay.like_lines):
            mine[chord] = np.tensordot(by[lines], one.seen[lines], axes=([0, 2], [0, 2]))
            found[lines] = across[chord].T @ by[lines]
        slopes.add(key, mine)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _DifferingLenslets:
    """Behind square lenslets that differ, row after row: what is between is computed again, not kept.

    Parameters
    ----------
    lit
        Rows of lenslets that are not dark, and the columns of each.
    """

    relay: IndividualLenslets
    cells: Ways
    light: np.ndarray
    lit: list[tuple[int, list[int]]]
    field: np.ndarray

    @classmethod
    def of(cls, relay: IndividualLenslets, light: np.ndarray, cells: Ways) -> "_DifferingLenslets":
        lit = relay.lit(light, *cells)
        return cls(relay, cells, light, lit, relay.past(light, lit, cells))

    def changed(self, light: np.ndarray, change: Pieces) -> np.ndarray:
        """As `TransmittedLight.changed`."""
        relay, cells, own = self.relay, self.cells, self.relay.piece
        found = relay.past(light, self.lit, cells)
        for row, members in self.lit:
            beside, moved = relay.unlit(cells), relay.unlit(cells)
            for column in members:
                one = row, column
                window, bend = relay.around(self.light, one, cells), relay.bend(*one)
                bent = relay.on_nodes((own, own), window, one) * bend
                turned = relay.on_nodes((change, own), window, one)
                turned = turned + relay.on_nodes((own, change), window, one)
                turned = turned * bend + 1j * relay.phase(change, *one) * bent
                cut, spread = relay.cut(1, column, cells[1]), relay.spread(one)[1]
                beside[:, cut.there] += bent @ own(spread)[:, cut.inside]
                moved[:, cut.there] += turned @ own(spread)[:, cut.inside]
                moved[:, cut.there] += bent @ change(spread)[:, cut.inside]
            cut, spread = relay.cut(0, row, cells[0]), relay.spread((row, members[0]))[0]
            across = relay.across(members, cells[1])
            found[cut.there, across] += own(spread)[:, cut.inside].T @ moved[:, across]
            found[cut.there, across] += change(spread)[:, cut.inside].T @ beside[:, across]
        return found

    def back(self, by: np.ndarray, slopes: LensletGradient) -> np.ndarray:
        """As `TransmittedLight.back`."""
        relay, own, found = self.relay, self.relay.piece, np.zeros_like(self.light)
        for row, members in self.lit:
            cut, spread = relay.cut(0, row, self.cells[0]), relay.spread((row, members[0]))[0]
            across = relay.across(members, self.cells[1])
            part = by[cut.there, across]
            seen, beside = relay.unlit(self.cells), relay.unlit(self.cells)
            seen[:, across] = own(spread)[:, cut.inside] @ part
            for column in members:
                self._back(found, (row, column), (seen, beside), slopes)
            slopes.add_columns(spread, beside[:, across] @ part.T, cut.inside, own(spread))
        return found

    def _back(
        self, found: np.ndarray, one: Cell, row: tuple[np.ndarray, np.ndarray], slopes: LensletGradient
    ) -> None:
        """Through a lenslet, by slopes on the row's nodes along y; the row's light there is added to."""
        relay, own, (seen, beside) = self.relay, self.relay.piece, row
        window, bend = relay.around(self.light, one, self.cells), relay.bend(*one)
        light, key = relay.light(one), relay.spread(one)[1]
        (down, across), (above, right) = map(own, light), relay.polynomials
        left = down @ window
        bent = (left @ across.T) * bend
        cut = relay.cut(1, one[1], self.cells[1])
        spread = own(key)[:, cut.inside]
        beside[:, cut.there] += bent @ spread
        slopes.add_columns(key, bent.T @ seen[:, cut.there], cut.inside, own(key))
        by = seen[:, cut.there] @ spread.T
        turned = above.T @ np.imag(by * bent) @ right
        number, phases = relay.number(one[1]), ("phases", one[0])
        slopes.add_columns(phases, -turned.reshape(-1, 1), slice(number, number + 1), own(phases))
        by = by * bend
        slopes.add(light[0], by @ (window @ across.T).T)
        slopes.add(light[1], by.T @ left)
        relay.around(found, one, self.cells)[...] += down.T @ by @ across


def _times(by: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Slopes by a matrix from light (m, ...) to what has slopes `by` (n, ...)."""
    return by.reshape(len(by), -1) @ light.reshape(len(light), -1).T
