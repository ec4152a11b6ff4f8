"""`datasheet`: properties of a plenoptic camera, measured on its white images and on charts."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice, pairwise
from typing import Any

import numpy as np

from lumigraph.analysis import photon_transfer, pupil_edge
from lumigraph.analysis.pupil_edge import PupilEdge
from lumigraph.calibration import calibrate
from lumigraph.calibration.fitting import Fitted
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.core.result import Quantity
from lumigraph.errors import CalibrationError, LumigraphError
from lumigraph.instruments import LensletCamera
from lumigraph.metrology.boards.places import pitch_and_rotation, places, residual
from lumigraph.metrology.datasheet import planes, steady
from lumigraph.metrology.datasheet.charts import ChartExposures, Charts
from lumigraph.metrology.datasheet.exposures import mean_image
from lumigraph.metrology.datasheet.planes import is_rendered, scene
from lumigraph.metrology.datasheet.sheet import ChartPlane, Sheet, SheetEntry
from lumigraph.metrology.datasheet.stability import stability
from lumigraph.preparation import decode, prepare, render
from lumigraph.rendering import refocus

GRID, LIGHT, DIRECTIONS, RESOLUTION, DEPTH, GEOMETRY = (
    "Micro-images", "Light and noise", "Directions", "Resolution", "Depth", "Geometry"
)  # fmt: skip

LIMITS = (
    "picture cut-off", "picture cut-off at the object", "rendered cut-off", "rendered cut-off at the object",
    "cut-off at the object", "lenslet cut-off", "lenslet Airy radius", "Airy radius", "resolvable directions",
    "pixels per micro-image", "views per axis", "directions per axis", "lateral resolution", "depth of field",
    "refocus range", "cross-talk",
)  # fmt: skip
"""Rows of a camera's `quantities` that bound what can be measured."""

NO_CHART = "there is no picture of a chart"

_PAIRS = 8
"""Pairs of white images whose noise is measured."""

_KEPT = 0.5
"""Part of the best MTF50 that the ends of the refocus range keep."""


def datasheet(charts: Charts, *, progress: Progress = silent) -> Sheet:
    """A camera's data sheet, each number with its 95 % interval and how it was measured.

    Simulated and real pictures take the same way: a lattice from the white image, raw images prepared,
    decoded or rendered as the verbs do, and measured on the pictures. What cannot be measured says why.

    Parameters
    ----------
    charts
        `read_charts` or `simulate_charts` gives them.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    CalibrationError
        The white image shows no lattice, or no more light than the dark one.

    References
    ----------
    EMVA Standard 1288, release 4.0 linear, for light and noise; ISO 12233:2023 for resolution; VDI/VDE 2634,
    part 2, for depth: a plane at several distances, its mean error and the scatter about it.
    """
    white, dark = mean_image(charts.whites), mean_image(charts.darks) if charts.darks else None
    bare = np.asarray(to_numpy(white.data), float) - (0.0 if dark is None else np.asarray(dark.data))
    if bare.mean() <= 0:
        raise CalibrationError("the white image is no brighter than the dark image. Check which is which.")
    camera = charts.camera
    lattice, grid = _grid(white, _lattice(white, camera), charts.whites)
    steps = len(charts.boards) + len(charts.scenes) + 2
    progress(1 / steps)

    def ready(raw: RawImage) -> PreparedImage:
        return prepare(raw, lattice, white=white, dark=dark, camera=camera)

    first = next((one.boards[0] for one in charts.boards), next(iter(charts.scenes), None))
    rendered = is_rendered(camera, ready(first)) if first is not None else camera is not None and is_rendered(
        camera, ready(white)
    )  # fmt: skip
    edge, edge_entries = _edges(bare, lattice)
    entries = [*grid, *_vignetting(lattice), *_light(charts), *edge_entries]
    found: list[ChartPlane] = []
    for k, seen in enumerate(charts.boards, 2):
        found.append(_plane(seen, ready, camera, charts.spacing, rendered=rendered))
        progress(k / steps)
    found.sort(key=lambda one: math.inf if one.depth is None else one.depth)
    scenes = []
    for k, raw in enumerate(charts.scenes, 1):
        told, picture = scene(ready(raw), k, camera, rendered=rendered)
        entries += [SheetEntry(DEPTH, one.quantity, one.how) for one in told]
        scenes.append(picture)
        progress((1 + len(found) + k) / steps)
    entries += [*_resolution(found), *_of_depth(found), *_geometry(found)]
    if rendered:
        entries += _times_seen(found, lattice)
    pairs = ((ready(one), ready(other)) for one, other in _pairs(charts.whites))
    entries += _picture_noise(pairs, camera, rendered=rendered)
    entries += stability(charts.whites, lattice)
    profile = None if edge is None else (edge.position, edge.profile)
    limits = () if camera is None else tuple(_limits(camera))
    notes = [f"lattice: {note}" for note in lattice.notes]
    if camera is None:
        notes.append(
            "the camera's lengths are not known: depths are in pixels. Give a camera file for metres"
        )
    if charts.boards and charts.spacing is None:
        notes.append("the chart's spacing is not known: resolution is in cycles per sample of the picture")
    return Sheet(charts.name, tuple(entries), tuple(found), limits, profile, tuple(notes), tuple(scenes))


def _lattice(white: RawImage, camera: LensletCamera | None) -> Calibration:
    """Lattice of the white image; the camera file decides between two equally likely pitches."""
    try:
        return calibrate(white)
    except CalibrationError:
        if camera is None:
            raise
        return calibrate(white, layout=camera.lenslets.layout, pitch=camera.calibration.lattice.pitch)


def _entry(section: str, name: str, value: Any, unit: str, how: str, half: float | None = None) -> SheetEntry:
    interval = None if half is None else (value - half, value + half)
    return SheetEntry(section, Quantity(name, value, unit, interval), how)


def _missing(section: str, name: str, why: Exception | str) -> SheetEntry:
    return SheetEntry(section, Quantity(name, None), f"not measured: {why}")


def _grid(
    white: RawImage, lattice: Calibration, whites: Sequence[RawImage]
) -> tuple[Calibration, list[SheetEntry]]:
    """The lattice through the lenslets well inside the array, its pitch, its rotation and its residual."""

    def placed(image: RawImage) -> Fitted:
        return places(np.asarray(to_numpy(image.data)), lattice)

    try:
        found = placed(white)
        halves = [found]
        if len(whites) > 1:
            halves = [placed(mean_image(islice(whites, first, None, 2))) for first in (0, 1)]
    except CalibrationError as error:
        how = f"lattice of the white image; no interval: {error}"
        return lattice, [
            _entry(GRID, "pitch_px", lattice.lattice.pitch, "px", how),
            _entry(GRID, "rotation", 1e3 * lattice.lattice.rotation, "mrad", how),
            _entry(
                GRID, "residual_px", lattice.residual_px, "px", "rms distance of the centres from the lattice"
            ),
        ]
    (pitch, half), (turn, wide) = pitch_and_rotation(found)
    off, ends = residual(halves)
    noise = "noise is in it" if len(halves) == 1 else "noise, by two halves of the exposures, is not in it"
    count = len(found.spots.indices)
    how = f"straight lines through the phases of {count} micro-images well inside the white image"
    return replace(lattice, lattice=found.lattice, warp=found.warp), [
        _entry(GRID, "pitch_px", pitch, "px", how, 1.96 * half),
        _entry(GRID, "rotation", 1e3 * turn, "mrad", how, 1.96e3 * wide),
        SheetEntry(
            GRID, Quantity("residual_px", off, "px", ends), f"rms of what phases are off the lattice; {noise}"
        ),
    ]


def _vignetting(lattice: Calibration) -> Iterator[SheetEntry]:
    """Light at the corner over that of the middle."""
    name = "light_at_corner"
    if lattice.light is None or len(lattice.light) < 12:
        yield _missing(LIGHT, name, "too few whole micro-images")
        return
    middle = (np.array(lattice.shape) - 1) / 2
    r2 = (((lattice.centers - middle) / np.hypot(*middle)) ** 2).sum(1)
    design = np.column_stack([np.ones_like(r2), r2])
    fit = np.linalg.lstsq(design, lattice.light, rcond=None)[0]
    off = lattice.light - design @ fit
    covariance = np.linalg.inv(design.T @ design) * (off**2).sum() / (len(off) - 2)
    ratio = fit[1] / fit[0]
    slope = np.array([-ratio, 1.0]) / fit[0]
    half = 1.96 * float(np.sqrt(slope @ covariance @ slope))
    how = "light of whole micro-images, fitted by 1 + c r²; the white image's own evenness is in it"
    yield _entry(LIGHT, name, 100 * float(1 + ratio), "%", how, 100 * half)


def _light(charts: Charts) -> Iterator[SheetEntry]:
    """Noise of pixels: photon transfer where flats and darks allow, and the white images' own."""
    pairs = _pairs(charts.whites)
    if pairs:
        dark = float(np.mean(np.asarray(charts.darks[0].data))) if charts.darks else 0.0
        means, squares = [], []
        for a, b in ((np.asarray(to_numpy(one.data), float) for one in pair) for pair in pairs):
            level = (a + b) / 2 - dark
            bright = level > np.median(level[level > level.max() / 2]) / 2
            means.append(float(level[bright].mean()))
            squares.append(_squared((a - b)[bright]))
        square, mean = np.concatenate(squares), float(np.mean(means))
        if square.any():
            snr = mean / math.sqrt(square.mean())
            # Half the relative error of the variance, of pixels that are not equally bright.
            part = float(square.std() / square.mean()) / math.sqrt(4 * square.size)
            how = f"{_of(len(pairs))}, pixels above half of the bright ones, {mean:.4g} counts in the mean"
            yield _entry(LIGHT, "snr_of_pixels", snr, "", how, 1.96 * snr * part)
    else:
        yield _missing(LIGHT, "snr_of_pixels", "there is one white image; two of the same light are needed")
    try:
        yield from _transfer(charts)
    except LumigraphError as error:
        yield _missing(LIGHT, "gain", error)


def _pairs(whites: Sequence[RawImage]) -> list[tuple[RawImage, RawImage]]:
    """Pairs of successive white images, between which the lamp changes little."""
    some = whites[: 2 * _PAIRS]
    return list(zip(some[::2], some[1::2], strict=False))


def _of(pairs: int) -> str:
    return "two white images" if pairs == 1 else f"{pairs} pairs of white images"


def _squared(difference: np.ndarray) -> np.ndarray:
    """Variance of one image by each pixel of two images' difference."""
    return (difference - difference.mean()) ** 2 / 2


def _transfer(charts: Charts) -> Iterator[SheetEntry]:
    if not charts.flats or len(charts.darks) < 2:
        raise LumigraphError(
            f"{len(charts.flats)} pairs of flats and {len(charts.darks)} darks; one pair and two are needed"
        )
    found = photon_transfer(charts.flats, [charts.darks[:2]])
    how = f"photon transfer, EMVA 1288: {int(found.fitted.sum())} pairs of white images, one of darks"
    yield _entry(LIGHT, "gain", found.gain, "electrons/count", how, 1.96 * found.gain_error)
    yield _entry(LIGHT, "dark_noise", found.dark_noise, "electrons", how, 1.96 * found.dark_noise_error)
    yield _entry(LIGHT, "dark_signal", found.dark_signal, "counts", how, 1.96 * found.dark_signal_error)
    if found.full_well is not None:
        yield _entry(LIGHT, "full_well", found.full_well, "electrons", how)


def _edges(white: np.ndarray, lattice: Calibration) -> tuple[PupilEdge | None, list[SheetEntry]]:
    names = ("micro_image_width_px", "directions_per_axis")
    try:
        edge = pupil_edge(white, lattice)
    except LumigraphError as error:
        return None, [_missing(DIRECTIONS, name, error) for name in names]
    how = "edges of micro-images on the white image, along their rows; 4 sectors of the picture"
    wide, blur, talk = edge.width, edge.blur, 100 * edge.cross_talk()
    # Cross-talk of pixels depends on view over blur alone: the blur's interval as one of the view's width.
    ends = [100 * edge.cross_talk(blur / (blur + sign * edge.blur_error)) for sign in (1, -1)]
    spill, part = 100 * edge.spill, edge.blur_error / blur
    return edge, [
        _entry(DIRECTIONS, names[0], wide, "px", how, edge.width_error),
        _entry(
            DIRECTIONS, "direction_blur_px", blur, "px", f"full width at half maximum; {how}", edge.blur_error
        ),
        _entry(
            DIRECTIONS, names[1], edge.directions, "", "width of a micro-image over the blur of its edges",
            edge.directions_error,
        ),
        _entry(
            DIRECTIONS, "cross_talk_of_pixels", talk, "%",
            "part of a direction's light outside the pixel it belongs to, from the blur",
            abs(ends[0] - ends[1]) / 2,
        ),
        _entry(
            DIRECTIONS, "spill", spill, "%",
            "part of a micro-image's light that falls into its two neighbours, from width and blur",
            spill * min(1.0, 4 * part),
        ),
    ]  # fmt: skip


def _plane(
    seen: ChartExposures, ready: Callable[[RawImage], PreparedImage], camera: LensletCamera | None,
    spacing: float | None, *, rendered: bool,
) -> ChartPlane:  # fmt: skip
    try:
        return planes.plane(seen, ready, camera, spacing, rendered=rendered)
    except LumigraphError as error:
        return ChartPlane(seen.depth, (_missing("", "picture", error),), None)


def _with(found: Sequence[ChartPlane], name: str) -> list[tuple[ChartPlane, Quantity, str]]:
    """Planes that have a value, it, and how it was measured."""
    hits = ((p, e) for p in found for e in p.entries if e.quantity.name == name and e.value is not None)
    return [(plane, entry.quantity, entry.how) for plane, entry in hits]


def _resolution(found: Sequence[ChartPlane]) -> Iterator[SheetEntry]:
    for zone in ("middle", "border"):
        for percent in (50, 10):
            name = f"mtf{percent}_{zone}"
            known = _with(found, name)
            if not known:
                why = "no picture of the chart shows enough edges" if found else NO_CHART
                yield _missing(RESOLUTION, f"best_{name}", why)
                continue
            plane, q, how = max(known, key=lambda one: one[1].value)
            yield SheetEntry(
                RESOLUTION, replace(q, name=f"best_{name}"), f"chart at {plane.label} from the focus; {how}"
            )
    yield _refocus_range(found)


def _refocus_range(found: Sequence[ChartPlane]) -> SheetEntry:
    """Depths between which pictures keep half of the best MTF50, counted in samples of the picture."""
    name = "refocus_range"
    known = [(p.depth, q.value) for p, q, _ in _with(found, "mtf50_middle") if p.depth is not None]
    if len(known) < 3:
        why = f"{len(known)} charts of known depth show edges; 3 are needed" if found else NO_CHART
        return _missing(RESOLUTION, name, why)
    depths, sharp = np.array([d for d, _ in known], float), np.array([v for _, v in known], float)
    least, kept = _KEPT * sharp.max(), sharp >= _KEPT * sharp.max()
    ends = [depths[kept].min(), depths[kept].max()]
    closed = [False, False]
    for (d0, s0), (d1, s1) in pairwise(zip(depths, sharp, strict=True)):
        if (s0 < least) != (s1 < least):
            side = int(s1 < least)
            ends[side], closed[side] = float(d0 + (d1 - d0) * (least - s0) / (s1 - s0)), True
    how = "depths whose refocused pictures keep half of the best MTF50, between the charts by straight lines"
    if not all(closed):
        how += "; not beyond the last charts, which are still sharp: the range may be wider"
    return SheetEntry(RESOLUTION, Quantity(name, (float(ends[0]), float(ends[1])), "m"), how)


def _of_depth(found: Sequence[ChartPlane]) -> Iterator[SheetEntry]:
    for name in ("disparity", "patch", "depth"):
        known = _with(found, f"{name}_noise")
        if known:
            plane, q, how = min(known, key=lambda one: one[1].value)
            yield SheetEntry(
                DEPTH, replace(q, name=f"least_{name}_noise"), f"chart at {plane.label} from the focus; {how}"
            )
        if errors := [q for _, q, _ in _with(found, f"{name}_error")]:
            off = np.array([q.value for q in errors])
            rms = float(np.sqrt(np.mean(off**2)))
            how = f"root mean square of the planes' mean errors, {len(errors)} charts, no correction"
            halves = [(q.interval[1] - q.interval[0]) / 2 for q in errors if q.interval is not None]
            half = (
                float(np.hypot.reduce(off * halves)) / (len(off) * rms) if len(halves) == len(off) else None
            )
            yield _entry(DEPTH, f"{name}_error", rms, errors[0].unit, how, half)


def _geometry(found: Sequence[ChartPlane]) -> Iterator[SheetEntry]:
    for name in ("distortion", "sample_on_chart"):
        known = _with(found, name)
        if not known:
            why = "no picture shows enough of the chart, or its spacing is not known" if found else NO_CHART
            yield _missing(GEOMETRY, name, why)
            continue
        plane, q, how = min(known, key=lambda one: abs(one[0].depth or 0.0))
        yield SheetEntry(GEOMETRY, q, f"chart at {plane.label} from the focus; {how}")


def _times_seen(found: Sequence[ChartPlane], lattice: Calibration) -> Iterator[SheetEntry]:
    known = _with(found, "patch")
    if known:
        plane, q, _ = min(known, key=lambda one: abs(one[0].depth or 0.0))
        pitch, (low, high) = lattice.lattice.pitch, q.interval or (q.value, q.value)
        how = f"pitch over patch: lenslets along an axis that show a point; chart at {plane.label}"
        ends = sorted((pitch / abs(low), pitch / abs(high)))
        views = Quantity("views_per_axis", pitch / abs(q.value), "", (ends[0], ends[1]))
        yield SheetEntry(DIRECTIONS, views, how)


def _picture_noise(
    pairs: Iterable[tuple[PreparedImage, PreparedImage]], camera: LensletCamera | None, *, rendered: bool
) -> Iterator[SheetEntry]:
    """SNR of a picture of an even scene, as bright as the white images."""

    def picture(ready: PreparedImage) -> np.ndarray:
        assert ready.calibration is not None  # prepared with a white image
        if rendered:
            known = camera is not None and camera.patch
            patch = camera.patch if camera is not None and known else ready.calibration.lattice.pitch / 3
            found = render(ready, ready.calibration, patch)
        else:
            found = refocus(decode(ready, ready.calibration), 1.0, oversample=1)
        return steady.inner(np.asarray(to_numpy(found), float))

    levels, squares = [], []
    for one, other in ((picture(one), picture(other)) for one, other in pairs):
        levels.append((one.mean() + other.mean()) / 2)
        squares.append(_squared(one - other))
    noise = math.sqrt(np.mean(squares)) if squares else 0.0
    if noise > 0:
        snr, n = float(np.mean(levels)) / noise, squares[0].size
        what = "rendered" if rendered else "all views in focus"
        how = f"{_of(len(squares))} made into pictures, {what}, even light; {n} samples"
        yield _entry(LIGHT, "snr_of_picture", snr, "", how, 1.96 * snr / math.sqrt(2 * n * len(squares)))


def _limits(camera: LensletCamera) -> Iterator[tuple[str, str, str]]:
    for row in camera.quantities():
        if row.name in LIMITS:
            yield row.name, row.text, row.source
