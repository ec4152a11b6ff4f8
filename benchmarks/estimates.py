"""Errors that raw images state, ``metadata["error"]``, beside the true ones of drawn scenes.

    python -m benchmarks.estimates [--count 60] [--seed 0] [--rows FILE]

Points, edges and fine gratings of a few samples, sums of `references`; tilted waves and snapshots
beside exact incoherent images. An estimate is good within a factor 2 of the truth; a larger one is safe.
"""

import argparse
import json
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import accuracy, accuracy_microscope, references
from benchmarks.periodic_operator import relative
from lumigraph.units import mm, um

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
    options = parser.parse_args()
    rows = [json.loads(r) for r in options.rows.read_text().splitlines()] if options.rows.exists() else []
    seeds = range(options.seed, options.seed + options.count)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lg.SamplingWarning)
        for seed in sorted(set(seeds) - {row["seed"] for row in rows}):
            rows.append(drawn(seed))
            with options.rows.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
            print(rows[-1], flush=True)
    show([row for row in rows if row["seed"] in seeds])


def show(rows: list[dict[str, Any]]) -> None:
    """How many estimates are good, and how many are too small."""
    print("| method | draws | within a factor 2 | too small by more | median of stated over true |")
    print("|---|---|---|---|---|")
    for method in (*dict.fromkeys(METHODS), "microscope", "all"):
        ratios = np.array([r["stated"] / r["true"] for r in rows if method in (r["method"], "all")])
        if len(ratios):
            good, low = int(((ratios > 0.5) & (ratios < 2)).sum()), int((ratios <= 0.5).sum())
            print(f"| {method} | {len(ratios)} | {good} | {low} | {np.median(ratios):.2f} |")


if __name__ == "__main__":
    main()
