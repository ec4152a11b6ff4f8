"""Errors to expect: what they are made of, and how their factors are found."""

import numpy as np
import pytest
from benchmarks.expected import fitted

from lumigraph.depth.expected import FACTORS, Evidence, expected, terms
from lumigraph.depth.volume import rivals


@pytest.fixture
def edge():
    """A step of 4 px, nearer on the left, in a picture that shows no edge; noise of 0.1 px."""
    values = np.where(np.arange(40) < 20, 4.0, 0.0) + np.zeros((30, 1))
    even = np.zeros_like(values)
    return values, Evidence(even + 0.1, even, even, even)


def test_a_map_is_least_sure_on_the_near_side_of_an_edge_that_no_picture_shows(edge):
    values, evidence = edge
    error = expected(values, evidence)[15]
    assert error[:10] == pytest.approx(0.1 * FACTORS["noise"])
    near = 0.1 * FACTORS["noise"] + 4 * (FACTORS["farther"] + FACTORS["faint"] + FACTORS["wide"])
    assert error[19] == pytest.approx(near)
    assert error[20] == pytest.approx(0.1 * FACTORS["noise"] + 4 * FACTORS["nearer"])
    shown = Evidence(evidence.deviation, evidence.disputed, np.ones_like(values), evidence.rivals)
    assert expected(values, shown)[15, 19] < 0.5 * near


def test_a_slant_is_no_edge():
    """Only its end is: a slope of 0.2 px a sample counted as an edge of 0.2 to 1.4 px everywhere."""
    values = 0.2 * np.arange(40) + np.zeros((30, 1))
    even = np.zeros_like(values)
    parts = terms(values, Evidence(even, even, even, even))
    inside = [parts[name][:, 5:-5] for name in ("nearer", "farther", "faint", "wide")]
    assert np.abs(inside).max() == pytest.approx(0, abs=1e-9)
    thin = terms(values + 3.0 * (np.arange(40) == 20), Evidence(even, even, even, even))
    assert thin["farther"][15, 20] == pytest.approx(3.2)


def test_the_factors_that_made_errors_are_found_again(rng):
    values = np.cumsum(np.cumsum(rng.normal(0, 0.3, (80, 90)), 0), 1) * (rng.random((80, 90)) > 0.3)
    evidence = Evidence(*rng.random((4, 80, 90)) * np.array([1.0, 0.5, 0.01, 0.0])[:, None, None])
    parts = np.stack([part.ravel() for part in terms(values, evidence).values()])
    true = np.array(list(FACTORS.values()))
    # Errors are not of one size: exponential, as where some places are right and some far off.
    errors = rng.exponential(true @ parts)
    found = fitted(parts, errors)
    assert (found @ parts).mean() == pytest.approx(errors.mean(), rel=1e-3)
    assert np.mean(np.abs(found @ parts / (true @ parts) - 1)) < 0.1


def test_a_slant_that_noise_disputes_is_not_at_stake_between_micro_images():
    values = 0.2 * np.arange(40) + np.zeros((30, 1))
    even = np.zeros_like(values)
    inside = [
        terms(values, Evidence(even, even + 0.5, even, even), slants=slants)["disputed"][10:-10, 10:-10]
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
    error = expected(even, Evidence(even, even, even, others))
    assert error[5:15, 5:20] == pytest.approx(2.0)  # with its gap, which is one place of a pattern
    assert error[:, 25:] == pytest.approx(0)  # as narrow as what an edge of depth leaves
