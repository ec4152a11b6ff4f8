"""Errors of reconstruction in drawn noise, beside a bound or an expected error, for one camera."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError, LumigraphError
from lumigraph.instruments.instrument import Instrument
from lumigraph.studies.information import reconstruction_trials, trials, unknown_depth_trials
from lumigraph.studies.information.bounds import PARTS, checked_depths
from lumigraph.studies.information.points import source, spread
from lumigraph.studies.optimisation.goals import BOUNDS, ERRORS, Goal

ACCURACY = 1e-2
"""Accuracy of images of points."""

MOST = 10_000
"""Raw images at each depth."""

HELD_OUT = 16
"""Scenes of held-out pictures, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnErrors:
    """Errors in drawn raw images, beside what was to be expected of the same.

    Parameters
    ----------
    bound
        Of a point's fits at the places that were drawn, or the expected error of reconstructions, rms over
        depths.
    reached
        The errors' rms over draws and depths.
    error
        Standard error of that, by the number of draws.
    pictures
        Of reconstructed scenes: the first scene that was drawn, and what was made of it (n, n), at the first
        depth.
    squares
        Of each reconstructed scene (draws,): its error's square, in the mean over depths.
    reason
        Why there are none; empty where there are.
    """

    bound: float = math.nan
    reached: float = math.nan
    error: float = math.nan
    pictures: tuple[np.ndarray, ...] = field(default=())
    squares: np.ndarray = field(default_factory=lambda: np.zeros(0))
    reason: str = ""

    def gain(self, beside: "DrawnErrors") -> tuple[float, float]:
        """Relative gain of the rms over that of the same scenes otherwise, and its standard error."""
        ratio = self.reached / beside.reached
        off = (self.squares - ratio**2 * beside.squares) / beside.reached**2
        return 1 - ratio, float(off.std(ddof=1)) / math.sqrt(len(off)) / 2 / ratio


def check(goal: Goal, draws: int) -> None:
    """Refuse draws that are too many, or that a goal has no use for.

    Raises
    ------
    GeometryError
        They are.
    """
    if checks.whole("trials", draws, 0) > MOST:
        raise GeometryError(f"trials are {draws} but must be at most {MOST}.")
    if draws == 1:
        raise GeometryError("trials are 1 but an error needs two at least. Give 0 for none.")
    if draws and not goal.judged:
        raise GeometryError(f"trials are of {', '.join((*BOUNDS, *ERRORS))}, not of {goal.name!r}.")


def tried(goal: Goal, camera: Instrument, first: float, places: int, how: tuple[int, int]) -> DrawnErrors:
    """Errors of fits to points, or of reconstructed scenes.

    Parameters
    ----------
    goal, camera, first
        What is reached, by which camera; `first` as of `Goal.values`.
    places
        At which the bound was searched: points stand at the next of the sequence, one at each depth.
    how
        Raw images at each depth; seed.
    """
    try:
        if goal.name in ERRORS:
            return _scenes(goal, camera, first, *how)
        return _points(goal, camera, first, places, how)
    except LumigraphError as error:
        return DrawnErrors(reason=" ".join(str(error).split()))


def held_out_squares(goal: Goal, pictures: Sequence[Any]) -> list[np.ndarray]:
    """Scenes (n, n) of pictures, as the goal's scenes are wide.

    Raises
    ------
    GeometryError
        Pictures for a goal without scenes.
    FormatError
        A picture that has no such square.
    """
    if not len(pictures):
        return []
    if goal.name not in ERRORS:
        raise GeometryError(f"held-out pictures are for {', '.join(ERRORS)}, not for {goal.name!r}.")
    return goal.judged_scenes.squares(pictures, HELD_OUT)


def reached(
    goal: Goal, camera: Instrument, first: float, squares: Sequence[np.ndarray], seed: int
) -> DrawnErrors:
    """Errors of scenes (n, n) that took no part in a search, reconstructed as if they were those of the goal.

    Parameters
    ----------
    goal, camera, first
        As of `tried`.
    squares
        The scenes.
    seed
        Of the noise.
    """
    try:
        return _scenes(goal, camera, first, squares, seed)
    except LumigraphError as error:
        return DrawnErrors(reason=" ".join(str(error).split()))


def _scenes(
    goal: Goal, camera: Instrument, first: float, draws: int | Sequence[np.ndarray], seed: int
) -> DrawnErrors:
    expected, light = goal.reconstructions(camera, first), goal.light_of(camera, first)
    volume, rng = {"volume": goal.name == ERRORS[1]}, np.random.default_rng(seed)
    if goal.name == ERRORS[2]:
        found = unknown_depth_trials(camera, goal.depths, goal.judged_scenes, light, draws=draws, rng=rng)
    else:
        found = reconstruction_trials(
            camera, goal.depths, goal.judged_scenes, light, draws=draws, **volume, rng=rng
        )
    shown = found.scene[0], found.reconstructed[0]
    return DrawnErrors(expected.value, found.rms, found.rms_error, shown, np.mean(found.errors**2, axis=1))


def _points(goal: Goal, camera: Instrument, first: float, places: int, how: tuple[int, int]) -> DrawnErrors:
    draws, seed = how
    depths, light, part = checked_depths(goal.depths), goal.light_of(camera, first), PARTS[goal.name]
    cell = source(camera, depths, ACCURACY).cell
    bounds, squares = [], []
    for k, dz in enumerate(depths.tolist()):
        (at,) = spread(cell(dz), range(places + k, places + k + 1))
        rng = np.random.default_rng([seed, k])
        found = trials(camera, (*at.tolist(), dz), light, draws=draws, accuracy=ACCURACY, rng=rng)
        bounds.append(found.bounds[part] ** 2)
        squares.append((found.errors[:, part] ** 2).mean(1))
    reached = math.sqrt(np.mean(squares))
    over = np.mean(squares, axis=0)  # of draws
    error = float(over.std(ddof=1)) / math.sqrt(draws) / 2 / reached
    return DrawnErrors(math.sqrt(np.mean(bounds)), reached, error)
