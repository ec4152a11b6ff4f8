"""Accuracy that was asked for and that is reached, path by path, against `references`.

    python -m benchmarks.accuracy [--quick] [--only "2.0, m = 0.5" ...]

Numbers are relative rms errors of raw images over the accuracy asked for: up to 1 the promise is kept in the
middle and outside, up to 2 within a lenslet of the border.
"""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import accuracy_microscope, references
from benchmarks.periodic_operator import CAMERAS, operator_images, points, relative
from lumigraph.units import mm

Row = dict[str, Any]

ACCURACIES = (1e-2, 1e-3, 1e-4)
DEPTHS = (-3 * mm, 0.0, 3 * mm)
EVERY = (*CAMERAS, *accuracy_microscope.MICROSCOPES)
LINES = references.Fineness(48, 3, 900, 64)
"""For hexagons, whose lines cost more; good to 1e-5."""


def _places(camera: Any, dz: float) -> dict[str, list[tuple[float, float]]]:
    step = camera.lenslets.pitch * (camera.object_distance + dz) / camera.separation
    edge = camera.lenslets.extent[0] / camera.lenslets.pitch / 2
    at = points(camera, dz)
    outside = [((edge + 1) * step, 0.2 * step), ((edge + 3) * step, -(edge + 2.3) * step)]
    return {"middle": at[:3], "border": at[3:], "outside": outside}


def _simulated(
    camera: Any, dz: float, at: Sequence[tuple[float, float]], accuracy: float
) -> list[np.ndarray]:
    share = np.prod(camera.object_grid.pitch) * (camera.separation / (camera.object_distance + dz)) ** 2
    light = lg.Incoherent(accuracy=accuracy)
    return [lg.simulate(camera, lg.targets.points([(*p, dz)]), light).data / share for p in at]


def rows_of(name: str, depths: Sequence[float], accuracies: Sequence[float]) -> list[Row]:
    """Points and slices of one camera, at some depths."""
    camera, rows = CAMERAS[name](), []
    fineness = references.FINE if camera.lenslets.layout == "square" else LINES
    for dz in depths:
        places = _places(camera, dz)
        everywhere = [p for at in places.values() for p in at]
        truth = dict(zip(everywhere, references.points(camera, dz, everywhere, fineness), strict=True))
        for accuracy in accuracies:
            for path, images in (("points", _simulated), ("slices", operator_images)):
                row = {"path": path, "camera": name, "dz [mm]": f"{dz / mm:g}", "asked": f"{accuracy:g}"}
                for place, at in places.items():
                    if path == "slices" and place == "outside":
                        row[place] = ""
                        continue
                    found = zip(images(camera, dz, at, accuracy), at, strict=True)
                    row[place] = f"{max(relative(i, truth[p]) for i, p in found) / accuracy:.2f}"
                rows.append(row)
    return rows


def white_rows(name: str, accuracies: Sequence[float]) -> list[Row]:
    """White images of one camera of square lenslets, five by five of them and wide pixels."""
    whole = CAMERAS[name]()
    camera = whole.replace(lenslets={"count": (5, 5)}, sensor={"pixel_pitch": whole.lenslets.pitch / 9.1})
    truth = references.white(camera, 48, references.Fineness(64, 3))
    rows = []
    for accuracy in accuracies:
        image = lg.simulate(camera, lg.targets.white(), lg.Incoherent(accuracy=accuracy)).data
        rows.append({
            "path": "white image", "camera": name, "dz [mm]": "", "asked": f"{accuracy:g}",
            "middle": f"{relative(image, truth) / accuracy:.2f}", "border": "", "outside": "",
        })  # fmt: skip
    return rows


def run(only: Sequence[str] = EVERY, *, quick: bool = False) -> list[Row]:
    """Rows of the table."""
    accuracies, depths = (ACCURACIES[:2], DEPTHS[1:2]) if quick else (ACCURACIES, DEPTHS)
    rows = []
    for name in only:
        if name in accuracy_microscope.MICROSCOPES:
            at = accuracy_microscope.DEPTHS[1:2] if quick else accuracy_microscope.DEPTHS
            rows += accuracy_microscope.rows_of(name, at, accuracies)
            continue
        rows += rows_of(name, depths, accuracies)
        if CAMERAS[name]().lenslets.layout == "square":
            rows += white_rows(name, accuracies)
    return rows


def show(rows: Sequence[Row]) -> None:
    """Print a Markdown table."""
    print("| " + " | ".join(rows[0]) + " |\n" + "|---" * len(rows[0]) + "|")
    for row in rows:
        print("| " + " | ".join(map(str, row.values())) + " |")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two accuracies, one depth")
    parser.add_argument("--only", nargs="+", choices=EVERY, default=EVERY)
    options = parser.parse_args()
    show(run(options.only, quick=options.quick))


if __name__ == "__main__":
    main()
