"""A camera's numbers as tensors: their values, and to first order how they change with its keys."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch.utils.checkpoint import checkpoint

from lumigraph.elements import PupilMask
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.gradient import Both, Moved, both
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint

Numbers = dict[Any, torch.Tensor]


class _FirstOrder(torch.autograd.Function):
    """Zeros that change as parameters do, once."""

    @staticmethod
    def forward(ctx: Any, parts: torch.Tensor) -> torch.Tensor:
        return torch.zeros_like(parts)

    @staticmethod
    def backward(ctx: Any, *slopes: torch.Tensor) -> torch.Tensor:
        return _Once.apply(slopes[0])  # type: ignore[return-value]  # apply is untyped

    @staticmethod
    def jvp(ctx: Any, *changes: torch.Tensor) -> torch.Tensor:
        return changes[0].clone()


class _Once(torch.autograd.Function):
    """Slopes that have none of their own."""

    @staticmethod
    def forward(ctx: Any, slopes: torch.Tensor) -> torch.Tensor:
        return slopes.clone()

    @staticmethod
    def backward(ctx: Any, *_: torch.Tensor) -> Any:
        raise GeometryError(
            "second derivatives by keys of the camera file are not known: a camera's numbers are followed to "
            "first order. Use create_graph=False, or differences of gradients."
        )


class Expansion:
    """Numbers of a camera by its keys, to first order around what they are.

    Parameters
    ----------
    own, ends
        The camera, and those of each pair.
    parts
        (n,), of the keys' ranges.
    widths
        (n,), how far apart the cameras of the pairs are.
    masks
        Zeros (n, n) that change as the control points of the stop's mask do: "phase", "open".
    """

    def __init__(
        self,
        own: SampledCamera,
        ends: Sequence[Both],
        parts: torch.Tensor,
        widths: np.ndarray,
        masks: Mapping[str, torch.Tensor],
    ) -> None:
        self.masks = masks
        self.own, self.ends, self.widths = own, ends, widths
        self.device = parts.device
        self.moves = first_order(parts) if ends else None

    def tensor(self, still: Any, changes: Iterable[tuple[int, Any, Any]]) -> torch.Tensor:
        """A number as a tensor, of its values before the cameras of pairs that differ by it."""
        found = torch.as_tensor(np.array(still), device=self.device)
        for k, low, high in changes:
            if low is not high and not np.array_equal(low, high):
                slope = torch.as_tensor((np.asarray(high) - np.asarray(low)) / self.widths[k])
                assert self.moves is not None
                found = found + self.moves[k] * slope.to(self.device)
        return found

    def of_point(self, source: SourcePoint, moved: Sequence[Moved | None]) -> Numbers:
        """Numbers that a point's light follows from."""
        own = self.own.numbers(source)
        seen = [
            [end.numbers(one) for end, one in both(source, ends, where)]
            for ends, where in zip(self.ends, moved, strict=True)
        ]
        found = {
            name: self.tensor(one, ((k, low[name], high[name]) for k, (low, high) in enumerate(seen)))
            for name, one in own.items()
        }
        return found | self._masked(found) if self.masks else found

    def _masked(self, numbers: Numbers) -> Numbers:
        """The stop and the phase in it, which are linear in the mask's control points."""
        lens, grid, found = self.own.optics.camera.lens, self.own.grid, {}
        (mask,) = (part for part in lens.elements if isinstance(part, PupilMask))
        for name, moves in self.masks.items():
            y, x = (torch.as_tensor(mask.basis(at, len(moves))) for at in (grid.y, grid.x))
            change = y.to(moves.device) @ moves @ x.to(moves.device).T
            if name == "phase":
                found["aberrations"] = numbers["aberrations"] + 2 * np.pi * change
            else:
                stop = torch.as_tensor(main_lens.opening_of(lens).through(grid), device=moves.device)
                found["stop"] = numbers["stop"] + stop * change
        return found

    def of_lenslets(self, keys: Iterable[Any]) -> Numbers:
        """Numbers that the lenslets' arrays follow from."""
        found, pairs = {}, [(low.lenslets, high.lenslets) for low, high in self.ends]
        for key, one in self.own.lenslets.numbers(list(keys)).items():
            changes = (
                (k, low.number(key), high.number(key))
                for k, (low, high) in enumerate(pairs)
                if low is not high
            )
            found[key] = self.tensor(one, changes)
        return found

    def prepared(self, xp: Any, sources: Sequence[SourcePoint]) -> Numbers:
        """The lenslets' arrays, for the light of some points."""
        keys = list(dict.fromkeys(key for source in sources for key in self.own.keys(source)))
        if not keys:
            return {}

        def made() -> tuple[torch.Tensor, ...]:
            found = self.own.lenslets.prepare(xp, self.of_lenslets(keys), keys)
            return tuple(found[key] for key in keys)

        return dict(zip(keys, again(made), strict=True))

    def linear(
        self,
        given: torch.Tensor,
        of: Callable[[SampledCamera], Any],
        apply: Callable[[Any, torch.Tensor], torch.Tensor],
    ) -> torch.Tensor:
        """A linear map of the camera applied to an array, whose changes are compared between pairs."""
        found = apply(of(self.own), given)
        for k, (low, high) in enumerate(self.ends):
            if (first := of(low)) is not (last := of(high)):
                still = given.detach()
                slope = (apply(last, still) - apply(first, still)) / self.widths[k]
                assert self.moves is not None
                found = found + self.moves[k] * slope
        return found


def again(function: Callable[..., Any], *given: torch.Tensor) -> Any:
    """Value of a function that is computed once more on the way back, in place of keeping what it needs."""
    if not torch.is_grad_enabled():
        return function(*given)
    return checkpoint(function, *given, use_reentrant=False, preserve_rng_state=False)


def first_order(x: torch.Tensor) -> torch.Tensor:
    """Zeros that change as an array does, once: what is linear in them has its slopes."""
    return _FirstOrder.apply(x)  # type: ignore[return-value]  # apply is untyped
