"""Changes of points' light, and of what is made of it, between cameras a little apart."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.operators.lenslets.array_libraries import Array, Numbers, differentiable, slopes, tangent
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.operators.sampling.resampling import Resampling
from lumigraph.scene import Points

Both = tuple[SampledCamera, SampledCamera]
"""Cameras of a pair."""

Moved = tuple[Points, Points]
"""Where points are before both, and how bright."""

Slopes = dict[Any, np.ndarray]

Loss = Callable[[Numbers, Numbers], Array]
"""A real number, of a point's numbers and of the lenslets' arrays."""


@dataclass(eq=False)
class Gradient:
    """Slopes of a number made of points' images, by all that these follow from.

    Parameters
    ----------
    own
        The camera itself.
    ends, moved
        (n,), cameras of the pairs, and where points are before both.
    """

    own: SampledCamera
    ends: Sequence[Both]
    moved: Sequence[Moved | None]
    _by_lenslets: Slopes = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.ends))

    def add(self, source: SourcePoint, weights: np.ndarray) -> np.ndarray:
        """Add slopes of a point's intensity (y, x) times weights, summed; returned is that intensity."""
        seen: list[np.ndarray] = []

        def loss(xp: Any, field: Array) -> Array:
            intensity = xp.real(field) ** 2 + xp.imag(field) ** 2
            seen.append(plain(intensity))
            return (intensity * weights).sum()

        lit = self.own.lit(source)
        self.follow(source, self.own.numbers(source), lambda xp, numbers, prepared: loss(
            xp, self.own.field(xp, numbers, prepared, source, lit)
        ))  # fmt: skip
        return seen[0]

    def follow(
        self, source: SourcePoint, numbers: Slopes, loss: Callable[[Any, Numbers, Numbers], Array]
    ) -> None:
        """Add slopes of a real number, made of a point's numbers and of the lenslets' arrays."""
        xp, prepared = differentiable(), self.own.lenslets.prepared(self.own.keys(source))
        names = set(numbers)
        found = slopes(
            lambda both: loss(
                xp, {k: both[k] for k in names}, {k: v for k, v in both.items() if k not in names}
            ),
            numbers | prepared,
        )
        for key in prepared:
            by = found[key]
            self._by_lenslets[key] = self._by_lenslets[key] + by if key in self._by_lenslets else by
        self._add_numbers(source, {name: found[name] for name in names})

    def _add_numbers(self, source: SourcePoint, by: Mapping[str, np.ndarray]) -> None:
        """Add slopes by what a point's light before the lenslets follows from."""
        moves = "move y" in by
        for k, pair in enumerate(zip(self.ends, self.moved, strict=True)):
            low, high = (
                end.numbers(one) | (end.move_numbers(one) if moves else {})
                for end, one in both(source, *pair)
            )
            self._found[k] += sum(times(slope, low[name], high[name]) for name, slope in by.items())

    def along(self) -> np.ndarray:
        """(n,), changes of the number from the first to the last camera of each pair."""
        for keys in self.own.lenslets.grouped(self._by_lenslets):
            for k, change in enumerate(self._through_lenslets(keys)):
                self._found[k] += change
        self._by_lenslets = {}
        return self._found

    def _through_lenslets(self, keys: list[Any]) -> list[float]:
        """Changes by some of the lenslets' arrays."""
        own, by, xp = self.own.lenslets, self._by_lenslets, differentiable()
        if all(low.lenslets is high.lenslets for low, high in self.ends):
            return [0.0] * len(self.ends)

        def loss(numbers: Numbers) -> Array:
            made = own.prepare(xp, numbers, keys)
            return sum(xp.real((by[key] * made[key]).sum()) for key in keys)

        found = slopes(loss, own.numbers(keys))
        changes = []
        for ends in self.ends:
            low, high = (end.lenslets for end in ends)
            pairs = ((slope, low.number(key), high.number(key)) for key, slope in found.items())
            changes.append(0.0 if low is high else sum(times(*pair) for pair in pairs))
        return changes


@dataclass(frozen=True, eq=False)
class Tangent:
    """Change of what points' light follows from: so many times from the first to the last of each pair.

    Parameters
    ----------
    own
        The camera itself.
    pairs
        Times, cameras, and where points are before both.
    prepared
        The lenslets' arrays.
    changed
        Their change.
    """

    own: SampledCamera
    pairs: Sequence[tuple[float, Both, Moved | None]]
    prepared: Slopes
    changed: Slopes

    @classmethod
    def of(
        cls,
        own: SampledCamera,
        pairs: Sequence[tuple[float, Both, Moved | None]],
        sources: Sequence[SourcePoint],
    ) -> "Tangent":
        """Change of what the light of some points follows from."""
        keys = list(dict.fromkeys(key for source in sources for key in own.keys(source)))
        numbers = own.lenslets.numbers(keys)
        changes = {key: np.zeros_like(one) for key, one in numbers.items()}
        for weight, (low, high), _ in pairs:
            if low.lenslets is not high.lenslets:
                for key in changes:
                    changes[key] = changes[key] + weight * (
                        high.lenslets.number(key) - low.lenslets.number(key)
                    )
        values, moved = {}, {}
        if keys:
            xp = differentiable()
            value, change = tangent(
                lambda given: [*own.lenslets.prepare(xp, given, keys).values()], numbers, changes
            )
            values, moved = dict(zip(keys, value, strict=True)), dict(zip(keys, change, strict=True))
        return cls(own, pairs, values, moved)

    def intensity(self, source: SourcePoint) -> tuple[np.ndarray, np.ndarray]:
        """Intensity (y, x) of a point of 1, and its change."""
        xp, numbers = differentiable(), self.own.numbers(source)
        changes = {name: np.zeros_like(np.asarray(one)) for name, one in numbers.items()}
        for weight, ends, moved in self.pairs:
            low, high = (end.numbers(one) for end, one in both(source, ends, moved))
            changes = {name: one + weight * (high[name] - low[name]) for name, one in changes.items()}
        keys, lit = self.own.keys(source), self.own.lit(source)

        def seen(given: Numbers) -> Array:
            mine, prepared = {k: given[k] for k in numbers}, {k: given[k] for k in keys}
            field = self.own.field(xp, mine, prepared, source, lit)
            return [xp.real(field) ** 2 + xp.imag(field) ** 2]

        (still,), (change,) = tangent(
            seen,
            numbers | {key: self.prepared[key] for key in keys},
            changes | {key: self.changed[key] for key in keys},
        )
        return still, change


def plain(x: Array) -> np.ndarray:
    """Values of an array that is differentiated."""
    from autograd.tracer import getval

    return getval(x)


def both(source: SourcePoint, ends: Both, moved: Moved | None) -> list[tuple[SampledCamera, SourcePoint]]:
    """Cameras of a pair, and a point before each."""
    low, high = ends
    if moved is None:
        return [(low, source), (high, source)]
    return [(low, source.among(moved[0])), (high, source.among(moved[1]))]


def times(by: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Change of a number of such slopes from low to high."""
    return 0.0 if low is high else float(np.dot(np.ravel(by), np.ravel(high - low)).real)


def read_anew(own: SampledCamera, ends: Sequence[Both], light: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(n,), changes of what pixels take of the same light, times weights (ny, nx), summed."""
    found = np.zeros(len(ends))
    if all(low.read is high.read for low, high in ends):
        return found
    if not isinstance(own.read, Resampling):  # of a turned array
        pairs = ((low.read, high.read) for low, high in ends)
        return np.array([
            0.0 if low is high else times(weights, low.forward(light), high.forward(light))
            for low, high in pairs
        ])  # fmt: skip
    by_y, by_x = weights @ own.read.x.right(light).T, weights.T @ own.read.y.down(light)
    for k, (low, high) in enumerate(ends):
        if low.read is not high.read:
            (a, b), (c, d) = ((end.read.y, end.read.x) for end in (low, high))  # type: ignore[attr-defined]
            found[k] = c.inner(by_y) - a.inner(by_y) + d.inner(by_x) - b.inner(by_x)
    return found
