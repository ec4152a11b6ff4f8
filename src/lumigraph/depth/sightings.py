"""Values that the micro-images around a place of a plenoptic 2.0 picture show, for a patch size."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.depth.beside import LensletNeighbours
from lumigraph.depth.blurred import BlurLevels
from lumigraph.depth.flat import FlatImage
from lumigraph.rendering.patches import PatchLayout

Pair = tuple[np.ndarray, np.ndarray]

_SHARP = 1.5  # px of blur by which another kind of lenslet loses against the sharpest one
_FARTHEST = 3.0  # pitches to the farthest lenslet that is asked
_ALONE = 0.9  # sum of the squares of parts of the weight: one lenslet has nearly all of it
_FINE = 64  # weights per px of the distance from a micro-image's centre
_BAND, _BLOCK = 1 << 15, 32  # samples at a time, and across: so that they stay in the processor's cache


@dataclass(frozen=True, slots=True)
class NeighbourView:
    """View of each place (y, x) by one neighbour of the nearest lenslet.

    `away` is from the lenslet to the place, along y and x [px of the lattice]. `weight` is 0 where it is not
    seen, and less for a kind of lenslet that blurs it. `here` numbers the places (n,) within its reach, row
    by row; `at` is where in the image they are seen, along y and x (n,).
    """

    weight: np.ndarray
    value: np.ndarray
    away: Pair
    here: np.ndarray
    at: Sequence[np.ndarray]


@dataclass(frozen=True)
class Sightings:
    """Rows of a picture, and the raw image that shows them.

    Parameters
    ----------
    flat
        Of the raw image.
    calibration
        Of the camera.
    layout
        Places of the picture.
    focus
        Patch [px] at which each kind of lenslets is sharp; None where that is not known.
    """

    flat: FlatImage
    calibration: Calibration
    layout: PatchLayout
    focus: np.ndarray | None

    @cached_property
    def bands(self) -> list[tuple[slice, "Sightings"]]:
        """Some rows at a time, each of which remembers what is around its places."""
        rows = max(1, _BAND // len(self.layout.x))
        parts = [slice(k, k + rows) for k in range(0, len(self.layout.y), rows)]
        return [(part, replace(self, layout=self.layout.part(part))) for part in parts]

    @cached_property
    def blocks(self) -> list[tuple[slice, slice, "Sightings"]]:
        """Some rows and columns at a time."""
        rows, columns = (
            [slice(k, k + _BLOCK) for k in range(0, len(places), _BLOCK)]
            for places in (self.layout.y, self.layout.x)
        )
        return [
            (down, right, replace(self, layout=self.layout.part(down, right)))
            for down in rows
            for right in columns
        ]

    def blurred(self, sizes: np.ndarray) -> BlurLevels:
        """The raw image for `disagreements`."""
        trusts = [(float(size), self._trust(float(size))) for size in sizes]
        return BlurLevels.of(
            self.flat.image, self.focus, [(size, trust) for size, trust in trusts if trust is not None]
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the picture (rows, columns)."""
        return len(self.layout.y), len(self.layout.x)

    @cached_property
    def fractional(self) -> Pair:
        """Index (i, j) of each place (y, x) in the lattice, not only whole numbers."""
        lattice = self.calibration.lattice
        inverse = np.linalg.inv(lattice.matrix)
        dy, dx = self.layout.y[:, None] - lattice.origin[0], self.layout.x - lattice.origin[1]
        return inverse[0, 0] * dy + inverse[0, 1] * dx, inverse[1, 0] * dy + inverse[1, 1] * dx

    @cached_property
    def index(self) -> Pair:
        """Index (i, j) of the lenslet nearest to each place."""
        return self.calibration.lattice.index(self.layout.y[:, None], self.layout.x)

    @cached_property
    def _kinds(self) -> np.ndarray:
        """Kinds of the lenslets nearest to each place (n,)."""
        return self.calibration.lattice.kind(*self.index).astype(np.int8).ravel()

    @cached_property
    def _nearest(self) -> Pair:
        """Vector from the nearest lenslet to each place, along y and x [px]."""
        y, x = (middle.astype(np.float32).reshape(self.shape) for middle in self._middles)
        return np.float32(self.layout.y[:, None]) - y, np.float32(self.layout.x) - x

    @cached_property
    def _middles(self) -> Pair:
        """Middles of the lenslets nearest to each place (n,), in a regular lattice, along y and x [px]."""
        points = self.calibration.lattice.position(np.stack(self.index, -1))
        return points[..., 0].ravel(), points[..., 1].ravel()

    def _centers(self, here: np.ndarray, step: tuple[int, int]) -> Pair:
        """Centres of the micro-images a step away from the nearest one of numbered places (n,) [px]."""
        move, warp = self.calibration.lattice.matrix @ step, self.calibration.warp
        y, x = (middle[here] + part for middle, part in zip(self._middles, move, strict=True))
        if warp is not None:
            y, x = warp.applied(np.stack([y, x], -1)).T
        return y.astype(np.float32), x.astype(np.float32)

    def disagreements(self, sizes: np.ndarray, most: float, blurred: BlurLevels) -> np.ndarray:
        """Disagreement (n, y, x) of lenslets for patches of `sizes` (n,); see `LensletNeighbours`."""
        pitch, even = self.calibration.lattice.pitch, self.flat.even
        beside = self._beside(float(np.abs(sizes).min()))
        steps = np.arange(math.ceil(_FINE * (even + 1))).astype(np.float32) / np.float32(_FINE)
        light = np.clip(even - steps, 0, 1) * self.flat.light(steps / np.float32(pitch / 2)) ** 2
        light[-1] = 0
        out = np.empty((len(sizes), *self.shape), np.float32)
        for k, size in enumerate(sizes):
            near = beside.within(even / abs(size))
            far = near.distance * np.float32(_FINE * abs(size))
            weight = light.take(far.astype(np.int32), mode="clip")
            trust = self._trust(float(size))
            if trust is not None:
                weight *= trust.astype(np.float32).take(near.kind)
            at = [c - np.float32(size) * a for c, a in zip(near.center, near.away, strict=True)]
            value = blurred.read(at, near.kind, float(size), trust)
            out[k] = near.disagreement(weight, value, most).reshape(self.shape)
        return out

    def _beside(self, size: float) -> LensletNeighbours:
        """The lenslets that show the places if their patches have a size [px] or more."""
        lattice, (ny, nx) = self.calibration.lattice, self.calibration.shape
        pitch, half = np.float32(lattice.pitch), lattice.pitch / 2
        steps = self._steps((min(self.flat.even / size, _FARTHEST) + 0.75) * lattice.pitch)
        every = np.arange(self.shape[0] * self.shape[1])
        move = np.array([lattice.matrix @ step for step in steps], np.float32)
        away = [(a.ravel() - m[:, None]) / pitch for a, m in zip(self._nearest, move.T, strict=True)]
        center = [
            np.stack(part) for part in zip(*(self._centers(every, step) for step in steps), strict=True)
        ]
        kinds = np.array([lattice.kind(*map(np.asarray, step)) for step in steps], np.int8)
        kind = np.mod(self._kinds + kinds[:, None], np.int8(lattice.kinds))
        cy, cx = center
        whole = (cy >= half - 1) & (cy + half <= ny) & (cx >= half - 1) & (cx + half <= nx)
        return LensletNeighbours.of((away[0], away[1]), (cy, cx), kind, whole, self.flat.even / size)

    def around(self, size: np.ndarray | float, *, finer: bool = False) -> Iterator[NeighbourView]:
        """Sights of each place by the lenslets near it, for a patch size, one or (y, x) [px].

        Of the raw image, or of the finer one.
        """
        image, fineness = (self.flat.finer, 2) if finer else (self.flat.image, 1)
        lattice, (ny, nx) = self.calibration.lattice, self.calibration.shape
        reach = min(self.flat.even / float(np.abs(size).min()), _FARTHEST) * lattice.pitch
        ratio, trust = np.asarray(size / lattice.pitch, np.float32), self._trust(size)
        half = lattice.pitch / 2
        for step in self._steps(reach + 0.75 * lattice.pitch):
            move = (lattice.matrix @ step).astype(np.float32)
            away = self._nearest[0] - move[0], self._nearest[1] - move[1]
            distance = np.hypot(*away) * np.abs(ratio)
            here = np.flatnonzero(distance < self.flat.even)
            distance = distance.ravel()[here]
            cy, cx = self._centers(here, step)
            light = self.flat.light(distance / np.float32(half))
            whole = (cy >= half - 1) & (cy + half <= ny) & (cx >= half - 1) & (cx + half <= nx)
            weight = np.clip(self.flat.even - distance, 0, 1) * light**2 * whole
            if trust is not None:
                there = np.int8(lattice.kind(*map(np.asarray, step)))
                kind = np.mod(self._kinds[here] + there, np.int8(lattice.kinds))
                weight *= np.choose(kind, [self._some(part, here) for part in trust])
            if weight.any():
                slant = self._some(ratio, here)
                at = [fineness * (c - slant * a.ravel()[here]) for c, a in zip((cy, cx), away, strict=True)]
                value = self._spread(_linear(image, at), here)
                yield NeighbourView(self._spread(weight, here), value, away, here, at)

    def _some(self, values: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Values, one or (y, x), at numbered places (n,)."""
        return np.broadcast_to(values, self.shape).ravel()[here] if values.ndim else values

    def _spread(self, values: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Values (n,) at their numbered places of the picture (y, x), 0 elsewhere."""
        whole = np.zeros(self.shape, np.float32)
        whole.ravel()[here] = values
        return whole

    def _steps(self, reach: float) -> list[tuple[int, int]]:
        lattice = self.calibration.lattice
        count = math.ceil(1.2 * reach / lattice.pitch)
        around = range(-count, count + 1)
        return [(i, j) for i in around for j in around if np.hypot(*(lattice.matrix @ (i, j))) <= reach]

    def _trust(self, size: np.ndarray | float) -> np.ndarray | None:
        """Weight of each kind of lenslets (kinds, ...); the sharpest one has 1. See `rendering.focused`."""
        if self.focus is None:
            return None
        blur = np.stack([np.square(np.asarray(size, np.float32) - np.float32(sharp)) for sharp in self.focus])
        return np.exp(-(blur - blur.min(0)) / (2 * _SHARP**2))

    def picture(self, size: np.ndarray | float) -> np.ndarray:
        """The mean (y, x) of what the lenslets show of places of a patch, one or (y, x)."""
        total, weights = np.zeros(self.shape, np.float32), np.full(self.shape, 1e-6, np.float32)
        for sight in self.around(size):
            total += sight.weight * sight.value
            weights += sight.weight
        return total / weights

    def asked(self, size: np.ndarray, noise: float, slow: np.ndarray) -> np.ndarray:
        """Changes of patches (y, x) that lenslets imply, and the evidence for them (6, y, x).

        Pull and information are for a step of the patch by which a detail moves by 1 px where it stands at a
        micro-image's edge; then the variance of the values, and the disputed part: values that are off by
        more than their noise count less. Last what two lenslets share of the texture of a place, which is
        what they show beyond the `slow` part (y, x) of the picture, and the square of what one shows.
        """
        step = np.asarray(size / self.calibration.lattice.pitch / self.flat.even, np.float32)
        sights = list(self.around(size, finer=True))
        values = np.stack([sight.value for sight in sights])
        slopes = np.stack([step * self._slope(sight) for sight in sights])
        weights = seen = np.stack([sight.weight for sight in sights])
        for _ in range(2):
            off = values - (weights * values).sum(0) / (weights.sum(0) + np.float32(1e-9))
            weights = seen / (1 + (off / np.float32(2.5 * noise)) ** 2)
        total = weights.sum(0) + np.float32(1e-9)
        slopes -= (weights * slopes).sum(0) / total
        off = values - (weights * values).sum(0) / total
        pulled, variance = weights * slopes, (weights * off**2).sum(0) / total
        disputed = 1 - total / (seen.sum(0) + np.float32(1e-9))
        pull, information = -(pulled * off).sum(0), (pulled * slopes).sum(0)
        return np.stack([pull, information, variance, disputed, *_shared(seen, values - slow)])

    def _slope(self, sight: NeighbourView) -> np.ndarray:
        """Derivative (y, x) of a lenslet's value by the logarithm of the patch, over patch/pitch."""
        image, slope = self.flat.finer, np.zeros(len(sight.here), np.float32)
        for axis, away in enumerate(sight.away):
            ends = []
            for half in (-1, 1):
                at = [place + np.float32(half * (k == axis)) for k, place in enumerate(sight.at)]
                ends.append(_linear(image, at))
            slope -= away.ravel()[sight.here] * (ends[1] - ends[0])
        return self._spread(slope, sight.here)


def _shared(weight: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means (y, x) of the products of the values of two, and of the squares of those of one (k, y, x)."""
    part = weight / (weight.sum(0) + np.float32(1e-9))
    own, alone = (part * value**2).sum(0), (part**2).sum(0)
    both = ((part * value).sum(0) ** 2 - (part**2 * value**2).sum(0)) / (1 - alone + np.float32(1e-6))
    several = alone < _ALONE
    return both * several, own * several


def _linear(image: np.ndarray, at: Sequence[np.ndarray]) -> np.ndarray:
    """Values (n,) of an image between its pixels at places (y, x), two of (n,); the edge's beyond it."""
    below, part = [], []
    for place, count in zip(at, image.shape, strict=True):
        place = np.clip(place, 0, count - 1)
        start = np.minimum(place.astype(np.int32), count - 2)
        below.append(start)
        part.append(place - start.astype(np.float32))
    width = image.shape[1]
    flat, number = image.ravel(), below[0] * width + below[1]
    upper, lower = (
        flat[number + k] + part[1] * (flat[number + (k + 1)] - flat[number + k]) for k in (0, width)
    )
    return upper + part[0] * (lower - upper)
