"""Boards that lean the other way."""

from dataclasses import replace

import numpy as np
import pytest

from lumigraph.metrology.boards import geometry
from lumigraph.metrology.boards.adjustment import adjust
from lumigraph.metrology.boards.start import pose, search
from lumigraph.metrology.boards.twofold import mirrored, turned_over

from .scenes import BOARD, CAMERA, NOMINAL, corners


def test_a_board_turned_over_has_its_normal_mirrored_at_the_line_of_sight() -> None:
    where = np.array([0.1, 0.2, -0.1, 0.3, -0.02, -0.03])
    points = geometry.moved(BOARD.points(), where)
    turned = mirrored(points)
    middle = points.mean(0)
    np.testing.assert_allclose(turned.mean(0), middle, atol=1e-12)
    ways = [np.linalg.norm(one[:, None] - one, axis=-1) for one in (points, turned)]
    np.testing.assert_allclose(*ways, atol=1e-12)
    normals = [np.cross(one[6] - one[0], one[-1] - one[0]) for one in (points, turned)]
    n, other = (one / np.linalg.norm(one) for one in normals)
    sight = middle / np.linalg.norm(middle)
    np.testing.assert_allclose(other, 2 * (n @ sight) * sight - n, atol=1e-9)
    np.testing.assert_allclose(mirrored(turned), points, atol=1e-12)


@pytest.mark.long  # 24 s: adjusts a camera again
def test_an_adjustment_that_settled_with_a_board_turned_over_is_mended() -> None:
    seen = corners(np.random.default_rng(1), frames=4)
    camera, poses = search(seen, BOARD, NOMINAL)
    known = sorted(poses)
    seen = seen[np.isin(seen.frame, known)]
    good = adjust(seen, BOARD, NOMINAL, camera, np.array([poses[k] for k in known]))
    wrong, residual, points = good.poses.copy(), good.residual.copy(), BOARD.points()
    wrong[1] = pose(points, mirrored(geometry.moved(points, wrong[1])))
    mine = seen.frame == known[1]
    where = geometry.moved(points, wrong[1])[seen.corner[mine]]
    residual[mine] = good.camera.project(where, seen.center[mine], seen.kind[mine]) - seen.place[mine]
    mended = turned_over(replace(good, poses=wrong, residual=residual), seen, BOARD, NOMINAL)
    np.testing.assert_allclose(mended.poses, good.poses, atol=1e-4)
    assert abs(mended.camera.focal_length - CAMERA.focal_length) < 1e-3
