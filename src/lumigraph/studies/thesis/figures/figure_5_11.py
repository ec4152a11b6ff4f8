"""Figures 5.11 and 5.12: lobe and cut-off against the magnification of the lenslets."""

import numpy as np

from lumigraph.design import plenoptic2
from lumigraph.plots.curves import curves
from lumigraph.studies.thesis.figures._lenslet import FOCAL as _FOCAL
from lumigraph.studies.thesis.figures._lenslet import PITCH as _PITCH
from lumigraph.studies.thesis.figures._lenslet import measured
from lumigraph.studies.thesis.figures.point_images import WAVELENGTH
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment


@experiment(
    "figure-5.11",
    "Resolution against magnification",
    question="How do the lobe and the cut-off of the rendered picture follow from the magnification?",
    thesis="Figures 5.11 and 5.12, equations 5.16 to 5.19",
    shows="Curves over the magnification, of the lateral resolution and of the cut-off, which rises.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Curves from m = 0.1 to 1, right and as printed, and what a wave behind one lenslet shows."""
    magnifications = np.linspace(0.1, 1.0, 91)
    b = np.array([plenoptic2.lenslet_distance(_FOCAL, m) for m in magnifications])
    a = np.array([plenoptic2.relay_distance(_FOCAL, m) for m in magnifications])
    lobe = np.array([plenoptic2.rendered_lobe(WAVELENGTH, _PITCH, relay) for relay in a])
    pairs = zip(magnifications, b, strict=True)
    cutoff = np.array([plenoptic2.rendered_cutoff(WAVELENGTH, _PITCH, m, distance) for m, distance in pairs])
    half = int(np.argmin(np.abs(magnifications - 0.5)))
    rows = []
    for m in (0.1, 0.5, 1.0):
        at = int(np.argmin(np.abs(magnifications - m)))
        wave_lobe, wave_cutoff = measured(a[at], b[at], WAVELENGTH)
        rows += [
            ResultRow(
                f"lobe of the wave, m = {m:g}",
                wave_lobe * 1e6,
                "µm",
                None,
                lobe[at] * 1e6,
                5e-3 * lobe[at] * 1e6,
                "twice the first zero behind a simulated lenslet, against 2.44 λ a/p",
            ),
            ResultRow(
                f"cut-off of the wave, m = {m:g}",
                wave_cutoff,
                "1/m",
                1e4 if m == 0.5 else None,
                cutoff[at],
                0.01 * cutoff[at],
                "from the MTF of that image, against m p/(λb); 5.18 has b/p, 1e-3 of it",
            ),
        ]
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
                ylabel="lobe [µm]",
            ),
            "Width of a point's central lobe (5.11).",
        ),
        (
            curves(magnifications, ours, xlabel="magnification of the lenslets", ylabel="cut-off [10⁴ /m]"),
            "Cut-off of the rendered picture (5.12). Equation 5.18 as printed would give "
            f"{printed[half]:.2g} /m at m = 0.5.",
        ),
    )
    return ExperimentOutcome(
        tuple(rows),
        figures,
        why="Equations 5.18 and 5.19 have b/p for p/b; a smaller f-number of the lenslets raises it.",
    )
