"""Corners and measured cameras in files."""

import itertools
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError, LumigraphError
from lumigraph.io import source
from lumigraph.metric.calibration import Measured, Pose
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import FARTHEST, Board, Corners
from lumigraph.metric.noise import Noise
from lumigraph.metric.spill import Spill
from lumigraph.store import write_bytes

COLUMNS = ("frame", "corner", "y", "x", "center_y", "center_x", "kind")
"""Columns of a table of corners, lengths in pixels."""

IN_VIEWS = "in_views"
"""A column of ones in a table of corners that were found in views."""

SPILL = ("wavelength", "fill", "pitch", "rotation", "hexagonal", "sharp")
"""Columns more, alike in all rows, where light that lenslets spill is to be allowed for.

Its wavelength [m], the width of micro-images over their pitch, that pitch [px], the rows' turn [rad], 1 for
hexagons and 0 for squares; how far micro-images of a point in focus move, over the way between their
lenslets, 0 where that is left out.
"""

EDGES = tuple(f"edge_{name}_{kind}" for kind in range(3) for name in ("width", "blur"))
"""Columns more where a white image was measured: width and blur of micro-images of each kind, over their
pitch."""

KIND = "lumigraph metric camera"

_COMPOTE = ("bap.csv", "centers.csv", "camera.json", "scene.json")

_LARGEST = 256 << 20

_MM = 1e-3


def load_corners(path: str | os.PathLike[str]) -> Corners:
    """Corners from a table (.csv) with a header of `COLUMNS`, and of `IN_VIEWS` and `SPILL` where known.

    `kind` may be left out.

    Raises
    ------
    FormatError
        Another file, a column that is missing, text that is no number, some corners in views but not all,
        columns of `SPILL` that change from row to row.
    """
    file = source.regular_file(path)
    found = _table(file, COLUMNS[:-1])
    in_views = set(found.get(IN_VIEWS, np.zeros(1)).tolist())
    if in_views not in ({0.0}, {1.0}):
        raise FormatError(f"column {IN_VIEWS} of {file} must hold 0 in all rows, or 1 in all.")
    with reading(file):
        place, center = (_pair(found, y, x) for y, x in (("y", "x"), ("center_y", "center_x")))
        found.setdefault("kind", np.zeros(len(place)))
        frame, corner, kind = (_whole(name, found) for name in ("frame", "corner", "kind"))
        known = {name: _alike(name, found) for name in (*SPILL, *EDGES) if name in found}
        spill = _spill(known) if SPILL[0] in found else None
        return Corners(frame, corner, place, center, kind, in_views == {1.0}, spill)


def save_corners(corners: Corners, path: str | os.PathLike[str]) -> None:
    """Write a table of corners (.csv), which `load_corners` reads."""
    constant = {IN_VIEWS: 1} if corners.in_views else {}
    constant |= _plain(corners.spill) or {}
    names = (*COLUMNS, *constant)
    columns = [corners.frame, corners.corner, *corners.place.T, *corners.center.T, corners.kind]
    columns += [np.full(len(corners), value) for value in constant.values()]
    rows = (",".join(map(str, row)) for row in zip(*map(np.ndarray.tolist, columns), strict=True))
    write_bytes(path, ("\n".join((",".join(names), *rows)) + "\n").encode())


def _plain(spill: Spill | None) -> dict[str, Any] | None:
    """The numbers of `SPILL`."""
    if spill is None:
        return None
    lattice = spill.lattice
    told = spill.wavelength, spill.fill, lattice.pitch, lattice.rotation
    known = dict(zip(SPILL, (*told, int(lattice.layout == "hex"), spill.sharp), strict=True))
    return known | dict(zip(EDGES, itertools.chain(*spill.edges), strict=False))


def _spill(found: dict[str, Any]) -> Spill:
    known = {SPILL[-1]: 0.0} | found
    wavelength, fill, pitch, rotation, hexagonal, sharp = (_number(known, name) for name in SPILL)
    lattice = (Lattice.hex if hexagonal else Lattice.square)(pitch, rotation)
    edges = [_number(found, name) for name in EDGES if name in found]
    return Spill(lattice, fill, wavelength, sharp, tuple(zip(edges[::2], edges[1::2], strict=True)))


def _alike(name: str, found: dict[str, np.ndarray]) -> float:
    if np.ptp(found[name]) > 0:
        raise FormatError(f"column {name} must hold the same number in all rows.")
    return float(found[name][0])


def load_compote(folder: str | os.PathLike[str]) -> tuple[Corners, Board, Nominal]:
    """Corners, board and nominal camera from a COMPOTE folder: bap.csv, centers.csv, camera.json, scene.json.

    The blur of each corner is not read: COMPOTE computes it from its own first camera.

    Raises
    ------
    FormatError
        A file or a key that is missing, or holds something else.
    """
    place = source.existing(folder)
    files = [source.regular_file(source.unlinked(place / name)) for name in _COMPOTE]
    corners = _table(files[0], ("k", "l", "u", "v", "cluster", "frame"))
    centers = _table(files[1], ("k", "l", "u", "v"))
    camera, scene = (read_json(file) for file in files[2:])
    with reading(place):
        sensor, grid = camera["sensor"], scene["checkerboards"][0]
        nominal = Nominal(
            float(camera["main_lens"]["f"]) * _MM,
            float(sensor["scale"]) * _MM,
            (int(sensor["height"]), int(sensor["width"])),
        )
        board = Board((int(grid["y_grid"]), int(grid["x_grid"])), float(grid["lph"]) * _MM)
        kinds = 3 if int(camera.get("I", 3)) == 3 else 1
        k, row = (_whole(name, corners) for name in "kl")
        seen = Corners(
            _whole("frame", corners),
            _whole("cluster", corners),
            _pair(corners, "v", "u"),
            _centers(centers)(k, row),
            (k + row // 2 + row) % kinds,
        )
    return seen, board, nominal


def _centers(found: dict[str, np.ndarray]) -> Any:
    """Centres (n, 2) of a hexagonal lattice's columns k and rows l, by the lattice that fits them best."""
    measured, best = _pair(found, "v", "u"), None
    column, line = (_whole(name, found) for name in "kl")
    if not np.abs(measured).max() <= FARTHEST:  # not a number is refused too; LAPACK would print lines
        raise FormatError(f"centers.csv has centres beyond {FARTHEST:g} px.")
    for shifted in (0, 1):

        def lattice(k: np.ndarray, row: np.ndarray, shifted: int = shifted) -> np.ndarray:
            return np.column_stack([np.ones(len(k)), k + 0.5 * (row % 2 == shifted), row])

        known = lattice(column, line)
        basis, *_ = np.linalg.lstsq(known, measured, rcond=None)
        off = float(np.mean((known @ basis - measured) ** 2))
        if best is None or off < best[0]:
            best = off, lattice, basis
    assert best is not None  # two shifts were tried
    _, lattice, basis = best
    return lambda k, row: lattice(k, row) @ basis


def save(measured: Measured, path: str | os.PathLike[str]) -> None:
    """Write a measured camera as JSON, all its numbers with their covariance."""
    plain = {
        "kind": KIND,
        "camera": asdict(measured.camera),
        "covariance": measured.covariance.tolist(),
        "noise": {
            "own": measured.noise.own.tolist(),
            "shared": measured.noise.shared,
            "sway": measured.noise.sway,
            "trend": None if measured.noise.trend is None else measured.noise.trend.tolist(),
            "seen": list(measured.noise.seen),
        },
        "board": asdict(measured.board),
        "residual_px": measured.residual_px,
        "left_out": measured.left_out,
        "notes": list(measured.notes),
        "spill": _plain(measured.spill),
        "poses": [
            {
                name: value.tolist() if isinstance(value, np.ndarray) else value
                for name, value in asdict(p).items()
            }
            for p in measured.poses
        ],
    }
    write_bytes(path, json.dumps(plain, indent=1).encode())


def load(path: str | os.PathLike[str]) -> Measured:
    """The measured camera that `save` wrote.

    Raises
    ------
    FormatError
        Another file, or one that is damaged.
    """
    file = source.regular_file(path)
    found = read_json(file)
    with reading(file):
        if found.get("kind") != KIND:
            raise FormatError(f"its kind is {found.get('kind')!r} but must be {KIND!r}.")
        lists: dict[str, Any] = {
            name: tuple(v) if isinstance(v, list) else v for name, v in found["camera"].items()
        }
        plain: dict[str, Any] = found["board"] | {"shape": tuple(found["board"]["shape"])}
        if plain.get("heights") is not None:
            plain["heights"] = tuple(_numbers(plain, "heights", len(plain["heights"])).tolist())
        board = Board(**plain)
        camera = MetricCamera(**lists)
        numbers, noise = len(camera.numbers), _noise(found["noise"], len(camera.gains))
        return Measured(
            camera, _numbers(found, "covariance", numbers, numbers), noise, board,
            tuple(_pose(one) for one in found["poses"]), _number(found, "residual_px"),
            int(found["left_out"]), tuple(map(str, found["notes"])),
            _spill(found["spill"]) if found.get("spill") else None,
        )  # fmt: skip


def is_measured(path: str | os.PathLike[str]) -> bool:
    """True if a JSON file is a camera that `save` wrote."""
    return read_json(source.regular_file(path)).get("kind") == KIND


def _noise(found: dict[str, Any], kinds: int) -> Noise:
    own, shared = _numbers(found, "own", kinds), _number(found, "shared")
    sway = _number(found, "sway") if "sway" in found else 0.0
    if found.get("trend") is None:
        return Noise(own, shared, sway)
    low, middle, high = _numbers(found, "seen", 3).tolist()
    return Noise(own, shared, sway, _numbers(found, "trend", kinds), (low, middle, high))


def _pose(found: dict[str, Any]) -> Pose:
    turn, shift = _numbers(found, "turn", 3), _numbers(found, "shift", 3)
    covariance = _numbers(found, "covariance", 6, 6)
    off, expected = _number(found, "residual_px"), _number(found, "expected_px")
    return Pose(int(found["frame"]), turn, shift, covariance, off, expected)


def _numbers(found: dict[str, Any], name: str, *shape: int) -> np.ndarray:
    values = np.asarray(found[name], float)
    if values.shape != shape or not np.isfinite(values).all():
        raise FormatError(f"{name} has shape {values.shape} but must be {shape}, finite numbers.")
    return values


def _number(found: dict[str, Any], name: str) -> float:
    return checks.finite(name, found[name], "px", FormatError)


def _table(path: Path, needed: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of a table of numbers with a header."""
    _check_length(path)
    with source.decoding(path, "CSV"), path.open(encoding="utf-8") as lines:
        names = [name.strip() for name in lines.readline(1000).split(",")]
        values = np.loadtxt(lines, delimiter=",", ndmin=2, dtype=np.float64)
    missing = [name for name in needed if name not in names]
    if missing or values.shape[1] != len(names) or len(set(names)) < len(names):
        raise FormatError(
            f"{path} has the columns {', '.join(names)[:100]} and {values.shape[1]} numbers a row but must "
            f"have {', '.join(needed)}."
        )
    return dict(zip(names, values.T, strict=True))


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file of at most 256 MiB."""
    _check_length(path)
    with source.decoding(path, "JSON"):
        found = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(found, dict):
        raise FormatError(f"{path} holds no JSON object.")
    return found


def _check_length(path: Path) -> None:
    size = path.stat().st_size
    if size > _LARGEST:
        raise FormatError(f"{path} has {size} bytes but at most {_LARGEST} are read. Give a smaller table.")


def _pair(found: dict[str, np.ndarray], y: str, x: str) -> np.ndarray:
    return np.column_stack([found[y], found[x]])


def _whole(name: str, found: dict[str, np.ndarray]) -> np.ndarray:
    values = found[name]
    if not (
        np.isfinite(values).all() and np.array_equal(values, np.round(values)) and abs(values).max() < 2**31
    ):
        raise FormatError(f"column {name} must hold whole numbers below {2**31}.")
    return values.astype(np.int64)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Context in which values that no camera can have become errors of the file, in one line."""
    try:
        yield
    except LumigraphError as error:
        raise FormatError(f"{path}: {error}") from None
    except (AttributeError, KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise FormatError(f"{path}: {type(error).__name__} {error}, which no such file has.") from None
