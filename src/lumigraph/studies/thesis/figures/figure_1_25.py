"""Figures 1.25 and 1.26: phase space of a plenoptic camera 2.0, and rendering across lenslets."""

import numpy as np

from lumigraph import plots
from lumigraph.core.raw import RawImage
from lumigraph.design import plenoptic2
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.figures.figure_1_20 import camera as point_camera
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

_M = 0.3
_PLACES = (-55 * um, 75 * um)  # of a red and a green point, on the main-lens image
_COLOURS = ((0.85, 0.2, 0.15), (0.15, 0.55, 0.2))
_REACH = 3
_SEEN = 1 / 3  # of the light of the brightest lenslet, or of its width


@experiment(
    "figure-1.25",
    "Phase space of a plenoptic camera 2.0",
    question="How do lenslets that relay the image divide places and directions among them?",
    thesis="Figures 1.25 and 1.26, equations 1.8 to 1.10 and 1.20 to 1.23",
    shows="Two points are columns in phase space, lenslets its slanted bands: three of them sample each "
    "point's directions.",
    camera="thesis-plenoptic-2-m030",
)
def run(context: Context) -> ExperimentOutcome:
    """Each lenslet as a band of phase space, and the pixels of two simulated points in it."""
    camera = point_camera(_M, (2.5 if context.quick else 5 / 3) * um)
    p, a, b = camera.lenslets.pitch, camera.relay_distance, camera.lenslet_distance
    rows = [
        ResultRow("directions of one lenslet, p/a, over all, p/b", (p / a) / (p / b), "", 0.3, _M, 1e-9,
            kind="closed form"),
        ResultRow("directions of each place, 1/m", plenoptic2.views_per_axis(_M), "", 3, 1 / _M, 1e-9,
            note="3 in the figure, 3.33 in the mean of all places", kind="closed form"),
        ResultRow("all directions over those the main lens sends, D/z2", (p / b) / (
            camera.pupil_diameter / camera.image_distance), "", 1.0, 1.0, 1e-9, kind="closed form"),
    ]  # fmt: skip
    samples = []
    for number, place in enumerate(_PLACES):
        context.progress(number / 2, f"point at {place / um:.0f} µm")
        raw = simulate(camera, targets.points([(0.0, place / camera.magnification)]))
        samples.append(_samples(camera, raw))
        rows += _rows(samples[-1], place, _covered(camera, place))
    pair = [(_bands(camera), "rays: lenslets as bands"), (_scattered(camera, samples), "simulated pixels")]
    return ExperimentOutcome(
        tuple(rows),
        ((plots.images(pair, columns=2),
          "1.25: directions θ (up) over places X on the main-lens image. Every lenslet is a band of slope "
          "-1/a; two points (red, green) are columns that cross three or four of them"),
         (plots.curves(*_rendered(samples), xlabel="X [µm]", ylabel="light"),
          "1.26: a rendered pixel sums a column, pixels of several lenslets")),
        why="In 2.0 one place is spread over lenslets: the angular resolution is the lenslet's p/a, the "
        "spatial one the pixel's, divided by m. 1.22 and 1.23 are right with +x/f and +x/b.",
    )  # fmt: skip


def _samples(
    camera: FocusedPlenopticCamera, raw: RawImage
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Places X, directions θ and light of the pixels under each lenslet of the middle row.

    A ray from X through the lenslet at c lands at s = c (1 + m) - m X.
    """
    calibration, pixel = camera.calibration, camera.pixels.pixel_pitch
    pitch, origin = calibration.lattice.pitch, calibration.lattice.origin
    rows = np.abs(np.arange(raw.shape[0]) - origin[0]) < pitch / 2
    light = raw.data[rows].sum(0)
    found = []
    for k in range(-_REACH, _REACH + 1):
        c = k * camera.lenslets.pitch
        own = np.abs(np.arange(raw.shape[1]) - origin[1] - k * pitch) <= pitch / 2
        s = (np.arange(raw.shape[1])[own] - origin[1]) * pixel
        place = (c * (1 + _M) - s) / _M
        found.append((place, (c - place) / camera.relay_distance, light[own]))
    return found


def _covered(camera: FocusedPlenopticCamera, place: float) -> int:
    """Lenslets of the middle row that the cone of a point's rays covers by more than `_SEEN`."""
    pitch, spread = camera.lenslets.pitch, camera.relay_distance / camera.image_distance
    centre, radius = place * (1 + spread), camera.pupil_diameter * spread / 2
    left = (np.arange(-_REACH, _REACH + 1) - 0.5) * pitch
    parts = np.minimum(left + pitch, centre + radius) - np.maximum(left, centre - radius)
    return int((parts > _SEEN * pitch).sum())


def _rows(
    samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]], place: float, covered: int
) -> list[ResultRow]:
    """Position of the point according to each lenslet that receives its light."""
    total = max(light.sum() for _, _, light in samples)
    seen = sum(light.sum() > _SEEN * total for _, _, light in samples)
    places = []
    for x, _, light in samples:
        if light.sum() > 0.6 * total:
            top = np.maximum(light - light.max() / 2, 0)
            places.append(float(x @ top / top.sum()))
    return [
        ResultRow(
            f"lenslets that see the point at {place / um:.0f} µm",
            float(seen),
            "",
            3,
            covered,
            0.0,
            note="those that its cone of rays covers by more than a third; 1/m = 3.33 in the mean",
        ),
        ResultRow(
            f"its place by these lenslets, mean, {place / um:.0f} µm",
            float(np.mean(places)) / um,
            "µm",
            None,
            place / um,
            2.0,
        ),
        ResultRow(
            f"largest difference between them, {place / um:.0f} µm",
            float(np.ptp(places)) / um,
            "µm",
            None,
            0.0,
            5.0,
            note="only the well lit ones; a lenslet's lobe is 232 µm wide here",
        ),
    ]


def _axes(camera: FocusedPlenopticCamera, ny: int, nx: int) -> tuple[np.ndarray, np.ndarray]:
    theta = np.linspace(0.5, -0.5, ny) * 1.2 * camera.lenslets.pitch / camera.lenslet_distance
    return theta, np.linspace(-250, 250, nx) * um


def _bands(camera: FocusedPlenopticCamera) -> np.ndarray:
    """Drawing (θ, X, 3): lenslets as grey bands, the main lens' limits, two points."""
    theta, x = _axes(camera, 300, 400)
    lenslet = np.rint((x + camera.relay_distance * theta[:, None]) / camera.lenslets.pitch)
    grey = np.where(lenslet % 2 == 0, 0.95, 0.75)
    # Rays through the main lens: θ about that of the chief ray, X / z2.
    half = camera.pupil_diameter / camera.image_distance / 2
    inside = np.abs(theta[:, None] - x / camera.image_distance) <= half
    picture = np.repeat(np.where(inside, grey, 1.0)[..., None], 3, -1)
    for place, colour in zip(_PLACES, _COLOURS, strict=True):
        picture[(np.abs(x - place) < 3 * um) & inside] = colour
    return picture


def _scattered(camera: FocusedPlenopticCamera, samples: list) -> np.ndarray:
    """Drawing (θ, X, 3): pixels of both points where they belong in phase space, darker where brighter."""
    theta, x = _axes(camera, 100, 134)
    picture = np.ones((len(theta), len(x), 3))
    spread = camera.lenslets.pitch / camera.relay_distance / 2  # a pixel holds p/a of directions
    for pixels, colour in zip(samples, _COLOURS, strict=True):
        top = max(float(light.max()) for _, _, light in pixels)
        for place, direction, light in pixels:
            for one, angle, value in zip(place, direction, light / top, strict=True):
                column = np.abs(x - one) <= (x[1] - x[0]) * 1.2
                row = np.abs(theta - angle) <= spread
                picture[np.ix_(row, column)] -= value * (1 - np.array(colour)) * 0.5
    return np.clip(picture, 0, 1)


def _rendered(samples: list) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Light of the pixels of all lenslets, summed by their place in the object [µm]."""
    edges = np.linspace(-250, 250, 61)
    curves = {}
    for pixels, name in zip(samples, ("red point", "green point"), strict=True):
        places, light = (np.concatenate([one[k] for one in pixels]) for k in (0, 2))
        count = np.maximum(np.histogram(places / um, edges)[0], 1)
        curves[name] = np.histogram(places / um, edges, weights=light)[0] / count
    return (edges[1:] + edges[:-1]) / 2, curves
