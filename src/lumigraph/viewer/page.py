"""The page's files, as a table to serve, and the exhibits' arrays beside them."""

import json
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import Any

from lumigraph.viewer.encoding import Coded
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.parts import Parts
from lumigraph.viewer.server import Content, Resource, Site

MODULES = (
    "colours.js", "tone.js", "source.js", "state.js", "aperture.js", "focusing.js", "shaders.js", "device.js",
    "canvas.js", "refocus.js", "overlay.js", "epi.js", "models.js", "pane.js", "histogram.js", "controls.js",
    "play.js", "keys.js", "main.js",
)  # fmt: skip
"""In the order of their imports: a module comes after those it uses."""

_TYPES = {"js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8"}


@cache
def static(name: str) -> str:
    """A file of the page; `name` comes from `MODULES` or from here, never from a request."""
    return files("lumigraph.viewer").joinpath("static", name).read_text("utf-8")


def site(exhibits: Sequence[Exhibit]) -> Site:
    """The viewer's page and one or two exhibits' arrays, as a table to serve."""
    resources = {"": Resource("text/html; charset=utf-8", static("index.html").encode())}
    for name in (*MODULES, "style.css"):
        kind = _TYPES[name.rsplit(".", 1)[1]]
        resources[f"app/{name}"] = Resource(kind, static(name).encode())
    parts = [Parts.of(exhibit) for exhibit in exhibits]
    resources["data/about"] = Resource("application/json", json.dumps(about(parts)).encode())
    for number, part in enumerate(parts):
        for name, coded in part.arrays.items():
            _add(resources, f"data/{number}/{name}", part, coded)
    return Site(resources)


def about(parts: Sequence[Parts]) -> dict[str, Any]:
    """What the page must know before any array."""
    return {"version": version("lumigraph"), "exhibits": [part.about for part in parts]}


def _add(resources: dict[str, Resource], path: str, part: Parts, coded: Callable[[], Coded]) -> None:
    kind = "application/octet-stream"
    if path.endswith("/views"):
        numbers = coded()
        flat = Coded(
            numbers.numbers.reshape(-1, *numbers.numbers.shape[2:]), numbers.scale, numbers.offset
        )  # fmt: skip
        for k, (first, count) in enumerate(part.about["views"]["chunks"]):
            resources[f"{path}/{k}"] = Resource(kind, _sliced(flat, first, count), keep=False)
    else:
        resources[path] = Resource(kind, lambda: coded().as_bytes())


def _sliced(flat: Coded, first: int, count: int) -> Callable[[], Content]:
    return lambda: flat.as_bytes(slice(first, first + count))
