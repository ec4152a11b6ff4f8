r"""Single points before a microscope with lenslets: images, changes by place, and the way back to its parts.

With P the wave of a point in the pupil and φ_k what turns it as the point moves, samples of the image are

.. math:: U_0 = B_y P B_x, \quad U_k = B_y (i \varphi_k P) B_x, \quad
          I_0 = S |U_0|^2 S^T, \quad I_k = S\, 2 \mathrm{Re}(U_0^* U_k) S^T

and U goes through a window of lenslets, T, where these are not square. A number that is made of them is
followed back once, to P, φ, B, S and T. How these change with a length, the
wavelength or a term of the phase is the difference of two microscopes a little apart, sampled alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.elements.objective import Objective
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.gradient import times
from lumigraph.operators.microscope.cell import Lenslet
from lumigraph.operators.microscope.pupil import PupilImages
from lumigraph.operators.microscope.pupil_waves import (
    PupilWaves,
    Told,
    behind,
    of_each,
    sampling_matrix,
    window_of,
)
from lumigraph.scene import Points

Place = tuple[Objective, Lenslet]
"""What waves behind lenslets follow from."""

Back = Callable[[np.ndarray], None]
"""Takes slopes (4, ny, nx) of a number by an image and its derivatives."""

Both = tuple[PupilImages, PupilImages]
"""Of a pair."""


@dataclass(frozen=True, eq=False)
class MicroscopePoints:
    """A microscope, and points before it: where they are and how bright."""

    images: PupilImages
    points: Points

    def light(self, number: int) -> float:
        """Light of a point's samples."""
        return self.images.unit * float(self.points.intensities[number])

    def pupil(self, which: int, nodes: int) -> np.ndarray:
        """Amplitudes (modes, rows, nodes) of an objective's pupil without a point's place."""
        return self.images.pupil(self.images.objectives[which], nodes)

    def phases(self, which: int, nodes: int) -> np.ndarray:
        """Slopes of the phase by a point's y, x and dz (3, rows, nodes) [rad/m]."""
        return self.images.phases(self.images.objectives[which], nodes)

    def wave(self, which: int, nodes: int, number: int, cell: tuple[int, int]) -> np.ndarray:
        """P (modes, rows, nodes), of a point in a cell."""
        place = self.images.within(self.points.positions[number], cell)
        turn = np.tensordot(place, self.phases(which, nodes), 1)
        return self.pupil(which, nodes) * np.exp(1j * turn)


@dataclass(eq=False)
class WindowParts:
    """Matrices whose products are the images of a window behind an objective, and slopes by them.

    Parameters
    ----------
    which, told
        Number of the objective, and how a window is sampled.
    waves
        B_y, B_x, S, and how the pupil's nodes stand.
    resampled
        Whether S differs between microscopes.
    """

    which: int
    told: Told
    waves: PupilWaves
    resampled: bool

    def __post_init__(self) -> None:
        w = self.waves
        self.down, self.across, self.spread = (m.transposed for m in (w.down, w.across, w.sampled))
        self.by = [np.zeros(m.shape, m.even.dtype) for m in (w.down, w.across, w.sampled)]
        self.by += [np.zeros_like(m) for m in (w.window.lenslets, w.window.path)] if w.window else []

    def along(self, ends: Both, own: PupilImages) -> float:
        """Change of a number from one microscope to another close by, as the matrices change."""
        return sum(times(self.by[k], *pair) for k, pair in self.ends(ends, own).items())

    def ends(self, ends: Both, own: PupilImages) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Matrices that differ between two microscopes, by number: B_y 0, B_x 1, S 2; T 3 and 4."""
        found, (low, high) = {}, ends
        if self._behind(low) != self._behind(high):
            both = zip(*(self._made(self._behind(one), self._behind(own)) for one in ends), strict=True)
            found |= dict(zip((0, 1, 3, 4), both, strict=False))
        if low.layout.sampling != high.layout.sampling:
            cells, fine, *_ = self.told
            first, last = (sampling_matrix(cells, fine, one.layout.sampling) for one in ends)
            found[2] = first, last
        return found

    def _made(self, own: Place, like: Place) -> tuple[np.ndarray, ...]:
        """All that light between the pupil and the sensor is multiplied by."""
        window = window_of(own, like, self._exact)
        return (*behind(own, like, self._exact), *((window.lenslets, window.path) if window else ()))

    def add_sampled(self, given: np.ndarray, across: np.ndarray, light: np.ndarray) -> None:
        """Slopes by S of those G by samples of light (k, n, n), of which `across` is G S."""
        for one, lit, mine in zip(given, across, light, strict=True):
            self.by[2] += lit @ mine.T + one.T @ self.waves.sampled.down(mine)

    def back(self, by: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Slopes by what comes before a window of lenslets, if there is one, of those by fields behind it."""
        if (window := self.waves.window) is None:
            return by
        for slopes, more in zip(self.by[3:], window.slopes(before, by), strict=True):
            slopes += more
        return window.transposed(by)

    @property
    def _exact(self) -> Told:
        """Sampling of the window, in double precision."""
        cells, fine, nodes, _ = self.told
        return cells, fine, nodes, "complex128"

    def _behind(self, images: PupilImages) -> Place:
        """Values that waves behind lenslets follow from."""
        return replace(images.objectives[self.which], aberrations=()), images.lenslet


@dataclass(frozen=True, slots=True, eq=False)
class _PointPath:
    """A point's waves on their way: pupils (4 modes, rows, nodes), what stands before a window of lenslets
    (4 modes, n, n), U and its derivatives (4, modes, n, n).
    """

    parts: WindowParts
    wave: np.ndarray
    phases: np.ndarray
    even: np.ndarray
    right: np.ndarray
    before: np.ndarray
    fields: np.ndarray

    @classmethod
    def of(cls, parts: WindowParts, wave: np.ndarray, phases: np.ndarray) -> "_PointPath":
        turned = np.concatenate([wave[None], 1j * phases[:, None] * wave]).reshape(-1, *wave.shape[1:])
        even = of_each(parts.waves.onto, turned, parts.waves.across.shape[1])
        right = parts.waves.across.right(even)
        before = parts.waves.down.down(right)
        fields = parts.waves.behind(before)
        return cls(parts, wave, phases, even, right, before, fields.reshape(4, len(wave), *fields.shape[1:]))

    @property
    def light(self) -> np.ndarray:
        """Light on the fine grid, and its derivatives (4, n, n)."""
        light = np.real(self.fields[0].conj() * self.fields).sum(1)
        light[1:] *= 2
        return light

    def images(self) -> np.ndarray:
        """Samples, and their derivatives (4, count, count)."""
        return self.parts.waves.samples(self.light)

    def back(self, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes by P (modes, rows, nodes) and by φ (3, rows, nodes), of those by samples (4, count, count).

        Those by matrices are added. Without conjugates: what changes is Re of products with changes.
        """
        parts, fields = self.parts, self.fields.conj()
        across = parts.spread.right(given)
        if parts.resampled:
            parts.add_sampled(given, across, self.light)
        seen = 2 * parts.spread.down(across)[:, None]
        by = seen * fields[0]
        by[0] += (seen[1:] * fields[1:]).sum(0)
        by = by.reshape(len(self.even), *fields.shape[2:])
        by = parts.back(by, self.before)
        rows = parts.down.down(by)
        parts.by[0] += np.tensordot(by, self.right, ([0, 2], [0, 2]))
        parts.by[1] += np.tensordot(rows, self.even, ([0, 1], [0, 1]))
        nodes = of_each(parts.waves.onto.T, parts.across.right(rows), self.wave.shape[2])
        still, moved = nodes[: len(self.wave)], nodes[len(self.wave) :].reshape(3, *self.wave.shape)
        turned = 1j * moved
        return still + (turned * self.phases[:, None]).sum(0), np.real(turned * self.wave).sum(1)


@dataclass(eq=False)
class PupilPoints:
    """Points one by one, before a microscope and before the pairs of microscopes around it.

    Parameters
    ----------
    own
        The microscope's images, without terms, and the points.
    pairs
        (n,), microscopes a little to either side, sampled alike and in double precision, and where the same
        points are before these.
    parts
        By number of the objective and how its window is sampled, those that are known.

    Raises
    ------
    GeometryError
        Microscopes of another number of lenslets before the pixels, or of wavelengths.
    """

    own: MicroscopePoints
    pairs: Sequence[tuple[MicroscopePoints, MicroscopePoints]]
    parts: dict[tuple[int, Told], WindowParts] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.pairs))
        for end in (one.images for pair in self.pairs for one in pair):
            require_alike(end, self.own.images)

    @single_products()
    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image of a point and its derivatives by y, x and dz (4, ny, nx) [1/m], and the way back."""
        own, position = self.own.images, self.own.points.positions[number]
        cell, whole = own.cell_of(position), np.zeros((4, *own.samples))
        ways = [self._way(which, number, cell) for which in range(len(own.objectives))]
        for way in ways:
            own.add(whole, way.images(), cell)
        pixels = np.stack([own.placed(one) for one in whole]) * self.own.light(number)
        return pixels, partial(self._back, number, cell, ways, whole, pixels)

    def _way(self, which: int, number: int, cell: tuple[int, int]) -> _PointPath:
        own, dz = self.own.images, float(self.own.points.positions[number, 2])
        told, waves = own.sampled(own.objectives[which], dz)
        parts = self.parts.setdefault((which, told), WindowParts(which, told, waves, self._resampled))
        wave, phases = self.own.wave(which, told[2], number, cell), self.own.phases(which, told[2])
        return _PointPath.of(parts, wave.astype(told[3]), phases)

    @property
    def _resampled(self) -> bool:
        own = self.own.images.layout.sampling
        return any(one.images.layout.sampling != own for pair in self.pairs for one in pair)

    @single_products()
    def along(self) -> np.ndarray:
        """(n,) changes of the sum of all numbers, from the first to the last microscope of each pair."""
        ends = [(low.images, high.images) for low, high in self.pairs]
        return self._found + [
            sum(parts.along(pair, self.own.images) for parts in self.parts.values()) for pair in ends
        ]

    @single_products()
    def _back(
        self,
        number: int,
        cell: tuple[int, int],
        ways: list[_PointPath],
        whole: np.ndarray,
        pixels: np.ndarray,
        given: np.ndarray,
    ) -> None:
        own, light = self.own.images, self.own.light(number)
        placement = own.layout.placement
        seen = light * (given if placement is None else np.stack([placement.adjoint(one) for one in given]))
        for way in ways:
            count = way.parts.waves.sampled.shape[0]
            cut = np.stack([own.cut(one, cell, count) for one in seen])
            by = way.back(cut.astype(way.phases.dtype))
            for k, pair in enumerate(self.pairs):
                self._found[k] += _between(way.parts, pair, number, cell, by)
        brighter = float(np.vdot(given, pixels)) / light
        for k, (low, high) in enumerate(self.pairs):
            self._found[k] += brighter * (high.light(number) - low.light(number))
            self._found[k] += light * _placed_anew((low.images, high.images), whole, given)


def _between(
    parts: WindowParts,
    pair: tuple[MicroscopePoints, MicroscopePoints],
    number: int,
    cell: tuple[int, int],
    by: tuple[np.ndarray, np.ndarray],
) -> float:
    """Change of a number by a point's wave, and by how it turns, between two microscopes."""
    which, nodes = parts.which, parts.told[2]
    low, high = (one.images.within(one.points.positions[number], cell) for one in pair)
    first, last = (one.images.objectives[which] for one in pair)
    if first == last and np.array_equal(low, high):
        return 0.0
    found = times(by[0], *(one.wave(which, nodes, number, cell) for one in pair))
    return found + times(by[1], *(one.phases(which, nodes) for one in pair))


def _placed_anew(ends: tuple[PupilImages, PupilImages], whole: np.ndarray, given: np.ndarray) -> float:
    """Change of weighed pixels by where they stand, between two microscopes."""
    low, high = ends
    if low.layout.placement is high.layout.placement:
        return 0.0
    return sum(
        times(weights, low.placed(one), high.placed(one)) for weights, one in zip(given, whole, strict=True)
    )


def require_alike(one: PupilImages, own: PupilImages) -> None:
    """Refuse microscopes between which more differs than numbers that change by little.

    Raises
    ------
    GeometryError
        Other numbers of wavelengths, of lenslets before the pixels, or of pixels.
    """
    counts = [(len(each.objectives), each.layout.cells, each.shape) for each in (one, own)]
    if counts[0] != counts[1]:
        raise GeometryError(
            f"microscopes have {counts[0]} and {counts[1]} wavelengths, lenslets before the pixels and "
            "pixels, but derivatives need as many. Use search 'local', or fewer lenslets."
        )
