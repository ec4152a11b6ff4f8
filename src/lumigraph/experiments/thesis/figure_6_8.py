"""Figures 6.8, 6.9 and 6.11: a USAF-1951 target before the laboratory camera, raw and rendered."""

import math

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.signal import fftconvolve

from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.design.plenoptic2 import rendered_cutoff
from lumigraph.experiments.charts import contrast, elements
from lumigraph.experiments.registry import Context, Outcome, Row, experiment
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.plots.curves import curves, images
from lumigraph.rendering import render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import simulate

MAGNIFICATIONS = (0.5, 0.4, 0.3, 0.25)

GROUPS = (2, 3)
"""Groups of the target: 4 to 14 line pairs per mm, on both sides of the cut-offs."""


@experiment(
    "figure-6.8",
    "The laboratory camera sees a resolution target",
    question="Which elements of a USAF-1951 target do the pictures of the laboratory camera show, at m = 0.5 "
    "to 0.25?",
    thesis="Figures 6.8, 6.9 and 6.11, sections 6.3 and 6.4",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> Outcome:
    """Exact incoherent raw images; contrasts against the target, blurred as the lenslets' openings do."""
    rows: list[Row] = []
    raws, pictures, lines = [], [], {}
    lenslets, groups = (21, (3, 3)) if context.quick else (33, GROUPS)
    chosen = MAGNIFICATIONS[:1] if context.quick else MAGNIFICATIONS
    for number, m in enumerate(chosen):
        context.progress(number / len(chosen), f"target, m = {m:g}")
        found = laboratory_camera(m, lenslets)
        raw = RawImage(context.cached(f"raw-{m:g}", lambda c=found: simulate(c, target(c, groups)).data))
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
    return Outcome(
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
    """Table 6.1's camera, the main lens matched, so many lenslets per axis."""
    found = FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    return found.replace(lenslets={"magnification": m, "count": (lenslets, lenslets)})


def target(found: FocusedPlenopticCamera, groups: tuple[int, int]) -> Scene:
    """The chart, drawn on the camera's samples of the object."""
    return targets.usaf1951(found.object_grid, groups)


def contrasts(picture: np.ndarray, grid: Grid, groups: tuple[int, int]) -> dict[float, float]:
    """Contrast of each element by its frequency [1/m], in a picture of magnification 1."""
    return {f: contrast(np.asarray(picture, float), grid, corner, w) for f, corner, w in elements(groups)}


def blurred(found: FocusedPlenopticCamera, wanted: Grid, groups: tuple[int, int]) -> np.ndarray:
    """The target at the picture's places, as square openings of a lenslet's width show it, ray by ray.

    A lenslet's image of a point has the intensity sinc²(p y/(λ a)) sinc²(p x/(λ a)) in the main-lens image.
    """
    step = found.wavelength * found.relay_distance / found.lenslets.pitch / 8
    n = 2 * math.ceil(found.object_grid.size[0] / 2 / step) + 1
    fine = Grid.square(n, step)
    (part,) = targets.usaf1951(fine, groups).parts
    assert isinstance(part, Slice)
    x = np.arange(-80, 81) / 8
    spread = np.sinc(x) ** 2 / (np.sinc(x) ** 2).sum()
    image = fftconvolve(
        fftconvolve(np.asarray(part.intensity), spread[:, None], "same"), spread[None], "same"
    )
    places = np.meshgrid((wanted.y - fine.y[0]) / step, (wanted.x - fine.x[0]) / step, indexing="ij")
    return map_coordinates(image, places, order=1)


def _rows(
    m: float, found: FocusedPlenopticCamera, seen: dict[float, float], right: dict[float, float]
) -> list[Row]:
    cutoff = rendered_cutoff(found.wavelength, found.lenslets.pitch, m, found.lenslet_distance)
    # Between lenslets the main lens' rim cuts their openings; round ones would be off by 0.14 at half of it.
    return [
        Row(f"contrast at {frequency / 1e3:.3g} line pairs/mm, m = {m:g}", value, "", None,
            right[frequency], 0.06, f"the cut-off is {cutoff / 1e3:.3g}")
        for frequency, value in seen.items()
    ]  # fmt: skip
