"""Drift of a bench over hours, from the steps of `watch`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lumigraph.metrology.alignment.setup import shown


def drift_rates(steps: Sequence[Mapping[str, Any]]) -> dict[str, tuple[float, float]]:
    """Drift of what motors move an hour, and its standard deviation, by least squares over the steps.

    What the motors did is taken out: each step's value less all moves before it. The deviation is that of the
    scatter alone: tilts of a simulated bench that drifted for two hours came out a fifth too small
    (docs/validation/align.md).

    Parameters
    ----------
    steps
        `AlignmentStep.values` or those of the log, at least three from after the alignment.
    """
    first = next((k for k, one in enumerate(steps) if one["status"] == "aligned"), 0)
    used = steps[first:]
    hours = np.array([one["seconds"] / 3600 for one in used])
    found = {}
    for name in used[0]["moved_by_motors"] if len(used) > 2 and np.ptp(hours) > 0 else ():
        value = np.array([one["out"][name] for one in used]) - _moved(used, name)
        A = np.stack([hours - hours.mean(), np.ones_like(hours)], 1)
        fit, *_ = np.linalg.lstsq(A, value, rcond=None)
        rest = float(np.sum((value - A @ fit) ** 2)) / (len(used) - 2)
        found[name] = (float(fit[0]), float(np.sqrt(rest / np.sum(A[:, 0] ** 2))))
    return found


def _moved(steps: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    """Sum of the moves before each step."""
    total, sums = 0.0, []
    for step in steps:
        sums.append(total)
        for move in step["moves"]:
            if step["moved_by_motors"][move["number"]] == name:
                total += move["expected"]
    return np.array(sums)


def drift_table(steps: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Drift as rows of text, their header first: what, drift an hour, largest deviation while watched."""
    first = next((k for k, one in enumerate(steps) if one["status"] == "aligned"), 0)
    rows = [["what", "drift an hour", "standard deviation, of scatter alone", "farthest from its place"]]
    for name, (rate, error) in drift_rates(steps).items():
        most = max((one["out"][name] for one in steps[first:]), key=abs)
        rows.append([name, shown(name, rate), shown(name, error, signed=False), shown(name, most)])
    return rows
