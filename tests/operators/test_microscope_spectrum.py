"""The microscope's operator through the lenslets' frequencies: against products over all offsets."""

import dataclasses

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.banded import banded
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope import spectrum as module
from lumigraph.operators.microscope.building import SampledLenslets, microscope_operator
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.patterns import all_patterns, few_of_pixels
from lumigraph.operators.microscope.pixels import b_spline
from lumigraph.operators.microscope.sensor import CellSamples, SeparablePixels, sensor
from lumigraph.operators.microscope.tiles import TileRow, Tiling
from lumigraph.operators.microscope.transforms import add_cells, columns
from lumigraph.operators.microscope.volume_operator import suits_frequencies
from lumigraph.operators.sampling.resampling import Resampling

SCOPE = Objective(525e-9, 0.5)
LENSLET = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6)
DEPTHS = (-25e-6, 0.0, 15e-6)


def operators(sampling, cells):
    """By offsets and by frequency."""
    one = microscope_operator([SCOPE], LENSLET, SampledLenslets(cells, sampling), DEPTHS, accuracy=2e-2)
    return (dataclasses.replace(one, by_frequency=way, left_out=0.0, _spectra={}) for way in (False, True))


@pytest.fixture(scope="module", params=[(3, 8, (6, 7)), (4, 5, (7, 9)), (1, 4, (5, 3))])
def pair(request):
    s, N, cells = request.param
    return tuple(operators(CellSampling(s, N, 1 / N), cells))


def test_both_ways_give_the_same_image(pair, xp, rng):
    volume = xp.asarray(rng.random(pair[0].shape[1]))
    expected, found = (to_numpy(one.forward(volume)) for one in pair)
    # 1e-6: the matrices are in single precision. A wrong sign of one part or a frequency is beyond 1e-3.
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-6 * expected.max())


def test_both_ways_give_the_same_adjoint_and_it_is_the_transpose(pair, xp, rng):
    volume, raw = xp.asarray(rng.random(pair[0].shape[1])), xp.asarray(rng.random(pair[0].shape[0]))
    expected, found = (to_numpy(one.adjoint(raw)) for one in pair)
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-6 * expected.max())
    left = float(xp.sum(pair[1].forward(volume) * raw))
    assert left == pytest.approx(float(xp.sum(volume * pair[1].adjoint(raw))), rel=1e-10)


def test_tiles_of_lenslets_give_the_same(monkeypatch, rng):
    by_offsets, by_frequency = operators(CellSampling(2, 4, 1 / 4), (8, 11))
    monkeypatch.setattr(module, "LEAST", 4)
    monkeypatch.setattr(module, "MOST", 1)
    tiling = by_frequency._tiling
    assert tiling.count > 2
    assert tiling.rows.reach > 2  # tiles light each other
    check_equal(by_offsets, by_frequency, rng)


@pytest.mark.parametrize("margin", [-1, 1, 4])
@pytest.mark.parametrize("least", [3, 8])
def test_objects_larger_and_smaller_than_the_picture(margin, least, monkeypatch, rng):
    monkeypatch.setattr(module, "LEAST", least)
    monkeypatch.setattr(module, "MOST", 1)
    by_offsets, by_frequency = (
        dataclasses.replace(one, margin=margin) for one in operators(CellSampling(2, 4, 1 / 4), (8, 11))
    )
    check_equal(by_offsets, by_frequency, rng)


def check_equal(by_offsets, by_frequency, rng):
    volume, raw = rng.random(by_offsets.shape[1]), rng.random(by_offsets.shape[0])
    assert by_frequency.forward(volume) == pytest.approx(by_offsets.forward(volume), rel=1e-5, abs=1e-5)
    assert by_frequency.adjoint(raw) == pytest.approx(by_offsets.adjoint(raw), rel=1e-5, abs=1e-5)


def test_a_widened_operator_sees_of_the_inside_what_its_own_does(rng):
    """An object that is dark beyond the picture gives the same raw image, by either way."""
    for one in operators(CellSampling(2, 4, 1 / 4), (6, 7)):
        wide, (rows, columns) = one.widened(1e-6)
        inside = rng.random(one.shape[1])
        whole = np.zeros(wide.shape[1])
        whole[:, rows, columns] = inside
        np.testing.assert_allclose(wide.forward(whole), one.forward(inside), rtol=2e-6, atol=2e-6)
        whole[:, 0, 0] = 1  # farther than a margin less by one lenslet would hold
        assert wide.forward(whole).sum() > one.forward(inside).sum()


def test_what_hardly_sends_light_onto_the_picture_is_not_followed(rng):
    """The samples that are left out have less than a tenth of the most light: deconvolution skips them."""
    one = next(operators(CellSampling(2, 4, 1 / 4), (9, 9)))
    all_of_it, less = (one.widened(least)[0] for least in (1e-6, 0.05))
    cut = all_of_it.margin - less.margin
    assert 0 < less.margin < all_of_it.margin
    even, kept = np.ones(one.shape[0]), (slice(None), *2 * [slice(2 * cut, -2 * cut)])
    seen, most = all_of_it.adjoint(even), one.adjoint(even).max()
    np.testing.assert_allclose(less.adjoint(even), seen[kept], rtol=1e-6)
    seen[kept] = 0
    assert 0.005 * most < seen.max() < 0.1 * most


def test_single_precision_stays_and_a_points_image_has_no_rounding(pair, xp, rng):
    volume = rng.random(pair[0].shape[1])
    single = pair[1].forward(xp.asarray(volume.astype(np.float32)))
    assert single.dtype == xp.float32
    np.testing.assert_allclose(to_numpy(single), pair[0].forward(volume), rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(pair[1].psf((0, 2, 1)), pair[0].psf((0, 2, 1)))
    assert pair[1].psf((0, 2, 1)).min() >= 0


def test_the_way_is_chosen_by_time_memory_and_symmetry(monkeypatch):
    sampling, cells = CellSampling(3, 8, 1 / 8), (15, 15)
    deep = microscope_operator(
        [SCOPE], LENSLET, SampledLenslets(cells, sampling), (-30e-6, 30e-6), accuracy=2e-2
    )
    assert deep.by_frequency
    assert deep.multiply_adds < dataclasses.replace(deep, by_frequency=False).multiply_adds / 5
    flat = microscope_operator([SCOPE], LENSLET, SampledLenslets((3, 3), sampling), (0.0,), accuracy=2e-2)
    assert not flat.by_frequency
    coma = Objective(525e-9, 0.5, aberrations={8: 0.05})
    assert not microscope_operator(
        [coma], LENSLET, SampledLenslets((9, 9), sampling), (10e-6,), accuracy=2e-2
    ).by_frequency
    assert suits_frequencies(deep.kernels, cells, 0)
    monkeypatch.setattr("lumigraph.operators.microscope.spectrum.MOST", 4 * 10**5)
    assert not suits_frequencies(deep.kernels, cells, 0)


def test_no_bit_of_an_image_depends_on_the_memory_that_is_free(monkeypatch, rng):
    layout = SampledLenslets((15, 15), CellSampling(3, 8, 1 / 8))
    volume, images = rng.random((2, 45, 45)).astype(np.float32), []
    for free in (2**40, 14 * 10**5, None):  # the kernels fit, the matrices do not
        monkeypatch.setattr("lumigraph.core.memory.available", lambda free=free: free)
        monkeypatch.setattr("lumigraph.core.memory.require", lambda *_: None)
        operator = microscope_operator([SCOPE], LENSLET, layout, (-30e-6, 30e-6), accuracy=2e-2)
        images.append(operator.forward(volume).tobytes())
    assert len(set(images)) == 1


def test_large_matrices_are_no_reason_for_products_that_take_more(monkeypatch):
    layout = SampledLenslets((15, 15), CellSampling(9, 8, 1 / 8))
    deep = microscope_operator([SCOPE], LENSLET, layout, (-50e-6, 0.0, 40e-6), accuracy=2e-2)
    monkeypatch.setattr("lumigraph.operators.microscope.spectrum.MOST", 4 * 10**5)
    assert suits_frequencies(deep.kernels, (15, 15), 0, deep.left_out)
    assert deep.memory_bytes < dataclasses.replace(deep, by_frequency=False, _spectra={}).memory_bytes


@pytest.mark.parametrize("depths", [DEPTHS, None])
def test_objects_side_by_side_give_what_each_gives_and_no_bit_depends_on_the_others(depths, xp, rng):
    layout = SampledLenslets((6, 7), CellSampling(3, 8, 1 / 8))
    one = microscope_operator([SCOPE], LENSLET, layout, depths, accuracy=2e-2)
    one = dataclasses.replace(one, by_frequency=True, _spectra={})
    assert one.side_by_side == 4
    for shape, alone, together in (
        (one.shape[1], one._forward, one._forwards), (one.shape[0], one._adjoint, one._adjoints)
    ):  # fmt: skip
        given = [xp.asarray(rng.random(shape, np.float32)) for _ in range(4)]
        expected, found = (
            [to_numpy(image) for image in some] for some in (map(alone, given), together(given))
        )
        np.testing.assert_array_equal(found, expected)
        (lonely,) = together(given[2:3])
        np.testing.assert_array_equal(to_numpy(lonely), found[2])


@pytest.mark.parametrize("few", [False, True])
def test_pixels_of_a_straight_lattice_see_patterns_as_samples_between_say(few, xp, rng):
    """One matrix for each cell and axis, against B-splines among samples."""
    n, at = 9, [np.linspace(-3.0, 31.5, 25), np.linspace(4.0, 37.0, 31)]  # beyond the samples, and not of all
    along = [banded(y, np.arange(27 + 9 * k), lambda d: b_spline(d, 3), 2.0, 4) for k, y in enumerate(at)]
    placement, patterns = Resampling(*along), all_patterns(n)
    if few:
        kernel = microscope_operator(
            [SCOPE], LENSLET, SampledLenslets((3, 4), CellSampling(2, n, 1 / n)), (-30e-6,)
        )
        patterns = few_of_pixels(kernel.kernels, 0.1)
        assert patterns.vectors is not None
    raw, parts = rng.random((25, 31)), rng.random((3, 4, patterns.count))
    found = sensor(patterns, placement, xp.asarray(raw))
    assert isinstance(found, SeparablePixels)
    expected = CellSamples(patterns, placement)
    np.testing.assert_allclose(to_numpy(found.parted(xp.asarray(raw))), expected.parted(raw), atol=1e-12)
    np.testing.assert_allclose(to_numpy(found.whole(xp.asarray(parts))), expected.whole(parts), atol=1e-12)


@pytest.mark.parametrize("of_image", [False, True])
def test_sums_are_the_transform_of_cells_turned_and_lead_back_to_them(of_image, rng):
    """By a fast transform: (-i)^odd times it, of an image its inverse, as real and imaginary parts."""
    told, odd = Tiling(TileRow(4, 0, 2, 1), TileRow(5, 0, 2, 1)), np.array([[0, 0, 1, 1], [0, 1, 0, 1]])
    cells, (ly, lx) = rng.random((4, 5, 4)), told.lengths
    found = columns([cells, 2 * cells], 2, told, odd, of_image=of_image)
    turned = np.fft.rfft2(cells, (ly, lx), axes=(0, 1)) * (1j if of_image else -1j) ** odd.sum(0)
    above, below = turned[: ly // 2 + 1], turned[-np.arange(ly // 2 + 1) % ly] * (-1.0) ** odd[0]
    cc, cs, sc, ss = np.moveaxis(found.reshape(ly // 2 + 1, lx // 2 + 1, 2, 4, 4)[:, :, 0], 2, 0)
    np.testing.assert_allclose(cc - ss - 1j * (cs + sc), above, atol=1e-12)
    np.testing.assert_allclose(cc + ss - 1j * (cs - sc), below, atol=1e-12)
    again = np.zeros((2, *cells.shape))
    add_cells(list(again), found, told, odd, of_image=of_image)
    np.testing.assert_allclose(again, [cells, 2 * cells], atol=1e-12)
