"""Figures 4.19 and 4.21: three points at three depths, rendered and refocused."""

import numpy as np

from lumigraph import plots
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.instruments import PlenopticCamera
from lumigraph.rendering import decode, refocus
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

# Name: (y, x, dz) [m]; the printed list and figure call the second and third point B and C, or C and B.
POINTS = {"A": (-3 * mm, -3 * mm, -50 * mm), "B": (0.0, 0.0, 0.0), "C": (3 * mm, 3 * mm, 50 * mm)}


@experiment(
    "figure-4.19",
    "Three points at three depths, refocused",
    question="Does refocusing bring the light of one depth together and leave the picture's energy alone?",
    thesis="Figures 4.18, 4.19 and 4.21",
    shows="A raw image and pictures of three points, one of them sharp and bright in each.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """One raw image for each point, of equal energy, summed; refocused on each point."""
    camera = table_4_1.camera(context, (61, 101))
    raw = _raw(context, camera)
    views = decode(raw, camera.calibration, directions=10)
    alphas = {name: camera.alpha(dz) for name, (_, _, dz) in POINTS.items()}
    pictures = {}
    for number, (name, alpha) in enumerate(alphas.items()):
        context.progress(0.4 + 0.2 * number, f"refocused on {name}")
        pictures[name] = refocus(views, alpha, oversample=1)
    rows = [row for name in POINTS for row in _rows(camera, views, pictures, name)]
    energy = {name: float(picture.sum()) for name, picture in pictures.items()}
    rows += [
        ResultRow(
            f"light when refocused on {name}, over the rendered picture's",
            energy[name] / energy["B"],
            "",
            "unchanged",
            1.0,
            0.02,
            note="places near the edge are seen by fewer views",
        )
        for name in ("A", "C")
    ]
    shown = [
        (np.sqrt(np.maximum(pictures[name], 0)), f"refocused on {name}, α' = {alphas[name]:.4f}")
        for name in ("B", "A", "C")
    ]
    return ExperimentOutcome(
        tuple(rows),
        ((plots.images([(np.sqrt(raw.data), "raw, amplitude"), shown[0]], columns=2, cmap="magma"),
          "4.19: raw image and the picture without refocusing, amplitudes: B is in focus"),
         (plots.images(shown[1:], columns=2, cmap="magma"), "4.21: refocused on A and on C, amplitudes")),
        why="The text refocuses A with α' = 0.7; its own equation gives 0.7368. Points stand where the ray "
        "through the middle of the main lens goes: A at 3.79 mm, C at 2.48 mm, not at 3 mm.",
    )  # fmt: skip


def _raw(context: Context, camera: PlenopticCamera) -> RawImage:
    def summed() -> np.ndarray:
        total = np.zeros(camera.sensor.shape)
        for number, (name, (y, x, dz)) in enumerate(POINTS.items()):
            context.progress(0.13 * number, f"point {name}")
            light = table_4_1.point(camera, dz, (y, x)).data
            total += light / light.sum(dtype=float)
        return total.astype(np.float32)

    return RawImage(context.cached("raw", summed), camera.pixels.pixel_pitch)


def _rows(
    camera: PlenopticCamera, views: LightField, pictures: dict[str, np.ndarray], name: str
) -> list[ResultRow]:
    """Place of a point, and how much brighter it is when the picture is refocused on it."""
    y, x, dz = POINTS[name]
    scale = camera.separation / (camera.object_distance + dz)
    place = np.array([y, x]) * scale
    near = (np.abs(views.lenslets.y - place[0]) < 1.2 * mm, np.abs(views.lenslets.x - place[1]) < 1.2 * mm)
    peaks = {key: float(picture[np.ix_(*near)].max()) for key, picture in pictures.items()}
    part = np.maximum(pictures[name][np.ix_(*near)], 0)
    part = part * (part > 0.3 * part.max())
    found = (part.sum(0) @ views.lenslets.x[near[1]]) / part.sum()
    others = max(peak for key, peak in peaks.items() if key != name)
    return [
        ResultRow(f"place of {name}, x", found / mm, "mm", None, place[1] / mm, 0.03),
        ResultRow(
            f"peak of {name} when refocused on it, over other pictures",
            peaks[name] / others,
            "",
            "highest",
            1.5,
            (0.0, np.inf),
        ),
        ResultRow(
            f"brightest point refocused on {name}: peak over the other points'",
            peaks[name] / _brightest_other(camera, views, pictures[name], name),
            "",
            "brightest",
            1.0,
            (0.0, np.inf),
        ),
    ]


def _brightest_other(camera: PlenopticCamera, views: LightField, picture: np.ndarray, name: str) -> float:
    peaks = []
    for key, (y, x, dz) in POINTS.items():
        if key == name:
            continue
        place = np.array([y, x]) * camera.separation / (camera.object_distance + dz)
        near = np.ix_(
            np.abs(views.lenslets.y - place[0]) < 1.2 * mm, np.abs(views.lenslets.x - place[1]) < 1.2 * mm
        )
        peaks.append(float(picture[near].max()))
    return max(peaks)
