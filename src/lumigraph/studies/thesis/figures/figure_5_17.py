"""Figures 5.17 and 5.18: two points at and at twice the Rayleigh distance."""

import numpy as np
from scipy.special import j1

from lumigraph.plots.curves import curves, images
from lumigraph.studies.thesis.figures.point_images import PointRendering, camera
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment


@experiment(
    "figure-5.17",
    "Two points",
    question="Does the rendered picture still tell two points apart that the main lens just resolves?",
    thesis="Figures 5.17 and 5.18, section 5.5",
    shows="Two points at Rayleigh's distance are one spot in the rendered picture at m = 0.5, and two at "
    "twice the distance.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Mutually incoherent points on both sides of the axis; the light between them over the peak."""
    lenslets = 13 if context.quick else 39
    rows: list[ResultRow] = []
    figures = []
    for number, separation in enumerate((40e-6, 80e-6)):
        context.progress(number / 2, f"points {separation * 1e6:.0f} µm apart")
        points = PointRendering.of(camera(0.5, lenslets), ((0.0, -separation / 2), (0.0, separation / 2)))
        rows += _rows(points, separation)
        figures += _figures(points, separation)
    return ExperimentOutcome(
        tuple(rows),
        tuple(figures),
        why="The lobe of the rendered picture is twice as wide at m = 0.5: the thesis' conclusion holds.",
    )


def _rows(points: PointRendering, separation: float) -> list[ResultRow]:
    main, tile = _dip(*points.main_profile), _dip(*points.rendered_profile)
    if separation < 60e-6:
        return [
            ResultRow(
                "middle over peak, main lens, 40 µm",
                main,
                "",
                "limit",
                _airy_dip(points, separation),
                0.005,
                note="two Airy discs, as far apart",
            ),
            ResultRow("middle over peak, rendered, 40 µm", tile, "", "merged", 1.0, (0.001, 0.0)),
        ]
    return [
        ResultRow(
            "middle over peak, main lens, 80 µm", main, "", None, 0.0, 5e-4, "each other's first dark ring"
        ),
        ResultRow(
            "middle over peak, rendered, 80 µm",
            tile,
            "",
            "limit",
            0.62,
            0.01,
            "two Airy discs would leave 0.741: each point lights a lenslet's edge with Fresnel ripples",
            "told",
        ),
    ]


def _airy_dip(points: PointRendering, separation: float) -> float:
    """Light between two incoherent points behind the main lens, over the peak."""
    camera, x = points.camera, np.linspace(0, separation, 401)
    v = np.pi / (camera.wavelength * camera.f_number) * np.abs(x[:, None] - [separation / 2, -separation / 2])
    light = np.square(np.divide(2 * j1(v), v, out=np.ones_like(v), where=v > 0)).sum(1)
    return float(light[0] / light.max())


def _dip(x: np.ndarray, profile: np.ndarray) -> float:
    return float(profile[int(np.argmin(np.abs(x)))] / profile.max())


def _figures(points: PointRendering, separation: float) -> list[tuple[object, str]]:
    panels, profiles, width = [], {}, 1.6e-4
    for name, image, grid, (x, values) in (
        ("main lens", points.main, points.main_grid, points.main_profile),
        ("rendered", points.rendered, points.rendered_grid, points.rendered_profile),
    ):
        panels.append((image[np.ix_(np.abs(grid.y) < width, np.abs(grid.x) < width)], name))
        profiles[name] = (x[np.abs(x) < width] * 1e6, values[np.abs(x) < width] / values.max())
    text = f"Two points {separation * 1e6:.0f} µm apart, m = 0.5"
    return [
        (images(panels, columns=2), f"{text}: main-lens image and rendered picture."),
        (
            curves([], profiles, xlabel="x in the main-lens image [µm]", ylabel="intensity"),
            f"{text}: profiles.",
        ),
    ]
