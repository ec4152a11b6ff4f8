"""Lattices of rectified pictures, whose pitch is known."""

import numpy as np
import pytest

from lumigraph.calibration import exactly
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError


def measured(lattice, shape=(200, 210), noise=0.1):
    """A calibration with centres that are off by chance, and its fit."""
    rng = np.random.default_rng(3)
    indices = lattice.indices((8, shape[0] - 9), (8, shape[1] - 9))
    centers = lattice.position(indices) + noise * rng.standard_normal(indices.shape)
    return Calibration(lattice, shape, indices, centers, noise)


@pytest.mark.parametrize("layout", ["square", "hex"])
@pytest.mark.parametrize("turn", [0.0, np.pi / 6])
def test_an_exact_pitch_is_kept_and_only_the_place_is_measured(layout, turn):
    found = measured(getattr(Lattice, layout)(19.014, 1e-4 + turn, (9.3, 9.7)))
    exact = exactly(found, 19, turn)
    truth = getattr(Lattice, layout)(19.0, turn)
    np.testing.assert_allclose(np.abs(np.linalg.det(exact.lattice.matrix)), truth.cell_area, rtol=1e-12)
    assert exact.lattice.pitch == pytest.approx(19, rel=1e-12)
    assert exact.lattice.rotation == pytest.approx(found.lattice.rotation, abs=2e-4)
    middle = found.lattice.index(100, 105)
    np.testing.assert_allclose(exact.position(np.array(middle)), found.position(np.array(middle)), atol=0.06)
    assert exact.residual_px == pytest.approx(np.sqrt((exact.residuals**2).sum(-1).mean()))
    assert exact.warp is None


def test_a_picture_with_another_pitch_is_not_exact():
    with pytest.raises(CalibrationError, match=r"20\.500 px.*slips by 0\.\d\d of a pitch"):
        exactly(measured(Lattice.square(20.5, 0, (9, 9))), 19)
    with pytest.raises(CalibrationError, match="pitch"):
        exactly(measured(Lattice.square(20.5, 0, (9, 9))), -19)
