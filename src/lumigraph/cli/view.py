"""`lumigraph view`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import COMMON, Common
from lumigraph.cli.origin import Origin
from lumigraph.cli.serving import Port, announce, check_port
from lumigraph.core.result import Quantity, Result
from lumigraph.errors import FormatError


@Parameter(name="*")
@dataclass(frozen=True)
class Shown(Origin):
    """What a raw image needs to become views or pictures.

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
    patch
        Of a camera 2.0 [px]: pictures with patches about this size. Found in the raw image if left out.
    """

    patch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Page:
    """How the page is shown.

    Parameters
    ----------
    port
        Of this computer, for its own browser only; any free one if left out.
    no_open
        Do not open a browser.
    export
        Write the page into this file (.html) instead, which works from disk and can be sent to others.
    quality
        Of the exported views, 1 to 99; 100 keeps every number, in a file several times as large.
    """

    port: Port = 0
    no_open: Annotated[bool, Parameter(negative="")] = False
    export: Path | None = None
    quality: Annotated[int, Parameter(allow_leading_hyphen=True)] = 90

    def check(self) -> None:
        """Refuse what is wrong before anything is read."""
        check_port(self.port)
        if not 1 <= self.quality <= 100:
            raise FormatError(f"--quality is {self.quality} but must be from 1 to 100.")
        if self.export is not None:
            files.check_output(self.export, (".html", ".htm"))


def view(
    file: Path,
    beside: Path | None = None,
    /,
    *,
    origin: Shown = Shown(),
    page: Page = Page(),
    common: Common = COMMON,
) -> Result | None:
    """Look at a file in the browser: refocus by a click, move the viewpoint, see raw pixels, depth, volumes.

    Prints the page's address and ends with Ctrl-C. Only this computer's browser is answered.

    Example: `lumigraph view views.zarr`

    Example: `lumigraph view raw.png --white white.png`

    Example: `lumigraph view views.zarr --export page.html`

    Parameters
    ----------
    file
        Light field, folder of views, raw image, focal stack, volume, or a camera (TOML), which is simulated.
    beside
        A second file to show side by side.
    """
    from lumigraph import viewer

    page.check()
    exhibits = [_opened(path, origin) for path in (file, beside) if path is not None]
    if page.export is not None:
        with progress("export") as shown:
            written = viewer.export(exhibits, page.export, quality=page.quality, progress=shown)
        sizes = {name.split("/")[1]: size for name, size in written.arrays.items()}
        parts = ", ".join(f"{name} {_megabytes(size)}" for name, size in sizes.items())
        text = f"{_megabytes(written.size)} ({parts})"
        values = (Quantity("bytes", written.size), Quantity("arrays", written.arrays))
        return Result("View", "", exhibits, (text,), values, written=(written.path,))
    viewer.serve(
        viewer.site(exhibits),
        port=page.port,
        ready=lambda address: announce(address, common, no_open=page.no_open),
    )
    return None


def _opened(path: Path, origin: Shown) -> Any:
    from lumigraph import viewer

    wanted = viewer.Origin(origin.calibration, origin.white, origin.dark, origin.described(), origin.patch)
    with progress(f"open {path.name}") as shown:
        return viewer.open_exhibit(path, wanted, shown)


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= 100_000 else f"{size / 1e3:.1f} kB"
