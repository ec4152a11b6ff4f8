"""The page as a folder of files in several steps, which any web server shows: large things open at once."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np

from lumigraph import store
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, part, silent
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io.target import check_target, is_clutter
from lumigraph.viewer import safety
from lumigraph.viewer.encoding import Coded, white_level
from lumigraph.viewer.exhibit import Exhibit, comfortable, depth_of, grey_or_colour
from lumigraph.viewer.packing import LOSSLESS, check_quality, packed
from lumigraph.viewer.page import MEDIA, site_of
from lumigraph.viewer.parts import Parts
from lumigraph.viewer.pyramid import COARSE, TILE, Pyramid
from lumigraph.viewer.server import Resource, Site

_ENTRIES = {"index.html", "app", "data"}


@dataclass(frozen=True, slots=True)
class Folder:
    """Result of an export: folder, size and number of files.

    Parameters
    ----------
    path
        The folder.
    size
        Bytes of all files.
    files
        How many.
    """

    path: Path
    size: int
    files: int


def check_folder(path: Path) -> Path:
    """The path, refused where a page's folder could not be written in the end.

    Raises
    ------
    FormatError
        The folder above is missing or may not be written to; the folder holds something else.
    """
    if not path.is_dir():
        return check_target(path)
    check_target(path / "index.html")
    for entry in path.iterdir():
        if entry.name not in _ENTRIES and not is_clutter(entry):
            raise FormatError(
                f"writing {path} would remove {entry.name}, which it holds too. Choose another folder."
            )
    return path


def export_folder(
    exhibits: Sequence[Exhibit],
    path: Path,
    *,
    quality: int = 90,
    coarse: int = COARSE,
    tile: int = TILE,
    progress: Progress | None = None,
) -> Folder:
    """Write a page as a folder for any web server: views and volumes in tiles, every 1, 2, 4, ... samples.

    The page loads the coarsest pictures, then finer tiles of what is seen. No file needs a program on the
    server's side, nor requests for parts of it.

    Parameters
    ----------
    exhibits
        One, or two side by side.
    path
        Folder; one that an earlier export wrote is replaced.
    quality
        Of views and volumes of 8 bits as WebP pictures, 1 to 99; 100 keeps every number. Those of 16 bits
        and floats are kept as numbers of 16 bits.
    coarse
        Bytes that the coarsest pictures may take.
    tile
        Samples across a tile.
    progress
        Called as ``progress(fraction)``, a `core.progress.Stage`.

    Raises
    ------
    LumigraphError
        The quality is not 1 to 100.
    FormatError
        A folder that holds other things, or that cannot be written.
    """
    check_quality(quality)
    target, progress = check_folder(Path(path)), progress or silent
    with store.replacing(target) as place:
        writer, parts = _FolderWriter(place, quality), []
        for k, exhibit in enumerate(exhibits):
            parts.append(
                _streamed(exhibit, _Tiles(writer, k, coarse, tile, part(progress, k, len(exhibits))))
            )
        site = site_of(parts, lambda name, part, coded: packed(name, coded, part, quality))
        for name, resource in site.resources.items():
            content = bytes(resource.future().result())
            writer.write(name or "index.html", content if name else _with_policy(content))
    return Folder(target, writer.size, writer.files)


def serve_folder(path: Path) -> Site:
    """Site of a folder that `export_folder` wrote: its files, listed once.

    Raises
    ------
    FormatError
        No such folder.
    """
    if not (path / "index.html").is_file() or not (path / "data" / "about").is_file():
        raise FormatError(
            f"{path} is no folder of a page. Write one by 'lumigraph view FILE --export {path}'."
        )
    found = (file for file in path.rglob("*") if file.is_file() and not file.is_symlink())
    resources: dict[str, Resource] = {}
    for file in found:
        name = file.relative_to(path).as_posix()
        kind = MEDIA.get(file.suffix, "application/octet-stream")
        resources["" if name == "index.html" else name] = Resource(kind, file.read_bytes, keep=False)
    return Site(resources)


def _with_policy(page: bytes) -> bytes:
    """The page with the policy that a server of lumigraph sends beside it."""
    policy, _, _ = safety.POLICY.partition("; frame-ancestors")  # means nothing inside a page
    mark = b'<meta charset="utf-8">'
    return page.replace(
        mark, mark + f'\n<meta http-equiv="Content-Security-Policy" content="{policy}">'.encode(), 1
    )


class _FolderWriter:
    """Files in a folder, and how large they are."""

    def __init__(self, place: Path, quality: int) -> None:
        self.place, self.quality, self.size, self.files, self.lock = place, quality, 0, 0, Lock()

    def write(self, name: str, content: bytes) -> None:
        path = self.place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        with self.lock:
            self.size, self.files = self.size + len(content), self.files + 1

    def tile(self, name: str, coded: Coded) -> None:
        """Pictures of 8 bits as WebP where the quality allows a loss; all else exactly."""
        pictures = coded.bits == 8 and self.quality < LOSSLESS and "/valid-" not in name
        self.write(name, coded.pictures(self.quality) if pictures else coded.deflated())


@dataclass(frozen=True, slots=True)
class _Tiles:
    """Writer of the tiles of one exhibit."""

    writer: _FolderWriter
    number: int
    coarse: int
    tile: int
    progress: Progress

    def written(
        self, what: str, data: np.ndarray, valid: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray | None, Pyramid]:
        """Write the tiles; the values of the coarsest pictures, which are valid, and the pyramid."""
        pyramid = Pyramid.of(data, self.coarse, self.tile)
        coding = pyramid.coding
        if pyramid.coarsest == 1:
            return data, valid, pyramid

        def write(name: str, numbers: np.ndarray) -> None:
            coded = (
                Coded(numbers, coding.scale, coding.offset) if numbers.dtype != bool else Coded.of(numbers)
            )
            self.writer.tile(f"data/{self.number}/{what}-tiles/{name}", coded)

        numbers, mask = pyramid.write(data, write, valid, self.progress)
        values = numbers if coding.is_exact else Coded(numbers, coding.scale, coding.offset).values()
        return values if coding.is_exact else values.astype(np.float32), mask, pyramid


def _streamed(exhibit: Exhibit, tiles: _Tiles) -> Parts:
    """Description of an exhibit whose views and volume are coarse, with tiles of what is finer."""
    finer: dict[str, Pyramid] = {}
    white: dict[str, float] = {}
    if exhibit.views is not None:
        views = grey_or_colour(exhibit.views)
        flat = to_numpy(views.data).reshape(-1, *views.data.shape[2:])
        valid = None if views.valid is None else to_numpy(views.valid).reshape(-1, *views.data.shape[2:4])
        data, mask, pyramid = tiles.written("views", flat, valid)
        if pyramid.coarsest > 1:
            finer["views"], white["views"] = pyramid, white_level(flat)
            exhibit = _coarser_views(exhibit, views, pyramid.coarsest, data, mask)
    if exhibit.volume is not None:
        volume = exhibit.volume
        full = to_numpy(volume.data)
        full = full[..., 0] if full.ndim == 4 and full.shape[3] == 1 else full
        data, _, pyramid = tiles.written("volume", full)
        if pyramid.coarsest > 1:
            finer["volume"], white["volume"] = pyramid, white_level(full)
            exhibit = dataclasses.replace(exhibit, volume=_coarser_volume(volume, pyramid.coarsest, data))
    parts = Parts.of(exhibit, written=True)
    for what, pyramid in finer.items():
        parts.about[what] |= {"finer": pyramid.about(), "white": white[what]}
    return parts


def _coarser(grid: Grid, step: int, shape: tuple[int, ...]) -> Grid:
    """Samples 0, s, 2s, ... of a grid."""
    rows, columns = grid.y[::step], grid.x[::step]
    ny, nx = shape
    return Grid((ny, nx), (grid.pitch[0] * step, grid.pitch[1] * step), (rows[ny // 2], columns[nx // 2]))


def _coarser_views(
    exhibit: Exhibit, views: LightField, step: int, data: np.ndarray, mask: np.ndarray | None
) -> Exhibit:
    shape = views.data.shape[:2] + data.shape[1:]
    lenslets = _coarser(views.lenslets, step, data.shape[1:3])
    valid = None if mask is None else mask.reshape(shape[:4])
    small, changed = comfortable(
        LightField(data.reshape(shape), views.aperture, lenslets, views.separation, valid)
    )
    depth, finer = exhibit.depth and depth_of(small), exhibit.metres
    metres = None if finer is None else lambda disparities: finer(disparities * step)
    return dataclasses.replace(
        exhibit, views=small, depth=depth, relative=exhibit.relative or changed, metres=metres
    )


def _coarser_volume(volume: Volume, step: int, data: np.ndarray) -> Volume:
    return Volume(data, _coarser(volume.grid, step, data.shape[1:3]), volume.depths)
