"""The designer: a camera's parameters as sliders, and at once all that follows from them."""

import io
import json
import threading
import time
from base64 import b64encode
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.picture import png
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments import Instrument
from lumigraph.instruments.point_view import PointImage
from lumigraph.viewer.designer_curves import trade_offs
from lumigraph.viewer.page import html_of, static
from lumigraph.viewer.server import Resource, Site

MODULES = ("designer_charts.js", "designer_controls.js", "designer.js")

_FARTHEST = 1e5  # m


def designer_site(camera: Instrument, name: str) -> Site:
    """The designer's page for a camera, as a table to serve.

    The page asks; all is computed here, by the same functions as in Python. Nothing is written: the
    camera's TOML is shown and saved by the browser.

    Parameters
    ----------
    camera
        Where the sliders start.
    name
        Of its file, shown and proposed for saving.
    """
    script, style = "text/javascript; charset=utf-8", "text/css; charset=utf-8"
    resources = {"": Resource("text/html; charset=utf-8", html_of("designer.html").encode())}
    for file in MODULES:
        resources[f"app/{file}"] = Resource(script, static(file).encode())
    for file in ("style.css", "designer.css"):
        resources[f"app/{file}"] = Resource(style, static(file).encode())
    about = {
        "name": name, "version": version("lumigraph"),
        "parameters": [asdict(each) for each in camera.parameters()], "depth": _depth_slider(camera),
    }  # fmt: skip
    resources["data/about"] = Resource("application/json", json.dumps(about).encode())
    one_at_a_time = threading.Lock()  # what is large in memory

    def point(given: dict[str, Any]) -> dict[str, Any]:
        wanted, dz = camera.changed(given.get("values")), _depth(given)
        with one_at_a_time:
            return timed(wanted, dz)

    def layout(given: dict[str, Any]) -> dict[str, Any]:
        wanted = camera.changed(given.get("values"))
        with one_at_a_time:
            return {"svg": _drawn(wanted)}

    def design(given: dict[str, Any]) -> dict[str, Any]:
        return designed(camera.changed(given.get("values")))

    return Site(resources, {"design": design, "layout": layout, "point": point})


def designed(camera: Instrument) -> dict[str, Any]:
    """All that follows in closed form, as JSON can hold it."""
    table = camera.describe()
    sections = [
        {"title": title, "rows": [[row.name, row.text, row.source] for row in rows]}
        for title, rows in table.sections
    ]
    return {
        "title": table.title, "sections": sections, "warnings": list(table.warnings),
        "curves": trade_offs(camera), "toml": camera.to_toml(), "diameter": camera.pupil_diameter,
    }  # fmt: skip


def timed(camera: Instrument, dz: float) -> dict[str, Any]:
    """Image of a point as a page shows it, with the seconds that it took."""
    started = time.perf_counter()
    answer = shown(camera.point_view(dz))
    return answer | {"seconds": time.perf_counter() - started}


def shown(image: PointImage, gamma: float = 0.5) -> dict[str, Any]:
    """A PNG whose brightness is (intensity / largest) ** gamma."""
    top = float(image.data.max()) or 1.0
    grey = np.rint(255 * np.clip(image.data / top, 0, 1) ** gamma).astype(np.uint8)
    return {
        "png": "data:image/png;base64," + b64encode(png(grey)).decode(), "shape": list(grey.shape),
        "pixel_pitch": image.pixel_pitch, "lenslets": image.lenslets, "notes": list(image.notes),
    }  # fmt: skip


def _depth_slider(camera: Instrument) -> dict[str, Any]:
    """Unit and reach of the point's depth."""
    reach = camera.depth_reach()
    unit, scale = ("µm", 1e-6) if reach < 5e-4 else ("mm", 1e-3)
    return {"unit": unit, "scale": scale, "reach": float(f"{reach / scale:.2g}")}


def _depth(given: dict[str, Any]) -> float:
    dz = given.get("dz", 0.0)
    dz = checks.finite("dz", dz, error=FormatError)
    if abs(dz) > _FARTHEST:
        raise GeometryError(f"dz is {dz:g} m, beyond {_FARTHEST:g} m. Use a nearer point.")
    return float(dz)


def _drawn(camera: Instrument) -> str:
    """The rays through the camera as SVG."""
    from lumigraph import plots

    buffer = io.StringIO()
    plots.layout(camera).savefig(buffer, format="svg", transparent=True)
    return buffer.getvalue()
