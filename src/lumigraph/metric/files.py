"""Corners and measured cameras in files."""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.errors import FormatError, LumigraphError
from lumigraph.io import source
from lumigraph.metric.calibration import Measured, Pose
from lumigraph.metric.camera import MetricCamera, Nominal
from lumigraph.metric.corners import Board, Corners
from lumigraph.metric.noise import Noise
from lumigraph.store import write_bytes

COLUMNS = ("frame", "corner", "y", "x", "center_y", "center_x", "kind")
"""Of a table of corners: lengths in pixels."""

KIND = "lumigraph metric camera"

_LARGEST = 256 << 20

_MM = 1e-3


def load_corners(path: str | os.PathLike[str]) -> Corners:
    """Corners from a table (.csv) with a header of `COLUMNS`; `kind` may be left out.

    Raises
    ------
    FormatError
        Another file, a column that is missing, text that is no number.
    """
    file = source.regular_file(path)
    found = _table(file, COLUMNS[:-1])
    with _checked(file):
        place, center = (_pair(found, y, x) for y, x in (("y", "x"), ("center_y", "center_x")))
        kind = found.get("kind", np.zeros(len(place)))
        return Corners(_whole("frame", found), _whole("corner", found), place, center, kind.astype(int))


def save_corners(corners: Corners, path: str | os.PathLike[str]) -> None:
    """Write a table of corners (.csv), which `load_corners` reads."""
    columns = (corners.frame, corners.corner, *corners.place.T, *corners.center.T, corners.kind)
    rows = (",".join(map(str, row)) for row in zip(*map(np.ndarray.tolist, columns), strict=True))
    write_bytes(path, ("\n".join((",".join(COLUMNS), *rows)) + "\n").encode())


def load_compote(folder: str | os.PathLike[str]) -> tuple[Corners, Board, Nominal]:
    """What COMPOTE keeps in a folder: bap.csv, centers.csv, camera.json, scene.json.

    The blur of each corner is not read: COMPOTE computes it from its own first camera.

    Raises
    ------
    FormatError
        A file or a key that is missing, or holds something else.
    """
    place = source.existing(folder)
    corners = _table(source.regular_file(place / "bap.csv"), ("k", "l", "u", "v", "cluster", "frame"))
    centers = _table(source.regular_file(place / "centers.csv"), ("k", "l", "u", "v"))
    camera, scene = (_json(source.regular_file(place / name)) for name in ("camera.json", "scene.json"))
    with _checked(place):
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
    for shifted in (0, 1):

        def lattice(k: np.ndarray, row: np.ndarray, shifted: int = shifted) -> np.ndarray:
            return np.column_stack([np.ones(len(k)), k + 0.5 * (row % 2 == shifted), row])

        known = lattice(found["k"], found["l"])
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
        "noise": {"own": measured.noise.own.tolist(), "shared": measured.noise.shared},
        "board": asdict(measured.board),
        "residual_px": measured.residual_px,
        "left_out": measured.left_out,
        "notes": list(measured.notes),
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
    found = _json(file)
    with _checked(file):
        if found.get("kind") != KIND:
            raise FormatError(f"its kind is {found.get('kind')!r} but must be {KIND!r}.")
        lists: dict[str, Any] = {
            name: tuple(v) if isinstance(v, list) else v for name, v in found["camera"].items()
        }
        board = Board(tuple(found["board"]["shape"]), found["board"]["spacing"])
        noise = Noise(np.asarray(found["noise"]["own"], float), float(found["noise"]["shared"]))
        camera = MetricCamera(**lists)
        numbers = len(camera.numbers)
        return Measured(
            camera, _square(found["covariance"], numbers), noise, board,
            tuple(_pose(one) for one in found["poses"]), float(found["residual_px"]),
            int(found["left_out"]), tuple(map(str, found["notes"])),
        )  # fmt: skip


def _pose(found: dict[str, Any]) -> Pose:
    turn, shift = (np.asarray(found[name], float).reshape(3) for name in ("turn", "shift"))
    covariance = _square(found["covariance"], 6)
    off, expected = float(found["residual_px"]), float(found["expected_px"])
    return Pose(int(found["frame"]), turn, shift, covariance, off, expected)


def _square(values: Any, size: int) -> np.ndarray:
    matrix = np.asarray(values, float)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise FormatError(f"a covariance has shape {matrix.shape} but must be ({size}, {size}), finite.")
    return matrix


def _table(path: Path, needed: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of a table of numbers with a header."""
    _check_length(path)
    with source.decoding(path, "CSV"), path.open(encoding="utf-8") as lines:
        names = [name.strip() for name in lines.readline(1000).split(",")]
        values = np.loadtxt(lines, delimiter=",", ndmin=2, dtype=np.float64)
    missing = [name for name in needed if name not in names]
    if missing or values.shape[1] != len(names):
        raise FormatError(
            f"{path} has the columns {', '.join(names)[:100]} and {values.shape[1]} numbers a row but must "
            f"have {', '.join(needed)}."
        )
    return dict(zip(names, values.T, strict=True))


def _json(path: Path) -> dict[str, Any]:
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
def _checked(path: Path) -> Iterator[None]:
    """Whatever a file holds that a camera cannot have is its own fault, in one line."""
    try:
        yield
    except LumigraphError as error:
        raise FormatError(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise FormatError(f"{path}: {type(error).__name__} {error}, which no such file has.") from None
