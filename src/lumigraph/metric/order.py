"""Order of a board's points among the places found: checked, mended where that is possible, or refused."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from lumigraph.errors import CalibrationError

_OFF = 0.3
"""Largest error of a place on a flat board, by the others, over the distance to the nearest one."""

_FLAT = 0.02
"""Width over length of a board seen from the side that no detector finds any more."""


def ordered(places: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The places (n, 2), (y, x), in the order of a flat board's points (n, 2).

    A flat board is seen by a homography, but for distortion. Places in an order that fits none are laid onto
    the board by the corners of their outline; the board is seen from the front.

    Raises
    ------
    CalibrationError
        If no order of the places makes a flat board.
    """
    off = misplaced(places, points)
    if off <= _OFF:
        return places
    for again in _by_outline(places, points):
        if misplaced(again, points) <= _OFF:
            return again
    raise CalibrationError(
        f"the {len(places)} corners found make no flat board in any order (one is {off:.2g} of the way to "
        f"its neighbour from where the others lead, {_OFF:g} at most). Leave the picture out."
    )


@contextmanager
def told_of(what: str) -> Iterator[None]:
    """Context in which errors name the picture."""
    try:
        yield
    except CalibrationError as error:
        raise CalibrationError(f"{what}: {error}") from None


def misplaced(places: np.ndarray, points: np.ndarray) -> float:
    """Largest distance of a place from the homography of them all, over that to the nearest other place.

    Infinite where the board would be seen from behind, and where places coincide or lie on a line.
    """
    long, wide = np.linalg.svd(places - places.mean(0), compute_uv=False)
    near = np.asarray(KDTree(places).query(places, 2)[0])[:, 1]
    matrix = homography(points, places)
    scale = np.column_stack([points, np.ones(len(points))]) @ matrix[2]
    # The sign of the Jacobian: det H over the cube of the denominator.
    if wide < _FLAT * long or not near.all() or not (np.linalg.det(matrix) * scale > 0).all():
        return np.inf
    return float((np.hypot(*(applied(matrix, points) - places).T) / near).max())


def homography(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) that maps points (n, 2) to places (n, 2), n at least 4, by least squares (DLT).

    R. Hartley, "In defense of the eight-point algorithm", IEEE Trans. PAMI 19, 580 (1997), scales so.
    """
    (a, one), (b, other) = _scaled(points), _scaled(places)
    ones, none = np.ones((len(a), 1)), np.zeros((len(a), 3))
    flat = np.hstack([a, ones])
    rows = np.concatenate([
        np.hstack([flat, none, -b[:, :1] * flat]), np.hstack([none, flat, -b[:, 1:] * flat])
    ])  # fmt: skip
    return np.linalg.inv(other) @ np.linalg.svd(rows)[2][-1].reshape(3, 3) @ one


def applied(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 2) after a homography."""
    moved = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return moved[:, :2] / moved[:, 2:]


def _scaled(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points about 0, of size 1, and the matrix that does it."""
    middle = points.mean(0)
    size = max(float(np.sqrt(((points - middle) ** 2).sum(1).mean())), 1e-300)
    matrix = np.array([[1 / size, 0, -middle[0] / size], [0, 1 / size, -middle[1] / size], [0, 0, 1.0]])
    return (points - middle) / size, matrix


def _by_outline(places: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """The places in orders by which the outlines' largest quadrilaterals agree."""
    try:
        mine, theirs = points[_quadrilateral(points)], places[_quadrilateral(places)]
    except QhullError:
        return []
    found = []
    for turn in range(4):
        expected = applied(homography(mine, np.roll(theirs, turn, axis=0)), points)
        order = np.asarray(KDTree(places).query(expected)[1])
        if len(np.unique(order)) == len(places):
            found.append(places[order])
    return found


def _quadrilateral(points: np.ndarray) -> np.ndarray:
    """Indices (4,), in turn, of the quadrilateral of the largest area: an image of a rectangle is its own."""
    rim = ConvexHull(points).vertices  # in turn, the same way round for all
    chosen = rim[np.array(list(combinations(range(len(rim)), 4)), int)]
    (ay, ax), (by, bx) = (np.moveaxis(points[chosen[:, k + 2]] - points[chosen[:, k]], -1, 0) for k in (0, 1))
    return chosen[np.argmax(np.abs(ay * bx - ax * by))]
