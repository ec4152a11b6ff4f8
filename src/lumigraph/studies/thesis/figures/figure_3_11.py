"""Random phase masks and the size of their areas of one phase."""

import numpy as np

from lumigraph.core.arrays import fft2, ifft2
from lumigraph.core.grid import Grid
from lumigraph.elements.masks import random_phase_mask, white_phase
from lumigraph.plots import curves, images
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

INDICES = (10, 50, 100, 200)
SAMPLES, WINDOW = 1765, 10 * mm
QUICK_SAMPLES = 882
"""Half of the window at one pitch, with half as many sources: areas of the same size."""
LAGS = 120
AREA = 0.631
"""Width at half height of the phase's degree of coherence, over a disc's diameter, where light has spread.

The wave's degree γ is a disc's correlation with itself (van Cittert and Zernike; 0.808 of the diameter wide).
The phase alone of a circular Gaussian wave has (π/4) γ F(1/2, 1/2; 2; γ²), which is 1/2 at γ = 0.604.
"""
WHY = (
    "A mask's areas of one phase are about as large as its sources, N/C samples, although light has spread "
    "over d_c: it stays coherent over them, and a mask with C < N is never incoherent."
)


@experiment(
    "figure-3.11",
    "Random phase masks",
    question="How large are the areas of one phase in a mask of C × C sources?",
    thesis="Figures 3.9 to 3.11, equation 3.7",
    shows="Masks of random phase for coherence indices of 10, 50, 100 and 200: areas of one phase shrink as "
    "the index rises.",
)
def run(context: Context) -> ExperimentOutcome:
    """Masks for four coherence indices, and the width of their degree of coherence."""
    grid = Grid.square(QUICK_SAMPLES if context.quick else SAMPLES, WINDOW / SAMPLES)
    rows, pictures, drawn, rng = [], [], {}, np.random.default_rng(311)
    lags = np.arange(LAGS)
    for step, index in enumerate(INDICES):
        context.progress(step / len(INDICES), f"C = {index}")
        sources = round(index * grid.shape[0] / SAMPLES)
        mask = random_phase_mask(grid, two_f.WAVELENGTH, sources, rng)
        pictures.append((np.angle(mask), f"C = {index}"))
        drawn[f"C = {index}"] = coherence = degree(mask)[:LAGS]
        rows.append(_area_row(index, width(coherence) * index / SAMPLES, sources))
        rows.append(ResultRow(f"width of an area, C = {index}", width(coherence), "samples"))
    drawn["white phase"] = white = degree(white_phase(grid, rng))[:LAGS]
    rows.append(
        ResultRow("coherence of a white phase one sample away", white[1], expected=0.0, tolerance=0.01,
            note="1/N for random numbers")
    )  # fmt: skip
    figures = (
        (images(pictures, columns=2, cmap="twilight"), "Phase of the masks"),
        (
            curves(lags, drawn, xlabel="distance [samples]", ylabel="degree of coherence"),
            "Correlation of a mask with itself",
        ),
    )
    return ExperimentOutcome(tuple(rows), figures, WHY)


def _area_row(index: int, areas: float, sources: int) -> ResultRow:
    """Checked where light has spread over d_c: the discs' Fresnel number (W/C)²/(λ d_c) = N/C² is below 1."""
    name = f"width of an area times C/N, C = {index}"
    if index**2 < SAMPLES:
        return ResultRow(name, areas, note="light has not spread: discs, and fringes where they meet")
    note = "0.631 N/C in closed form; for the wave, not its phase, it would be 0.808"
    return ResultRow(name, areas, expected=AREA, tolerance=0.05 if sources >= 50 else 0.12, note=note)


def degree(mask: np.ndarray) -> np.ndarray:
    """Modulus of the correlation of a mask with itself along x, 1 at distance 0."""
    spectrum = fft2(mask)
    correlation = ifft2(np.square(np.abs(spectrum)).astype(np.complex64))
    return np.abs(correlation[0]) / np.abs(correlation[0, 0])


def width(coherence: np.ndarray) -> float:
    """Distance over which the degree of coherence falls to a half, on both sides [samples]."""
    below = int(np.argmax(coherence < 0.5))
    before, after = coherence[below - 1], coherence[below]
    return 2 * (below - 1 + (before - 0.5) / (before - after))
