"""`Volume`: planes with their places."""

import numpy as np
import pytest

import lumigraph as lg

GRID = lg.Grid((4, 5), (2e-6, 1e-6))


def test_a_volume_knows_its_spacing_and_planes(xp):
    data = xp.asarray(np.arange(60.0).reshape(3, 4, 5))
    volume = lg.Volume(data, GRID, (-3e-6, 0.0, 3e-6))
    assert volume.shape == (3, 4, 5)
    assert volume.spacing == pytest.approx((3e-6, 2e-6, 1e-6))
    assert volume.depth_step == pytest.approx(3e-6)
    assert float(volume.plane(2e-6)[0, 0]) == 40.0


def test_depths_may_be_uneven_and_descend():
    volume = lg.Volume(np.ones((3, 4, 5, 3)), GRID, np.array([4e-6, 1e-6, 0.0]))
    assert volume.depth_step is None
    assert volume.spacing[0] == pytest.approx(2e-6)
    assert lg.Volume(np.ones((3, 4, 5)), GRID, (2e-6, 1e-6, 0.0)).depth_step == pytest.approx(-1e-6)
    assert lg.Volume(np.ones((1, 4, 5)), GRID, (2e-6,)).spacing[0] == 0


@pytest.mark.parametrize(
    ("shape", "depths", "message"),
    [
        ((3, 4, 6), (0.0, 1.0, 2.0), r"shape \(3, 4, 6\) but must be .* \(4, 5\) of the grid"),
        ((3, 4, 5), (0.0, 1.0), r"z = 2 of the depths"),
        ((4, 5), (0.0,), r"shape \(4, 5\) but must be"),
        ((3, 4, 5), (0.0, np.nan, 2.0), "must be finite"),
        ((3, 4, 5), (0.0, 2.0, 1.0), "ascend or descend"),
        ((3, 4, 5), (0.0, 0.0, 1.0), "ascend or descend"),
    ],
)
def test_data_that_does_not_fit_is_refused(shape, depths, message):
    with pytest.raises(lg.GeometryError, match=message):
        lg.Volume(np.ones(shape), GRID, depths)


def test_a_list_is_no_volume():
    with pytest.raises(lg.GeometryError, match="must be an array"):
        lg.Volume([[[1.0]]], lg.Grid((1, 1), 1.0), (0.0,))
