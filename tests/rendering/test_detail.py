"""Samples per lenslet that pictures of views have where nobody says how many."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.depth import drawn
from lumigraph.rendering import detail, finer


def views(n: int, directions: int = 5) -> lg.LightField:
    data = np.random.default_rng(3).random((directions, directions, n, n + 5))
    return lg.LightField(data, lg.Grid.square(directions, 1.0), lg.Grid((n, n + 5), (1.0, 1.0)), 10.0)


def test_small_views_make_pictures_of_200_pixels():
    small = views(20)
    assert detail(small) == 8
    assert lg.refocus(small, 1.02).shape == (19 * 8 + 1, 24 * 8 + 1)
    np.testing.assert_array_equal(lg.refocus(small, 1.02), lg.refocus(small, 1.02, oversample=8))
    assert lg.refocus_stack(small, [0.98, 1.02]).shape == (2, 153, 193)


def test_one_sample_per_lenslet_on_request_and_where_views_are_large():
    assert lg.refocus(views(20), 1.02, oversample=1).shape == (20, 25)
    assert lg.refocus(views(210, 2), 1.02).shape == (210, 215)


def test_a_picture_sharp_everywhere_is_as_fine_and_of_one_depth_a_refocused_one():
    small = views(20)
    made = lg.all_in_focus(small, depth=np.full((20, 25), 1.02))
    assert made.alpha.shape == (20, 25)
    np.testing.assert_allclose(made.picture, lg.refocus(small, 1.02), atol=1e-12)


def test_between_two_depths_the_finer_picture_blends_planes_a_quarter_of_a_lenslet_apart():
    small = views(20)
    depth = np.broadcast_to(np.linspace(0.9, 1.1, 25), (20, 25))
    fine = lg.all_in_focus(small, depth=depth, oversample=4).picture
    column = 12  # a lenslet: its factor is exactly 1
    np.testing.assert_allclose(
        fine[:, 4 * column], lg.refocus(small, 1.0, oversample=4)[:, 4 * column], atol=1e-9
    )


def test_a_map_between_lenslets_is_linear_and_unknown_places_stay_unknown():
    values = np.add.outer(10.0 * np.arange(3), np.arange(4.0))
    fine = finer(values, 4)
    np.testing.assert_allclose(fine, np.add.outer(2.5 * np.arange(9), 0.25 * np.arange(13)), atol=1e-12)
    values[1, 1] = np.nan
    holed = finer(values, 4)
    assert np.isnan(holed[4, 4])
    np.testing.assert_array_equal(np.isnan(holed).sum(), 16)  # nearest to that lenslet
    assert finer(values, 1).shape == (3, 4)


def test_a_drawn_map_is_as_fine_as_a_refocused_picture():
    small = views(20)
    found = lg.DepthMap(np.ones((20, 25)) * np.arange(25), np.ones((20, 25)), "disparity")
    assert drawn(found, small).shape == lg.refocus(small, 1.0).shape
    assert drawn(found).shape == (20, 25)
    assert drawn(found)[0, 0] == 0
    assert drawn(found)[0, -1] == 1


@pytest.mark.parametrize("wrong", [0, -2, 1.5])
def test_samples_that_are_no_whole_number_above_zero_are_refused(wrong):
    with pytest.raises(lg.GeometryError, match="oversample"):
        lg.refocus(views(20), 1.0, oversample=wrong)
