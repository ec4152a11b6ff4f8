"""The finest bars of a USAF-1951 target that a light-field microscope resolves, at several depths."""

import numpy as np

from lumigraph import plots
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.plots.curves import curves
from lumigraph.scene import Slice, targets
from lumigraph.studies.thesis.charts import contrast, elements, finest_resolved
from lumigraph.studies.thesis.microscope._bench import PIXELS, exposed, found_by, scope
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import um

DEPTHS = (-50 * um, -25 * um, -12 * um, 0.0, 12 * um, 25 * um, 50 * um)
"""Depths of the target, in the full run."""

PHOTONS = 300.0
"""Photons of a bright place, on each pixel."""

RESOLVED = 0.2
"""Least contrast of bars that count as resolved."""


@experiment(
    "microscope-usaf",
    "The finest bars that a light-field microscope resolves at each depth",
    question="A USAF-1951 target stands at a known depth, and is reconstructed from one noisy exposure. "
    "Which of its elements are resolved, beside the band limit?",
    thesis="not there; M. Broxton et al., Opt. Express 21, 25418 (2013)",
    shows="Broxton and others show a USAF-1951 target, blocky in focus and sharp some way off; the thesis "
    "shows none from several depths.",
)
def run(context: Context) -> ExperimentOutcome:
    """Contrast of every element, and the finest resolved one, at each depth."""
    count, groups, samples = (25, (7, 8), 9) if context.quick else (45, (6, 8), 9)
    bench, rng = scope(count), np.random.default_rng(1951)
    depths = (0.0, 25 * um, 50 * um) if context.quick else DEPTHS
    pictures, rows, finest, limits = [], [], [], []
    for done, dz in enumerate(depths):
        context.progress(done / len(depths), f"target at {dz / um:g} µm")
        found = context.cached(f"usaf-{done}", lambda dz=dz: _found(bench, dz, (groups, samples), rng))
        frequencies = [frequency for frequency, _, _ in elements(groups)]
        contrasts = dict(zip(frequencies, found["contrasts"], strict=True))
        finest.append(finest_resolved(contrasts, RESOLVED))
        limits.append(1 / (2 * bench.sampling_distances((dz,))[0]))
        blocks = finest_resolved(dict(zip(frequencies, found["blocks"], strict=True)), RESOLVED)
        limit = min(limits[-1], max(frequencies))
        rows.append(in_focus(finest[-1], blocks) if dz == 0 else off_focus(dz, finest[-1], limit))
        pictures.append((found["picture"], f"from {dz / um:g} µm"))
    lines = {"finest resolved": np.array(finest) / 1e3, "band limit": np.array(limits) / 1e3}
    figure = curves(np.array(depths) / um, lines, xlabel="depth [µm]", ylabel="[line pairs per mm]")
    return ExperimentOutcome(
        tuple(rows),
        (
            (plots.images(pictures, columns=min(4, len(pictures))), "Reconstructed targets"),
            (figure, f"The finest elements with a contrast of {RESOLVED:g} or more, and the band limit."),
        ),
        why="In focus there is one sample per lenslet, half a line pair. Whether bars near that limit are "
        "seen depends on how they fall on the lenslets, so that contrasts are means over nine positions. "
        "Off focus a lenslet's aperture limits what is resolved, in proportion to depth.",
    )


def _found(
    bench: LightFieldMicroscope, dz: float, chart: tuple[tuple[int, int], int], rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Picture of the target, mean contrasts of its elements, and those of one value per lenslet.

    In focus the target stands at nine places, a third of a lenslet apart along y and x.
    """
    groups, samples = chart
    operator = bench.operator((dz,), samples, pixels=PIXELS, accuracy=1e-2)
    assert operator.object_grid is not None
    (chart_slice,) = targets.usaf1951(operator.object_grid, groups).parts
    assert isinstance(chart_slice, Slice)
    pictures, blocks = [], []
    for place in np.ndindex(3, 3) if dz == 0 else [(0, 0)]:
        y, x = (step * samples // 3 for step in place)
        truth = np.roll(chart_slice.intensity, (y, x), (0, 1)) * PHOTONS
        raw = exposed(truth[None].astype(np.float32), operator, rng)
        found = found_by(bench.sampling_distances((dz,)), operator, raw, 40, accelerated=True)[0]
        pictures.append(np.roll(found, (-y, -x), (0, 1)))
        blocks.append(np.roll(one_value_a_lenslet(truth, samples), (-y, -x), (0, 1)))
    means = [
        np.mean([[contrast(one, operator.object_grid, corner, w) for _, corner, w in elements(groups)]
                 for one in shown], 0)
        for shown in (pictures, blocks)
    ]  # fmt: skip
    return {"picture": pictures[0], "contrasts": means[0], "blocks": means[1]}


def one_value_a_lenslet(truth: np.ndarray, samples: int) -> np.ndarray:
    """The picture (y, x) with every lenslet's samples x samples replaced by their mean."""
    rows, columns = (size // samples for size in truth.shape)
    means = truth.reshape(rows, samples, columns, samples).mean((1, 3))
    return np.kron(means, np.ones((samples, samples)))


def in_focus(finest: float, blocks: float) -> ResultRow:
    """Finest bars in focus, against what a picture of one value per lenslet shows of the same target."""
    # Half an element: one that is finer or coarser by an element, 12 %, fails.
    low, high = (blocks * abs(2 ** (half / 12) - 1) / 1e3 for half in (-1, 1)) if blocks else (0.0, 1.0)
    return ResultRow(
        "finest bars resolved at 0 µm, mean of nine positions", finest / 1e3, "line pairs/mm", None,
        blocks / 1e3, (low, high), note="that of the target itself with one value per lenslet",
    )  # fmt: skip


def off_focus(dz: float, finest: float, limit: float) -> ResultRow:
    """Finest bars at a depth, against the band limit [1/m]: up to two elements coarser, none finer."""
    return ResultRow(
        f"finest bars resolved at {dz / um:g} µm", finest / 1e3, "line pairs/mm", None, limit / 1e3,
        (limit * (1 - 2 ** (-2.1 / 6)) / 1e3, 1e-9),
        note="the band limit, or up to two elements, of 12 % each, below",
    )  # fmt: skip
