"""Objects that reach beyond the picture, as far as light comes from, and are cut afterwards."""

from typing import Protocol, runtime_checkable

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear
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
"""Where an object (y, x) stands in a larger one."""


@runtime_checkable
class Widening(Protocol):
    """An operator that can look beyond the picture."""

    def widened(self, least: float) -> tuple[Linear, Inside]:
        """The same raw image of a larger object, and where (y, x) the operator's own stands in it.

        What sends less than a part `least` of its light onto the picture need not be followed.
        """
        ...


def beyond(operator: Linear) -> tuple[Linear, Inside]:
    """The operator of the object that light on the picture comes from, and what of it is asked for."""
    if isinstance(operator, Widening):
        return operator.widened(
            BARELY / 2
        )  # at corners and in dark samples, less is seen than beside a border
    return operator, (slice(None), slice(None))


def least_seen(operator: Linear) -> float:
    """Part of the most light below which a sample counts as unseen: more where a border is followed."""
    return BARELY if isinstance(operator, Widening) else UNSEEN


def cut(estimate: Array, inside: Inside, pictured: Array | None) -> Array:
    """What is asked for of an object (..., y, x); 0 beside the picture."""
    found = estimate[..., inside[0], inside[1]]
    if pictured is None:
        return found
    where = arrays.namespace(estimate).where
    kept = pictured[..., inside[0], inside[1]]
    return arrays.by_plane(lambda values, kept: where(kept, values, 0 * values), found, kept)


def continued(start: Array, shape: tuple[int, ...], inside: Inside) -> Array:
    """A first estimate of the inside as one of the whole, whose border goes on outwards."""
    if tuple(start.shape) == shape:
        return start
    margins = [(0, 0)] * (len(shape) - 2)
    margins += [(part.start, n - part.stop) for part, n in zip(inside, shape[-2:], strict=True)]
    return arrays.like(np.pad(arrays.to_numpy(start), margins, mode="edge"), start)
