"""The pictures that a data sheet is measured on: of a folder, or simulated from a camera file."""

import json
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lumigraph import io, store
from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.brief import brief
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.design import thin_lens
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments import Instrument, LensletCamera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.instruments.files import read as read_table
from lumigraph.instruments.loading import AnyCamera, load_camera
from lumigraph.preparation import read_raw
from lumigraph.scene import Scene, targets
from lumigraph.simulation import Incoherent, simulate
from lumigraph.units import parse

FILE = "charts.toml"
"""Names the pictures of a folder."""

FILL = 0.8
"""Part of a full well that white images and charts fill."""

ACCURACY = 1e-2
"""Of simulated charts, as good as their noise: at 1e-3 an image out of focus may take minutes."""

_FLATS = (0.1, 0.25, 0.45, 0.65)  # the same of further white images, for photon transfer
_CELL = 22.0  # samples of the picture to a square, of the farthest chart
_GRAIN = 1.5  # samples: blur of the texture
_TURN = math.radians(7)
_DISPARITIES = (-1.5, -0.75, 0.0, 0.75, 1.5)  # lenslets from one direction that is told apart to the next
_MAGNIFICATIONS = (0.75, 0.87, 1.0, 1.15, 1.3)  # of the lenslets over that of the plane in focus
_KEYS = {"camera", "spacing", "white", "dark", "flats", "charts", "scenes"}
_PICTURES = {".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm"}


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Raw images of the charts at one distance.

    Parameters
    ----------
    raw
        Of a chessboard that fills the picture, turned by some 7 degrees, as it was read.
    texture
        Of a random pattern at the same place, for depth; None where the board serves for it.
    depth
        Of the charts from the plane in focus [m], positive farther; None where it is not known.
    """

    raw: RawImage
    texture: RawImage | None = None
    depth: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Charts:
    """Raw images of one camera, for its data sheet.

    Parameters
    ----------
    name
        Of the camera.
    whites
        White images of one light, one at least; two tell the noise.
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
    whites: tuple[RawImage, ...]
    darks: tuple[RawImage, ...] = ()
    flats: tuple[tuple[RawImage, RawImage], ...] = ()
    boards: tuple[Seen, ...] = ()
    scenes: tuple[RawImage, ...] = ()
    camera: LensletCamera | None = None
    spacing: float | None = None

    def __post_init__(self) -> None:
        if not self.whites:
            raise FormatError(f"{self.name} has no white image. Take one of an evenly lit diffuser.")
        shapes = {one.shape for _, one in self.pictures()}
        if len(shapes) > 1:
            sizes = ", ".join(f"{rows} x {columns}" for rows, columns in sorted(shapes))
            raise FormatError(
                f"the pictures of {self.name} have several sizes: {sizes} px. Give one camera's."
            )

    def pictures(self) -> Iterator[tuple[str, RawImage]]:
        """All raw images with a name for a file."""
        for kind, images in (("white", self.whites), ("dark", self.darks), ("scenes", self.scenes)):
            yield from ((f"{kind}-{k}", one) for k, one in enumerate(images, 1))
        for k, pair in enumerate(self.flats, 1):
            yield from ((f"flat-{k}{side}", one) for side, one in zip("ab", pair, strict=True))
        for k, one in enumerate(self.boards, 1):
            yield f"board-{k}", one.raw
            if one.texture is not None:
                yield f"texture-{k}", one.texture


def check_camera(camera: AnyCamera | LensletCamera | Instrument) -> LensletCamera:
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

    def images(names: Any, key: str) -> tuple[RawImage, ...]:
        return tuple(read_raw(_inside(place, name, key), f"{key} image") for name in _listed(names, key))

    flats = [images(pair, "flats") for pair in _listed(table.get("flats", []), "flats")]
    if any(len(pair) != 2 for pair in flats):
        raise FormatError(f'{file}: flats must be pairs of pictures, [["a1.tiff", "a2.tiff"], ...].')
    spacing = None if "spacing" not in table else parse(str(table["spacing"]))
    return Charts(
        place.resolve().name, images(table.get("white", []), "white"), images(table.get("dark", []), "dark"),
        tuple((pair[0], pair[1]) for pair in flats), tuple(_boards(place, table.get("charts", []))),
        images(table.get("scenes", []), "scenes"), camera,
        None if spacing is None else checks.positive("spacing", spacing, error=FormatError),
    )  # fmt: skip


def _listed(value: Any, key: str) -> list[Any]:
    if not isinstance(value, list):
        raise FormatError(f"{FILE}: {key} is {value!r} but must be a list, in brackets.")
    return value


def _inside(place: Path, name: Any, key: str) -> Path:
    if not isinstance(name, str):
        raise FormatError(f"{FILE}: {key} names {name!r}, which is no file.")
    return place / name


def _boards(place: Path, rows: Any) -> Iterator[Seen]:
    for row in _listed(rows, "charts"):
        if not isinstance(row, dict) or not {"board"} <= set(row) <= {"board", "texture", "depth"}:
            raise FormatError(
                f'{FILE}: a chart is {row!r} but must be board = "a.tiff", and texture = "b.tiff" and '
                'depth = "5 mm" where they are known.'
            )
        board, texture = (
            read_raw(_inside(place, row[key], "charts"), key) if key in row else None
            for key in ("board", "texture")
        )
        assert board is not None  # one of the keys above
        yield Seen(board, texture, parse(str(row["depth"])) if "depth" in row else None)


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
    for name, raw in charts.pictures():
        files.append(place / f"{name}.tiff")
        io.save(raw, files[-1])
    if charts.camera is not None:
        files.append(place / "camera.toml")
        store.write_bytes(files[-1], charts.camera.to_toml().encode())
    files.append(place / FILE)
    store.write_bytes(files[-1], "\n".join(_table(charts)).encode())
    return files


def _table(charts: Charts) -> Iterator[str]:
    if charts.camera is not None:
        yield 'camera = "camera.toml"'
    if charts.spacing is not None:
        yield f'spacing = "{charts.spacing * 1e3:.9g} mm"'
    for key, images in (("white", charts.whites), ("dark", charts.darks), ("scenes", charts.scenes)):
        yield f"{key} = {json.dumps([f'{key}-{k}.tiff' for k in range(1, len(images) + 1)])}"
    pairs = [[f"flat-{k}{side}.tiff" for side in "ab"] for k in range(1, len(charts.flats) + 1)]
    yield f"flats = {json.dumps(pairs)}"
    for k, one in enumerate(charts.boards, 1):
        yield f'\n[[charts]]\nboard = "board-{k}.tiff"'
        if one.texture is not None:
            yield f'texture = "texture-{k}.tiff"'
        if one.depth is not None:
            yield f'depth = "{one.depth * 1e3:.9g} mm"'
    yield ""


def usual_depths(camera: LensletCamera) -> tuple[float, ...]:
    """Depths of five charts [m]: over what the camera refocuses, those beyond its reach left out."""
    f, focused, found = camera.main_lens.focal_length, camera.object_distance, []
    # A direction is as wide as a pixel, or as the lenslet's diffraction if that is wider.
    b, pitch = camera.lenslet_distance, camera.lenslets.pitch
    direction = max(camera.sensor.pixel_pitch, camera.wavelength * b / pitch) * camera.separation / b
    for change in _MAGNIFICATIONS if isinstance(camera, Rendered) else _DISPARITIES:
        if isinstance(camera, Rendered):
            image = camera.separation - (camera.separation - camera.image_distance) / change
        else:
            image = camera.separation / max(1 - change * pitch / direction, 1e-3)
        if f < image < 20 * f:
            found.append(round(thin_lens.object_distance(f, image) - focused, 9))
    return tuple(sorted(set(found)))


def simulate_charts(
    camera: LensletCamera,
    depths: Sequence[float] | None = None,
    *,
    name: str = "camera",
    rng: np.random.Generator | None = None,
    textured: bool = True,
    accuracy: float = ACCURACY,
    progress: Progress = silent,
) -> Charts:
    """The pictures that a laboratory would take with a camera, by wave optics and with its sensor's noise.

    Parameters
    ----------
    camera
        A plenoptic camera 1.0 or 2.0.
    depths
        Of the charts from the plane in focus [m]; None for `usual_depths`.
    name
        Of the camera.
    rng
        Random numbers of the noise.
    textured
        Whether random patterns are taken, too, for depth.
    accuracy
        Of the charts' pictures, relative rms; the white image's is 1e-3.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        Another kind of camera, or a depth inside the focal length.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    lights = Lights.of(camera, depths, textured=textured, accuracy=accuracy, progress=progress)
    return lights.exposed(rng, name)


@dataclass(frozen=True, slots=True, eq=False)
class Lights:
    """What a camera's sensor would see of white images and charts, before its noise.

    Parameters
    ----------
    camera
        That they belong to.
    white
        Of an evenly lit diffuser (y, x).
    charts
        (depth [m], board, texture) of each distance; None in the place of a texture that is not wanted.
    spacing
        Width of the board's squares [m]; None without charts.
    """

    camera: LensletCamera
    white: np.ndarray
    charts: tuple[tuple[float, np.ndarray, np.ndarray | None], ...]
    spacing: float | None

    __repr__ = brief

    @classmethod
    def of(
        cls,
        camera: LensletCamera,
        depths: Sequence[float] | None = None,
        *,
        textured: bool = True,
        accuracy: float = ACCURACY,
        progress: Progress = silent,
    ) -> "Lights":
        """By wave optics; parameters and errors as of `simulate_charts`."""
        camera = check_camera(camera)
        depths = usual_depths(camera) if depths is None else tuple(depths)
        white = np.asarray(to_numpy(simulate(camera, targets.white()).data))
        progress(1 / (len(depths) + 1))
        spacing = float(f"{max(_CELL * _sample(camera, depth) for depth in depths):.3g}") if depths else None
        charts = []
        for k, depth in enumerate(depths, 2):
            canvas = _canvas(camera, depth)
            scenes = [_board(canvas, spacing or 1.0)]
            if textured:
                scenes.append(targets.texture(canvas, _GRAIN * _sample(camera, depth), seed=k))
            seen = [
                np.asarray(to_numpy(simulate(camera, one.at(depth), Incoherent(accuracy)).data))
                for one in scenes
            ]
            charts.append((depth, seen[0], seen[1] if textured else None))
            progress(k / (len(depths) + 1))
        return cls(camera, white, tuple(charts), spacing)

    def exposed(self, rng: np.random.Generator, name: str = "camera") -> Charts:
        """Raw images with the sensor's noise."""
        sensor, top = self.camera.sensor, float(np.quantile(self.white, 0.999))

        def one(light: np.ndarray, fill: float = FILL) -> RawImage:
            return sensor.expose(light, reference=top, fill=fill, rng=rng)

        boards = tuple(
            Seen(one(board), None if texture is None else one(texture), depth)
            for depth, board, texture in self.charts
        )
        white = self.white
        return Charts(
            name, (one(white), one(white)), (one(0 * white), one(0 * white)),
            tuple((one(white, fill), one(white, fill)) for fill in _FLATS), boards,
            camera=self.camera, spacing=self.spacing,
        )  # fmt: skip


def _sample(camera: LensletCamera, depth: float) -> float:
    """Between samples of a picture, on a chart at a depth [m]."""
    per = max(1, abs(round(camera.patch_at(depth)))) if isinstance(camera, Rendered) else 1
    return camera.lenslets.pitch * camera.defocused(depth) / camera.separation / per


def _canvas(camera: LensletCamera, depth: float) -> Grid:
    """Samples of a plane at a depth, wider than what the camera sees there."""
    wide, grid = 1.1 * max(1.0, camera.defocused(depth) / camera.object_distance), camera.object_grid
    shape = tuple(math.ceil(n * wide) for n in grid.shape)
    return Grid((shape[0], shape[1]), grid.pitch, grid.center)


def _board(canvas: Grid, spacing: float) -> Scene:
    """A chessboard beyond the canvas; a square is on the axis, no corner."""
    count = 2 * math.ceil(0.75 * max(canvas.size) / spacing) + 2
    return targets.chessboard(canvas, (count, count), spacing, angle=_TURN)
