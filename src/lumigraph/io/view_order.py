"""Check that the views of a light field stand where their numbers say: `check_order`, `is_mirrored`."""

import math
import warnings
from typing import Any

import numpy as np
import scipy

from lumigraph.core.arrays import to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.errors import SamplingWarning

_SIDE, _REACH, _WINDOW, _SMOOTH = 128, 20, 7, 7
"""Pixels across the pictures that are compared, how far they may be shifted, over what they agree [px]."""

_FLAT, _FEWEST = 1e-4, 4
"""Detail, as a share of the largest value, below which a picture has none; fewest pictures."""

_BETTER, _SEEN, _MOST = 1.5, 0.02, 99
"""How many times better the views must agree otherwise; the least difference that counts, as a share of the
picture's contrast; the largest number of times that is said."""

Around = dict[tuple[int, int], np.ndarray]
_GIVEN, _MIRRORED = "as they are", "with the columns mirrored"
_ORDERS = {
    _GIVEN: (1, 1, False),
    _MIRRORED: (1, -1, False),
    "with rows and columns swapped": (1, 1, True),
    "with rows and columns swapped and the columns mirrored": (1, -1, True),
}
"""Signs of v and u, and whether they are swapped. Mirroring rows instead only turns all views round, which
changes near and far but not how well they agree."""


def check_order(views: LightField[Any], name: str) -> None:
    """Warn where views agree far better with their two numbers swapped, or with one of them mirrored.

    Parameters
    ----------
    views
        As they were read.
    name
        Of the file or folder.

    Warns
    -----
    SamplingWarning
        Which order makes them agree, and how well they do in both.
    """
    if (better := _better(views)) is None:
        return
    order, best, given = better
    warnings.warn(
        f"{name}: the views agree {given / max(best, given / _MOST):.1f} times better {order} "
        f"(they differ by {best:.1%} of the contrast, as they are by {given:.1%}). "
        "Pictures focused from them are blurred: check which number in the names is the row.",
        SamplingWarning,
        stacklevel=4,
    )


def is_mirrored(views: LightField[Any]) -> bool:
    """True if views agree far better with the columns, or as well the rows, in reverse order."""
    better = _better(views)
    return better is not None and better[0] == _MIRRORED


def _better(views: LightField[Any]) -> tuple[str, float, float] | None:
    """Order in which views agree far better, and their difference in it and as they are; None if in none."""
    for wide in (True, False):
        if (costs := _compared(views, wide)) is None:
            continue
        best, given = min(costs, key=costs.__getitem__), costs[_GIVEN]
        if costs[best] * _BETTER < given and given > _SEEN:
            return best, costs[best], given
    return None


def _compared(views: LightField[Any], wide: bool) -> dict[str, float] | None:
    """Difference of the outer views from the middle one in each order; None where nothing can be said.

    Each place is moved by the slope that suits it best: orders are told apart by what no slope explains.
    """
    pictures = _pictures(views, wide)
    if pictures is None:
        return None
    middle, around, aspect = pictures
    contrast = float(middle.std())
    if contrast == 0:
        return None
    costs = {}
    for order, (sv, su, swap) in _ORDERS.items():
        maps = []
        for slope in range(-_REACH, _REACH + 1):
            total = np.zeros_like(middle)
            for (v, u), view in around.items():
                y, x = (u, v) if swap else (v, u)
                total += np.abs(_moved(view, sv * slope * y * aspect, su * slope * x) - middle)
            maps.append(scipy.ndimage.uniform_filter(total / len(around), _WINDOW))
        costs[order] = float(_inner(np.min(maps, 0)).mean()) / contrast
    return costs


def _pictures(views: LightField[Any], wide: bool) -> tuple[np.ndarray, Around, float] | None:
    """Middle view, the eight around it at the same distance, and rows a slope moves for each column."""
    nv, nu, ny, nx = (int(n) for n in views.data.shape[:4])
    far = max((min(nv, nu) - 1) // 2, 1)
    if min(nv, nu) < 2 or min(ny, nx) < 3 * _WINDOW:
        return None
    step = math.ceil(max(ny, nx) / _SIDE) if wide else 1
    if not wide and max(ny, nx) <= _SIDE:
        return None
    middle = nv // 2, nu // 2
    read = {
        (v, u): _reduced(to_numpy(views.view(middle[0] + far * v, middle[1] + far * u)), step)
        for v in (-1, 0, 1)
        for u in (-1, 0, 1)
        if _is_there(views, middle[0] + far * v, middle[1] + far * u)
    }
    if (0, 0) not in read or len(read) < _FEWEST or not all(any(place[k] for place in read) for k in (0, 1)):
        return None
    down, right = (a / b for a, b in zip(views.aperture.pitch, views.lenslets.pitch, strict=True))
    return read.pop((0, 0)), read, down / right


def _is_there(views: LightField[Any], v: int, u: int) -> bool:
    if not (0 <= v < views.data.shape[0] and 0 <= u < views.data.shape[1]):
        return False
    return views.valid is None or bool(np.asarray(to_numpy(views.valid[v, u])).any())


def _reduced(view: np.ndarray, step: int) -> np.ndarray:
    """Grey picture, means of blocks, or its middle part where the step is 1."""
    grey = np.asarray(view, np.float32)
    grey = grey if grey.ndim == 2 else grey.mean(-1)
    if step == 1:
        top, left = ((n - _SIDE) // 2 if n > _SIDE else 0 for n in grey.shape)
        return _detail(grey[top : top + _SIDE, left : left + _SIDE])
    ny, nx = (n // step for n in grey.shape)
    return _detail(grey[: ny * step, : nx * step].reshape(ny, step, nx, step).mean((1, 3)))


def _detail(grey: np.ndarray) -> np.ndarray:
    """Detail of a picture without its brightness, which vignetting changes from view to view."""
    fine = grey - scipy.ndimage.gaussian_filter(grey, _SMOOTH)
    least = _FLAT * float(np.abs(grey).max())
    return fine / spread if (spread := float(fine.std())) > least else np.zeros_like(fine)


def _moved(view: np.ndarray, y: float, x: float) -> np.ndarray:
    return np.roll(view, (-round(y), -round(x)), (0, 1))


def _inner(values: np.ndarray) -> np.ndarray:
    """Without the border, over which pictures roll round."""
    edge = min(_REACH, min(values.shape) // 4)
    return values[edge : values.shape[0] - edge, edge : values.shape[1] - edge]
