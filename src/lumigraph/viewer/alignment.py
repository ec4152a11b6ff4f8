"""Live page of a bench's alignment: the steps of its log, as they are written."""

from base64 import b64encode
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lumigraph.core import checks
from lumigraph.errors import FormatError
from lumigraph.metrology.alignment.log import AlignmentLog
from lumigraph.metrology.alignment.setup import shown
from lumigraph.viewer.page import MEDIA, html_of, static
from lumigraph.viewer.server import Resource, Site

_KEPT = ("number", "seconds", "status", "notes", "instructions", "shape", "centers")


def alignment_site(folder: Path) -> Site:
    """Page that follows the log of an alignment, as a table to serve.

    Parameters
    ----------
    folder
        Of the log; it may be written later.
    """
    resources = {"": Resource(MEDIA[".html"], html_of("alignment.html").encode())}
    for name in ("alignment.js", "style.css", "alignment.css"):
        resources[f"app/{name}"] = Resource(MEDIA[Path(name).suffix], static(name).encode())
    log = AlignmentLog(folder)

    def step(given: dict[str, Any]) -> dict[str, Any]:
        count, wanted = log.count(), given.get("number")
        if not count:
            return {"count": 0, "name": folder.name, "version": version("lumigraph")}
        number = count - 1 if wanted is None else checks.whole("number", wanted, 0, FormatError)
        return {"count": count, "name": folder.name, "step": shown_step(log, min(number, count - 1))}

    return Site(resources, {"step": step})


def shown_step(log: AlignmentLog, number: int) -> dict[str, Any]:
    """One step as a page shows it: its picture, micro-images and a table of what is out of place."""
    found = log.step(number)
    rows = []
    for place, name in enumerate(found["moved_by_motors"]):
        expected, reached = found["reached"].get(name, (None, None))
        play, error = found["backlash"][place]
        rows.append([
            name.replace("_", " "), shown(name, found["out"][name]),
            f"± {shown(name, 1.96 * found['errors'][name], signed=False)}",
            "" if expected is None else shown(name, expected),
            "" if reached is None else shown(name, reached),
            _interval(name, play, 1.96 * error) if play else "",
        ])  # fmt: skip
    image = "data:image/png;base64," + b64encode(log.picture(number)).decode()
    return {name: found[name] for name in _KEPT} | {"rows": rows, "png": image}


def _interval(name: str, value: float, half: float) -> str:
    """A value and half its interval, with one unit."""
    return f"{shown(name, value, signed=False).rstrip(' µm°%')} ± {shown(name, half, signed=False)}"
