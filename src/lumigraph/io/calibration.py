"""A `Calibration` as TOML: the lattice in pixels, the geometry, and every measured centre."""

import json
import math
import os
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.aside import Aside
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp
from lumigraph.errors import FormatError, LumigraphError
from lumigraph.io import source, target
from lumigraph.io.numerals import listed
from lumigraph.units import parse

KIND = "calibration"
_LARGEST = 1 << 29  # bytes of a file; about six million lenslets
_LARGEST_TEXT = 64 << 20  # bytes without the numbers that NumPy reads
_NUMBERS = {"indices": 2, "centers": 2, "light": 1}  # numbers in a row
_WRITTEN = {  # rows as they are written
    1: re.compile(r"[-+.\w]+(?:, [-+.\w]+)*+", re.ASCII),
    2: re.compile(r"(?:\n  \[[-+.\w]+, [-+.\w]+\],)++", re.ASCII),
}
_BLANKS = str.maketrans("[]\n", "   ")
_LENGTHS = ("pixel_pitch", "separation", "lenslet_distance")


def save_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> None:
    """Write a calibration as TOML; every number survives exactly."""
    lattice = calibration.lattice
    lengths = [
        f'{name} = "{float(value)!r} m"'
        for name in _LENGTHS
        if (value := getattr(calibration, name)) is not None
    ]
    lines = [
        "# Micro-images found on a white image, lengths on it in pixels; pixel (0, 0) is a pixel's centre.",
        f'kind = "{KIND}"',
        f"shape = {list(calibration.shape)}  # rows, columns",
        f"residual_px = {float(calibration.residual_px)!r}"
        + ("" if calibration.measured else "  # not measured"),
        *lengths,
        *_quality(calibration),
        "",
        "[lattice]  # points origin + i * basis[1] + j * basis[0]; pairs are (y, x)",
        f'layout = "{lattice.layout}"',
        f"kinds = {lattice.kinds}",
        f"origin = {_row(lattice.origin)}",
        f"basis = [{_row(lattice.basis[0])}, {_row(lattice.basis[1])}]",
        "",
        "[lenslets]  # one row each: the index (i, j) and the measured centre (y, x)",
        f"indices = {listed(to_numpy(calibration.indices))}",
        f"centers = {listed(to_numpy(calibration.centers))}",
        f"missing = {to_numpy(calibration.missing).tolist()}  # indices of those not found",
    ]
    if calibration.light is not None:
        lines.append(f"light = {listed(to_numpy(calibration.light))}")
    if (aside := calibration.aside) is not None:
        lines.append(f"aside = {to_numpy(aside.indices).tolist()}  # indices of those beside the lattice")
        lines.append(f"aside_by = {listed(to_numpy(aside.ways))}")
    if calibration.warp is not None:
        lines += ["", *_warp_lines(calibration.warp)]
    target.write_bytes(path, ("\n".join(lines) + "\n").encode())


def _quality(calibration: Calibration) -> list[str]:
    lines = [] if calibration.fill is None else [f"fill = {float(calibration.fill)!r}  # of the pitch"]
    if calibration.sharpness:
        lines.append(f"sharpness = {_row(calibration.sharpness)}  # of the three kinds")
    # A JSON string is a TOML string, but for DEL.
    notes = [json.dumps(note.replace("\x7f", "")) for note in calibration.notes]
    return [*lines, f"notes = [{', '.join(notes)}]"] if notes else lines


def _warp_lines(warp: Warp) -> list[str]:
    return [
        "[warp]  # q from center: q / (1 + tilt.q), then times 1 + radial |q|^2",
        f"center = {_row(warp.center)}",
        f"tilt = {_row(warp.tilt)}",
        f"radial = {warp.radial!r}",
    ]


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """The calibration in a TOML file.

    Raises
    ------
    FormatError
        No such file, no TOML, another kind of file, or a field that is missing or wrong.
    """
    path = source.regular_file(path)
    if path.stat().st_size > _LARGEST:
        raise FormatError(
            f"{path} has {path.stat().st_size} bytes, too many for a calibration. Check the path."
        )
    try:
        text, numbers = _taken(path.read_text(encoding="utf-8"))
        if len(text) > _LARGEST_TEXT:
            raise FormatError(
                f"{path} has {len(text)} characters beside its lenslets, too many. Check the path."
            )
        found = source.toml(path, text)
    except UnicodeDecodeError as error:
        raise FormatError(f"{path} is not TOML: {error}.") from error
    _check_kind(path, found)
    if numbers:
        found["lenslets"] |= numbers
    try:
        return _calibration(found)
    except LumigraphError as error:
        raise FormatError(f"{path}: {error}") from error


def _taken(text: str) -> tuple[str, dict[str, np.ndarray]]:
    """The text without the numbers of its lenslets, where they are written as here, and the numbers.

    `tomllib` takes 20 us for each lenslet.
    """
    first = text.find("\n[lenslets]")
    if first < 0 or '"""' in text or "'''" in text:
        return text, {}
    numbers = {}
    for name, columns in _NUMBERS.items():
        begin = text.find(f"\n{name} = [", first)
        start, end = begin + len(name) + 5, text.find("]\n" if columns == 1 else "\n]\n", begin)
        if begin < 0 or end < 0 or text.find("\n[", first + 1, begin) >= 0:
            continue
        if (values := _read(text[start:end], columns)) is not None:
            numbers[name], text = values, f"{text[:start]}{text[end:]}"
    return text, numbers


def _read(block: str, columns: int) -> np.ndarray | None:
    """Numbers (k,) or (k, 2) of a block of rows; None where it is written in another way."""
    if _WRITTEN[columns].fullmatch(block) is None:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of older NumPy, of what is no number
            values = np.fromstring(block.translate(_BLANKS), sep=",")
    except (ValueError, DeprecationWarning):
        return None
    if values.size != block.count(",") + (columns == 1):
        return None
    return values if columns == 1 else values.reshape(-1, 2)


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> Calibration:
    """`load_calibration`, as `open` calls it."""
    del max_pixels  # a calibration has no pixels; its file's size is limited
    return load_calibration(path)


save = save_calibration


def _check_kind(path: Path, found: dict[str, Any]) -> None:
    kind = found.get("kind")
    if kind == KIND:
        return
    if isinstance(kind, str):
        raise FormatError(
            f"{path} describes a {kind!r}, not a calibration. If it is a camera, give it where a camera file "
            "is asked for; from Python, lumigraph.instruments.load_camera(path)."
        )
    raise FormatError(
        f'{path} is not a calibration: it has no kind = "{KIND}". Make one with `lumigraph calibrate`.'
    )


def _calibration(found: dict[str, Any]) -> Calibration:
    lattice, lenslets = _table(found, "lattice"), _table(found, "lenslets")
    basis = _numbers(lattice, "lattice.basis", (2, 2))
    centers = _numbers(lenslets, "lenslets.centers", (-1, 2))
    indices = _numbers(lenslets, "lenslets.indices", (-1, 2))
    shape = _numbers(found, "shape", (2,))
    if np.any(indices != np.rint(indices)) or np.any(shape != np.rint(shape)):
        raise FormatError("lenslets.indices and shape must be whole numbers.")
    return Calibration(
        lattice=Lattice(
            (tuple(basis[0].tolist()), tuple(basis[1].tolist())),
            tuple(_numbers(lattice, "lattice.origin", (2,)).tolist()),
            lattice.get("layout", "square"),
            lattice.get("kinds", 1),
        ),
        shape=(int(shape[0]), int(shape[1])),
        indices=indices.astype(np.int64),
        centers=centers,
        residual_px=_residual(found),
        **{name: _length(name, found[name]) for name in _LENGTHS if name in found},
        **_extras(found, lenslets),
    )


def _residual(found: dict[str, Any]) -> float:
    """The residual [px], NaN where none was measured."""
    value = found.get("residual_px")
    if isinstance(value, float) and math.isnan(value):
        return math.nan
    return float(_numbers(found, "residual_px", ()))


def _extras(found: dict[str, Any], lenslets: dict[str, Any]) -> dict[str, Any]:
    """Values that files of the first versions lack."""
    extras: dict[str, Any] = {}
    if "missing" in lenslets:
        extras["missing"] = _numbers(lenslets, "lenslets.missing", (-1, 2)).astype(np.int64)
    if "aside" in lenslets:
        indices = _numbers(lenslets, "lenslets.aside", (-1, 2)).astype(np.int64)
        extras["aside"] = Aside(indices, _numbers(lenslets, "lenslets.aside_by", (-1, 2)))
    if "light" in lenslets:
        extras["light"] = _numbers(lenslets, "lenslets.light", (-1,))
    if "fill" in found:
        extras["fill"] = float(_numbers(found, "fill", ()))
    if "sharpness" in found:
        extras["sharpness"] = tuple(_numbers(found, "sharpness", (-1,)).tolist())
    if "warp" in found:
        warp = _table(found, "warp")
        center, tilt = (tuple(_numbers(warp, f"warp.{name}", (2,)).tolist()) for name in ("center", "tilt"))
        extras["warp"] = Warp(center, tilt, float(_numbers(warp, "warp.radial", ())))
    notes = found.get("notes", [])
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise FormatError("notes must be a list of texts.")
    return extras | {"notes": tuple(notes)}


def _table(found: dict[str, Any], name: str) -> dict[str, Any]:
    if not isinstance(table := found.get(name), dict):
        raise FormatError(f"the table [{name}] is missing. Make the calibration again.")
    return table


def _length(name: str, value: Any) -> float:
    try:
        return parse(value)
    except FormatError as error:
        raise FormatError(f"{name}: {error}") from error


def _numbers(found: dict[str, Any], name: str, shape: tuple[int, ...]) -> np.ndarray:
    """The finite numbers under the last part of `name`; -1 stands for any count."""
    key = name.rpartition(".")[2]
    if key not in found:
        raise FormatError(f"{name} is missing. Make the calibration again.")
    try:
        values = np.asarray(found[key], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.array(np.nan)
    values = values.reshape(0, 2) if values.shape == (0,) and len(shape) == 2 else values
    fits = values.ndim == len(shape) and all(w in (-1, n) for w, n in zip(shape, values.shape, strict=True))
    if not fits or not np.isfinite(values).all():
        wanted = " x ".join("k" if n < 0 else str(n) for n in shape)
        raise FormatError(f"{name} must be {wanted + ' finite numbers' if wanted else 'a finite number'}.")
    return values


def _row(values: Any) -> str:
    return f"[{', '.join(repr(value) for value in np.asarray(values).tolist())}]"
