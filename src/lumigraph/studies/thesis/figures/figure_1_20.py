"""Figures 1.20 to 1.23: the raw image of a point in a plenoptic camera 2.0, and its points of view."""

import numpy as np

from lumigraph import plots
from lumigraph.core.raw import RawImage
from lumigraph.design import plenoptic2
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

MAGNIFICATIONS = (1.0, 0.5, 0.3, 0.25, 0.1)
_REACH = 7  # lenslets about the middle: 15 hold the ten that see a point at m = 0.1
# How far the spread of light over the lenslets may be from 1/m: the edge of the main lens' shadow is blurred
# by sqrt(λ a), 0.55 lenslets at m = 1 and 1.3 at m = 0.1.
_TOLERANCE = {0.5: 0.3, 0.3: 0.1, 0.25: 0.1, 0.1: 0.3}


@experiment(
    "figure-1.20",
    "Points of view of a plenoptic camera 2.0",
    question="How many lenslets see one point, and how far do they show it apart?",
    thesis="Figures 1.20 to 1.23",
    shows="A point's raw image: lit parts of several micro-images, more of them and more displaced the "
    "lower the magnification.",
    camera="thesis-plenoptic-2-m030",
)
def run(context: Context) -> ExperimentOutcome:
    """Exact raw images of a point for five magnifications of the lenslets."""
    rows, pictures, zoomed = [], [], (np.zeros((1, 1)), "")
    for number, m in enumerate(MAGNIFICATIONS):
        context.progress(number / len(MAGNIFICATIONS), f"m = {m:g}")
        one = camera(m, 5 * um if context.quick else 5 / 3 * um)
        raw = _point(one, _symmetric(one))
        rows += _rows(context, one, raw)
        pictures.append((_middle(one, raw), f"m = {m:g}"))
        if m == 0.3:
            zoomed = (_middle(one, raw, 2.5), "m = 0.3, 5 × 5 lenslets")
    return ExperimentOutcome(
        tuple(rows),
        ((plots.images([pictures[2], zoomed], columns=2, cmap="magma"),
          "1.20, 1.21: a point for m = 0.3, amplitude, with the borders of the micro-images"),
         (plots.images([pictures[k] for k in (0, 1, 3, 4)], columns=2, cmap="magma"),
          "1.23: the same for m = 1, 0.5, 0.25 and 0.1")),
        why="One lenslet sees p/a of the directions D/z2 = p/b, so that 1/m lenslets per axis see a point: a "
        "whole number where the point stands symmetrically. Diffraction blurs the edge of the lit disc.",
    )  # fmt: skip


def camera(m: float, pixel_pitch: float, lenslets: int = 15) -> FocusedPlenopticCamera:
    """The camera of the figures at another lenslet magnification; the main lens is matched, D = z2 p / b."""
    known = FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m030")
    return known.replace(
        lenslets={"magnification": m, "count": (lenslets, lenslets)}, sensor={"pixel_pitch": pixel_pitch}
    )


def _point(camera: FocusedPlenopticCamera, place: float) -> RawImage:
    """Raw image of a point whose image stands at (place, place) on the main-lens image [m]."""
    return simulate(camera, targets.points([(place / camera.magnification, place / camera.magnification)]))


def _symmetric(camera: FocusedPlenopticCamera) -> float:
    """Place before the middle of a lenslet for an odd number of views, before a corner for an even one."""
    odd = round(1 / camera.lenslet_magnification) % 2
    return 0.0 if odd else camera.lenslets.pitch / 2 * camera.image_distance / camera.separation


def _rows(context: Context, camera: FocusedPlenopticCamera, raw: RawImage) -> list[ResultRow]:
    m = camera.lenslet_magnification
    share = table_4_1.energies(raw, camera.calibration, _REACH)
    row = share[_REACH]
    rows = [
        ResultRow(
            f"lenslets of a row that see the point, m = {m:g}",
            float((row > 0.3 * row.max()).sum()),
            "",
            round(1 / m),
            round(1 / m),
            0.0,
            note="brighter than 0.3 of the brightest",
        )
    ]
    if m in _TOLERANCE:
        spread = context.cached(f"spread-{m:g}", lambda: np.array(_spread(camera)))
        rows.append(
            ResultRow(
                f"lenslets per axis from the spread of light, m = {m:g}",
                float(spread),
                "",
                1 / m,
                plenoptic2.views_per_axis(m),
                _TOLERANCE[m],
                note="mean of places",
            )
        )
        rows.append(
            ResultRow(
                f"point's shift from lenslet to lenslet, m = {m:g}",
                _shift(camera, raw),
                "px",
                None,
                camera.patch,
                0.05 * camera.patch,
                note="the patch m p z2/L",
            )
        )
    return rows


def _spread(camera: FocusedPlenopticCamera, places: int = 4) -> float:
    """Diameter of the disc of lenslets that image a point: 4 standard deviations of an even disc.

    Sorting light by lenslets adds a variance of 1/12, in the mean of all places of the point.
    """
    away, variance = np.arange(-_REACH, _REACH + 1), []
    for k in range(places):
        raw = _point(camera, (k + 0.5) / places * camera.lenslets.pitch)
        share = table_4_1.energies(raw, camera.calibration, _REACH)
        across = np.where(share > 0.02 * share.max(), share, 0).sum(0)
        across /= across.sum()
        variance.append(across @ away**2 - (across @ away) ** 2)
    return float(4 * np.sqrt(np.mean(variance) - 1 / 12))


def _shift(camera: FocusedPlenopticCamera, raw: RawImage) -> float:
    """Distance of a point from its micro-image's centre in one lenslet, less that in the one before [px]."""
    pitch, origin = camera.calibration.lattice.pitch, camera.calibration.lattice.origin
    first = 0 if _symmetric(camera) == 0 else 1
    places = []
    for k in (first - 1, first):
        center = origin[1] + k * pitch
        x = np.arange(raw.shape[1]) - center
        row = np.where(np.abs(x) < pitch / 2, raw.data.sum(0), 0)
        top = np.maximum(row - row.max() / 2, 0)
        places.append(float(top @ x / top.sum()))
    return abs(places[1] - places[0])


def _middle(camera: FocusedPlenopticCamera, raw: RawImage, reach: float = 6.5) -> np.ndarray:
    """Amplitude of the lenslets about the middle, with the borders of their micro-images."""
    pitch = camera.calibration.lattice.pitch
    middle, half = raw.shape[0] // 2, int(reach * pitch)
    part = np.sqrt(raw.data[middle - half : middle + half + 1, middle - half : middle + half + 1])
    part = part / part.max()
    width = max(0.5, half / 220)
    border = np.abs(np.abs(np.arange(-half, half + 1)) % pitch - pitch / 2) <= width
    return np.maximum(part, 0.25 * (border[:, None] | border))
