"""Errors to expect: what they are made of, and how their factors are found."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.expected import fitted

from lumigraph.depth.expected import LINES, Evidence, deviation, expected, terms
from lumigraph.depth.volume import rivals


@pytest.fixture
def edge():
    """A step of 4 px, nearer on the left, in a picture that shows no edge; noise of 0.1 px."""
    values = np.where(np.arange(40) < 20, 4.0, 0.0) + np.zeros((30, 1))
    even = np.zeros_like(values)
    return values, Evidence(even + 0.1, even, even, even, even)


def test_a_map_is_least_sure_on_the_near_side_of_an_edge_that_no_picture_shows(edge):
    values, evidence = edge
    error = expected(values, evidence, LINES)[15]
    assert error[:10] == pytest.approx(0.1 * LINES["noise"])
    near = 0.1 * LINES["noise"] + 4 * (LINES["farther"] + LINES["faint"] + LINES["wide"])
    assert error[19] == pytest.approx(near)
    assert error[20] == pytest.approx(0.1 * LINES["noise"] + 4 * LINES["nearer"])
    shown = replace(evidence, contrast=np.ones_like(values))
    assert expected(values, shown, LINES)[15, 19] < 0.5 * near


def test_a_slant_is_no_edge():
    """Only its end is: a slope of 0.2 px a sample counted as an edge of 0.2 to 1.4 px everywhere."""
    values = 0.2 * np.arange(40) + np.zeros((30, 1))
    even = np.zeros_like(values)
    parts = terms(values, Evidence(even, even, even, even, even))
    inside = [parts[name][:, 5:-5] for name in ("nearer", "farther", "faint", "wide")]
    assert np.abs(inside).max() == pytest.approx(0, abs=1e-9)
    thin = terms(values + 3.0 * (np.arange(40) == 20), Evidence(even, even, even, even, even))
    assert thin["farther"][15, 20] == pytest.approx(3.2)


def test_the_factors_that_made_errors_are_found_again(rng):
    values = np.cumsum(np.cumsum(rng.normal(0, 0.3, (80, 90)), 0), 1) * (rng.random((80, 90)) > 0.3)
    evidence = Evidence(*rng.random((5, 80, 90)) * np.array([1.0, 0.3, 0.5, 0.01, 0.0])[:, None, None])
    parts = np.stack([part.ravel() for part in terms(values, evidence).values()])
    true = np.array(list(LINES.values()))
    # Errors are not of one size: exponential, as where some places are right and some far off.
    errors = rng.exponential(true @ parts)
    found = fitted(parts, errors)
    assert (found @ parts).mean() == pytest.approx(errors.mean(), rel=1e-3)
    assert np.mean(np.abs(found @ parts / (true @ parts) - 1)) < 0.1


def test_a_slant_that_noise_disputes_is_not_at_stake_between_micro_images():
    values = 0.2 * np.arange(40) + np.zeros((30, 1))
    even = np.zeros_like(values)
    inside = [
        terms(values, Evidence(even, even, even + 0.5, even, even), slants=slants)["disputed"][10:-10, 10:-10]
        for slants in (True, False)
    ]
    assert inside[0] == pytest.approx(0.5 * 14 * 0.2)
    assert inside[1] == pytest.approx(0, abs=1e-9)


def test_rivals_are_valleys_by_their_distance_and_depth():
    """Deepest at 20 of a ridge of height 10; a valley half as deep 8 before it, one as deep 9 behind."""
    label = np.arange(40.0)
    valleys = [
        -2.5 * d * np.maximum(4 - np.abs(label - at), 0) for at, d in ((20, 1.0), (12, 0.5), (29, 1.0))
    ]
    total = 10 + sum(valleys)[:, None, None] + np.zeros((1, 3, 4))
    total[20] -= 1e-6
    assert rivals(total, 1.0) == pytest.approx(8 * 0.5**2 + 9)
    assert rivals(total[::-1], 1.0) == pytest.approx(8 * 0.5**2 + 9)
    shallow = 10 + valleys[0][:, None, None] + 0.7 * np.cos(label * np.pi)[:, None, None] * np.ones((1, 3, 4))
    assert rivals(shallow, 2.0) == pytest.approx(0)
    assert rivals(np.ones((40, 3, 4)), 1.0) == pytest.approx(0)


def test_only_areas_that_others_explain_as_well_are_at_stake():
    even = np.zeros((30, 40))
    others = even.copy()
    others[5:15, 5:20], others[:, 30:34], others[10, 10] = 4.0, 4.0, 0.0
    error = expected(even, Evidence(even, even, even, even, others), LINES)
    assert error[5:15, 5:20] == pytest.approx(2.0)  # with its gap, which is one place of a pattern
    assert error[:, 25:] == pytest.approx(0)  # as narrow as what an edge of depth leaves


def test_a_mean_of_unequal_noise_has_the_deviation_that_draws_have(rng):
    """Half of the places have five times the noise; one noise for all would be off by a third or more."""
    shape, noise = (41, 41), np.where(np.arange(41) % 2, 0.5, 0.1) + np.zeros((41, 1))
    slope = np.where(np.arange(41) % 2, 0.3, 1.0) + np.zeros((41, 1))
    draws = noise * rng.standard_normal((400, *shape))
    window = np.s_[:, 17:24, 17:24]
    means = (slope * draws)[window].sum((1, 2)) / (slope**2)[window[1:]].sum()
    pulls = (slope**2 * draws**2).mean(0)
    rough = 10 * rng.standard_normal(shape)  # so that no wider window is asked
    found = deviation(rough, slope**2, pulls, LINES)[0][20, 20] / 7  # of a place by itself, not of 49
    assert found == pytest.approx(means.std(), rel=0.1)


def test_what_says_nothing_is_as_far_off_as_what_is_around_scatters(rng):
    """A gap in a slanted plane takes its noise, beside a step the step; where nothing is known, anything."""
    y, x = np.mgrid[:60, :80]
    plane = 0.05 * x + 0.2 * rng.standard_normal((60, 80))
    known = np.where((abs(y - 30) < 5) & (abs(x - 40) < 5), 0.0, 1.0)
    gap = deviation(plane, known, 1e-4 * known, LINES)[1]
    assert gap[30, 40] == pytest.approx(0.2, rel=0.15)
    assert gap[10, 10] == 0
    step = deviation(plane + 4 * (x > 40), known, 1e-4 * known, LINES)[1][30, 40]
    assert 0.7 < step < 2
    assert (deviation(plane, 0 * known, 0 * known, LINES)[0] == 1e3).all()
