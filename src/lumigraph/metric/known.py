r"""Comparison of prior knowledge of a camera with the result of its calibration: `disagreement`.

A value known as x_0 with variance σ_0² is adjusted with a variance σ²; if both are right, x - x_0 has the
variance σ_0² - σ². The sum of (x - x_0)²/σ_0² is a chi-square of Σ (1 - σ²/σ_0²) degrees of freedom.
Only b shows the width of a board's squares: see docs/theory/metric.md.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from lumigraph.errors import CalibrationError
from lumigraph.metric import geometry
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board

_DOUBTFUL, _ONE_OF_MANY, _WRONG = 3.0, 3.5, 5.0
"""Standard deviations from which on notes doubt b, and other values, and from which on a board is refused."""

_TOLD = 0.1
"""Part of a variance that pictures must take away for a value to be compared."""

_SHOWN = {
    "f": ("f", 1e3, "mm"), "b": ("b", 1e3, "mm"), "L/E": ("L/E", 1.0, ""), "1 + b/E": ("1 + b/E", 1.0, ""),
    "axis y": ("the axis' y", 1.0, "px"), "axis x": ("the axis' x", 1.0, "px"),
    "tilt y": ("the tilt along y", 1e3, "mrad"), "tilt x": ("the tilt along x", 1e3, "mrad"),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Known:
    """A value as it was known, and as it was adjusted, with standard deviations."""

    name: str
    before: float
    error: float
    after: float
    left: float

    @property
    def told(self) -> float:
        """Part of the variance that the pictures took away."""
        return 1 - min(1.0, (self.left / self.error) ** 2)

    @property
    def pull(self) -> float:
        """Way from what was known, in its standard deviations."""
        return (self.after - self.before) / self.error

    @property
    def deviations(self) -> float:
        """The same, in standard deviations of it; 0 where the pictures add nothing."""
        return self.pull / math.sqrt(self.told) if self.told > _TOLD else 0.0

    @property
    def doubtful(self) -> bool:
        """True if the value is too far from its known one."""
        return abs(self.deviations) > (_DOUBTFUL if self.name == "b" else _ONE_OF_MANY)

    @property
    def text(self) -> str:
        label, scale, unit = _SHOWN.get(self.name, (self.name, 1.0, ""))
        after, before, error = (f"{one * scale:.4g}" for one in (self.after, self.before, self.error))
        return f"{label} is {after} {unit} where {before} ± {error} was known".replace("  ", " ")


def disagreement(
    camera: MetricCamera, covariance: np.ndarray, nominal: Nominal, board: Board
) -> Iterator[str]:
    """Sentences on what was known and does not fit the pictures of a board.

    Raises
    ------
    CalibrationError
        A board that is not as wide as it is said to be, beyond doubt.
    """
    every = list(_all(camera, covariance, nominal))
    far = sorted((one for one in every if one.doubtful), key=lambda one: -abs(one.deviations))
    squares = next((one for one in every if one.name == "b"), None)
    if squares is None:
        yield (
            "nothing that was given shows whether the board's spacing is right: if it is wrong by a "
            "part, b, distances and sizes are, too. Give how far the lenslets are from the sensor "
            "(--lenslet-distance)"
        )
    elif squares in far:
        yield _spacing(squares, board)
    if far:
        total, freedom = sum(one.pull**2 for one in every), sum(one.told for one in every)
        chance = float(chi2.sf(total, freedom))
        told = "; ".join(f"{one.text} ({abs(one.deviations):.1f} deviations)" for one in far)
        yield (
            f"what was known of the camera hardly fits the pictures: {told}. Together: chi-square "
            f"{total:.1f} of {freedom:.1f} degrees of freedom, probability {chance:.1g}"
        )


def _all(camera: MetricCamera, covariance: np.ndarray, nominal: Nominal) -> Iterator[_Known]:
    numbers, errors = camera.numbers, np.sqrt(np.diag(covariance))
    for k, value, error in nominal.priors(len(camera.gains)):
        name = geometry.NAMES[k] if k < len(geometry.NAMES) else f"gain {k - len(geometry.NAMES)}"
        yield _Known(name, value, error, float(numbers[k]), float(errors[k]))
    if nominal.apart is not None:
        slope = geometry.slopes_of_pitch_ratio(numbers)
        left = math.sqrt(float(slope @ covariance @ slope))
        yield _Known("1 + b/E", *nominal.apart, float(geometry.pitch_ratio(numbers)[0]), left)


def _spacing(b: _Known, board: Board) -> str:
    """Remark on the width of squares that the pictures imply, or a refusal."""
    implied = board.spacing * b.after / b.before
    part = math.hypot(b.error / b.before, b.left / b.after)
    told = (
        f"{b.text}, {abs(b.deviations):.1f} deviations away: the pictures imply a spacing of the board of "
        f"{implied * 1e3:.3g} ± {1.96 * part * implied * 1e3:.2g} mm, {board.spacing * 1e3:.4g} mm given"
    )
    if abs(b.deviations) < _WRONG:
        return f"{told}. Measure the board, or give b if it is not known so well"
    raise CalibrationError(
        f"{told}. Measure the board and give its spacing (--board), or say how well b is known "
        "(--lenslet-distance-error)."
    )
