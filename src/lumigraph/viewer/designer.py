"""The designer: a camera's parameters as sliders, and at once all that follows from them."""

import io
import json
import threading
from importlib.metadata import version
from typing import Any

from lumigraph.core import checks
from lumigraph.errors import FormatError, GeometryError
from lumigraph.instruments.loading import AnyCamera
from lumigraph.viewer.designer_curves import trade_offs
from lumigraph.viewer.designer_parameters import changed, parameters
from lumigraph.viewer.designer_point import timed
from lumigraph.viewer.page import static
from lumigraph.viewer.server import Resource, Site

MODULES = ("designer_charts.js", "designer_controls.js", "designer.js")

_FARTHEST = 1e5  # m


def designer_site(camera: AnyCamera, name: str) -> Site:
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
    resources = {"": Resource("text/html; charset=utf-8", static("designer.html").encode())}
    for file in MODULES:
        resources[f"app/{file}"] = Resource(script, static(file).encode())
    for file in ("style.css", "designer.css"):
        resources[f"app/{file}"] = Resource(style, static(file).encode())
    about = {
        "name": name, "kind": camera.KIND, "version": version("lumigraph"),
        "parameters": [_plain(each) for each in parameters(camera)], "depth": _depth_slider(camera),
    }  # fmt: skip
    resources["data/about"] = Resource("application/json", json.dumps(about).encode())
    one_at_a_time = threading.Lock()  # what is large in memory

    def point(given: dict[str, Any]) -> dict[str, Any]:
        wanted, dz = changed(camera, given.get("values")), _depth(given)
        with one_at_a_time:
            return timed(wanted, dz)

    def layout(given: dict[str, Any]) -> dict[str, Any]:
        wanted = changed(camera, given.get("values"))
        with one_at_a_time:
            return {"svg": _drawn(wanted)}

    def design(given: dict[str, Any]) -> dict[str, Any]:
        return designed(changed(camera, given.get("values")))

    return Site(resources, {"design": design, "layout": layout, "point": point})


def designed(camera: AnyCamera) -> dict[str, Any]:
    """All that follows in closed form, as JSON can hold it."""
    table = camera.describe()
    sections = [
        {"title": title, "rows": [[row.name, row.text, row.source] for row in rows]}
        for title, rows in table.sections
    ]
    diameter = getattr(camera, "pupil_diameter", None)
    return {
        "title": table.title, "sections": sections, "warnings": list(table.warnings),
        "curves": trade_offs(camera), "toml": camera.to_toml(), "diameter": diameter,
    }  # fmt: skip


def _plain(parameter: Any) -> dict[str, Any]:
    return {name: getattr(parameter, name) for name in parameter.__slots__}


def _depth_slider(camera: Any) -> dict[str, Any]:
    """Unit and reach of the point's depth."""
    if camera.KIND == "light-field-microscope":
        return {"unit": "µm", "scale": 1e-6, "reach": 100.0}
    reach = 0.3 * (camera.object_distance - camera.main_lens.focal_length)
    return {"unit": "mm", "scale": 1e-3, "reach": float(f"{reach * 1e3:.2g}")}


def _depth(given: dict[str, Any]) -> float:
    dz = given.get("dz", 0.0)
    checks.finite("dz", dz, error=FormatError)
    if abs(dz) > _FARTHEST:
        raise GeometryError(f"dz is {dz:g} m, beyond {_FARTHEST:g} m. Use a nearer point.")
    return float(dz)


def _drawn(camera: Any) -> str:
    """The rays through the camera as SVG; empty for a microscope, which has no drawing."""
    if camera.KIND == "light-field-microscope":
        return ""
    from lumigraph import plots

    buffer = io.StringIO()
    plots.layout(camera).savefig(buffer, format="svg", transparent=True)
    return buffer.getvalue()
