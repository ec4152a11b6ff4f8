"""Image of an edge in coherent and in incoherent light."""

import warnings

import numpy as np
from scipy.special import sici

from lumigraph.core.field import Field
from lumigraph.errors import SamplingWarning
from lumigraph.plots import curves
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.figures._lamp_edge import lamp_edge, lamp_edge_theory, places
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

METHOD = "band limited, padded"
PLATEAU = slice(300, 400)
"""Samples from the edge, 1.5 to 2 mm: beyond the ringing, far from the end of the window."""
LAMPS = (0.25, 0.5, 1.0)
"""Widths of a lamp, in apertures of the lens."""

WHY = (
    "At the edge the coherent amplitude is half of its plateau, the intensity a quarter; the incoherent "
    "intensity is a half. The incoherent image is exact: the point image added up over the bright side. "
    "Fringes stand beside the edge as long as a lamp fills a part of the lens. One that fills it, as that of "
    "chapter 6 more than does, leaves none."
)


@experiment(
    "figure-3.19",
    "Image of an edge",
    question="Which intensity has the image of an edge at the edge, and which fringes has it beside it, in "
    "coherent light, in that of a lamp, and in incoherent light?",
    thesis="Figure 3.19, section 3.5.3",
    shows="An edge in coherent light, with fringes beside it, and in incoherent light, without.",
    camera=two_f.CAMERA,
)
def run(context: Context) -> ExperimentOutcome:
    """A half plane through the 2f system; the edge lies between two samples."""
    coherent = coherent_edge()
    context.progress(0.6, "incoherent")
    incoherent = incoherent_edge()
    x = two_f.GRID.x - two_f.GRID.pitch[1] / 2
    near = np.abs(x) <= 250 * um
    values, right = [at_edge(image) for image in (coherent, incoherent)], theory(x)
    rows = (
        ResultRow("intensity at the edge, coherent", values[0], thesis=0.25, expected=at_edge(right[0]),
            tolerance=0.0012, note="1/4, and what two samples 5 µm apart and a ringing plateau add"),
        ResultRow("intensity at the edge, incoherent", values[1], thesis=0.5, expected=at_edge(right[1]),
            tolerance=0.001, note="1/2, over a plateau that is not all of the light"),
        ResultRow("largest overshoot of the coherent image", float(coherent.max()),
            expected=float(right[0].max()), tolerance=0.004, note="(1/2 + Si(π)/π)²: ringing"),
        ResultRow("incoherent image from theory, largest difference near the edge",
            float(np.abs(incoherent - right[1])[near].max()), expected=0.0, tolerance=0.002),
    )  # fmt: skip
    lamps = {width: (lamp_edge(width), lamp_edge_theory(width)) for width in LAMPS}
    beside = np.abs(places()) < 100 * um
    rows += tuple(
        ResultRow(f"highest beside the edge, lamp {width:g} times as wide as the lens",
            float(row[beside].max()), expected=float(right[beside].max()), tolerance=0.003,
            note="over the plateau; mean of tilted waves' edges in closed form")
        for width, (row, right) in lamps.items()
    )  # fmt: skip
    edge = (x[near] > 0).astype(float)
    figure = curves(
        x[near] / um,
        {"edge": edge, "coherent": coherent[near], "incoherent": incoherent[near]}
        | {f"lamp of {width:g}": (places() / um, row) for width, (row, _) in lamps.items()},
        xlabel="x [µm]",
        ylabel="intensity",
        marks={"edge": 0.0},
    )
    return ExperimentOutcome(rows, ((figure, "Image of an edge, over its plateau"),), WHY)


def theory(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Images of an edge at 0, coherent and incoherent, over their plateaus; nothing is propagated.

    An edge has frequencies along x alone. A pupil passes them up to D/(2λz): the amplitude is
    1/2 + Si(2π f x)/π. The incoherent image is 1/2 + ∫ M(f) sin(2π f x)/(π f) df, M of a round pupil.
    """
    highest = two_f.DIAMETER / (2 * two_f.WAVELENGTH * two_f.DISTANCE)
    amplitude = 0.5 + sici(2 * np.pi * highest * x)[0] / np.pi
    nodes, weights = np.polynomial.legendre.leggauss(800)
    s = (nodes + 1) / 2
    passed = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)) * weights / (2 * np.pi * s)
    light = 0.5 + np.sin(4 * np.pi * highest * np.outer(x, s)) @ passed
    return _over_plateau(amplitude**2), _over_plateau(light)


def coherent_edge() -> np.ndarray:
    """Middle row of the image in light that converges on the lens, turned upright, over its plateau."""
    grid = two_f.GRID
    n = grid.shape[1] // 2
    along = np.exp(-1j * np.pi * grid.x**2 / (two_f.WAVELENGTH * two_f.DISTANCE))
    data = (along[:, None] * (along * (np.arange(grid.shape[1]) > n))).astype(np.complex64)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)
        image = two_f.train(METHOD, two_f.DIAMETER)(Field(data, grid, two_f.WAVELENGTH)).intensity
    return _over_plateau(_upright(two_f.profile(image)))


def incoherent_edge() -> np.ndarray:
    """The line spread added up over the bright samples, those beyond the middle one, over its plateau."""
    image, _ = two_f.point_image(METHOD)
    line = image.sum(0, dtype=np.float64)
    return _over_plateau(np.concatenate([[0.0], np.cumsum(line)[:-1]]))


def _upright(row: np.ndarray) -> np.ndarray:
    """The row turned about sample n // 2, the axis."""
    return np.roll(row[::-1], 1 - len(row) % 2)


def _over_plateau(row: np.ndarray) -> np.ndarray:
    n = len(row) // 2
    return row / row[n + PLATEAU.start : n + PLATEAU.stop].mean()


def at_edge(row: np.ndarray) -> float:
    """Value between the two samples beside the edge, the mean of both."""
    n = len(row) // 2
    return float((row[n] + row[n + 1]) / 2)
