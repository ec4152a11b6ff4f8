"""Several depths as one operator: sums of planes."""

from dataclasses import dataclass

import numpy as np
import pytest

from lumigraph.core.arrays import namespace, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.operators.slices import Slices

GRID = Grid((3, 4), 1.0)


@dataclass
class Dense:
    """Any matrix as an operator of a plane."""

    matrix: np.ndarray

    shape = ((2, 5), (3, 4))

    def forward(self, intensity, /):
        xp = namespace(intensity)
        return xp.reshape(
            xp.asarray(self.matrix, dtype=intensity.dtype) @ xp.reshape(intensity, (12,)), (2, 5)
        )

    def adjoint(self, raw, /):
        xp = namespace(raw)
        return xp.reshape(xp.asarray(self.matrix.T, dtype=raw.dtype) @ xp.reshape(raw, (10,)), (3, 4))


@pytest.fixture
def slices(rng):
    return Slices([Dense(rng.random((10, 12))) for _ in range(3)], GRID, (-1e-3, 0.0, 2e-3))


def test_the_raw_image_is_the_sum_of_those_of_the_slices(slices, xp, rng):
    volume = rng.random((3, 3, 4))
    assert slices.shape == ((2, 5), (3, 3, 4))
    expected = sum(plane.forward(layer) for plane, layer in zip(slices.planes, volume, strict=True))
    np.testing.assert_allclose(to_numpy(slices.forward(xp.asarray(volume))), expected, rtol=1e-12)


def test_the_adjoint_is_the_transpose(slices, xp, rng):
    x, y = rng.random((3, 3, 4)), rng.random((2, 5))
    back = to_numpy(slices.adjoint(xp.asarray(y)))
    assert back.shape == x.shape
    assert (slices.forward(x) * y).sum() == pytest.approx((x * back).sum(), rel=1e-12)


def test_a_point_spread_function_is_a_column(slices):
    image = slices.psf((1, 2, 3))
    assert image.dtype == np.float32
    np.testing.assert_allclose(image.ravel(), slices.planes[1].matrix[:, 11], rtol=1e-6)


def test_another_shape_is_refused(slices):
    with pytest.raises(
        GeometryError, match=r"an object has shape \(3, 4\) but the operator takes \(3, 3, 4\)"
    ):
        slices.forward(np.ones((3, 4)))
