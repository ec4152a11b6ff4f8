"""Young's slits before a lamp of finite width: fringes, where light is coherent enough."""

import numpy as np

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.design.illumination import coherence_area
from lumigraph.plots import curves
from lumigraph.propagation import Propagate
from lumigraph.scene import ExtendedSource
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, nm, um

WAVELENGTH, LAMP, SCREEN = 633 * nm, 200 * mm, 100 * mm
APART, SLIT = 200 * um, 20 * um
"""Distance R of the slits from the lamp, and of the screen from them; distance and width of the slits."""

RATIOS = (0.1, 0.5, 1.0, 1.5)
"""Width of the lamp times its angle to the slits, over λ: 1 is equation 3.5's limit."""

GRID, LINE = Grid((1, 512), (SLIT, 2 * um)), Grid((1, 512), (20 * mm, 2 * um))
_PAD = 3.0


@experiment(
    "figure-3.8",
    "Young's slits",
    question="How wide may a lamp be for two slits to make fringes?",
    thesis="Figure 3.8, equations 3.5 and 3.6",
    shows="A drawing: a square lamp lights two pinholes, whose light makes fringes on a screen if the lamp "
    "is narrow enough.",
)
def run(context: Context) -> ExperimentOutcome:
    """Coherent modes of a lamp through two slits to a screen; the fringes' contrast, by their maxima."""
    rows, drawn = [], {}
    x = np.zeros(0)
    for step, ratio in enumerate(RATIOS):
        context.progress(step / len(RATIOS), f"lamp of {ratio:g} λ/Δθ")
        width = ratio * WAVELENGTH * LAMP / APART
        x, light = fringes(width)
        drawn[f"Δx Δθ = {ratio:g} λ"] = (x / mm, light / light.max())
        rows.append(
            ResultRow(
                f"contrast of the fringes, Δx Δθ = {ratio:g} λ", visibility(x, light), "",
                "fringes" if ratio < 1 else "none", abs(float(np.sinc(ratio))), 0.006,
                "|sin(πs)/(πs)|: van Cittert and Zernike, for an even lamp",
            )
        )  # fmt: skip
    side = WAVELENGTH * LAMP / APART
    area = coherence_area(WAVELENGTH, side, LAMP)
    rows.append(
        ResultRow("coherence area of the lamp at the limit", area / mm**2, "mm²", None,
            (APART / mm) ** 2, 1e-9, "R²λ²/S; 3.6 prints R²λ/S, a length", "closed form")
    )  # fmt: skip
    figure = curves([], drawn, xlabel="x on the screen [mm]", ylabel="intensity")
    return ExperimentOutcome(
        tuple(rows),
        ((figure, "The screen behind two slits, for lamps of four widths (3.8)"),),
        why="Fringes do not end at the limit: they return, reversed and weaker, for wider lamps. 2Δθ is the "
        "angle between the slits as seen from the lamp in the figure, Δθ in 3.5 the same angle.",
    )


def fringes(width: float) -> tuple[np.ndarray, np.ndarray]:
    """Places x [m] on the screen and the intensity of all modes of a lamp so wide [m], a line along y."""
    lamp = ExtendedSource.rectangle((1e-9, width / 2 / LAMP), LAMP)
    modes = lamp.modes(GRID, WAVELENGTH, accuracy=1e-3)
    open_ = (np.abs(np.abs(GRID.x) - APART / 2) <= SLIT / 2).astype(float)
    # A slit is a line: along y the wave stays as it is, in a window so tall that no band of it is narrow.
    screen = Propagate(SCREEN, "band_limited", _PAD, grid=Grid((1, 1536), LINE.pitch))
    light = modes.through(lambda field: screen(Field(field.data * open_, LINE, WAVELENGTH))).intensity
    return screen.grid.x if screen.grid else GRID.x, np.asarray(light)[0]


def visibility(x: np.ndarray, light: np.ndarray) -> float:
    """Contrast of the fringes of period λz/d in the middle of the screen: twice their Fourier component."""
    period = WAVELENGTH * SCREEN / APART
    near = np.abs(x) <= 1.5 * period
    window = np.cos(np.pi * x[near] / (3 * period)) ** 2
    envelope = np.sinc(SLIT * x[near] / (WAVELENGTH * SCREEN)) ** 2
    parts = [np.ones(near.sum()), np.cos(2 * np.pi * x[near] / period), np.sin(2 * np.pi * x[near] / period)]
    matrix = np.stack([part * envelope for part in parts], 1) * window[:, None]
    even, cosine, sine = np.linalg.lstsq(matrix, light[near] * window, rcond=None)[0]
    return float(np.hypot(cosine, sine) / even)
