"""The lenslet-periodic operator: error against sums of full propagations, transpose, speed and memory.

Errors are relative rms of the raw images of single points, each with its own power, in the middle of small
arrays and near their border, against `_point_sums`: quadrature for square lenslets, propagation for hexagons,
and what those two and finer runs of them differ by; "not paraxial" is what exact spheres and plane waves
would change. Speed is that of the thesis' Table 5.1 camera, 39 x 39
lenslets, USAF target, with nothing kept, against 350 snapshots (`plenoptic_snapshots`, extrapolated from a
few). Every measurement has a process of its own.

    python -m benchmarks.periodic_operator [--quick] [--only accuracy adjoint ...] [--counts 39 101 201]
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import _point_sums, plenoptic_snapshots
from lumigraph.core import memory
from lumigraph.core.arrays import WORKERS
from lumigraph.operators import periodic_operator
from lumigraph.operators.periodic.sizes import build_bytes
from lumigraph.operators.sampling.optics import Optics
from lumigraph.units import mm, nm, um

Row = dict[str, Any]
SUITES = ("accuracy", "adjoint", "speed", "cost", "large")
COUNTS = (39, 101, 201)
DEPTHS = (1, 3)
AREA = (1 * um) ** 2
"""Of the object sample that stands for a point."""

GIB = 2**30


def camera(**lenslets: Any) -> lg.FocusedPlenopticCamera:
    """A small camera 2.0, as the thesis' in all lengths but the pitch."""
    parts: dict[str, Any] = {
        "main_lens": {"focal_length": 60 * mm},
        "lenslets": {
            "pitch": 100 * um, "focal_length": 5.2 * mm, "count": (7, 7), "magnification": 0.5, **lenslets
        },
        "sensor": {"pixel_pitch": 6 * um},
    }  # fmt: skip
    return lg.FocusedPlenopticCamera(wavelength=633 * nm, object_distance=120 * mm, **parts)


def plenoptic() -> lg.PlenopticCamera:
    """A small camera 1.0."""
    parts: dict[str, Any] = {
        "main_lens": {"focal_length": 120 * mm},
        "lenslets": {"pitch": 110 * um, "focal_length": 10 * mm, "count": (7, 7)},
        "sensor": {"pixel_pitch": 9 * um},
    }
    return lg.PlenopticCamera(wavelength=633 * nm, object_distance=240 * mm, **parts)


CAMERAS: dict[str, Callable[[], Any]] = {
    "2.0, m = 0.5": camera,
    "2.0, m = 0.3": lambda: camera(magnification=0.3),
    "2.0, m = 0.25": lambda: camera(magnification=0.25),
    "2.0, Galilean": lambda: camera(magnification=-0.4, focal_length=8 * mm),
    "2.0, hexagonal": lambda: camera(layout="hex", count=(8, 7)),
    "2.0, three kinds": lambda: camera(
        layout="hex", count=(8, 7), focal_length=(5.2 * mm, 5 * mm, 5.4 * mm), shape="round"
    ),
    "1.0": plenoptic,
}


def points(found: Any, dz: float) -> list[tuple[float, float]]:
    """Three points that the middle lenslets see, and two within a lenslet of the border."""
    step = found.lenslets.pitch * (found.object_distance + dz) / found.separation
    edge = [e / found.lenslets.pitch / 2 - 0.7 for e in found.lenslets.extent]
    at = [(0.1, -0.23), (0.45, 0.5), (-0.9, 0.31), (edge[0], 0.2), (-edge[0], edge[1])]
    return [(y * step, x * step) for y, x in at]


def relative(image: np.ndarray, reference: np.ndarray) -> float:
    """Relative rms difference."""
    return float(np.linalg.norm(image - reference) / np.linalg.norm(reference))


def operator_images(found: Any, dz: float, at: Sequence[tuple[float, float]], accuracy: float) -> list:
    """Raw images of points, for 1 of light on the lenslets, by the operator."""
    share = AREA * (found.separation / (found.object_distance + dz)) ** 2
    images = []
    for point in at:
        grid = lg.Grid((1, 1), AREA**0.5, point)
        images.append(periodic_operator(found, grid, dz, accuracy=accuracy).forward(np.ones((1, 1))) / share)
    return images


def accuracy_of(name: str, dz: float, accuracies: Sequence[float]) -> list[Row]:
    """Errors of one camera at a depth, and those of the references."""
    found = CAMERAS[name]()
    at, hexagonal = points(found, dz), found.lenslets.layout == "hex"
    coarse = _point_sums.Fineness(768, 96)
    fine = _point_sums.Fineness(1024, 288)
    coarsest = _point_sums.by_propagation(found, dz, at[:1], coarse)[0]
    if hexagonal:
        reference = _point_sums.by_propagation(found, dz, at, fine)
        own, other = relative(coarsest, reference[0]), None
    else:
        reference = _point_sums.by_quadrature(found, dz, at, 128, 8)
        own = max(map(relative, _point_sums.by_quadrature(found, dz, at, 80), reference))
        other = relative(_point_sums.by_propagation(found, dz, at[:1], fine)[0], reference[0])
    exact = _point_sums.by_propagation(found, dz, at[:1], coarse, paraxial=False)[0]
    rows = []
    for accuracy in accuracies:
        images = operator_images(found, dz, at, accuracy)
        errors = [relative(*pair) for pair in zip(images, reference, strict=True)]
        rows.append({
            "camera": name, "dz [mm]": dz / mm, "accuracy": f"{accuracy:g}",
            "middle": f"{np.sqrt(np.mean(np.square(errors[:3]))):.1e}",
            "border": f"{np.sqrt(np.mean(np.square(errors[3:]))):.1e}",
            "met": "yes" if np.sqrt(np.mean(np.square(errors[:3]))) <= accuracy else "no",
            "light": f"{np.mean([i.sum() / r.sum() for i, r in zip(images, reference, strict=True)]):.5f}",
            "reference, halved": f"{own:.0e}",
            "two references": "" if other is None else f"{other:.0e}",
            "not paraxial": f"{relative(exact, coarsest):.0e}",
        })  # fmt: skip
    return rows


def adjoint_of(name: str) -> list[Row]:
    """⟨Ax, y⟩ and ⟨x, Aᵀy⟩ in float32."""
    operator, rng = CAMERAS[name]().operator(accuracy=1e-3), np.random.default_rng(1)
    x, y = (rng.random(shape, np.float32) for shape in reversed(operator.shape))
    left = float((operator.forward(x).astype(float) * y).sum())
    right = float((x * operator.adjoint(y).astype(float)).sum())
    return [{"camera": name, "<Ax, y>": f"{left:.7g}", "difference": f"{abs(left - right) / abs(left):.1e}"}]


def first_image(count: int, depths: int, repeats: int, pixel: float = 1.0) -> list[Row]:
    """Seconds and memory of the Table 5.1 camera with so many lenslets along a side, and wider pixels."""
    found = plenoptic_snapshots.camera()
    sensor = {"pixel_pitch": pixel * found.sensor.pixel_pitch}
    found = found.replace(lenslets={"count": (count, count)}, sensor=sensor)
    if depths > 1:
        found_depths: Any = tuple(np.linspace(-4 * mm, 4 * mm, depths))
    else:
        found_depths = 0.0
    grid = found.object_grid
    scene: Any = lg.targets.usaf1951(grid) if count >= COUNTS[0] else lg.targets.siemens_star(grid)
    target = np.asarray(scene.parts[0].intensity, np.float32)
    full = np.zeros(grid.shape, np.float32)
    top, left = ((n - m) // 2 for n, m in zip(grid.shape, target.shape, strict=True))
    full[top : top + target.shape[0], left : left + target.shape[1]] = target
    picture = full if depths == 1 else np.stack([full] * depths)
    before, start = _peak(), time.perf_counter()
    building = build_bytes(Optics.of(found, found.object_distance, 1e-3).bricks, WORKERS) / GIB
    operator = periodic_operator(found, grid, found_depths)
    built = time.perf_counter() - start
    predicted = before + max(building, operator.memory_bytes / GIB)
    image = operator.forward(picture)
    first, next_ones, pixels = time.perf_counter() - start, [], image.shape[0]
    del image
    for _ in range(repeats):
        start = time.perf_counter()
        operator.forward(picture)
        next_ones.append(time.perf_counter() - start)
    return [{
        "lenslets": f"{count}²", "depths": depths, "pixels": f"{pixels}²", "build s": round(built, 2),
        "first image s": round(first, 2), "next s, median": round(median(next_ones), 3),
        "peak GiB": round(_peak(), 2), "predicted GiB": round(predicted, 2), "of it before": round(before, 2),
        "matrices MiB": round(sum(p.matrix.nbytes for p in operator.planes) / 2**20, 1),
    }]  # fmt: skip


def fast(pitch: float, focal_length: float, count: int) -> lg.PlenopticCamera:
    """A camera 1.0 of fast lenslets; lengths in micrometres."""
    parts: dict[str, Any] = {
        "main_lens": {"focal_length": 30 * mm},
        "lenslets": {"pitch": pitch * um, "focal_length": focal_length * um, "count": (count, count)},
        "sensor": {"pixel_pitch": pitch / 10 * um},
    }
    return lg.PlenopticCamera(wavelength=550 * nm, object_distance=240 * mm, **parts)


LARGE: dict[str, tuple[Callable[[], Any], float]] = {
    "f/4, 14 um, 1.0": (lambda: fast(14, 56, 39), 1e-3),
    "f/2, 14 um, 1.0": (lambda: fast(14, 28, 101), 1e-2),
    "Galilean": (lambda: lg.FocusedPlenopticCamera.from_catalogue("galilean"), 1e-3),
    "m = 0.25": (lambda: lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m025"), 1e-4),
    "f/4, 40 um, 1.0": (lambda: fast(40, 160, 39), 1e-3),
    "multi-focus": (lambda: lg.FocusedPlenopticCamera.from_catalogue("multi-focus-hex"), 1e-3),
}


def large_of(name: str) -> list[Row]:
    """Processor seconds and memory of the first image and of the next, a star over the whole field."""
    make, accuracy = LARGE[name]
    found = make()
    part: Any = lg.targets.siemens_star(found.object_grid).parts[0]
    target, before, start = np.asarray(part.intensity, np.float32), _peak(), time.process_time()
    operator = periodic_operator(found, part.grid, accuracy=accuracy)
    operator.forward(target)
    first = time.process_time()
    operator.forward(target)
    return [{
        "camera": name, "accuracy": accuracy, "first image, CPU s": round(first - start, 1),
        "next, CPU s": round(time.process_time() - first, 2), "peak GiB": round(_peak(), 2),
        "of it before": round(before, 2), "held": type(operator.planes[0].matrix).__name__ == "Matrix",
    }]  # fmt: skip


def snapshots(which: str) -> list[Row]:
    """Median seconds of one snapshot, None without Octave."""
    measured = getattr(plenoptic_snapshots, f"{which}_seconds")(count=2)
    return [{"seconds": None if measured is None else median(measured)}]


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def apart(function: str, *arguments: Any) -> list[Row]:
    """What a function of this file gives in a process of its own, with nothing kept on disk."""
    words = [
        sys.executable,
        "-m",
        "benchmarks.periodic_operator",
        "--call",
        json.dumps([function, *arguments]),
    ]
    environment = {**os.environ, "LUMIGRAPH_CACHE": "off"}
    done = subprocess.run(words, env=environment, capture_output=True, text=True)
    if done.returncode:
        return [{"failed": " ".join(words[3:]), "because": (done.stderr.splitlines() or [""])[-1]}]
    return json.loads(done.stdout.splitlines()[-1])


def accuracy_rows(quick: bool) -> list[Row]:
    """Every camera, at focus and, for one, 3 mm beyond it."""
    accuracies = [1e-3] if quick else [1e-3, 1e-4]
    cases = [(name, 0.0) for name in CAMERAS] + [("2.0, m = 0.5", 3 * mm)]
    if quick:
        cases = cases[:1]
    return [row for name, dz in cases for row in apart("accuracy_of", name, dz, accuracies)]


def speed_rows(quick: bool) -> list[Row]:
    """The operator beside 350 snapshots."""
    (mine,) = apart("first_image", 39, 1, 2 if quick else 7)
    rows = [{"method": "operator, accuracy 1e-3", **mine}]
    if "failed" in mine:
        return [mine]
    for name, which in (
        ("Octave", "octave_snapshot"),
        ("SciPy", "scipy_snapshot"),
        ("lumigraph", "snapshots"),
    ):
        (found,) = apart("snapshots", which)
        seconds = found.get("seconds")
        row = {"method": f"350 snapshots, {name}", **dict.fromkeys(mine, "")}
        if seconds is None:
            row["pixels"] = "octave-cli is not installed" if which.startswith("octave") else str(found)
        else:
            whole = plenoptic_snapshots.THESIS_SNAPSHOTS * seconds
            row["first image s"] = f"{whole:.0f}, {whole / mine['first image s']:.0f} times"
            row["next s, median"] = f"{whole / mine['next s, median']:.0f} times"
        rows.append(row)
    return rows


def cost_rows(counts: Sequence[int], quick: bool) -> list[Row]:
    """Lenslet counts with one depth, then depths with the first count; 45 pixels to a lenslet."""
    rows = []
    for count, depths in [(n, 1) for n in counts] + [(counts[0], d) for d in DEPTHS[1:]]:
        needed, free = 3.0e5 * count**2, memory.available()
        if free is not None and needed > free:
            rows.append(
                {"skipped": f"{count}² lenslets need some {needed / GIB:.1f} GiB, {free / GIB:.1f} are free"}
            )
        else:
            rows += apart("first_image", count, depths, 1 if quick else 3, 2.0)
    return rows


def run(
    only: Sequence[str] = SUITES, counts: Sequence[int] = COUNTS, *, quick: bool = False
) -> list[tuple[str, list[Row]]]:
    """Title and rows of each table."""
    tables: dict[str, tuple[str, Callable[[], list[Row]]]] = {
        "accuracy": ("Relative rms error of single points", lambda: accuracy_rows(quick)),
        "adjoint": (
            "<Ax, y> and <x, Aᵀy>, float32",
            lambda: [
                row for name in list(CAMERAS)[: 1 if quick else None] for row in apart("adjoint_of", name)
            ],
        ),
        "speed": ("Table 5.1 camera, USAF target, nothing kept", lambda: speed_rows(quick)),
        "cost": ("Lenslets and depths", lambda: cost_rows(counts, quick)),
        "large": (
            "Cameras of many points and samples a cell",
            lambda: [row for name in list(LARGE)[: 1 if quick else None] for row in apart("large_of", name)],
        ),
    }
    return [(tables[name][0], tables[name][1]()) for name in SUITES if name in only]


def show(tables: Sequence[tuple[str, list[Row]]]) -> None:
    """Print every table; rows of other columns than the first's stand below it."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=150)
    for title, rows in tables:
        table = Table(*rows[0], title=title, title_justify="left")
        for row in rows:
            if row.keys() == rows[0].keys():
                table.add_row(*(str(value) for value in row.values()))
        console.print(table)
        for row in rows:
            if row.keys() != rows[0].keys():
                console.print(row)


def main() -> None:
    """Run what is asked for, or one measurement for a process that asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="little of everything")
    parser.add_argument("--only", nargs="+", choices=SUITES, default=SUITES)
    parser.add_argument("--counts", nargs="+", type=int, default=COUNTS)
    parser.add_argument("--call", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.call:
        function, *arguments = json.loads(options.call)
        print(json.dumps(globals()[function](*arguments)))
        return
    for name in options.only:  # each table as soon as it is there
        show(run([name], options.counts, quick=options.quick))


if __name__ == "__main__":
    main()
