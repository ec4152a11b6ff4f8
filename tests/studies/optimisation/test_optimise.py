"""Searches find optima that are known, go on after a kill to the same result, and refuse nonsense at once."""

import dataclasses
import json
import math
from unittest.mock import ANY

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.errors import FormatError, GeometryError, SamplingWarning
from lumigraph.studies.information import Light
from lumigraph.studies.information.points import collected
from lumigraph.studies.optimisation import Goal
from lumigraph.studies.optimisation.front import front, trace
from lumigraph.studies.optimisation.goals import JudgedBound
from lumigraph.studies.optimisation.gradient import downhill
from lumigraph.studies.optimisation.optimise import Optimum, _warn_of_luck
from lumigraph.studies.optimisation.search import grid, refined
from lumigraph.studies.optimisation.space import Space

SCOPE, CAMERA = "lfm-fourier", "thesis-plenoptic-2-m050"
DEPTHS = (-10e-6, 10e-6)
VARY = {"fourier_lens": "60 mm:90 mm:x2"}


@pytest.mark.parametrize("search", ["local", "global"])
def test_a_number_with_a_known_optimum_is_found(search):
    """Cross-talk sqrt(2.44 λ b)/p falls with f: the least of b = f (1 + m) is at both ranges' low ends."""
    vary = {
        "lenslets.magnification": "0.3:0.6:x3",
        "lenslets.focal_length": "5 mm:6 mm:x2",
        "lenslets.pitch": "140 um, 150 um",
    }
    found = lg.optimise(CAMERA, vary, "least cross-talk", search=search, evaluations=60)
    b = 5e-3 * 1.3
    assert found.best["cross-talk"] == pytest.approx(math.sqrt(2.44 * 633e-9 * b) / 150e-6, rel=1e-3)
    assert set(found.active) == {"lenslets.magnification", "lenslets.focal_length"}
    assert found.gain(found.start) > 0.05
    assert len(found.rows) <= 1 + 12 + 60


def test_the_largest_is_the_other_end():
    vary = {"lenslets.magnification": "0.3:0.6:x3"}
    seen = []
    found = lg.optimise(CAMERA, vary, "largest cross-talk", evaluations=20, progress=seen.append)
    assert seen == sorted(seen)
    assert 0 < seen[0] < 0.1 < seen[-1] <= 1
    assert found.active == {"lenslets.magnification": 0.6}
    assert 0 < found.gain(found.start) < 0.1


def test_a_front_of_two_goals_is_where_neither_can_be_better(tmp_path, capsys):
    """The shorter focal length is better in both; the magnification trades one for the other."""
    vary = {"lenslets.magnification": "0.3:0.6:x3", "lenslets.focal_length": "5 mm:6 mm:x2"}
    goals = {"goal": "least cross-talk", "against": "least lateral resolution"}
    found = lg.optimise(CAMERA, vary, **goals, evaluations=40)
    assert len(found.rows) <= 1 + 6 + 80
    assert {row["lenslets.focal_length"] for row in found.front} == {"5 mm"}
    m = np.array([row["lenslets.magnification"] for row in found.front])
    assert m.tolist() == sorted(m)
    assert (m[0], m[-1]) == (0.3, 0.6)
    assert np.diff(m).max() < 0.05
    b = 5e-3 * (1 + m)
    talk = np.array([row["cross-talk"] for row in found.front])
    np.testing.assert_allclose(talk, np.sqrt(2.44 * 633e-9 * b) / 150e-6, rtol=1e-3)
    best = tmp_path / "best.toml"
    words = ["optimise", CAMERA, *(f"--vary={key}={values}" for key, values in vary.items()), "-o", str(best)]
    words += ["--goal", goals["goal"], "--against", goals["against"], "--evaluations", "40"]
    assert main([*words, "--report", str(tmp_path / "r.html")]) == 0
    said = capsys.readouterr().out
    assert f"{len(m)} cameras that no other beats in both goals, from cross-talk 0.66789 with lateral" in said
    assert "magnification = 0.6" in said
    assert "Of two goals" in (tmp_path / "r.html").read_text()
    with pytest.raises(FormatError, match="has no number 'beauty'"):
        lg.optimise(CAMERA, vary, against="largest beauty", goal="least cross-talk")


class Known:
    """Cameras whose cost is known: least at given parts of two ranges, and none beyond a border."""

    def __init__(self, space, least):
        self.space, self.least, self.rows, self.seen = space, least, [], {}

    def cost(self, item):
        y, x = self.space.parts(item)
        if str(item) not in self.seen:
            self.rows.append(item)
            away = (
                1 + (y - self.least[0]) ** 2 + 3 * (x - self.least[1]) ** 2 + (y - self.least[0]) * (x - 0.3)
            )
            self.seen[str(item)] = math.inf if y + x > 1.2 else away
        return self.seen[str(item)]


def test_a_front_whose_middle_is_hollow_is_reached_between_its_ends():
    """a against 1 - a²: no weighted sum of the two has its least inside."""

    class Hollow(Known):
        def row(self, item):
            if str(item) not in self.seen:
                (y,) = self.space.parts(item)
                self.seen[str(item)] = {**item, "y": y, "z": 1 - y**2}
                self.rows.append(self.seen[str(item)])
            return self.seen[str(item)]

    space, goals = Space.of(["a=0:1:x2"]), (Goal("y"), Goal("z"))
    cameras = Hollow(space, None)
    for item in space.combinations():
        cameras.row(item)
    trace(cameras, space, goals, ("local", 60, 0))
    found = np.array([row["y"] for row in front(cameras.rows, goals)])
    for weight in (0.2, 0.5, 0.8):  # where the weighted ways to the ends are alike
        here = (-weight + math.sqrt(weight**2 + 4 * (1 - weight) ** 2)) / (2 * (1 - weight))
        assert np.abs(found - here).min() < 5e-3


@pytest.mark.parametrize("search", ["local", "global"])
def test_a_least_between_the_first_values_is_found_beside_what_cannot_be(search):
    space = Space.of(["a=1 mm:3 mm:x3", "b=0:1:x3"])
    known = Known(space, (0.63, 0.3))
    first = grid(known, space)
    found = refined(known, space, first, (search, 400, 1))
    assert space.parts(found) == pytest.approx([0.63, 0.3], abs=5e-3)
    few = Known(space, (0.63, 0.3))
    refined(few, space, grid(few, space), (search, 7, 1))
    assert len(few.rows) == 9 + 7


def test_bounds_fall_and_the_best_is_a_camera_that_has_them():
    goal = Goal("depth", depths=DEPTHS, light=Light(5000))
    found = lg.optimise(SCOPE, VARY, goal, evaluations=8)
    assert found.best["depth"] <= found.swept["depth"]
    places = found.best["places"]
    again = lg.information.bounds(found.camera, DEPTHS, Light(5000), places=places)
    assert again.depth == pytest.approx(found.best["depth"], rel=1e-6)


@pytest.mark.long  # 18 s
def test_the_best_bound_carries_the_error_of_its_derivatives():
    """A step that is far too long shows: what is said holds the bound by the right one."""
    camera = lg.load_camera(CAMERA).replace(main_lens={"diameter": "3 mm"}, model="exact")
    goal, first = Goal("lateral", depths=(2e-3,), light=Light(5000), places=1), collected(camera)
    rough = goal.values(camera, first)
    value, error, over_depths, _ = goal.checked(camera, first, rough)
    again = lg.information.bounds(camera, (2e-3,), Light(5000), places=range(1, 5))
    assert value == pytest.approx(again.lateral, rel=1e-9)
    assert over_depths == pytest.approx(again.of("lateral"), rel=1e-9)
    assert error >= np.max(again.errors) > 0
    assert error >= abs(rough["lateral"] / value - 1) > 0
    exact = lg.optimise(SCOPE, {"fourier_lens": "60 mm:90 mm:x1"}, depths=(2e-6,), search="grid")
    assert (
        exact.checked["best"]
        == exact.checked["swept"]
        == (pytest.approx(exact.best["depth"], rel=1e-2), ANY, ANY, ANY)
    )
    assert exact.best["fourier_lens"] == "75 mm"
    shown = dataclasses.replace(exact, checked={"best": JudgedBound(8e-8, 0.25, np.zeros(1))}).quantities()
    assert shown[2].interval == pytest.approx((6e-8, 1e-7))


COARSE = {
    "fourier_lens": "76.32 mm",
    "lenslets": {
        "count": (2, 2), "pitch": "1.982 mm", "focal_length": "15.16 mm",
        "single": {n: {"focal_change": 0.02 if n in (1, 4) else -0.02} for n in (1, 2, 3, 4)},
    },
}  # fmt: skip
"""Spots of a pixel: bounds change by half with the place in it."""


def test_a_bound_that_is_a_places_luck_is_warned_of_and_more_places_are_taken_unasked():
    scope, vary, depths = lg.load_camera(SCOPE).replace(**COARSE), {"fourier_lens": "76.32 mm"}, (24e-6,)
    true = lg.information.bounds(scope, depths, Light(5000), places=16).depth
    lucky = Goal("depth", depths=depths, light=Light(5000), places=1)
    with pytest.warns(SamplingWarning, match=r"at the 1 places a depth.* are chance"):
        one = lg.optimise(scope, vary, lucky)
    assert one.best["depth"] < 0.92 * true
    assert one.checked["best"][0] == pytest.approx(true, rel=0.03)
    some = lg.optimise(scope, vary, dataclasses.replace(lucky, places=None))
    assert some.best["depth"] == pytest.approx(true, rel=0.015)
    assert some.best["places"] >= 4
    even = lg.load_camera(SCOPE)
    assert Goal("depth", depths=(24e-6,)).values(even, collected(even))["places"] == 2


def test_a_search_starts_from_the_camera_given_too(monkeypatch):
    """Its valley is another one than that of the first values."""
    scope = lg.load_camera(SCOPE)

    def two_valleys(goal, instrument, first):
        f = instrument.fourier_lens * 1e3
        return {"depth": 1 + min((f - 100) ** 2 + 1, (f - 77) ** 2 / 4), "places": 2}

    monkeypatch.setattr(Goal, "values", two_valleys)
    monkeypatch.setattr(Goal, "checked", lambda *given: JudgedBound(given[-1]["depth"], 0.0, np.zeros(2)))
    found = lg.optimise(scope, {"fourier_lens": "50 mm:100 mm:x2"}, depths=DEPTHS, evaluations=40)
    assert found.swept["fourier_lens"] == "100 mm"
    assert found.camera.fourier_lens == pytest.approx(77e-3, rel=2e-3)
    assert len(found.rows) <= 1 + 2 + 40


def test_two_better_ones_beside_the_best_are_said(recwarn):
    rows, values = {"depth": 1.0, "places": 2}, {"start": 0.9, "swept": 2.0, "best": 1.0}
    found = Optimum(
        Goal("depth"), lg.load_camera(SCOPE), {**rows, "depth": 3.0}, {**rows, "depth": 2.0}, rows, {}, [],
        {which: JudgedBound(value, 0.0, np.zeros(1)) for which, value in values.items()},
    )  # fmt: skip
    _warn_of_luck(found)
    assert [str(one.message).split(" has")[0] for one in recwarn] == ["the camera as given"]


@pytest.mark.parametrize(
    ("best", "swept", "said"),
    [
        ((1.0, 0.9), (1.5, 0.8), []),  # better half-way, worse in all
        ((1.0, 0.9), (1.01, 0.5), ["half-way between the depths the best of the first values"]),
        ((1.0, 1.02), (2.0, 2.0), []),
        ((1.0, 1.2), (2.0, 2.0), ["the depth bound of the best is 1 m over the depths"]),
        ((1.0, math.nan), (1.5, math.nan), []),
    ],
)
def test_a_bound_that_is_worse_between_its_depths_is_warned_of(best, swept, said, recwarn):
    rows = {"depth": 1.0, "places": 2}
    known = {
        which: JudgedBound(value, 0.0, np.zeros(2), between)
        for which, (value, between) in (("swept", swept), ("best", best))
    }
    found = Optimum(Goal("depth"), lg.load_camera(SCOPE), rows, {**rows, "depth": 2.0}, rows, {}, [], known)
    _warn_of_luck(found)
    told = [str(one.message) for one in recwarn]
    assert len(told) == len(said)
    for words, begun in zip(told, said, strict=True):
        assert words.startswith(begun)
        assert words.endswith("Search again with more depths.")


def test_a_bound_is_judged_half_way_between_its_depths():
    scope, light = lg.load_camera(SCOPE), Light(5000)
    goal = Goal("depth", depths=(20e-6, -20e-6, 4e-6), light=light, places=2)
    judged = goal.checked(scope, collected(scope), goal.values(scope, collected(scope)))
    there = lg.information.bounds(scope, [-8e-6, 12e-6], light, places=range(2, 6))
    assert judged.between == pytest.approx(there.depth, rel=1e-9)
    one = dataclasses.replace(goal, depths=(4e-6,))
    assert math.isnan(one.checked(scope, collected(scope), one.values(scope, collected(scope))).between)


def test_more_aperture_collects_more_of_the_same_points_light():
    goal, scope = Goal("depth", depths=(1e-6,), light=Light(1000), places=1), lg.load_camera(SCOPE)
    half = scope.replace(objective={"numerical_aperture": 0.25})
    caps = [1 - math.sqrt(1 - aperture**2) for aperture in (0.5, 0.25)]
    assert goal.values(half, collected(scope))["photons"] == pytest.approx(1000 * caps[1] / caps[0], rel=1e-9)


def test_a_search_that_was_killed_goes_on_to_the_same_result(tmp_path, monkeypatch):
    whole = lg.optimise(SCOPE, VARY, depths=DEPTHS, evaluations=6)
    from lumigraph.studies.optimisation import goals

    plain, calls = goals.Goal.values, []

    def dying(self, *given):
        calls.append(given)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return plain(self, *given)

    monkeypatch.setattr(goals.Goal, "values", dying)
    with pytest.raises(KeyboardInterrupt):
        lg.optimise(SCOPE, VARY, depths=DEPTHS, evaluations=6, output=tmp_path / "best.toml")
    found = lg.optimise(SCOPE, VARY, depths=DEPTHS, evaluations=6, output=tmp_path / "best.toml")
    assert found.rows == whole.rows
    assert len(calls) == 5 + len(whole.rows) - 4
    with pytest.raises(FormatError, match="belongs to another job"):
        lg.optimise(SCOPE, VARY, depths=(-10e-6, 11e-6), evaluations=6, output=tmp_path / "best.toml")


def test_a_search_goes_on_with_more_evaluations_from_what_is_noted(tmp_path, monkeypatch):
    """From two starts, whose cameras come in another order then."""
    from lumigraph.studies.optimisation import goals

    plain, calls = goals.Goal.values, []
    monkeypatch.setattr(goals.Goal, "values", lambda self, *given: calls.append(given) or plain(self, *given))
    vary, goal = {"lenslets.magnification": "0.3:0.7:x3"}, "least cross-talk"
    whole = lg.optimise(CAMERA, vary, goal, evaluations=12)
    calls.clear()
    few = lg.optimise(CAMERA, vary, goal, evaluations=5, output=tmp_path / "best.toml")
    assert len(calls) == len(few.rows)
    found = lg.optimise(CAMERA, vary, goal, evaluations=12, output=tmp_path / "best.toml")
    assert found.rows == whole.rows
    assert len(calls) < len(few.rows) + len(whole.rows) - 4
    done = len(calls)
    assert lg.optimise(CAMERA, vary, goal, evaluations=12, output=tmp_path / "best.toml").rows == whole.rows
    assert len(calls) == done


def test_ranges_and_stock_are_told_apart():
    space = Space.of(["a=1 mm:3 mm:x3", "b=4, 5"])
    assert space.moved({"a": "1 mm", "b": 4}, [0.25]) == {"a": "1.5 mm", "b": 4}
    assert space.parts({"a": "2 mm", "b": 5}) == [0.5]
    assert space.active({"a": "3 mm", "b": 5}) == {"a": "3 mm"}


@pytest.mark.parametrize(
    ("vary", "goal", "said"),
    [
        ({"fourier_lens": "nan mm:90 mm:x2"}, "depth", "first:last:xN"),
        ({"fourier_lens": "90 mm:60 mm:x2"}, "depth", "must go up"),
        ({"fourier_lense": "60 mm:90 mm:x2"}, "depth", "fourier_lense"),
        (VARY, "depht", "--goal is 'depht'"),
        (VARY, "largest luck", "no number 'luck'"),
        (VARY, "largest mtf@10/mm", "light-field-microscope"),
        ({}, "depth", "nothing to vary"),
        ({"lenslets.layout": "hex"}, "depth", "none of the first 1 cameras is possible"),
    ],
)
def test_nonsense_is_refused(vary, goal, said):
    with pytest.raises((FormatError, GeometryError), match=said):
        lg.optimise(SCOPE, vary, goal, depths=DEPTHS)


def test_depths_are_needed_for_bounds():
    with pytest.raises(GeometryError, match="needs depths"):
        lg.optimise(SCOPE, VARY, "depth")


def test_the_verb_writes_a_camera_and_says_before_and_after(tmp_path, capsys):
    best = tmp_path / "best.toml"
    words = [
        "optimise",
        SCOPE,
        "--vary",
        "fourier_lens=60 mm:90 mm:x2",
        "--depth",
        "-10 um, 10 um",
        "-o",
        str(best),
    ]
    words += ["--evaluations", "3"]
    assert main([*words, "--report", str(tmp_path / "r.html")]) == 0
    said, page = capsys.readouterr().out, (tmp_path / "r.html").read_text()
    assert all(words in page for words in ("depth bound", "75 mm", "At other places than those of"))
    assert (
        "e-0" not in said + page[page.index("<body") : page.index("<img")]
    )  # lengths have a unit that suits
    assert "as given" in said
    assert "fourier_lens = " in said
    assert "half-way between the depths the best depth bound is " in " ".join(said.split())
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    camera = lg.load_camera(best)
    assert camera.fourier_lens == pytest.approx(lg.units.parse(told["best"]["fourier_lens"]), rel=1e-9)
    assert main(["optimise", SCOPE, "--vary", "fourier_lens=60:90", "-o", str(best)]) == 1
    assert capsys.readouterr().err.startswith("lumigraph: error: ")


@pytest.mark.long  # 9 s
def test_gradients_move_single_lenslets_where_a_simplex_stalls():
    """Twelve keys, 14 cameras: the bound falls as slopes say, at the two depths and not between them."""
    start = lg.load_camera(SCOPE).replace(
        fourier_lens="76 mm",
        lenslets={
            "count": (2, 2), "pitch": "1.8 mm", "focal_length": "16 mm", "fill_factor": 0.95,
            "single": {n: {"focal_change": c, "offset_y": 1e-6, "offset_x": 1e-6}
                       for n, c in enumerate((0.01, -0.01, -0.01, 0.01), 1)},
        },
    )  # fmt: skip
    vary = {f"lenslets.single.{n}.focal_change": "-0.05:0.05:x1" for n in (1, 2, 3, 4)}
    for n in (1, 2, 3, 4):
        vary |= {f"lenslets.single.{n}.offset_{axis}": "-200 um:200 um:x1" for axis in "yx"}
    goal = Goal("depth", depths=(-24e-6, 24e-6), light=Light(5000), places=2)
    with pytest.warns(SamplingWarning, match="half-way between"):
        found = lg.optimise(start, vary, goal, search="gradient", evaluations=12)
    assert found.checked["best"].between > 2 * found.checked["best"].value
    simplex = lg.optimise(start, vary, goal, search="local", evaluations=12)
    assert len(found.rows) <= 14
    assert found.gain(found.start) > 0.2
    assert found.best["depth"] < 0.9 * simplex.best["depth"]
    assert len({found.best[f"lenslets.single.{n}.offset_y"] for n in (1, 2, 3, 4)}) == 4


def test_gradients_stay_within_ranges_and_around_what_cannot_be():
    """A valley beyond the range and beside a wall: its lowest point within is found, from a bend of 100."""

    def cost(at):
        if at[0] + at[1] > 1.5:
            return math.inf
        return (at[0] - 0.7) ** 2 + 100 * (at[1] - 0.3) ** 2 + (at[2] - 2) ** 2

    def slopes(at):
        return np.array([2 * (at[0] - 0.7), 200 * (at[1] - 0.3), 2 * (at[2] - 2)])

    seen = []

    def noted(at):
        seen.append((cost(at), at.copy()))
        return seen[-1][0]

    downhill(noted, slopes, np.array([0.1, 0.9, 0.4]))
    _, best = min(seen, key=lambda one: one[0])
    assert all((at >= 0).all() and (at <= 1).all() for _, at in seen)
    assert best == pytest.approx([0.7, 0.3, 1.0], abs=0.01)
    assert len(seen) < 60


@pytest.mark.parametrize(
    ("words", "match"),
    [
        ({"goal": "largest light caught"}, "search 'gradient' is for depth, lateral, brightness"),
        ({"against": "lateral"}, "search 'gradient' is for one goal"),
    ],
)
def test_what_has_no_gradients_is_refused(words, match):
    with pytest.raises(GeometryError, match=match):
        lg.optimise(SCOPE, VARY, depths=DEPTHS, search="gradient", **words)
