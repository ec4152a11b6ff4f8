"""Cameras and operators as PyTorch modules: a loss reaches the optics (extra ``[gpu]``).

- `camera`: `Camera`, raw images of points and scenes, with derivatives by keys of the camera file
- `keys`: those keys as parameters within their ranges; `expansion`, a camera's numbers as tensors
- `library`: array functions of PyTorch, by which it runs the lines of `operators.lenslets`
- `images`: images of points and of planes; `noise`: `Exposure`, noise by reparametrisation
- `operator`: `Operator`, any linear operator with its exact adjoint; `for_deepinv`, the same for deepinv
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lumigraph.torch.camera import Camera
    from lumigraph.torch.for_deepinv import physics
    from lumigraph.torch.noise import Exposure
    from lumigraph.torch.operator import Operator

__all__ = ["Camera", "Exposure", "Operator", "physics"]

_HOMES = {"Camera": "camera", "Exposure": "noise", "Operator": "operator", "physics": "for_deepinv"}


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: PyTorch takes seconds, and is an extra."""
    if name not in _HOMES:
        raise AttributeError(f"module 'lumigraph.torch' has no attribute {name!r}")
    try:
        import_module("torch")
    except ImportError:
        from lumigraph.errors import LumigraphError

        raise LumigraphError(
            f"lumigraph.torch.{name} needs PyTorch, which is not installed. Run: pip install lumigraph[gpu]"
        ) from None
    return getattr(import_module(f"lumigraph.torch.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
