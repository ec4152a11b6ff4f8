"""The files that come with a raw image: `Given`, and their readers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lumigraph import io
from lumigraph.calibration import calibrate
from lumigraph.core import checks
from lumigraph.core.brief import called
from lumigraph.core.calibration import Calibration
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError
from lumigraph.io.raytrix import lens_types
from lumigraph.preparation.prepare import prepare
from lumigraph.rendering import sharp_patches

_MAKERS = (".xml", ".ini")  # which do not say how large their raw images are


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
            As it was read.
        even
            False where the white image only gives the lattice and is not divided out.
        options
            As `prepare` takes them.
        """
        place = None if self.calibration is None else read_calibration(self.calibration, raw.shape)
        white = None if self.white is None else read_raw(self.white, "white image")
        dark = None if self.dark is None else read_raw(self.dark, "dark image")
        if not even:
            place, white = calibrate(white) if place is None and white is not None else place, None
        return prepare(raw, place, white=white, dark=dark, **options)


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
        Of a stack: one, such as "3", some as "first:last", or "all".
    one
        Whether a single page is needed, as an error then says.

    Raises
    ------
    FormatError
        A stack without pages named, pages that it does not have, something else, or NaN.
    """
    found = io.open(path)
    if isinstance(found, Volume):
        found = Stack(found.data)
    if not isinstance(found, Stack):
        if pages not in (None, "0", "all"):
            raise FormatError(f"--page is {pages} but {path} has one page. Leave it out.")
        return {0: read_raw(path)}
    if pages is None:
        several = "" if one else ", or all"
        raise FormatError(f"{path} has {len(found)} pages. Give --page 0 to {len(found) - 1}{several}.")
    chosen = {}
    for k in _range(pages, len(found), path, one=one):
        checks.finite_array(f"page {k} of {path}", found[k], FormatError)
        chosen[k] = RawImage(found[k], found.pixel_pitch, found.bit_depth, metadata=found.metadata)
    return chosen


def _range(pages: str, count: int, path: Path, *, one: bool) -> range:
    first, _, last = ("0", ":", str(count - 1)) if pages == "all" else pages.partition(":")
    try:
        found = range(int(first), int(last or first) + 1)
    except ValueError:
        found = range(0)
    if not found or found[0] < 0 or found[-1] >= count:
        forms = "one of them" if one else "one, 'first:last' or 'all'"
        raise FormatError(f"--page is {pages!r} but {path} has pages 0 to {count - 1}. Give {forms}.")
    return found


def read_calibration(path: Path, shape: tuple[int, int] | None = None) -> Calibration:
    """A calibration: our own, or one by a camera's maker, which needs the raw images' shape.

    Raises
    ------
    FormatError
        Another kind of file.
    """
    ending = path.suffix.lower()
    if ending in _MAKERS:
        found = io.open(path, shape=shape)
    elif ending in (".lfp", ".lfr", ".lfx"):
        found = io.open(path, what="calibration")
    else:
        found = io.open(path)
    if not isinstance(found, Calibration):
        raise FormatError(f"{path} holds a {called(found)} where a calibration is needed.")
    return found


def sharp_kinds(
    calibration: Calibration, patches: Sequence[float] = (), file: Path | None = None
) -> list[float] | None:
    """Patch [px] at which each of three kinds of lenslets is sharp; None of one kind, or where unknown.

    Parameters
    ----------
    calibration
        Of the camera.
    patches
        What its description says; none without one.
    file
        Of the calibration: that of a maker of multi-focus cameras (.xml) says it, too.
    """
    if calibration.lattice.kinds == 1:
        return None
    if len(patches) == calibration.lattice.kinds:
        return list(patches)
    if file is None or file.suffix.lower() != ".xml":
        return None
    return list(sharp_patches(calibration, lens_types(file)))
