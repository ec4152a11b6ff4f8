"""`optimise`: the best camera within what can be made."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, get_args

from lumigraph.core import checks
from lumigraph.core.progress import Progress, Stage
from lumigraph.core.result import Quantity
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.instruments import load_camera
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.varied import changed
from lumigraph.studies.information.points import collected
from lumigraph.studies.optimisation.evaluations import ERROR, Evaluations, noted
from lumigraph.studies.optimisation.front import front, trace
from lumigraph.studies.optimisation.goals import BOUNDS, PLACES, Goal, JudgedBound
from lumigraph.studies.optimisation.search import Search, grid, refined
from lumigraph.studies.optimisation.space import Space
from lumigraph.studies.optimisation.tried import DrawnErrors, held_out_squares, reached, tried
from lumigraph.studies.optimisation.tried import check as check_trials

MOST = 100_000
"""Evaluations."""

LUCK = 0.03
"""Part of a bound, better where it was searched than at other places or depths, that is warned of."""

BEFORE = {"start": "the camera as given", "swept": "the best of the first values"}
"""Cameras beside the best, in words."""


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """The best camera that a search found, beside the one that was given and the best of a grid.

    Parameters
    ----------
    goal
        What was made best.
    camera
        The best.
    start, swept, best
        Values of the camera as given, of the best of the grid, and of the best of all.
    active
        Values of the best at an end of their range, by key: another range would give a better camera.
    rows
        All cameras, in the order of the search; impossible ones have an "error".
    checked
        Of bounds and errors of reconstruction: by "start", "swept" and "best", the bound at other places than
        those of the search, by derivatives of two steps where they are not exact, its relative error, at
        least what it differs by from the searched one, the bound over depth, and half-way between the depths.
        Empty of other goals.
    against
        The goal that was weighed against it; None for none.
    front
        With two goals: the rows that no other beats in both, from the best in the first on.
    tried
        By "start" and "best", errors of fits or reconstructions in drawn raw images; empty without trials.
    held_out
        By "start", "swept" and "best", errors of scenes that took no part in the search; empty without any.
    """

    goal: Goal
    camera: Instrument
    start: dict[str, Any]
    swept: dict[str, Any]
    best: dict[str, Any]
    active: dict[str, Any]
    rows: list[dict[str, Any]]
    checked: Mapping[str, JudgedBound] = field(default_factory=dict)
    against: Goal | None = None
    front: list[dict[str, Any]] = field(default_factory=list)
    tried: Mapping[str, DrawnErrors] = field(default_factory=dict)
    held_out: Mapping[str, DrawnErrors] = field(default_factory=dict)

    __repr__ = brief

    def gain(self, beside: Mapping[str, Any]) -> float:
        """Relative gain of the goal over other values; NaN where those have none."""
        other = beside.get(self.goal.name, float("nan"))
        change = (self.best[self.goal.name] - other) / abs(other)
        return change if self.goal.largest else -change

    def quantities(self) -> tuple[Quantity, ...]:
        """The goal before, of the best of the grid, and of the best."""
        name, unit = self.goal.name, BOUNDS.get(self.goal.name, "")
        best, error, *_ = self.checked.get("best", (self.best[name], 0.0))
        between = (best * (1 - error), best * (1 + error)) if error else None
        return (
            Quantity(f"{name}, as given", self.start.get(name), unit),
            Quantity(f"{name}, best of the grid", self.swept[name], unit),
            Quantity(f"{name}, best", best, unit, between),
            Quantity("cameras", len(self.rows)),
            Quantity("impossible", sum(ERROR in row for row in self.rows)),
        )  # fmt: skip


def optimise(
    instrument: Instrument | str | PathLike[str],
    vary: Mapping[str, str] | Sequence[str],
    goal: Goal | str = "depth",
    *,
    depths: Sequence[float] = (),
    against: Goal | str | None = None,
    search: Search = "local",
    evaluations: int = 200,
    seed: int = 0,
    trials: int = 0,
    held_out: Sequence[Any] = (),
    output: str | PathLike[str] | None = None,
    progress: Progress | None = None,
    estimated: Callable[[float, int], None] | None = None,
) -> Optimum:
    """The camera that reaches a goal best, of those that ranges and a stock allow.

    All combinations of the first values are computed. From the best of them a simplex goes downhill
    ("local"), and from the camera as given where it lies within the ranges; or a population by differential
    evolution looks over all of the ranges ("global"). Bounds of microscopes and cameras, and errors of
    scenes of many, have gradients ("gradient"): each step takes the time of some five cameras, however many
    keys vary, such as the places of single lenslets. Values of a stock stay as the combination has them.
    What no camera can be is left out, with its reason. Bounds are judged at other places than those of the
    search, for where pixels are coarse a search finds the places' luck, and half-way between its depths,
    for lenslets may be sharp at these alone.

    Parameters
    ----------
    instrument
        A camera, its file, or a name of the catalogue.
    vary
        By keys of the camera file: "0.3:0.6:x4" or "4 mm:6 mm:1 mm" is a range, whose values are tried
        first; "100 um, 150 um" a stock.
    goal
        `Goal`, or its text: "depth" (default), "lateral", "brightness", "picture error", "largest light
        caught", "largest views per axis", "largest mtf@10/mm", ...
    depths
        Of the volume, for a goal that is a text [m].
    against
        A second goal: after the search for the first, others look for the best of it and between the two,
        with as many evaluations again. See `Optimum.front`; its bounds are not judged at other places.
    search
        "local", "global", "gradient", or "grid" for none but the first values.
    evaluations
        Cameras at most, beyond the grid.
    seed
        Of the population, and of the trials.
    trials
        Raw images that are drawn with noise at each depth, before the camera as given and the best: their
        points are fitted, or their scenes reconstructed, to set the errors beside what was expected.
    held_out
        Pictures (ny, nx) of scenes that the search does not see, of the scenes' pitch, for the errors of
        reconstruction: 16 squares of them at most are seen with noise by the camera as given, the best of the
        grid and the best, and reconstructed as if they were the goal's scenes.
    output
        File, beside which each camera is noted as it is done. Safe to interrupt: the same call resumes, to
        the same result. None for nowhere. The best camera is not written.
    progress
        Called as ``progress(fraction)``.
    estimated
        Called with the seconds that the rest may take, and how many cameras they are, after the first.

    Raises
    ------
    FormatError
        An unknown key or number, a range that does not go up, an output of another search.
    GeometryError
        A goal that the instrument does not have, or none of the first values gives a camera. Gradients of
        another instrument or goal than bounds of those, by its sensor, or with a second goal.

    Warns
    -----
    SamplingWarning
        At other places, or half-way between the depths, the best bound is larger by more than 3 %, or others
        are better than it. Held-out scenes are reconstructed as well, or better, before others.

    Examples
    --------
    >>> import lumigraph as lg
    >>> vary = {"fourier_lens": "60 mm:90 mm:x2"}
    >>> found = lg.optimise("lfm-fourier", vary, depths=[-1e-5, 1e-5], evaluations=4)
    >>> found.best["depth"] <= found.swept["depth"]
    True
    """
    start = instrument if isinstance(instrument, Instrument) else load_camera(instrument)
    aim = Goal.parse(goal, depths) if isinstance(goal, str) else goal
    aim = aim.ready(start)
    check_trials(aim, trials)
    squares = held_out_squares(aim, held_out)
    other = replace(aim, **_other(against)) if isinstance(against, str) else against
    other = None if other is None else other.ready(start)
    checks.choice("search", search, get_args(Search))
    most = checks.whole("evaluations", evaluations, 0)
    if most > MOST:
        raise GeometryError(f"evaluations are {most} but must be at most {MOST}.")
    checks.whole("seed", seed, 0)
    space = Space.of(vary)
    items = space.combinations()
    _check(start, items[0])
    aim.check(start)
    if other is not None:
        other.check(start)
    if search == "gradient":
        aim.check_slopes(start)
        if other is not None:
            raise GeometryError("search 'gradient' is for one goal. Use 'local' with against.")
    beyond = most if space.ranges and search != "grid" else 0
    total = 1 + len(items) + beyond * (1 if other is None else 2)
    what = {
        "camera": start.to_toml(), "values": space.grid, "ranges": list(space.ranges), "goal": asdict(aim),
        "search": [search, seed], **({} if other is None else {"against": asdict(other)}),
    }  # fmt: skip

    def done(count: int) -> None:
        if estimated is not None and count == 1 and cameras.computed:
            estimated(cameras.seconds * (total - 1), total - 1)
        if progress is not None:
            progress(Stage(min(count / total, 1.0), f"camera {count} of at most {total}"))

    with noted(None if output is None else Path(output), what) as ledger:
        cameras = Evaluations(start, aim, collected(start), ledger, done, list(space.grid), other)
        cameras.row({})
        swept = grid(cameras, space)
        if swept is None:
            reason = cameras.rows[1].get(ERROR, f"{aim.name} is not known of it")
            raise GeometryError(f"none of the first {len(items)} cameras is possible, such as: {reason}")
        best = _refined(cameras, space, swept, (search, most, seed))
        if other is not None and beyond:
            trace(cameras, space, (aim, other), (search, most, seed))
        given, first, last = (dict(cameras.row(item)) for item in ({}, swept, best))
    found = Optimum(
        aim, changed(start, best), given, first, last, space.active(best), cameras.rows,
        _elsewhere(cameras, {"start": {}, "swept": swept, "best": best}),
        other, [] if other is None else front(cameras.rows, (aim, other)),
        _tried(cameras, {"start": {}, "best": best}, (trials, seed)),
        _reached(cameras, {"start": {}, "swept": swept, "best": best}, squares, seed),
    )  # fmt: skip
    _warn_of_luck(found)
    _warn_of_held_out(found)
    return found


def _other(text: str) -> dict[str, Any]:
    """Name and direction of a second goal."""
    found = Goal.parse(text)
    return {"name": found.name, "largest": found.largest}


def _refined(
    cameras: Evaluations, space: Space, swept: dict[str, Any], how: tuple[Search, int, int]
) -> dict[str, Any]:
    """The best that is found from the best of the grid, and from the camera as given where it lies within."""
    search, most, seed = how
    begun, own = len(cameras.rows), space.own(cameras.start)
    starts = [swept]
    if own is not None and own != swept and search != "grid" and space.ranges and most > 0:
        starts = sorted([swept, own], key=cameras.cost)
    if search == "global":  # goes everywhere from one
        starts = starts[:1]
    found, slopes = [], partial(cameras.slopes, space=space) if search == "gradient" else None
    for k, item in enumerate(starts):
        left = most - (len(cameras.rows) - begun)
        found.append(refined(cameras, space, item, (search, left // (len(starts) - k), seed), slopes))
    return min(found, key=cameras.cost)


def _elsewhere(cameras: Evaluations, items: Mapping[str, Mapping[str, Any]]) -> dict[str, JudgedBound]:
    """Bounds of some items at places where they were not searched."""
    if not cameras.goal.judged:
        return {}
    known: dict[str, JudgedBound] = {}
    for which, item in items.items():
        row = cameras.row(item)
        same = next((one for one in known if items[one] == item), None)
        if same is not None:
            known[which] = known[same]
        elif math.isfinite(cameras.goal.cost(row)):
            known[which] = cameras.goal.checked(changed(cameras.start, item), cameras.first, row)
    return known


def _tried(
    cameras: Evaluations, items: Mapping[str, Mapping[str, Any]], how: tuple[int, int]
) -> dict[str, DrawnErrors]:
    """Errors that reconstruction reaches before some items."""
    goal, found = cameras.goal, {}
    for which, item in items.items() if how[0] else ():
        row = cameras.row(item)
        if math.isfinite(goal.cost(row)):
            camera = changed(cameras.start, item)
            found[which] = tried(goal, camera, cameras.first, int(row.get(PLACES, 0)), how)
    return found


def _reached(
    cameras: Evaluations, items: Mapping[str, Mapping[str, Any]], squares: Sequence[Any], seed: int
) -> dict[str, DrawnErrors]:
    """Errors of held-out scenes before some items."""
    found: dict[str, DrawnErrors] = {}
    for which, item in items.items() if squares else ():
        same = next((one for one in found if items[one] == item), None)
        if same is not None:
            found[which] = found[same]
        elif math.isfinite(cameras.cost(item)):
            camera = changed(cameras.start, item)
            found[which] = reached(cameras.goal, camera, cameras.first, squares, seed)
    return found


def _warn_of_held_out(found: Optimum) -> None:
    """Warn where other cameras reconstruct held-out scenes as well as the best."""
    best, told = found.held_out.get("best", DrawnErrors(reason="there are none")), found.goal.told
    for which, words in BEFORE.items():
        other = found.held_out.get(which, best)
        if other is best or other.reason or best.reason:
            continue
        gain, error = best.gain(other)
        if not gain > 2 * error:
            warnings.warn(
                f"{words} reconstructs held-out scenes within {told(other.reached)}, the best within "
                f"{told(best.reached)}: a gain of {gain:.1%} ± {error:.1%}, no more than chance, where the "
                f"search has {found.gain(getattr(found, which)):.1%}. Search with scenes more like those, or "
                "with more light.",
                SamplingWarning,
                stacklevel=3,
            )


def _warn_of_luck(found: Optimum) -> None:
    """Warn where a bound owes its value to the places or depths at which it was searched."""
    if "best" not in found.checked:
        return
    name, told, label = found.goal.name, found.goal.told, found.goal.label
    here, there = found.best[name], found.checked["best"].value
    said = list(_luck_of_depths(found))
    if there > here * (1 + LUCK):
        said.append(
            f"the {label} of the best is {told(here)} at the {found.best[PLACES]} places a depth "
            f"where it was searched, but {told(there)} at others: {there / here - 1:.1%} are chance"
        )
    for which, words in BEFORE.items():
        other = found.checked[which].value if which in found.checked else math.inf
        if other < there and found.gain(getattr(found, which)) > 0:
            said.append(
                f"{words} has a {label} of {told(other)} at other places, the best {told(there)}: "
                "it is better only where it was searched"
            )
    for words in said:
        more = "depths" if "half-way" in words else "places"
        warnings.warn(f"{words}. Search again with more {more}.", SamplingWarning, stacklevel=3)


def _luck_of_depths(found: Optimum) -> Iterator[str]:
    """Warnings where a bound is worse half-way between its depths, ends left out, or others are better."""
    label, told, best = found.goal.label, found.goal.told, found.checked["best"]
    both = math.hypot(best.value, best.between)
    if best.between > best.value * (1 + LUCK):
        yield (
            f"the {label} of the best is {told(best.value)} over the depths where it was searched, but "
            f"{told(best.between)} half-way between them"
        )
    for which, words in BEFORE.items():
        other = found.checked.get(which, best)
        if other.between < best.between and math.hypot(other.value, other.between) < both:
            yield (
                f"half-way between the depths {words} has a {label} of {told(other.between)}, the best "
                f"{told(best.between)}: it is better only where it was searched"
            )


def _check(start: Instrument, item: Mapping[str, Any]) -> None:
    """Refuse an unknown key before any work; values that no camera has are left to the search."""
    try:
        changed(start, item)
    except GeometryError:
        return
