"""Accuracy that was asked for and that is reached: every path, camera and place, against `references`.

    python -m benchmarks.accuracy [--write] [--only "2.0, hexagonal" ...] [--rows FILE]

Numbers are relative rms errors of raw images, the worst of each place, over the accuracy asked for: up to 1
the promise is kept in the middle and outside the array, up to 2 within a lenslet of its border. Rows are kept
in a file as they come; a run that was stopped goes on. `--write` puts the table into
docs/validation/operator.md.
"""

import argparse
import json
import math
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lumigraph as lg
from benchmarks import accuracy_microscope, references
from benchmarks.periodic_operator import CAMERAS as LARGER
from benchmarks.periodic_operator import camera, relative
from lumigraph.units import mm, um

ACCURACIES = (1e-2, 1e-3, 1e-4)
DEPTHS = (-3 * mm, 0.0, 3 * mm)
PLACES = ("middle", "border", "outside")
DOCUMENT = Path(__file__).parents[1] / "docs" / "validation" / "operator.md"
MARKS = "<!-- accuracy: python -m benchmarks.accuracy --write -->", "<!-- end of accuracy -->"
SQUARE = references.Fineness(72, 4, 900, 64)
"""Converged to 1e-6 and better."""

Place = tuple[float, float]


def _small(name: str) -> Callable[[], Any]:
    count = (6, 5) if name in ("2.0, hexagonal", "2.0, three kinds") else (5, 5)
    return lambda: LARGER[name]().replace(lenslets={"count": count})


CAMERAS: dict[str, Callable[[], Any]] = {
    name: _small(name) for name in ("2.0, m = 0.5", "2.0, m = 0.25", "2.0, Galilean", "1.0")
}
CAMERAS |= {
    "single lens": lambda: lg.SingleLensCamera(
        wavelength=633e-9, object_distance=120 * mm,
        main_lens={"focal_length": 60 * mm, "diameter": 3.75 * mm},
        sensor={"pixel_pitch": 6 * um, "shape": (97, 97)},
    ),
    "2.0, square, gaps": lambda: camera(fill_factor=0.9, count=(7, 7)),
    "2.0, round": lambda: camera(shape="round", fill_factor=0.9, count=(5, 5)),
    "2.0, hexagonal": _small("2.0, hexagonal"),
    "2.0, three kinds": _small("2.0, three kinds"),
}  # fmt: skip
EVERY = (*CAMERAS, *accuracy_microscope.MICROSCOPES)


class Cell(NamedTuple):
    """What is measured at once: a path through a camera at a depth, and the accuracy asked for."""

    path: str
    camera: str
    dz: float
    asked: float

    @property
    def key(self) -> str:
        """In the file of rows."""
        return f"{self.path}; {self.camera}; {self.dz / mm:g}; {self.asked:g}"


def cells(only: Sequence[str] = EVERY) -> Iterator[Cell]:
    """All of the table, what takes longest last."""
    for asked in ACCURACIES:
        for name in (name for name in only if name in CAMERAS):
            for dz in DEPTHS:
                yield Cell("points", name, dz, asked)
                if dz == 0 or asked > 1e-4:  # matrices at 1e-4 take minutes
                    yield Cell("slices", name, dz, asked)
            if name != "single lens":
                yield Cell("white image", name, 0.0, asked)
            yield Cell("volume", name, 0.0, asked)
            yield Cell("colours", name, 0.0, asked)
        for name in (name for name in only if name in accuracy_microscope.MICROSCOPES):
            for dz in accuracy_microscope.DEPTHS:
                for path in ("points", "slices"):
                    yield Cell(path, name, dz, asked)


def measured(cell: Cell) -> dict[str, str]:
    """Errors over the accuracy asked for, by place; "refused" where there is no image."""
    ways: dict[str, Callable[[Any, Cell], dict[str, float]]] = {
        "points": _points, "slices": _slices, "white image": _white, "volume": _volume, "colours": _colours,
    }  # fmt: skip
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", lg.SamplingWarning)
            if cell.camera in accuracy_microscope.MICROSCOPES:
                off = accuracy_microscope.errors(cell.camera, cell.path, cell.dz, cell.asked)
            else:
                off = ways[cell.path](CAMERAS[cell.camera](), cell)
    except lg.SamplingError:
        return {"middle": "refused"}
    return {place: f"{value / cell.asked:.2f}" for place, value in off.items()}


def _points(found: Any, cell: Cell) -> dict[str, float]:
    def image(place: Place) -> np.ndarray:
        return _simulated(found, lg.targets.points([(*place, cell.dz)]), cell) / _share(found, cell.dz)

    return _worst(found, cell, _places(found, cell.dz), image)


def _slices(found: Any, cell: Cell) -> dict[str, float]:
    """Of slices of one sample."""

    def image(place: Place) -> np.ndarray:
        scene = lg.Scene([lg.Slice(np.ones((1, 1), np.float32), lg.Grid((1, 1), 1 * um, place), cell.dz)])
        return _simulated(found, scene, cell) / _share(found, cell.dz, (1 * um) ** 2)

    places = {k: at for k, at in _places(found, cell.dz).items() if k != "outside"}
    return _worst(found, cell, places, image)


def _volume(found: Any, cell: Cell) -> dict[str, float]:
    """Of three planes of a sample each, side by side."""
    grid = lg.Grid((1, 3), 0.1 * found.object_grid.size[0])
    data = np.eye(3, dtype=np.float32)[:, None, :]
    image = _simulated(found, lg.Volume(data, grid, DEPTHS), cell)
    area, truth = float(np.prod(grid.pitch)), np.zeros(image.shape)
    for dz, x in zip(DEPTHS, grid.x.tolist(), strict=True):
        truth += _share(found, dz, area) * _truth(found, dz, [(float(grid.y[0]), x)])[0]
    return {"middle": relative(image, truth)}


def _colours(found: Any, cell: Cell) -> dict[str, float]:
    """Of a slice of one sample of three colours and equal brightness."""
    spectrum, place = lg.Spectrum.rgb(), _places(found, 0.0)["middle"][0]
    scene = lg.Scene([lg.Slice(np.ones((1, 1, 3), np.float32), lg.Grid((1, 1), 1 * um, place), 0.0)])
    image = _simulated(found, scene, cell, spectrum)
    tuned = [found.replace(wavelength=w) for w in spectrum.wavelengths]
    truth = [_share(t, 0.0, (1 * um) ** 2) * _truth(t, 0.0, [place])[0] for t in tuned]
    return {"middle": max(relative(image[..., k], t) for k, t in enumerate(truth))}


def _white(whole: Any, cell: Cell) -> dict[str, float]:
    """Three by three lenslets, or nearly, and wide pixels: the stop is sampled by hundreds of waves."""
    count = (4, 3) if whole.lenslets.layout == "hex" else (3, 3)
    found = whole.replace(lenslets={"count": count}, sensor={"pixel_pitch": whole.lenslets.pitch / 5.3})
    image = _simulated(found, lg.targets.white(), cell)
    return {"middle": relative(image, references.white(found, 48, references.Fineness(40, 6)))}


def _simulated(found: Any, scene: Any, cell: Cell, spectrum: Any = None) -> np.ndarray:
    return lg.simulate(found, scene, lg.Incoherent(accuracy=cell.asked), spectrum=spectrum).data


def _share(found: Any, dz: float, area: float | None = None) -> float:
    """Light on the lenslets, of a sample of intensity 1 and an area [m²]; of a point without one."""
    area = float(np.prod(found.object_grid.pitch)) if area is None else area
    return area * (found.separation / (found.object_distance + dz)) ** 2


def _places(found: Any, dz: float) -> dict[str, list[Place]]:
    """In the middle, within a lenslet of the border, and beside the array."""
    distance = found.object_distance + dz
    if found.lattice is None:
        half = found.sensor.grid.size[0] / 2 * distance / found.separation
        return {"middle": [(0.1 * half, -0.23 * half)], "border": [(0.9 * half, 0.2 * half)]}
    step = found.lenslets.pitch * distance / found.separation
    y, x = (e / found.lenslets.pitch / 2 for e in found.lenslets.extent)
    at = {"middle": [(0.1, -0.23), (0.45, 0.5)], "border": [(y - 0.7, 0.2), (0.7 - y, x - 0.7)]}
    at["outside"] = [(y + 1, 0.2), (y + 3, -x - 2.3)]
    return {place: [(v * step, h * step) for v, h in mine] for place, mine in at.items()}


def _worst(
    found: Any, cell: Cell, places: dict[str, list[Place]], image: Callable[[Place], np.ndarray]
) -> dict[str, float]:
    every = [p for at in places.values() for p in at]
    truth = dict(zip(every, _truth(found, cell.dz, every), strict=True))
    return {place: max(relative(image(p), truth[p]) for p in at) for place, at in places.items()}


def _truth(found: Any, dz: float, at: Sequence[Place]) -> list[np.ndarray]:
    """Raw images for 1 of light on the lenslets, or on the sensor of a camera without."""
    if found.lattice is None:
        return references.focused(found, dz, at)
    return references.points(found, dz, at, fineness(found))


def fineness(found: Any) -> references.Fineness:
    """Two nodes across a lenslet for each turn of the phase from the farthest, and some.

    Lines across a disc stand π/2 times as far apart in the middle.
    """
    across = max(found.lenslets.extent) / found.lenslet_distance
    turns = found.lenslets.pitch * across / found.wavelength
    if found.lenslets.layout == "square" and found.lenslets.shape == "square":
        return replace(SQUARE, lenslet=max(SQUARE.lenslet, 10 + math.ceil(2 * turns)))
    nodes = (math.pi if found.lenslets.shape == "round" else 2) * turns
    return replace(SQUARE, lenslet=10 + math.ceil(nodes))


def run(only: Sequence[str], rows: Path, *, until: float = float("inf")) -> dict[str, dict[str, str]]:
    """All cells that are not yet in the file of rows, until a moment."""
    known = _known(rows)
    for cell in cells(only):
        if cell.key not in known and time.monotonic() < until:
            start, found = time.process_time(), measured(cell)
            known[cell.key] = found
            with rows.open("a") as file:
                file.write(json.dumps({cell.key: found}) + "\n")
            print(f"{cell.key}: {found}, {time.process_time() - start:.1f} s", flush=True)
    return known


def _known(rows: Path) -> dict[str, dict[str, str]]:
    lines = rows.read_text().splitlines() if rows.exists() else []
    return {key: found for line in lines for key, found in json.loads(line).items()}


def table(known: dict[str, dict[str, str]]) -> str:
    """Markdown: a line for each path and camera, worst of all depths; for each accuracy, all places.

    What was not run at all of its depths is left out: the worst may be missing.
    """
    worst: dict[tuple[str, str], dict[str, list[str]]] = {}
    partly = {cell._replace(dz=0.0) for cell in cells() if cell.key not in known}
    for cell in (cell for cell in cells() if cell._replace(dz=0.0) not in partly):
        mine = worst.setdefault((cell.camera, cell.path), {})
        for place, value in known[cell.key].items():
            mine.setdefault(f"{place} {cell.asked:g}", []).append(value)
    head = ["camera", "path", *(f"{a:g}" for a in ACCURACIES)]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for (name, path), mine in worst.items():
        if mine:
            across = (
                " / ".join(_shown(mine, place, a) for place in PLACES).rstrip("/ –") for a in ACCURACIES
            )
            lines.append(f"| {name} | {path} | " + " | ".join(a or "–" for a in across) + " |")
    return "\n".join(lines)


def _shown(mine: dict[str, list[str]], place: str, accuracy: float) -> str:
    values = mine.get(f"{place} {accuracy:g}", [])
    if "refused" in values:
        return "refused"
    return f"{max(map(float, values)):.2f}" if values else "–"


def missed(known: dict[str, dict[str, str]]) -> list[str]:
    """Cells that do not keep the promise."""
    return [
        f"{key}, {place}: {value}"
        for key, found in known.items()
        for place, value in found.items()
        if value != "refused" and float(value) > (2 if place == "border" else 1)
    ]


def write(text: str, document: Path = DOCUMENT) -> None:
    """Put the table between its marks; cells that were not run keep what the document says."""
    before, rest = document.read_text().split(MARKS[0])
    there, after = rest.split(MARKS[1])
    document.write_text(f"{before}{MARKS[0]}\n\n{merged(text, there.strip())}\n\n{MARKS[1]}{after}")


def merged(table: str, older: str) -> str:
    """A table whose rows and cells that are missing, or are "–", are those of an older one."""
    (head, rule, *lines), known = table.splitlines(), dict(map(_row, older.splitlines()[2:]))
    found = dict(map(_row, lines))
    rows = [name for name in dict.fromkeys((c.camera, c.path) for c in cells()) if name in known | found]
    filled = (
        [
            new if new != "–" else old
            for new, old in zip(found.get(name, _NONE), known.get(name, _NONE), strict=True)
        ]
        for name in rows
    )
    return "\n".join(
        [head, rule, *("| " + " | ".join((*n, *c)) + " |" for n, c in zip(rows, filled, strict=True))]
    )


_NONE = ("–",) * len(ACCURACIES)


def _row(line: str) -> tuple[tuple[str, str], tuple[str, ...]]:
    camera, path, *values = (cell.strip() for cell in line.strip("|").split("|"))
    return (camera, path), tuple(values)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=EVERY, default=EVERY)
    parser.add_argument("--rows", type=Path, default=Path(tempfile.gettempdir()) / "lumigraph-accuracy.jsonl")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after these")
    parser.add_argument("--write", action="store_true", help="the table into docs/validation/operator.md")
    options = parser.parse_args()
    known = run(options.only, options.rows, until=time.monotonic() + 60 * options.minutes)
    print(table(known), *missed(known), sep="\n")
    if options.write:
        write(table(known))


if __name__ == "__main__":
    main()
