"""Figures 5.7 to 5.9: distances and main-lens aperture against the magnification of the lenslets."""

import numpy as np

from lumigraph.design import matching, plenoptic2
from lumigraph.plots.curves import curves
from lumigraph.studies.thesis.figures._lenslet import FOCAL as _FOCAL
from lumigraph.studies.thesis.figures._lenslet import IMAGE as _IMAGE
from lumigraph.studies.thesis.figures._lenslet import PITCH as _PITCH
from lumigraph.studies.thesis.figures._lenslet import traced
from lumigraph.studies.thesis.registry import (
    Context,
    ExperimentOutcome,
    ResultRow,
    closed_forms,
    experiment,
)


@experiment(
    "figure-5.7",
    "Distances and aperture against magnification",
    question="How do b, a and the main lens' aperture follow from the magnification of the lenslets?",
    thesis="Figures 5.7, 5.8 and 5.9, equations 5.12 to 5.15",
    shows="Curves of a, b and the aperture of the main lens, for magnifications from 0.1 to 0.5.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Curves from m = 0.1 to 0.5, and rays through the cameras that they describe."""
    magnifications = np.linspace(0.1, 0.5, 41)
    b = np.array([plenoptic2.lenslet_distance(_FOCAL, m) for m in magnifications])
    a = np.array([plenoptic2.relay_distance(_FOCAL, m) for m in magnifications])
    wide = [matching.diameters(_PITCH, _IMAGE, _IMAGE + relay, at) for relay, at in zip(a, b, strict=True)]
    views, full = np.array([each.matched for each in wide]), np.array([each.full for each in wide])
    rows = (
        ResultRow("b, m = 0.5", b[-1] * 1e3, "mm", 7.8, 7.8, 0.001),
        ResultRow("a, m = 0.5", a[-1] * 1e3, "mm", 15.6, 15.6, 0.001),
        ResultRow("D for 1/m views, m = 0.5", views[-1] * 1e3, "mm", 2.3, 2.308, 0.001),
        *(row for k in (0, 15, -1) for row in _traced(a[k], b[k], (views[k], full[k]))),
    )
    figures = (
        (_figure(magnifications, {"b": b * 1e3}, "b [mm]"), "Lenslets to sensor (5.7)."),
        (_figure(magnifications, {"a": a * 1e3}, "a [mm]"), "Main-lens image to lenslets (5.8)."),
        (
            _figure(
                magnifications,
                {"1/m views: z2 p/b": views * 1e3, "micro-images filled: (z2 + a) p/b": full * 1e3},
                "diameter [mm]",
            ),
            "Aperture of the main lens (5.9).",
        ),
    )
    return ExperimentOutcome(
        closed_forms(rows),  # rays through matrices: no wave
        figures,
        why="Equation 5.15 calls z2 p/b a radius; it is a diameter. It gives each point 1/m views, but fills "
        "only z2/(z2 + a) of a micro-image.",
    )


def _traced(a: float, b: float, apertures: tuple[float, float]) -> tuple[ResultRow, ...]:
    """Rays: the distances image a point sharply, m times as large; each aperture does what it is for."""
    narrow, wide = (traced(a, b, diameter) for diameter in apertures)
    m, lens = b / a, "D = z2 p/b"
    return (
        ResultRow(
            f"two rays of a point on the sensor, m = {m:.2g}",
            narrow["blur"] * 1e9,
            "nm",
            None,
            0.0,
            0.1,
            "meet; with b = f (1 - m) they would be up to 0.1 mm apart",
        ),
        ResultRow(
            f"size of the image by rays, m = {m:.2g}", narrow["magnification"], "", None, round(m, 3), 1e-6
        ),
        ResultRow(
            f"lenslets that a point lights, {lens}, m = {m:.2g}", narrow["lenslets"], "", None, 1 / m, 1e-6
        ),
        ResultRow(
            f"filled part of a micro-image, {lens}, m = {m:.2g}",
            narrow["filled"],
            "",
            1.0,
            _IMAGE / (_IMAGE + _FOCAL * (1 + 1 / m)),
            1e-6,
            "5.15 would have it 1",
        ),
        ResultRow(f"the same, D = (z2 + a) p/b, m = {m:.2g}", wide["filled"], "", None, 1.0, 1e-6),
    )


def _figure(magnifications: np.ndarray, lines: dict[str, np.ndarray], label: str) -> object:
    return curves(magnifications, lines, xlabel="magnification of the lenslets", ylabel=label)
