"""Measured abilities of each propagation method."""

import time
import warnings

import numpy as np

from lumigraph.analysis import snr
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingWarning
from lumigraph.plots import curves
from lumigraph.propagation import propagate, sampling
from lumigraph.scene.sources import gaussian_beam
from lumigraph.studies.thesis.methods import corrected_cutoff
from lumigraph.studies.thesis.registry import (
    Context,
    ExperimentOutcome,
    ResultRow,
    closed_forms,
    experiment,
)
from lumigraph.units import mm, nm, um

WAVELENGTH, WAIST, DISTANCE = 633 * nm, 0.1 * mm, 500 * mm
GRID = Grid.square(1024, 5 * um)
"""A beam that grows from 0.1 to 1.01 mm in a window of 5.1 mm: exact in closed form, and no light wraps."""

METHODS = {
    "Fresnel integral": ("fresnel", 0.0),
    "multi-step": ("multi_step_fresnel", 0.0),
    "angular spectrum": ("angular_spectrum", 0.0),
    "band limited": ("band_limited_circular", 0.0),
    "corrected band limited": ("corrected_band_limited", 0.0),
    "band limited, padded": ("band_limited", 1.0),
    "zoom": ("zoom", 0.0),
}
THESIS = {
    "Fresnel integral": "noisy, scaling factor",
    "multi-step": "noisy, slow",
    "angular spectrum": "aliasing for long propagations",
    "band limited": "loss of information",
    "corrected band limited": "keeps information",
}
LEAST = 60.0
"""SNR [dB] of a smooth beam that stays inside the window: no method is noisy by itself."""

WHY = (
    "None of the methods is noisy by itself: a smooth beam that stays in the window comes out alike by all. "
    "They differ in where light that leaves the window goes, which the pupil of figure 3.2 shows."
)


@experiment(
    "table-2.1",
    "Propagation methods compared",
    question="What do the advantages and drawbacks of each method amount to, in numbers?",
    thesis="Table 2.1",
    shows="A list of each method's advantages and drawbacks in words: scaling, speed, aliases, information "
    "kept.",
)
def run(context: Context) -> ExperimentOutcome:
    """Noise of a smooth beam, scale, band, valid range and time of each method."""
    rows, errors, beam = [], {}, gaussian_beam(GRID, WAVELENGTH, WAIST, dtype=np.complex64)
    for step, name in enumerate(METHODS):
        context.progress(step / len(METHODS), name)
        image, seconds = _timed(beam, name)
        right = gaussian_beam(image.grid, WAVELENGTH, WAIST, DISTANCE).intensity
        found = image.intensity
        error = np.abs(_row(found) - _row(right)) / right.max()
        near = np.abs(image.grid.x) < 2.5 * mm
        errors[name] = image.grid.x[near] / mm, np.maximum(error[near], 1e-9)
        rows += [
            ResultRow(f"SNR of a Gaussian beam, {name}", snr(found, right), "dB", thesis=THESIS.get(name),
                expected=LEAST, tolerance=(0.0, np.inf), note="against the closed form"),
            ResultRow(f"time, {name}", seconds * 1e3, "ms"),
        ]  # fmt: skip
    figure = curves([], errors, xlabel="x [mm]", ylabel="|error| over the peak", log=True)
    return ExperimentOutcome(
        (*closed_forms(_facts()), *rows), ((figure, "Error of each method for a Gaussian beam"),), WHY
    )


def _facts() -> list[ResultRow]:
    """Closed forms of the table's words, for the grid of the text: N = 2000, W = 1 cm."""
    grid = Grid.square(2000, 5 * um)
    doubled = Grid.square(4000, 5 * um)
    pulled = sampling.fresnel_step(grid, WAVELENGTH)[0]
    limits = [sampling.band_limits(window, 1.0, WAVELENGTH)[0] for window in (grid, doubled)]
    corrected = corrected_cutoff(grid, 1.0, WAVELENGTH)[0]
    wave = Field(np.ones((2, 2), np.complex64), Grid.square(2, 5 * um), WAVELENGTH)
    scale = propagate(wave, 0.316, "fresnel").grid.pitch[0] / wave.grid.pitch[0] * 2 / 2000
    return [
        ResultRow("Fresnel integral: pitch at 316 mm over the input's", scale, expected=0.316 / pulled,
            tolerance=1e-6, note="scaling factor λz/(N p²)"),
        ResultRow("multi-step: length of a step", pulled / mm, "mm", expected=78.989, tolerance=0.008),
        ResultRow("angular spectrum: longest distance without aliasing",
            sampling.longest_distance(grid, WAVELENGTH) / mm, "mm", expected=78.989, tolerance=0.008,
            note="the same length: N p²/λ"),
        ResultRow("band limited: frequencies kept at 1 m", limits[0] / 1e5, expected=0.079, tolerance=0.001,
            note="of the samples' highest one, 1e5 /m"),
        ResultRow("corrected: frequencies kept at 1 m", corrected / 1e5, expected=0.158, tolerance=0.001,
            note="half of them aliased"),
        ResultRow("band limited, padded: frequencies kept at 1 m", limits[1] / 1e5, expected=0.158,
            tolerance=0.001, note="as many, none aliased"),
    ]  # fmt: skip


def _row(image: np.ndarray) -> np.ndarray:
    return image[image.shape[0] // 2]


def _timed(beam: Field, name: str) -> tuple[Field, float]:
    """The field and the time of a second propagation [s], when transfer functions are known."""
    method, pad = METHODS[name]
    grid = Grid.square(512, 10 * um) if method == "zoom" else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # what is warned of is looked at
        propagate(beam, DISTANCE, method, pad, grid=grid)
        start = time.perf_counter()
        image = propagate(beam, DISTANCE, method, pad, grid=grid)
    return image, time.perf_counter() - start
