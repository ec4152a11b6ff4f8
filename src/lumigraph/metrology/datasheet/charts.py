"""The pictures that a data sheet is measured on: of a folder, or simulated from a camera file."""

import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph import io, store
from lumigraph.core import checks
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments import Instrument, LensletCamera
from lumigraph.instruments.files import read as read_table
from lumigraph.instruments.loading import load_camera
from lumigraph.metrology.datasheet.exposures import FileExposures
from lumigraph.units import parse

if TYPE_CHECKING:
    from lumigraph.instruments.loading import AnyCamera

FILE = "charts.toml"
"""Names the pictures of a folder."""

_KEYS = {"camera", "spacing", "white", "dark", "flats", "charts", "scenes"}
_PICTURES = {".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm"}


@dataclass(frozen=True, slots=True, eq=False)
class ChartExposures:
    """Raw images of the charts at one distance.

    Parameters
    ----------
    boards
        Exposures of a chessboard that fills the picture, turned by some 7 degrees, as they were read.
    textures
        Of a random pattern at the same place, for depth; none where the board serves for it.
    depth
        Of the charts from the plane in focus [m], positive farther; None where it is not known.
    """

    boards: Sequence[RawImage]
    textures: Sequence[RawImage] = ()
    depth: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Charts:
    """Raw images of one camera, for its data sheet.

    Parameters
    ----------
    name
        Of the camera.
    whites
        White images of one light, one at least; two give the noise, more give it better.
    darks
        Without light, of the same exposure time.
    flats
        Further pairs of white images, each pair of one light: photon transfer.
    boards
        Raw images of the charts, at several distances.
    scenes
        Raw images of anything else with texture: how steady depth is.
    camera
        What it is meant to be; None where that is not known.
    spacing
        Width of the chart's squares [m]; None where it is not known.

    Raises
    ------
    FormatError
        No white image, or pictures of several sizes.
    """

    name: str
    whites: Sequence[RawImage]
    darks: Sequence[RawImage] = ()
    flats: tuple[tuple[RawImage, RawImage], ...] = ()
    boards: tuple[ChartExposures, ...] = ()
    scenes: Sequence[RawImage] = ()
    camera: LensletCamera | None = None
    spacing: float | None = None

    def __post_init__(self) -> None:
        if not self.whites:
            raise FormatError(f"{self.name} has no white image. Take one of an evenly lit diffuser.")
        # Of one exposure of each light: means of the others are refused where their sizes differ.
        shapes = {images[0].shape for _, images in self.lights() if images}
        if len(shapes) > 1:
            sizes = ", ".join(f"{rows} x {columns}" for rows, columns in sorted(shapes))
            raise FormatError(
                f"the pictures of {self.name} have several sizes: {sizes} px. Give one camera's."
            )

    def lights(self) -> Iterator[tuple[str, Sequence[RawImage]]]:
        """Raw images, those of one light together, with a name for their files."""
        yield from (("white", self.whites), ("dark", self.darks), ("scenes", self.scenes))
        yield from ((f"flat-{k}", pair) for k, pair in enumerate(self.flats, 1))
        for k, one in enumerate(self.boards, 1):
            yield from ((f"board-{k}", one.boards), (f"texture-{k}", one.textures))


def check_camera(camera: "AnyCamera | LensletCamera | Instrument") -> LensletCamera:
    """The camera, refused unless it is a plenoptic one."""
    if not isinstance(camera, LensletCamera):
        raise GeometryError(
            f"a {camera.noun} has no data sheet yet: give a plenoptic camera 1.0 or 2.0, or their pictures."
        )
    return camera


def read_charts(folder: str | os.PathLike[str], camera: LensletCamera | None = None) -> Charts:
    """The raw images of a folder, as its ``charts.toml`` names them, or by what their names say.

    Without that file, a picture whose name has "white" or "dark" in it is one, and every other a scene.

    Parameters
    ----------
    folder
        With the pictures.
    camera
        In the place of the file's.

    Raises
    ------
    FormatError
        No folder, no pictures, an unknown key, a picture that is missing, a length without its unit.
    """
    place = Path(folder)
    if not place.is_dir():
        raise FormatError(f"{place} is no folder of raw images.")
    file = place / FILE
    table = read_table(file) if file.exists() else _by_names(place)
    if unknown := sorted(set(table) - _KEYS):
        raise FormatError(f"{file} has the key {unknown[0]!r}. The keys are {', '.join(sorted(_KEYS))}.")
    if camera is None and "camera" in table:
        camera = check_camera(load_camera(_inside(place, table["camera"], "camera")))

    def images(key: str) -> FileExposures:
        return _files(place, _listed(table.get(key, []), key), key)

    flats = [
        _files(place, _listed(pair, "flats"), "flats") for pair in _listed(table.get("flats", []), "flats")
    ]
    if any(len(pair) != 2 for pair in flats):
        raise FormatError(f'{file}: flats must be pairs of pictures, [["a1.tiff", "a2.tiff"], ...].')
    spacing = None if "spacing" not in table else parse(str(table["spacing"]))
    return Charts(
        place.resolve().name, images("white"), images("dark"), tuple((pair[0], pair[1]) for pair in flats),
        tuple(_boards(place, table.get("charts", []))), images("scenes"), camera,
        None if spacing is None else checks.positive("spacing", spacing, error=FormatError),
    )  # fmt: skip


def _listed(value: Any, key: str) -> list[Any]:
    if not isinstance(value, list):
        raise FormatError(f"{FILE}: {key} is {value!r} but must be a list, in brackets.")
    return value


def _files(place: Path, names: list[Any], key: str) -> FileExposures:
    return FileExposures(tuple(_inside(place, name, key) for name in names), f"{key} image")


def _inside(place: Path, name: Any, key: str) -> Path:
    if not isinstance(name, str):
        raise FormatError(f"{FILE}: {key} names {name!r}, which is no file.")
    return place / name


def _boards(place: Path, rows: Any) -> Iterator[ChartExposures]:
    for row in _listed(rows, "charts"):
        if not isinstance(row, dict) or not {"board"} <= set(row) <= {"board", "texture", "depth"}:
            raise FormatError(
                f'{FILE}: a chart is {row!r} but must be board = "a.tiff", and texture = "b.tiff" and '
                'depth = "5 mm" where they are known; ["a.tiff", "b.tiff"] of several exposures.'
            )
        board, texture = (
            _files(place, names if isinstance(names, list) else [names], key)
            for key in ("board", "texture") for names in (row.get(key, []),)
        )  # fmt: skip
        if not board:
            raise FormatError(f"{FILE}: the chart {row!r} has no picture of a board.")
        yield ChartExposures(board, texture, parse(str(row["depth"])) if "depth" in row else None)


def _by_names(place: Path) -> dict[str, Any]:
    names = sorted(path.name for path in place.iterdir() if path.suffix.lower() in _PICTURES)
    found: dict[str, Any] = {"white": [], "dark": [], "scenes": []}
    for name in names:
        kind = re.search("white|dark", name.lower())
        found["scenes" if kind is None else kind[0]].append(name)
    if not found["white"]:
        raise FormatError(
            f"{place} has neither {FILE} nor a picture with 'white' in its name among {len(names)} pictures."
        )
    return found


def save_charts(charts: Charts, folder: str | os.PathLike[str]) -> list[Path]:
    """Write the raw images into a folder that `read_charts` reads; returns the files."""
    place, files = Path(folder), []
    place.mkdir(parents=True, exist_ok=True)
    for light, images in charts.lights():
        for name, raw in zip(_names(light, images), images, strict=True):
            files.append(place / name)
            io.save(raw, files[-1])
    if charts.camera is not None:
        files.append(place / "camera.toml")
        store.write_bytes(files[-1], charts.camera.to_toml().encode())
    files.append(place / FILE)
    store.write_bytes(files[-1], "\n".join(_table(charts)).encode())
    return files


def _names(light: str, images: Sequence[RawImage]) -> list[str]:
    """Names of the files of a light's exposures."""
    return [f"{light}-{k:0{len(str(len(images)))}}.tiff" for k in range(1, len(images) + 1)]


def _table(charts: Charts) -> Iterator[str]:
    if charts.camera is not None:
        yield 'camera = "camera.toml"'
    if charts.spacing is not None:
        yield f'spacing = "{charts.spacing * 1e3:.9g} mm"'
    for key, images in (("white", charts.whites), ("dark", charts.darks), ("scenes", charts.scenes)):
        yield f"{key} = {json.dumps(_names(key, images))}"
    pairs = [_names(f"flat-{k}", pair) for k, pair in enumerate(charts.flats, 1)]
    yield f"flats = {json.dumps(pairs)}"
    for k, one in enumerate(charts.boards, 1):
        yield f"\n[[charts]]\nboard = {json.dumps(_names(f'board-{k}', one.boards))}"
        if one.textures:
            yield f"texture = {json.dumps(_names(f'texture-{k}', one.textures))}"
        if one.depth is not None:
            yield f'depth = "{one.depth * 1e3:.9g} mm"'
    yield ""
