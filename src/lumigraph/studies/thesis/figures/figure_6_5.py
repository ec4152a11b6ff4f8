"""Figure 6.5: white images of misaligned lenslets, and the diagnosis of each."""

import math

import numpy as np

from lumigraph.calibration.diagnosis import Diagnosis, diagnose
from lumigraph.core.raw import RawImage
from lumigraph.plots.curves import images
from lumigraph.studies.thesis.figures.white_images import (
    MisplacedCamera,
    laboratory_camera,
    tilted_white,
    white,
)
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_TURN, _TILT, _MOVE, _SHIFT = math.radians(1.5), math.radians(4.0), 0.4e-3, (12e-6, -30e-6)


@experiment(
    "figure-6.5",
    "Misaligned lenslets",
    question="Does a white image tell that the lenslets are shifted, turned, tilted or at a wrong distance?",
    thesis="Figure 6.5, section 6.3",
    shows="A drawing of four faults of the lenslets before the sensor, which are to be put right by eye.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Simulated white images of one camera with one fault each, diagnosed against the camera as meant."""
    intended = laboratory_camera(13 if context.quick else 31)
    rows: list[ResultRow] = []
    panels = []
    whites = {
        "as meant": lambda: white(intended),
        "shifted": lambda: white(intended.replace(lenslets={"offset": _SHIFT})),
        "turned": lambda: white(intended.replace(lenslets={"rotation": _TURN})),
        "tilted": lambda: tilted_white(intended, _TILT),
        "wrong distance": lambda: white(intended.replace(sensor_shift=_MOVE)),
    }
    for number, (name, simulated) in enumerate(whites.items()):
        context.progress(number / len(whites), name)
        picture = RawImage(context.cached(name.replace(" ", "-"), lambda make=simulated: make().data))
        found = diagnose(picture, intended)
        rows += _rows(name, found, intended)
        middle = slice(picture.shape[0] // 5, -(picture.shape[0] // 5))
        panels.append((np.asarray(picture.data)[middle, middle], f"{name}\n{_short(found.report())}"))
    return ExperimentOutcome(
        tuple(rows),
        ((images(panels, columns=2), "White images with one fault each, and the diagnosis."),),
        why="The thesis aligns by eye; these numbers come from the white images alone. A tilt shows only in "
        "the change of the pitch over the picture.",
    )


def _rows(name: str, found: Diagnosis, intended: MisplacedCamera) -> list[ResultRow]:
    named = ", ".join(found.faults) or "none"
    spread = 1 + intended.lenslet_distance / intended.separation
    expected = {
        "as meant": (),
        "shifted": ("offset",),
        "turned": ("rotation",),
        "tilted": ("tilt",),
        # With the same main lens, micro-images farther away are wider.
        "wrong distance": ("distance", "overlap"),
    }[name]
    rows = [
        ResultRow(f"right fault named, {name}", float(found.faults == expected), "", None, 1.0, 0.0, named)
    ]
    if name == "shifted":
        for axis, value, right in zip("yx", found.offset, _SHIFT, strict=True):
            # The raw image is turned by 180 degrees.
            rows.append(
                ResultRow(f"offset along {axis}", value * 1e6, "µm", None, -right * spread * 1e6, 0.5)
            )
    if name == "turned":
        rows.append(
            ResultRow("rotation", math.degrees(found.rotation), "deg", None, math.degrees(_TURN), 0.01)
        )
    if name == "wrong distance":
        moved = found.lenslet_distance - found.intended_distance
        rows.append(ResultRow("distance too large by", moved * 1e3, "mm", None, _MOVE * 1e3, 0.03))
    if name == "tilted":
        height = intended.sensor.shape[1] * intended.sensor.pixel_pitch
        total = intended.separation + intended.lenslet_distance
        gradient = -2 * _TILT * intended.micro_image_pitch * height / total * 1e6
        rows += [
            ResultRow("tilt about y", math.degrees(found.tilt[1]), "deg", None, math.degrees(_TILT), 0.2),
            ResultRow("tilt about x", math.degrees(found.tilt[0]), "deg", None, 0.0, 0.2),
            ResultRow("pitch gradient along x", found.pitch_gradient[1] * 1e6, "µm", None, gradient,
                -0.05 * gradient, "over the width of the sensor"),
        ]  # fmt: skip
    return rows


def _short(report: str) -> str:
    """Text of the first fault, without the remedy."""
    return report.splitlines()[0].split(":")[0].replace(", ", ",\n", 1)
