"""Step of the multi-step Fresnel method, and what the method is equal to."""

import warnings

import numpy as np

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingWarning
from lumigraph.plots import curves
from lumigraph.propagation import propagate
from lumigraph.propagation.fresnel import one_step_grid
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, nm, um

WAVELENGTH = 633 * nm
WINDOW = 10 * mm
STEPS = 4

WHY = (
    "Several Fresnel steps of dz = W²/(Nλ) equal the unpadded paraxial angular spectrum to rounding: what "
    "the thesis calls noise of the multi-step method is light that wraps round, as in that one."
)


@experiment(
    "2.34",
    "Step of the multi-step Fresnel method",
    question="Over which distance does one Fresnel step keep the pitch, and what do several steps give?",
    thesis="Section 2.3.1, equation 2.34",
    shows="A drawing: the distance is divided into steps dz, after each of which samples lie as far apart "
    "as before.",
)
def run(context: Context) -> ExperimentOutcome:
    """The step from the pitch of one Fresnel step; several steps against a spectrum computed here."""
    samples = 2000
    grid = Grid.square(samples, WINDOW / samples)
    found = _step(grid)
    pitch = one_step_grid(grid, found, WAVELENGTH).pitch[1]
    small = grid if not context.quick else Grid.square(512, WINDOW / 512)
    error, profiles = _difference(small)
    near = np.abs(small.x) < 1.2 * mm
    figure = curves(
        small.x[near] / mm,
        {name: profile[near] for name, profile in profiles.items()},
        xlabel="x [mm]",
        ylabel="intensity",
    )
    rows = (
        ResultRow(
            "step dz, N = 2000, W = 1 cm",
            found / mm,
            "mm",
            expected=78.989,
            tolerance=78.989e-4,
            kind="closed form",
        ),
        ResultRow("pitch after the step", pitch / um, "µm", expected=5.0, tolerance=1e-9, kind="closed form"),
        ResultRow(
            f"largest difference of {STEPS} steps from the paraxial angular spectrum",
            error,
            thesis="noisy",
            expected=0.0,
            tolerance=1e-11,
            note="rounding; relative to the largest amplitude",
        ),
    )
    return ExperimentOutcome(rows, ((figure, f"A pupil of 1 mm after {STEPS} steps, by both ways"),), WHY)


def _step(grid: Grid) -> float:
    """Distance at which the output pitch λz/(Np), proportional to z, is the input's."""
    return grid.pitch[1] / one_step_grid(grid, 1.0, WAVELENGTH).pitch[1]


def _difference(grid: Grid) -> tuple[float, dict[str, np.ndarray]]:
    distance = STEPS * _step(grid)
    data = (np.hypot(grid.y[:, None], grid.x) <= 0.5 * mm).astype(np.complex128)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # wrapped light is what is looked at
        wave = propagate(Field(data, grid, WAVELENGTH), distance, "multi_step_fresnel", 0)
    squares = np.square(grid.fy)[:, None] + np.square(grid.fx)
    carrier = np.exp(2j * np.pi * (distance / WAVELENGTH % 1.0))
    transfer = carrier * np.exp(-1j * np.pi * (WAVELENGTH * distance * squares % 2.0))
    right = np.fft.ifft2(np.fft.fft2(data) * transfer)
    middle = grid.shape[0] // 2
    profiles = {"multi-step": np.abs(wave.data[middle]) ** 2, "spectrum": np.abs(right[middle]) ** 2}
    return float(np.abs(wave.data - right).max() / np.abs(right).max()), profiles
