"""Figures 6.6 and 6.7: white images with a main lens too small, matched and too large."""

import numpy as np

from lumigraph.calibration.diagnosis import diagnose
from lumigraph.core.raw import RawImage
from lumigraph.plots.curves import images
from lumigraph.studies.thesis.figures.white_images import laboratory_camera, white
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_CASES = {
    "too small": (0.6, ("gap",)),
    "matched": (1.0, ()),
    "somewhat too large": (1.1, ("overlap",)),
    "much too large": (1.4, ("overlap",)),
}


@experiment(
    "figure-6.6",
    "Matching the f-numbers",
    question="Does a white image tell by how much the main lens must be opened or closed?",
    thesis="Figures 6.6 and 6.7, section 6.3",
    shows="White images with gaps between micro-images, where the main lens is too small, and with "
    "micro-images that touch.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Simulated white images for four diameters of the main lens."""
    intended = laboratory_camera(9 if context.quick else 31)
    touching, pitch = intended.diameters.touching, intended.micro_image_pitch
    rows: list[ResultRow] = []
    panels = []
    for number, (name, (factor, faults)) in enumerate(_CASES.items()):
        context.progress(number / len(_CASES), name)
        camera = intended.replace(main_lens={"diameter": factor * touching})
        picture = RawImage(context.cached(name.replace(" ", "-"), lambda c=camera: white(c).data))
        found = diagnose(picture, intended)
        gap = (pitch - camera.micro_image_width) * 1e6
        rows += [
            ResultRow(f"right fault named, {name}", float(found.faults == faults), "", None, 1.0, 0.0,
                ", ".join(found.faults) or "none"),
            ResultRow(f"gap (overlap below 0), {name}", found.gap * 1e6, "µm", None, gap, 2.5),
            ResultRow(f"diameter of the main lens, {name}", found.diameter * 1e3, "mm", None,
                camera.pupil_diameter * 1e3, 0.05),
            ResultRow(f"diameter at which they touch, {name}", found.intended_diameter * 1e3, "mm", None,
                touching * 1e3, 0.03),
        ]  # fmt: skip
        n, half = picture.shape[0] // 2, int(3.5 * pitch / intended.sensor.pixel_pitch)
        text = f"{name}: gap {found.gap * 1e6:+.0f} µm"
        panels.append((np.asarray(picture.data)[n - half : n + half, n - half : n + half], text))
    return ExperimentOutcome(
        tuple(rows),
        ((images(panels, columns=2), "White images: too small (6.6), matched (6.7), too large."),),
        why="Micro-images touch at D = p (L + b)/b; equation 5.15 gives z2 p/b, which leaves gaps. Lenslets "
        "do not focus the main lens on the sensor: their blur is taken out of the measured width.",
    )
