"""Faint light far from a point: against direct sums of the law, transpose, nothing near."""

import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.operators.cells import Cells
from lumigraph.operators.glare import glare

SIZE = (2.0, 1.5)
REACH = (1, 2)
IMAGE = (5, 6)
CELLS = Cells(SIZE, (0.0, 0.0), (3, 4), (2, 2), (2, 2))
BRICKS = Cells(SIZE, (0.0, 0.0), (3, 4), (2, 2), (2, 2), staggered=True, kinds=3, kind=1)


@pytest.fixture
def means(rng):
    return {(dy, dx): rng.random(4) for dy in range(-1, 2) for dx in range(-2, 3)}


def direct(cells, means):
    """Of every pair of cells that is out of reach: the ring's nearest picture, fallen as r⁻³.

    A picture at (dy, dx) is that of the cell (dy, dx) beyond the image's.
    """
    image = np.zeros((*IMAGE, 4))
    for i in range(IMAGE[0]):
        for j in range(IMAGE[1]):
            for k in range(cells.shape[0]):
                for m in range(cells.shape[1]):
                    dy, dx = k - REACH[0] - i, m - REACH[1] - j
                    out = max(abs(dy) / REACH[0], abs(dx) / REACH[1])
                    if out > 1:
                        near = round(dy / out), round(dx / out)
                        far = math.hypot(dy * SIZE[0], dx * SIZE[1])
                        law = math.hypot(near[0] * SIZE[0], near[1] * SIZE[1]) / far
                        image[i, j] += law**3 * cells[k, m] * means[near]
    return image


def test_it_is_the_sum_over_all_cells_out_of_reach(means, rng):
    """With a random picture for each direction: one that is mirrored or wraps round is another."""
    cells = rng.random((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1]))
    found = glare([means], CELLS).forward(cells)
    np.testing.assert_allclose(found, direct(cells, means), rtol=2e-6)


def test_within_reach_there_is_none(means):
    cells = np.zeros((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1]))
    cells[REACH[0] + 2, REACH[1] + 3] = 1  # above the image's cell (2, 3)
    image = glare([means], CELLS).forward(cells)
    assert np.abs(image[1:4, 1:6]).max() < 1e-6
    assert image[4, 3].min() > 0
    assert image[2, 0].min() > 0


def test_it_falls_as_the_cube_of_the_distance(means):
    """Along a row, from 3 to 5 cells: (3/5)³ of it."""
    cells = np.zeros((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1]))
    cells[REACH[0] + 2, REACH[1] + 5] = 1
    image = glare([means], CELLS).forward(cells)
    np.testing.assert_allclose(image[2, 0] / image[2, 2], (3 / 5) ** 3, rtol=1e-5)


def test_the_adjoint_is_the_transpose(means, xp, rng):
    whole = glare([means], CELLS)
    x = rng.random((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1])).astype(np.float32)
    y = rng.random((*IMAGE, 4)).astype(np.float32)
    forward, back = to_numpy(whole.forward(xp.asarray(x))), to_numpy(whole.adjoint(xp.asarray(y)))
    assert forward.dtype == np.float32
    assert back.shape == x.shape
    assert (forward.astype(float) * y).sum() == pytest.approx((x * back.astype(float)).sum(), rel=1e-6)


@pytest.fixture
def staggered(rng):
    """Of three kinds; odd rows reach from -3 to 2, as far to both sides."""
    keys = [(dy, dx) for dy in range(-2, 3) for dx in range(-2 - dy % 2, 3)]
    return [{key: rng.random(4) for key in keys} for _ in range(3)]


def test_behind_staggered_cells_of_three_kinds_it_is_the_sum_over_all_out_of_reach(staggered, rng):
    """Each cell of the image by where it stands, its kind and the nearest picture on the straight line."""
    margin = (2, 3)
    cells, image = rng.random((IMAGE[0] + 4, IMAGE[1] + 6)), np.zeros((*IMAGE, 4))
    for i in range(IMAGE[0]):
        for j in range(IMAGE[1]):
            odd = (i - 1) % 2
            kind = (1 + (j - 1) - odd) % 3
            for k in range(cells.shape[0]):
                for m in range(cells.shape[1]):
                    dy = k - margin[0] - i
                    across = m - margin[1] - j + ((i - 1 + dy) % 2 - odd) / 2
                    shift = dy % 2
                    if (dy, round(across - shift / 2)) in staggered[0]:
                        continue
                    out = max(abs(dy) / 2, abs(across) / 2.5)
                    row = round(dy / out)
                    column = round(across / out - row % 2 / 2)
                    column = min(max(column, -2 - row % 2), 2)
                    near = math.hypot(row * SIZE[0], (column + row % 2 / 2) * SIZE[1])
                    law = near / math.hypot(dy * SIZE[0], across * SIZE[1])
                    image[i, j] += law**3 * cells[k, m] * staggered[kind][row, column]
    found = glare(staggered, BRICKS)
    assert found.margin == margin
    np.testing.assert_allclose(found.forward(cells), image, rtol=1e-5)


def test_the_adjoint_behind_staggered_cells_is_the_transpose(staggered, xp, rng):
    whole = glare(staggered, BRICKS)
    x = rng.random((IMAGE[0] + 4, IMAGE[1] + 6)).astype(np.float32)
    y = rng.random((*IMAGE, 4)).astype(np.float32)
    forward, back = to_numpy(whole.forward(xp.asarray(x))), to_numpy(whole.adjoint(xp.asarray(y)))
    assert back.shape == x.shape
    assert (forward.astype(float) * y).sum() == pytest.approx((x * back.astype(float)).sum(), rel=1e-6)
