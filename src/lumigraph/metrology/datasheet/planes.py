"""Measures of one picture of a chart: sharpness, size, distortion and depth of its plane."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from scipy.stats import t as student

from lumigraph import depth
from lumigraph.analysis import Chart
from lumigraph.analysis.chart import LEAST_BENT, find_chart
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.raw import RawImage
from lumigraph.core.result import Quantity
from lumigraph.errors import LumigraphError, SamplingError
from lumigraph.instruments import LensletCamera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.metrology.datasheet.charts import ChartExposures
from lumigraph.metrology.datasheet.exposures import mean_image
from lumigraph.metrology.datasheet.sheet import ChartPlane, SheetEntry
from lumigraph.metrology.datasheet.steady import TRUSTED, mean_within, steady, trusted_median, without_strays
from lumigraph.preparation import decode, render
from lumigraph.rendering import refocus
from lumigraph.rendering.kind_check import focused_shift

_MIDDLE = 0.5  # part of the way to the corner up to which the field is called its middle
_LEAST_EDGES = 2
_PATCHES = (0.94, 0.96, 0.98, 1.0, 1.02, 1.04, 1.06)  # over that which depth measures
_HIGH = 0.7
"""Over the length of an edge in samples, the part by which MTF50 and MTF10 may read high: the line spread's
tails lie outside. `benchmarks.edges` finds 0.46 ± 0.24."""
_WHOLE = 0.8  # of the corners of the picture that shows most


@dataclass(frozen=True, slots=True, eq=False)
class FoundDepth:
    """Depth of a raw image: disparities with the views of a camera 1.0, or patches of a camera 2.0."""

    calibration: Calibration
    depth: DepthMap
    views: LightField | None


def measured(ready: PreparedImage, *, rendered: bool) -> FoundDepth:
    """Depth of a raw image, as the verb `depth` measures it for each lenslet.

    Parameters
    ----------
    ready
        The raw image.
    rendered
        Whether it is of a camera 2.0.
    """
    assert ready.calibration is not None  # prepared with a white image
    if rendered:
        return FoundDepth(ready.calibration, depth.correlation(ready, ready.calibration), None)
    views = decode(ready, ready.calibration)
    return FoundDepth(ready.calibration, depth.epi(views), views)


def _pictured(views: LightField, value: float) -> np.ndarray:
    """Picture (y, x) of a camera 1.0 in focus at a disparity."""
    alpha = depth.alpha_of(_one(value, "disparity"), views)
    return grey(refocus(views, float(to_numpy(alpha.values)[0, 0]), oversample=1))


@dataclass(frozen=True, slots=True, eq=False)
class TriedChart:
    """A chart on a picture, its samples from lenslet to lenslet, and those of the patches next to its own."""

    chart: Chart
    lenslet: float = 1.0
    beside: tuple["TriedChart", ...] = ()

    def within(self) -> Chart:
        """The corners that neighbours of their lenslet show, too."""
        return self.chart.within(self.lenslet)

    def swayed(self, value: Callable[["TriedChart"], float]) -> float:
        """Standard deviation of a value, as which patch is right is not known better than to the next one.

        The value is anywhere between what the patches on either side give, none of it likelier.
        """
        own, others = value(self), []
        for one in self.beside:
            with suppress(SamplingError):  # too few corners, of a board at the limit
                others.append(abs(value(one) - own))
        return max(others, default=0.0) / math.sqrt(3)


def straightest(ready: PreparedImage, patch: float, camera: LensletCamera | None) -> TriedChart:
    """The chart on the picture whose patches fit together best, and those of the patches next to that.

    Diffraction biases the patch that depth measures by some per cent. Patches that are too wide or too narrow
    move the corners to and fro within each lenslet's piece of the picture: the patch near the measured one
    where they are straightest is the chart's own.

    Parameters
    ----------
    ready
        The raw image.
    patch
        As depth measured it [px].
    camera
        As `Charts` has it.

    Raises
    ------
    SamplingError
        No picture shows a chart.
    """
    charts = []
    for part in _PATCHES:
        with suppress(SamplingError):
            found = find_chart(rendered_at(ready, part * patch, camera))
            charts.append((TriedChart(found, max(1.0, abs(round(part * patch)))), part))
    if not charts:
        raise SamplingError("no corners of a chessboard are seen. Bring the chart into the picture.")
    most = max(len(one.chart) for one, _ in charts)
    whole = [one for one in charts if len(one[0].chart) > _WHOLE * most]
    told = most >= LEAST_BENT  # fewer corners are straight by chance
    best = min(
        range(len(whole)), key=lambda k: whole[k][0].chart.unevenness if told else abs(whole[k][1] - 1)
    )
    beside = tuple(whole[k][0] for k in (best - 1, best + 1) if 0 <= k < len(whole))
    return replace(whole[best][0], beside=beside)


def rendered_at(ready: PreparedImage, value: float, camera: LensletCamera | None) -> np.ndarray:
    """Picture (y, x) of a camera 2.0 in focus at a patch."""
    assert ready.calibration is not None  # prepared with a white image
    kinds = ready.calibration.lattice.kinds
    focus = camera.patches_on_raw() if kinds > 1 and isinstance(camera, Rendered) else None
    return grey(render(ready, ready.calibration, value, focus=focus))


def grey(picture: Any) -> np.ndarray:
    """Values (y, x) of a picture, the mean of its colours."""
    data = np.asarray(to_numpy(picture), float)
    return data.mean(-1) if data.ndim == 3 else data


def _one(value: float, quantity: str) -> DepthMap:
    return DepthMap(np.array([[value]]), np.ones((1, 1)), quantity)


def plane(
    seen: ChartExposures,
    ready: Callable[[RawImage], PreparedImage],
    camera: LensletCamera | None,
    spacing: float | None,
    *,
    rendered: bool,
) -> ChartPlane:
    """Measures of the pictures of the charts at one distance.

    Parameters
    ----------
    seen
        The charts: the mean of the board's exposures is measured, and the depth of each exposure.
    ready
        Prepares a raw image.
    camera, spacing
        As `Charts` has them.
    rendered
        Whether the raw images are of a camera 2.0.
    """
    board, images = ready(mean_image(seen.boards)), seen.textures or seen.boards
    found = measured(ready(images[0]), rendered=rendered)
    maps = [found.depth, *(measured(ready(one), rendered=rendered).depth for one in islice(images, 1, None))]
    views, value = None if rendered else decode(board, found.calibration), trusted_median(maps)
    entries = _depths(found, maps, seen.depth, camera)
    try:
        if views is None:
            tried = straightest(board, value, camera)
        else:
            tried = TriedChart(find_chart(_pictured(views, value)))
    except SamplingError as error:
        picture = rendered_at(board, value, camera) if views is None else _pictured(views, value)
        return ChartPlane(seen.depth, (*entries, _not("mtf50_middle", error)), picture)
    found_on = (*_sharpness(tried.chart, spacing), *_shape(tried, spacing))
    return ChartPlane(seen.depth, (*found_on, *entries), tried.chart.picture)


def scene(
    ready: PreparedImage, number: int, camera: LensletCamera | None, *, rendered: bool
) -> tuple[list[SheetEntry], np.ndarray | None]:
    """Uncertainty of depth in an unknown scene, and its picture (y, x) in focus at the median depth.

    Parameters
    ----------
    ready
        The raw image.
    number
        Of the scene, for names.
    camera
        For metres; None where it is not known.
    rendered
        Whether it is of a camera 2.0.
    """
    found, name = measured(ready, rendered=rendered), f"depth_noise_of_scene_{number}"
    try:
        value = trusted_median([found.depth])
    except SamplingError as error:
        return [_not(name, error)], None
    picture = rendered_at(ready, value, camera) if found.views is None else _pictured(found.views, value)
    values, unit = ("patches", "px") if rendered else ("disparities", "px/view")
    entries = list(_expected(found.depth, name, f"{values}_of_scene_{number}", unit))
    if camera is not None:
        try:
            metres = _metres(found, [found.depth], camera)[0]
        except LumigraphError as error:
            return [*entries, _not(f"{name}_in_metres", error)], picture
        names = (f"{name}_in_metres", f"depths_of_scene_{number}")
        entries += _expected(metres, *names, "m")
    return entries, picture


def _expected(found: DepthMap, name: str, of_values: str, unit: str) -> Iterator[SheetEntry]:
    """The median of the errors that a map expects, and the range of its values."""
    trust = np.asarray(to_numpy(found.confidence)) >= TRUSTED
    if found.error is None:
        yield _not(name, "the method does not estimate its error")
    else:
        error = float(np.nanmedian(np.asarray(to_numpy(found.error))[trust]))
        how = f"median of the errors that the depth map expects, {trust.mean():.0%} of the places trusted"
        yield SheetEntry("", Quantity(name, error, unit), how)
    low, high = (float(v) for v in found.quantiles(0.05, 0.95))
    yield SheetEntry(
        "", Quantity(of_values, (low, high), unit), "5 % and 95 % of the places, by their confidence"
    )


def _metres(got: FoundDepth, maps: Sequence[DepthMap], camera: LensletCamera) -> list[DepthMap]:
    """Depths [m] from the plane in focus."""
    f, focused = camera.main_lens.focal_length, camera.object_distance
    source = got.calibration if got.views is None else got.views
    return [depth.metric(one, source, focal_length=f, object_distance=focused) for one in maps]


def _not(name: str, error: Exception | str) -> SheetEntry:
    return SheetEntry("", Quantity(name, None), f"not measured: {error}")


def of_chart(tried: TriedChart, spacing: float | None) -> list[Quantity]:
    """Sharpness, size and distortion of a picture of the chart, whose squares are `spacing` wide [m]."""
    return [entry.quantity for entry in (*_sharpness(tried.chart, spacing), *_shape(tried, spacing))]


def is_middle(at: np.ndarray, chart: Chart) -> bool:
    """True if a place (y, x) is in the middle of the picture."""
    middle = (np.array(chart.picture.shape) - 1) / 2
    return bool(np.hypot(*(at - middle)) < _MIDDLE * np.hypot(*middle))


def _sharpness(chart: Chart, spacing: float | None) -> list[SheetEntry]:
    """MTF50 and MTF10 in the middle and towards the border, on the chart if its spacing is known."""
    per, unit = (1.0, "cycles/sample") if spacing is None else (chart.spacing / spacing, "1/m")
    found: dict[tuple[int, str], list[float]] = {}
    for at, edge in chart.edges():
        zone = "middle" if is_middle(at, chart) else "border"
        for percent in (50, 10):
            if (edge.mtf < percent / 100).any():
                found.setdefault((percent, zone), []).append(edge.at(percent / 100) * per)
    entries = []
    for percent, zone in ((50, "middle"), (50, "border"), (10, "middle"), (10, "border")):
        name, values = f"mtf{percent}_{zone}", found.get((percent, zone), [])
        if len(values) < _LEAST_EDGES:
            width = f"squares are {chart.spacing:.3g} samples wide"
            entries.append(_not(name, f"{len(values)} edges there, {_LEAST_EDGES} are needed; {width}"))
            continue
        near = without_strays(values)
        value, interval = mean_within(near)
        if interval is not None:
            interval = (interval[0] - _HIGH / chart.edge_length * value, interval[1])
        how = (
            f"mean over {len(near)} slanted edges of the chart, {chart.edge_length} samples long, "
            "ISO 12233, pixels' blur included"
        )
        if strays := len(values) - len(near):
            how += f"; {strays} far off the others left out"
        entries.append(SheetEntry("", Quantity(name, value, unit, interval), how))
    return entries


def _shape(tried: TriedChart, spacing: float | None) -> list[SheetEntry]:
    """Size and distortion, by the corners that neighbours of their lenslet show, too."""
    entries, chart, inside = [], tried.chart, tried.within()
    if spacing is not None and len(inside) >= LEAST_BENT:
        value, error = spacing / inside.spacing, inside.spacing_error / inside.spacing
        sway = tried.swayed(lambda one: math.log(one.within().spacing / one.lenslet))
        part = _half(error, 2 * len(inside) - 6, sway)
        how = f"width of the chart's squares over that of their picture, {len(inside)} corners"
        ends = (value * (1 - part), value * (1 + part))
        entries.append(SheetEntry("", Quantity("sample_on_chart", value, "m", ends), how))
    elif spacing is not None:
        how = f"width of the chart's squares over that of their picture, {len(chart)} corners"
        entries.append(SheetEntry("", Quantity("sample_on_chart", spacing / chart.spacing, "m"), how))
    try:
        bent, error = inside.distortion()
    except SamplingError as problem:
        return [*entries, _not("distortion", problem)]
    half = _half(error, 2 * len(inside) - 9, tried.swayed(lambda one: one.within().distortion()[0]))
    interval = (100 * (bent - half), 100 * (bent + half))
    how = f"radial, at the picture's corner, over the distance from its middle; {len(inside)} corners"
    return [*entries, SheetEntry("", Quantity("distortion", 100 * bent, "%", interval), how)]


def _half(error: float, freedom: int, sway: float) -> float:
    """Half width of a 95 % interval, by the deviation of few corners (Student's t) and other variation."""
    return math.hypot(float(student.ppf(0.975, max(freedom, 1))) * error, 1.96 * sway)


def _depths(
    got: FoundDepth, maps: Sequence[DepthMap], true: float | None, camera: LensletCamera | None
) -> list[SheetEntry]:
    """Virtual depth and metres: what was found, its error and its noise."""
    name = "disparity" if got.views is not None else "patch"
    unit = "px/view" if name == "disparity" else "px"
    entries = steady(maps, name, unit)
    if camera is None:
        return entries
    if true is not None and isinstance(camera, Rendered):
        expected = camera.patch_at(true)
    elif true is not None and got.views is not None:
        alpha = _one(camera.alpha(true), "alpha")
        expected = float(to_numpy(depth.disparity_of(alpha, got.views).values)[0, 0])
    else:
        expected = math.nan
    if not math.isnan(expected):
        how = f"{name} measured less that of the camera file at the chart's depth"
        entries.append(_less(entries[0], f"{name}_error", expected, how))
    try:
        metres = _metres(got, maps, camera)
    except LumigraphError as error:
        return [*entries, _not("depth", error)]
    found = steady(metres, "depth", "m")
    if true is not None and found[0].value is not None:
        how = "depth by the camera file's lengths, less where the chart stood"
        found.append(_less(found[0], "depth_error", true, how))
    return entries + found


def _less(entry: SheetEntry, name: str, reference: float, how: str) -> SheetEntry:
    q = entry.quantity
    if q.value is None:
        return _not(name, entry.how)
    ends = None if q.interval is None else (q.interval[0] - reference, q.interval[1] - reference)
    return SheetEntry("", Quantity(name, q.value - reference, q.unit, ends), how, entry.repeats)


def is_rendered(camera: LensletCamera | None, ready: PreparedImage) -> bool:
    """True if raw images are of a camera 2.0: by the camera file, or by the picture itself."""
    if camera is not None:
        return isinstance(camera, Rendered)
    assert ready.calibration is not None  # prepared with a white image
    return focused_shift(ready.data, ready.calibration) is not None
