"""Chapters 2 and 3 of the thesis at their quick size: every row within its tolerance."""

import numpy as np
import pytest

from lumigraph.analysis import first_zero, rms_error
from lumigraph.studies.thesis import Context, find
from lumigraph.studies.thesis.figures import _lamp_edge, figure_2_11, figure_3_11, table_3_1
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.figures._coherence import Errors, Imager, masked, snapshots, white

FIGURES = ("2.4", "2.5", "2.11", "3.2", "3.3", "3.6", "3.8", "3.11", "3.12", "3.15", "3.18", "3.19")
IDS = ("2.34", "table-2.1", "table-3.1", "table-3.2", *(f"figure-{number}" for number in FIGURES))


SLOW = ("figure-3.18", "table-3.1")  # 5 s and more: run at full size alone


@pytest.mark.parametrize("name", [name for name in IDS if name not in SLOW])
def test_every_row_of_the_quick_experiment_passes(name):
    (experiment,) = find([name])
    outcome = experiment.run(Context(quick=True))
    assert outcome.figures
    assert outcome.why
    assert any(row.passed for row in outcome.rows)
    failed = [row for row in outcome.rows if row.passed is False]
    assert not failed


@pytest.fixture(scope="module")
def imager():
    """Bars of 20 samples instead of the target, which needs a larger window."""
    small = Imager(441)
    small.__dict__["target"] = np.tile((np.arange(441) // 20 % 2).astype(np.float32), (441, 1))
    return small


def test_the_tolerance_of_the_first_zero_tells_methods_apart():
    # The corrected method keeps aliased light, which moves the minimum by 0.7 um: more than the tolerance.
    near = two_f.middle(120e-6)
    cut = two_f.profile(two_f.point_image("corrected band limited")[0])[near]
    assert abs(first_zero(two_f.GRID.x[near], cut) - 48.794e-6) > table_3_1.TOLERANCES[5e-3] * 1e-6


def test_a_lamps_edge_lies_between_the_coherent_and_the_incoherent_one():
    """A point of light: 1/4 at the edge, (1/2 + Si(π)/π)² beside it. A lamp as wide as the lens: 1/3."""
    x = _lamp_edge.places()
    narrow, wide = _lamp_edge.lamp_edge_theory(1e-4), _lamp_edge.lamp_edge_theory(1.0)
    assert narrow.max() == pytest.approx((0.5 + 1.8519 / np.pi) ** 2, abs=0.01)  # another plateau, and pixels
    assert np.interp(0.0, x, narrow) == pytest.approx(1 / 4, abs=0.012)
    assert np.interp(0.0, x, wide) == pytest.approx(1 / 3, abs=0.012)
    assert wide[np.abs(x) < 1e-4].max() < 1


def test_two_thirds_of_a_lens_of_one_and_a_half_times_the_limit_reach_the_focus():
    assert figure_2_11.power_in_focus(1.5 * figure_2_11.LIMIT) == pytest.approx(2 / 3, abs=0.01)


def test_the_width_of_an_area_is_taken_between_samples():
    assert figure_3_11.width(np.array([1.0, 0.75, 0.25])) == pytest.approx(3.0)


def test_coarse_masks_leave_a_bias_and_white_phases_none(imager):
    coarse = Errors.of(snapshots(imager, masked(10), 20, 1), 20, imager.reference)
    independent = Errors.of(snapshots(imager, white, 100, 1), 100, imager.reference)
    assert coarse.bias > 0.15
    assert independent.bias < 0.02
    assert independent.speckle == pytest.approx(1.0, abs=0.1)


def test_snapshots_are_the_same_for_the_same_seed(imager):
    one, other = (snapshots(imager, white, 4, seed=3) for _ in range(2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, snapshots(imager, white, 4, seed=4))


def test_the_mean_of_white_snapshots_is_the_exact_incoherent_image(imager):
    mean = snapshots(imager, white, 400, seed=5).sum(0) / 400
    # 1/sqrt(400) = 0.05, over some 2000 speckles: a scale or a frequency that is off gives 0.1 and more.
    assert rms_error(mean, imager.reference, scaled=False) == pytest.approx(0.05, abs=0.006)
