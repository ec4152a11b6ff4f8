"""Errors that raw images state beside the true ones, of cameras from a wide family.

    python -m benchmarks.stated_errors [--count 60] [--seed 0] [--rows FILE]

Square lenslets, 1 to 7 along each axis by themselves, 1.0 and 2.0, with and without gaps, of Fresnel numbers
p²/(λb) of 0.5 to 9. A point, a slice of one sample or a white image, at 1e-2 or 3e-3; beside the quadratures
of `references`, Fresnel sums that share nothing with the operators. An estimate is good within a factor 2 of
the truth; a larger one is safe. Arrays that lean, lenslets of glass and main lenses by prescription are not
among them: no sum of `references` is of these.
"""

import argparse
import json
import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import accuracy, references
from benchmarks.periodic_operator import relative
from lumigraph.units import mm, nm, um

FINE = references.Fineness(lenslet=48, pixel=4, pupil=600, spline=64)
"""Of the sums: 1e-5 of images, a hundredth of what is asked."""

FACTOR = 2.0
"""Between the stated and the true error, of an estimate that is good."""


def camera(rng: np.random.Generator) -> Any:
    """A small one."""
    number, pitch = float(np.exp(rng.uniform(np.log(0.5), np.log(9)))), float(rng.uniform(50, 120)) * um
    wavelength, length = float(rng.uniform(450, 650)) * nm, float(rng.uniform(40, 80)) * mm
    distance = pitch**2 / (wavelength * number)
    magnification = 0.0 if rng.random() < 0.5 else float(rng.uniform(0.2, 0.6))
    lenslets: dict[str, Any] = {
        "pitch": pitch, "focal_length": distance / (1 + magnification),
        "count": tuple(int(n) for n in rng.integers(1, 8, 2)),
    }  # fmt: skip
    if rng.random() < 1 / 3:
        lenslets["fill_factor"] = float(rng.uniform(0.85, 0.98))
    parts: dict[str, Any] = {
        "wavelength": wavelength, "object_distance": 2 * length, "main_lens": {"focal_length": length},
        "sensor": {"pixel_pitch": float(rng.uniform(0.06, 0.1)) * pitch},
    }  # fmt: skip
    if magnification:
        lenslets["magnification"] = magnification
        return lg.FocusedPlenopticCamera(lenslets=lenslets, **parts)
    return lg.PlenopticCamera(lenslets=lenslets, **parts)


def drawn(seed: int) -> dict[str, Any]:
    """Stated and true error of one draw."""
    rng = np.random.default_rng(seed)
    found, dz = camera(rng), float(rng.uniform(-3, 5)) * mm
    asked, method = float(rng.choice([1e-2, 3e-3])), str(rng.choice(("point", "slice", "white image")))
    step = found.lenslets.pitch * (found.object_distance + dz) / found.separation
    y, x = (float(rng.uniform(-0.5, 0.5) * n * step) for n in found.lenslets.count)
    turns = found.lenslets.pitch * max(found.lenslets.extent) / (found.wavelength * found.lenslet_distance)
    fine = replace(FINE, lenslet=max(FINE.lenslet, 10 + math.ceil(2 * turns)))
    if method == "white image":
        scene, truth = lg.targets.white(), references.white(found, 20, fine)
    else:
        grid = lg.Grid((1, 1), 1 * um, (y, x))
        truth = references.points(found, dz, [(y, x)], fine)[0]
        truth *= accuracy._share(found, dz, None if method == "point" else float(np.prod(grid.pitch)))
        one = lg.Slice(np.ones((1, 1), np.float32), grid, dz)
        scene = lg.targets.points([(y, x, dz)]) if method == "point" else lg.Scene([one])
    raw = lg.simulate(found, scene, lg.Incoherent(accuracy=asked))
    number = found.lenslets.pitch**2 / (found.wavelength * found.lenslet_distance)
    return {
        "seed": seed, "method": method, "asked": asked, "count": found.lenslets.count, "fresnel": number,
        "m": getattr(found.lenslets, "magnification", 0.0), "fill": found.lenslets.fill_factor,
        "stated": raw.metadata["error"]["rms"], "true": relative(raw.data, truth),
    }  # fmt: skip


def main() -> None:
    """Print each draw, and how many states the truth within a factor."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rows", type=Path)
    given, rows = parser.parse_args(), []
    warnings.simplefilter("ignore")
    for seed in range(given.seed, given.seed + given.count):
        rows.append(row := drawn(seed))
        print(
            f"{row['seed']:5d} {row['method']:12s} {row['count']} N {row['fresnel']:.2f} m {row['m']:.2f} "
            f"fill {row['fill']:.2f} asked {row['asked']:.0e} stated {row['stated']:.1e} "
            f"true {row['true']:.1e} ratio {row['stated'] / row['true']:.2f}",
            flush=True,
        )
    ratios = np.array([row["stated"] / row["true"] for row in rows])
    good = (ratios > 1 / FACTOR) & (ratios < FACTOR)
    print(f"{good.sum()} of {len(rows)} within a factor {FACTOR:g}, {(ratios < 1 / FACTOR).sum()} too small")
    if given.rows is not None:
        given.rows.write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
