"""The microscope's operator through the lenslets' frequencies: against products over all offsets."""

import dataclasses

import numpy as np
import pytest

from lumigraph.elements.objective import Objective
from lumigraph.operators import microscope_spectrum as module
from lumigraph.operators.microscope_cell import CellSampling, Lenslet
from lumigraph.operators.microscope_operator import Layout, _suits_frequencies, microscope_operator

SCOPE = Objective(525e-9, 0.5)
LENSLET = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6)
DEPTHS = (-25e-6, 0.0, 15e-6)


def operators(sampling, cells):
    """By offsets and by frequency."""
    one = microscope_operator([SCOPE], LENSLET, Layout(cells, sampling), DEPTHS, accuracy=2e-2)
    return (dataclasses.replace(one, by_frequency=way, _spectra={}) for way in (False, True))


@pytest.fixture(scope="module", params=[(3, 8, (6, 7)), (4, 5, (7, 9)), (1, 4, (5, 3))])
def pair(request):
    s, N, cells = request.param
    return tuple(operators(CellSampling(s, N, 1 / N), cells))


def test_both_ways_give_the_same_image(pair, xp, rng):
    volume = xp.asarray(rng.random(pair[0].shape[1]))
    expected, found = (np.asarray(one.forward(volume)) for one in pair)
    # 1e-6: the matrices are in single precision. A wrong sign of one part or a frequency is beyond 1e-3.
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-6 * expected.max())


def test_both_ways_give_the_same_adjoint_and_it_is_the_transpose(pair, xp, rng):
    volume, raw = xp.asarray(rng.random(pair[0].shape[1])), xp.asarray(rng.random(pair[0].shape[0]))
    expected, found = (np.asarray(one.adjoint(raw)) for one in pair)
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-6 * expected.max())
    left = float(xp.sum(pair[1].forward(volume) * raw))
    assert left == pytest.approx(float(xp.sum(volume * pair[1].adjoint(raw))), rel=1e-10)


def test_tiles_of_lenslets_give_the_same(monkeypatch, rng):
    by_offsets, by_frequency = operators(CellSampling(2, 4, 1 / 4), (8, 11))
    monkeypatch.setattr(module, "TILE", 5)
    tiling = module.tiling(by_frequency.kernels, (8, 11))
    assert tiling.counts == (2, 3)
    assert tiling.reach > 2  # tiles light each other
    volume, raw = rng.random(by_offsets.shape[1]), rng.random(by_offsets.shape[0])
    assert by_frequency.forward(volume) == pytest.approx(by_offsets.forward(volume), rel=1e-5, abs=1e-5)
    assert by_frequency.adjoint(raw) == pytest.approx(by_offsets.adjoint(raw), rel=1e-5, abs=1e-5)


def test_single_precision_stays_and_a_points_image_has_no_rounding(pair, xp, rng):
    volume = rng.random(pair[0].shape[1])
    single = pair[1].forward(xp.asarray(volume.astype(np.float32)))
    assert single.dtype == xp.float32
    np.testing.assert_allclose(np.asarray(single), pair[0].forward(volume), rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(pair[1].psf((0, 2, 1)), pair[0].psf((0, 2, 1)))
    assert pair[1].psf((0, 2, 1)).min() >= 0


def test_the_way_is_chosen_by_time_memory_and_symmetry(monkeypatch):
    sampling, cells = CellSampling(3, 8, 1 / 8), (15, 15)
    deep = microscope_operator([SCOPE], LENSLET, Layout(cells, sampling), (-30e-6, 30e-6), accuracy=2e-2)
    assert deep.by_frequency
    assert deep.multiply_adds < dataclasses.replace(deep, by_frequency=False).multiply_adds / 5
    flat = microscope_operator([SCOPE], LENSLET, Layout((3, 3), sampling), (0.0,), accuracy=2e-2)
    assert not flat.by_frequency
    coma = Objective(525e-9, 0.5, aberrations={8: 0.05})
    assert not microscope_operator(
        [coma], LENSLET, Layout((9, 9), sampling), (10e-6,), accuracy=2e-2
    ).by_frequency
    assert _suits_frequencies(deep.kernels, cells)
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: 14 * 10**5)
    assert not _suits_frequencies(deep.kernels, cells)
