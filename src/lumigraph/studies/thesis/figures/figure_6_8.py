"""Figures 6.8, 6.9 and 6.11: a USAF-1951 target before the laboratory camera, raw and rendered."""

import math

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.signal import fftconvolve
from scipy.special import j1

from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.design.plenoptic2 import rendered_cutoff
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.plots.curves import curves, images
from lumigraph.rendering import render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import Incoherent, simulate
from lumigraph.studies.thesis.charts import contrast, elements
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

MAGNIFICATIONS = (0.5, 0.4, 0.3, 0.25)

GROUPS = (2, 3)
"""Groups of the target: 4 to 14 line pairs per mm, on both sides of the cut-offs."""


@experiment(
    "figure-6.8",
    "The laboratory camera sees a resolution target",
    question="Which elements of a USAF-1951 target do the pictures of the laboratory camera show, at m = 0.5 "
    "to 0.25?",
    thesis="Figures 6.8, 6.9 and 6.11, sections 6.3 and 6.4",
    shows="Photographs of a resolution target, raw and rendered, at four magnifications: the lower, the "
    "more blurred.",
    camera="thesis-prototype",
)
def run(context: Context) -> ExperimentOutcome:
    """Exact incoherent raw images; contrasts against the target, blurred as the lenslets' openings do."""
    rows: list[ResultRow] = []
    raws, pictures, lines = [], [], {}
    lenslets, groups = (17, (3, 3)) if context.quick else (33, GROUPS)
    chosen = MAGNIFICATIONS
    for number, m in enumerate(chosen):
        context.progress(number / len(chosen), f"target, m = {m:g}")
        found = laboratory_camera(m, lenslets)
        if context.quick:
            found = found.replace(sensor={"pixel_pitch": 2 * found.pixels.pixel_pitch})
        raw = RawImage(context.cached(f"raw-{m:g}", lambda c=found: bench_image(c, target(c, groups)).data))
        picture = render(raw, found.calibration, found.patch)
        grid = rendered_grid(found.calibration, found.patch)
        seen = contrasts(picture, grid, groups)
        right = contrasts(blurred(found, grid, groups), grid, groups)
        rows += _rows(m, found, seen, right)
        panels = np.asarray(raw.data), np.asarray(picture)
        middle = [slice(3 * n // 8, 5 * n // 8) for n in panels[0].shape]
        raws.append((panels[0][middle[0], middle[1]], f"raw, m = {m:g}"))
        pictures.append((panels[1], f"rendered, m = {m:g}"))
        lines |= {f"m = {m:g}": (np.array(list(seen)) / 1e3, np.array(list(seen.values())))}
    figure = curves([], lines, xlabel="line pairs per mm at the object", ylabel="contrast")
    return ExperimentOutcome(
        tuple(rows),
        (
            (images(raws, columns=2), "The middle of the raw images (6.8, 6.9)."),
            (images(pictures, columns=2), "Rendered pictures (6.11)."),
            (figure, "Contrast of the target's elements."),
        ),
        why="The lower the magnification, the more lenslets show a detail, and the coarser the picture, as "
        "the thesis says. Three bars are no grating: beyond the cut-off a little contrast is left, reversed.",
    )


def laboratory_camera(m: float, lenslets: int) -> FocusedPlenopticCamera:
    """The thesis' bench at one of its magnifications, so many lenslets per axis and all of them seen."""
    return FocusedPlenopticCamera.from_catalogue("thesis-prototype").replace(
        lenslets={"magnification": m, "count": (lenslets, lenslets)}, sensor={"shape": None}
    )


def bench_image(found: FocusedPlenopticCamera, scene: Scene) -> RawImage:
    """Raw image to 1e-2, which is less than a third of the rows' tolerance."""
    return simulate(found, scene, Incoherent(1e-2))


def target(found: FocusedPlenopticCamera, groups: tuple[int, int]) -> Scene:
    """The chart, drawn on the camera's samples of the object."""
    return targets.usaf1951(found.object_grid, groups)


def contrasts(picture: np.ndarray, grid: Grid, groups: tuple[int, int]) -> dict[float, float]:
    """Contrast of each element by its frequency [1/m], in a picture of magnification 1."""
    return {f: contrast(np.asarray(picture, float), grid, corner, w) for f, corner, w in elements(groups)}


def blurred(found: FocusedPlenopticCamera, wanted: Grid, groups: tuple[int, int]) -> np.ndarray:
    """The target at the picture's places, as a round lenslet's opening shows it: by its Airy pattern."""
    width = found.lenslets.pitch * found.lenslets.fill_factor
    step = found.wavelength * found.relay_distance / width / 8
    n = 2 * math.ceil(found.object_grid.size[0] / 2 / step) + 1
    fine = Grid.square(n, step)
    (part,) = targets.usaf1951(fine, groups).parts
    assert isinstance(part, Slice)
    v = math.pi * np.hypot(np.arange(-80, 81)[:, None], np.arange(-80, 81)) / 8
    spread = np.square(np.divide(j1(v), v, out=np.full_like(v, 0.5), where=v > 0))
    image = fftconvolve(np.asarray(part.intensity), spread / spread.sum(), "same")
    places = np.meshgrid((wanted.y - fine.y[0]) / step, (wanted.x - fine.x[0]) / step, indexing="ij")
    return map_coordinates(image, places, order=1)


def _rows(
    m: float, found: FocusedPlenopticCamera, seen: dict[float, float], right: dict[float, float]
) -> list[ResultRow]:
    cutoff = rendered_cutoff(found.wavelength, found.lenslets.pitch, m, found.lenslet_distance)
    # Square openings would be off by 0.1 and more at half of it.
    return [
        ResultRow(f"contrast at {frequency / 1e3:.3g} line pairs/mm, m = {m:g}", value, "", None,
            right[frequency], 0.04, f"the cut-off is {cutoff / 1e3:.3g}")
        for frequency, value in seen.items()
    ]  # fmt: skip
