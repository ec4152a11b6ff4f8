"""Measures of a camera's description, on a simulated picture of a chart."""

import re
from collections.abc import Sequence

import numpy as np

from lumigraph.analysis import Chart
from lumigraph.analysis.chart import find_chart
from lumigraph.calibration import calibrate
from lumigraph.core import checks
from lumigraph.core.result import Quantity
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.metrology.datasheet import planes
from lumigraph.metrology.datasheet.charts import check_camera
from lumigraph.metrology.datasheet.exposures import mean_image
from lumigraph.metrology.datasheet.lights import Lights
from lumigraph.preparation import decode, prepare
from lumigraph.rendering import refocus

MEASURES = ("mtf50_middle", "mtf50_border", "mtf10_middle", "mtf10_border", "sample_on_chart", "distortion")
"""Measures, and the contrast ``mtf@F/mm`` of F cycles per millimetre of the object, in the middle."""

_ACCURACY = 1e-3  # cameras that differ little are compared
_CONTRAST = re.compile(r"mtf@(\d+\.?\d*)/mm")


def is_measure(name: str) -> bool:
    """True if `simulated` measures something of this name.

    >>> is_measure("mtf@10/mm"), is_measure("mtf50_middle"), is_measure("mtf@10")
    (True, True, False)
    """
    return name in MEASURES or _CONTRAST.fullmatch(name) is not None


def simulated(
    camera: LensletCamera,
    names: Sequence[str],
    *,
    depths: Sequence[float] = (0.0,),
    rng: np.random.Generator | None = None,
) -> dict[str, Quantity]:
    """Measures of simulated pictures, as the data sheet makes them, the worst over depths; None if none is.

    A white image and a chessboard at each depth are simulated by wave optics with the sensor's noise; the
    lattice is found on the former, the latter decoded and refocused to its depth, or rendered.

    Parameters
    ----------
    camera
        A plenoptic camera 1.0 or 2.0.
    names
        Of `MEASURES`, or ``mtf@F/mm``.
    depths
        Of the chessboard, from the plane in focus [m]: frequencies and contrasts are the least, widths and
        distortions the largest of all; None where one of them cannot be measured.
    rng
        Random numbers of the noise.

    Raises
    ------
    GeometryError
        Another kind of camera, an unknown name, or no depths.
    SamplingError, CalibrationError
        A picture without a chart, or a white image without a lattice.
    """
    for name in names:
        if not is_measure(name):
            raise GeometryError(f"{name!r} is not measured. Give {', '.join(MEASURES)} or mtf@10/mm.")
    if not len(depths):
        raise GeometryError("there are no depths. Give one at least, such as 0.")
    planned = [checks.finite("a depth", float(dz)) for dz in depths]
    for dz in planned:
        check_camera(camera).defocused(dz)
    rng = np.random.default_rng(0) if rng is None else rng
    seen = [_measured(camera, names, dz, rng) for dz in planned]
    return {name: _worst([one[name] for one in seen]) for name in names}


def _measured(
    camera: LensletCamera, names: Sequence[str], dz: float, rng: np.random.Generator
) -> dict[str, Quantity]:
    """Measures of a chessboard at a depth, with squares that suit it."""
    charts = Lights.of(camera, (dz,), textured=False, accuracy=_ACCURACY).exposed(rng, exposures=1)
    spacing = charts.spacing
    assert spacing is not None  # it is simulated
    white, dark = mean_image(charts.whites), mean_image(charts.darks)
    lattice = calibrate(white)
    ready = prepare(charts.boards[0].boards[0], lattice, white=white, dark=dark, camera=camera)
    if isinstance(camera, Rendered) and planes.is_rendered(camera, ready):
        tried = planes.straightest(ready, camera.patch_at(dz), camera)
    else:
        assert ready.calibration is not None  # prepared with one; in lengths, as refocusing needs them
        views = decode(ready, ready.calibration)
        tried = planes.TriedChart(find_chart(planes.grey(refocus(views, _alpha(camera, dz), oversample=1))))
    found = {entry.name: entry for entry in planes.of_chart(tried, spacing)}
    return {name: found[name] if name in found else _contrast(tried.chart, spacing, name) for name in names}


def _alpha(camera: LensletCamera, dz: float) -> float:
    """Refocus factor of a depth: the lenslets' distance behind the main lens over the image's."""
    focus = 1 / camera.main_lens.focal_length
    return (focus - 1 / camera.defocused(dz)) / (focus - 1 / camera.object_distance)


def _worst(some: Sequence[Quantity]) -> Quantity:
    """The least contrast or frequency, the largest width or distortion; None where one is not known."""
    unknown = [one for one in some if one.value is None]
    if unknown:
        return unknown[0]
    pick = min if some[0].name.startswith("mtf") else max
    return pick(some, key=lambda one: abs(float(one.value)))


def _contrast(chart: Chart, spacing: float, name: str) -> Quantity:
    """Mean contrast of the edges in the middle at a frequency on the chart."""
    told = _CONTRAST.fullmatch(name)
    assert told is not None  # names are known
    frequency = 1e3 * float(told[1]) * spacing / chart.spacing  # in cycles per sample
    edges = [edge for at, edge in chart.edges() if planes.is_middle(at, chart)]
    known = [float(np.interp(frequency, edge.frequencies, edge.mtf)) for edge in edges]
    beyond = not edges or frequency > min(edge.frequencies[-1] for edge in edges)
    return Quantity(name, None if beyond else float(np.mean(known)))
