"""`Scatter`: differences of the lenslets of an array, random and given."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from lumigraph.core import checks
from lumigraph.elements.form import TERMS
from lumigraph.errors import GeometryError

_MULTIPLIERS = (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)  # splitmix64's

MOST_MISSING = 0.99
"""Part of the lenslets."""

MOST = {"focal_length": 0.2, "decentre": 1.0, "missing": MOST_MISSING, "turn": 0.05, "form": 10e-6}
"""Largest values by name, in SI."""

UNITS = {"decentre": " m", "turn": " rad (of light, n - 1 times the tilt)", "form": " m"}


class LensletWarp(NamedTuple):
    """Deviations of paths through lenslets besides focus and vertex: angles [rad] and terms [m].

    `down` and `across` (...) turn light towards later columns and rows; `terms` (..., k) are those of
    `lumigraph.elements.form`.
    """

    down: np.ndarray
    across: np.ndarray
    terms: np.ndarray


@dataclass(frozen=True, slots=True)
class SingleLenslet:
    """Deviations of the lenslet of an index (i, j); lengths along columns and rows of the array.

    `focal_change` is the part by which its focal length is longer; `aside` (down, across) the way from its
    place on the lattice to the middle of its aperture, None for one on it, and `decentre` from the middle to
    its vertex [m].
    """

    index: tuple[int, int]
    focal_change: float = 0.0
    aside: tuple[float, float] | None = None
    decentre: tuple[float, float] = (0.0, 0.0)

    @property
    def vertex(self) -> tuple[float, float]:
        """Offset of the vertex from the place on the lattice [m]."""
        down, across = self.aside or (0.0, 0.0)
        return down + self.decentre[0], across + self.decentre[1]


@dataclass(frozen=True, slots=True)
class Scatter:
    """Differences of single lenslets: random errors, reproducible by lenslet and seed, and given ones.

    Parameters
    ----------
    focal_length
        Standard deviation, as a part of it.
    decentre
        Standard deviation of a lenslet's vertex from the middle of its aperture, along each axis of the
        array [m]. Apertures stay where the lattice has them.
    missing
        Part of the lenslets that are opaque.
    seed
        Seed of all random values.
    turn
        Standard deviation of the angles by which tilted lenslets turn light, along each axis of the array
        [rad]: of a spherical surface tilted by θ, (n - 1) θ.
    form
        Form error of the path through a lenslet, without focus and tilt: rms over the square around it
        and over the lenslets [m]. Each of the terms of `form.TERMS` has the same part.
    own
        Deviations of single lenslets, beside what is drawn for them.

    Raises
    ------
    GeometryError
        A negative value, or a part of 1 or more; a focal length of its own that is not above 0.
    """

    focal_length: float = 0.0
    decentre: float = 0.0
    missing: float = 0.0
    seed: int = 0
    turn: float = 0.0
    form: float = 0.0
    own: tuple[SingleLenslet, ...] = ()

    def __post_init__(self) -> None:
        checks.whole("seed", self.seed, 0)
        for name, most in MOST.items():
            if not 0 <= checks.finite(name, getattr(self, name)) <= most:
                unit = UNITS.get(name, "")
                raise GeometryError(
                    f"the scatter's {name} is {getattr(self, name):g}{unit} but must be from 0 to "
                    f"{most:g}{unit}. Check the unit, or give less."
                )
        for one in self.own:
            checks.finite("decentre", sum(one.vertex))
            if not checks.finite("focal_change", one.focal_change, "") > -1:
                raise GeometryError(
                    f"lenslet {one.index} has a focal_change of {one.focal_change:g} but must be above -1. "
                    "Give a part, such as 0.03 for 3 %."
                )

    def of(self, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Focal-length factor, vertex offsets along columns and rows [m] and presence of lenslets (i, j)."""
        bend, down, across, there = (_uniform(i, j, self.seed, channel) for channel in range(4))
        factor = 1 + self.focal_length * np.clip(scipy.special.ndtri(bend), -4, 4)
        down, across = self.decentre * scipy.special.ndtri(down), self.decentre * scipy.special.ndtri(across)
        for mine, one in self._among(i, j):
            factor[mine] *= 1 + one.focal_change
            down[mine] += one.vertex[0]
            across[mine] += one.vertex[1]
        return factor, down, across, there >= self.missing

    def aside(self, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Offsets of the apertures of lenslets (i, j) from the lattice, along columns and rows [m]."""
        found = np.zeros((2, *np.broadcast(i, j).shape))
        for mine, one in self._among(i, j):
            found[0][mine], found[1][mine] = one.aside or (0.0, 0.0)
        return found[0], found[1]

    def _among(self, i: np.ndarray, j: np.ndarray) -> Iterator[tuple[np.ndarray, SingleLenslet]]:
        for one in self.own:
            if (mine := (i == one.index[0]) & (j == one.index[1])).any():
                yield mine, one

    @property
    def moves(self) -> bool:
        """True if some apertures are off the lattice."""
        return any(any(one.aside or ()) for one in self.own)

    def naming(self, lenslets: Mapping[tuple[int, int], bool]) -> "Scatter":
        """Scatter that also lists these lenslets, with the apertures of those that are marked."""
        own = {one.index: one for one in self.own}
        named = {index: own.get(index, SingleLenslet(index)) for index in lenslets}
        return replace(self, own=tuple(
            replace(one, aside=one.aside or (0.0, 0.0)) if lenslets[index] else one
            for index, one in sorted(named.items())
        ))  # fmt: skip

    @property
    def warps(self) -> bool:
        """True if lenslets are tilted or have a form error."""
        return bool(self.turn or self.form)

    def warp(self, i: np.ndarray, j: np.ndarray) -> LensletWarp:
        """Tilt and form of the paths through lenslets (i, j)."""
        down, across, *terms = (
            np.clip(scipy.special.ndtri(_uniform(i, j, self.seed, channel)), -4, 4)
            for channel in range(4, 6 + len(TERMS))
        )
        return LensletWarp(
            self.turn * down, self.turn * across, self.form / math.sqrt(len(TERMS)) * np.stack(terms, -1)
        )


def _uniform(i: np.ndarray, j: np.ndarray, seed: int, channel: int) -> np.ndarray:
    """Numbers between 0 and 1 by index, a hash, independent of the other lenslets in the call."""
    golden, first, second = (np.uint64(one) for one in _MULTIPLIERS)
    found = np.full(np.broadcast(i, j).shape, np.uint64(seed % 2**64))
    with np.errstate(over="ignore"):
        for number in (i, j, channel):
            found = found * golden + np.asarray(number).astype(np.int64).astype(np.uint64) + golden
            found = (found ^ (found >> np.uint64(30))) * first
            found = (found ^ (found >> np.uint64(27))) * second
            found = found ^ (found >> np.uint64(31))
    return (found >> np.uint64(11)).astype(np.float64) * 2.0**-53 + 2.0**-54
