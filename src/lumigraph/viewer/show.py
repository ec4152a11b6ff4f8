"""The viewer opened from Python."""

import threading
import webbrowser
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from lumigraph.core.calibration import Calibration
from lumigraph.errors import FormatError
from lumigraph.viewer.address import redirecting
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.inline import exhibit_of
from lumigraph.viewer.opening import Origin, open_exhibit
from lumigraph.viewer.page import site
from lumigraph.viewer.server import serve


def show(
    thing: Any, calibration: Calibration | None = None, *, port: int = 0, open_browser: bool = True
) -> None:
    """Open the viewer for something in memory, a file or a camera, until Ctrl-C; prints the page's address.

    Only browsers on this computer can reach the page. In a notebook use `view_inline`.

    Parameters
    ----------
    thing
        `LightField`, `RawImage`, `Stack` or `Volume`; the path of a file that `lumigraph view` takes; a
        camera's file, or its name in the catalogue.
    calibration
        Micro-images of a raw image in memory, which is then decoded too.
    port
        Port of this computer; 0 takes any free one.
    open_browser
        False only prints the address.

    Raises
    ------
    FormatError
        Something that has no picture, or a calibration without a raw image.
    LumigraphError
        The port is taken or not allowed.

    Examples
    --------
    ``lumigraph.show(views)``
    """

    def ready(address: str) -> None:
        print(address, flush=True)
        if open_browser:
            open_in_browser(address)

    serve(site([_exhibit(thing, calibration)]), port=port, ready=ready)


def _exhibit(thing: Any, calibration: Calibration | None) -> Exhibit:
    if not isinstance(thing, str | PathLike):
        return exhibit_of(thing, calibration)
    if calibration is not None:
        raise FormatError("a calibration is for a raw image in memory. Open the file first: lumigraph.open.")
    return open_exhibit(Path(thing), Origin())


def open_in_browser(address: str, complain: Callable[[str], None] = print) -> None:
    """Open a browser at an address, by a file that leads there: command lines can be read by all users."""
    try:
        file = redirecting(address)
    except OSError as error:
        complain(f"no browser is opened: {error.strerror or error}. Open the address above.")
        return
    threading.Thread(target=webbrowser.open, args=(file.as_uri(),), daemon=True).start()
