"""What reconstruction reaches of a bound or an expected error: in drawn noise, of one camera."""

import math
from dataclasses import dataclass, field

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError, LumigraphError
from lumigraph.information import reconstruction_trials, trials
from lumigraph.information.bounds import PARTS, checked_depths
from lumigraph.information.points import source, spread
from lumigraph.instruments.instrument import Instrument
from lumigraph.optimisation.goals import BOUNDS, ERRORS, Goal

ACCURACY = 1e-2
"""Of images of points."""

MOST = 10_000
"""Raw images at each depth."""


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
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
    reason
        Why there are none; empty where there are.
    """

    bound: float = math.nan
    reached: float = math.nan
    error: float = math.nan
    pictures: tuple[np.ndarray, ...] = field(default=())
    reason: str = ""


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


def tried(goal: Goal, camera: Instrument, first: float, places: int, how: tuple[int, int]) -> Tried:
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
            return _scenes(goal, camera, first, how)
        return _points(goal, camera, first, places, how)
    except LumigraphError as error:
        return Tried(reason=" ".join(str(error).split()))


def _scenes(goal: Goal, camera: Instrument, first: float, how: tuple[int, int]) -> Tried:
    draws, seed = how
    expected, light = goal.reconstructions(camera, first), goal.light_of(camera, first)
    found = reconstruction_trials(
        camera, goal.depths, goal.judged_scenes, light,
        draws=draws, volume=goal.name == ERRORS[1], rng=np.random.default_rng(seed),
    )  # fmt: skip
    shown = found.scene[0], found.reconstructed[0]
    return Tried(expected.value, found.rms, found.rms_error, shown)


def _points(goal: Goal, camera: Instrument, first: float, places: int, how: tuple[int, int]) -> Tried:
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
    return Tried(math.sqrt(np.mean(bounds)), reached, error)
