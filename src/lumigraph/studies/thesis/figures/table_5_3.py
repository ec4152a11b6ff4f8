"""Table 5.3 and figures 5.13 to 5.16: the image of a point, on the sensor and rendered."""

import numpy as np

from lumigraph.analysis import first_zero
from lumigraph.design import plenoptic2
from lumigraph.plots.curves import curves, images
from lumigraph.studies.thesis.figures.point_images import MAGNIFICATIONS, PointRendering, on_axis
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_PRINTED = {0.5: (78.48, 200.0), 0.3: (68.48, 269.8), 0.25: (65.14, 357.4)}


@experiment(
    "table-5.3",
    "The image of a point, raw and rendered",
    question="How wide is the central lobe of a point's image, behind the main lens and in the rendered "
    "picture?",
    thesis="Table 5.3, figures 5.13 to 5.16",
    shows="Raw and rendered images of a point with artefacts beside the lobe, which is wider, the lower the "
    "magnification.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Exact images of a point on the axis.

    The rendered lobe is measured in the micro-image behind the lenslet on the axis, at the picture's scale:
    in the picture itself the lobe is wider than a patch and cut by the seams.
    """
    rows: list[ResultRow] = []
    figures = []
    for number, m in enumerate(MAGNIFICATIONS):
        context.progress(number / 3, f"point, m = {m:g}")
        point = on_axis(m, 13 if context.quick else 39)
        rows += _rows(point, m)
        figures += _figures(point, m)
    return ExperimentOutcome(
        tuple(rows),
        tuple(figures),
        why="The rendered lobe is 2.44 λ a/p on the scale of the main-lens image; equation 5.16 has b/p, the "
        "lobe on the sensor. What the thesis measures beyond that comes from patches of the wrong size.",
    )


def _rows(point: PointRendering, m: float) -> list[ResultRow]:
    part, grid = point.micro_image
    main, tile = _lobe(*point.main_profile), _lobe(grid.x, part[len(part) // 2])
    printed, found = _PRINTED[m], point.camera
    zero = 2 * 1.21967 * 1e6 * found.wavelength  # of an Airy pattern, over the f-number [um]
    right = zero * found.f_number, zero * found.relay_distance / found.lenslets.pitch
    return [
        ResultRow(f"main-lens lobe, m = {m:g}", main, "µm", printed[0], right[0], 0.2,
            note="2 · 1.2197 λF#"),
        ResultRow(f"rendered lobe, m = {m:g}", tile, "µm", printed[1], right[1], 0.07 * right[1],
            note="Fresnel ripples of the main lens' blurred disc move the zero by some per cent"),
        ResultRow(f"width over width, m = {m:g}", main / tile, "",
            round(printed[0] / printed[1], 2), right[0] / right[1], 0.08 * right[0] / right[1]),
        ResultRow(f"first minimum × 2 across seams, m = {m:g}", _lobe(*point.rendered_profile), "µm",
            note=f"seams ± {_seam(point):.0f} µm from the middle"),
        ResultRow(f"views of the point per axis, m = {m:g}", _views(point), "", round(1 / m, 1),
            note="light of the row over its brightest micro-image; 1/m for the mean of all places"),
    ]  # fmt: skip


def _lobe(x: np.ndarray, profile: np.ndarray) -> float:
    return 2e6 * first_zero(x, profile)


def _seam(point: PointRendering) -> float:
    """Half a lenslet's share of the main-lens image [µm]."""
    camera = point.camera
    return 5e5 * camera.lenslets.pitch * camera.image_distance / camera.separation


def _views(point: PointRendering) -> float:
    """Light of the middle row of micro-images over that of the brightest."""
    calibration, raw = point.camera.calibration, np.asarray(point.raw.data, float)
    i, j = calibration.lattice.index(np.arange(raw.shape[0])[:, None], np.arange(raw.shape[1])[None, :])
    light = np.bincount((j[i == 0] - j.min()).ravel(), raw[i == 0].ravel())
    return float(light.sum() / light.max())


def _figures(point: PointRendering, m: float) -> list[tuple[object, str]]:
    camera, half = point.camera, 5.5
    size = int(half * camera.micro_image_pitch / camera.pixels.pixel_pitch)
    ny, nx = point.raw.shape
    raw = np.asarray(point.raw.data)[ny // 2 - size : ny // 2 + size, nx // 2 - size : nx // 2 + size]
    width = half * camera.lenslets.pitch * camera.image_distance / camera.separation
    near = [np.abs(axis) < width for axis in (point.rendered_grid.y, point.rendered_grid.x)]
    rendered = point.rendered[np.ix_(near[0], near[1])]
    panels = [(np.sqrt(raw), "raw image"), (np.sqrt(np.maximum(rendered, 0)), "rendered picture")]
    profiles = {}
    for name, (x, values) in (("main lens", point.main_profile), ("rendered", point.rendered_profile)):
        shown = np.abs(x) < 3.5e-4
        profiles[name] = (x[shown] * 1e6, values[shown] / values.max())
    lobe = plenoptic2.rendered_lobe(camera.wavelength, camera.lenslets.pitch, camera.relay_distance)
    marks = {"1.22 λ a/p": lobe * 5e5, "seam": _seam(point)}
    return [
        (images(panels, columns=2), f"A point, m = {m:g}: square root of the intensity (5.13 to 5.15)."),
        (
            curves([], profiles, xlabel="x in the main-lens image [µm]", ylabel="intensity", marks=marks),
            f"Profiles of the point's image, m = {m:g} (5.16).",
        ),
    ]
