"""Planes of a TIFF file, wherever they stand: its pages, bytes behind the only one, pages of other files."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path

import numpy as np
import tifffile

from lumigraph.errors import FormatError
from lumigraph.io import ome, source
from lumigraph.io.hyperstack import Declared
from lumigraph.io.tiff_pixels import pixels

MOST = 100_000
"""Pages."""

_NAMED = 3  # missing files in a message
_WHOLE = (8, 16, 32, 64)


@dataclass(slots=True)
class PlaneReader:
    """Reader of planes, one by one.

    Parameters
    ----------
    path, file
        Of the file that was opened.
    count
        Planes.
    behind
        Whether they stand one behind the other, with a page for the first alone.
    places
        Name of another file (empty for this one) and page of each plane; empty where pages stand in order.
    """

    path: Path
    file: tifffile.TiffFile
    count: int
    behind: bool = False
    places: tuple[tuple[str, int], ...] = ()
    _other: tuple[str, tifffile.TiffFile] | None = field(default=None, init=False)

    def page(self, k: int) -> tuple[Path, tifffile.TiffPage]:
        """File and page of a plane; of those behind each other the only page."""
        if self.behind:
            return self.path, page_of(self.path, self.file, 0)
        if not self.places:
            return self.path, page_of(self.path, self.file, k)
        name, index = self.places[k]
        if not name:
            return self.path, page_of(self.path, self.file, index)
        path = self.path.parent / name
        if self._other is None or self._other[0] != name:
            self.close()
            self._other = name, tifffile.TiffFile(source.unlinked(path))
        if index >= len(self._other[1].pages):
            raise FormatError(f"{path} has {len(self._other[1].pages)} pages where {index + 1} are needed.")
        return path, page_of(path, self._other[1], index)

    def pixels(self, k: int, *, transparent: bool) -> np.ndarray:
        """Pixels of a plane (y, x) or (y, x, c), whose page has been checked."""
        path, page = self.page(k)
        if not self.behind:
            return pixels(path, page, transparent=transparent)
        size = _bytes_of(page)
        dtype = np.dtype(page.dtype).newbyteorder(self.file.byteorder)
        with path.open("rb") as stream:
            stream.seek(page.dataoffsets[0] + k * size)
            content = stream.read(size)
        data = np.frombuffer(content, dtype).reshape(page.shape)
        return data.astype(dtype.newbyteorder("="))

    def close(self) -> None:
        """Close the other file that is open."""
        if self._other is not None:
            self._other[1].close()
            self._other = None


@contextmanager
def opened(
    path: Path, file: tifffile.TiffFile, planes: ome.OmePlanes | None, told: Declared | None
) -> Iterator[PlaneReader]:
    """Reader of all planes that a file declares, as a context.

    Raises
    ------
    FormatError
        More planes are declared than there are: which files are missing.
    """
    reader = _reader(path, file, planes, told)
    try:
        yield reader
    finally:
        reader.close()


def _reader(
    path: Path, file: tifffile.TiffFile, planes: ome.OmePlanes | None, told: Declared | None
) -> PlaneReader:
    if (count := len(file.pages)) == 0:
        raise FormatError(f"{path} is a TIFF without a picture. Copy or save it again.")
    wanted = count if told is None else told.count
    if max(count, wanted) > MOST:
        raise FormatError(f"{path} has {max(count, wanted)} pages but at most {MOST} are read. Split it.")
    if planes is not None:
        return _ome_reader(path, file, planes, count)
    if wanted <= count or told is None:
        return PlaneReader(path, file, count)
    page = page_of(path, file, 0)
    if count > 1 or not _is_plain(page):
        raise FormatError(
            f"{path}: {told.writer}'s header says {wanted} images but the file has {count}, and no pixels "
            "that stand plainly behind each other. Copy or save it again."
        )
    end, size = page.dataoffsets[0] + wanted * _bytes_of(page), path.stat().st_size
    if end > size:
        raise FormatError(
            f"{path} is cut short: {told.writer}'s header says {wanted} images, which need {end} bytes, but "
            f"the file has {size}. Copy it again."
        )
    return PlaneReader(path, file, wanted, behind=True)


def _ome_reader(path: Path, file: tifffile.TiffFile, planes: ome.OmePlanes, count: int) -> PlaneReader:
    places = planes.places
    names = {name for name, _ in places if name}
    if len(names) == 1 and not any(name == "" for name, _ in places) and _renamed(path, names, places, count):
        places, names = tuple(("", index) for _, index in places), set()
    missing = sorted(name for name in names if not _is_beside(path, name))
    if missing:
        more = " ..." if len(missing) > _NAMED else ""
        lost = sum(name in missing for name, _ in places)
        raise FormatError(
            f"{path} names {planes.count} planes, {lost} of them in files that are not beside it: "
            f"{', '.join(missing[:_NAMED])}{more}. Copy them into its folder, or choose one by page=."
        )
    here = 1 + max((index for name, index in places if not name), default=-1)
    if here > count or (not places and planes.count > count):
        raise FormatError(
            f"{path}: its OME-XML says {planes.count} planes but the file has {count}. Copy it again, or "
            f"choose one by page=0 ... {count - 1}."
        )
    if not names and [index for _, index in places] == list(range(count)):
        places = ()
    if not names and count > len(places):  # several images: all pages, as they stand
        places = ()
    return PlaneReader(path, file, len(places) or count, places=places)


def _renamed(path: Path, names: set[str], places: tuple[tuple[str, int], ...], count: int) -> bool:
    """Whether the only file that is named is this one, under the name that it once had."""
    return not _is_beside(path, next(iter(names))) and max(index for _, index in places) < count


def _is_beside(path: Path, name: str) -> bool:
    return Path(name).name == name and (path.parent / name).is_file()


def page_of(path: Path, file: tifffile.TiffFile, index: int) -> tifffile.TiffPage:
    """A page of a file."""
    image = file.pages.get(index)
    if not isinstance(image, tifffile.TiffPage):
        raise FormatError(f"{path} has a page of an unknown kind.")
    return image


def _bytes_of(page: tifffile.TiffPage) -> int:
    return ceil(page.imagelength * page.imagewidth * page.samplesperpixel * page.bitspersample / 8)


def _is_plain(page: tifffile.TiffPage) -> bool:
    """Whether pixels stand in one piece, so that those of the next plane can follow."""
    ends = [at + size for at, size in zip(page.dataoffsets, page.databytecounts, strict=True)]
    return (
        page.compression == 1
        and page.bitspersample in _WHOLE
        and page.dtype is not None
        and page.photometric in (tifffile.PHOTOMETRIC.MINISBLACK, tifffile.PHOTOMETRIC.RGB)
        and (page.samplesperpixel == 1 or page.planarconfig == 1)
        and not page.is_tiled
        and list(page.dataoffsets[1:]) == ends[:-1]
    )
