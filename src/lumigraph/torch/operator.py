"""`Operator`: a linear operator as a PyTorch module, whose derivative is its exact adjoint."""

from collections.abc import Callable
from typing import Any

import torch

from lumigraph.core.linear import Linear
from lumigraph.errors import GeometryError


class _Applied(torch.autograd.Function):
    """A linear map, and its transpose as its derivative, to any order."""

    @staticmethod
    def forward(
        ctx: Any, x: torch.Tensor, there: Callable[[Any], Any], back: Callable[[Any], Any]
    ) -> torch.Tensor:
        ctx.maps = there, back
        return there(x)

    @staticmethod
    def backward(ctx: Any, *slopes: torch.Tensor) -> Any:
        there, back = ctx.maps
        return _Applied.apply(slopes[0].contiguous(), back, there), None, None

    @staticmethod
    def jvp(ctx: Any, *changes: Any) -> torch.Tensor:
        return ctx.maps[0](changes[0])


def applied(operator: Linear, x: torch.Tensor) -> torch.Tensor:
    """Image of an object of the operator's shape, with the adjoint as derivative."""
    return _Applied.apply(x, operator.forward, operator.adjoint)  # type: ignore[return-value]  # apply is untyped


def returned(operator: Linear, y: torch.Tensor) -> torch.Tensor:
    """The adjoint of a raw image, with the operator as derivative."""
    return _Applied.apply(y, operator.adjoint, operator.forward)  # type: ignore[return-value]  # apply is untyped


class Operator(torch.nn.Module):
    """A linear operator as a module without parameters: objects (..., z, y, x) to raw images (..., ny, nx).

    Its derivative is the operator's adjoint, exactly, to any order. Tensors stay where they are, on a
    processor or a GPU, in their own precision.

    Parameters
    ----------
    operator
        Such as ``camera.operator()``.

    Examples
    --------
    >>> import lumigraph as lg, torch
    >>> camera = lg.load_camera("thesis-2f").replace(sensor={"shape": (32, 32)})
    >>> model = lg.torch.Operator(camera.operator())
    >>> x = torch.rand(2, *model.operator.shape[1], requires_grad=True)
    >>> (model(x) ** 2).sum().backward()
    >>> x.grad.shape == x.shape
    True
    """

    def __init__(self, operator: Linear) -> None:
        super().__init__()
        self.operator = operator

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Raw images (..., ny, nx) of objects (..., y, x) or (..., z, y, x)."""
        return self._each(x, self.operator.shape[1], applied, "an object")

    def adjoint(self, y: torch.Tensor) -> torch.Tensor:
        """Transpose of `forward`: (..., y, x) or (..., z, y, x) of raw images (..., ny, nx)."""
        return self._each(y, self.operator.shape[0], returned, "a raw image")

    def _each(
        self, x: torch.Tensor, shape: tuple[int, ...], of: Callable[[Linear, torch.Tensor], torch.Tensor],
        name: str,
    ) -> torch.Tensor:  # fmt: skip
        if tuple(x.shape[x.ndim - len(shape) :]) != tuple(shape):
            raise GeometryError(f"{name} has shape {tuple(x.shape)} but must end in {tuple(shape)}.")
        batch = x.shape[: x.ndim - len(shape)]
        found = torch.stack([of(self.operator, one) for one in x.reshape(-1, *shape)])
        return found.reshape(*batch, *found.shape[1:])
