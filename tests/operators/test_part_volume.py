"""Planes that shine at once, with derivatives: the sum of the planes'."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import GeometryError
from lumigraph.units import mm, um

DEPTHS = (-2 * mm, 0.0, 3 * mm)


@pytest.fixture(scope="module")
def volume():
    camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
        lenslets={"count": (5, 5)}, sensor={"shape": (61, 61)}, main_lens={"diameter": "1 mm"}
    )
    pair = tuple(camera.replace(lenslets={"focal_length": f}) for f in ("5.1999 mm", "5.2001 mm"))
    grid = lg.Grid.square(10, 100 * um)
    return camera, camera.part_volume([pair], grid, DEPTHS), grid


def test_a_volume_is_seen_as_the_operator_sees_it(volume):
    """Where the outermost lenslets are most of the picture, planes are 2 to 3 % off."""
    camera, part, grid = volume
    x = np.random.default_rng(1).random(part.shape[1])
    seen = camera.operator_on(grid, DEPTHS, accuracy=1e-3).forward(x.astype(np.float32))
    middle = np.s_[20:41, 20:41]
    off = np.linalg.norm((part.forward(x) - seen)[middle]) / np.linalg.norm(seen[middle])
    assert off < 0.02


def test_gradient_is_the_transpose_of_the_derivative(volume):
    _, part, _ = volume
    rng = np.random.default_rng(2)
    x, weights = rng.random((2, *part.shape[1])), rng.standard_normal((2, *part.shape[0]))
    there = sum(np.vdot(w, part.derivative(one, np.ones(1))) for one, w in zip(x, weights, strict=True))
    assert part.gradient(x, weights)[0] == pytest.approx(there, rel=1e-8, abs=0)


def test_other_objects_and_no_depths_are_refused(volume):
    camera, part, grid = volume
    with pytest.raises(GeometryError, match=r"shape \(2, 10, 10\) but the planes \(3, 10, 10\)"):
        part.forward(np.ones((2, 10, 10)))
    with pytest.raises(GeometryError, match="depths are empty"):
        camera.part_volume([], grid, [])
