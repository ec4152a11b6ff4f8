"""A camera 2.0 with a phase in its main lens, or without: `python -m benchmarks.designs_camera --workers 16`.

A stop of 8 mm and a volume of ±10 mm: ±9 waves of defocus at its edge. Of the same main lens, sensor and
light, how much better is a point's depth known if the main lens has a phase of its own, astigmatic in two
orders? Lenslets and the plane of sharpness are searched without the phase, then with it; the best of each are
set side by side at places and depths where nothing was searched, and points there are fitted in drawn noise.

Each camera is a line of JSON: its numbers, its bounds [µm], and CPU seconds. `--known FILE` takes lines of an
earlier run instead of computing them again, so that a run that ended early goes on. Each search is of
`--rounds` of `--each` cameras; `--fits` fits too.
"""

import argparse
import json
import multiprocessing
import os
import time
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.studies.information import Light, bounds, trials
from lumigraph.units import mm, nm, um

MIDDLE, FOCAL_LENGTH, STOP = 120 * mm, 60 * mm, 8 * mm
"""Of the volume, from the main lens; of the main lens."""

SEARCHED, BETWEEN = (-10.0, -10 / 3, 10 / 3, 10.0), (-9.0, -6.0, 0.0, 6.0, 9.0)
"""Depths from the middle [mm]."""

LIGHT, OTHERS = Light(20_000), (3, 5)
HELD_OUT = ((0.05, -0.11, -7.0), (-0.13, 0.04, 8.0), (0.08, 0.1, 2.0))
"""Points (y, x, and depth from the middle) whose depth is fitted [mm]."""
DRAWS, SEED = 200, 2

FASTEST = 2.5
"""Focal length over pitch of lenslets, at least: what can be made, and what paraxial waves are good for."""

CLOSER = 0.4
"""Width of each round's ranges over those of the round before."""

FINALISTS = 2
"""Cameras of each search that are judged where nothing was searched."""

Design = dict[str, float]

RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "regular": {
        "across": (1.5, 5.0), "pitch": (0.25, 0.6), "magnification": (0.08, 0.35), "sharp": (0.0, 5.0),
    },
    "masked": {
        "across": (0.6, 1.3), "pitch": (0.25, 0.5), "magnification": (0.2, 0.5), "sharp": (0.5, 4.0),
        "z6": (-7.0, -3.0), "z12": (0.0, 2.3), "z11": (-1.0, 1.0),
    },
}  # fmt: skip
"""Of searches: lenslets across that see a point in focus, their pitch, magnifications, how far beyond the
middle of the volume cameras are sharp [mm], and terms of the main lens (Noll) [waves rms]."""

FIRST: dict[str, list[Design]] = {
    "regular": [{"across": 3.3, "pitch": 0.45, "magnification": 0.15, "sharp": 2.5}],
    "masked": [
        {"across": a, "pitch": 0.36, "magnification": m, "sharp": 2.2, "z6": -5.0, "z12": 1.15, "z11": 0.0}
        for a, m in ((0.8, 0.35), (1.3, 0.2))
    ],
}
"""Cameras that the first round has as well; further rounds narrow about the best."""

PLACES = {"regular": (0, 2), "masked": (0, 1)}
"""At each depth of a search: cameras with a mask are less uneven, and dearer."""


def camera(design: Design) -> FocusedPlenopticCamera:
    """Of a design's numbers, as `RANGES` has them.

    Raises
    ------
    ValueError
        Lenslets faster than `FASTEST`.
    """
    pitch, magnification = design["pitch"] * mm, design["magnification"]
    distance, beam = MIDDLE + design["sharp"] * mm, design["across"] * pitch
    image = 1 / (1 / FOCAL_LENGTH - 1 / distance)
    focal_length = beam * image / (STOP - beam) * magnification / (1 + magnification)
    if focal_length < FASTEST * pitch:
        raise ValueError(f"lenslets are f/{focal_length / pitch:.2f} but must be f/{FASTEST:g} or slower")
    mask = {int(key[1:]): value for key, value in design.items() if key.startswith("z") and value}
    return FocusedPlenopticCamera(
        wavelength=633 * nm,
        object_distance=distance,
        main_lens={"focal_length": FOCAL_LENGTH, "diameter": STOP, "aberrations": mask},
        lenslets={
            "pitch": pitch, "focal_length": focal_length, "count": (39, 39), "magnification": magnification
        },
        sensor={"pixel_pitch": 3.4 * um, "read_noise": 1.5},
    )  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """Bounds of a design over depths [mm] at places of a cell: those from the first to before the second."""

    design: Design
    depths: tuple[float, ...]
    places: tuple[int, int]

    @property
    def jobs(self) -> list[tuple[Any, ...]]:
        """Depth by depth."""
        return [(judged, self.design, depth, self.places) for depth in self.depths]

    def joined(self, parts: list[dict[str, Any]]) -> dict[str, Any]:
        """Roots of mean variances [µm], or why there are none."""
        if "not built" in parts[0]:
            return parts[0]
        depth, across = (np.array([one[key] for one in parts]) for key in ("depth", "across"))
        return {
            "depth": _root(depth), "each": [_root(one) for one in depth], "across": _root(across),
            "cpu_s": round(sum(one["cpu_s"] for one in parts), 1),
        }  # fmt: skip


@dataclass(frozen=True)
class Fit:
    """Fits of a design to drawn noise at a point (y, x, depth) [mm]."""

    design: Design
    point: tuple[float, float, float]

    @property
    def jobs(self) -> list[tuple[Any, ...]]:
        """One."""
        return [(fitted, self.design, self.point)]

    def joined(self, parts: list[dict[str, Any]]) -> dict[str, Any]:
        """It."""
        return parts[0]


def _root(variances: np.ndarray) -> float:
    return round(float(np.sqrt(variances.mean())), 3)


def judged(design: Design, depth: float, places: tuple[int, int]) -> dict[str, Any]:
    """Variances of depth and across [µm²] at places of one depth, and CPU seconds; or why there are none."""
    began = time.process_time()
    try:
        found = bounds(camera(design), [(depth - design["sharp"]) * mm], LIGHT, places=range(*places))
    except ValueError as error:
        return {"not built": str(error).split("\n")[0]}
    variances, cpu_s = np.square(found.deviations[0] / um), time.process_time() - began
    return {"depth": variances[:, 2].tolist(), "across": variances[:, :2].tolist(), "cpu_s": cpu_s}


def fitted(design: Design, point: tuple[float, float, float]) -> dict[str, Any]:
    """Errors of depths [µm] that are fitted to a point in drawn noise, their own error, and the bound."""
    began, (y, x, depth) = time.process_time(), point
    place = (y * mm, x * mm, (depth - design["sharp"]) * mm)
    found = trials(camera(design), place, LIGHT, draws=DRAWS, rng=np.random.default_rng(SEED))
    values = {"bound": found.bounds[2], "fits": found.rms[2], "error": found.rms_error[2]}
    in_um = {key: round(float(value) / um, 3) for key, value in values.items()}
    return {**in_um, "cpu_s": round(time.process_time() - began, 1)}


class Bench:
    """Processes that answer, and lines of what is known."""

    def __init__(self, pool: ProcessPoolExecutor, known: Path | None) -> None:
        self.pool, self.known = pool, {}
        for line in known.read_text().splitlines() if known else ():
            if line.startswith('{"what"') and line.endswith("}"):
                one = json.loads(line)
                self.known[json.dumps(one["asked"])] = one

    def answers(self, asked: dict[str, list[Any]]) -> dict[str, list[dict[str, Any]]]:
        """To all that is asked, by what it is asked for; each is printed as a line."""
        begun = {
            what: [(one, [self.pool.submit(*job) for job in one.jobs if self._key(one) not in self.known])
                   for one in some]
            for what, some in asked.items()
        }  # fmt: skip
        return {what: [self._answer(what, *one) for one in some] for what, some in begun.items()}

    def _answer(self, what: str, asked: Any, parts: list[Future]) -> dict[str, Any]:
        key = self._key(asked)
        if key not in self.known:
            found = asked.joined([part.result() for part in parts])
            self.known[key] = {"what": what, **found, "asked": asdict(asked)}
        print(json.dumps(self.known[key]), flush=True)
        return self.known[key]

    @staticmethod
    def _key(asked: Any) -> str:
        return json.dumps(asdict(asked))


class Search:
    """For the best camera of a kind: drawn evenly from its ranges, then nearer and nearer to the best."""

    def __init__(self, kind: str) -> None:
        self.kind, self.names = kind, list(RANGES[kind])
        self.low, self.high = np.array(list(RANGES[kind].values())).T
        self.middle, self.width = (self.low + self.high) / 2, self.high - self.low
        self.drawn = qmc.Halton(len(self.names), rng=SEED)
        self.known: list[tuple[float, Design]] = []

    def ask(self, count: int) -> list[Asked]:
        """Cameras to be judged."""
        at = np.clip(self.middle + (self.drawn.random(count) - 0.5) * self.width, self.low, self.high)
        drawn = [dict(zip(self.names, one.round(3).tolist(), strict=True)) for one in at]
        designs = drawn if self.known else FIRST[self.kind] + drawn
        return [Asked(one, SEARCHED, PLACES[self.kind]) for one in designs]

    def tell(self, asked: list[Asked], found: list[dict[str, Any]]) -> None:
        """Narrow the ranges about the best."""
        bounds = [one.get("depth", np.inf) for one in found]
        self.known += [(bound, one.design) for bound, one in zip(bounds, asked, strict=True)]
        self.known.sort(key=lambda one: one[0])
        self.middle, self.width = np.array(list(self.best[0].values())), self.width * CLOSER

    @property
    def best(self) -> list[Design]:
        """The first few."""
        return [design for _, design in self.known[:FINALISTS]]


def searched(bench: Bench, each: int, rounds: int) -> dict[str, list[Design]]:
    """The best of both kinds, best first."""
    searches = {kind: Search(kind) for kind in RANGES}
    for _ in range(rounds):
        asked = {kind: one.ask(each) for kind, one in searches.items()}
        for kind, found in bench.answers(asked).items():
            searches[kind].tell(asked[kind], found)
    return {kind: one.best for kind, one in searches.items()}


def chosen(bench: Bench, best: dict[str, list[Design]]) -> dict[str, Design]:
    """Of each kind the camera with the least bound at other places; all are judged at other depths, too."""
    depths = {"other places": SEARCHED, "other depths": BETWEEN}
    asked = {
        f"{kind}, {where}": [Asked(one, between, OTHERS) for one in some]
        for where, between in depths.items() for kind, some in best.items()
    }  # fmt: skip
    found = bench.answers(asked)
    least = {kind: [one["depth"] for one in found[f"{kind}, other places"]] for kind in best}
    return {kind: some[int(np.argmin(least[kind]))] for kind, some in best.items()}


def main() -> None:
    """Search, judge and fit."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, usual in {"workers": 1, "each": 5, "rounds": 3}.items():
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--known", type=Path)
    parser.add_argument("--fits", action="store_true")
    given = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # of processes that begin
    with ProcessPoolExecutor(given.workers, multiprocessing.get_context("spawn")) as pool:
        bench = Bench(pool, given.known)
        designs = chosen(bench, searched(bench, given.each, given.rounds))
        print(json.dumps(designs), flush=True)
        if given.fits:
            bench.answers(
                {f"fits at {at[2]:g} mm": [Fit(one, at) for one in designs.values()] for at in HELD_OUT}
            )


if __name__ == "__main__":
    main()
