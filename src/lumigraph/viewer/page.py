"""The page's files, as a table to serve, and the exhibits' arrays beside them."""

import json
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import PurePath
from typing import Any

from lumigraph.viewer.encoding import Coded
from lumigraph.viewer.exhibit import Exhibit
from lumigraph.viewer.parts import Parts
from lumigraph.viewer.server import Content, Resource, Site

MODULES = (
    "colours.js", "tone.js", "turning.js", "source.js", "aperture.js", "focusing.js", "shaders.js",
    "device.js", "canvas.js", "refocus.js", "overlay.js", "measures.js", "state.js", "epi.js", "finer.js",
    "rays.js", "sections.js", "finishing.js", "models.js", "picking.js", "pane.js", "quilt.js",
    "histogram.js", "play.js", "saving.js", "webm.js", "film.js", "controls.js", "keys.js", "main.js",
)  # fmt: skip
"""Modules in the order of their imports: a module comes after those it uses."""

MEDIA = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
}  # fmt: skip
"""Media types of the page's files by their endings."""

Pack = Callable[[str, Parts, Coded], bytes]
"""Encoding of an array: function of its name, what it belongs to, and its numbers."""


@cache
def static(name: str) -> str:
    """A file of the page; `name` comes from `MODULES` or from here, never from a request."""
    return files("lumigraph.viewer").joinpath("static", name).read_text("utf-8")


@cache
def html_of(name: str) -> str:
    """A page of HTML, with the head that all pages have."""
    return static(name).replace("<!-- head.html -->\n", static("head.html"), 1)


def site(exhibits: Sequence[Exhibit]) -> Site:
    """The viewer's page and one or two exhibits' arrays, as a table to serve."""
    return site_of([Parts.of(exhibit) for exhibit in exhibits])


def site_of(parts: Sequence[Parts], pack: Pack = lambda name, part, coded: coded.as_bytes()) -> Site:
    """Site of exhibits that are described already; see `site`."""
    resources = {"": Resource(MEDIA[".html"], html_of("index.html").encode())}
    for name in (*MODULES, "style.css"):
        resources[f"app/{name}"] = Resource(MEDIA[PurePath(name).suffix], static(name).encode())
    resources["data/about"] = Resource("application/json", json.dumps(about(parts)).encode())
    for number, part in enumerate(parts):
        for name, coded in part.arrays.items():
            _add(resources, (f"data/{number}/{name}", name), part, coded, pack)
    return Site(resources)


def about(parts: Sequence[Parts]) -> dict[str, Any]:
    """Description of the exhibits, which the page reads before any array."""
    return {"version": version("lumigraph"), "exhibits": [part.about for part in parts]}


def pictures(views: Coded) -> Coded:
    """A light field's numbers (v, u, t, s[, c]) as pictures (n, t, s[, c])."""
    return Coded(views.numbers.reshape(-1, *views.numbers.shape[2:]), views.scale, views.offset)


def _add(
    resources: dict[str, Resource], at: tuple[str, str], part: Parts, coded: Callable[[], Coded], pack: Pack
) -> None:
    (path, name), kind = at, "application/octet-stream"
    if name == "views":
        flat = pictures(coded())
        for k, (first, count) in enumerate(part.about["views"]["chunks"]):
            some = slice(first, first + count)
            resources[f"{path}/{k}"] = Resource(kind, _sliced(flat, some, part, pack), keep=False)
    else:
        resources[path] = Resource(kind, lambda: pack(name, part, coded()))


def _sliced(flat: Coded, some: slice, part: Parts, pack: Pack) -> Callable[[], Content]:
    return lambda: pack("views", part, Coded(flat.numbers[some], flat.scale, flat.offset))
