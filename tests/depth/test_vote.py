"""Which of two sweeps a place takes."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import texture, views_of

from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import silent
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.shading import Shading
from lumigraph.depth.sweep import outermost, swept
from lumigraph.depth.vote import agreed


@pytest.fixture
def plane():
    """Views of a plane of 0.5 px per view, 1.5 px in the outermost one."""
    paint = texture(np.random.default_rng(1))
    views, truth = views_of([(paint, lambda y, x: 0.5 + 0 * y + 0 * x, None)])
    return views, (3 * truth).astype(np.float32)


def test_each_place_takes_the_map_that_its_views_agree_with(plane):
    views, moves = plane
    pictures, half = Pictures.of(views), moves.shape[1] // 2
    left, right = moves.copy(), moves.copy()
    left[:, :half] += 1.2  # wrong in its left half, the other one in its right half
    right[:, half:] -= 1.2
    found = agreed(pictures, (left, right), Shading.none(moves.shape))
    assert np.array_equal(found[:, : half - 10], right[:, : half - 10])  # the window is 10 px wide
    assert np.array_equal(found[:, half + 10 :], left[:, half + 10 :])


def test_shading_is_no_disagreement(plane):
    """On a ramp of 0.01 a place, 0.01 brighter in the outermost view is 1 px to the left, or shading."""
    pictures = Pictures.of(plane[0])
    middle = np.broadcast_to(0.01 * np.arange(72, dtype=np.float32), (64, 72))
    place = pictures.right.astype(np.float32)[:, None, None, None]
    ramp = replace(pictures, data=np.zeros((7, 7, 1, 1, 1), np.float32) + middle + 0.01 * place)
    still, moved, even = np.zeros_like(middle), np.full_like(middle, -1), np.zeros_like(middle)
    inner = (slice(12, -12), slice(12, -12))
    for gloss, right in ((0.01, still), (0.0, moved)):
        found = agreed(ramp, (moved, still), Shading(even, np.full_like(middle, gloss)))
        assert np.array_equal(found[inner], right[inner])


def test_the_outermost_views_of_the_cross_are_swept_alone_where_there_are_others(plane):
    views, _ = plane
    ends = outermost(Pictures.of(views))
    assert ends is not None
    assert sorted(map(tuple, np.argwhere(ends.lit))) == [(0, 3), (3, 0), (3, 3), (3, 6), (6, 3)]
    few = LightField(views.data[2:5, 2:5], Grid((3, 3), 1.0), views.lenslets, views.separation)
    assert outermost(Pictures.of(few)) is None
    row = LightField(views.data[3:4], Grid((1, 7), 1.0), views.lenslets, views.separation)
    ends = outermost(Pictures.of(row))
    assert ends is not None
    assert ends.lit.tolist() == [[True, False, False, True, False, False, True]]


def test_a_sweep_of_all_and_one_of_the_outermost_views_are_put_to_the_vote(plane, monkeypatch):
    """All but the outermost views show the plane where it is not: the sweep of all of them follows these."""
    views, moves = plane
    pictures = Pictures.of(views)
    labels = np.arange(-2, 4.1, 0.4, dtype=np.float32)
    data = pictures.data.copy()
    for k in (1, 2, 4, 5):
        data[3, k] = data[k, 3] = pictures.center
    put = []
    monkeypatch.setattr("lumigraph.depth.sweep.agreed", lambda _, maps, __: put.extend(maps) or maps[1])
    found, _ = swept(replace(pictures, data=data), labels, Shading.none(moves.shape), silent)
    off = [np.median(np.abs(one - moves)[6:-6, 6:-6]) for one in (*put, found)]
    assert off[0] > 0.5
    assert off[1] < 0.1
    assert off[2] == off[1]
