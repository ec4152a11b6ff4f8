"""The experiment on the microscope's resolution: its rows pass, and what it measures with is right."""

import numpy as np
import pytest

from lumigraph.experiments import Context, find
from lumigraph.experiments.microscope.resolution import width


def test_the_width_of_a_triangle_is_half_its_base():
    assert width(np.array([0.0, 1, 2, 3, 2, 1, 0]), 2.0) == pytest.approx(6.0)
    assert width(np.array([0.0, 0, 4, 0, 0]), 1.0) == pytest.approx(1.0)


@pytest.mark.long
def test_every_row_of_the_reduced_run_passes():
    (one,) = find(["microscope-resolution"])
    outcome = one.run(Context(quick=True))
    assert [row.quantity for row in outcome.rows if row.passed is False] == []
    assert len(outcome.figures) == 3
