r"""Products with centrosymmetric matrices, :math:`M_{-i, -j} = M_{ij}`, by halves.

Such a matrix turns even data into even and odd into odd, so that two matrices of half the rows and columns
do: half of the arithmetic.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Mirrored:
    """A centrosymmetric matrix (rows, columns).

    Parameters
    ----------
    shape
        Shape of the matrix.
    even, odd
        (rows - rows // 2, columns - columns // 2): from the upper halves of even and odd data to those of
        what they become.
    """

    shape: tuple[int, int]
    even: np.ndarray
    odd: np.ndarray

    @classmethod
    def of(cls, matrix: np.ndarray) -> "Mirrored":
        """The halves of a matrix, of which the upper rows are read."""
        rows, columns = matrix.shape
        half = matrix[rows // 2 :]
        upper, lower = half[:, columns // 2 :], half[:, : columns - columns // 2][:, ::-1]
        even, odd = (upper + lower) / 2, (upper - lower) / 2
        if columns % 2:
            even[:, 0] /= 2  # what stands in the middle is its own mirror image
        return cls((rows, columns), even, odd)

    @property
    def whole(self) -> np.ndarray:
        """The matrix."""
        return self.down(np.eye(self.shape[1], dtype=self.even.dtype))

    @property
    def transposed(self) -> "Mirrored":
        """The transpose, which is centrosymmetric, too."""
        (rows, columns), even = self.shape, self.even.T.copy()
        if rows % 2:
            even[:, 0] /= 2  # as `of` has what stands in the middle of a row
        if columns % 2:
            even[0] *= 2
        return Mirrored((columns, rows), even, self.odd.T)

    @property
    def nbytes(self) -> int:
        """Memory of both halves [bytes]."""
        return self.even.nbytes + self.odd.nbytes

    def down(self, data: np.ndarray) -> np.ndarray:
        """``matrix @ data``, of data (..., columns, k)."""
        return by_halves(data, self.shape[0], self.even.__matmul__, self.odd.__matmul__, axis=-2)

    def right(self, data: np.ndarray) -> np.ndarray:
        """``data @ matrix.T``, of data (..., k, columns)."""
        return by_halves(data, self.shape[0], self.even.T.__rmatmul__, self.odd.T.__rmatmul__, axis=-1)


def by_halves(
    data: np.ndarray,
    count: int,
    even: Callable[[np.ndarray], np.ndarray],
    odd: Callable[[np.ndarray], np.ndarray],
    *,
    axis: int,
) -> np.ndarray:
    """Result (`count` along the axis) of applying separate functions to the even and odd half of data.

    `even` takes the sum of the upper half and the mirrored lower one and gives the even result's upper half,
    `odd` their difference and gives the odd one's. Halves of odd counts begin in the middle.
    """
    n, along = data.shape[axis], np.moveaxis(data, axis, 0)
    upper, lower = (np.moveaxis(half, 0, axis) for half in (along[n // 2 :], along[: n - n // 2][::-1]))
    a, b = (np.moveaxis(part, axis, 0) for part in (even(upper + lower), odd(upper - lower)))
    shape = [*data.shape]
    shape[axis] = count
    found = np.empty(shape, np.result_type(a, b))
    along = np.moveaxis(found, axis, 0)
    np.add(a, b, out=along[count // 2 :])
    np.subtract(a[count % 2 :], b[count % 2 :], out=along[: count // 2][::-1])
    return found
