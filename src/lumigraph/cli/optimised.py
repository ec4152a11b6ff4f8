"""Report of `lumigraph optimise` on its result."""

import math
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph.core.result import Figure, Quantity, Result

if TYPE_CHECKING:
    import numpy as np

    from lumigraph.instruments import Instrument
    from lumigraph.studies.optimisation import Goal
    from lumigraph.studies.optimisation.optimise import Optimum
    from lumigraph.studies.optimisation.tried import DrawnErrors

NAMES = {"start": "as given", "swept": "the best of the first values"}
"""Names of the cameras beside the best."""


def result(found: "Optimum", given: "Instrument", output: Path) -> Result:
    """Before and after, in words, numbers and pictures."""
    return Result(
        "Optimum", "The camera that reaches a goal best, of all that can be made.", found,
        tuple(_lines(found)), found.quantities(), lambda: _figures(found, given), tuple(_notes(found)),
        (output,),
        {"best": found.best, "start": found.start, "swept": found.swept, "active": found.active,
         "cameras computed": found.rows, **({"front": found.front} if found.against else {})},
    )  # fmt: skip


def _lines(found: "Optimum") -> Iterator[str]:
    before, swept, best = map(partial(_told, found.goal), found.quantities()[:3])
    yield f"{found.goal.name}: {before} as given, {swept} the best of the first values, {best} the best"
    given, first = (f"{100 * found.gain(row):z.1f}%" for row in (found.start, found.swept))
    yield f"better by {given} than as given, by {first} than the first values"
    yield ", ".join(f"{key} = {value}" for key, value in _changed(found).items())
    for which, one in found.tried.items():
        yield _reached(found, which, one)
    yield from _held_out(found)
    if found.against is not None and found.front:
        yield f"{len(found.front)} cameras that no other beats in both goals, from {_both(found, 0)}"
        yield f"to {_both(found, -1)}"


def _told(goal: "Goal", one: Quantity) -> str:
    """A value of the goal and its interval, in words."""
    if one.value is None:
        return str(one)
    within = "" if one.interval is None else f" ({' to '.join(map(goal.told, one.interval))})"
    return f"{goal.told(one.value)}{within}"


def _reached(found: "Optimum", which: str, one: "DrawnErrors") -> str:
    """Error that reconstruction reaches, beside the expected one, in words."""
    words, told = NAMES.get(which, which), found.goal.told
    if one.reason:
        return f"{words}: no raw images were drawn, for {one.reason}"
    what, beside = _kinds(found)
    return (
        f"{words}: {what} err by {told(one.reached)}, within {_off(found, one)} by their number, where the "
        f"{beside} is {told(one.bound)}"
    )


def _off(found: "Optimum", one: "DrawnErrors") -> str:
    """A standard error, in two digits where it has no unit."""
    from lumigraph.studies.optimisation.goals import ERRORS

    return f"{one.error:.2g}" if found.goal.name in ERRORS else found.goal.told(one.error)


def _held_out(found: "Optimum") -> Iterator[str]:
    """Errors of held-out scenes, in words, and the gain of the best camera."""
    best = found.held_out.get("best")
    for which, one in found.held_out.items():
        words = NAMES.get(which, which)
        if best is None or one.reason or best.reason:
            yield f"{words}: held-out scenes were not drawn, for {one.reason or 'those of the best were not'}"
            continue
        by = "" if one is best else "; the best is better by {:.1%} ± {:.1%}".format(*best.gain(one))
        yield (
            f"{words}: {len(one.squares)} held-out scenes err by {found.goal.told(one.reached)}, within "
            f"{_off(found, one)} by their number{by}"
        )


def _kinds(found: "Optimum") -> tuple[str, str]:
    """Words for the use of drawn raw images, and for the value beside it."""
    if found.goal.scenes is not None:
        return "reconstructions of drawn scenes", "expected error"
    return f"fits ({found.goal.name}) in drawn raw images", "bound of the same points"


def _both(found: "Optimum", k: int) -> str:
    """Values of both goals of a camera of the front, and its varied values."""
    row, goals = found.front[k], (found.goal, found.against)
    reached = " with ".join(f"{one.name} {one.told(row[one.name])}" for one in goals if one)
    own = ", ".join(f"{key} = {row[key]}" for key in _changed(found) if key in row)
    return f"{reached} ({own or 'as given'})"


def _changed(found: "Optimum") -> dict[str, Any]:
    """Varied values of the best camera, without the numbers that follow from them."""
    return {key: value for key, value in found.best.items() if key not in found.start}


def _notes(found: "Optimum") -> Iterator[str]:
    if "best" in found.checked:
        yield _elsewhere(found)
        if math.isfinite(found.checked["best"].between):
            yield f"half-way between the depths the best {found.goal.label} is {_between(found)}"
    if found.gain(found.start) < 0:
        yield "the camera as given is better than all of these: give other ranges"
    if found.active:
        ends = ", ".join(f"{key} = {value}" for key, value in found.active.items())
        yield f"at an end of its range: {ends}; a wider range may give a better camera"
    bad = [row["error"] for row in found.rows if "error" in row]
    if bad:
        yield f"{len(bad)} of {len(found.rows)} cameras cannot be, such as: {bad[0]}"


def _elsewhere(found: "Optimum") -> str:
    """Error of the best camera in an independent check, or its uncertainty."""
    best, error, *_ = found.checked["best"]
    if found.goal.scenes is not None:
        scenes = found.goal.scenes
        kind = "their pictures'" if scenes.spectrum else "1/f²"
        return (
            f"scenes are {scenes.samples} x {scenes.samples} samples {scenes.pitch * 1e6:.4g} µm apart, with "
            f"{scenes.contrast:.1%} of contrast and {kind} power; the error is known within {error:.1%}"
        )
    beside = ", ".join(
        f"{words} {found.goal.told(found.checked[which].value)}"
        for which, words in NAMES.items()
        if which in found.checked
    )
    return (
        "at other places than the search's, by two steps where derivatives are not exact, the best bound "
        f"is {found.goal.told(best)} within {error:.1%} "
        f"(searched: {found.goal.told(found.best[found.goal.name])}), {beside}"
    )


def _between(found: "Optimum") -> str:
    """Errors half-way between the depths, for the best camera and for those before it."""
    names = {"best": "", **{which: f"{words} " for which, words in NAMES.items()}}
    some = {words: found.checked[which].between for which, words in names.items() if which in found.checked}
    return ", ".join(f"{words}{found.goal.told(value)}" for words, value in some.items())


def _figures(found: "Optimum", given: "Instrument") -> Iterator[Figure]:
    yield Figure(_before_and_after(found, given), section="Before and after")
    yield from _over_depth(found)  # before pictures, whose width would leave it a column of theirs
    yield from _trials(found)
    yield from _front(found, given)
    yield from _search(found)


def _before_and_after(found: "Optimum", given: "Instrument") -> list[tuple[str, ...]]:
    """Values that vary and the goal, of the camera as given, of the best first one and of the best."""
    from lumigraph.instruments.varied import value

    changes, goal = _changed(found), found.goal
    own = {key: value(given, key) for key in changes}
    rows: list[tuple[str, ...]] = [("", *changes, found.goal.label)]
    for name, some in (("as given", found.start), ("first values", found.swept), ("best", found.best)):
        values = (some.get(key, own[key]) for key in changes)
        reached = some.get(goal.name)
        told = "not known" if reached is None else goal.told(reached)
        rows.append((name, *("-" if one is None else str(one) for one in values), told))
    return rows


def _trials(found: "Optimum") -> Iterator[Figure]:
    """Bound or expected error against what reconstruction reaches, before and after."""
    yield from _of_held_out(found)
    some = {which: one for which, one in found.tried.items() if not one.reason}
    if not some:
        return
    (what, beside), told = _kinds(found), found.goal.told
    rows: list[tuple[str, ...]] = [("", beside, f"{what}, rms", "standard error")]
    for which, one in some.items():
        rows.append((NAMES.get(which, which), told(one.bound), told(one.reached), _off(found, one)))
    yield Figure(rows, section="Before and after")
    pictures = {NAMES.get(which, which): one.pictures for which, one in some.items() if one.pictures}
    if pictures:
        yield _pictures(found, "A drawn scene", pictures)


def _of_held_out(found: "Optimum") -> Iterator[Figure]:
    """Figure of the errors of held-out scenes, and the first of them."""
    some = {NAMES.get(which, which): one for which, one in found.held_out.items() if not one.reason}
    if not some:
        return
    told = found.goal.told
    rows: list[tuple[str, ...]] = [("", "error of held-out scenes, rms", "standard error")]
    rows.extend((words, told(one.reached), _off(found, one)) for words, one in some.items())
    yield Figure(rows, section="Before and after")
    yield _pictures(found, "A held-out scene", {words: one.pictures for words, one in some.items()})


def _pictures(found: "Optimum", what: str, pictures: "Mapping[str, tuple[np.ndarray, ...]]") -> Figure:
    """A scene and its reconstructions, from black to white alike."""
    from lumigraph import plots
    from lumigraph.core.grid import Grid

    scene, pitch = next(iter(pictures.values()))[0], found.goal.judged_scenes.pitch
    some = [(scene, "scene"), *((one[1], words) for words, one in pictures.items())]
    drawn = plots.images(
        some, columns=len(some), grid=Grid(scene.shape, (pitch, pitch)), limits=(scene.min(), scene.max())
    )
    return Figure(drawn, f"{what} and its reconstructions at the first depth.", "Before and after")


def _over_depth(found: "Optimum") -> Iterator[Figure]:
    """The bound over depth, before and after."""
    from lumigraph import plots
    from lumigraph.studies.optimisation.goals import BOUNDS

    if "best" not in found.checked or len(found.goal.depths) < 2:
        return
    shown = {"as given": "start", "the best of the first values": "swept", "best": "best"}
    curves = {
        words: found.checked[which].over_depths for words, which in shown.items() if which in found.checked
    }
    lengths = BOUNDS.get(found.goal.name) == "m"
    drawn = plots.over_depth(found.goal.depths, curves, found.goal.label, lengths=lengths)
    said = "At other places than those of the search." if found.goal.name in BOUNDS else ""
    yield Figure(drawn, said, "Before and after")


def _front(found: "Optimum", given: "Instrument") -> Iterator[Figure]:
    """Cameras that no other beats in both goals."""
    from lumigraph import plots
    from lumigraph.instruments.varied import value

    other = found.against
    if other is None or not found.front:
        return
    goals, keys = (found.goal, other), list(_changed(found))
    rows: list[tuple[str, ...]] = [(*(one.name for one in goals), *keys)]
    for row in found.front:
        own = (row.get(key, value(given, key)) for key in keys)
        rows.append((*(one.told(row[one.name]) for one in goals), *map(str, own)))
    yield Figure(rows, section="Of two goals")
    if len(found.front) > 1:
        (x, xlabel), (y, ylabel) = (_scaled(one, [row[one.name] for row in found.front]) for one in goals)
        drawn = plots.curves(x, {"no other is better in both": y}, xlabel=xlabel, ylabel=ylabel)
        yield Figure(drawn, "Where they were searched; not judged at other places.", "Of two goals")


def _scaled(goal: "Goal", values: list[float]) -> tuple[list[float], str]:
    """Values in a unit that suits them, and the axis' label."""
    from lumigraph.plots.axes import length_unit
    from lumigraph.studies.optimisation.goals import BOUNDS

    if BOUNDS.get(goal.name) != "m":
        return values, goal.name
    size, unit = length_unit(max(values))
    return [one / size for one in values], f"{goal.name} bound [{unit}]"


def _search(found: "Optimum") -> Iterator[Figure]:
    """Figure of the best value so far over the cameras in turn."""
    from lumigraph import plots
    from lumigraph.plots.axes import length_unit
    from lumigraph.studies.optimisation.goals import BOUNDS

    costs = [found.goal.cost(row) for row in found.rows]
    so_far = [min(costs[: k + 1]) for k in range(len(costs))]
    if not all(map(math.isfinite, so_far)):
        return
    sign = -1.0 if found.goal.largest else 1.0
    lengths = BOUNDS.get(found.goal.name) == "m"
    size, unit = length_unit(max(so_far)) if lengths else (1.0, "")
    curve = {"best so far": ([float(k) for k in range(len(so_far))], [sign * cost / size for cost in so_far])}
    label = f"{found.goal.label} [{unit}]" if unit else found.goal.label
    drawn = plots.curves([], curve, xlabel="cameras computed", ylabel=label)
    yield Figure(drawn, "The best camera so far; the first one is the camera as given.", "Search")
