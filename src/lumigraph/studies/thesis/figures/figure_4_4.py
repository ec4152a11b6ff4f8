"""Figure 4.4: cross-talk in the raw image of a point."""

import numpy as np

from lumigraph import plots
from lumigraph.core.raw import RawImage
from lumigraph.instruments import PlenopticCamera
from lumigraph.rendering import decode
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

PITCHES = {"100 um": 100 * um, "150 um": 150 * um}


@experiment(
    "figure-4.4",
    "Raw image of a point with cross-talk",
    question="Where does the light of a point in focus go when its lenslet is too small?",
    thesis="Figures 4.4 and 4.5",
    shows="A point in focus lights its lenslet and, by diffraction, the neighbours, which widens it in "
    "phase space.",
)
def run(context: Context) -> ExperimentOutcome:
    """Energies under a lenslet and its neighbours, for lenslets below and above the condition."""
    rows, figures = [], []
    for number, (name, pitch) in enumerate(PITCHES.items()):
        context.progress(number / 2, f"lenslets of {name}")
        camera = _camera(pitch, 25 if context.quick else 61)
        raw = table_4_1.point(camera)
        share = table_4_1.energies(raw, camera.calibration, 2)
        own, beside, corner = share[2, 2], share[2, [1, 3]].sum() + share[[1, 3], 2].sum(), share[1, 1]
        blur = _blur(camera, raw)
        figures += _figures(camera, raw, name)
        expected = (0.904, 0.01) if pitch == 150 * um else (None, None)
        rows += [
            ResultRow(f"own micro-image, {name}", own, "", None, *expected),
            ResultRow(f"four neighbours, {name}", beside),
            ResultRow(f"one corner, {name}", corner),
            ResultRow(f"width of the rendered point, rms, {name}", blur, "lenslets"),
        ]
    loss = (1 - rows[0].got) / (1 - rows[4].got)
    rows.append(ResultRow("light lost, 100 µm over 150 µm", loss, "", "more", 1.5, (0.0, np.inf)))
    return ExperimentOutcome(
        tuple(rows), tuple(figures),
        why="The printed focal length of 100 mm cannot be meant: 100 µm would need a main lens of 0.24 mm, "
        "whose Airy lobe is 15 lenslets wide. With 10 mm, as in Table 4.1, the picture looks as printed.",
    )  # fmt: skip


def _camera(pitch: float, count: int) -> PlenopticCamera:
    return PlenopticCamera.from_catalogue("thesis-plenoptic-1").replace(
        lenslets={"pitch": pitch, "count": (count, count)}, sensor={"pixel_pitch": pitch / 20}
    )


def _blur(camera: PlenopticCamera, raw: RawImage) -> float:
    """Root mean square distance of a rendered point's light from its lenslet, within three lenslets."""
    picture = decode(raw, camera.calibration).data.mean((0, 1))
    middle = picture.shape[0] // 2
    part = picture[middle - 3 : middle + 4, middle - 3 : middle + 4]
    away = np.arange(-3, 4)
    return float(np.sqrt((part * (away[:, None] ** 2 + away**2)).sum() / part.sum()))


def _figures(camera: PlenopticCamera, raw: RawImage, name: str) -> list[tuple[object, str]]:
    data, pitch = raw.data, camera.calibration.lattice.pitch
    middle, half = data.shape[0] // 2, int(2.5 * pitch)
    part = np.sqrt(data[middle - half : middle + half + 1, middle - half : middle + half + 1])
    part = part / part.max()
    borders = np.abs(np.abs(np.arange(-half, half + 1)) % pitch - pitch / 2) <= 0.5
    part[borders[:, None] | borders] = np.maximum(part[borders[:, None] | borders], 0.3)
    views = decode(raw, camera.calibration)
    epi = views.data[views.data.shape[0] // 2, :, views.data.shape[2] // 2]
    s = epi.shape[1] // 2
    phase_space = np.sqrt(np.maximum(epi[:, s - 4 : s + 5], 0))
    pair = [(part, "raw, amplitude; borders"), (phase_space, "phase space, amplitude")]
    return [
        (plots.images(pair, columns=2, cmap="magma"),
         f"4.4, 4.5: a point in focus behind lenslets of {name}; right, directions u over lenslets s"),
    ]  # fmt: skip
