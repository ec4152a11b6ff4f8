"""Linear maps in the words of other libraries: SciPy's and PyLops' operators."""

import math
from typing import Any, Protocol

import numpy as np

from lumigraph.errors import LumigraphError


class Map(Protocol):
    """A linear map and its transpose, as `Linear` has them."""

    @property
    def shape(self) -> Any:
        """Shapes of a raw image and of an object."""
        ...

    def forward(self, intensity: Any, /) -> Any:
        """Raw image of an object."""
        ...

    def adjoint(self, raw: Any, /) -> Any:
        """The transpose."""
        ...


def to_scipy(operator: Map, dtype: Any = np.float32) -> Any:
    """The map as `scipy.sparse.linalg.LinearOperator`; see `Linear.to_scipy`."""
    from scipy.sparse.linalg import LinearOperator

    there, back = _flat(operator, dtype)
    shape = math.prod(operator.shape[0]), math.prod(operator.shape[1])
    return LinearOperator(shape, matvec=there, rmatvec=back, dtype=np.dtype(dtype))


def to_pylops(operator: Map, dtype: Any = np.float32) -> Any:
    """The map as `pylops.LinearOperator`; see `Linear.to_pylops`."""
    try:
        from pylops import LinearOperator
    except ImportError:
        raise LumigraphError(
            "operator.to_pylops() needs PyLops, which is not installed. Run: pip install pylops"
        ) from None
    there, back = _flat(operator, dtype)

    class Foreign(LinearOperator):
        """A linear map of lumigraph."""

        def _matvec(self, x: np.ndarray) -> np.ndarray:
            return there(x)

        def _rmatvec(self, x: np.ndarray) -> np.ndarray:
            return back(x)

    raw, given = operator.shape
    return Foreign(dtype=np.dtype(dtype), dims=given, dimsd=raw, name="lumigraph")


def _flat(operator: Map, dtype: Any) -> tuple[Any, Any]:
    """The map and its transpose, of vectors."""
    raw, given = operator.shape

    def there(x: np.ndarray) -> np.ndarray:
        return operator.forward(np.asarray(x, dtype).reshape(given)).ravel()

    def back(y: np.ndarray) -> np.ndarray:
        return operator.adjoint(np.asarray(y, dtype).reshape(raw)).ravel()

    return there, back
