"""Deviations by the scatter of scores, against estimates from drawn noise; and what a misfit is."""

import warnings

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.studies.adaptive.clusters import Clusters, widened
from lumigraph.studies.adaptive.misfit import Misfit

SIDE, PITCH = 10, 9.3
"""Lenslets along a side, and pixels along each."""


@pytest.fixture(scope="module")
def clusters():
    shape = (round(SIDE * PITCH),) * 2
    at = np.stack(np.meshgrid(*[np.arange(SIDE)] * 2, indexing="ij"), -1).reshape(-1, 2)
    first = (PITCH - 1) / 2
    lattice = Lattice.square(PITCH, origin=(first, first))
    return Clusters.of(Calibration(lattice, shape, at, lattice.position(at), 0.0), 2)


def left_over(kind, clusters, rng):
    """Independent noise of 1; twice as much in common of a lenslet's pixels, or of those in one place."""
    noise = rng.normal(size=clusters.lenslets.shape)
    if kind == "noise":
        return noise
    labels = getattr(clusters, kind)
    return noise + 2 * rng.normal(size=labels.max() + 1)[labels]


def test_pixels_are_sorted_by_lenslet_and_by_place(clusters):
    assert len(np.unique(clusters.lenslets)) == SIDE**2
    assert len(np.unique(clusters.places)) == 25
    _, counts = np.unique(clusters.lenslets, return_counts=True)
    assert counts.mean() == pytest.approx(PITCH**2, rel=1e-3)
    assert len(np.unique(clusters.lenslets[:, : int(PITCH)])) == SIDE
    rows, columns = (np.unique(np.diff(clusters.places // step % 5, axis=k)) for k, step in ((0, 5), (1, 1)))
    assert set(rows) == set(columns) == {-4, 0, 1}  # once around behind each lenslet


def test_few_lenslets_are_parted(clusters):
    """Into 25, where there are no more than twice as many as terms: each pixel's is in one place."""
    shape, at = clusters.lenslets.shape, np.array([[0, 0], [SIDE - 1, SIDE - 1]])
    lattice = Lattice.square(PITCH, origin=((PITCH - 1) / 2,) * 2)
    calibration = Calibration(lattice, shape, at, lattice.position(at), 0.0)
    parted, whole = (Clusters.of(calibration, terms) for terms in (50, 49))
    assert len(np.unique(whole.lenslets)) == 100
    assert len(np.unique(parted.lenslets)) == 2500
    assert (parted.lenslets // 25 == whole.lenslets).all()
    assert len(np.unique(parted.places)) == 100


def test_what_clusters_of_noise_scatter_by_chance_is_left_out(clusters, rng):
    """In 9 of 10 drawings noise is what noise says; without the allowance in none."""
    columns = rng.normal(size=(2, *clusters.lenslets.shape))
    noise = np.tensordot(columns, columns, ((1, 2), (1, 2)))
    found = [clusters.scatter(columns * rng.normal(size=columns.shape[1:]), noise) for _ in range(100)]
    same = [np.allclose(one, noise, rtol=1e-9, atol=1e-9 * np.trace(noise)) for one in found]
    assert np.mean(same) > 0.8
    assert max(np.trace(one) / np.trace(noise) for one in found) < 2


@pytest.mark.parametrize("kind", ["noise", "lenslets", "places"])
def test_deviations_are_those_of_estimates_from_noise_that_is_alike(kind, clusters, rng):
    """Least squares of two columns in 400 drawings; noise alone says 3 times too little or less.

    Places have 25 clusters: their variance scatters by √(2/25) = 0.28 each time, the mean of 400 by 0.015.
    """
    columns = rng.normal(size=(2, *clusters.lenslets.shape))
    columns += 3 * rng.normal(size=(2, SIDE**2))[:, np.unique(clusters.lenslets, return_inverse=True)[1]]
    columns += 3 * rng.normal(size=(2, 25))[:, clusters.places]
    information = np.tensordot(columns, columns, ((1, 2), (1, 2)))
    found, said = [], []
    for _ in range(400):
        data = left_over(kind, clusters, rng)
        c = np.linalg.solve(information, np.tensordot(columns, data, 2))
        scores = columns * (data - np.tensordot(c, columns, 1))
        inverse = np.linalg.inv(information)
        found.append(c)
        said.append(inverse @ clusters.scatter(scores, information) @ inverse)
    true = np.cov(np.array(found).T)
    if kind != "noise":
        assert np.trace(true) > 9 * np.trace(np.linalg.inv(information))
    assert np.trace(np.mean(said, 0)) == pytest.approx(np.trace(true), rel=0.25)


def test_deviations_are_nowhere_below_those_of_noise():
    information, scatter = np.diag([4.0, 9.0]), np.diag([1.0, 90.0])
    found = widened(information, information, scatter)
    np.testing.assert_allclose(found, np.diag([1 / 4, 90 / 81]))
    assert np.linalg.eigvalsh(widened(information, information, -scatter)).min() > 0.1


def test_noise_leaves_1_as_far_as_its_deviation_says(rng):
    """2000 drawings of 400 pixels with 2 electrons, a grey value being a third of one, half of them dead."""
    gain, shown = 3.0, np.full((20, 20), 2 / 3)
    weights = gain * (np.arange(20) % 2)[:, None] * np.ones(20)
    drawn = [Misfit.of(weights, gain, rng.poisson(gain * shown) / gain, shown) for _ in range(2000)]
    pearson = np.array([one.pearson for one in drawn])
    assert pearson.mean() == pytest.approx(1, abs=0.01)
    assert drawn[0].deviation == pytest.approx(pearson.std(), rel=0.06)


def test_what_noise_does_not_explain_is_warned_of():
    with pytest.warns(
        lg.SamplingWarning, match=r"2 beads leave 1.2 times .* leaves 1 ± 0.01: .* Ask for more"
    ):
        Misfit(1.2, 0.01).warn("2 beads leave", "Ask for more terms.")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Misfit(1.2, 0.05).warn("2 beads leave", "")
        Misfit(1.04, 0.001).warn("2 beads leave", "")
