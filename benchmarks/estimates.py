"""Errors that raw images state, ``metadata["error"]``, beside the true ones of drawn scenes.

    python -m benchmarks.estimates [--count 60] [--seed 0] [--rows FILE] [--cameras]

Points, edges and fine gratings of a few samples, sums of `references`; tilted waves and snapshots
beside exact incoherent images. With `--cameras`, points, slices of a sample and white images before drawn
cameras: square lenslets of f/25 to f/60, 60 to 150 um, 1.0, 2.0 and Galilean. An estimate is good within a
factor 2 of the truth; a larger one is safe.
"""

import argparse
import json
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import accuracy, accuracy_microscope, references
from benchmarks.periodic_operator import relative
from lumigraph.operators.periodic.white import white_image
from lumigraph.units import mm, nm, um

METHODS = ("points", "incoherent", "incoherent", "coherent", "tilted waves", "snapshots")
NAMES = (
    "2.0, m = 0.5", "2.0, m = 0.25", "2.0, Galilean", "1.0", "2.0, round", "single lens", "2.0, hexagonal",
    "2.0, three kinds", "2.0, square, gaps", "microscope, 20x/0.5",
)  # fmt: skip


def drawn(seed: int) -> dict[str, Any]:
    """Stated and true error of one draw."""
    rng = np.random.default_rng(seed)
    name, method = str(rng.choice(NAMES)), str(rng.choice(METHODS))
    if name in accuracy_microscope.MICROSCOPES:
        return {"seed": seed, "camera": name, **_through_microscope(name, rng)}
    found, dz = accuracy.CAMERAS[name](), float(rng.uniform(-3, 3)) * mm
    asked, pattern = float(rng.choice([1e-2, 3e-3, 1e-3])), str(rng.choice(["edge", "grating", "noise"]))
    center = tuple((rng.uniform(-0.25, 0.25, 2) * found.object_grid.size).tolist())
    if method in ("tilted waves", "snapshots"):
        raw, truth = _many(found, method, pattern, dz, rng)
    elif method == "points":
        light = lg.Incoherent(accuracy=asked)
        raw = lg.simulate(found, lg.targets.points([(*center, dz)]), light)
        truth = accuracy._share(found, dz) * accuracy._truth(found, dz, [center])[0]
    else:
        grid = lg.Grid((3, 4), (float(rng.uniform(8, 25)) * um,) * 2, center)
        scene = lg.Scene([lg.Slice(_picture(pattern, grid.shape, rng), grid, dz)])
        light = lg.Coherent() if method == "coherent" else lg.Incoherent(accuracy=asked)
        raw, truth = lg.simulate(found, scene, light), _summed(found, scene.parts[0], method == "coherent")
    return {
        "seed": seed, "camera": name, "method": method, "asked": asked, "pattern": pattern,
        "stated": raw.metadata["error"]["rms"], "true": relative(raw.data, truth),
    }  # fmt: skip


def drawn_camera(rng: np.random.Generator) -> Any:
    """Of 5 x 5 square lenslets, in a third of the draws with gaps."""
    pitch, length = float(rng.uniform(60, 150)) * um, float(rng.uniform(50, 100)) * mm
    lenslets = {"pitch": pitch, "focal_length": pitch * float(rng.uniform(25, 60)), "count": (5, 5)}
    if rng.random() < 1 / 3:
        lenslets["fill_factor"] = float(rng.uniform(0.85, 0.98))
    pixel = float(rng.uniform(0.04, 0.09)) * pitch
    parts: dict[str, Any] = {
        "wavelength": float(rng.uniform(450, 650)) * nm, "object_distance": 2 * length,
        "main_lens": {"focal_length": length}, "sensor": {"pixel_pitch": pixel},
    }  # fmt: skip
    low, high = [(0.2, 0.6), (-0.5, -0.25), (0.0, 0.0)][int(rng.integers(3))]
    if not high:
        return lg.PlenopticCamera(lenslets=lenslets, **parts)
    return lg.FocusedPlenopticCamera(
        lenslets={**lenslets, "magnification": float(rng.uniform(low, high))}, **parts
    )


def through_drawn_camera(seed: int) -> dict[str, Any]:
    """Stated and true error of a point, a slice of a sample or, beside a finer one, a white image."""
    rng = np.random.default_rng(seed)
    found, dz, asked = (
        drawn_camera(rng),
        float(rng.uniform(-5, 8)) * mm,
        float(rng.choice([1e-2, 3e-3, 1e-3])),
    )
    method = str(rng.choice(("points", "incoherent", "white image")))
    step = found.lenslets.pitch * (found.object_distance + dz) / found.separation
    y, x = (float(v) for v in rng.uniform(-2, 2, 2) * step)
    grid = lg.Grid((1, 1), 1 * um, (y, x))
    if method == "white image":
        found = found.replace(lenslets={"count": (int(rng.integers(9, 22)),) * 2})
        scene, truth = lg.targets.white(), white_image(found.optics(), asked / 30)
    else:
        fine = replace(accuracy.fineness(found), pixel=7)  # fast lenslets, wide pixels: 4 are off by 6e-4
        truth = references.points(found, dz, [(y, x)], fine)[0]
        truth *= accuracy._share(found, dz, None if method == "points" else float(np.prod(grid.pitch)))
        slices = lg.Scene([lg.Slice(np.ones((1, 1), np.float32), grid, dz)])
        scene = lg.targets.points([(y, x, dz)]) if method == "points" else slices
    raw = lg.simulate(found, scene, lg.Incoherent(accuracy=asked))
    return {
        "seed": seed, "camera": "drawn", "method": method, "asked": asked, "pattern": "point",
        "stated": raw.metadata["error"]["rms"], "true": relative(raw.data, truth),
    }  # fmt: skip


def _through_microscope(name: str, rng: np.random.Generator) -> dict[str, Any]:
    """A point of fluorescence, in the middle or at the border."""
    scope, dz = accuracy_microscope.MICROSCOPES[name](), float(rng.uniform(-9, 9)) * um
    y, x = (float(c) for c in rng.uniform(-3, 3, 2) * scope.lenslet_size)
    asked = float(rng.choice([1e-2, 3e-3]))
    raw = lg.simulate(scope, lg.targets.points([(y, x, dz)]), lg.Incoherent(accuracy=asked))
    truth = accuracy_microscope.points(scope, dz, [(y, x)])[0]
    known = {"stated": raw.metadata["error"]["rms"], "true": relative(raw.data, truth)}
    return {"method": "microscope", "asked": asked, "pattern": "point", **known}


def _picture(pattern: str, shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    if pattern == "edge":
        return (np.indices(shape)[1] >= shape[1] // 2).astype(np.float32)
    if pattern == "grating":
        return (np.indices(shape).sum(0) % 2).astype(np.float32)
    return rng.random(shape, np.float32)


def _summed(found: Any, part: Any, coherent: bool) -> np.ndarray:
    """Of all samples of a slice."""
    grid, dz, area = part.grid, part.dz, float(np.prod(part.grid.pitch))
    at = [(float(y), float(x)) for y in grid.y for x in grid.x]
    values = part.intensity.ravel().tolist()
    share = accuracy._share(found, dz, area)
    if not coherent:
        return share * sum(v * i for v, i in zip(values, accuracy._truth(found, dz, at), strict=True) if v)
    samples = ((p, v**0.5) for p, v in zip(at, values, strict=True) if v)
    if found.lattice is None:
        return references.coherent_focused(found, dz, samples, area) * share / area
    return references.coherent(found, dz, samples, area, accuracy.fineness(found)) * share / area


def _many(found: Any, method: str, pattern: str, dz: float, rng: np.random.Generator) -> tuple[Any, Any]:
    """Shots of a picture over a third of the field, and its incoherent image."""
    grid, count = found.object_grid, int(rng.choice([20, 60]))
    n = grid.shape[0] // 3
    grid = lg.Grid((n, n), grid.pitch)
    scene = lg.Scene([lg.Slice(_picture(pattern, grid.shape, rng), grid, dz)])
    light = lg.TiltedWaves(count) if method == "tilted waves" else lg.Snapshots(count, rng=0)
    return lg.simulate(found, scene, light), lg.simulate(found, scene, lg.Incoherent()).data


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--rows", type=Path, default=Path(tempfile.gettempdir()) / "lumigraph-estimates.jsonl"
    )
    parser.add_argument("--cameras", action="store_true")
    options = parser.parse_args()
    rows = [json.loads(r) for r in options.rows.read_text().splitlines()] if options.rows.exists() else []
    rows = [row for row in rows if (row["camera"] == "drawn") == options.cameras]
    seeds = range(options.seed, options.seed + options.count)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lg.SamplingWarning)
        for seed in sorted(set(seeds) - {row["seed"] for row in rows}):
            rows.append(through_drawn_camera(seed) if options.cameras else drawn(seed))
            with options.rows.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
            print(rows[-1], flush=True)
    show([row for row in rows if row["seed"] in seeds])


def show(rows: list[dict[str, Any]]) -> None:
    """How many estimates are good, and how many are too small."""
    print("| method | draws | within a factor 2 | too small by more | median of stated over true |")
    print("|---|---|---|---|---|")
    for method in (*dict.fromkeys(METHODS), "microscope", "white image", "all"):
        ratios = np.array([r["stated"] / r["true"] for r in rows if method in (r["method"], "all")])
        if len(ratios):
            good, low = int(((ratios > 0.5) & (ratios < 2)).sum()), int((ratios <= 0.5).sum())
            print(f"| {method} | {len(ratios)} | {good} | {low} | {np.median(ratios):.2f} |")


if __name__ == "__main__":
    main()
