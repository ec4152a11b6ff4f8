"""Products by halves are those with the whole matrix."""

import numpy as np
import pytest

from lumigraph.core.mirrored import Mirrored


@pytest.mark.parametrize("shape", [(6, 4), (6, 5), (7, 4), (7, 5), (1, 1), (2, 1), (1, 2)])
def test_a_matrix_that_is_alike_from_both_ends_is_its_halves(shape, rng):
    matrix = rng.random(shape) + 1j * rng.random(shape)
    matrix = matrix + matrix[::-1, ::-1]
    found, data = Mirrored.of(matrix), rng.random((3, shape[1], 2)) + 1j
    assert found.whole == pytest.approx(matrix, abs=1e-14)
    assert found.transposed.whole == pytest.approx(matrix.T, abs=1e-14)
    assert found.down(data) == pytest.approx(matrix @ data, abs=1e-13)
    across = np.swapaxes(data, -1, -2)
    assert found.right(across) == pytest.approx(across @ matrix.T, abs=1e-13)
    assert 2 * found.nbytes <= matrix.nbytes * (1 + 1 / shape[0]) * (1 + 1 / shape[1])
