"""`lumigraph sweep`: what follows from a camera's description, for every combination of some values."""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.batch import TABLES, WorkerOptions, kept, require_table, save_table
from lumigraph.cli.console import line, progress
from lumigraph.cli.options import Output
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.cli.standing import StatusPage
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError, LumigraphError

if TYPE_CHECKING:
    from lumigraph.cluster import Values
    from lumigraph.instruments import Instrument
    from lumigraph.io.tables import Axes

_CURVES = 60
"""Quantities that a report draws at most."""

_ERROR = "error"


def sweep(
    camera: str,
    /,
    *,
    vary: Annotated[list[str], Parameter(allow_leading_hyphen=True)],
    measure: str | None = None,
    output: Output,
    workers: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None,
    common: ReportOptions = REPORTED,
) -> Result:
    """Vary a camera's values and write the quantities of each combination into a table.

    Quantities are the closed forms that 'lumigraph design' prints and, for plenoptic cameras, measures on a
    simulated picture of a chessboard. An impossible combination becomes a row with the reason.
    Safe to interrupt: run the same command again to resume.

    Example: `lumigraph sweep thesis-plenoptic-2-m050 --vary "lenslets.focal_length=4 mm:6 mm:9" --vary "lenslets.magnification=0.3,0.5" --measure "views per axis, lateral resolution" -o table.csv`

    Parameters
    ----------
    camera
        Camera file (TOML), or the name of a bundled one.
    vary
        A key of the camera file and its values: 'first:last:count', or several, separated by commas. Of a
        list such as a tilt, a number is the value's place: 'built.array_tilt.0=-2 mrad:2 mrad:3'.
        May be repeated: every combination is computed.
    measure
        Names of quantities as 'lumigraph design' prints them, separated by commas; all if left out. Simulated:
        mtf@10/mm (contrast at 10 cycles per mm of the object), mtf50_middle, mtf10_middle, mtf50_border,
        mtf10_border, sample_on_chart, distortion.
    output
        Table (.csv, or .parquet with pyarrow), or NetCDF (.nc) whose axes are the varied keys, which xarray
        opens; lengths in metres.
    workers
        Processes on this machine; one for each processor if left out.
    """  # noqa: E501 - an example is one line
    from lumigraph import cluster
    from lumigraph.instruments import load_camera
    from lumigraph.instruments.varied import changed, combinations, values

    common.check()
    files.check_output(output, (*TABLES, ".nc"))
    given, varied = load_camera(anywhere(camera)), dict(map(values, vary))
    if len(varied) < len(vary):
        raise FormatError("--vary names a key twice. Give all its values at once.")
    items = combinations(varied)
    axes = axes_of(varied)
    require_table(output, axes)
    changed(given, items[0])  # an unknown key is refused before any work
    names = _names(measure, [row.name for row in given.quantities()])
    check_measures(given, names)
    with progress("sweep") as shown, kept(output):
        text = given.to_toml()
        found = cluster.batch(
            Designs(text, tuple(names)), items, output,
            what={"camera": text, "measure": names}, inputs=cluster.inputs.named_in(text),
            workers=WorkerOptions(workers).cluster(), progress=StatusPage(output, shown),
            estimated=lambda needed: line(str(needed)),
        )  # fmt: skip
    save_table(output, axes)
    if found.failures:
        number, why = min(found.failures.items())
        raise LumigraphError(f"{len(found.failures)} of {found.count} failed; number {number}: {why}")
    rows = [entry.values for _, entry in sorted(found.entries.items())]
    return _result(rows, list(varied), names, output)


def anywhere(camera: str) -> str:
    """A camera file by a path that does not depend on the folder, in which workers may differ; or a name."""
    return str(Path(camera).absolute()) if Path(camera).exists() else camera


@dataclass(frozen=True)
class Designs:
    """Quantities of a camera with changed values.

    Parameters
    ----------
    camera
        Text of a camera file: what the file holds later does not matter.
    names
        Names of the quantities.
    """

    camera: str
    names: tuple[str, ...]

    def __call__(self, item: Mapping[str, Any]) -> "Values":
        """The values, and the quantities or why no camera has those values."""
        from lumigraph.cluster import Values
        from lumigraph.instruments.loading import camera_of
        from lumigraph.instruments.varied import changed

        try:
            camera = changed(camera_of(tomllib.loads(self.camera), "the camera file"), item)
            known = {row.name: row for row in (*camera.quantities(), *self._simulated(camera))}
        except LumigraphError as error:
            return Values({**item, _ERROR: " ".join(str(error).split())})
        return Values(
            {
                **item,
                **{_column(known[name]): _plain(known[name].value) for name in self.names if name in known},
            }
        )

    def _simulated(self, camera: "Instrument") -> "Iterable[Quantity]":
        """Quantities measured on a simulated picture."""
        from lumigraph import metrology
        from lumigraph.core.cache import SHARED
        from lumigraph.metrology.datasheet.charts import check_camera

        names = [name for name in self.names if metrology.is_measure(name)]
        if not names:
            return ()
        try:
            return metrology.simulated(check_camera(camera), names).values()
        finally:
            SHARED.empty()  # the next camera is another one


def axes_of(varied: Mapping[str, list[Any]]) -> "Axes":
    """The varied keys as axes of a table; lengths are places in metres."""
    from lumigraph.io.tables import Axes
    from lumigraph.units import parse

    places = {}
    for name, some in varied.items():
        if all(isinstance(value, str) for value in some):
            try:
                places[name] = [parse(value) for value in some]
            except FormatError:  # words, or another dimension
                continue
    return Axes(varied, places)


def _names(measure: str | None, known: Sequence[str]) -> list[str]:
    """Requested quantities."""
    if measure is None:
        return list(known)
    from lumigraph.metrology import is_measure

    names = [name.strip() for name in measure.split(",")]
    for name in names:
        if name not in known and not is_measure(name):
            near = get_close_matches(name, known, 3, 0.4)
            hint = f" Did you mean {', '.join(map(repr, near))}?" if near else ""
            raise FormatError(f"--measure names {name!r}, which 'lumigraph design' does not print.{hint}")
    return names


def check_measures(camera: "Instrument", names: Sequence[str]) -> None:
    """Refuse measures on simulated pictures of cameras that have none."""
    from lumigraph.metrology import is_measure
    from lumigraph.metrology.datasheet.charts import check_camera

    if any(map(is_measure, names)):
        check_camera(camera)


def _column(row: Any) -> str:
    return f"{row.name} [{row.unit}]" if row.unit else row.name


def _plain(value: Any) -> Any:
    return " x ".join(map(str, value)) if isinstance(value, tuple | list) else value


def _result(rows: list[dict[str, Any]], varied: list[str], names: list[str], output: Path) -> Result:
    bad = [row for row in rows if _ERROR in row]
    lines = [f"{len(rows)} combinations of {', '.join(varied)}"]
    lines += [f"{len(bad)} of them no camera can have, such as: {bad[0][_ERROR]}"] if bad else []
    counts = (Quantity("combinations", len(rows)), Quantity("impossible", len(bad)))
    return Result(
        "Sweep", "What follows from a camera's description as its values vary.", rows, tuple(lines), counts,
        lambda: _figures(rows, varied, names), written=(output,),
    )  # fmt: skip


def _figures(rows: list[dict[str, Any]], varied: list[str], names: list[str]) -> "Iterator[Figure]":
    """A curve of each quantity over the first value, one for each combination of the others."""
    from lumigraph import plots

    good = [row for row in rows if _ERROR not in row]
    columns = [name for name in (good[0] if good else {}) if name.partition(" [")[0] in names][:_CURVES]
    for column in columns:
        curves: dict[str, tuple[list[float], list[float]]] = {}
        unit = ""
        for row in good:
            place = re.fullmatch(r"([-+\d.eE]+)\s*(.*)", str(row[varied[0]]))
            if place is not None and isinstance(row.get(column), int | float):
                label = ", ".join(f"{name} {row[name]}" for name in varied[1:])
                xs, ys = curves.setdefault(label, ([], []))
                xs.append(float(place[1]))
                ys.append(float(row[column]))
                unit = f" [{place[2]}]" if place[2] else ""
        if any(len(xs) > 1 for xs, _ in curves.values()):
            drawn = plots.curves([], curves, xlabel=f"{varied[0]}{unit}", ylabel=column)
            yield Figure(drawn, f"{column} over {varied[0]}.", "Curves")
