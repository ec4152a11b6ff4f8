"""The sweep of a star of views: which arms count, how narrow its windows are, and what stays uncertain."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import texture, views_of

import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import silent
from lumigraph.depth.lines import few
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import Shading
from lumigraph.depth.sweep import behind, costs, swept

LABELS = np.arange(-2, 6.1, 0.4, dtype=np.float32)


@pytest.fixture(scope="module")
def plane():
    """Views of a plane of 0.5 px per view, 1.5 px in the outermost one."""
    paint = texture(np.random.default_rng(1))
    views, truth = views_of([(paint, lambda y, x: 0.5 + 0 * y + 0 * x, None)])
    return views, (3 * truth).astype(np.float32)


@pytest.fixture(scope="module")
def leaves():
    """Views of leaves of 4 px across, 9 px apart, before a wall 1.2 px per view behind them; disparities."""
    rng = np.random.default_rng(3)
    near, far = texture(rng), texture(rng)
    leaf = (near, lambda y, x: 1.0 + 0 * y + 0 * x, lambda y, x: np.abs((x + 0.3 * y) % 9 - 4.5) < 2)
    return views_of([leaf, (far, lambda y, x: -0.2 + 0 * y + 0 * x, None)])


def _without_diagonals(views):
    data = np.zeros_like(views.data)
    data[3], data[:, 3] = views.data[3], views.data[:, 3]
    return LightField(data, views.aperture, views.lenslets, views.separation)


def test_leaves_are_as_wide_as_they_are_and_the_wall_between_them_is_seen(leaves):
    """Windows of 7 px, as wide as leaf and gap, are off at a quarter of the places."""
    views, truth = leaves
    found = lg.depth.epi(views)
    inner = (slice(8, -8), slice(8, -8))
    off = np.abs(found.values - truth)[inner]
    assert (off > 0.3).mean() < 0.1
    near = (found.values > 0.4)[inner].mean()
    assert near == pytest.approx((truth > 0.4)[inner].mean(), rel=0.08)


@pytest.mark.parametrize(("whole", "cut_off"), [(True, 4), (False, 1)])
def test_arms_that_do_not_see_a_place_do_not_count(plane, whole, cut_off):
    """Of a star half of the arms may be in the way, of a cross one of each line."""
    views, moves = plane
    views = views if whole else _without_diagonals(views)
    pictures, none = Pictures.of(views), Shading.none(moves.shape)
    data = pictures.data.copy()
    hidden = [(slice(0, 3), 3), (3, slice(0, 3)), (range(3), range(3)), (range(3), range(6, 3, -1))][:cut_off]
    for arm in hidden:
        data[arm] = 0
    at = np.float32([1.5])
    off = costs(replace(pictures, data=data), at, 0.1, silent, none)[0, 8:-8, 8:-8]
    assert np.median(off) < 0.02  # what linear interpolation leaves
    data[3, 4:] = data[4:, 3] = data[range(4, 7), range(4, 7)] = data[range(2, -1, -1), range(4, 7)] = 0
    off = costs(replace(pictures, data=data), at, 0.1, silent, none)[0, 8:-8, 8:-8]
    assert np.median(off) > 0.05


def test_what_has_been_moved_by_its_disparity_costs_nothing(plane):
    views, moves = plane
    pictures = Pictures.of(views)
    cost = costs(pictures, LABELS, 0.1, silent, Shading.none(moves.shape))
    assert LABELS[np.median(cost[:, 8:-8, 8:-8], (1, 2)).argmin()] == pytest.approx(1.5, abs=0.21)


def test_a_row_of_views_is_swept(plane):
    views, moves = plane
    row = Pictures.of(LightField(views.data[3:4], Grid((1, 7), 1.0), views.lenslets, views.separation))
    found = swept(row, LABELS, Shading.none(moves.shape), silent).moves
    assert np.median(np.abs(found - moves)[6:-6, 6:-6]) < 0.1


def test_a_plain_gap_may_belong_to_what_is_behind(plane):
    """Where costs do not tell the farther movement from the map's own, most of the way to it is at stake."""
    found = np.full((20, 30), 2.0, np.float32)
    found[:, :4] = -2
    alike = np.zeros((len(LABELS), 20, 30), np.float32)
    stake = behind(alike, LABELS, found, 0.01)
    assert stake[10, 8] == pytest.approx(0.8 * 4)
    assert not stake[10, :4].any()  # nothing farther
    assert not stake[10, 13:].any()  # nor near
    clear = alike + np.abs(LABELS - 2)[:, None, None]
    assert behind(clear, LABELS, found, 0.01)[10, 8] < 1e-6


@pytest.mark.parametrize(
    ("down", "right", "noise"), [(0.3, 0.8, 0.01), (2.5, 1.0, 0.005), (0.15, 0.05, 0.002)]
)
def test_slanted_ground_shows_no_contours(down, right, noise):
    """Disparities pass many labels of the sweep; a seam 0.2 px off at each would be 2 % of the places."""
    rng = np.random.default_rng(2)
    ground = (texture(rng), lambda y, x: 0.3 + down * y / 96 + right * x / 96, None)
    views, truth = views_of([ground], (96, 96), (5, 5))
    data = views.data + noise * views.data.max() * rng.standard_normal(views.data.shape)
    found = lg.depth.epi(LightField(data, views.aperture, views.lenslets, views.separation))
    inner = (slice(6, -6), slice(6, -6))  # half of the views do not see the border
    sure = np.asarray(found.confidence)[inner] > 0.8
    assert sure.mean() > 0.9
    assert (np.abs(found.values - truth)[inner][sure] < 0.03).mean() > 0.99


def test_maps_are_first_refined_on_every_second_view_of_the_star(plane):
    some = few(Pictures.of(plane[0])).lit
    star = {(v, u) for v in (0, 2, 3, 4, 6) for u in (0, 2, 3, 4, 6)}
    star = {(v, u) for v, u in star if v == 3 or u == 3 or abs(v - 3) == abs(u - 3)}
    assert set(map(tuple, np.argwhere(some))) == star
    row = LightField(plane[0].data[3:4], Grid((1, 7), 1.0), plane[0].lenslets, 20.0)
    assert few(Pictures.of(row)).lit.tolist() == [[True, False, True, True, True, False, True]]
