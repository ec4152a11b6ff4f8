"""The experiment on a camera 2.0's deconvolved picture."""

import numpy as np
import pytest

from lumigraph.studies.thesis import Context, find
from lumigraph.studies.thesis.beyond.deconvolution import PARTS, _Bench, _main_transfer


@pytest.fixture(scope="module")
def outcome():
    (one,) = find(["deconvolution-2.0"])
    return one.run(Context(quick=True))


def row(outcome, quantity):
    (found,) = [one.got for one in outcome.rows if one.quantity == quantity]
    return found


def test_every_expected_row_passes(outcome):
    assert [one.quantity for one in outcome.rows if one.passed is False] == []
    assert sum(one.passed is not None for one in outcome.rows) >= 5


def test_deconvolution_keeps_what_rendering_loses_below_the_rendered_cutoff(outcome):
    for part in (0.1, 0.3, 0.42):
        told = f"at {part:g} of the main lens's cut-off"
        basic, blended, deconvolved = (
            row(outcome, f"contrast, {name}, {told}") for name in ("basic", "blended", "deconvolved")
        )
        assert deconvolved < 1.1
        assert deconvolved > 1.05 * max(basic, blended)


def test_what_the_raw_image_holds_falls_to_nothing_at_the_main_lens_s_cutoff(outcome):
    found = [
        row(outcome, f"modulation of the raw image at {part:g} of the main lens's cut-off") for part in PARTS
    ]
    assert np.all(np.diff(found) < 0)
    assert found[PARTS.index(0.9)] > 3 * found[PARTS.index(1.1)]


def test_the_deconvolved_picture_stands_as_the_scene_does():
    """Neither mirrored nor shifted: correlated with the scene's frequencies below the rendered cut-off."""
    bench = _Bench.of(quick=True)
    x, y = bench.grid.x, bench.grid.y[:, None]
    scene = 1 + 0.4 * np.sin(2 * np.pi * bench.cutoff * (0.15 * x + 0.1 * y)) + 0.3 * (x > 0) * (y > 0)
    found = bench.deconvolved(bench.raw(scene.astype(np.float32), None), 10)
    inner = (slice(12, -12), slice(12, -12))
    assert np.corrcoef(found[inner].ravel(), scene[inner].ravel())[0, 1] > 0.95


def test_the_transfer_of_a_round_pupil_is_the_one_of_the_books():
    """Goodman, Introduction to Fourier Optics, equation 6-31: 0.391 at half of the cut-off."""
    np.testing.assert_allclose(_main_transfer(np.array([0.0, 0.5, 1.0, 1.2])), [1, 0.39100, 0, 0], atol=1e-5)
