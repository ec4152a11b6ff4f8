"""`Matrix`: numbers in rows and columns as a linear map, dense or sparse, for arrays of any library."""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear, Shape
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Matrix(Linear):
    """A matrix between the samples of an object and of a raw image, each in the order of its memory.

    Parameters
    ----------
    matrix
        (raw samples, object samples), of NumPy, or of SciPy in compressed rows (``csr``).
    raw_shape, object_shape
        Shapes of output and input.

    Raises
    ------
    GeometryError
        The shapes do not hold as many samples as the matrix has rows and columns.

    Examples
    --------
    >>> Matrix(np.array([[1.0, 2.0]]), (1,), (2, 1)).adjoint(np.array([3.0])).tolist()
    [[3.0], [6.0]]
    """

    matrix: Any
    raw_shape: Shape
    object_shape: Shape
    _tables: dict = field(default_factory=dict)

    title: ClassVar[str] = "Matrix"

    def __post_init__(self) -> None:
        needed = math.prod(self.raw_shape), math.prod(self.object_shape)
        if tuple(self.matrix.shape) != needed:
            raise GeometryError(
                f"the matrix has shape {tuple(self.matrix.shape)} but {self.raw_shape} from "
                f"{self.object_shape} needs {needed}."
            )

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the raw image and of the object."""
        return self.raw_shape, self.object_shape

    @property
    def memory_bytes(self) -> float:
        """Memory of the stored numbers [bytes]."""
        kept = self.matrix if isinstance(self.matrix, np.ndarray) else self.matrix.data
        return float(kept.nbytes)

    def _forward(self, intensity: Array) -> Array:
        return arrays.namespace(intensity).reshape(self._applied(intensity, back=False), self.raw_shape)

    def _adjoint(self, raw: Array) -> Array:
        return arrays.namespace(raw).reshape(self._applied(raw, back=True), self.object_shape)

    def _applied(self, values: Array, *, back: bool) -> Array:
        xp = arrays.namespace(values)
        flat = xp.reshape(values, (-1,))
        if arrays.is_numpy(values):
            matrix = self.matrix.T if back else self.matrix
            return (matrix @ flat).astype(values.dtype, copy=False)
        if isinstance(self.matrix, np.ndarray):
            matrix = arrays.held(self.matrix, values)
            return (xp.matrix_transpose(matrix) if back else matrix) @ flat
        index, weight = self._table(values, back)
        gathered = xp.reshape(xp.take(flat, xp.reshape(index, (-1,)), axis=0), weight.shape)
        return xp.sum(gathered * weight, axis=1)

    def _table(self, like: Array, back: bool) -> tuple[Array, Array]:
        """Index and weight of each value's neighbours (n, k), padded with weight 0."""
        key = arrays.placement(like), back
        if key not in self._tables:
            matrix = self.matrix.T.tocsr() if back else self.matrix
            start = np.asarray(matrix.indptr)
            counts = np.diff(start)
            column = np.arange(len(matrix.data)) - np.repeat(start[:-1], counts)
            row = np.repeat(np.arange(len(counts)), counts)
            index = np.zeros((len(counts), max(1, int(counts.max()))), np.int64)
            weight = np.zeros(index.shape)
            index[row, column], weight[row, column] = np.asarray(matrix.indices), matrix.data
            xp = arrays.namespace(like)
            self._tables[key] = xp.asarray(index, device=arrays.device(like)), arrays.like(weight, like)
        return self._tables[key]
