"""Folders of views: one picture for each camera, named by its place in the grid.

Read: the HCI 4D light field benchmark (`input_Cam000.png` ..., row by row from the top left; its
`parameters.cfg` if there), the Stanford archive (`out_RR_CC_Y_X_.png`), and any names that end in two
numbers, row and column (`view_03_05.png`). Written: `view_RR_CC.png` (`.tif` for floats) and `views.json`.
Row 0, column 0 is the camera top left, unless positions in the names say where it stands: y counts down, x to
the right. `cameras` says how that becomes (v, u).
"""

import json
import math
import re
import warnings
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph.core import memory
from lumigraph.core.arrays import to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError, SamplingWarning
from lumigraph.io import bmp, header, jpeg, png, pnm, source, target, tiff, view_order
from lumigraph.io.cameras import from_cameras, in_order_of_views, to_cameras

_LOADERS = {
    "png": png.load, "tif": tiff.load, "tiff": tiff.load, "jpg": jpeg.load, "jpeg": jpeg.load,
    "bmp": bmp.load, "ppm": pnm.load, "pgm": pnm.load, "pnm": pnm.load,
}  # fmt: skip
_ENDING = rf"\.(?:{'|'.join(_LOADERS)})"
_HCI = re.compile(rf"input_Cam(\d{{1,6}}){_ENDING}", re.I)
_POSITION = r"([+-]?\d{1,9}(?:\.\d{1,12})?(?:e[+-]?\d\d?)?)"
_STANFORD = re.compile(rf"\D*?(\d{{1,4}})_(\d{{1,4}})_{_POSITION}_{_POSITION}_?{_ENDING}", re.I)
_PLACED = re.compile(rf".*?(\d{{1,4}})[_x\-](\d{{1,4}}){_ENDING}", re.I)
_MOST = 10_000  # views
_OFF = 0.5  # of a spacing: cameras that stand farther than that from where their numbers say
_NAMED = 3  # missing views in a warning
_LONGEST_NUMBER = 400  # characters
Files = dict[tuple[int, int], Path]


def load(path: Path, *, max_pixels: int = source.MAX_PIXELS) -> LightField:
    """The light field in a folder of pictures.

    Raises
    ------
    FormatError
        No such names, or pictures of several sizes.

    Warns
    -----
    SamplingWarning
        Views are missing, as of a star or a cross: they are black and not `valid`.
    """
    files, places = _files(path)
    spacing = places or (1.0, 1.0)
    rows, columns = (max(place[k] for place in files) + 1 for k in (0, 1))
    if rows * columns > _MOST:
        raise FormatError(
            f"{path} names {rows} x {columns} views but holds {len(files)}; at most {_MOST} are read: "
            "the rest is missing. Check the numbers in the names."
        )
    data, cameras = None, None
    for (row, column), file in sorted(files.items()):
        picture = _picture(file, max_pixels)
        if data is None:
            data = _room(path, (rows, columns, *picture.shape), picture.dtype, len(files), max_pixels)
            # Filled in the order of the views: turning a large light field round takes as much memory again.
            cameras = in_order_of_views(data, spacing)
        assert cameras is not None  # it is data in another order
        if picture.shape != data.shape[2:] or picture.dtype != data.dtype:
            raise FormatError(
                f"{file} has {picture.shape} {picture.dtype} but the first view has {data.shape[2:]} "
                f"{data.dtype}: all views must be alike."
            )
        cameras[row, column] = picture
    assert data is not None  # _files found at least one
    there = np.zeros((rows, columns), bool)
    there[tuple(np.transpose(list(files)))] = True
    views = _without(path, _restored(path, data, spacing), there, spacing)
    return views if places is None else _upward(path, views)


def _room(path: Path, shape: tuple[int, ...], dtype: np.dtype, held: int, max_pixels: int) -> np.ndarray:
    """Zeros for all views; where most of them are there, it is their memory alone that bounds them."""
    if 2 * held < shape[0] * shape[1] or max_pixels < source.MAX_PIXELS:
        source.check_size(path, shape, max_pixels)
    needed = float(np.prod(shape, dtype=float)) * dtype.itemsize
    memory.require(needed, f"{path}: its views", "Use fewer or smaller ones.", FormatError)
    return np.zeros(shape, dtype)


def _upward(path: Path, views: LightField) -> LightField:
    """The light field with its rows turned round where the y in its names counts up, as the pictures show."""
    if not view_order.is_mirrored(views):
        return views
    _doubt(f"{path}: the y in its names counts up, as the pictures show; read so")
    last = len(views.data) - 1
    for k in range((last + 1) // 2):  # row by row: all at once would take as much memory again
        views.data[[k, last - k]] = views.data[[last - k, k]]
    return views if views.valid is None else replace(views, valid=views.valid[::-1])


def _without(path: Path, views: LightField, there: np.ndarray, spacing: tuple[float, float]) -> LightField:
    """The light field whose missing cameras (row, column) do not count."""
    if there.all():
        return views
    missing = ", ".join(f"{row}/{column}" for row, column in np.argwhere(~there)[:_NAMED])
    more = " ..." if (~there).sum() > _NAMED else ""
    warnings.warn(
        f"{path} holds {there.sum()} of {there.shape[0]} x {there.shape[1]} views; row/column {missing}"
        f"{more} are left out. Copy the folder again if it should hold them.",
        SamplingWarning,
        stacklevel=2,
    )
    valid = np.broadcast_to(in_order_of_views(there, spacing)[..., None, None], views.data.shape[:4])
    return replace(views, valid=valid)


def save(views: LightField, path: Path, *, white: float | None = None) -> None:
    """Write each view as a picture, and the light field's lengths into `views.json`.

    Whole numbers of 8 bits, or 16 if grey, become PNG, everything else TIFF, both exactly; with `white`
    all become PNG, 0 ... `white` scaled.
    """
    data = to_cameras(LightField(to_numpy(views.data), views.aperture, views.lenslets, views.separation))
    exact = data.dtype == np.uint8 or (data.dtype == np.uint16 and data.ndim == 4)
    as_png = white is not None or (exact and data.shape[4:] in ((), (3,)))
    digits = len(str(max(data.shape[:2]) - 1)) if max(data.shape[:2]) > 100 else 2
    with target.replacing(path, folder=True) as temporary:
        temporary.mkdir()
        for row in range(data.shape[0]):
            for column in range(data.shape[1]):
                name = f"view_{row:0{digits}}_{column:0{digits}}"
                if as_png:
                    png.save(RawImage(data[row, column]), temporary / f"{name}.png", white=white)
                else:
                    tiff.save(RawImage(data[row, column]), temporary / f"{name}.tif")
        fields = json.dumps(header.describe_views(views), indent=1)
        (temporary / target.VIEWS).write_text(fields + "\n", encoding="ascii")


def parameters(path: str | Path) -> dict[str, float]:
    """Numbers of the `parameters.cfg` beside HCI views, such as ``disp_min`` and ``baseline_mm``.

    Empty where there is no such file.

    Raises
    ------
    FormatError
        A damaged or oversized file.
    """
    file = source.unlinked(Path(path) / "parameters.cfg")
    if not file.is_file():
        return {}
    return {name: value for name, value in numbers(file).items() if math.isfinite(value)}


def numbers(file: Path) -> dict[str, float]:
    """Every entry of an INI file that is a number, as "name" and "section.name".

    Raises
    ------
    FormatError
        No INI file, or an oversized one.
    """
    if file.stat().st_size > 1 << 20:
        raise FormatError(f"{file} has {file.stat().st_size} bytes, too many for parameters. Check the path.")
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(f"{file} is not an INI file: {error}.") from error
    found: dict[str, float] = {}
    section = None
    for number, whole in enumerate(lines, 1):
        line = whole.strip()
        if line.startswith("[") and line.endswith("]"):
            section = line[1:-1].strip()
        elif line and line[0] not in "#;" and not whole[0].isspace():  # the rest of a longer value
            name, equals, value = line.replace(":", "=", 1).partition("=")
            if not equals or section is None:
                raise FormatError(f"{file} is not an INI file: line {number} is {line[:40]!r}.")
            with suppress(ValueError):
                name = name.strip().lower()
                found[name] = found[f"{section}.{name}"] = float(value[:_LONGEST_NUMBER])
    return found


def contents(path: Path) -> list[tuple[str, str, str]]:
    """One light field, with the number of its views and what `parameters.cfg` says of disparities."""
    files, _ = _files(path)
    rows, columns = (max(place[k] for place in files) + 1 for k in (0, 1))
    known = parameters(path)
    told = ""
    if {"disp_min", "disp_max"} <= known.keys():
        told = f", disparity {known['disp_min']:g} to {known['disp_max']:g} px"
    some = "" if len(files) == rows * columns else f"{len(files)} of "
    return [("", "LightField", f"{some}{rows} x {columns} views{told}")]


def _files(path: Path) -> tuple[Files, tuple[float, float] | None]:
    """Picture of each camera (row, column), and the spacing of the cameras (down, right), where names say."""
    path = source.existing(path)
    if not path.is_dir():
        raise FormatError(f"{path} is not a folder of views, and has no extension that says what it is.")
    names = sorted(child.name for child in path.iterdir())
    if len(names) > 10 * _MOST:
        raise FormatError(f"{path} holds {len(names)} files, too many for views. Check the path.")
    if found := {m: path / m[0] for m in map(_HCI.fullmatch, names) if m}:
        return _hci(path, found), None
    if found := [m for m in map(_STANFORD.fullmatch, names) if m]:
        return _stanford(path, found)
    counted = [m for m in map(_PLACED.fullmatch, names) if m]
    placed = _placed(path, counted)
    if not placed or len(placed) > _MOST:
        raise FormatError(
            f"{path} holds no views: names such as input_Cam000.png, out_00_00_Y_X_.png or view_00_00.png."
        )
    first = min(place[0] for place in placed), min(place[1] for place in placed)
    if _may_be_square(counted):
        _doubt(
            f"{path} names {len(placed)} views of one row, {first[0]}. If they are {math.isqrt(len(placed))} "
            "rows of as many, number them input_Cam000.png, row by row"
        )
    return {(r - first[0], c - first[1]): file for (r, c), file in placed.items()}, None


def _placed(path: Path, found: list[re.Match[str]]) -> Files:
    """Picture of each camera by the numbers (row, column) in its name; refused where two have the same."""
    files: Files = {}
    for match in found:
        place = int(match[1]), int(match[2])
        if place in files:
            raise FormatError(
                f"{path} holds two pictures of row {place[0]}, column {place[1]}: {files[place].name} and "
                f"{match[0]}. Keep one kind in the folder."
            )
        files[place] = path / match[0]
    return files


def _may_be_square(counted: list[re.Match[str]]) -> bool:
    """True if numbers count a square's views, and the one before them hardly a row: it has other digits."""
    few = len(counted) < 9 or math.isqrt(len(counted)) ** 2 != len(counted)
    return (
        not few
        and len({m[1] for m in counted}) == 1
        and (int(counted[0][1]) > 1 or any(len(m[1]) != len(m[2]) for m in counted))
    )


def _hci(path: Path, found: dict[re.Match[str], Path]) -> Files:
    numbers = [int(match[1]) for match in found]
    count = max(len(found), max(numbers) + 1)  # the last of a star's views stands in a corner
    columns = int(parameters(path).get("num_cams_x", math.isqrt(count)))
    if columns < 1 or ("num_cams_x" not in parameters(path) and columns**2 != count):
        raise FormatError(
            f"{path} holds {len(found)} views up to input_Cam{max(numbers):03}.png, and how many stand in a "
            "row is not known: no square has so many. Give num_cams_x in parameters.cfg, or name them "
            "view_ROW_COLUMN."
        )
    return {divmod(int(match[1]), columns): file for match, file in found.items()}


def _stanford(path: Path, found: list[re.Match[str]]) -> tuple[Files, tuple[float, float]]:
    """Rows and columns as counted in the names, and how far the cameras stand apart (down, right), signed.

    Positions are (y, x), y down and x to the right: of the archive's sets some are numbered along x, some
    against it.

    Warns
    -----
    SamplingWarning
        Positions that do not follow the numbers.
    """
    table = np.array([[float(m[k]) for k in (1, 2, 3, 4)] for m in found])
    numbers, places = table[:, :2], table[:, 2:]
    slopes = _slopes(numbers, places)
    swapped = abs(slopes[0, 1]) > abs(slopes[0, 0]) and abs(slopes[1, 0]) > abs(slopes[1, 1])
    files = _placed(path, found)
    if swapped:
        _doubt(f"{path}: the first number in its names counts columns, as the positions (y, x) say; read so")
        files = {(column, row): file for (row, column), file in files.items()}
        numbers, slopes = numbers[:, ::-1], slopes[::-1]
    spacing = np.diagonal(slopes)
    off = np.abs(places - places.mean(0) - (numbers - numbers.mean(0)) * spacing)
    far = int((off > _OFF * np.abs(spacing)).any(1)[(spacing != 0).all()].sum()) if len(off) else 0
    if far:
        _doubt(
            f"{path}: {far} of {len(found)} views stand over half a spacing from where their numbers say, by "
            "the positions in their names. They are read by their numbers"
        )
    down, right = (float(step) for step in spacing)
    return files, (down or abs(right) or 1.0, right or abs(down) or 1.0)


def _slopes(numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Change of the positions (y, x), in columns, with the row and with the column, in rows."""
    design = np.c_[np.ones(len(numbers)), numbers]
    return np.linalg.lstsq(design, places, rcond=None)[0][1:]


def _doubt(line: str) -> None:
    warnings.warn(f"{line}. Check the names.", SamplingWarning, stacklevel=2)


def _picture(file: Path, max_pixels: int) -> np.ndarray:
    load_one = _LOADERS[file.suffix.lower().removeprefix(".")]
    raw = load_one(source.unlinked(file), max_pixels=max_pixels)
    if not isinstance(raw, RawImage):
        raise FormatError(f"{file} holds several pages where one view is needed.")
    return to_numpy(raw.data)


def _restored(path: Path, data: np.ndarray, spacing: tuple[float, float]) -> LightField:
    """The light field of views (v, u, ...), with the lengths that `save` wrote."""
    file = source.unlinked(path / target.VIEWS)
    if not file.is_file():
        return from_cameras(in_order_of_views(data), (abs(spacing[0]), abs(spacing[1])))
    with source.decoding(file, "the views.json of a folder of views"):
        found: Any = header.loads(file.read_text(encoding="ascii")) if file.stat().st_size < 1 << 20 else None
        if found is None or found.get("kind") != "LightField":
            raise FormatError("it was not written by lumigraph. Remove it to read the pictures alone.")
        grids = header.grid(found.get("aperture")), header.grid(found.get("lenslets"))
        return LightField(data, *grids, found.get("separation", 0.0))
