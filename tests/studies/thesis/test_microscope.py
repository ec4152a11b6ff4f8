"""The experiments on the microscope's resolution: rows pass, other models fail, measures are right."""

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.scene import targets
from lumigraph.studies.thesis.microscope import _bench, usaf
from lumigraph.studies.thesis.microscope.resolution import bead, bead_rows, shell_radius, width
from lumigraph.units import um


def test_the_width_of_a_triangle_is_half_its_base():
    assert width(np.array([0.0, 1, 2, 3, 2, 1, 0]), 2.0) == pytest.approx(6.0)
    assert width(np.array([0.0, 0, 4, 0, 0]), 1.0) == pytest.approx(1.0)


def test_a_shells_radius_is_measured():
    at = np.arange(-25, 25.5) * um
    radius = np.sqrt(at[:, None, None] ** 2 + at[:, None] ** 2 + at**2)
    assert shell_radius(np.exp(-(((radius - 15 * um) / (2 * um)) ** 2)), radius) == pytest.approx(
        15e-6, abs=2e-7
    )


def test_contrast_is_one_on_the_target_itself_and_falls_where_it_is_soft():
    grid = Grid.square(700, 0.2 * um)
    picture = targets.usaf1951(grid, (7, 8)).parts[0].intensity
    found = [usaf.contrast(picture, grid, corner, w) for _, corner, w in usaf.elements((7, 8))]
    assert min(found) > 0.95
    assert usaf.contrast(picture[::-1], grid, *usaf.elements((7, 8))[0][1:]) < 0.5
    frequencies = [f for f, _, _ in usaf.elements((7, 8))]
    assert frequencies[0] == pytest.approx(128e3)
    assert usaf.finest_resolved({64.0: 0.9, 72.0: 0.3, 81.0: 0.1, 91.0: 0.8}, usaf.RESOLVED) == 72.0
    assert usaf.finest_resolved({64.0: 0.1}, usaf.RESOLVED) == 0.0


def test_bars_of_a_lenslet_vanish_where_they_fall_on_two():
    bars = np.tile((np.arange(54) // 9 % 2).astype(float), (18, 1))
    assert np.array_equal(usaf.one_value_a_lenslet(bars, 9), bars)
    assert np.ptp(usaf.one_value_a_lenslet(np.roll(bars, 4, 1), 9)[:, 9:45]) == pytest.approx(1 / 9)


@pytest.mark.parametrize(
    ("elements", "passed"),
    [(-3, (False, False)), (-1, (False, True)), (0, (True, True)), (1, (False, False))],
)
def test_a_method_that_is_one_element_finer_fails(elements, passed):
    seen = 100e3 * 2 ** (elements / 6)
    assert (usaf.in_focus(seen, 100e3).passed, usaf.off_focus(25 * um, seen, 100e3).passed) == passed


@pytest.mark.long
def test_a_paraxial_model_puts_the_bead_elsewhere():
    scope, rng = _bench.scope(9), np.random.default_rng(3)
    paraxial = scope.replace(objective={"model": "paraxial"})
    rows = bead_rows(scope, 25 * um, bead(scope, paraxial, 25 * um, rng))
    assert [row.quantity for row in rows if row.passed is False] == ["bead at 25 µm, depth found"]
