"""Figures 6.10 and 6.12: a grid from a row and a column of a white image, and a picture by a wrong one."""

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from lumigraph.calibration import calibrate
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.plots.curves import curves, images
from lumigraph.rendering import render
from lumigraph.scene import targets
from lumigraph.studies.thesis.figures import white_images
from lumigraph.studies.thesis.figures.figure_6_8 import bench_image, laboratory_camera, target
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_TURN, _OFF = math.radians(0.3), -2.0
"""Rotation of the lenslets; extra distance of each micro-image from the last one [px]."""

_SAMPLES, _NEAR = 41, 3
"""Samples of the picture per lenslet; lenslets from the axis at which patches are still in micro-images."""

_THRESHOLD, _STOP = 0.5, 0.8
"""Part of the brightest; and the main lens' diameter over that whose micro-images touch: they need gaps."""


@experiment(
    "figure-6.10",
    "The grid of micro-images",
    question="How well does a grid from one row and one column of a white image fit, and what does a grid do "
    "to the picture that is wrong?",
    thesis="Figures 6.10 and 6.12, section 6.4",
    shows="Cuts through a row and a column of a white image give a grid; one that is off by 15 pixels "
    "leaves seams in the picture.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """The thesis' grid and `calibrate`'s against where the micro-images are; seams of two grids."""
    camera = white_images.laboratory_camera(17 if context.quick else 31)
    camera = camera.replace(
        lenslets={"rotation": _TURN, "shape": "square"},
        main_lens={"diameter": _STOP * camera.diameters.touching},
    )
    context.progress(0.0, "white image")
    white = RawImage(context.cached("white", lambda: white_images.white(camera).data))
    rows, drawn = _grids(white, camera.calibration)
    context.progress(0.4, "target")
    found = laboratory_camera(0.5, 21)
    found = found.replace(sensor={"pixel_pitch": 2 * found.pixels.pixel_pitch})
    raw = RawImage(context.cached("raw", lambda: bench_image(found, target(found, (3, 3))).data))
    even = RawImage(context.cached("even", lambda: bench_image(found, targets.white()).data))
    grids = {"right": found.calibration, "wrong": stretched(found.calibration, _OFF)}
    pictures, flat = (
        {name: np.asarray(render(one, grid, found.patch, samples=_SAMPLES)) for name, grid in grids.items()}
        for one in (raw, even)
    )
    even_lit = {name: picture / flat[name] for name, picture in pictures.items()}
    rows += _seam_rows(even_lit, _OFF * _SAMPLES / found.patch)
    panels = [(picture, f"{name} grid") for name, picture in pictures.items()]
    return ExperimentOutcome(
        tuple(rows),
        (
            drawn,
            (images(panels, columns=2), "The same raw image with the right grid and a wrong one (6.12)."),
        ),
        why="A row and a column know no rotation: their grid is off by the lenslets' turn times the "
        "distance. An offset that all sub-images share only moves the picture; one that grows from each to "
        "the next, as here, makes seams.",
    )


def _grids(white: RawImage, true: Calibration) -> tuple[list[ResultRow], tuple[object, str]]:
    data, (row, column) = np.asarray(white.data, float), np.round(true.position(np.zeros(2, int))).astype(int)
    profiles = data[:, column], data[row]
    down, right = (lit_middles(profile) for profile in profiles)
    grid = {
        (i, j): (y, x)
        for i, y in enumerate(down, -_before(down, row)) for j, x in enumerate(right, -_before(right, column))
    }  # fmt: skip
    pairs = np.array([pair for pair in map(tuple, true.indices) if pair in grid])
    told = np.array([grid[tuple(pair)] for pair in pairs])
    off = np.linalg.norm(told - true.position(pairs), axis=1)
    pitch = true.lattice.pitch
    expected = pitch * math.sin(_TURN) * math.sqrt(np.square(pairs).sum(1).mean())
    found = calibrate(white)
    near = found.position(np.stack(found.lattice.index(*true.position(pairs).T), -1))
    rows = [
        ResultRow(
            "pitch by thresholds", float(np.diff(right).mean()), "px", None, pitch * math.cos(_TURN), 0.05
        ),
        ResultRow(
            "grid of a row and a column off by, rms",
            math.sqrt(np.mean(off**2)),
            "px",
            None,
            expected,
            0.05 * expected,
            "pitch × turn × rms distance",
        ),
        ResultRow(
            "grid of calibrate off by, rms",
            math.sqrt(np.square(near - true.position(pairs)).sum(1).mean()),
            "px",
            None,
            0.0,
            0.1,
        ),
    ]
    lines = {
        name: ((np.arange(len(p)) - n) * 1.0, p / p.max())
        for name, p, n in (("column", profiles[0], row), ("row", profiles[1], column))
    }
    ends = lines["row"][0][[0, -1]]
    lines["threshold"] = (ends, np.full(2, _THRESHOLD))
    figure = curves([], lines, xlabel="place [px]", ylabel="white image")
    return rows, (figure, f"A row and a column of the white image, cut at {_THRESHOLD:g} (6.10).")


def lit_middles(profile: np.ndarray) -> np.ndarray:
    """Middles [px] of the runs above the threshold that touch no end: sub-images, found as in the thesis."""
    lit = np.concatenate([[True], profile > _THRESHOLD * np.quantile(profile, 0.9), [True]])
    edges = np.flatnonzero(np.diff(lit.astype(int)))  # from dark to lit and back, between samples
    starts, ends = edges[1:-1:2], edges[2::2]
    return (starts + ends - 1) / 2


def _before(places: np.ndarray, middle: int) -> int:
    """Index of the place nearest to the middle."""
    return int(np.abs(places - middle).argmin())


def stretched(calibration: Calibration, off: float) -> Calibration:
    """The calibration with a pitch that is wrong by `off` [px], about the middle of the sensor."""
    lattice = calibration.lattice
    middle = lattice.position(np.zeros(2, int))
    wrong = lattice.scaled(1 + off / lattice.pitch)
    wrong = wrong.moved(*(middle - wrong.position(np.zeros(2, int))))
    return replace(calibration, lattice=wrong, centers=wrong.position(calibration.indices))


def _seam_rows(pictures: dict[str, np.ndarray], step: float) -> list[ResultRow]:
    """Rows on pictures of even brightness; `step` is how much farther each patch is taken [samples]."""
    seen, right = pictures["wrong"], pictures["right"]
    tiles = [np.floor((np.arange(n) - n // 2) / _SAMPLES + 0.5) for n in right.shape]
    places = np.meshgrid(*(np.arange(len(k)) - step * k for k in tiles), indexing="ij")
    expected = map_coordinates(right, places, order=1)
    near = np.ix_(*(np.abs(k) <= _NEAR for k in tiles))
    off, unmoved = (
        np.linalg.norm(seen[near] - one[near]) / np.linalg.norm(one[near]) for one in (expected, right)
    )
    return [
        ResultRow("step across seams, right grid", _seams(right[near])),
        ResultRow("step across seams, wrong grid", _seams(seen[near]), "", "do not match"),
        ResultRow("picture by the wrong grid from the right one", float(unmoved), note="relative rms"),
        ResultRow("the same, from the right one with its patches moved", float(off), "", None, 0.0, 0.1,
            "relative rms; brightness divided out"),
    ]  # fmt: skip


def _seams(picture: np.ndarray) -> float:
    """Rms difference of neighbours along x across the borders of whole patches."""
    edges = np.arange(_SAMPLES, picture.shape[1], _SAMPLES)
    return float(np.sqrt(np.square(picture[:, edges] - picture[:, edges - 1]).mean()))
