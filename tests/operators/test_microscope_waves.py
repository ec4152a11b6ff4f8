"""Points behind square lenslets by products of matrices, against Fourier transforms of the whole field."""

import tracemalloc

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core import memory
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope import bench, samples
from lumigraph.operators.microscope.bench import LensletBench, spline_response
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.kernels import KernelAccuracy, margin_of
from lumigraph.operators.microscope.waves import SeparableLenslets

LENSLET = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6)
PIXELS, SPLINES = CellSampling(3, 15, 1 / 15), CellSampling(3, 14, 1 / 15, 3)
FINE = 4.5
"""Margin: what neither way follows is below 1e-4."""


def images(way, sampling, points, dz, objective=None, **options):
    objective = objective or Objective(525e-9, 0.5)
    return list(way(objective, LENSLET, sampling, 2, FINE, **options).images(dz, points))


def off(found, truth):
    return np.linalg.norm(found - truth) / np.linalg.norm(truth)


@pytest.mark.parametrize(
    ("objective", "dz", "sampling"),
    [
        (Objective(525e-9, 0.5), -12e-6, PIXELS),
        (Objective(525e-9, 0.5), 5e-6, SPLINES),
        (Objective(525e-9, 0.5, model="vector", axial_share=0.6), 6e-6, PIXELS),  # odd modes, too
        pytest.param(  # not even
            Objective(525e-9, 0.5, aberrations={7: 0.2, 6: 0.1}), 6e-6, PIXELS, marks=pytest.mark.long
        ),
    ],
)
def test_products_and_transforms_give_the_same_images(objective, dz, sampling):
    points = [(0, 1), (1.3, 0.4)]  # also between samples
    found = images(SeparableLenslets, sampling, points, dz, objective)
    truth = images(LensletBench, sampling, points, dz, objective)
    for (image, lost), (right, missed) in zip(found, truth, strict=True):
        assert off(image, right) < 4e-4
        assert lost == pytest.approx(missed, abs=2e-4)


def of_corner(way, asked, pixels, dz, **options):
    objective, sampling = Objective(525e-9, 0.5), CellSampling(3, pixels, 1 / pixels)
    margin = margin_of(objective, LENSLET, dz, KernelAccuracy(asked, 2))
    return next(way(objective, LENSLET, sampling, 2, margin, **options).images(dz, [(0, 0)]))[0]


@pytest.mark.parametrize(("accuracy", "pixels"), [(1e-2, 15), (1e-2, 11), (1e-3, 9), (1e-3, 15), (1e-4, 15)])
@pytest.mark.parametrize("dz", [-12e-6, -30e-6])
def test_the_mean_over_a_pixel_has_enough_nodes(accuracy, pixels, dz, monkeypatch):
    """With as many as half the samples in a pixel, and one, off by up to 4.2 times the accuracy."""
    monkeypatch.setattr(bench, "GRID", np.inf)  # of the same light
    asked = accuracy, pixels, dz
    found, truth = (of_corner(SeparableLenslets, *asked, accuracy=one) for one in (accuracy, accuracy * 1e-6))
    assert off(found, truth) < 0.7 * accuracy


@pytest.mark.parametrize(("accuracy", "pixels"), [(1e-2, 11), (1e-3, 9)])
def test_the_mean_over_a_pixel_is_that_of_transforms(accuracy, pixels):
    """Off by 0.72 and 0.82 times the accuracy with half the samples in a pixel, and one."""
    asked = accuracy, pixels, -12e-6
    found = of_corner(SeparableLenslets, *asked, accuracy=accuracy)
    assert off(found, of_corner(LensletBench, *asked)) < 0.3 * accuracy


SPARSE = CellSampling(3, 53, 0.064, 3)
"""Splines almost as close as samples of the light: what these alias is seen."""


ROUND = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6, is_round=True)


def middle_of(sampling, dz, margin, lenslet=LENSLET, accuracy=1e-3):
    way = LensletBench if lenslet.is_round else SeparableLenslets
    reach = 6 if lenslet.is_round else 3  # as at 1e-3
    bench = way(Objective(525e-9, 0.5), lenslet, sampling, reach, margin, accuracy=accuracy)
    before = bench.fine
    ((image, stated),) = bench.images(dz, [(0, 1)])
    return image, stated, bench.fine / before


def test_the_grid_of_the_light_is_made_finer_where_it_misses_too_much():
    """At 20 um, 1e-3 asked, splines were off by 1.6e-3 without a word."""
    image, stated, finer = middle_of(SPARSE, 20e-6, 3.4)
    assert finer == pytest.approx(1.4, rel=0.1)
    truth, *_ = middle_of(SPARSE, 20e-6, 8.0)
    assert off(image, truth) < 1e-4
    assert stated < 1e-3


@pytest.mark.long  # margins of eight
def test_the_grid_of_round_lenslets_is_made_finer_where_it_misses_too_much():
    """They were off by up to twice what was asked for, without a word."""
    image, stated, finer = middle_of(PIXELS, -9e-6, 3.4, ROUND, 3e-4)
    assert finer > 1.3
    truth, *_ = middle_of(PIXELS, -9e-6, 8.0, ROUND, 1.0)
    assert stated < 1.5e-4
    assert off(image, truth) < 1.5 * stated


@pytest.mark.parametrize(
    ("pixels", "dz", "lenslet"),
    [
        (15, 20e-6, LENSLET),
        (9, 20e-6, LENSLET),
        (15, -9e-6, LENSLET),
        pytest.param(15, -20e-6, ROUND, marks=pytest.mark.long),
    ],
)
def test_what_the_grid_of_the_light_misses_is_stated(pixels, dz, lenslet):
    """Nothing else is left out, and samples are pixels: it is all that they are off by."""
    sampling = CellSampling(3, pixels, 1 / pixels)
    image, stated, finer = middle_of(sampling, dz, 3.4, lenslet)
    assert finer == 1
    truth, *_ = middle_of(sampling, dz, 10.0, lenslet)
    assert stated == pytest.approx(off(image, truth), rel=0.35)


@pytest.mark.parametrize("lenslet", [LENSLET, pytest.param(ROUND, marks=pytest.mark.long)])
def test_a_finer_grid_that_cannot_fit_is_refused(lenslet, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 1e6)
    sampling, accuracy = (PIXELS, 1e-4) if lenslet.is_round else (SPARSE, 1e-3)
    with pytest.raises(lg.errors.SamplingError, match=r"at 20 µm, on \d+ samples along a lenslet, needs"):
        middle_of(sampling, 20e-6, 3.4, lenslet, accuracy)


def test_samples_that_hold_no_more_of_the_light_are_not_looked_for(monkeypatch):
    """Points in focus at 60x/1.2 had no end: the grid itself is coarser than 1e-5 asks for."""
    monkeypatch.setattr(samples, "MOST", 0.5)
    assert 30 < samples.samples_needed(Objective(525e-9, 0.5), LENSLET, 1 / 15, (0.0,), 1e-7) < 100


def test_a_low_rank_leaves_out_what_it_says():
    points = [(ky, kx) for ky in range(3) for kx in range(3)]
    whole, few = (images(SeparableLenslets, PIXELS, points, -20e-6, left_out=part) for part in (0.0, 0.02))
    said = {lost for _, lost in few}
    assert len(said) == 1
    assert 0.01 < said.pop() < 0.02
    worst = max(off(image, right) for (image, _), (right, _) in zip(few, whole, strict=True))
    assert 1e-4 < worst < 0.01


@pytest.mark.parametrize("sampling", [CellSampling(9, 15, 1 / 15), CellSampling(9, 14, 1 / 15, 3)])
def test_memory_is_bounded(sampling):
    bench = SeparableLenslets(Objective(525e-9, 0.5), LENSLET, sampling, 4, 2.4, 1e-3)
    points = [(ky, kx) for ky in range(9) for kx in range(9)]
    list(bench.images(-25e-6, points[:1]))  # radial tables are kept
    tracemalloc.start()
    for _ in bench.images(-25e-6, points):
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.25 < peak / bench.held_bytes(9) < 1


def test_splines_hold_little_of_light_far_finer_than_their_samples():
    """Whole periods in a sample included: those beyond the sixth gave 1e65."""
    own, held = spline_response(np.array([2.0, 7.0, 8.0, 7.3, 20.5]), 3)
    assert np.abs(own).max() < 1e-4
    assert held.max() < 1e-6
