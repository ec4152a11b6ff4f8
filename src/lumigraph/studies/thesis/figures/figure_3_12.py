"""Spectrum and coherence time of the LED."""

import numpy as np

from lumigraph.plots import curves
from lumigraph.studies.thesis.registry import (
    Context,
    ExperimentOutcome,
    ResultRow,
    closed_forms,
    experiment,
)
from lumigraph.units import nm

WAVELENGTH, BANDWIDTH = 630 * nm, 20 * nm
LIGHT = 299_792_458.0
WHY = (
    "A bandwidth Δλ is a bandwidth in frequency of Δν = cΔλ/λ², so that τ = 1/Δν = λ²/(cΔλ); the printed "
    "Δλ/c is a time of another kind, a thousand times too short."
)


@experiment(
    "figure-3.12",
    "Coherence time of the LED",
    question="How long is the coherence time of an LED at 630 nm of 20 nm bandwidth?",
    thesis="Figure 3.12, equation 3.8",
    shows="The spectrum of the LED, a peak of 20 nm at 630 nm.",
)
def run(context: Context) -> ExperimentOutcome:
    """τ = ∫|γ(t)|² dt, from the transform of an even spectrum and of a Gaussian one."""
    wavelengths = np.linspace(560 * nm, 700 * nm, 1401)
    gaussian = np.exp(-4 * np.log(2) * np.square((wavelengths - WAVELENGTH) / BANDWIDTH))
    centre, width = LIGHT / WAVELENGTH, LIGHT * BANDWIDTH / WAVELENGTH**2
    frequency = centre + np.linspace(-20, 20, 8001) * width
    even = (np.abs(frequency - centre) <= width / 2).astype(float)
    smooth = np.exp(-4 * np.log(2) * np.square((frequency - centre) / width))
    femto = 1e-15
    rows = closed_forms(
        (
            ResultRow(
                "coherence time, even spectrum",
                coherence_time(frequency, even) / femto,
                "fs",
                thesis=0.066,
                expected=66.17,
                tolerance=0.5,
                note="λ²/(cΔλ) = 6.6e-14 s",
            ),
            ResultRow(
                "coherence time, Gaussian spectrum",
                coherence_time(frequency, smooth) / femto,
                "fs",
                expected=0.6643 * 66.17,
                tolerance=0.5,
                note="sqrt(2 ln 2/π)/Δν",
            ),
            ResultRow(
                "coherence length",
                coherence_time(frequency, even) * LIGHT * 1e6,
                "µm",
                expected=19.85,
                tolerance=0.2,
                note="λ²/Δλ",
            ),
        )
    )
    time = np.linspace(0, 200, 401) * femto
    figures = (
        (
            curves(wavelengths / nm, {"model": gaussian}, xlabel="wavelength [nm]", ylabel="emission"),
            "A Gaussian spectrum of 20 nm, in place of the data sheet's",
        ),
        (
            curves(
                time / femto,
                {
                    "even spectrum": degree(frequency, even, time),
                    "Gaussian spectrum": degree(frequency, smooth, time),
                },
                xlabel="delay [fs]",
                ylabel="degree of coherence",
                marks={"λ²/(cΔλ)": WAVELENGTH**2 / (LIGHT * BANDWIDTH) / femto},
            ),
            "Degree of temporal coherence",
        ),
    )
    return ExperimentOutcome(rows, figures, WHY)


def degree(frequency: np.ndarray, spectrum: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Modulus of the degree of coherence γ(t), the normalised transform of the power spectrum."""
    turned = np.exp(-2j * np.pi * np.outer(time, frequency - frequency.mean()))
    return np.abs(turned @ spectrum) / spectrum.sum()


def coherence_time(frequency: np.ndarray, spectrum: np.ndarray) -> float:
    """Integral of |γ|² over all delays [s]; by Parseval ∫S² dν / (∫S dν)²; Goodman, *Statistical Optics*."""
    step = frequency[1] - frequency[0]
    return float(np.square(spectrum).sum() / (spectrum.sum() ** 2 * step))
