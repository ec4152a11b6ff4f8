"""Signal to noise ratio of a resolution target's image against the coherence index."""

import math

import numpy as np

from lumigraph.plots import curves, images
from lumigraph.studies.thesis.figures import _coherence as coherence
from lumigraph.studies.thesis.figures import _two_f as two_f
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

RATIOS = (0.003, 0.01, 0.03, 0.06, 0.1, coherence.INCOHERENCE, 0.2, 0.28)
"""C/N from the thesis' C = 5 to its C = 500, of N = 1765."""
QUICK = (0.01, coherence.INCOHERENCE)
COUNT = {True: 40, False: 48}
"""Snapshots for each coherence index, quick and full; the two kinds of error are separate, see `Errors`."""
ITERATIONS = 300
"""Snapshots of the thesis' figures 3.14 and 3.15."""

WHY = (
    "With M snapshots rms² = bias² + speckle²/M. The asymptote over C is where the bias, light that stays "
    "partially coherent, has come down to the speckle; more snapshots do not lower it. It is a property of "
    "the masks, not of incoherent light. The reference of the thesis' SNR is not given there."
)


@experiment(
    "figure-3.15",
    "SNR against the coherence index",
    question="How incoherent are the random phase masks of C × C sources?",
    thesis="Figures 3.14 and 3.15",
    shows="Images of a resolution target and their SNR: both improve with the coherence index, up to 250 "
    "sources.",
    camera=two_f.CAMERA,
)
def run(context: Context) -> ExperimentOutcome:
    """Bias and speckle of the masks, against the exact incoherent image."""
    imager, found, pictures = coherence.Imager.of(context), {}, []
    count, ratios = COUNT[context.quick], QUICK if context.quick else RATIOS
    for step, ratio in enumerate(ratios):
        context.progress(step / (len(ratios) + 1), f"C/N = {ratio:g}")
        index = max(round(ratio * imager.samples), 2)
        halves = context.cached(f"index-{index}", _task(imager, index, count))
        found[ratio] = coherence.Errors.of(halves, count, imager.reference)
        pictures.append((halves.sum(0), f"C = {index}, C/N = {ratio:g}"))
    pictures.append((imager.reference, "exact incoherent image"))
    floor, coarse = found[coherence.INCOHERENCE], found[ratios[0]]
    rows = (
        ResultRow("floor for many snapshots, C/N = 0.14", floor.bias, expected=0.097, tolerance=0.03,
            note="relative rms error; 0 for incoherent light", kind="told"),
        ResultRow("SNR of 300 snapshots, C/N = 0.14", _decibel(floor), "dB", thesis=18.0, expected=19.0,
            tolerance=2.5, note="floor 0.097 ± 0.03 and speckle 0.8/sqrt(300)", kind="told"),
        ResultRow(f"SNR of 300 snapshots, C/N = {ratios[0]:g}", _decibel(coarse), "dB"),
        ResultRow("gain from the coarsest masks to C/N = 0.14", _decibel(floor) - _decibel(coarse), "dB",
            thesis="grows, then levels off", expected=3.0, tolerance=(0.0, math.inf), kind="told"),
    )  # fmt: skip
    rows += () if context.quick else (_parallel_row(context, imager, count),)
    return ExperimentOutcome(rows, _figures(imager, found, pictures), WHY)


def _task(imager: coherence.Imager, index: int, count: int):
    return lambda: coherence.snapshots(imager, coherence.masked(index), count, seed=index)


def _parallel_row(context: Context, imager: coherence.Imager, count: int) -> ResultRow:
    """The floor where the light does not converge on the lens."""
    index = round(coherence.INCOHERENCE * imager.samples)
    other = coherence.Imager(imager.samples, converging=False)
    halves = context.cached("parallel", _task(other, index, count))
    bias = coherence.Errors.of(halves, count, imager.reference).bias
    note = "coherent light from the border of the field misses the lens"
    return ResultRow("floor in parallel light, C/N = 0.14", bias, note=note)


def _decibel(errors: coherence.Errors) -> float:
    return -20 * math.log10(float(errors.rms(ITERATIONS)))


def _figures(imager: coherence.Imager, found: dict, pictures: list) -> tuple:
    index = [ratio * imager.samples for ratio in found]
    biases = [-20 * math.log10(max(one.bias, 1e-3)) for one in found.values()]
    speckle = [-20 * math.log10(one.speckle / math.sqrt(ITERATIONS)) for one in found.values()]
    drawn = {
        "300 snapshots": [_decibel(one) for one in found.values()],
        "bias alone (endless snapshots)": biases,
        "speckle alone": speckle,
    }
    shown = [pictures[k] for k in sorted({0, len(pictures) // 3, len(pictures) // 2, len(pictures) - 2})]
    figure = curves(
        np.array(index), drawn, xlabel="coherence index C", ylabel="SNR [dB]",
        marks={"C/N = 0.14": coherence.INCOHERENCE * imager.samples},
    )  # fmt: skip
    return (
        (images([*shown, pictures[-1]], columns=3), "Images of the target for several coherence indices"),
        (figure, "SNR against the coherence index, and what limits it"),
    )
