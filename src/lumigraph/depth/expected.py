"""The error of a map to expect: what noise does, and what is at stake beside an edge of depth."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import grey_closing, grey_opening, maximum_filter, minimum_filter

FACTORS = {
    "noise": 0.26,
    "nearer": 0.07,
    "farther": 0.29,
    "faint": 0.54,
    "wide": 0.21,
    "disputed": 0.105,
}
"""Of the `terms`, chosen on *antinous* and *cotton*; benchmarks/expected.py compares them with a new fit."""

_FADED = {"faint": 5, "wide": 9}  # windows beside whose edges no edge of the picture shows
_AROUND = 15
_RIVALS = 0.5  # of how far other values lie: so large are errors where they explain *antinous* as well
_CHANCE = 0.5  # px: what lies nearer is noise of the costs, as on slants
_GAPS = 3  # samples across that an area of rivals closes over
_AREA = 7  # samples across that it has: beside an edge of depth there are fewer
_EVEN, _ABOUT = 1e-6, 33  # contrast of what is saturated or black; samples across whose values it may have
_FAINT = 0.005  # contrast between neighbours by which an edge of depth shows


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a map rests on.

    Parameters
    ----------
    deviation
        Standard deviation (y, x) by the residuals that are left and the contrast.
    disputed
        Part (y, x) of what sees a place that shows something else there.
    contrast
        Between neighbours of the picture (y, x), of 0 to 1.
    rivals
        How far (y, x) other values lie that explain a place as well; see `lumigraph.depth.volume.rivals`.
    chance
        How likely (y, x) the match is one by chance; see `lumigraph.depth.chance.by_chance`.
    """

    deviation: np.ndarray
    disputed: np.ndarray
    contrast: np.ndarray
    rivals: np.ndarray
    chance: np.ndarray | float = 0.0


def contrast(picture: np.ndarray) -> np.ndarray:
    """Length of the gradient (y, x) of a picture (y, x)."""
    return np.hypot(*np.gradient(picture))


def expected(values: np.ndarray, evidence: Evidence, *, slants: bool = True) -> np.ndarray:
    """Mean distance from the truth (y, x) to expect, in the unit of the values and their deviation.

    `values` (y, x) are greater where nearer. `slants`: see `terms`. Where other values explain an area as
    well, as in a texture that repeats, it is at least a part of how far they lie.
    """
    parts = terms(values, evidence, slants=slants)
    usual = sum((FACTORS[name] * part for name, part in parts.items()), np.zeros_like(values))
    rivals = np.where(evidence.rivals > _CHANCE, evidence.rivals, 0)
    return np.maximum(usual, _RIVALS * grey_opening(grey_closing(rivals, _GAPS), _AREA))


def uniform(evidence: Evidence) -> np.ndarray:
    """Whether a place (y, x) and all around it are as bright, as where the picture is saturated or black."""
    return maximum_filter(evidence.contrast, 3) < _EVEN


def about(values: np.ndarray) -> np.ndarray:
    """Mean distance (y, x) to expect of what may have any of the values that are near to it."""
    return 0.5 * _range(values, _ABOUT)


def terms(values: np.ndarray, evidence: Evidence, *, slants: bool = True) -> dict[str, np.ndarray]:
    """What an expected error is made of (y, x), each in the unit of the values.

    A map is most often wrong beside something farther, which it takes for a part of what stands before it;
    the more so if no edge of the picture says where that ends. What is as much nearer on the other side is no
    edge but a slant. With `slants` it is still at stake where views dispute a place.
    """
    beyond = {width: _beyond_slant(values, width) for width in (3, *_FADED.values())}
    farther = {width: np.maximum(one, 0) for width, one in beyond.items()}
    around = _range(values, _AROUND) if slants else np.abs(_beyond_slant(values, _AROUND))
    faint = np.exp(-evidence.contrast / _FAINT)
    return {
        "noise": evidence.deviation,
        "nearer": np.maximum(-beyond[3], 0),
        "farther": farther[3],
        **{name: faint * farther[width] for name, width in _FADED.items()},
        "disputed": evidence.disputed * around,
    }


def _range(values: np.ndarray, width: int) -> np.ndarray:
    """Between the nearest and the farthest in a window (y, x)."""
    return maximum_filter(values, width) - minimum_filter(values, width)


def _beyond_slant(values: np.ndarray, width: int) -> np.ndarray:
    """How much farther what is farthest in a window is, than what is nearest in it is nearer (y, x)."""
    return (values - minimum_filter(values, width)) - (maximum_filter(values, width) - values)
