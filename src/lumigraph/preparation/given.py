"""The files that come with a raw image: `Given`, and their readers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from lumigraph import io
from lumigraph.calibration import calibrate
from lumigraph.core import checks
from lumigraph.core.cache import remembered
from lumigraph.core.calibration import Calibration
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.raw import RawImage
from lumigraph.core.short_repr import called
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io.raytrix import lens_types
from lumigraph.preparation.beside import ReferenceImages
from lumigraph.preparation.calibration_file import read_calibration
from lumigraph.preparation.doubts import check_kinds
from lumigraph.preparation.prepare import prepare
from lumigraph.rendering import sharp_patches

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Given:
    """Files of the calibration, the white and the dark image of a raw image; None where there is none."""

    calibration: Path | None = None
    white: Path | None = None
    dark: Path | None = None

    def prepared(self, raw: RawImage, *, even: bool = True, **options: Any) -> PreparedImage:
        """The raw image, ready to use.

        Parameters
        ----------
        raw
            Raw image as it was read.
        even
            False where the white image only gives the lattice and is not divided out.
        options
            As `prepare` takes them.
        """
        place = None if self.calibration is None else read_calibration(self.calibration, raw.shape)
        found = place is None and self.white is not None
        white = None if self.white is None else _read(self.white, _stamp(self.white), "white image")
        dark = None if self.dark is None else _read(self.dark, _stamp(self.dark), "dark image")
        if place is None and self.white is not None:
            if white is not None and white.shape == raw.shape:
                check_kinds(raw, ReferenceImages(white, dark))
            place = _on_white(self.white, _stamp(self.white))
        white = white if even else None
        ready = prepare(raw, place, white=white, dark=dark, **options)
        if not found or place is None:
            return ready
        return replace(
            ready, notes=("the lattice was found on the white image", *place.notes, *ready.notes[1:])
        )


def _stamp(path: Path) -> tuple[int, int]:
    """Size and time of modification of a file, which change when it does."""
    known = path.stat() if path.exists() else None
    return (0, 0) if known is None else (known.st_size, known.st_mtime_ns)


@remembered
def _read(path: Path, stamp: tuple[int, int], what: str) -> RawImage:
    """A white or dark image, which the frames of a series share."""
    return read_raw(path, what)


@remembered
def _on_white(path: Path, stamp: tuple[int, int]) -> Calibration:
    return calibrate(_read(path, stamp, "white image"))


def read_raw(path: Path, what: str = "raw image") -> RawImage:
    """A raw, white or dark image of finite values.

    Raises
    ------
    FormatError
        Something else, or NaN.
    """
    raw = io.open(path)
    if not isinstance(raw, RawImage):
        raise FormatError(f"{path} holds a {called(raw)} where a {what} is needed.")
    checks.finite_array(str(path), raw.data, FormatError)
    return raw


def read_pages(path: Path, pages: str | None = None, *, one: bool = False) -> dict[int, RawImage]:
    """Raw images of a file by their pages, counted from 0.

    Parameters
    ----------
    path
        A raw image, or a stack of them.
    pages
        Pages of a stack: one, such as "3", some as "3:9" or "3-9", both of which count, or "all".
    one
        True if a single page is needed, as an error then says.

    Raises
    ------
    FormatError
        A stack without pages named, pages that it does not have, something else, or NaN.
    """
    numbers = pages_of(path, pages, one=one)
    if numbers == [None]:
        return {0: read_raw(path)}
    chosen, read = {}, _reader(path)
    for k in numbers:
        assert k is not None  # they are numbers, or one None
        chosen[k] = read(k)
        checks.finite_array(f"page {k} of {path}", chosen[k].data, FormatError)
    return chosen


def pages_of(path: Path, pages: str | None = None, *, one: bool = False) -> list[int | None]:
    """Numbers of the pages that `read_pages` reads; one None for a file of a single picture.

    Raises
    ------
    FormatError
        As `read_pages`.
    """
    count = io.pages(path)
    if count == 1 and not io.opens_pages(path):
        if pages not in (None, "0", "all"):
            raise FormatError(f"--page is {pages} but {path} has one page. Leave it out.")
        return [None]
    if pages is None:
        several = "" if one else ", or all"
        raise FormatError(f"{path} has {count} pages. Give --page 0 to {count - 1}{several}.")
    return list(_range(pages, count, path, one=one))


def _reader(path: Path) -> Callable[[int], RawImage]:
    """Gives a page of a file; the others are not read where its format allows that."""
    if io.opens_pages(path):
        return lambda k: _instance(path, io.open(path, page=k), RawImage)
    found = io.open(path)
    if isinstance(found, Volume):
        found = Stack(found.data)
    stack = _instance(path, found, Stack)
    return lambda k: RawImage(stack[k], stack.pixel_pitch, stack.bit_depth, metadata=stack.metadata)


def _instance(path: Path, thing: object, kind: type[Kind]) -> Kind:
    if not isinstance(thing, kind):
        raise FormatError(f"{path} holds a {called(thing)} where a raw image is needed.")
    return thing


def _range(pages: str, count: int, path: Path, *, one: bool) -> range:
    if pages == "all":
        return range(count)
    first, _, last = pages.partition("-" if "-" in pages else ":")
    try:
        found = range(int(first), int(last or first) + 1)
    except ValueError:
        found = range(0)
    if not found or found[0] < 0 or found[-1] >= count:
        forms = "one of them" if one else "one, some as '0:3' or '0-3', or 'all'"
        raise FormatError(f"--page is {pages!r} but {path} has pages 0 to {count - 1}. Give {forms}.")
    return found


def sharp_kinds(
    calibration: Calibration, patches: Sequence[float] = (), file: Path | None = None
) -> list[float] | None:
    """Patch [px] at which each of three kinds of lenslets is sharp; None of one kind, or where unknown.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    patches
        Patches of the camera's description; none without one.
    file
        File of the calibration: that of a maker of multi-focus cameras (.xml) says it, too.
    """
    if calibration.lattice.kinds == 1:
        return None
    if len(patches) == calibration.lattice.kinds:
        return list(patches)
    if file is None or file.suffix.lower() != ".xml":
        return None
    return list(sharp_patches(calibration, lens_types(file)))
