"""Image of a point, its profiles and its spectra."""

import numpy as np

from lumigraph.analysis import cutoff, mtf
from lumigraph.design.resolution import f_number, incoherent_cutoff
from lumigraph.plots import curves, images
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, um

CUTOFF = incoherent_cutoff(two_f.WAVELENGTH, f_number(two_f.DISTANCE, two_f.DIAMETER))
LEVEL = 0.01
LEVEL_AT = 0.95874
"""Frequency, over the cut-off, at which the transfer function of a round pupil is 0.01."""

WHY = (
    "The transfer function is the modulus of the intensity's transform (the thesis squares it, 5.21, and "
    "draws a row's spectrum instead of a slice of the 2-D one). Beyond the cut-off the band-limited methods "
    "leave nothing but rounding; the peak at 1e5 /m is the unpadded angular spectrum's aliasing, and the "
    "background of the multi-step method is light that wraps round."
)


@experiment(
    "figure-3.6",
    "Point image, profiles and spectra",
    question="What does each method make of a point, and which frequencies reach the image?",
    thesis="Figures 3.6 and 3.7, equation 3.2",
    shows="A point's image, cross section and power spectrum by four methods, beside Airy's pattern and its "
    "spectrum in red.",
    camera=two_f.CAMERA,
)
def run(context: Context) -> ExperimentOutcome:
    """A pinhole of 10 µm, as in the thesis, through the whole system."""
    names = [name for name in two_f.METHODS if not (context.quick and name.startswith("multi"))]
    near, x = two_f.middle(250 * um), two_f.GRID.x
    pictures, profiles, spectra, rows = [], {}, {}, []
    frequencies = np.zeros(0)
    for step, name in enumerate(names):
        context.progress(step / len(names), name)
        image, _ = two_f.point_image(name, two_f.DIAMETER, 10 * um)
        pictures.append((np.sqrt(image[near, near]), name))
        profiles[name] = two_f.clipped(two_f.profile(image)[near], 1e-7)
        frequencies, spectra[name] = mtf(image, two_f.GRID.pitch[1])
        if name.startswith("band limited"):
            rows.append(_cutoff_row(name, frequencies, spectra[name]))
            rows.append(_noise_row(name, frequencies, spectra[name]))
    profiles["Airy"] = two_f.clipped(two_f.airy(x[near]), 1e-7)
    spectra["theory"] = _theory(frequencies)
    shown = frequencies <= 4 * CUTOFF
    figures = (
        (images(pictures, columns=3), "Image of a pinhole of 10 µm (square root of the intensity)"),
        (
            curves(x[near] / um, profiles, xlabel="x [µm]", ylabel="intensity", log=True),
            "Profiles through the middle, and the Airy pattern",
        ),
        (
            curves(
                frequencies[shown] * mm,
                {name: two_f.clipped(values[shown], 1e-8) for name, values in spectra.items()},
                xlabel="frequency [1/mm]",
                ylabel="transfer function",
                log=True,
                marks={"1/(λF#)": CUTOFF * mm},
            ),
            "Spectra: slices of the 2-D transfer function",
        ),
    )
    rows.append(
        ResultRow("cut-off 1/(λ F#)", CUTOFF, "1/m", expected=24997.0, tolerance=1.0, kind="closed form")
    )
    return ExperimentOutcome(tuple(rows), figures, WHY)


def _cutoff_row(name: str, frequencies: np.ndarray, values: np.ndarray) -> ResultRow:
    """Frequency at which the curve falls to 1 %; half a frequency sample of 100 /m is allowed."""
    return ResultRow(
        f"frequency of 1 % contrast, {name}",
        cutoff(frequencies, values, LEVEL),
        "1/m",
        expected=LEVEL_AT * CUTOFF,
        tolerance=60.0,
        note="round pupil: 0.9587 of the cut-off",
    )


def _noise_row(name: str, frequencies: np.ndarray, values: np.ndarray) -> ResultRow:
    """Light beyond the cut-off: aliasing alone would be 1e-3."""
    beyond = float(np.max(values[frequencies > 1.02 * CUTOFF]))
    return ResultRow(f"largest value beyond the cut-off, {name}", beyond, expected=0.0, tolerance=1e-3)


def _theory(frequencies: np.ndarray) -> np.ndarray:
    """Transfer function of a round pupil, (2/π)(acos s - s sqrt(1 - s²)); Goodman, equation 6-32."""
    s = np.minimum(frequencies / CUTOFF, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
