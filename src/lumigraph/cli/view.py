"""`lumigraph view`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import COMMON, Common, section
from lumigraph.cli.origin import RawOptions
from lumigraph.cli.serving import Port, announce, check_port
from lumigraph.core.result import Quantity, Result
from lumigraph.errors import FormatError


@Parameter(name="*", group=section("Raw image"))
@dataclass(frozen=True)
class ShownOptions(RawOptions):
    """Corrections and geometry of a raw image, for views or pictures.

    Parameters
    ----------
    calibration
        File made by 'lumigraph calibrate', or the camera maker's (.xml, .ini, .json).
    white
        White image: the raw image is divided by it, and calibrated from it without --calibration.
    dark
        Image with the lens covered: subtracted; shows which pixels are hot.
    camera
        Camera file, or a name of the catalogue, of the raw image.
    page
        Page of a stack of raw images, counted from 0.
    bit_depth
        Bits of the sensor, such as 12, where the file does not say and full pixels are to be known.
    mosaic
        Views, rows x columns, such as 5x5, of a picture made of blocks, one for each lenslet (ESLF).
    patch
        For a camera 2.0: size of the patches [px]; found in the raw image if left out.
    """

    patch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None


@Parameter(name="*", group=section("Page"))
@dataclass(frozen=True)
class PageOptions:
    """Display of the page.

    Parameters
    ----------
    port
        Port of this computer, which only its own browser can reach; 0: any free one.
    no_open
        Do not open a browser.
    export
        Write the page instead: into one file (.html), which works from disk and can be sent to others, or
        into a folder for any web server, in tiles, so that things of many gigabytes open at once.
    quality
        Quality of the exported views, 1 to 99; 100 is lossless, in files several times as large.
    serve_folder
        FILE is a folder that --export wrote: serve its files.
    """

    port: Port = 0
    no_open: Annotated[bool, Parameter(negative="")] = False
    export: Path | None = None
    quality: Annotated[int, Parameter(allow_leading_hyphen=True)] = 90
    serve_folder: Annotated[bool, Parameter(negative="")] = False

    @property
    def is_file(self) -> bool:
        """True if the page is written into one file."""
        return self.export is not None and self.export.suffix.lower() in (".html", ".htm")

    def check(self) -> None:
        """Refuse what is wrong before anything is read."""
        check_port(self.port)
        if not 1 <= self.quality <= 100:
            raise FormatError(f"--quality is {self.quality} but must be from 1 to 100.")
        if self.export is None:
            return
        if self.serve_folder:
            raise FormatError("--export writes a page and --serve-folder shows one. Leave one of them out.")
        if self.is_file:
            files.check_output(self.export, (".html", ".htm"))
            return
        if self.export.suffix:
            raise FormatError(
                f"--export is {self.export}: the wrong extension. Give a file (.html), or a folder (none)."
            )
        files.check_page(self.export)


def is_shown(word: str) -> bool:
    """True if a word in the place of a verb is a file, which `lumigraph FILE` shows."""
    if not word or word.startswith("-"):
        return False
    path = Path(word)
    try:
        return path.is_file() or (path.is_dir() and (path.suffix != "" or (path / "views.json").is_file()))
    except OSError:  # longer than any name of a file
        return False


def view(
    file: Path,
    beside: Path | None = None,
    /,
    *,
    origin: ShownOptions = ShownOptions(),
    page: PageOptions = PageOptions(),
    common: Common = COMMON,
) -> Result | None:
    """Look at a file in the browser: refocus by a click, move the viewpoint, see raw pixels, depth, volumes.

    Prints the page's address and ends with Ctrl-C. Only browsers on this computer can reach it.

    Example: `lumigraph view views.zarr`, or only `lumigraph views.zarr`

    Example: `lumigraph view raw.png --white white.png`

    Example: `lumigraph view views.zarr --export page.html`

    Example: `lumigraph view large.zarr --export page`, then `lumigraph view page --serve-folder`

    Parameters
    ----------
    file
        Light field, folder of views, raw image, focal stack, volume, or a camera (TOML), which is simulated.
    beside
        A second file to show side by side.
    """
    from lumigraph import viewer

    page.check()
    if page.serve_folder:
        if beside is not None:
            raise FormatError("--serve-folder serves one folder. Leave the second file out.")
        _serve(viewer.serve_folder(file), page, common)
        return None
    exhibits = [_opened(path, origin) for path in (file, beside) if path is not None]
    if page.export is None:
        _serve(viewer.site(exhibits), page, common)
        return None
    return _exported(exhibits, page, page.export)


def _serve(site: Any, page: PageOptions, common: Common) -> None:
    from lumigraph import viewer

    viewer.serve(site, port=page.port, ready=lambda address: announce(address, common, no_open=page.no_open))


def _exported(exhibits: list[Any], page: PageOptions, path: Path) -> Result:
    from lumigraph import viewer

    with progress("export") as shown:
        if page.is_file:
            written = viewer.export(exhibits, path, quality=page.quality, progress=shown)
            sizes = {name.split("/")[1]: size for name, size in written.arrays.items()}
            about = ", ".join(f"{name} {_megabytes(size)}" for name, size in sizes.items())
            values = Quantity("bytes", written.size), Quantity("arrays", written.arrays)
        else:
            written = viewer.export_folder(exhibits, path, quality=page.quality, progress=shown)
            about = f"{written.files} files, for any web server"
            values = Quantity("bytes", written.size), Quantity("files", written.files)
    text = f"{_megabytes(written.size)} ({about})"
    told = [value for one in exhibits for what, value in one.facts if what == "Prepared"]
    return Result(
        "View", "", exhibits, (text,), values, notes=tuple(dict.fromkeys(told)), written=(written.path,)
    )


def _opened(path: Path, origin: ShownOptions) -> Any:
    from lumigraph import viewer

    wanted = viewer.Origin(
        origin.calibration,
        origin.white,
        origin.dark,
        origin.described(),
        origin.patch,
        origin.page,
        origin.bit_depth,
        origin.views_of_mosaic,
    )
    with progress(f"open {path.name}") as shown:
        return viewer.open_exhibit(path, wanted, shown)


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 100_000 else f"{size / 1e3:.1f} kB"
