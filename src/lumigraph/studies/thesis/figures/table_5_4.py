"""Table 5.4 and figure 5.19: transfer functions of the main lens and of the rendered picture."""

import numpy as np

from lumigraph.analysis import cutoff, mtf
from lumigraph.design import plenoptic2, resolution
from lumigraph.plots.curves import curves
from lumigraph.studies.thesis.figures.point_images import MAGNIFICATIONS, PointRendering, on_axis
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_PRINTED = {0.5: (3.0e4, 1.0e4), 0.3: (3.5e4, 0.76e4), 0.25: (3.6e4, 0.63e4)}
_RIGHT = {0.5: (30390.0, 15195.0), 0.3: (35065.0, 10520.0), 0.25: (36468.0, 9117.0)}
_LEVEL, _AT = 0.01, 0.95874  # of the MTF, and where a round pupil has it over its cut-off
_PAD = 2000  # samples of dark on both sides: frequencies so close that the first fall below 1 % is seen


@experiment(
    "table-5.4",
    "Cut-off of the rendered image",
    question="Up to which frequency does the main lens, and does the rendered picture, show an object?",
    thesis="Table 5.4, figure 5.19",
    shows="MTFs of the main lens and of the whole system, which ends at a third to a sixth of the main "
    "lens' cut-off.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """MTFs of a point on the axis, their last frequency above 1 %, and the cut-offs by formula."""
    rows: list[ResultRow] = []
    figures = []
    for number, m in enumerate(MAGNIFICATIONS):
        context.progress(number / 3, f"MTF, m = {m:g}")
        point = on_axis(m, 13 if context.quick else 39)
        part, grid = point.micro_image
        transfer = {
            "main lens": mtf(point.main, point.main_grid.pitch[1]),
            "rendered": mtf(np.pad(point.rendered, ((0, 0), (_PAD, _PAD))), point.rendered_grid.pitch[1]),
            "one micro-image": mtf(part, grid.pitch[1]),
        }
        rows += _rows(point, m, {name: cutoff(*curve, _LEVEL) for name, curve in transfer.items()})
        figures.append(_figure(transfer, m))
    return ExperimentOutcome(
        tuple(rows),
        tuple(figures),
        why="The lenslets pass m p/(λb); equation 5.18 prints b/p for p/b. The lower cut-offs of the thesis "
        "come from its patches (P m, centred by x b/z), which do not meet: not from diffraction.",
    )


def _rows(point: PointRendering, m: float, measured: dict[str, float]) -> list[ResultRow]:
    found, (main, tile), printed = point.camera, _RIGHT[m], _PRINTED[m]
    formula = (
        resolution.incoherent_cutoff(found.wavelength, found.f_number),
        plenoptic2.rendered_cutoff(found.wavelength, found.lenslets.pitch, m, found.lenslet_distance),
    )
    return [
        ResultRow(f"main lens, formula, m = {m:g}", formula[0], "1/m", None, main, 1.0,
            kind="closed form"),
        ResultRow(f"main lens, measured, m = {m:g}", measured["main lens"], "1/m", printed[0],
            _AT * main, 0.008 * main, note="a round pupil's MTF falls below 1 % at 0.959 of the cut-off"),
        ResultRow(f"rendered, formula, m = {m:g}", formula[1], "1/m", None, tile, 1.0,
            kind="closed form"),
        ResultRow(f"rendered, measured, m = {m:g}", measured["rendered"], "1/m", printed[1], tile,
            0.1 * tile, note="seams between patches add some light beyond"),
        ResultRow(f"one micro-image, measured, m = {m:g}", measured["one micro-image"], "1/m", None,
            _AT * tile, 0.045 * tile, note="without seams; ripples of the main lens' blurred disc"),
    ]  # fmt: skip


def _figure(transfer: dict[str, tuple[np.ndarray, np.ndarray]], m: float) -> tuple[object, str]:
    shown = {}
    for name, (frequency, values) in transfer.items():
        part = frequency < 4e4
        shown[name] = (frequency[part] / 1e4, values[part])
    marks = {"m p/(λb)": _RIGHT[m][1] / 1e4, "1/(λ F#)": _RIGHT[m][0] / 1e4, "thesis": _PRINTED[m][1] / 1e4}
    figure = curves([], shown, xlabel="frequency [10⁴ /m]", ylabel="MTF", marks=marks)
    return figure, f"Transfer functions, m = {m:g} (5.19)."
