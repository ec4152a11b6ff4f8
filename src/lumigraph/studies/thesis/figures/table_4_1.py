"""Table 4.1: the plenoptic camera 1.0 of chapter 4, and its image of a point in focus."""

import numpy as np
from scipy.special import j1

from lumigraph import plots
from lumigraph.calibration import calibrate
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.design import plenoptic1
from lumigraph.instruments import PlenopticCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, um


def camera(context: Context, lenslets: tuple[int, int] = (25, 41)) -> PlenopticCamera:
    """Table 4.1's camera with as many lenslets per axis as a quick and a full run need."""
    count = lenslets[0] if context.quick else lenslets[1]
    pixel = (10 if context.quick else 5) * um
    whole = PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    return whole.replace(lenslets={"count": (count, count)}, sensor={"pixel_pitch": pixel})


def point(camera: PlenopticCamera, dz: float = 0.0, place: tuple[float, float] = (0.0, 0.0)) -> RawImage:
    """Exact raw image of a point at depth `dz` from the focused plane and (y, x) [m]."""
    return simulate(camera, targets.points([(*place, dz)]))


def energies(raw: RawImage, calibration: Calibration, reach: int) -> np.ndarray:
    """Light under the lenslets (2 reach + 1)² about the middle one, of all light; pixels are shared out."""
    half, middle = calibration.lattice.pitch / 2, calibration.lattice.origin
    shares = []
    for axis in (0, 1):
        centers = middle[axis] + 2 * half * np.arange(-reach, reach + 1)
        away = np.abs(np.arange(raw.shape[axis]) - centers[:, None])
        shares.append(np.clip(0.5 + half - away, 0, 1))
    return shares[0] @ raw.data @ shares[1].T / raw.data.sum()


def airy_in_square(width: float, wavelength: float, f_number: float) -> float:
    """Light of an Airy pattern inside a square about its middle, of all light; an integral, no simulation."""
    samples = 1000
    x = (np.arange(samples) + 0.5) / samples * width / 2
    v = np.pi * np.hypot(x[:, None], x) / (wavelength * f_number)
    area = (width / 2 / samples) ** 2
    return float(4 * area * ((2 * j1(v) / v) ** 2).sum() * np.pi / 4 / (wavelength * f_number) ** 2)


@experiment(
    "table-4.1",
    "The plenoptic camera 1.0 of chapter 4",
    question="How far apart do the micro-images stand, and how much of an in-focus point's light stays under "
    "its own lenslet?",
    thesis="Table 4.1, section 4.6",
    shows="The distances, sizes and numbers of pixels of the camera that chapter 4 simulates.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """The lattice of a white image, and the energies of a point."""
    one = camera(context, (25, 101))
    pixel = one.pixels.pixel_pitch
    context.progress(0.0, "white image")
    white_camera = camera(context, (15, 41))
    white = simulate(white_camera, targets.white())
    found = calibrate(white)
    context.progress(0.6, "point in focus")
    raw = point(one)
    share = energies(raw, one.calibration, 3)
    directions = plenoptic1.resolvable_directions(one.wavelength, one.lenslets.pitch, one.lenslet_distance)
    rows = (
        ResultRow(
            "main-lens diameter, matched", one.pupil_diameter / mm, "mm", 3.6, 3.6, 1e-6, kind="closed form"
        ),
        ResultRow(
            "f-number, f/D",
            one.main_lens.focal_length / one.pupil_diameter,
            "",
            33.6,
            33.333,
            1e-3,
            kind="closed form",
        ),
        ResultRow("working f-number, z2/D", one.f_number, "", None, 66.667, 1e-3, kind="closed form"),
        ResultRow(
            "width of 101 lenslets",
            101 * one.lenslets.pitch / mm,
            "mm",
            20.0,
            15.15,
            1e-6,
            kind="closed form",
        ),
        ResultRow(
            "micro-image pitch, on a white image",
            found.lattice.pitch * pixel / um,
            "µm",
            150.0,
            156.25,
            0.02 * pixel / um,
            note="a fiftieth of a pixel",
        ),
        ResultRow("light of a point in its own micro-image", share[3, 3], "", None, 0.904, 0.01),
        ResultRow(
            "the same of the Airy pattern on the lenslet, by integration",
            airy_in_square(one.lenslets.pitch, one.wavelength, one.f_number),
            "",
            None,
            0.904,
            0.005,
            kind="closed form",
        ),
        ResultRow(
            "directions that diffraction leaves apart", directions, "", 30.0, 2.914, 0.001, kind="closed form"
        ),
    )
    half = int(3.5 * one.calibration.lattice.pitch)
    middle = raw.shape[0] // 2
    part = RawImage(
        np.sqrt(raw.data[middle - half : middle + half + 1, middle - half : middle + half + 1]), pixel
    )
    figures = (
        (plots.lattice(white, found), "White image and the lattice found on it"),
        (plots.show(part, title="7 × 7 micro-images", label="amplitude", cmap="magma"),
         "A point in focus: the square root of the raw image, so that light outside its micro-image shows"),
    )  # fmt: skip
    return ExperimentOutcome(
        rows, figures,
        why="Micro-images are seen from the main lens, so that they stand p (1 + f_µ/F) apart, not p; the "
        "printed sensor is a third too wide for its lenslets; thirty pixels sample three directions.",
    )  # fmt: skip
