"""Array functions of PyTorch, by which it runs the lines of `lumigraph.operators.lenslets`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from lumigraph.operators.lenslets.array_libraries import Array


class TorchLibrary:
    """Functions of arrays on a device; see `ArrayLibrary`."""

    exp = staticmethod(torch.exp)
    real = staticmethod(torch.real)
    stack = staticmethod(torch.stack)
    concatenate = staticmethod(torch.cat)
    sum = staticmethod(torch.sum)
    moveaxis = staticmethod(torch.movedim)

    def __init__(self, device: torch.device) -> None:
        self.device = device

    def asarray(self, x: Any) -> torch.Tensor:
        """Tensor of plain numbers."""
        return torch.as_tensor(np.asarray(x), device=self.device)

    @staticmethod
    def imag(x: Array) -> Array:
        """Imaginary part; of real numbers none."""
        return torch.imag(x) if x.is_complex() else torch.zeros_like(x)

    @staticmethod
    def part(x: Array, start: int, stop: int, axis: int) -> Array:
        """Part of an array along an axis, from a start to before a stop."""
        return x.narrow(axis, start, max(0, min(stop, x.shape[axis]) - start))

    def windows(self, x: Array, starts: Sequence[int], size: int, axis: int) -> Array:
        """Parts (n, ...) of an array along an axis, from each start on; zero beyond its ends."""
        lines = torch.movedim(x, axis, -1)
        index, inside = self._indices(starts, size, lines.shape[-1])
        found = lines[..., index] * inside.to(lines.dtype)
        return torch.movedim(torch.movedim(found, -2, 0), -1, axis + 1 if axis >= 0 else axis)

    def overlap_add(self, parts: Array, starts: Sequence[int], count: int, axis: int) -> Array:
        """Sum of parts (n, ...), each from its start on along an axis of `count` samples; cut at its ends."""
        lines = torch.movedim(torch.movedim(parts, axis + 1 if axis >= 0 else axis, -1), 0, -2)
        index, inside = self._indices(starts, lines.shape[-1], count)
        lines = (lines * inside.to(lines.dtype)).flatten(-2)
        dark = torch.zeros((*lines.shape[:-1], count), dtype=lines.dtype, device=lines.device)
        return torch.movedim(dark.index_add(-1, index.flatten(), lines), -1, axis)

    def _indices(self, starts: Sequence[int], size: int, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Samples (n, size) of parts, and which of them are among `count`."""
        first = torch.as_tensor(list(starts), device=self.device)[:, None]
        index = first + torch.arange(size, device=self.device)
        return index.clamp(0, count - 1), (index >= 0) & (index < count)
