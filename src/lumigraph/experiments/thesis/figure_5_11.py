"""Figures 5.11 and 5.12: lobe and cut-off against the magnification of the lenslets."""

import numpy as np

from lumigraph.design import plenoptic2
from lumigraph.experiments.registry import Context, Outcome, Row, experiment
from lumigraph.experiments.thesis.point_images import WAVELENGTH
from lumigraph.plots.curves import curves

_FOCAL, _PITCH = 5.2e-3, 150e-6


@experiment(
    "figure-5.11",
    "Resolution against magnification",
    question="How do the lobe and the cut-off of the rendered picture follow from the magnification?",
    thesis="Figures 5.11 and 5.12, equations 5.16 to 5.19",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> Outcome:
    """Curves from m = 0.1 to 1, right and as printed, and some values by hand."""
    magnifications = np.linspace(0.1, 1.0, 91)
    b = np.array([plenoptic2.lenslet_distance(_FOCAL, m) for m in magnifications])
    a = np.array([plenoptic2.relay_distance(_FOCAL, m) for m in magnifications])
    lobe = np.array([plenoptic2.rendered_lobe(WAVELENGTH, _PITCH, relay) for relay in a])
    pairs = zip(magnifications, b, strict=True)
    cutoff = np.array([plenoptic2.rendered_cutoff(WAVELENGTH, _PITCH, m, distance) for m, distance in pairs])
    half = int(np.argmin(np.abs(magnifications - 0.5)))
    rows = (
        Row("lobe, m = 0.1", lobe[0] * 1e6, "um", None, 588.8, 0.2),
        Row("lobe, m = 0.5", lobe[half] * 1e6, "um", None, 160.6, 0.1),
        Row("lobe, m = 1", lobe[-1] * 1e6, "um", None, 107.1, 0.1),
        Row("cut-off, m = 0.1", cutoff[0], "1/m", None, 4144.0, 1.0),
        Row("cut-off, m = 0.5", cutoff[half], "1/m", 10000.0, 15195.0, 1.0, "measured in the thesis"),
        Row("cut-off, m = 1", cutoff[-1], "1/m", None, 22792.0, 1.0),
        Row("lobe × cut-off", float((lobe * cutoff).mean()), "", None, 2.44, 0.001, "at every m"),
    )
    printed = magnifications * b / (WAVELENGTH * _PITCH)
    ours = {"m p/(λb)": cutoff / 1e4}
    figures = (
        (
            curves(
                magnifications,
                {
                    "rendered: 2.44 λ a/p": lobe * 1e6,
                    "on the sensor: 2.44 λ b/p": lobe * magnifications * 1e6,
                },
                xlabel="magnification of the lenslets",
                ylabel="lobe [um]",
            ),
            "Width of a point's central lobe (5.11).",
        ),
        (
            curves(magnifications, ours, xlabel="magnification of the lenslets", ylabel="cut-off [10⁴ /m]"),
            "Cut-off of the rendered picture (5.12). Equation 5.18 as printed would give "
            f"{printed[half]:.2g} /m at m = 0.5.",
        ),
    )
    return Outcome(
        rows,
        figures,
        why="Equations 5.18 and 5.19 have b/p for p/b; a smaller f-number of the lenslets raises it.",
    )
