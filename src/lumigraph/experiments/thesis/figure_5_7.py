"""Figures 5.7 to 5.9: distances and main-lens aperture against the magnification of the lenslets."""

import numpy as np

from lumigraph.design import plenoptic2
from lumigraph.experiments.registry import Context, Outcome, Row, experiment
from lumigraph.plots.curves import curves

_FOCAL, _PITCH, _IMAGE = 5.2e-3, 150e-6, 0.12


@experiment(
    "figure-5.7",
    "Distances and aperture against magnification",
    question="How do b, a and the main lens' aperture follow from the magnification of the lenslets?",
    thesis="Figures 5.7, 5.8 and 5.9, equations 5.12 to 5.15",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> Outcome:
    """Curves from m = 0.1 to 0.5, and their ends by hand."""
    magnifications = np.linspace(0.1, 0.5, 41)
    b = np.array([plenoptic2.lenslet_distance(_FOCAL, m) for m in magnifications])
    a = np.array([plenoptic2.relay_distance(_FOCAL, m) for m in magnifications])
    views = np.array([plenoptic2.views_diameter(_PITCH, _IMAGE, distance) for distance in b])
    pairs = zip(a, b, strict=True)
    full = np.array([plenoptic2.full_diameter(_PITCH, _IMAGE + relay, distance) for relay, distance in pairs])
    lens_law = np.abs(1 / a + 1 / b - 1 / _FOCAL).max() * _FOCAL
    rows = (
        Row("b, m = 0.1", b[0] * 1e3, "mm", None, 5.72, 0.001),
        Row("b, m = 0.5", b[-1] * 1e3, "mm", 7.8, 7.8, 0.001),
        Row("a, m = 0.1", a[0] * 1e3, "mm", None, 57.2, 0.001),
        Row("a, m = 0.5", a[-1] * 1e3, "mm", 15.6, 15.6, 0.001),
        Row("D for 1/m views, m = 0.1", views[0] * 1e3, "mm", None, 3.147, 0.001),
        Row("D for 1/m views, m = 0.5", views[-1] * 1e3, "mm", 2.3, 2.308, 0.001),
        Row("D that fills micro-images, m = 0.5", full[-1] * 1e3, "mm", None, 2.608, 0.001, "p (z2 + a)/b"),
        Row("largest error of 1/a + 1/b = 1/f", lens_law, "", None, 0.0, 1e-12),
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
    return Outcome(
        rows,
        figures,
        why="Equation 5.15 calls z2 p/b a radius; it is a diameter. It gives each point 1/m views, but fills "
        "only z2/(z2 + a) of a micro-image.",
    )


def _figure(magnifications: np.ndarray, lines: dict[str, np.ndarray], label: str) -> object:
    return curves(magnifications, lines, xlabel="magnification of the lenslets", ylabel=label)
