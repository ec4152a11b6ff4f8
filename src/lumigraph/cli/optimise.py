"""`lumigraph optimise`: the camera that reaches a goal best, of all that can be made."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import line, progress
from lumigraph.cli.deconvolve_options import depths as planes_of
from lumigraph.cli.options import Output, length
from lumigraph.cli.reporting import REPORTED, Reported
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.information import Scenes
    from lumigraph.instruments import Instrument
    from lumigraph.optimisation import Goal, Optimum
    from lumigraph.optimisation.tried import Tried

NAMES = {"start": "as given", "swept": "the best of the first values"}
"""Of what stands beside the best."""


@Parameter(name="*")
@dataclass(frozen=True)
class Aim:
    """What is made best.

    Parameters
    ----------
    goal
        depth, lateral or brightness: bounds of a point's errors over --depths. picture error: what the best
        linear reconstruction of scenes leaves, at each of --depths; volume error: the same with scenes at all
        depths at once. Or 'largest' or 'least' and a
        number's name: light caught, one that 'lumigraph design' prints, or a simulated one of 'lumigraph
        sweep', such as 'largest mtf@10/mm', the least over --depths.
    against
        A second goal, as --goal: prints and draws the cameras that no other beats in both. Searches for it
        may take as many --evaluations again.
    depths
        From the focused plane, such as '-5 mm:5 mm:5 mm'.
    photons
        Of a point, or of a sample of a scene in the mean, that enter the camera as it is given; others get
        theirs by their aperture.
    background
        Photons of even light on each pixel.
    places
        Of points at each depth; left out, as many as leave 1 % of the bound unknown, up to 16. More make
        it smoother over what varies, and take longer.
    scenes
        Pictures, whose contrast and power over frequency scenes have, for the errors of reconstruction;
        values count as light. Left out, 30 % of contrast and power 1/f².
    scene_pitch
        Of the pictures' pixels in the object, such as '10 um': half the finest period of scenes. Left out,
        half of what the camera as given resolves in focus.
    scene_samples
        Across a scene, which is as wide as so many pixels; the time grows with them.
    """

    goal: str = "depth"
    against: str | None = None
    depths: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    photons: Annotated[float, Parameter(allow_leading_hyphen=True)] = 10_000.0
    background: Annotated[float, Parameter(allow_leading_hyphen=True)] = 0.0
    places: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    scenes: Annotated[list[Path] | None, Parameter(consume_multiple=True, negative="")] = None
    scene_pitch: str | None = None
    scene_samples: Annotated[int, Parameter(allow_leading_hyphen=True)] = 32

    def read(self, given: "Instrument") -> "Goal":
        """The goal, of a camera to begin with; refuses nonsense."""
        from lumigraph.information import Light
        from lumigraph.optimisation import Goal

        planes = () if self.depths is None else planes_of("--depths", self.depths)
        light = Light(self.photons, self.background)
        goal = Goal.parse(self.goal, planes, light, self.places)
        return replace(goal, scenes=self._scenes(goal.ready(given).scenes))

    def _scenes(self, usual: "Scenes | None") -> "Scenes | None":
        """Those that pictures and numbers ask for; None where the goal needs none."""
        from lumigraph.information import Scenes
        from lumigraph.metric.planes import grey
        from lumigraph.preparation import read_raw

        asked = bool(self.scenes) or self.scene_pitch is not None or self.scene_samples != Aim.scene_samples
        if usual is None and asked:
            raise FormatError(
                f"--scenes, --scene-pitch and --scene-samples are for the goals 'picture error' and 'volume "
                f"error', not {self.goal!r}."
            )
        if usual is None:
            return None
        pitch = length("--scene-pitch", self.scene_pitch) or usual.pitch
        if self.scenes:
            pictures = [grey(read_raw(one, "picture of a scene").data) for one in self.scenes]
            return Scenes.of(pictures, pitch, self.scene_samples)
        return Scenes(pitch, self.scene_samples)


@Parameter(name="*")
@dataclass(frozen=True)
class How:
    """How it is looked for.

    Parameters
    ----------
    search
        local: downhill from the best of the first values. global: over all of the ranges, by differential
        evolution. gradient: along derivatives, for bounds of microscopes, and for bounds and the errors of
        scenes of paraxial cameras with lenslets; each step takes the time of some five cameras, however many
        keys vary. grid: the first values alone.
    evaluations
        Cameras at most, beyond the first values.
    seed
        Of --search global, and of the --trials.
    trials
        Raw images that are drawn with noise at each depth, before the camera as given and the best: points
        are fitted in them, or scenes reconstructed, and their errors stand beside what was expected. 0 for
        none; 200 are right for points, 8 for scenes.
    """

    search: Literal["local", "global", "gradient", "grid"] = "local"
    evaluations: Annotated[int, Parameter(allow_leading_hyphen=True)] = 200
    seed: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0
    trials: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0


def optimise(
    camera: str,
    /,
    *,
    vary: Annotated[list[str], Parameter(allow_leading_hyphen=True)],
    aim: Aim = Aim(),
    how: How = How(),
    output: Output,
    common: Reported = REPORTED,
) -> Result:
    """Look for the camera that reaches a goal best, within ranges and a stock, and write its file.

    All combinations of the first values are computed; then ranges are searched from the best of them. Killed
    at any time, the same line goes on where it was, to the same camera.

    Example: `lumigraph optimise lfm-fourier --vary "fourier_lens=60 mm:110 mm:3" --vary "lenslets.pitch=1 mm, 1.25 mm, 1.5 mm" --depths "-20 um:20 um:10 um" -o best.toml`

    Example: `lumigraph optimise camera.toml --vary "lenslets.magnification=0.2:0.6:5" --goal "largest mtf@10/mm" -o best.toml --report best.html`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one.
    vary
        A key of the camera file and its values, as in 'lumigraph sweep': 'first:last:count' is a range, of which
        so many values are tried first; values separated by commas are a stock. May be repeated.
    output
        Camera file of the best (.toml).
    """  # noqa: E501 - an example is one line
    from lumigraph import store
    from lumigraph.instruments import load_camera
    from lumigraph.optimisation import optimise as best_of

    common.check()
    files.check_output(output, (".toml",))
    given = load_camera(camera)
    goal = aim.read(given)
    with progress("optimise") as shown:
        found = best_of(
            given, vary, goal, against=aim.against, search=how.search, evaluations=how.evaluations,
            seed=how.seed, trials=how.trials, output=output, progress=shown,
            estimated=lambda seconds, count: line(_estimate(seconds, count)),
        )  # fmt: skip
    store.write_bytes(output, found.camera.to_toml().encode())
    return Result(
        "Optimum", "The camera that reaches a goal best, of all that can be made.", found,
        tuple(_lines(found)), found.quantities(), lambda: _figures(found, given), tuple(_notes(found)),
        (output,),
        {"best": found.best, "start": found.start, "swept": found.swept, "active": found.active,
         "cameras computed": found.rows, **({"front": found.front} if found.against else {})},
    )  # fmt: skip


def _estimate(seconds: float, count: int) -> str:
    from lumigraph.cluster.estimate import duration

    return f"{count} cameras to do at most: about {duration(seconds)}, if all take as long as the first"


def _lines(found: "Optimum") -> Iterator[str]:
    shown = {one.name: str(one) for one in found.quantities()}
    name = found.goal.name
    before, swept, best = (shown[f"{name}, {which}"] for which in ("as given", "best of the grid", "best"))
    yield f"{name}: {before} as given, {swept} the best of the first values, {best} the best"
    gains = (
        f"{found.gain(found.start):.1%} than as given",
        f"{found.gain(found.swept):.1%} than the first values",
    )
    yield f"better by {gains[0]}, by {gains[1]}"
    yield ", ".join(f"{key} = {value}" for key, value in _changed(found).items())
    for which, one in found.tried.items():
        yield _reached(found, which, one)
    if found.against is not None and found.front:
        yield f"{len(found.front)} cameras that no other beats in both goals, from {_both(found, 0)}"
        yield f"to {_both(found, -1)}"


def _reached(found: "Optimum", which: str, one: "Tried") -> str:
    """What reconstruction reaches of what was expected, in words."""
    words, told = NAMES.get(which, which), found.goal.told
    if one.reason:
        return f"{words}: no raw images were drawn, for {one.reason}"
    what, beside = _kinds(found)
    return (
        f"{words}: {what} err by {told(one.reached)}, within {told(one.error)} by their number, where the "
        f"{beside} is {told(one.bound)}"
    )


def _kinds(found: "Optimum") -> tuple[str, str]:
    """What is done with drawn raw images, and what stands beside it."""
    if found.goal.scenes is not None:
        return "reconstructions of drawn scenes", "expected error"
    return f"fits ({found.goal.name}) in drawn raw images", "bound of the same points"


def _both(found: "Optimum", k: int) -> str:
    """Values of both goals of a camera of the front, and what it has of its own."""
    row, goals = found.front[k], (found.goal, found.against)
    reached = " with ".join(f"{one.name} {one.told(row[one.name])}" for one in goals if one)
    own = ", ".join(f"{key} = {row[key]}" for key in _changed(found) if key in row)
    return f"{reached} ({own or 'as given'})"


def _changed(found: "Optimum") -> dict[str, Any]:
    """What the best has of its own, without what follows from it."""
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
    """What is known of the best anew, or how well."""
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
    """Of the best, and of those before it."""
    names = {"best": "", **{which: f"{words} " for which, words in NAMES.items()}}
    some = {words: found.checked[which].between for which, words in names.items() if which in found.checked}
    return ", ".join(f"{words}{found.goal.told(value)}" for words, value in some.items())


def _figures(found: "Optimum", given: "Instrument") -> Iterator[Figure]:
    yield Figure(_before_and_after(found, given), section="Before and after")
    yield from _trials(found)
    yield from _over_depth(found)
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
    some = {which: one for which, one in found.tried.items() if not one.reason}
    if not some:
        return
    (what, beside), told = _kinds(found), found.goal.told
    rows: list[tuple[str, ...]] = [("", beside, f"{what}, rms", "standard error")]
    for which, one in some.items():
        rows.append((NAMES.get(which, which), told(one.bound), told(one.reached), told(one.error)))
    yield Figure(rows, section="Before and after")
    pictures = {NAMES.get(which, which): one.pictures for which, one in some.items() if one.pictures}
    if pictures:
        from lumigraph import plots

        scene = next(iter(pictures.values()))[0]
        drawn = plots.images([(scene, "scene"), *((one[1], words) for words, one in pictures.items())])
        yield Figure(drawn, "A drawn scene and its reconstructions at the first depth.", "Before and after")


def _over_depth(found: "Optimum") -> Iterator[Figure]:
    """The bound over depth, before and after."""
    from lumigraph import plots
    from lumigraph.optimisation.goals import BOUNDS

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
    from lumigraph.optimisation.goals import BOUNDS
    from lumigraph.plots.axes import length_unit

    if BOUNDS.get(goal.name) != "m":
        return values, goal.name
    size, unit = length_unit(max(values))
    return [one / size for one in values], f"{goal.name} bound [{unit}]"


def _search(found: "Optimum") -> Iterator[Figure]:
    """The best so far over the cameras in turn."""
    from lumigraph import plots
    from lumigraph.optimisation.goals import BOUNDS
    from lumigraph.plots.axes import length_unit

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
