"""Aberrations from the light field of beads: raw images are simulated, not made by the model."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core import memory
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate
from lumigraph.studies.adaptive.beads import brightest
from lumigraph.studies.adaptive.field import ALIKE, PRIOR, FieldNodes
from lumigraph.studies.adaptive.fit import BeadFit
from lumigraph.studies.adaptive.search import BeadSearch
from lumigraph.studies.adaptive.worth import worth

SCOPE = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
    wavelength="525 nm",
    objective={
        "magnification": 20.0, "numerical_aperture": 0.5, "immersion_index": 1.0, "model": "scalar",
        "maker": None, "tube_lens": None,
    },
    lenslets={"pitch": "125 um", "count": (7, 7)},
    sensor={"shape": (135, 135)},
)  # fmt: skip
EXPOSURE = Exposure(background=1.0, gain=1.0)
DEPTHS = (-12e-6, -6e-6, 0.0, 6e-6, 12e-6)
BEADS = np.array([[-8.3e-6, -7.1e-6, 7.7e-6], [9.2e-6, 6.4e-6, -8.9e-6]])
UNIT = 14.6
"""Photons of a point of intensity 1."""


def exposed(aberrations, photons, beads=BEADS, seed=0, accuracy=2e-2, scope=SCOPE):
    bent = scope.replace(objective={"aberrations": aberrations})
    light = sum(bent.point_image(*place, accuracy=accuracy) for place in beads)
    return np.random.default_rng(seed).poisson(light * photons / UNIT + 1).astype(np.float32)


@pytest.fixture(scope="module")
def bent():
    """What is found of 0.2 waves of astigmatism and -0.15 of coma, with two terms that are not there."""
    return estimate(exposed({6: 0.2, 8: -0.15}, 2e4), SCOPE, DEPTHS, (4, 6, 8, 9, 11), exposure=EXPOSURE)


def test_aberrations_come_back_with_the_beads(bent):
    assert bent.coefficients == pytest.approx({6: 0.2, 8: -0.15, 9: 0, 11: 0}, abs=0.01)
    away = np.linalg.norm(bent.beads.positions[:, None] - BEADS, axis=-1)
    assert away.shape == (2, 2)
    assert away.min(0).max() < 0.15e-6
    np.testing.assert_allclose(bent.beads.intensities * UNIT, 2e4, rtol=0.03)


@pytest.mark.long
def test_aberrations_come_back_behind_round_lenslets():
    """Square ones of the same width have images of points that are off by 0.5."""
    scope = SCOPE.replace(lenslets={"shape": "round"})
    raw = exposed({6: 0.2, 8: -0.15}, 2e4, scope=scope)
    found = estimate(raw, scope, DEPTHS, (6, 8, 9), exposure=EXPOSURE)
    assert found.coefficients == pytest.approx({6: 0.2, 8: -0.15, 9: 0}, abs=0.01)
    assert found.pearson == pytest.approx(1, abs=0.1)


def test_what_explains_the_picture_is_stated(bent):
    before, after = bent.deviance
    assert before > 1.3 * after
    assert bent.pearson == pytest.approx(1, abs=0.1)
    assert (bent.deviations < 0.01).all()
    assert bent.untold == {4: "the beads' depths explain it"}
    assert dict(bent.instrument.objective.aberrations) == pytest.approx({6: 0.2, 8: -0.15}, abs=0.01)
    assert bent.rms == pytest.approx(0.25, abs=0.01)


def test_bright_beads_are_explained_by_finer_images():
    """Images to 3e-2, which the fit begins with, leave 1.41 times the variance of noise."""
    raw = exposed({6: 0.2, 8: -0.15}, 2e6, accuracy=1e-2)
    found = estimate(raw, SCOPE, DEPTHS, (6, 8), exposure=EXPOSURE)
    assert found.pearson < 1.05
    assert found.coefficients == pytest.approx({6: 0.2, 8: -0.15}, abs=0.003)


def test_the_phase_has_the_wavefronts_rms(bent):
    phase = bent.phase(257)
    assert np.isnan(phase[0, 0])
    assert np.nanstd(phase) == pytest.approx(bent.rms, rel=0.02)
    assert np.nanmean(phase) == pytest.approx(0, abs=2e-3)
    with pytest.raises(lg.LumigraphError, match="samples"):
        bent.phase(0)


def test_no_aberration_is_invented():
    found = estimate(exposed({}, 5e3), SCOPE, DEPTHS, (6, 7, 8, 11), exposure=EXPOSURE)
    assert found.rms == 0
    assert not found.instrument.objective.aberrations
    assert (found.deviations > 0).all()


STRONG = {5: 0.4, 6: -0.5, 7: 0.45, 8: 0.4, 9: -0.35, 10: 0.3, 11: -0.25}


@pytest.mark.long  # 10 s
def test_shifts_of_views_begin_a_strong_wavefront():
    found = estimate(exposed(STRONG, 2e4), SCOPE, DEPTHS, tuple(STRONG), exposure=EXPOSURE)
    assert found.coefficients == pytest.approx(STRONG, abs=0.02)
    assert found.pearson < 1.2
    assert found.steps <= 15  # 21 from none


def test_regions_of_the_field_have_aberrations_of_their_own():
    sides = [SCOPE.replace(objective={"aberrations": {6: waves}}) for waves in (0.2, -0.1)]
    light = sum(one.point_image(*place, accuracy=2e-2) for one, place in zip(sides, BEADS, strict=True))
    raw = np.random.default_rng(3).poisson(light * 2e4 / UNIT + 1).astype(np.float32)
    steps: list[float] = []
    found = estimate(raw, SCOPE, DEPTHS, (6,), regions=(1, 2), exposure=EXPOSURE, progress=steps.append)
    assert len(steps) > 2
    assert 0 < min(steps) <= max(steps) < 1
    assert found.values.shape == (1, 2, 1)
    at_beads = np.interp(BEADS[:, 1], found.nodes[1], found.values[0, :, 0])
    np.testing.assert_allclose(at_beads, [0.2, -0.1], atol=0.02)
    assert found.pearson < 1.1


def test_neighbours_that_are_alike_are_drawn_together():
    found = estimate(exposed({6: 0.2}, 2e3), SCOPE, DEPTHS, (6,), regions=(1, 2), exposure=EXPOSURE)
    (one, both), (_, other) = found.covariance
    assert both > 0.5 * np.sqrt(one * other)  # 0.02 where they are expected to differ by 0.3
    np.testing.assert_allclose(found.values, 0.2, atol=0.03)


def test_beads_are_looked_for_through_a_wavefront():
    raw, c = exposed(STRONG, 2e4), np.array(list(STRONG.values()))
    search = BeadSearch.of(SCOPE, tuple(STRONG), np.array(DEPTHS), (raw, EXPOSURE, None), 3e-2)
    found, without = search.beads(search.problem(c)), search.beads(search.problem(0 * c))
    away = np.linalg.norm(found.positions[:, None] - BEADS, axis=-1)
    assert away.shape == (2, 2)
    assert away.min(0).max() < 2e-6
    np.testing.assert_allclose(found.intensities * UNIT, 2e4, rtol=0.15)
    assert len(without.intensities) > 2
    again = search.more(BeadFit(found, c[None]), search.problem(c).read(0 * raw))
    assert again is not None
    assert len(again.intensities) == 2
    assert search.more(BeadFit(found, c[None]), raw + 1.0) is None


@pytest.mark.parametrize(
    ("kind", "message"),
    [("beads", "operator of 5 depths needs"), ("volume", "operator of 5 depths with 2 derivatives needs")],
)
def test_images_of_points_that_do_not_fit_in_memory_are_refused(kind, message, monkeypatch):
    """Asked before they are made: 1 MiB is free."""
    monkeypatch.setattr(memory, "available", lambda: 2**20)
    with pytest.raises(lg.SamplingError, match=message):
        estimate(np.ones((135, 135), np.float32), SCOPE, DEPTHS, (6, 8), exposure=EXPOSURE, object=kind)


RAW = np.ones((135, 135), np.float32)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"microscope": SCOPE.replace(configuration="2.0", lenslet_offset="1 mm")}, "configuration '1.0'"),
        ({"microscope": lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1")}, "need a .picture., flat"),
        ({"terms": (1, 2, 3, 4)}, "beads explain 1 to 4 themselves"),
        ({"terms": ()}, "Give others"),
        ({"terms": (0,)}, "Noll's index is 0"),
        ({"depths": (0.0,)}, "at least two planes"),
        ({"depths": (0.0, np.nan)}, "a depth"),
        ({"raw": RAW[:9]}, "the operator makes"),
        ({"raw": RAW * np.nan}, "NaN"),
        ({"raw": 0 * RAW}, "dark"),
        ({"regions": (0, 1)}, "regions"),
        ({"regions": (1, 1, 1)}, "two whole numbers"),
        ({"object": "cells"}, "'beads', 'volume' or 'picture'"),
        ({"object": "volume", "regions": (2, 2)}, "a volume has one"),
        ({"object": "volume", "terms": (4,)}, "volume explains 1 to 4 itself"),
        ({"object": "volume", "depths": ()}, "no depths"),
        ({"object": "volume", "raw": RAW * np.nan}, "NaN"),
    ],
)
def test_what_cannot_be_estimated_is_refused(given, message):
    with pytest.raises(lg.LumigraphError, match=message):
        estimate(**{"raw": RAW, "microscope": SCOPE, "depths": DEPTHS, "terms": (6,), **given})


def test_the_beads_of_a_volume_are_its_highest_samples_with_what_is_around_them():
    z, y, x = (np.arange(n) * 1e-6 for n in (9, 20, 30))
    true = np.array([[5.3e-6, 7.8e-6, 4.0e-6], [14.0e-6, 22.4e-6, 5.0e-6]])
    volume = np.zeros((9, 20, 30))
    for light, (a, b, c) in zip((2.0, 1.0), true, strict=True):
        away = (z[:, None, None] - c) ** 2 + (y[:, None] - a) ** 2 + (x - b) ** 2
        spot = np.exp(-away / (2 * 1e-12))
        volume += light * spot / spot.sum()
    found = brightest(volume, (z, y, x), (5e-6, 5e-6), 0.05)
    np.testing.assert_allclose(found.positions, true, atol=0.1e-6)
    np.testing.assert_allclose(found.intensities, [2, 1], rtol=0.01)


def test_between_nodes_coefficients_are_linear_and_beyond_them_constant():
    nodes = FieldNodes(np.array([-1.0, 1.0]), np.array([0.0, 2.0]), 1)
    values = np.array([0.0, 2.0, 10.0, 12.0])  # 5 (y + 1) + x
    points = lg.Points(np.array([[0.0, 1.0, 3.0], [0.5, 0.5, 0.0], [9.0, -9.0, 0.0]]), np.ones(3))
    np.testing.assert_allclose(nodes.at(points) @ values, [6.0, 8.0, 10.0])


def test_the_prior_of_a_field_that_is_even_is_that_of_one_wavefront():
    nodes = FieldNodes(np.arange(3.0), np.arange(2.0), 2)
    even = np.tile([0.5, -1.0], 6)
    assert even @ nodes.information @ even == pytest.approx(1.25 / PRIOR**2)
    step = np.kron(np.repeat([0.0, 1.0, 1.0], 2), [1.0, 0.0])
    assert step @ nodes.information @ step == pytest.approx(2 / ALIKE**2 + 4 / 6 / PRIOR**2)


def test_a_term_that_another_one_explains_goes_and_the_other_stays():
    # Each is 2.5 deviations from 0, and their sum 11: one of them is enough.
    covariance = np.array([[1.0, -0.9], [-0.9, 1.0]])
    prior = np.eye(2) / PRIOR**2
    assert worth(covariance, np.array([[2.5, 2.4]]), 1e4, prior).sum() == 1
    assert worth(np.eye(2), np.array([[3.6, 2.9]]), 1e4, prior).tolist() == [True, False]


@pytest.mark.parametrize(
    ("known", "least"), [(0.1, 10.56), (0.01, 28.21), (10.0, 9.21)], ids=["well", "better", "hardly"]
)
def test_a_term_costs_what_it_leaves_of_the_priors_width_and_ln_n(known, least):
    """Four regions: Schwarz's criterion alone would ask for 4 ln N, which is 37."""
    nodes = FieldNodes(np.arange(2.0), np.arange(2.0), 2)
    covariance = np.linalg.inv(nodes.information + np.eye(8) / known**2)
    own = np.linalg.cholesky(covariance[::2, ::2]) @ np.full(4, 0.5)  # a gain of 1
    for gain in (0.98 * least, 1.02 * least):
        x = np.column_stack([np.sqrt(gain) * own, 99 * own])
        assert worth(covariance, x, 1e4, nodes.information).tolist() == [gain > least, True]


@pytest.mark.parametrize("apart", [0.02, 0.1])
def test_how_alike_neighbours_are_is_learnt_from_the_fit(apart, rng):
    nodes = FieldNodes(np.arange(5.0), np.arange(6.0), 8)
    root = np.linalg.cholesky(np.linalg.inv(replace(nodes, alike=apart).information))
    seen = np.eye(240) / 0.05**2
    whole = seen + nodes.information
    found = []
    for _ in range(12):
        true = root @ rng.normal(size=240)
        fitted = np.linalg.solve(whole, seen @ (true + rng.normal(scale=0.05, size=240)))
        learnt = nodes.learnt(fitted.reshape(30, 8), np.linalg.inv(whole))
        better = np.linalg.solve(seen + learnt.information, whole @ fitted)
        assert np.std(better - true) < np.std(fitted - true)
        found.append(learnt.alike)
    assert np.mean(found) == pytest.approx(apart, abs=7e-3)  # 3 deviations of a mean: one is off by 0.008


def test_neighbours_that_differ_much_keep_the_first_expectation():
    nodes = FieldNodes(np.arange(3.0), np.arange(3.0), 4)
    values = np.random.default_rng(1).normal(size=(9, 4))
    covariance = np.linalg.inv(np.eye(36) / 0.01**2 + nodes.information)
    assert nodes.learnt(values, covariance).alike == ALIKE
