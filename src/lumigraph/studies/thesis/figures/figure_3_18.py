"""Signal to noise ratio of a resolution target's image against the number of snapshots."""

import math

import numpy as np

from lumigraph.analysis import rms_error
from lumigraph.plots import curves, images
from lumigraph.studies.thesis.figures import _coherence as coherence
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

COUNT = 350
"""Snapshots after which the thesis finds no gain."""
STEP = 50
"""Snapshots of one part, which an interrupted run keeps."""
QUICK_MASKS, MASKS = 50, 150
"""Snapshots of masks: their bias and their speckle are told apart, and give the error of any number."""

WHY = (
    "White phases, one for each sample, converge to the exact incoherent image as 1/sqrt(M), without an "
    "asymptote: 350 give 25 dB. The masks stop at their bias. The thesis' 18 dB is that of masks."
)


@experiment(
    "figure-3.18",
    "SNR against the number of snapshots",
    question="How many random-phase snapshots make an incoherent image?",
    thesis="Figures 3.16, 3.17 and 3.18",
    shows="Images of a target, full of speckle after 5 snapshots, and their SNR, which rises to 18 dB at "
    "350.",
    camera=two_f.CAMERA,
)
def run(context: Context) -> ExperimentOutcome:
    """Images of up to 350 snapshots with white phases and with masks, against the exact image."""
    imager = coherence.Imager.of(context)
    index = round(coherence.INCOHERENCE * imager.samples)
    few = {"5 snapshots": _sum(imager, coherence.masked(index), 5, 0).sum(0)}
    white = _parts(context, imager, "white", COUNT)
    masks = _parts(context, imager, "masks", QUICK_MASKS if context.quick else MASKS)
    counts = STEP * np.arange(1, len(white) + 1)
    errors = {name: _errors(parts, imager.reference) for name, parts in (("white", white), ("masks", masks))}
    found = coherence.Errors.of(masks.sum(0), STEP * len(masks), imager.reference)
    moduli = _moduli_error(imager)
    rows = (
        ResultRow(
            "rms error of 350 white snapshots",
            errors["white"][-1],
            thesis="18 dB: 0.126",
            expected=COUNT**-0.5,
            tolerance=0.0025,
            note="1/sqrt(M): fully developed speckle",
        ),
        ResultRow(
            "rms error of 50 white snapshots",
            errors["white"][0],
            expected=50**-0.5,
            tolerance=0.006,
            note="1/sqrt(M)",
        ),
        ResultRow(
            "SNR of 350 white snapshots",
            -20 * math.log10(errors["white"][-1]),
            "dB",
            thesis=18.0,
            expected=10 * math.log10(COUNT),
            tolerance=0.4,
        ),
        ResultRow(
            "floor of masks, C/N = 0.14",
            found.bias,
            expected=0.097,
            tolerance=0.03,
            note="for endless snapshots",
            kind="told",
        ),
        ResultRow(
            "SNR of 350 masks, C/N = 0.14",
            -20 * math.log10(float(found.rms(COUNT))),
            "dB",
            thesis=18.0,
            expected=19.0,
            tolerance=2.5,
            kind="told",
        ),
        ResultRow(
            "rms error of added moduli, endless snapshots",
            moduli,
            expected=0.25,
            tolerance=0.05,
            note="the listings add |U| instead of |U|²",
            kind="told",
        ),
    )
    pictures = [
        *few.items(),
        ("350 snapshots, white" if white.size else "", white.sum((0, 1))),
        (f"{STEP * len(masks)} snapshots, masks", masks.sum((0, 1))),
    ]
    laws = np.geomspace(5, 1000, 40)
    figure = curves(
        counts,
        {
            "white phases": -20 * np.log10(errors["white"]),
            "masks": (counts[: len(masks)], -20 * np.log10(errors["masks"])),
            "1/sqrt(M)": (laws, 10 * np.log10(laws)),
            "masks: bias and speckle": (laws, -20 * np.log10(found.rms(laws))),
        },
        xlabel="snapshots M",
        ylabel="SNR [dB]",
        marks={"thesis: 350": 350.0},
    )
    shown = [(picture, name) for name, picture in pictures]
    figures = (
        (images([*shown, (imager.reference, "exact incoherent image")], columns=2), "The target's image"),
        (figure, "SNR against the number of snapshots"),
    )
    return ExperimentOutcome(rows, figures, WHY)


def _sum(imager: coherence.Imager, light: coherence.Light, count: int, seed: int) -> np.ndarray:
    return coherence.snapshots(imager, light, count, seed)


def _parts(context: Context, imager: coherence.Imager, kind: str, count: int) -> np.ndarray:
    """Sums of `STEP` snapshots each (parts, 2, K, K)."""
    index = round(coherence.INCOHERENCE * imager.samples)
    light = coherence.white if kind == "white" else coherence.masked(index)
    parts = []
    for seed in range(1, count // STEP + 1):
        done = (seed - 1) * STEP / count
        context.progress(done / 2 if kind == "white" else 0.5 + done / 2, kind)
        parts.append(context.cached(f"{kind}-{seed}", lambda seed=seed: _sum(imager, light, STEP, seed)))
    return np.stack(parts)


def _errors(parts: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Relative rms error of the mean of 1, 2 ... parts."""
    sums = np.cumsum(parts.sum(1), axis=0)
    return np.array([rms_error(image, reference) for image in sums])


def _moduli_error(imager: coherence.Imager) -> float:
    """The mean modulus of speckle is sqrt(π I / 4): the sum of moduli tends to an image of sqrt(I)."""
    return rms_error(np.sqrt(np.maximum(imager.reference, 0)), imager.reference)
