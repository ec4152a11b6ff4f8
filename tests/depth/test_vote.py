"""Which of two sweeps a place takes."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import texture, views_of

from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import silent
from lumigraph.depth.lines import few, refined
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
    right_fits = agreed(pictures, (left, right), Shading.none(moves.shape))
    assert right_fits[:, : half - 10].all()  # the window is 10 px wide
    assert not right_fits[:, half + 10 :].any()


def test_shading_is_no_disagreement(plane):
    """On a ramp of 0.01 a place, 0.01 brighter in the outermost view is 1 px to the left, or shading."""
    pictures = Pictures.of(plane[0])
    middle = np.broadcast_to(0.01 * np.arange(72, dtype=np.float32), (64, 72))
    place = pictures.right.astype(np.float32)[:, None, None, None]
    ramp = replace(pictures, data=np.zeros((7, 7, 1, 1, 1), np.float32) + middle + 0.01 * place)
    still, moved, even = np.zeros_like(middle), np.full_like(middle, -1), np.zeros_like(middle)
    inner = (slice(12, -12), slice(12, -12))
    for gloss, stands_still in ((0.01, True), (0.0, False)):
        found = agreed(ramp, (moved, still), Shading(even, np.full_like(middle, gloss)))
        assert (found[inner] == stands_still).all()


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


def test_all_views_are_swept_and_the_outermost_alone(plane):
    """All but the outermost views show the plane where it is not: the sweep of all of them follows these."""
    views, moves = plane
    pictures = Pictures.of(views)
    labels = np.arange(-2, 4.1, 0.4, dtype=np.float32)
    data = pictures.data.copy()
    for k in (1, 2, 4, 5):
        data[3, k] = data[k, 3] = pictures.center
    maps, _ = swept(replace(pictures, data=data), labels, Shading.none(moves.shape), silent)
    off = [np.median(np.abs(one - moves)[6:-6, 6:-6]) for one in maps]
    assert off[0] > 0.5
    assert off[1] < 0.1


def test_maps_are_refined_before_they_are_put_to_the_vote(plane):
    """One is 0.3 px off everywhere, which refining mends, the other one right on the right only."""
    views, moves = plane
    pictures, none = Pictures.of(views), np.zeros_like(moves)
    second = moves.copy()
    second[:, :36] += 2.5  # too far to be mended
    found, _ = refined(pictures, ([moves + 0.3, second], none), Shading.none(moves.shape), silent)
    assert np.abs(found - moves)[6:-6, 6:-6].max() < 0.1
    found, _ = refined(pictures, ([second, moves + 0.3], none), Shading.none(moves.shape), silent)
    assert np.abs(found - moves)[6:-6, 6:-6].max() < 0.1


def test_maps_are_first_refined_on_every_second_view_of_the_star(plane):
    some = few(Pictures.of(plane[0])).lit
    star = {(v, u) for v in (0, 2, 3, 4, 6) for u in (0, 2, 3, 4, 6)}
    star = {(v, u) for v, u in star if v == 3 or u == 3 or abs(v - 3) == abs(u - 3)}
    assert set(map(tuple, np.argwhere(some))) == star
    row = LightField(plane[0].data[3:4], Grid((1, 7), 1.0), plane[0].lenslets, 20.0)
    assert few(Pictures.of(row)).lit.tolist() == [[True, False, True, True, True, False, True]]
