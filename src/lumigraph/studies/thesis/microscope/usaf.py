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
        grid = bench.operator((dz,), samples, pixels=PIXELS, accuracy=1e-2).object_grid
        assert grid is not None
        contrasts = {f: contrast(found, grid, corner, w) for f, corner, w in elements(groups)}
        finest.append(finest_resolved(contrasts, RESOLVED))
        limits.append(1 / (2 * bench.sampling_distances((dz,))[0]))
        rows += _rows(dz, finest[-1], limits[-1], contrasts)
        pictures.append((found, f"from {dz / um:g} µm"))
    lines = {"finest resolved": np.array(finest) / 1e3, "band limit": np.array(limits) / 1e3}
    figure = curves(np.array(depths) / um, lines, xlabel="depth [µm]", ylabel="[line pairs per mm]")
    return ExperimentOutcome(
        tuple(rows),
        (
            (plots.images(pictures, columns=min(4, len(pictures))), "Reconstructed targets"),
            (figure, f"The finest elements with a contrast of {RESOLVED:g} or more, and the band limit."),
        ),
        why="In focus there is one sample per lenslet, half a line pair. Off focus a lenslet's aperture "
        "limits what is resolved, in proportion to depth.",
    )


def _found(
    bench: LightFieldMicroscope, dz: float, chart: tuple[tuple[int, int], int], rng: np.random.Generator
) -> np.ndarray:
    groups, samples = chart
    operator = bench.operator((dz,), samples, pixels=PIXELS, accuracy=1e-2)
    assert operator.object_grid is not None
    (chart_slice,) = targets.usaf1951(operator.object_grid, groups).parts
    assert isinstance(chart_slice, Slice)
    truth = chart_slice.intensity * PHOTONS
    raw = exposed(truth[None].astype(np.float32), operator, rng)
    return found_by(bench.sampling_distances((dz,)), operator, raw, 40, accelerated=True)[0]


def _rows(dz: float, finest: float, limit: float, contrasts: dict[float, float]) -> list[ResultRow]:
    expected = 0.0 if limit < min(contrasts) else min(limit, max(contrasts))
    # Elements are a sixth of an octave apart. Contrast 0.2 ends up to two below the band limit, or one above;
    # in focus two, where bars finer than a pair of lenslets may still fall on them in turn.
    low, high = 2 ** (-2.1 / 6), 2 ** ((2.1 if dz == 0 else 1.1) / 6)
    tolerance = (expected * (1 - low), expected * (high - 1)) if expected else (0.0, 1.0)
    return [
        ResultRow(
            f"finest bars resolved at {dz / um:g} µm", finest / 1e3, "line pairs/mm", None, expected / 1e3,
            (tolerance[0] / 1e3, tolerance[1] / 1e3), note=f"the band limit is {limit / 1e3:.0f}",
        )
    ]  # fmt: skip
