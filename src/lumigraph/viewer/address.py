"""A file that leads a browser to a page, so that the page's address stands in no command line.

Every local user can read the arguments of every process. The file's name says nothing, and only its owner
can read it.
"""

import atexit
import html
import os
import tempfile
from contextlib import suppress
from pathlib import Path

from lumigraph import store

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>lumigraph</title>
</head>
<body><p><a href="{address}">Open the page</a></p></body>
</html>
"""


def redirecting(address: str, folder: Path | None = None) -> Path:
    """A new file of this user alone that opens a page; it is removed when the program ends.

    Parameters
    ----------
    address
        Of the page, with its token.
    folder
        Where it lies; the user's cache folder if left out, or a new one of the system's for temporary files.

    Raises
    ------
    OSError
        It cannot be written.
    """
    place = folder or store.folder()
    try:
        if place is None:
            raise OSError
        place.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(".html", "open-", place)  # mode 0600, and never an old file
    except OSError:
        descriptor, name = tempfile.mkstemp(".html", "lumigraph-open-")
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        file.write(_PAGE.format(address=html.escape(address)))
    path = Path(name).absolute()
    atexit.register(_remove, path)
    return path


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
