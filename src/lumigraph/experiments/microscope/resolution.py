"""What a light-field microscope resolves at each depth: beads, bars and a vesicle, with photon noise."""

import math
from typing import Any

import numpy as np

from lumigraph import plots
from lumigraph.deconvolution import RichardsonLucy, deconvolve, filters
from lumigraph.design import microscope as design
from lumigraph.experiments.registry import Context, Outcome, Row, experiment
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.plots.curves import curves
from lumigraph.units import um

DEPTHS = (-50 * um, -25 * um, -12 * um, 0.0, 12 * um, 25 * um, 50 * um)
"""Of the beads, in the full run."""

STEP = 4 * um
PHOTONS = 2e5
"""Of a bead, on the sensor."""


def scope(context: Context) -> LightFieldMicroscope:
    """20x/0.5 with lenslets of 125 um and f/20, the microscope of M. Broxton et al. (2013)."""
    count = (9, 9) if context.quick else (15, 15)
    return LightFieldMicroscope(
        wavelength=525e-9,
        objective={"magnification": 20.0, "numerical_aperture": 0.5},  # type: ignore[arg-type]
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": count},  # type: ignore[arg-type]
        sensor={"pixel_pitch": "8.33 um"},  # type: ignore[arg-type]
    )


@experiment(
    "microscope-resolution",
    "A light-field microscope's resolution against depth",
    question="How wide are beads, how contrasty bars and how true a vesicle that are reconstructed from one "
    "noisy exposure, beside the band limit?",
    thesis="not there; M. Broxton et al., Opt. Express 21, 25418 (2013)",
)
def run(context: Context) -> Outcome:
    """Widths of beads at several depths, bars on and off the focused plane, the radius of a vesicle."""
    bench, rng = scope(context), np.random.default_rng(20130)
    depths = (-25 * um, 0.0, 25 * um) if context.quick else DEPTHS
    widths = []
    for done, dz in enumerate(depths):
        context.progress(0.6 * done / len(depths), f"bead at {dz / um:g} um")
        widths.append(context.cached(f"bead-{done}", lambda dz=dz: _bead(bench, dz, context, rng)))
    context.progress(0.6, "bars")
    bars = context.cached("bars", lambda: _bars(bench, context, rng))
    context.progress(0.8, "vesicle")
    vesicle = context.cached("vesicle", lambda: _vesicle(bench, context, rng))
    rows = [*_bead_rows(bench, depths, widths), *_bar_rows(bars), *_vesicle_rows(vesicle)]
    figures = (_width_figure(bench, depths, widths), _bar_figure(bars), _vesicle_figure(vesicle))
    return Outcome(
        tuple(rows), figures,
        why="The focused plane is sampled once per lenslet: a bead there is as wide as a lenslet. Off it the "
        "directions fill the gaps, and the band limit of the lenslets takes over, in proportion to depth.",
    )  # fmt: skip


def _noisy(truth: np.ndarray, operator: Any, rng: np.random.Generator) -> np.ndarray:
    return rng.poisson(operator.forward(truth) + 1.0).astype(np.float32)


def _method(bench: LightFieldMicroscope, operator: Any) -> RichardsonLucy:
    widths = filters.widths_of(bench.sampling_distances(operator.depths), operator.object_grid.pitch[0])
    return RichardsonLucy(filter=filters.LowPass(widths))


def _bead(bench: LightFieldMicroscope, dz: float, context: Context, rng: np.random.Generator) -> np.ndarray:
    """Full widths at half maximum (lateral, axial) [m] of a point reconstructed at a depth."""
    samples, count = (7, 5) if context.quick else (11, 9)
    depths = tuple(dz + (k - count // 2) * STEP for k in range(count))
    operator = bench.operator(depths, samples, pixels=15)
    truth = np.zeros(operator.shape[1], np.float32)
    middle = tuple(n // 2 for n in truth.shape)
    truth[middle] = PHOTONS * samples**2 / 15**2
    found = deconvolve(_noisy(truth, operator, rng), operator, 20, method=_method(bench, operator))
    along = found[:, middle[1] - 2 : middle[1] + 3, middle[2] - 2 : middle[2] + 3].sum((1, 2))
    return np.array([width(found[middle[0], middle[1]], operator.object_grid.pitch[1]), width(along, STEP)])


def width(profile: np.ndarray, step: float) -> float:
    """Full width at half maximum about the highest sample, linear between samples."""
    top, half = int(np.argmax(profile)), float(profile.max()) / 2
    sides = []
    for line in (profile[top:], profile[top::-1]):
        below = np.flatnonzero(line < half)
        k = int(below[0]) if len(below) else len(line) - 1
        fraction = (line[k - 1] - half) / max(line[k - 1] - line[k], 1e-30) if k else 0.0
        sides.append(k - 1 + float(fraction))
    return sum(sides) * step


def _bars(bench: LightFieldMicroscope, context: Context, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Bars as on a USAF-1951 target, of 80 and 160 line pairs per mm, on and off the focused plane."""
    samples, found = (7 if context.quick else 11), {}
    for name, dz in (("0", 0.0), ("25", 25 * um)):
        operator = bench.operator((dz,), samples, pixels=15)
        x = operator.object_grid.x
        rows = np.arange(len(x)) < len(x) // 2
        bars = [(np.floor(2 * x * frequency) % 2 == 0) * (np.abs(x) < 20 * um) for frequency in _FREQUENCIES]
        truth = np.where(rows[:, None], bars[0][None], bars[1][None])[None].astype(np.float32) * 500
        raw = _noisy(truth, operator, rng)
        found[f"truth-{name}"] = truth[0]
        found[f"found-{name}"] = deconvolve(raw, operator, 30, method=_method(bench, operator))[0]
    return found


_FREQUENCIES = (80e3, 160e3)


def _contrast(picture: np.ndarray, truth: np.ndarray, half: int) -> float:
    """Contrast of bars against their own pattern, 1 for a perfect picture."""
    rows = slice(4, picture.shape[0] // 2 - 4) if half == 0 else slice(picture.shape[0] // 2 + 4, -4)
    profile, pattern = picture[rows].mean(0), truth[rows].mean(0)
    lit = np.flatnonzero(pattern)
    inside = (np.arange(len(pattern)) >= lit[0]) & (np.arange(len(pattern)) <= lit[-1])
    high, low = profile[inside & (pattern > 0)].mean(), profile[inside & (pattern == 0)].mean()
    return float((high - low) / (high + low))


def _vesicle(
    bench: LightFieldMicroscope, context: Context, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """A shell of 18 um radius about the focused plane."""
    samples = 3 if context.quick else 5
    depths = tuple(np.arange(-22, 22.1, 4 if context.quick else 2) * um)
    operator = bench.operator(depths, samples, pixels=15)
    grid = operator.object_grid
    radius = np.sqrt(np.asarray(depths)[:, None, None] ** 2 + grid.y[:, None] ** 2 + grid.x**2)
    truth = (200 * np.exp(-(((radius - 18 * um) / (2 * um)) ** 2))).astype(np.float32)
    found = deconvolve(_noisy(truth, operator, rng), operator, 25, method=_method(bench, operator))
    return {"truth": truth, "found": found, "radius": radius}


def _bead_rows(bench: LightFieldMicroscope, depths: tuple[float, ...], widths: list[np.ndarray]) -> list[Row]:
    rows = []
    for dz, (lateral, axial) in zip(depths, widths, strict=True):
        limit = bench.sampling_distances((dz,))[0]
        rows.append(
            Row(
                f"bead at {dz / um:g} um, lateral width", lateral / um, "um", None, limit / um * 1.3,
                limit / um * 0.8, note="1.3 of the sampling distance, as a low-pass leaves it",
            )
        )  # fmt: skip
        rows.append(Row(f"bead at {dz / um:g} um, axial width", axial / um, "um"))
    return rows


def _bar_rows(bars: dict[str, np.ndarray]) -> list[Row]:
    rows = []
    for name in ("0", "25"):
        for half, frequency in enumerate(_FREQUENCIES):
            got = _contrast(bars[f"found-{name}"], bars[f"truth-{name}"], half)
            what = f"contrast of {frequency / 1e3:g} line pairs per mm at {name} um"
            # One sample per lenslet holds 80 line pairs per mm and no more; 25 um off, the limit is 507.
            right, tolerance = (0.9, 0.5) if name == "25" else (0.05, 0.15)
            rows.append(Row(what, got, "", None, right, tolerance))
    return rows


def _vesicle_rows(vesicle: dict[str, np.ndarray]) -> list[Row]:
    found, truth, radius = (vesicle[key] for key in ("found", "truth", "radius"))
    edges = np.arange(8, 28, 0.5) * um
    light = np.histogram(radius, edges, weights=found)[0] / np.maximum(np.histogram(radius, edges)[0], 1)
    top = int(light.argmax())
    near = slice(max(0, top - 5), top + 6)
    weight, middle = light[near] - light[near].min(), (edges[1:] + edges[:-1])[near] / 2
    correlation = float(np.corrcoef(found.ravel(), truth.ravel())[0, 1])
    return [
        Row(
            "vesicle, radius of the shell", float(weight @ middle / weight.sum()) / um, "um", None, 18.0, 1.0
        ),
        Row("vesicle, correlation with the true volume", correlation, "", None, 0.85, (0.15, math.inf)),
    ]


def _width_figure(
    bench: LightFieldMicroscope, depths: tuple[float, ...], widths: list[np.ndarray]
) -> tuple[object, str]:
    lateral, axial = np.array(widths).T / um
    sampling = np.array(bench.sampling_distances(depths)) / um
    near = design.near_field(bench.wavelength, bench.magnification, bench.lenslets.pitch)
    lines = {"lateral width": lateral, "axial width": axial, "sampling distance": sampling}
    caption = (
        f"Full widths at half maximum of beads, and the distance between the lenslets' samples. Within "
        f"{near / um:.0f} um of the focused plane the band limit of Broxton et al. says nothing."
    )
    return curves(np.array(depths) / um, lines, xlabel="depth [um]", ylabel="[um]"), caption


def _bar_figure(bars: dict[str, np.ndarray]) -> tuple[object, str]:
    pictures = [(bars["truth-0"], "bars"), (bars["found-0"], "from 0 um"), (bars["found-25"], "from 25 um")]
    return plots.images(pictures, columns=3), "Bars of 80 (above) and 160 line pairs per mm, reconstructed"


def _vesicle_figure(vesicle: dict[str, np.ndarray]) -> tuple[object, str]:
    found, truth = vesicle["found"], vesicle["truth"]
    z, y = found.shape[0] // 2, found.shape[1] // 2
    pictures = [
        (truth[z], "true, focused plane"), (found[z], "found, focused plane"),
        (truth[:, y], "true, along the axis"), (found[:, y], "found, along the axis"),
    ]  # fmt: skip
    return plots.images(pictures, columns=2), "A vesicle of 18 um radius from one exposure"
