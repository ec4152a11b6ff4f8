"""Figure 1.24 and equations 1.11 to 1.23: light fields through one lenslet, by matrices and by a wave."""

import numpy as np

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.design import ray_matrices
from lumigraph.elements import ThinLens
from lumigraph.plots import curves, images
from lumigraph.propagation import propagate
from lumigraph.studies.thesis.figures._lenslet import FOCAL, PITCH
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

_M, _WAVELENGTH = 0.5, 633e-9
_PLACES = (-60 * um, 0.0, 90 * um)


@experiment(
    "figure-1.24",
    "Light field through one lenslet",
    question="Where do rays of the main-lens image go behind a lenslet, and does a wave go there?",
    thesis="Figure 1.24, equations 1.11 to 1.23",
    shows="One lenslet turns rays at the main-lens image into rays at the sensor, which a matrix describes.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """The matrix of 1.20, its inverse in 1.19, and a wave from each place through a simulated lenslet."""
    a, b = FOCAL * (1 + 1 / _M), FOCAL * (1 + _M)
    matrix = ray_matrices.relay(a, b, FOCAL)
    rows = [
        ResultRow(
            "determinant of 1.20", float(np.linalg.det(matrix)), "", 1.0, 1.0, 1e-12, kind="closed form"
        ),
        ResultRow("first element, -b/a", float(matrix[0, 0]), "", -_M, -_M, 1e-12, kind="closed form"),
        ResultRow("last element, -a/b", float(matrix[1, 1]), "", -1 / _M, -1 / _M, 1e-12, kind="closed form"),
    ]
    profiles = {}
    for step, place in enumerate(_PLACES):
        context.progress(step / len(_PLACES), f"place {place / um:.0f} µm")
        x, light = _wave(place, a, b)
        rays = float((matrix @ [place, 0.0])[0])
        profiles[f"x = {place / um:.0f} µm"] = (x / um, light / light.max())
        rows.append(
            ResultRow(f"wave from x = {place / um:.0f} µm, its middle on the sensor", _middle(x, light) / um,
                "µm", None, rays / um, 0.2, "-b/a x; lobe 80 µm wide")
        )  # fmt: skip
    x, p = np.linspace(-75, 75, 301) * um, np.linspace(-0.02, 0.02, 401)
    before = _lenslet_opening(a)
    behind = ray_matrices.through(matrix, before)
    seen = ray_matrices.intensity(behind, np.zeros(1), np.linspace(-0.02, 0.02, 20001))[0]
    rows.append(
        ResultRow("directions that a pixel sums, over d/b", float(seen / (PITCH / b)), "", 1.0, 1.0, 2e-3,
            "1.23: I(x) = d/b L", "closed form")
    )  # fmt: skip
    pair = [
        (radiance(x, p[::-1, None]), name)
        for radiance, name in ((before, "before"), (behind, "on the sensor"))
    ]
    figures = (
        (
            images(pair, columns=2),
            "Phase space, p upwards over x: light that one lenslet takes, and where it arrives",
        ),
        (curves([], profiles, xlabel="x on the sensor [µm]", ylabel="intensity"), "The same places by waves"),
    )
    return ExperimentOutcome(
        tuple(rows), figures,
        why="1.22 and 1.23 have the sign of the direction wrong, see the errata; a lenslet turns places by "
        "180° and makes them m = b/a times as large.",
    )  # fmt: skip


def _lenslet_opening(a: float) -> ray_matrices.Radiance:
    """Even radiance of the rays that meet a lenslet on the axis, at a behind the main-lens image."""

    def radiance(x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return (np.abs(x + a * p) <= PITCH / 2).astype(float)

    return radiance


def _wave(place: float, a: float, b: float) -> tuple[np.ndarray, np.ndarray]:
    """Row of the sensor behind a lenslet that a point at (0, place) lights from a before it."""
    pupil = Grid.square(300, 1.02 * PITCH / 300)
    away = pupil.y[:, None] ** 2 + (pupil.x - place) ** 2
    wave = Field(np.exp(1j * np.pi * away / (_WAVELENGTH * a)), pupil, _WAVELENGTH)
    sensor = Grid((1, 401), (0.5 * um, 0.5 * um))
    return sensor.x, propagate(ThinLens(FOCAL, PITCH)(wave), b, "fresnel", grid=sensor).intensity[0]


def _middle(x: np.ndarray, light: np.ndarray) -> float:
    top = np.maximum(light - light.max() / 2, 0)
    return float(top @ x / top.sum())
