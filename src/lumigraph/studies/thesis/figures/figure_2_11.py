"""Wrapping of a lens' phase, and how much light reaches the focus at the sampling limits."""

import numpy as np

from lumigraph.elements.lens import lens_phase
from lumigraph.plots import curves
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, nm, um

WAVELENGTH, FOCAL_LENGTH, PITCH = 633 * nm, 158 * mm, 20 * um
LIMIT = WAVELENGTH * FOCAL_LENGTH / (2 * PITCH)
"""Radius at which the phase turns by π from sample to sample, 2.5 mm [m]."""
ZEROS = 40
"""Half width of the focus, in zeros of its sinc²: holds 0.995 of a full pupil's light."""

WHY = (
    "The phase of a lens turns by more than π from sample to sample beyond r = λf/(2 dx); the printed 2.90 "
    "to 2.95 miss the 2. Light of the outer half then goes to other orders."
)


@experiment(
    "figure-2.11",
    "Phase wrapping of a lens",
    question="How much of the light reaches the focus of a lens at the limit of its sampling?",
    thesis="Figure 2.11, equations 2.90 to 2.95",
    shows="The quadratic phase of a lens, and the same phase wrapped at 2π, ever more steeply towards the "
    "rim.",
)
def run(context: Context) -> ExperimentOutcome:
    """A one-dimensional lens, its phase sampled, carried to its focus by the angular spectrum."""
    ratios = np.linspace(0.25, 2.0, 8 if context.quick else 29)
    powers = [power_in_focus(ratio * LIMIT) for ratio in ratios]
    x = np.linspace(0, 3 * mm, 3000)
    parabola = -np.pi * x**2 / (WAVELENGTH * FOCAL_LENGTH)
    wrapped = np.angle(lens_phase(x, FOCAL_LENGTH, WAVELENGTH))
    near = x < 1.2 * mm
    figures = (
        (
            curves(
                x[near] / mm,
                {"phase": parabola[near], "wrapped": wrapped[near]},
                xlabel="x [mm]",
                ylabel="phase [rad]",
            ),
            "Phase of a lens of f = 158 mm, and what a computer keeps of it",
        ),
        (
            curves(
                ratios,
                {"power in the focus": powers},
                xlabel="radius over λf/(2 dx)",
                ylabel="fraction of the power",
                marks={"right limit": 1.0, "printed limit": 2.0},
            ),
            "Power that reaches the focus against the radius of the lens",
        ),
    )
    rows = (
        ResultRow("power in the focus, r = λf/(2 dx)", power_in_focus(LIMIT),
            expected=1 - 1 / (np.pi**2 * ZEROS), tolerance=0.02,
            note="of sinc² within as many zeros; the phase at the rim is sampled twice a turn"),
        ResultRow(
            "power in the focus, r = λf/dx",
            power_in_focus(2 * LIMIT),
            thesis="no aliasing",
            expected=0.50,
            tolerance=0.02,
            note="half of the light goes to other orders",
        ),
        ResultRow("first wrap of the phase", _first_wrap(x, wrapped) / mm, "mm",
            expected=float(np.sqrt(WAVELENGTH * FOCAL_LENGTH)) / mm, tolerance=0.002,
            note="phase -π at sqrt(λf)", kind="closed form"),
    )  # fmt: skip
    return ExperimentOutcome(rows, figures, WHY)


def power_in_focus(radius: float) -> float:
    """Fraction of a plane wave's power behind a 1-D lens that is within `ZEROS` of the axis at its focus."""
    n = 8192
    x = (np.arange(n) - n // 2) * PITCH
    lens = np.where(np.abs(x) <= radius, lens_phase(x, FOCAL_LENGTH, WAVELENGTH), 0)
    transfer = transfer_function(np.zeros(1), np.fft.fftfreq(n, PITCH), FOCAL_LENGTH, WAVELENGTH)[0]
    focus = np.abs(np.fft.ifft(np.fft.fft(lens) * transfer)) ** 2
    half = max(ZEROS * WAVELENGTH * FOCAL_LENGTH / (2 * radius), PITCH)
    return float(focus[np.abs(x) <= half].sum() / (np.abs(lens) ** 2).sum())


def _first_wrap(x: np.ndarray, wrapped: np.ndarray) -> float:
    """Place where the wrapped phase first jumps from -π to π."""
    jump = int(np.flatnonzero(np.diff(wrapped) > np.pi)[0])
    return float((x[jump] + x[jump + 1]) / 2)
