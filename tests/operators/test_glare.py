"""Faint light far from a point: against direct sums of the law, transpose, nothing near."""

import math

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.operators.periodic.glare import aside, glare
from lumigraph.operators.sampling.cells import Cells

SIZE = (2.0, 1.5)
REACH = (1, 2)
IMAGE = (5, 6)
ARRAY = (slice(1, 4), slice(1, 5))
"""Its cells among those of the image: only where lenslets are does the main lens' light arrive."""
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
    return only(image)


def only(image, margin=(0, 0)):
    """What is in the array, of cells with a margin around the image's."""
    within = np.zeros_like(image)
    y, x = (slice(s.start + m, s.stop + m) for s, m in zip(ARRAY, margin, strict=True))
    within[y, x] = image[y, x]
    return within


def test_it_is_the_sum_over_all_cells_out_of_reach(means, rng):
    """With a random picture for each direction: one that is mirrored or wraps round is another."""
    cells = rng.random((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1]))
    found = glare([means], CELLS).forward(cells)
    np.testing.assert_allclose(found, direct(cells, means), rtol=2e-6)


def test_within_reach_there_is_none(means):
    cells = np.zeros((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1]))
    cells[REACH[0] + 2, REACH[1] + 3] = 1  # above the image's cell (2, 3)
    image = glare([means], CELLS).forward(cells)
    assert np.abs(image[1:4, 1:]).max() < 1e-6
    cells = np.roll(cells, (-2, 1), (0, 1))
    assert glare([means], CELLS).forward(cells)[2, 1].min() > 0


def test_it_falls_as_the_cube_of_the_distance(means):
    """Along a row, from 4 to 6 cells: (4/6)³ of it."""
    cells = np.zeros((IMAGE[0] + 2 * REACH[0], IMAGE[1] + 2 * REACH[1]))
    cells[REACH[0] + 2, REACH[1] + 7] = 1
    image = glare([means], CELLS).forward(cells)
    np.testing.assert_allclose(image[2, 1] / image[2, 3], (4 / 6) ** 3, rtol=1e-5)


def test_all_of_it_adds_up_to_an_even_object(means, rng):
    """Of an object that goes on for a hundred cells; what lies beyond falls as one over that."""
    even = sum(means.values()) * 4 + rng.random(4)
    wide = glare([means], CELLS, even[None]).widened((120, 160))
    cells = np.ones((IMAGE[0] + 2 * wide.margin[0], IMAGE[1] + 2 * wide.margin[1]))
    found = wide.forward(cells)[2, 2]
    np.testing.assert_allclose(4 * (sum(means.values()) + found), even, rtol=5e-3)


def test_what_lenslets_send_aside_comes_from_lenslets_and_falls_as_the_cube():
    """Of light of 1 in one cell, everywhere; what comes from beside the array counts nothing."""
    cells = np.ones((IMAGE[0] + 2, IMAGE[1] + 4))
    found = aside(CELLS, REACH, 0.01, 2.9).forward(only(cells, REACH) / 12)
    np.testing.assert_allclose(aside(CELLS, REACH, 0.01, 2.9).forward(cells / 12), found)
    cells = np.zeros_like(cells)
    cells[REACH[0] + 1, REACH[1] + 2] = 1
    found = aside(CELLS, REACH, 0.01, 2.9).forward(cells) * 4
    assert found[1, 3].max() == pytest.approx(0, abs=1e-9)
    law = 0.01 * 2.9 / (2 * math.pi) / np.array([3.0, 2 * SIZE[0]]) ** 3 * math.prod(SIZE)
    np.testing.assert_allclose([found[1, 4, 0], found[3, 2, 0]], law, rtol=1e-5)


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
    np.testing.assert_allclose(found.forward(cells), only(image), rtol=1e-5)


def test_the_adjoint_behind_staggered_cells_is_the_transpose(staggered, xp, rng):
    whole = glare(staggered, BRICKS)
    x = rng.random((IMAGE[0] + 4, IMAGE[1] + 6)).astype(np.float32)
    y = rng.random((*IMAGE, 4)).astype(np.float32)
    forward, back = to_numpy(whole.forward(xp.asarray(x))), to_numpy(whole.adjoint(xp.asarray(y)))
    assert back.shape == x.shape
    assert (forward.astype(float) * y).sum() == pytest.approx((x * back.astype(float)).sum(), rel=1e-6)
