"""Phase of the angular spectrum's transfer function, and where its sampling aliases."""

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.plots import curves
from lumigraph.propagation import sampling
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, nm, um

WAVELENGTH = 633 * nm
GRID = Grid.square(500, 1.6 * um)
"""Grid of 0.8 mm: aliasing begins at N p²/λ = 2.02 mm, as in the thesis, which does not give its grid."""
DISTANCES = (1 * mm, 2 * mm, 10 * mm, 20 * mm)

WHY = (
    "The phase itself is right in the thesis (2.53); the exponents of 2.42 to 2.55 miss a sign, z and a "
    "square, and the denominators of 2.59 and 2.62 are misprinted. 2.60 and 2.63 are right."
)


@experiment(
    "figure-2.4",
    "Phase of the transfer function and its aliasing",
    question="From which frequency on is the transfer function of free space sampled too coarsely?",
    thesis="Figure 2.4, equations 2.53 and 2.60",
    shows="The phase of the transfer function at 1, 2, 10 and 20 mm: it oscillates faster with distance, "
    "and is aliased from 2 mm on.",
)
def run(context: Context) -> ExperimentOutcome:
    """The first step of the sampled phase above π, counted, against the closed form."""
    rows, figures = [], []
    f = np.sort(GRID.fx)[GRID.shape[1] // 2 :]
    step = f[1]
    for distance in DISTANCES:
        limit = min(sampling.band_limits(GRID, distance, WAVELENGTH)[1], f[-1])
        figures.append((_figure(f, distance, limit), f"Wrapped phase at z = {distance / mm:g} mm"))
        if limit == f[-1]:
            rows.append(_unaliased(f, distance))
            continue
        rows.append(
            ResultRow(
                f"highest frequency without aliasing, z = {distance / mm:g} mm",
                _highest(f, distance) * um,
                "1/um",
                expected=limit * um,
                tolerance=step * um,
                note="within one frequency sample",
                kind="closed form",
            )
        )
    sine = WAVELENGTH / (2 * GRID.pitch[1])
    longest = sampling.longest_distance(GRID, WAVELENGTH) * np.sqrt(1 - sine**2)
    rows.append(
        ResultRow(
            "longest distance of this grid without aliasing",
            _longest(f) / mm,
            "mm",
            thesis="evident from 2 mm",
            expected=longest / mm,
            tolerance=0.01 * longest / mm,
            note="N p²/λ · sqrt(1 - (λ/2p)²); the last sample is 0.6 % below 1/(2p)",
            kind="closed form",
        )
    )
    return ExperimentOutcome(tuple(rows), tuple(figures), WHY)


def _unaliased(f: np.ndarray, distance: float) -> ResultRow:
    """Largest step of the phase over π: below 1, no frequency aliases."""
    sine = WAVELENGTH * (f[-1] + f[-2]) / 2
    step = 2 * distance * WAVELENGTH * (f[1] - f[0]) * (f[-1] + f[-2]) / 2 / np.sqrt(1 - sine**2)
    return ResultRow(
        f"largest step of the phase over π, z = {distance / mm:g} mm", _steps(f, distance).max() / np.pi, "",
        expected=step, tolerance=1e-4, note="2 λ z f Δf / sqrt(1 - (λf)²); below 1, unaliased",
        kind="closed form",
    )  # fmt: skip


def _steps(f: np.ndarray, distance: float) -> np.ndarray:
    """Phase steps of H between frequencies [rad], unwrapped on 64 times as many."""
    fine = np.linspace(f[0], f[-1], 64 * (len(f) - 1) + 1)
    phase = np.unwrap(np.angle(transfer_function(np.zeros(1), fine, distance, WAVELENGTH)[0]))
    return np.abs(np.diff(phase[::64]))


def _highest(f: np.ndarray, distance: float) -> float:
    """Last frequency before the phase turns by more than π to the next sample."""
    return float(f[np.flatnonzero(_steps(f, distance) > np.pi)[0]])


def _longest(f: np.ndarray) -> float:
    """Distance at which the last step of the phase is π: the phase grows in proportion to z."""
    return float(np.pi / _steps(f, 1 * mm).max()) * mm


def _figure(f: np.ndarray, distance: float, limit: float):
    fine = np.linspace(0, f[-1], 20 * len(f))
    sampled = np.angle(transfer_function(np.zeros(1), f, distance, WAVELENGTH)[0])
    true = np.angle(transfer_function(np.zeros(1), fine, distance, WAVELENGTH)[0])
    shown, most = slice(0, len(f)), min(1.0, 60 * f[1] / f[-1] * 20 * mm / distance)
    curve = {
        "phase": (fine[fine <= most * f[-1]] * um, true[fine <= most * f[-1]]),
        "its samples": (f[shown][f <= most * f[-1]] * um, sampled[f <= most * f[-1]]),
    }
    marks = {"aliasing from here": limit * um} if limit < f[-1] and limit <= most * f[-1] else {}
    return curves(
        f, curve, xlabel="frequency [1/um]", ylabel="phase [rad]", title=f"z = {distance / mm:g} mm",
        marks=marks,
    )  # fmt: skip
