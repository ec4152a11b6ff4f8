"""The factors of expected errors, `lumigraph.depth.expected.LINES`: found on rendered scenes with truth.

An error at a place is taken to be of the mean Σ factor · term; the factors are those of the greatest Poisson
likelihood of all errors, found by Richardson and Lucy's steps, which keep them above zero. What `expected`
adds where other values explain an area as well is left out. Scenes
that are not there (LUMIGRAPH_DATA) are left out.

    python -m benchmarks.expected [scene ...]
"""

import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.depth import SCENES, there
from lumigraph.depth.epi import lines_of
from lumigraph.depth.expected import LINES, terms
from lumigraph.depth.pictures import Pictures

CHOSEN = ("antinous", "cotton, 33 views")
"""Scenes that the factors are found on; the others say whether they hold."""

_STEPS = 400

Parts = tuple[np.ndarray, np.ndarray]
"""Terms (term, place) and errors (place,), in px of the outermost view."""


def parts_of(name: str) -> Parts:
    """Of a scene, where the truth is known."""
    views, truth = SCENES[name]()
    pictures = Pictures.of(views)
    found, evidence, _ = lines_of(pictures)
    known = np.isfinite(truth)
    parts = terms(found, evidence)
    return np.stack([parts[name][known] for name in LINES]), np.abs(found - truth * pictures.reach)[known]


def fitted(parts: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Factors (term,) of the greatest Poisson likelihood of errors (place,) of terms (term, place)."""
    factors, sums = np.full(len(parts), 0.1), parts.sum(1)
    for _ in range(_STEPS):
        factors = factors * (parts @ (errors / (factors @ parts + 1e-9))) / sums
    return factors


def show(found: dict[str, Parts], used: dict[str, float], chosen: Sequence[str]) -> None:
    """Print the factors by the chosen scenes, beside those in use, and the errors expected of each scene."""
    joined = [np.concatenate([found[name][k] for name in chosen if name in found], -1) for k in (0, 1)]
    new, old = fitted(*joined), np.array(list(used.values()))
    for name, factor, now in zip(used, new, old, strict=True):
        print(f"{name:10} {factor:.3f}, in use {now:.3f}")
    for scene, (parts, errors) in found.items():
        ratios = [float((factors @ parts).mean() / errors.mean()) for factors in (new, old)]
        print(f"{scene}: expected over true error {ratios[0]:.2f}, by those in use {ratios[1]:.2f}")
        print("  true over expected, from the surest eighth on:", by_eighths(old @ parts, errors))


def by_eighths(expected: np.ndarray, errors: np.ndarray) -> str:
    """Mean and median error (place,) of each eighth of the places by expected error, over its mean."""
    eighths = np.array_split(np.argsort(expected, kind="stable"), 8)
    means = [expected[some].mean() for some in eighths]
    return ", ".join(
        f"{errors[some].mean() / mean:.2f} ({np.median(errors[some]) / mean:.2f})"
        for some, mean in zip(eighths, means, strict=True)
    )


if __name__ == "__main__":
    measured = {name: parts_of(name) for name in there() if name.startswith(tuple(sys.argv[1:]) or "")}
    if set(CHOSEN) & set(measured):
        show(measured, LINES, CHOSEN)
    else:
        print("skipped: no scene is there. Set LUMIGRAPH_DATA to a folder that holds hci_antinous.")
