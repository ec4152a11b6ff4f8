"""`physics`: a linear operator as `deepinv.physics.LinearPhysics`, for deepinv's solvers."""

from typing import TYPE_CHECKING, Any

import torch

from lumigraph.core.linear import Linear
from lumigraph.errors import LumigraphError
from lumigraph.torch.operator import Operator

if TYPE_CHECKING:
    from deepinv.physics import LinearPhysics


def physics(operator: Linear, **more: Any) -> "LinearPhysics":
    """An operator as `deepinv.physics.LinearPhysics`: volumes (batch, 1, z, y, x) to (batch, 1, ny, nx).

    Planes are (batch, 1, y, x). Plug-and-play, unrolled and self-supervised methods and posterior sampling
    of deepinv take it as it is.

    Parameters
    ----------
    operator
        Such as ``microscope.operator(depths)``.
    more
        Passed on, such as ``noise_model=deepinv.physics.PoissonNoise(0.01)``.

    Raises
    ------
    LumigraphError
        deepinv is not installed.

    Examples
    --------
    >>> import lumigraph as lg, torch
    >>> camera = lg.load_camera("thesis-2f").replace(sensor={"shape": (32, 32)})
    >>> seen = lg.torch.physics(camera.operator())
    >>> x = torch.rand(1, 1, *camera.operator().shape[1])
    >>> bool(seen.adjointness_test(x) < 1e-3)
    True
    """
    try:
        from deepinv.physics import LinearPhysics
    except ImportError:
        raise LumigraphError(
            "lumigraph.torch.physics needs deepinv, which is not installed. Run: "
            "pip install lumigraph[deepinv]"
        ) from None
    model = Operator(operator)

    def there(x: torch.Tensor, **_: Any) -> torch.Tensor:
        return model(x)

    def back(y: torch.Tensor, **_: Any) -> torch.Tensor:
        return model.adjoint(y)

    return LinearPhysics(A=there, A_adjoint=back, img_size=(1, *operator.shape[1]), **more)
