"""What a camera's description promises, measured on a picture of a chart that is simulated through it."""

import re
from collections.abc import Sequence

import numpy as np

from lumigraph.analysis import Chart, find_chart
from lumigraph.calibration import calibrate
from lumigraph.core.result import Quantity
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.metric import planes
from lumigraph.metric.exposures import mean_image
from lumigraph.metric.lights import Lights
from lumigraph.preparation import decode, prepare
from lumigraph.rendering import refocus

MEASURES = ("mtf50_middle", "mtf50_border", "mtf10_middle", "mtf10_border", "sample_on_chart", "distortion")
"""What is measured, and the contrast ``mtf@F/mm`` of F cycles per millimetre of the object, in the middle."""

_ACCURACY = 1e-3  # cameras that differ little are compared
_CONTRAST = re.compile(r"mtf@(\d+\.?\d*)/mm")


def is_measure(name: str) -> bool:
    """Whether `simulated` measures something of this name.

    >>> is_measure("mtf@10/mm"), is_measure("mtf50_middle"), is_measure("mtf@10")
    (True, True, False)
    """
    return name in MEASURES or _CONTRAST.fullmatch(name) is not None


def simulated(
    camera: LensletCamera, names: Sequence[str], *, rng: np.random.Generator | None = None
) -> dict[str, Quantity]:
    """Measures of a simulated picture of the plane in focus, as the data sheet makes them; None if none is.

    A white image and a chessboard are simulated by wave optics with the sensor's noise; the lattice is found
    on the former, the latter decoded or rendered.

    Parameters
    ----------
    camera
        A plenoptic camera 1.0 or 2.0.
    names
        Of `MEASURES`, or ``mtf@F/mm``.
    rng
        Random numbers of the noise.

    Raises
    ------
    GeometryError
        Another kind of camera, or an unknown name.
    SamplingError, CalibrationError
        A picture without a chart, or a white image without a lattice.
    """
    for name in names:
        if not is_measure(name):
            raise GeometryError(f"{name!r} is not measured. Give {', '.join(MEASURES)} or mtf@10/mm.")
    lights = Lights.of(camera, (0.0,), textured=False, accuracy=_ACCURACY)
    charts = lights.exposed(np.random.default_rng(0) if rng is None else rng, exposures=1)
    assert charts.spacing is not None  # it is simulated
    white, dark = mean_image(charts.whites), mean_image(charts.darks)
    lattice = calibrate(white)
    ready = prepare(charts.boards[0].boards[0], lattice, white=white, dark=dark, camera=camera)
    if isinstance(camera, Rendered) and planes.is_rendered(camera, ready):
        tried = planes.straightest(ready, camera.patch_at(0.0), camera)
    else:
        tried = planes.Tried(find_chart(planes.grey(refocus(decode(ready, lattice), 1.0))))
    found = {entry.name: entry for entry in planes.of_chart(tried, charts.spacing)}
    return {
        name: found[name] if name in found else _contrast(tried.chart, charts.spacing, name) for name in names
    }


def _contrast(chart: Chart, spacing: float, name: str) -> Quantity:
    """Mean contrast of the edges in the middle at a frequency on the chart."""
    told = _CONTRAST.fullmatch(name)
    assert told is not None  # names are known
    frequency = 1e3 * float(told[1]) * spacing / chart.spacing  # in cycles per sample
    edges = [edge for at, edge in chart.edges() if planes.is_middle(at, chart)]
    known = [float(np.interp(frequency, edge.frequencies, edge.mtf)) for edge in edges]
    beyond = not edges or frequency > min(edge.frequencies[-1] for edge in edges)
    return Quantity(name, None if beyond else float(np.mean(known)))
