"""Slices before drawn cameras of all kinds of lenslets: do they keep what was asked?

    python -m benchmarks.drawn [--count 20] [--seed 0] [--rows FILE]

Cameras 1.0, 2.0 and Galilean of 6 x 6 or 7 x 6 square, round and hexagonal lenslets, with gaps or without, of
one kind or three. Pictures of noise, of an edge and of five samples, at 1e-2 and 1e-3, are compared with an
operator at 2e-4, and that one's samples in the middle and at the border with `references`. Numbers are
relative rms errors over what was asked. Cameras that take long are left out. Rows are kept in a file as
they come.
"""

import argparse
import json
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import accuracy
from benchmarks.periodic_operator import relative
from lumigraph.operators.periodic.kernels import operations
from lumigraph.operators.sampling.optics import Optics
from lumigraph.units import mm, nm, um

ASKED, FINER = (1e-2, 1e-3), 2e-4

MOST = 3e12
"""Operations that building the finer operator may take: what takes longer is left out."""


def camera(rng: np.random.Generator) -> Any:
    """Of few lenslets of any shape and layout."""
    length, pitch = float(rng.uniform(40, 110)) * mm, float(rng.uniform(60, 140)) * um
    layout = str(rng.choice(("square", "hex")))
    shape = str(rng.choice(("round", layout)))
    focal = pitch * float(rng.uniform(18, 45))
    kinds = layout == "hex" and rng.random() < 0.5
    lenslets: dict[str, Any] = {
        "pitch": pitch, "focal_length": (focal, 1.04 * focal, 0.96 * focal) if kinds else focal,
        "count": (7, 6) if layout == "hex" else (6, 6), "layout": layout, "shape": shape,
    }  # fmt: skip
    if shape != "hex" and rng.random() < 0.5:
        lenslets["fill_factor"] = float(rng.uniform(0.85, 0.98))
    parts: dict[str, Any] = {
        "wavelength": 550 * nm, "object_distance": float(rng.uniform(1.8, 3)) * length,
        "main_lens": {"focal_length": length}, "sensor": {"pixel_pitch": pitch / 12},
    }  # fmt: skip
    if not kinds and rng.random() < 0.3:
        return lg.PlenopticCamera(lenslets=lenslets, **parts)
    lenslets["magnification"] = float(rng.choice((0.25, 0.35, 0.5, -0.4)))
    return lg.FocusedPlenopticCamera(lenslets=lenslets, **parts)


def pictures(shape: tuple[int, int], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Noise, an edge, and five samples within the middle."""
    few = np.zeros(shape, np.float32)
    few[tuple(rng.integers(n // 4, 3 * n // 4, 5) for n in shape)] = 1
    edge = np.broadcast_to(np.arange(shape[1]) > 0.47 * shape[1], shape).astype(np.float32)
    return {"noise": rng.random(shape, np.float32), "edge": edge, "samples": few}


def drawn(seed: int) -> dict[str, Any]:
    """Errors of one camera, over what was asked, and seconds."""
    rng, start = np.random.default_rng(seed), time.perf_counter()
    found = camera(rng)
    dz = float(rng.choice((0, 0.01, -0.01))) * found.object_distance
    known: dict[str, Any] = {"seed": seed, "camera": described(found), "dz": round(dz / mm, 2)}
    count = operations(Optics.of(found.optics(), found.object_distance + dz, FINER).bricks)
    if count > MOST:
        return {**known, "operations": count}
    finer, *others = (found.operator([dz], accuracy=a) for a in (FINER, *ASKED))
    scenes = pictures(finer.shape[1][1:], rng)
    for name, picture in scenes.items():
        truth = finer.forward(picture[None])
        off = (relative(o.forward(picture[None]), truth) / a for o, a in zip(others, ASKED, strict=True))
        known[name] = [round(value, 2) for value in off]
    known["single"] = single(found, dz)
    return {**known, "s": round(time.perf_counter() - start)}


def single(found: Any, dz: float) -> dict[str, float]:
    """Of slices of one sample beside references, the worst of each place, at the finer accuracy."""
    off = accuracy._slices(found, accuracy.Cell("slices", "drawn", dz, FINER))
    return {place: round(value / FINER, 2) for place, value in off.items()}


def described(found: Any) -> str:
    """In one line."""
    own = found.lenslets
    kinds = "one kind" if len(set(np.atleast_1d(own.focal_length))) == 1 else "three kinds"
    number = own.pitch**2 / (found.wavelength * found.lenslet_distance)
    kind = "1.0" if isinstance(found, lg.PlenopticCamera) else f"2.0, m = {own.magnification:g}"
    shape = f"{own.layout}, {own.shape}, {kinds}, fill {own.fill_factor:.2f}"
    return f"{kind}, {shape}, Fresnel number {number:.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=Path, default=Path(tempfile.gettempdir()) / "lumigraph-drawn.jsonl")
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
    show([row for row in rows if row["seed"] in seeds and "noise" in row])


def show(rows: list[dict[str, Any]]) -> None:
    """The worst of each picture."""
    for name in ("noise", "edge", "samples"):
        worst = [max(row[name][k] for row in rows) for k in range(len(ASKED))]
        print(name, *(f"{w:.2f} of {a:g}" for w, a in zip(worst, ASKED, strict=True)))


if __name__ == "__main__":
    main()
