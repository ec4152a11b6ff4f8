"""`lumigraph tolerance`: effects of manufacturing tolerances on a camera."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.batch import TABLES, WorkerOptions, kept, require_table, save_table
from lumigraph.cli.console import line, progress
from lumigraph.cli.options import Output
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.cli.standing import StatusPage
from lumigraph.cli.sweep import anywhere
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError, LumigraphError

if TYPE_CHECKING:
    from lumigraph.studies.tolerance.outcome import ToleranceOutcome
    from lumigraph.studies.tolerance.study import Study

Tolerances = Annotated[
    list[str] | None, Parameter(name=("--tolerance", "-t"), allow_leading_hyphen=True, negative="")
]
"""Option of keys and tolerances."""

ALONE = WorkerOptions()

_POINTS = 200
"""Most points of a drawn curve."""

_SHOWN = 3
"""Tolerances that a line names."""


def tolerance(
    camera: str,
    /,
    *,
    tolerance: Tolerances = None,
    draws: Annotated[int, Parameter(name=("--draws", "-n"), allow_leading_hyphen=True)] = 1000,
    measure: str | None = None,
    seed: Annotated[int, Parameter(allow_leading_hyphen=True)] = 0,
    output: Output,
    hands: WorkerOptions = ALONE,
    common: ReportOptions = REPORTED,
) -> Result:
    """Draw cameras with manufacturing errors, and rank the tolerances by their effect.

    Each drawn camera is built with errors and not readjusted, so that its plane of focus moves. Each measure
    gets its mean and deviation over the cameras drawn, and the share of each tolerance by first-order
    sensitivities. Safe to interrupt: run the same command again to resume.

    Example: `lumigraph tolerance thesis-plenoptic-2-m050 -t "separation=±0.05 mm" -t "lenslets.focal_length=±1 %" -t "lenslets.pitch=±0.1 um uniform" -o draws.csv`

    Example: `lumigraph tolerance camera.toml --draws 200 --measure "focus shift, mtf50_middle" -o draws.csv --report tolerances.html`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one: a plenoptic camera 1.0 or 2.0. Its table
        [tolerances] counts.
    tolerance
        A key of the camera file and how far it may be off, such as "separation=±0.05 mm" or
        "lenslets.focal_length=±1 % uniform"; +- will do. Normal errors keep to it in 95 % of all cameras,
        uniform ones in all. Lenslets that differ from each other: "lenslets.each.focal_length=±1 %",
        "lenslets.each.decentre=±2 um", "lenslets.each.tilt=±1 mrad" (with their index in the camera file),
        "lenslets.each.form=±20 nm" (rms path), "lenslets.each.missing=0.2 %". Tilts and bow: "array_tilt_y=±1 mrad",
        array_tilt_x, array_bow (a length, at the corners), sensor_tilt_y, sensor_tilt_x. May be repeated.
    draws
        Cameras drawn.
    measure
        Names of quantities, separated by commas: those that 'lumigraph design' prints, focused distance,
        focus shift, depth error, blur at the object, blur behind a lenslet, lenslets that see a point,
        micro-image fill, corner shift y, corner shift x, corner focus shift, corner depth error, lenslet focus shift, light of a point, lenslet Strehl ratio,
        and the simulated ones of 'lumigraph sweep'.
    seed
        Seed of all random values.
    output
        Table of the cameras (.csv, or .parquet with pyarrow); that of the tolerances is written beside it,
        as NAME-tolerances.
    """  # noqa: E501 - an example is one line
    from lumigraph import cluster
    from lumigraph.instruments import load_camera
    from lumigraph.studies.tolerance.making import check_camera
    from lumigraph.studies.tolerance.study import Study
    from lumigraph.studies.tolerance.trials import ToleranceTrials

    common.check()
    hands.check()
    files.check_output(output, TABLES)
    require_table(output)
    names = None if measure is None else [name.strip() for name in measure.split(",")]
    trials = ToleranceTrials.of(
        check_camera(load_camera(anywhere(camera))), given_tolerances(tolerance or []), names, seed=seed
    )
    items = trials.items(draws)
    if hands.slurm is not None:
        return hands.submitted(output)
    with progress("tolerance") as shown, kept(output):
        found = cluster.batch(
            trials, items, output, what=trials.what, inputs=cluster.inputs.named_in(trials.camera),
            workers=hands.cluster(), part=hands.share(),
            progress=StatusPage(output, shown), estimated=lambda needed: line(str(needed)),
        )  # fmt: skip
    save_table(output)
    if found.failures:
        number, why = min(found.failures.items())
        raise LumigraphError(f"{len(found.failures)} of {found.count} failed; number {number}: {why}")
    if not found.is_whole:
        return _partly(found, output)
    with cluster.rows(output) as rows:
        study = Study.of(trials, rows)
    return _result(study, output)


def given_tolerances(texts: list[str]) -> dict[str, str]:
    """Keys and tolerances of an option."""
    given: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise FormatError(f"--tolerance is {text!r} but must be like 'separation=±0.05 mm'.")
        if name in given:
            raise FormatError(f"--tolerance names {name} twice. Give it once.")
        given[name] = value
    return given


def _partly(found: Any, output: Path) -> Result:
    told = f"{found.stand} are done; the last part reports the results"
    return Result("Tolerances", "A part of the cameras.", None, (told,), written=(output,))


def _result(study: "Study", output: Path) -> Result:
    from lumigraph.io import tables

    beside = output.with_name(f"{output.stem}-tolerances{output.suffix}")
    tables.save(beside, study.rows())
    counts = (Quantity("cameras", study.draws), Quantity("impossible", len(study.failures)))
    words = [f"{study.draws} cameras drawn with {len(study.names)} tolerances"]
    words += [_line(one, study.names) for one in study.outcomes]
    about = "Effects of manufacturing tolerances on a camera, ranked."
    return Result(
        "Tolerances", about, study, tuple(words), (*counts, *study.quantities()),
        lambda: _figures(study), tuple(study.notes()), (output, beside), {"tolerances": study.rows()},
    )  # fmt: skip


def _line(one: "ToleranceOutcome", names: tuple[str, ...]) -> str:
    """One measure: where most cameras are, how far they are from each other, and what that costs most."""
    if not one.changes:
        return f"{one.name}: {_text(one, one.nominal)}, which these errors do not change"
    (low, _), (high, _) = one.percentile(2.5), one.percentile(97.5)
    shares = [f"{name} {share:.0%}" for name, share in one.ranked(names)[:_SHOWN] if share >= 0.005]
    paid = f", by {', '.join(shares)}" if shares else ""
    return (
        f"{one.name}: {_text(one, one.nominal)} as described, 95 % of cameras {_text(one, low)} to "
        f"{_text(one, high)}, deviation {_text(one, one.deviation)} (first order "
        f"{_text(one, one.first_order)}{paid})"
    )


def _text(one: "ToleranceOutcome", value: float) -> str:
    from lumigraph.instruments import Row

    if abs(value) < 1e-9 * one.deviation:
        return "0"
    size, unit = Row(one.name, max(abs(value), 1e-3 * one.deviation), one.unit).scale
    return f"{value / size:.3g} {unit}".rstrip()


def _figures(study: "Study") -> Iterator[Figure]:
    """Figures of each measure: cost of each tolerance, and the share of cameras below a value."""
    from lumigraph import plots

    for one in study.outcomes:
        if not one.changes:
            continue
        mine = [row for row in study.rows() if row["measure"] == one.name]
        rows = [("tolerance", "range", "effect of one deviation", "share", "deviation if halved")]
        rows += [
            (row["tolerance"], row["range"], _text(one, row["effect"]), f"{row['share']:.1%}",
             _text(one, row["deviation if halved"]))
            for row in mine
        ]  # fmt: skip
        yield Figure(rows, section=one.name)
        size, unit = _scale(one)
        label = f"{one.name} [{unit}]" if unit else one.name
        drawn = plots.curves([], _curves(one, size), xlabel=label, ylabel="part of the cameras below")
        yield Figure(drawn, f"{one.name} of {len(one.sample)} cameras, and to first order.", one.name)


def _scale(one: "ToleranceOutcome") -> tuple[float, str]:
    from lumigraph.instruments import Row

    return Row(one.name, max(abs(one.nominal), 3 * one.deviation), one.unit).scale


def _curves(one: "ToleranceOutcome", size: float) -> dict[str, tuple[Any, Any]]:
    import numpy as np
    from scipy.special import ndtr

    count = len(one.sample)
    picked = np.unique(np.linspace(0, count - 1, min(count, _POINTS)).round().astype(int))
    places, parts = np.sort(one.sample)[picked] / size, (picked + 0.5) / count
    along = np.linspace(places[0], places[-1], _POINTS)
    curves: dict[str, tuple[Any, Any]] = {"cameras drawn": (places, parts)}
    if one.first_order:
        curves["first order"] = (along, ndtr((along - one.nominal / size) / (one.first_order / size)))
    return curves
