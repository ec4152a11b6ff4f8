"""Figure 4.3: lenslets wide enough for their own diffraction."""

import numpy as np

from lumigraph import plots
from lumigraph.design import plenoptic1, resolution
from lumigraph.instruments import PlenopticCamera
from lumigraph.studies.thesis.figures import table_4_1
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm, um

_DIAMETERS = np.array([75, 87.5, 100, 112, 124.27, 137, 150, 175, 200]) * um
_QUICK = np.array([100, 124.27, 150]) * um


@experiment(
    "figure-4.3",
    "Condition against cross-talk",
    question="How wide must a lenslet be to keep a point's light in its own micro-image, and what does the "
    "condition promise?",
    thesis="Figure 4.3, equations 4.1 to 4.3",
    shows="A curve of the smallest lenslet that keeps a point's light, over its focal length.",
    camera="thesis-plenoptic-1",
)
def run(context: Context) -> ExperimentOutcome:
    """The condition in closed form, and the light that simulated cameras keep."""
    wavelength, f = 633e-9, 10 * mm
    smallest = plenoptic1.smallest_lenslet(wavelength, f)
    lobe = 2 * resolution.airy_first_zero(wavelength, resolution.f_number(f, smallest))
    diameters = _QUICK if context.quick else _DIAMETERS
    kept = context.cached("kept", lambda: np.array([_kept(context, diameter) for diameter in diameters]))
    at = dict(zip((round(d / um) for d in diameters), kept, strict=True))
    rows = (
        ResultRow("smallest lenslet at 10 mm", smallest / um, "µm", None, 124.28, 0.05, kind="closed form"),
        ResultRow(
            "Airy lobe of that lenslet over its width",
            lobe / smallest,
            "",
            1.0,
            1.0,
            1e-9,
            kind="closed form",
        ),
        ResultRow(
            "smallest lenslet at 100 mm, the printed length of figure 4.4",
            plenoptic1.smallest_lenslet(wavelength, 100 * mm) / um,
            "µm",
            100.0,
            393.0,
            0.1,
            note="four times as wide as printed",
            kind="closed form",
        ),
        ResultRow(
            "directions left at the limit",
            plenoptic1.resolvable_directions(wavelength, smallest, f),
            "",
            None,
            2.0,
            1e-9,
            kind="closed form",
        ),
        ResultRow(
            "directions left in Table 4.1",
            plenoptic1.resolvable_directions(wavelength, 150 * um, f),
            "",
            30.0,
            2.914,
            1e-3,
            kind="closed form",
        ),
        ResultRow("light kept by lenslets of 150 µm", at[150], "", None, 0.904, 0.01),
        ResultRow("light kept at the limit", at[124], "", None, 0.808, 0.006, note="finer sum: 0.8082"),
        ResultRow(
            "light kept by lenslets of 100 µm", at[100], "", None, 0.827, 0.006, note="finer sum: 0.8271"
        ),
        ResultRow(
            "light lost by lenslets of 100 µm over 150 µm",
            (1 - at[100]) / (1 - at[150]),
            "",
            "more",
            1.5,
            (0.0, np.inf),
            note="below the limit",
        ),
    )
    lengths = np.linspace(0.5, 20, 200)
    limit = [plenoptic1.smallest_lenslet(wavelength, length * mm) / um for length in lengths]
    condition = plots.curves(
        lengths,
        {"d = sqrt(2.44 λ f_µ)": limit, "Table 4.1": ([10], [150]), "100 µm at 10 mm": ([10], [100])},
        xlabel="focal length of the lenslets [mm]", ylabel="lenslet diameter [µm]",
    )  # fmt: skip
    light = plots.curves(
        diameters / um, {"simulated": kept}, xlabel="lenslet diameter [µm], f_µ = 10 mm",
        ylabel="light in its own micro-image", marks={"condition": smallest / um},
    )  # fmt: skip
    return ExperimentOutcome(
        rows,
        ((condition, "4.3: lenslets above the line meet the condition"),
         (light, "Light of a point in focus in its own micro-image; neighbours interfere: it dips")),
        why="The condition makes the central lobe as wide as the lenslet. That is the least one can ask for: "
        "it leaves two directions apart, and a fifth of the light still goes to the neighbours.",
    )  # fmt: skip


def _kept(context: Context, diameter: float) -> float:
    """Light of an in-focus point in its own micro-image, for lenslets of a diameter [m]; D is matched."""
    context.progress(float(diameter / _DIAMETERS[-1]), f"lenslets of {diameter / um:.0f} µm")
    camera = PlenopticCamera.from_catalogue("thesis-plenoptic-1").replace(
        lenslets={"pitch": float(diameter), "count": (25, 25)}, sensor={"pixel_pitch": float(diameter) / 30}
    )
    return float(table_4_1.energies(table_4_1.point(camera), camera.calibration, 1)[1, 1])
