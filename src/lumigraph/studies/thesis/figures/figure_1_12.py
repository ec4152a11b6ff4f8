"""Figures 1.11 to 1.15 and 1.18: one plenoptic 1.0 raw image, its views, and the rendered picture."""

import numpy as np

from lumigraph import plots
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.instruments import PlenopticCamera
from lumigraph.rendering import decode, encode, refocus, views_from_mosaic
from lumigraph.rendering.views import lenslet_mosaic, views_mosaic
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment
from lumigraph.units import mm

_PIXELS = 20
# With the printed 7 mm, 75 lenslets would need waves of 12 000 x 12 000 samples.
_DIAMETER, _QUICK_DIAMETER = 3.6 * mm, 2.4 * mm


@experiment(
    "figure-1.12",
    "Camera view, array view and the rendered picture",
    question="How are places and directions laid out on the sensor, and what is left of the picture's size?",
    thesis="Figures 1.11 to 1.15 and 1.18, equations 1.6 and 1.7",
    shows="A raw image of lenslets of 20 × 20 pixels, its pixels sorted into an array of views, and the "
    "rendered picture of 75 × 75 pixels.",
)
def run(context: Context) -> ExperimentOutcome:
    """A flat object through the camera of section 1.4.2, decoded and rearranged."""
    camera = _camera(25, _QUICK_DIAMETER) if context.quick else _camera(75, _DIAMETER)
    scene = targets.photo(camera.object_grid)
    raw = RawImage(context.cached("raw", lambda: simulate(camera, scene).data), camera.pixels.pixel_pitch)
    views = decode(raw, camera.calibration)
    array, cells = views_mosaic(views), lenslet_mosaic(views)
    picture = refocus(views, 1.0, oversample=1)
    return ExperimentOutcome(
        (*_layout_rows(camera, views), *_content_rows(camera, raw, views, scene)),
        (*_raw_figures(raw, scene, camera), *_view_figures(views, array, cells, picture)),
        why="Every lenslet gives one pixel: the rendered picture has as many as there are lenslets. The "
        "views of a flat object in focus differ only by diffraction. The sum of 1.7 runs to N - 1.",
    )


def _camera(count: int, diameter: float) -> PlenopticCamera:
    """Main lens of 60 mm at 2f, lenslets of 5 mm, the matched pitch and 20 pixels per micro-image."""
    distance, f = 120 * mm, 5 * mm
    pitch = diameter * f / distance
    return PlenopticCamera.from_catalogue("thesis-plenoptic-1").replace(
        object_distance=distance,
        main_lens={"focal_length": 60 * mm},
        lenslets={"pitch": pitch, "focal_length": f, "count": (count, count)},
        sensor={"pixel_pitch": pitch * (1 + f / distance) / _PIXELS},
    )


def _layout_rows(camera: PlenopticCamera, views: LightField) -> list[ResultRow]:
    count = camera.lenslets.count[0]
    nv, _, nt, _ = views.data.shape
    return [
        ResultRow("main-lens diameter, matched", camera.pupil_diameter / mm, "mm", 7.0,
            note="smaller than printed, so that 75 lenslets can be simulated; pixel for pixel the same"),
        ResultRow("pixels across a micro-image", camera.calibration.lattice.pitch, "px", 20, 20, 1e-9,
            kind="closed form"),
        ResultRow("directions per axis, N", nv, "", 20, 20, 0, kind="closed form"),
        ResultRow("pixels of the array view per axis", views_mosaic(views).shape[0], "px", 1500 * count / 75,
            _PIXELS * count, 0, kind="closed form"),
        ResultRow("pixels of the rendered picture per axis", nt, "px", count, count, 0,
            kind="closed form"),
    ]  # fmt: skip


def _content_rows(camera: PlenopticCamera, raw: RawImage, views: LightField, scene: Scene) -> list[ResultRow]:
    array = views_mosaic(views)
    again = views_from_mosaic(array, views.aperture, views.lenslets, views.separation)
    back = encode(again, camera.calibration).data
    inner = slice(2 * _PIXELS, -2 * _PIXELS)
    error = float(np.abs(back - raw.data)[inner, inner].max() / raw.data.max())
    picture, count = refocus(views, 1.0, oversample=1), views.data.shape[0]
    mean = views.data.mean((0, 1))
    rest = float(np.abs(picture - mean).max() / mean.max())
    likeness = _correlation(camera, picture, views.lenslets, scene)
    left, right = (views.data[:, k].mean(0) for k in (count // 4, count - 1 - count // 4))
    return [
        ResultRow("array view turned back into the raw image, largest error", error, "", None, 0.0,
            1e-6, note="both are the same numbers, in another order"),
        ResultRow("picture less the mean of all directions, largest", rest, "", None, 0.0, 1e-5),
        ResultRow("shift between the views from left and right", _displacement(left, right), "lenslets",
            None, 0.0, 0.15,
            note="no parallax in focus; diffraction lets neighbours show at the rims"),
        ResultRow("correlation of the picture with the object", likeness, "", None, 1.0, 0.02),
    ]  # fmt: skip


def _slice(scene: Scene) -> Slice:
    (part,) = scene.parts
    assert isinstance(part, Slice)
    return part


def _displacement(one: np.ndarray, other: np.ndarray) -> float:
    """Shift along x that matches two pictures best: least squares of the gradient."""
    slope = np.gradient((one + other) / 2, axis=1)
    return float(((one - other) * slope).sum() / (slope**2).sum())


def _correlation(camera: PlenopticCamera, picture: np.ndarray, grid: Grid, scene: Scene) -> float:
    """Pearson's correlation with the object, averaged over each lenslet's footprint."""
    part = _slice(scene)
    scale = camera.magnification
    rows, columns = (
        np.rint((axis * scale - lenslets[0]) / grid.pitch[0]).astype(int)
        for axis, lenslets in ((part.grid.y, grid.y), (part.grid.x, grid.x))
    )
    inside = (rows >= 1) & (rows < grid.shape[0] - 1), (columns >= 1) & (columns < grid.shape[1] - 1)
    seen, count = np.zeros(grid.shape), np.zeros(grid.shape)
    place = np.ix_(rows[inside[0]], columns[inside[1]])
    np.add.at(seen, place, np.asarray(part.intensity)[np.ix_(*inside)])
    np.add.at(count, place, 1)
    known = count > 0
    return float(np.corrcoef(picture[known], seen[known] / count[known])[0, 1])


def _raw_figures(raw: RawImage, scene: Scene, camera: PlenopticCamera) -> list[tuple[object, str]]:
    middle, half = raw.shape[0] // 2, int(3.5 * camera.calibration.lattice.pitch)
    part = raw.data[middle - half : middle + half, middle - half : middle + half]
    return [
        (plots.images([(_slice(scene).intensity, "object"), (raw.data, "raw image"), (part, "its middle")]),
         "1.11, 1.12: the object, the raw image (the camera view) and 7 × 7 of its micro-images"),
    ]  # fmt: skip


def _view_figures(
    views: LightField, array: np.ndarray, cells: np.ndarray, picture: np.ndarray
) -> list[tuple[object, str]]:
    n, (nt, ns) = views.data.shape[0] // 2, views.lenslets.shape
    few = array[(n - 1) * nt : (n + 2) * nt, (n - 1) * ns : (n + 2) * ns]
    radiance = views.data[n, :, nt // 2]
    wide = np.repeat(radiance, max(1, ns // radiance.shape[0]), 0)
    return [
        (plots.images([(cells, "camera view"), (array, "array view"), (few, "its middle, 3 × 3 views")]),
         "1.13 to 1.15: the same radiance by lenslets and by directions"),
        (plots.images([(wide, "4-D radiance, one row: u over x"), (picture, "rendered")], columns=2),
         "1.18: a slice of the radiance, and the mean over its directions"),
    ]  # fmt: skip
