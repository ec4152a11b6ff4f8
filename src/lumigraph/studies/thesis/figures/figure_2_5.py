"""Band limits of the transfer function for three distances."""

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.plots import curves, images
from lumigraph.propagation import sampling
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.studies.thesis.methods import corrected_cutoff
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, nm, um

WAVELENGTH = 633 * nm
GRID = Grid.square(512, 5 * um)
DISTANCES = (20 * mm, 40 * mm, 80 * mm)
"""On this grid the transfer function aliases from 20.2 mm on."""

WHY = (
    "2.65 must read rect(f/(2 f_max)). Without padding the cut-off W/(λz) of 2.68 is always twice f_max, so "
    "that the corrected method keeps twice the band that is free of aliases, whatever the distance; the cure "
    "is a padded window. The circle must multiply H itself, not its phase."
)


@experiment(
    "figure-2.5",
    "Band limits of the transfer function",
    question="Which band of the transfer function is free of aliases, and which does each method keep?",
    thesis="Figure 2.5, equations 2.60 to 2.69",
    shows="The band of the transfer function that is kept, for three distances: it narrows with distance.",
)
def run(context: Context) -> ExperimentOutcome:
    """f_max by 2.60 against the frequency at which the local frequency of the phase is half the window."""
    rows, pictures, lines = [], [], {}
    for distance in DISTANCES:
        limit = sampling.band_limits(GRID, distance, WAVELENGTH)[1]
        corrected = corrected_cutoff(GRID, distance, WAVELENGTH)[1]
        name = f"z = {distance / mm:g} mm"
        rows += [
            ResultRow(
                f"band limit, {name}",
                _found(distance) * um,
                "1/um",
                expected=limit * um,
                tolerance=1e-4 * limit * um,
                kind="closed form",
            ),
            ResultRow(
                f"cut-off of the corrected method over the band limit, {name}",
                corrected / limit,
                thesis="1 or less",
                expected=2.0,
                tolerance=0.01,
                note="2 sqrt(1 + (W/2z)²)",
                kind="closed form",
            ),
        ]
        pictures.append((_limited(distance, limit), name))
        lines[name] = limit * um
    distances = np.geomspace(5 * mm, 500 * mm, 60)
    bands = [sampling.band_limits(GRID, z, WAVELENGTH)[1] * um for z in distances]
    cutoffs = [corrected_cutoff(GRID, z, WAVELENGTH)[1] * um for z in distances]
    padded = Grid.square(2 * GRID.shape[0], GRID.pitch[0])
    wide = [sampling.band_limits(padded, z, WAVELENGTH)[1] * um for z in distances]
    drawn = {"band limited": bands, "corrected": cutoffs, "band limited, window doubled": wide}
    nyquist = 0.5 / GRID.pitch[0] * um
    figure = curves(
        distances / mm,
        {key: np.minimum(values, 3 * nyquist) for key, values in drawn.items()}
        | {"highest frequency of the samples": np.full(len(distances), nyquist)},
        xlabel="distance [mm]",
        ylabel="highest frequency kept [1/um]",
        log=True,
    )
    figures = (
        (images(pictures, columns=3), "Phase of the band-limited transfer function over (fy, fx)"),
        (figure, "Highest frequency kept against the distance"),
    )
    return ExperimentOutcome(tuple(rows), figures, WHY)


def _found(distance: float) -> float:
    """Frequency at which the phase turns by π over one frequency sample: the slope of the phase is W/2."""
    f = np.linspace(0, 1 / WAVELENGTH, 2_000_001)[:-1]
    s = np.square(WAVELENGTH * f)
    phase = -distance / WAVELENGTH * s / (1 + np.sqrt(1 - s))  # in turns
    slope = np.abs(np.gradient(phase, f))
    return float(np.interp(GRID.size[1] / 2, slope[: len(f) // 2], f[: len(f) // 2]))


def _limited(distance: float, limit: float) -> np.ndarray:
    """Phase inside the circle of the band limit, 0 outside [rad]."""
    fy, fx = np.sort(GRID.fy), np.sort(GRID.fx)
    phase = np.angle(transfer_function(fy, fx, distance, WAVELENGTH))
    return np.where(np.hypot(fy[:, None], fx) <= limit, phase, 0.0)
