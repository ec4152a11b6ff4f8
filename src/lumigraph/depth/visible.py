"""Visibility of places in views, behind what is nearer."""

from collections.abc import Iterator

import numpy as np

from lumigraph.depth.pictures import Pictures

BEFORE = 1.2
"""Least distance of an occluder before a place [px in the outermost view]."""


def visible(pictures: Pictures, moves: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Lit views (v, u) but the middle one, each with a mask (y, x) of the middle view's places it sees.

    Places are put into the view from far to near: where another one ends up on top, they are hidden.
    """
    order = np.argsort(moves, axis=None)
    y, x = np.divmod(order, moves.shape[1])
    sorted_moves = moves.ravel()[order]
    last = [n - 1 for n in moves.shape]
    for v, u in np.argwhere(pictures.lit):
        if (v, u) == pictures.middle:
            continue
        row = np.clip(np.rint(y + sorted_moves * pictures.down[v]), 0, last[0]).astype(np.intp)
        column = np.clip(np.rint(x + sorted_moves * pictures.right[u]), 0, last[1]).astype(np.intp)
        nearest = np.empty_like(moves)
        nearest[row, column] = sorted_moves
        seen = np.empty(moves.size, bool)
        seen[order] = nearest[row, column] < sorted_moves + BEFORE
        yield int(v), int(u), seen.reshape(moves.shape)
