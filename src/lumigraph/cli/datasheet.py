"""`lumigraph datasheet`."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lumigraph.cli.console import progress
from lumigraph.cli.files import check_output
from lumigraph.cli.options import COMMON, Common, Output, lengths
from lumigraph.cli.reporting import page
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.progress import Progress
    from lumigraph.metrology import Charts, SheetEntry
    from lumigraph.metrology.datasheet.sheet import ChartPlane, Sheet

_WIDTH = 320  # px of the page that a picture takes
_MOST = 3  # cameras side by side
_NONE = "not measured"


def datasheet(
    sources: Annotated[tuple[str, ...], Parameter(negative="")],
    /,
    *,
    camera: str | None = None,
    depth: Annotated[list[str] | None, Parameter(negative="", allow_leading_hyphen=True)] = None,
    exposures: int | None = None,
    seed: int = 1,
    accuracy: float = 1e-2,
    charts: Path | None = None,
    output: Output | None = None,
    common: Common = COMMON,
) -> Result:
    """Write the data sheet of a plenoptic camera: resolution, directions, depth, light and geometry.

    SOURCES are folders of raw images, or camera files, whose charts are simulated by wave optics and measured
    in the same way; several are compared side by side. A folder has a charts.toml that names its pictures,
    several exposures of each chart (see the page on metric cameras), or white images and scenes,
    distinguished by "white" and "dark" in their names.

    Example: `lumigraph datasheet camera.toml -o sheet.html`

    Example: `lumigraph datasheet bench/ --camera camera.toml -o sheet.html`

    Example: `lumigraph datasheet thesis-plenoptic-1 thesis-plenoptic-2-m050 -o both.html`

    Parameters
    ----------
    sources
        Folders, camera files, or names of the catalogue.
    camera
        Camera file of the folders' pictures: depths in metres, and limits.
    depth
        Depths of simulated charts, from the plane in focus, such as '-5 mm, 0 mm' or '-5 mm:5 mm:5 mm'; five
        distances over what the camera refocuses if left out.
    exposures
        Exposures of each simulated chart, white and dark image; 16, or fewer for a large sensor. The sheet
        states the difference of two such sets, and the number of exposures for 2 %.
    seed
        Seed of the simulated sensor's noise.
    accuracy
        Accuracy of simulated charts, relative rms, 1e-2 to 1e-5.
    charts
        Folder to write the simulated raw images into, as a laboratory would take them; for one camera file.
    output
        Page to write (.html).
    """
    if output is not None:
        check_output(output, (".html", ".htm"))
    if not 1 <= len(sources) <= _MOST:
        raise FormatError(f"there are {len(sources)} cameras. Give one to {_MOST}, side by side.")
    simulated = [source for source in sources if not Path(source).is_dir()]
    if charts is not None and (len(sources) > 1 or not simulated):
        raise FormatError("--charts takes the pictures of one camera file. Give that alone.")
    planes = lengths("--depth", depth) or None
    sheets, written = [], []
    from lumigraph import metrology

    for source in sources:
        with progress(f"data sheet of {source}") as tell:
            found = _charts(source, camera, (planes, accuracy, exposures), seed, tell)
            if charts is not None:
                written += metrology.save_charts(found, charts)
            sheets.append(metrology.datasheet(found))
    result = _result(_distinct(sheets), written)
    if output is None:
        return result
    page(result).write(output)
    return replace(result, written=(*result.written, output))


def _charts(
    source: str,
    camera: str | None,
    how: tuple[list[float] | None, float, int | None],
    seed: int,
    tell: "Progress",
) -> "Charts":
    import numpy as np

    from lumigraph import metrology
    from lumigraph.instruments import load_camera
    from lumigraph.metrology.datasheet.charts import check_camera

    if Path(source).is_dir():
        return metrology.read_charts(source, None if camera is None else check_camera(load_camera(camera)))
    rng, name = np.random.default_rng(seed), Path(source).stem
    one = check_camera(load_camera(source))
    depths, accuracy, exposures = how
    return metrology.simulate_charts(
        one, depths, name=name, rng=rng, exposures=exposures, accuracy=accuracy, progress=tell
    )


def _distinct(sheets: "Sequence[Sheet]") -> "list[Sheet]":
    """Sheets whose names differ."""
    names = [sheet.name for sheet in sheets]
    return [
        replace(sheet, name=f"{sheet.name} ({k})") if names.count(sheet.name) > 1 else sheet
        for k, sheet in enumerate(sheets, 1)
    ]


def _result(sheets: "list[Sheet]", written: list[Path]) -> Result:
    names = " and ".join(sheet.name for sheet in sheets)
    rows = [row for sheet in sheets for row in sheet.rows()]
    limits = {sheet.name: [list(row) for row in sheet.limits] for sheet in sheets}
    notes = [f"{sheet.name}: {note}" for sheet in sheets for note in sheet.notes]
    return Result(
        f"Data sheet: {names}",
        "Measured on white images and charts. Intervals hold the value with 95 % probability as far as noise "
        "and scatter over the picture tell; each line says how it was measured, or why it was not.",
        sheets, tuple(_lines(sheets)), figures=lambda: _figures(sheets), notes=tuple(notes),
        written=tuple(written), extra={"entries": rows, "limits": limits},
    )  # fmt: skip


def _lines(sheets: "list[Sheet]") -> Iterator[str]:
    for sheet in sheets:
        yield sheet.name
        for one in sheet.entries:
            text = one.text if one.value is not None else one.how
            yield f"  {one.section:<16} {one.label:<26} {text}"


def _figures(sheets: "list[Sheet]") -> Iterable[Figure]:
    from lumigraph import plots

    for section in dict.fromkeys(one.section for sheet in sheets for one in sheet.entries):
        yield Figure(_table(sheets, section), section=section)
        if section == "Resolution" and (curve := _over_depth(sheets)):
            text = "Half contrast in the middle of the picture, over the charts' distances from the focus."
            yield Figure(
                plots.curves([], curve, xlabel="chart [mm from the focus]", ylabel="MTF50"), text, section
            )
        if section == "Directions":
            lines = {sheet.name: sheet.profile for sheet in sheets if sheet.profile is not None}
            if lines:
                text = "Mean light from the middle of a micro-image to the middle of the next one."
                curve = plots.curves([], lines, xlabel="along the row [px]", ylabel="light over the middle's")
                yield Figure(curve, text, section)
    for sheet in sheets:
        if sheet.planes:
            yield Figure(_planes(sheet.planes), section=f"Charts of {sheet.name}")
            yield from _pictures(sheet)
        for k, picture in enumerate(sheet.scenes, 1):
            if picture is not None:
                caption = f"Scene {k}, in focus at its median depth."
                yield Figure(picture, caption, f"Scenes of {sheet.name}", _zoom(picture))
        if sheet.limits:
            rows = [["limit", "value", "by"], *map(list, sheet.limits)]
            yield Figure(rows, section=f"Limits of {sheet.name}, by ray and wave optics")


def _table(sheets: "list[Sheet]", section: str) -> list[list[str]]:
    """Quantities down, cameras across, how each was measured last."""
    entries = [{e.quantity.name: e for e in s.entries if e.section == section} for s in sheets]
    names = dict.fromkeys(name for one in entries for name in one)
    rows = [["quantity", *(sheet.name for sheet in sheets), "how"]]
    for name in names:
        found = [one.get(name) for one in entries]
        label = next(one.label for one in found if one is not None)
        rows.append([label, *(_NONE if one is None else one.text for one in found), _how(sheets, found)])
    return rows


def _how(sheets: "list[Sheet]", found: "Sequence[SheetEntry | None]") -> str:
    """Method by which a quantity was measured, camera by camera if methods differ."""
    told = {sheet.name: one.how for sheet, one in zip(sheets, found, strict=True) if one is not None}
    if len(told) == 1 or len(set(told.values())) == 1:
        return next(iter(told.values()))
    return "; ".join(f"{name}: {how}" for name, how in told.items())


_COLUMNS = (
    "mtf50_middle", "mtf50_border", "mtf10_middle", "disparity", "disparity_noise", "patch", "patch_noise",
    "depth_error", "depth_noise", "distortion", "sample_on_chart",
)  # fmt: skip


def _planes(planes: "Sequence[ChartPlane]") -> list[list[str]]:
    """Measures down, distances of the charts across."""
    rows = [["chart at", *(plane.label for plane in planes)]]
    for name in _COLUMNS:
        found = [next((e for e in plane.entries if e.quantity.name == name), None) for plane in planes]
        if known := [one for one in found if one is not None and one.value is not None]:
            rows.append([known[0].label, *(_NONE if one is None else one.text for one in found)])
    return rows


def _over_depth(sheets: "list[Sheet]") -> dict[str, tuple[list[float], list[float]]]:
    curves = {}
    for sheet in sheets:
        known = [
            (plane.depth, one.value)
            for plane in sheet.planes for one in plane.entries
            if plane.depth is not None and one.quantity.name == "mtf50_middle" and one.value is not None
        ]  # fmt: skip
        if len(known) > 1:
            on_chart = sheet.planes[0].entries[0].quantity.unit == "1/m"
            scale, unit = (1e-3, "lp/mm") if on_chart else (1.0, "cycles/sample")
            curves[f"{sheet.name} [{unit}]"] = [1e3 * z for z, _ in known], [scale * v for _, v in known]
    return curves


def _pictures(sheet: "Sheet") -> Iterator[Figure]:
    shown = [plane for plane in sheet.planes if plane.picture is not None]
    for plane in shown[:: max(1, len(shown) // 3)]:
        caption = f"The chart at {plane.label} from the focus, as it was measured."
        yield Figure(plane.picture, caption, f"Charts of {sheet.name}", _zoom(plane.picture))


def _zoom(picture: Any) -> dict[str, Any]:
    """Pictures of few lenslets are stamps: each sample as a square that can be seen."""
    return {"zoom": max(1, _WIDTH // max(picture.shape))}
