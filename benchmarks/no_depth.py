"""Depth of views that hold none, or not one: what confidence, expected errors and warnings say.

A textured plane that slants, 7 x 7 views of 96²; as it is, among noise, noise alone, gratings whose period
is less than the range, disparities outside the range asked for, views mirrored and out of order, saturated.

    python -m benchmarks.no_depth [case ...]
"""

import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks.depth import show

Case = tuple[np.ndarray, np.ndarray | None, tuple[float, float] | None]
"""Views (v, u, y, x), true disparities (y, x) where there are any, and the range to ask for."""

_VIEWS, _SIDE = 7, 96


def textured(disparity: float) -> Case:
    """A sum of waves, on a plane that slants by 0.4 px."""
    rng = np.random.default_rng(1)
    waves = np.column_stack([rng.uniform(-0.9, 0.9, (40, 2)), rng.uniform(0, 2 * np.pi, 40)])
    return drawn(disparity, 0.004, lambda y, x: 2 + 0.2 * sum(np.cos(a * y + b * x + c) for a, b, c in waves))


def grating(period: float, disparity: float) -> Case:
    """Waves along both axes, on an even plane, with 1 % of noise."""
    k = 2 * np.pi / period
    views, truth, _ = drawn(disparity, 0.0, lambda y, x: 1.1 + 0.4 * (np.cos(k * y) + np.cos(k * x)))
    return views + noise(0.01), truth, None


def drawn(disparity: float, slant: float, paint: Callable[[Any, Any], Any]) -> Case:
    """A surface of disparities that grow by `slant` along x, seen where x - u d(x) meets it."""
    v, u, y, x = np.ix_(*(np.arange(n) - n // 2.0 for n in (_VIEWS, _VIEWS, _SIDE, _SIDE)))
    there = (x - u * disparity) / (1 + u * slant)
    return (
        paint(y - v * (disparity + slant * there), there),
        np.broadcast_to(disparity + slant * x[0, 0], (_SIDE, _SIDE)),
        None,
    )


def noise(deviation: float) -> np.ndarray:
    """Of the views, independent."""
    return deviation * np.random.default_rng(2).standard_normal((_VIEWS, _VIEWS, _SIDE, _SIDE))


def changed(change: Callable[[np.ndarray], np.ndarray], disparity: float = 0.8) -> Case:
    """The textured plane after something was done to its views."""
    views, truth, _ = textured(disparity)
    return change(views), truth, None


def _shuffled(views: np.ndarray) -> np.ndarray:
    return np.random.default_rng(5).permutation(views.reshape(-1, _SIDE, _SIDE)).reshape(views.shape)


CASES: dict[str, Callable[[], Case]] = {
    "a plane": lambda: textured(0.4),
    "a plane and noise of .2 of it": lambda: changed(lambda a: a + noise(0.2), 0.4),
    "noise of 2 %": lambda: (1 + noise(0.02), None, None),
    "noise of 30 %": lambda: (np.maximum(1 + noise(0.3), 0), None, None),
    "grating of 3.5 px at -0.52": lambda: grating(3.5, -0.52),
    "grating of 5 px at 1.7": lambda: grating(5, 1.7),
    "at 4 px, -1 to 1 asked for": lambda: (*textured(4)[:2], (-1, 1)),
    "at 10 px, -1 to 1 asked for": lambda: (*textured(10)[:2], (-1, 1)),
    "mirrored array": lambda: changed(lambda a: a[:, ::-1].copy()),
    "mirrored views": lambda: changed(lambda a: a[..., ::-1].copy()),
    "views out of order": lambda: changed(_shuffled),
    "90 % saturated": lambda: changed(lambda a: np.minimum(a, np.quantile(a, 0.1))),
}


def measured(name: str) -> dict[str, Any]:
    """A row of the table."""
    data, truth, asked = CASES[name]()
    grids = lg.Grid.square(_VIEWS, 1.0), lg.Grid.square(_SIDE, 1.0)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = lg.depth.epi(lg.LightField(data, *grids, 10.0), asked)
    sure = np.asarray(found.confidence) > 0.5
    off = np.full(sure.shape, np.nan) if truth is None else np.abs(found.values - truth)
    return {
        "case": name,
        "confidence > .5": f"{100 * sure.mean():.1f} %",
        "and off by > .3 px": "" if truth is None else f"{100 * (sure & (off > 0.3)).mean():.1f} %",
        "mean error": "" if truth is None else f"{off.mean():.3f} px",
        "expected": f"{np.asarray(found.error).mean():.3f} px",
        "said": "; ".join(str(one.message).split(":")[0].split(". ")[0] for one in said),
    }


def run(names: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Rows of the table, of the cases whose names begin with one of these."""
    return [measured(name) for name in CASES if name.startswith(tuple(names) or "")]


if __name__ == "__main__":
    show(run(sys.argv[1:]))
