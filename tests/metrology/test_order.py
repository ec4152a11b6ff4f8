"""Places of a board in the order of its points."""

import numpy as np
import pytest

from lumigraph.errors import CalibrationError
from lumigraph.metrology import Board
from lumigraph.metrology.boards import chessboard, order

BOARD = Board((5, 9), 1.0)
TILTED = np.array([[30.0, 3.0, 40.0], [2.0, 28.0, 50.0], [0.01, -0.02, 1.0]])


def places(bent=0.03, noise=0.1):
    """Of the board seen from the side by a lens with distortion."""
    seen = order.applied(TILTED, BOARD.points()[:, 1:])
    away = seen - seen.mean(0)
    part = (away**2).sum(1, keepdims=True) / (away**2).sum(1).max()
    return seen + bent * part * away + np.random.default_rng(0).normal(0, noise, seen.shape)


def from_either_end(found, true):
    return np.array_equal(found, true) or np.array_equal(found, true[::-1])


def test_a_homography_comes_back_exactly():
    flat = BOARD.points()[:, 1:]
    found = order.homography(flat, order.applied(TILTED, flat))
    np.testing.assert_allclose(found / found[2, 2], TILTED, rtol=1e-9)


def test_places_in_order_stay_as_they_are():
    np.testing.assert_array_equal(order.ordered(places(), BOARD.points()[:, 1:]), places())


@pytest.mark.parametrize("how", ["shuffled", "two swapped", "mirrored", "by columns"])
def test_scrambled_places_are_put_in_order(how):
    true = places()
    grid = true.reshape(5, 9, 2)
    swapped = true.copy()
    swapped[[20, 21]] = swapped[[21, 20]]
    scrambled = {
        "shuffled": np.random.default_rng(1).permutation(true),
        "two swapped": swapped,
        "mirrored": grid[:, ::-1].reshape(-1, 2),
        "by columns": grid.swapaxes(0, 1).reshape(-1, 2),
    }[how]
    assert order.misplaced(scrambled, BOARD.points()[:, 1:]) > 0.9
    assert from_either_end(order.ordered(scrambled, BOARD.points()[:, 1:]), true)


@pytest.mark.parametrize("how", ["one stray", "one twice", "all on a line"])
def test_places_that_no_order_makes_a_board_are_refused(how):
    wrong = np.random.default_rng(2).permutation(places())
    if how == "one stray":
        wrong[7] += (9, 11)
    elif how == "one twice":
        wrong[7] = wrong[8]
    else:
        wrong = np.column_stack([np.arange(45.0), np.arange(45.0)])
    with pytest.raises(CalibrationError, match="45 corners found make no flat board in any order"):
        order.ordered(wrong, BOARD.points()[:, 1:])


def test_a_scrambled_answer_of_opencv_is_put_in_order_or_refused(monkeypatch):
    cv2 = pytest.importorskip("cv2", reason="OpenCV finds the board")
    true = places(noise=0)
    answer = np.random.default_rng(3).permutation(true)[:, None, ::-1].astype(np.float32)
    monkeypatch.setattr(cv2, "findChessboardCornersSB", lambda *_, **__: (True, answer))
    dull = np.arange(100.0).reshape(10, 10)
    assert from_either_end(chessboard.find(dull, BOARD, "it"), true.astype(np.float32).astype(float))
    answer[3] = answer[3] + 10
    with pytest.raises(CalibrationError, match="no flat board in any order"):
        chessboard.find(dull, BOARD, "it")
