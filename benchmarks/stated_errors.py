"""Errors that raw images state beside the true ones, of cameras from a wide family.

    python -m benchmarks.stated_errors [--count 60] [--seed 0] [--rows FILE] [--write]

Square lenslets, 1 to 7 along each axis by themselves, 1.0 and 2.0, with and without gaps, of Fresnel numbers
p²/(λb) of 0.5 to 9. A point, one before an array that leans, a slice of one sample, a white image or tilted
waves, at 1e-2 or 3e-3; beside the quadratures of `references`, Fresnel sums that share nothing with the
operators (tilted waves beside the incoherent image). An estimate is good within a factor 2 of the truth; a
larger one is safe. `--write` puts the table into docs/validation/operator.md. Lenslets of glass and main
lenses by prescription are not among them: no sum of `references` is of these.
"""

import argparse
import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import accuracy, references
from benchmarks.periodic_operator import relative
from lumigraph.instruments import Built
from lumigraph.units import mm, nm, um

METHODS = ("point", "leaning", "slice", "white image", "tilted waves")

DOCUMENT = Path(__file__).parents[1] / "docs" / "validation" / "operator.md"
MARKS = "<!-- stated: python -m benchmarks.stated_errors --write -->", "<!-- end of stated -->"

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


def fineness(found: Any) -> references.Fineness:
    """Nodes that follow the light from one end of the array to the other."""
    turns = found.lenslets.pitch * max(found.lenslets.extent) / (found.wavelength * found.lenslet_distance)
    return references.Fineness(lenslet=max(48, 30 + math.ceil(2.4 * turns)), pixel=7, pupil=600, spline=64)


def across_stop(found: Any) -> int:
    """Nodes across the stop, for the fringes of lenslets at both ends of the array."""
    turns = found.pupil_diameter * max(found.lenslets.extent) / (found.wavelength * found.separation)
    return 40 + math.ceil(1.6 * turns)


def leaning(found: Any, dz: float, at: references.Point) -> np.ndarray:
    """Raw image (ny, nx) of a point for 1 of light, each lenslet at its own distances from lens and sensor.

    Light arrives λ/δ turns later at a lenslet δ farther, and as much earlier from there on the sensor.
    """
    fine, total, pitch, level = (
        fineness(found),
        np.zeros(()),
        found.lenslets.pitch,
        found.replace(built=Built()),
    )
    for middle in found.lattice.position(found.lenslets.indices()).tolist():
        away = found.lean.of_array(*middle)
        made = Built(separation=level.separation + away, lenslet_distance=level.lenslet_distance - away)
        local = level.replace(built=made)
        relay, light = references.Relay(local, fine), references.Lens(local, dz, fine).light(at)
        assert relay._separable is not None
        y, x, down, across = relay._separable
        rows, columns = np.abs(y - middle[0]) < pitch / 2, np.abs(x - middle[1]) < pitch / 2
        total = total + down[:, rows] @ light(y[rows], x[columns]) @ across[:, columns].T
    return references.Relay(level, fine).pixels(np.abs(total) ** 2)


def tilted(found: Any, dz: float, rng: np.random.Generator) -> tuple[Any, np.ndarray]:
    """Raw image of a picture by 16 to 60 tilted waves, and the incoherent one (ny, nx)."""
    grid = found.object_grid
    grid = lg.Grid(tuple(max(4, n // 3) for n in grid.shape), grid.pitch)
    scene = lg.Scene([lg.Slice(rng.random(grid.shape, np.float32), grid, dz)])
    raw = lg.simulate(found, scene, lg.TiltedWaves(int(rng.choice([16, 30, 60]))))
    return raw, lg.simulate(found, scene, lg.Incoherent(1e-3)).data


def drawn(seed: int) -> dict[str, Any]:
    """Stated and true error of one draw."""
    rng = np.random.default_rng(seed)
    found, dz = camera(rng), float(rng.uniform(-3, 5)) * mm
    asked, method = float(rng.choice([1e-2, 3e-3])), str(rng.choice(METHODS))
    step = found.lenslets.pitch * (found.object_distance + dz) / found.separation
    y, x = (float(rng.uniform(-0.5, 0.5) * n * step) for n in found.lenslets.count)
    light: Any = lg.Incoherent(accuracy=asked)
    one = lg.Slice(np.ones((1, 1), np.float32), lg.Grid((1, 1), 1 * um, (y, x)), dz)
    if method == "tilted waves":
        raw, truth = tilted(found, dz, rng)
    elif method == "white image":
        raw = lg.simulate(found, lg.targets.white(), light)
        truth = references.white(found, across_stop(found), fineness(found))
    else:
        if method == "leaning":
            lean = tuple(float(v) * 1e-3 for v in rng.uniform(-20, 20, 2))
            found = found.replace(built={"array_tilt": lean})
            truth = leaning(found, dz, (y, x))
        else:
            truth = references.points(found, dz, [(y, x)], fineness(found))[0]
        truth *= accuracy._share(found, dz, float(np.prod(one.grid.pitch)) if method == "slice" else None)
        scene = lg.Scene([one]) if method == "slice" else lg.targets.points([(y, x, dz)])
        raw = lg.simulate(found, scene, light)
    number = found.lenslets.pitch**2 / (found.wavelength * found.lenslet_distance)
    return {
        "seed": seed, "method": method, "asked": asked, "count": found.lenslets.count, "fresnel": number,
        "m": getattr(found.lenslets, "magnification", None) or 0.0, "fill": found.lenslets.fill_factor,
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
    parser.add_argument("--write", action="store_true")
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
    print("\n".join(table(rows)))
    if given.rows is not None:
        given.rows.write_text(json.dumps(rows))
    if given.write:
        text = DOCUMENT.read_text()
        before, after = text.split(MARKS[0])[0], text.split(MARKS[1])[1]
        DOCUMENT.write_text("\n".join([before + MARKS[0], "", *table(rows), "", MARKS[1] + after]))


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Lines of the table: by method, how many state the truth within a factor."""
    lines = [
        "| | draws | within a factor 2 | stated less than half | stated / true, quartiles | most of asked |",
        "|---|---|---|---|---|---|",
    ]
    for name in (*METHODS, "all"):
        mine = [row for row in rows if name in (row["method"], "all")]
        if not mine:
            continue
        ratios = np.array([row["stated"] / row["true"] for row in mine])
        good = ((ratios > 1 / FACTOR) & (ratios < FACTOR)).sum()
        quarters = ", ".join(f"{value:.2f}" for value in np.percentile(ratios, (25, 50, 75)))
        asked = [row["true"] / row["asked"] for row in mine if row["method"] != "tilted waves"]
        worst = f"{max(asked):.2f}" if asked and name != "tilted waves" else "–"
        lines.append(
            f"| {name} | {len(mine)} | {good} | {(ratios < 1 / FACTOR).sum()} | {quarters} | {worst} |"
        )
    return lines


if __name__ == "__main__":
    main()
