"""Objects that reach beyond the picture, as far as light comes from, and are cut afterwards."""

from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.joint import Joint
from lumigraph.core.linear import Linear, Shape
from lumigraph.deconvolution.problem import UNSEEN

BARELY = 0.1
"""Samples that send less of their light onto the picture take up what the model gets wrong there.

In a crop of a mouse's brain single ones became 80 times as bright as the inside. Those that are left explain
the light that comes in from the side.
"""

BESIDE = 0.3
"""Samples that send less of their light onto pixels that count lie beside the picture: they are cut.

In that crop those just beside it are up to 17 times as bright as the inside, those in it up to 2 times.
"""

Inside = tuple[slice, slice]
"""Slices (y, x) of an object in a larger one."""


@runtime_checkable
class Widening(Protocol):
    """An operator that can look beyond the picture."""

    def widened(self, least: float) -> tuple[Linear, Inside]:
        """The same raw image of a larger object, and where (y, x) the operator's own stands in it.

        What sends less than a part `least` of its light onto the picture need not be followed.
        """
        ...


def looks_beyond(operator: Linear) -> bool:
    """True if an operator, or one of several of an object, can look beyond the picture."""
    parts = operator.maps if isinstance(operator, Joint) else (operator,)
    return any(isinstance(part, Widening) for part in parts)


def beyond(operator: Linear) -> tuple[Linear, Inside]:
    """The operator of the object that light on the picture comes from, and the wanted part of it."""
    if isinstance(operator, Joint):
        return _all_beyond(operator)
    if isinstance(operator, Widening):
        return operator.widened(
            BARELY / 2
        )  # at corners and in dark samples, less is seen than beside a border
    return operator, (slice(None), slice(None))


def _all_beyond(operator: Joint) -> tuple[Linear, Inside]:
    """Operator of several raw images: the object reaches as far as that of any of them."""
    if not looks_beyond(operator):
        return operator, (slice(None), slice(None))
    wide = [beyond(part) for part in operator.maps]
    asked = operator.shape[1][-2:]
    befores = [tuple(side.start or 0 for side in inside) for _, inside in wide]
    afters = [
        tuple(n - b - k for n, b, k in zip(one.shape[1][-2:], before, asked, strict=True))
        for (one, _), before in zip(wide, befores, strict=True)
    ]
    before, after = ([max(sides) for sides in zip(*some, strict=True)] for some in (befores, afters))
    shape = (before[0] + asked[0] + after[0], before[1] + asked[1] + after[1])
    maps = [
        one if one.shape[1][-2:] == shape else Inner(one, shape, (before[0] - mine[0], before[1] - mine[1]))
        for (one, _), mine in zip(wide, befores, strict=True)
    ]
    rows, columns = (slice(b, b + n) for b, n in zip(before, asked, strict=True))
    return Joint(tuple(maps)), (rows, columns)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Inner(Linear):
    """A map of the inner part of a larger object.

    Parameters
    ----------
    of
        The map.
    whole
        Samples (y, x) of the larger object.
    first
        Of its samples, the first one (y, x) that the map sees.
    """

    of: Linear
    whole: tuple[int, int]
    first: tuple[int, int]

    title: ClassVar[str] = "A map of an object's inner part"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the raw image, and of the larger object."""
        raw, inner = self.of.shape
        return raw, (*inner[:-2], *self.whole)

    def _forward(self, intensity: Array) -> Array:
        y, x = (slice(f, f + n) for f, n in zip(self.first, self.of.shape[1][-2:], strict=True))
        return self.of._forward(intensity[..., y, x])

    def _adjoint(self, raw: Array) -> Array:
        return arrays.framed(self.of._adjoint(raw), self.first, self.whole)

    @property
    def memory_bytes(self) -> float:
        """Memory of the map [bytes]."""
        return self.of.memory_bytes

    @property
    def error(self) -> float:
        """Relative rms error of the map."""
        return self.of.error


def least_seen(operator: Linear) -> float:
    """Part of the most light below which a sample counts as unseen: more where a border is followed."""
    return BARELY if looks_beyond(operator) else UNSEEN


def cut(estimate: Array, inside: Inside, pictured: Array | None) -> Array:
    """The wanted part of an object (..., y, x); 0 beside the picture."""
    found = estimate[..., inside[0], inside[1]]
    if pictured is None:
        return found
    where = arrays.namespace(estimate).where
    kept = pictured[..., inside[0], inside[1]]
    return arrays.by_part(lambda values, kept: where(kept, values, 0 * values), found, kept)


def continued(start: Array, shape: tuple[int, ...], inside: Inside) -> Array:
    """First estimate of the whole from one of the inside, whose border is continued outwards."""
    if tuple(start.shape) == shape:
        return start
    margins = [(0, 0)] * (len(shape) - 2)
    margins += [(part.start, n - part.stop) for part, n in zip(inside, shape[-2:], strict=True)]
    return arrays.like(np.pad(arrays.to_numpy(start), margins, mode="edge"), start)
