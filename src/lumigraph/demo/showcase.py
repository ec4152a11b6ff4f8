"""Demonstration: a still life, a focused plenoptic camera and a microscope become a report of pictures."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lumigraph import depth, io, plots, report
from lumigraph.calibration import calibrate, devignette
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, Stage, silent, within
from lumigraph.core.volume import Volume
from lumigraph.demo.helix import helix
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.plots import layout
from lumigraph.rendering import refocus, render, sub_aperture
from lumigraph.samples import portrait, scene
from lumigraph.samples.files import camera_file, camera_path
from lumigraph.samples.still_life import LAYERS
from lumigraph.units import mm, um

Living = Callable[[LightField | Volume, Path], None]
"""Writes the viewer's page of a light field or of a volume into a file."""

NAMES = ("leaves", "robot", "wall")
"""What is painted at the three depths, from the camera outwards."""

VIEWS_PAGE, VOLUME_PAGE = "still_life.html", "helix.html"

SIZE, VIEWS = (160, 284), 9
LENSLETS = (27, 39)
GAMMA = 1.4
BRIGHTEST = 99.8
"""Percentile of a picture that is shown as white."""

INTRODUCTION = """
A light-field camera records where light goes, not only where it lands. So one exposure can be refocused
afterwards, seen from another side, and measured in depth.

Everything on this page was made from scratch by lumigraph: a painted still life as an ideal camera records
it, the raw image of a focused plenoptic camera, and the raw image of a light-field microscope.
"""


def run(
    output: str | os.PathLike[str] = "demo", progress: Progress | None = None, *, living: Living | None = None
) -> Path:
    """Run the demonstration; returns the path of the report.

    Writes ``report.html`` and, beside it, the light field and the volume (Zarr, TIFF), raw and white images
    (TIFF), a calibration (TOML) and the pictures (PNG).

    Parameters
    ----------
    output
        Folder to write into; made when missing.
    progress
        Called as ``progress(fraction)`` of the whole, a `core.progress.Stage`.
    living
        Writes the viewer's page of the still life and of the volume, which the report then shows.
    """
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    tell = progress or silent
    page = report.Page("lumigraph: a demonstration", INTRODUCTION)
    start = time.process_time()
    _still_life(page, folder, living, within(tell, 0.0, 0.55, "still life"))
    _focused(page, folder, within(tell, 0.55, 0.8, "2.0 camera"))
    _microscope(page, folder, living, within(tell, 0.8, 1.0, "microscope"))
    page.section("Time").text(f"All of it took {time.process_time() - start:.0f} s of processor time.")
    page.write(folder / "report.html")
    return folder / "report.html"


def _still_life(page: report.Page, folder: Path, living: Living | None, tell: Progress) -> None:
    views = scene(SIZE, VIEWS).views
    io.save(views, folder / "still_life.zarr")
    tell(Stage(0.5, "refocusing"))
    if living is not None:
        living(views, folder / VIEWS_PAGE)
        section = page.section("Click what should be sharp")
        section.frame(f"{VIEWS_PAGE}#gamma={GAMMA}", "The still life in the viewer")
        section.text(
            "Click a leaf, the robot or the wall. Press Parallax to move the viewpoint, and Depth, above, "
            "to see how far each place is."
        )
    section = page.section("One exposure, focused on three depths")
    for name, alpha in zip(NAMES, alphas(views), strict=True):
        picture = shown(refocus(views, alpha))
        io.save(picture, folder / f"still_life_{name}.png")
        section.figure(picture, f"Focused on the {name}: refocus factor α' = {alpha:.4f}")
    middle, last = VIEWS // 2, VIEWS - 1
    section = page.section("Another viewpoint, and depth")
    left, right = (shown(sub_aperture(views, middle, u)) for u in (0, last))
    section.figure(left, "From one side of the lens: one view (sub-aperture image), sharp at every depth")
    section.figure(right, "From the other side: the leaves have moved against the wall")
    tell(Stage(0.8, "depth"))
    if living is not None:  # its page holds the depth already
        section.frame(f"{VIEWS_PAGE}#mode=depth", "Depth, measured from the views, in the viewer")
    else:
        found = plots.show(depth.epi(views), title="Disparity, measured", label="disparity [px per view]")
        section.figure(found, "Depth from the views alone: nearer places have larger disparities")


def alphas(views: LightField) -> list[float]:
    """Refocus factors α' = 1 - disparity Δs/Δu of the leaves, the robot and the wall."""
    parallaxes = (LAYERS[3].parallax, LAYERS[2].parallax, LAYERS[0].parallax)
    rows, count = views.data.shape[2], views.data.shape[0]
    per_pixel = views.lenslets.pitch[1] / views.aperture.pitch[1]
    return [1 - parallax * rows / (count - 1) * per_pixel for parallax in parallaxes]


def shown(picture: Array) -> np.ndarray:
    """Picture (y, x[, 3]) as a screen shows it, uint8."""
    data = to_numpy(picture)
    light = np.clip(data / max(float(np.percentile(data, BRIGHTEST)), 1e-30), 0, 1)
    return np.round(255 * light ** (1 / GAMMA)).astype(np.uint8)


def _focused(page: report.Page, folder: Path, tell: Progress) -> None:
    with camera_path("focused-plenoptic") as path:
        camera = FocusedPlenopticCamera.from_toml(path).replace(lenslets={"count": LENSLETS})
    sample = portrait(camera, colour=True, progress=within(tell, 0.0, 0.4))
    tell(Stage(0.4, "calibrating"))
    found = calibrate(sample.white, separation=camera.separation, lenslet_distance=camera.lenslet_distance)
    tell(Stage(0.7, "rendering"))
    raw = devignette(sample.raw, sample.white)
    for name, thing in (("raw.tiff", sample.raw), ("white.tiff", sample.white), ("calibration.toml", found)):
        io.save(thing, folder / f"focused_{name}")
    depths = (sample.depths[0], camera_depth(sample.depths), sample.depths[1])
    section = page.section("A focused plenoptic (2.0) camera, rendered for each depth")
    for name, dz in zip(NAMES, depths, strict=True):
        patch = camera.patch_at(dz)
        picture = shown(render(raw, found, patch, blend=True))
        io.save(picture, folder / f"focused_{name}.png")
        section.figure(picture, f"Focused on the {name}, {_depth(dz)}: patches of {patch:.1f} px")
    section.text(
        "Each microlens shows a small part of the scene. A patch from each, turned by 180°, tiles the "
        "picture; the patch's size decides which depth fits together, and blended neighbours blur the others."
    )
    section = page.section("What its sensor recorded")
    section.figure(shown(sample.raw.data), f"Raw image: {LENSLETS[1]} × {LENSLETS[0]} micro-images")
    rows, columns = (n // 2 for n in sample.raw.shape)
    half = int(3.5 * found.lattice.pitch)
    part = sample.raw.data[rows - half : rows + half, columns - half : columns + half]
    section.figure(shown(part), "Its middle, 7 microlenses wide", zoom=2)
    section.figure(layout(camera), "Rays through the camera; heights are exaggerated", wide=True)
    _numbers(page, camera, found.report())


def camera_depth(depths: tuple[float, float]) -> float:
    """Depth of the robot from the focused plane [m], between those of the leaves and of the wall."""
    part = LAYERS[2].parallax / LAYERS[3].parallax
    return part * depths[0]


def _microscope(page: report.Page, folder: Path, living: Living | None, tell: Progress) -> None:
    sample = helix()
    io.save(sample.raw, folder / "helix_raw.tiff")
    io.save(sample.found, folder / "helix.tiff")
    tell(Stage(0.8, "pictures"))
    section = page.section("A light-field microscope: a volume from one exposure")
    if living is not None:
        living(sample.found, folder / VOLUME_PAGE)
        section.frame(f"{VOLUME_PAGE}#projection=brightest&map=magma", "The volume in the viewer")
        section.text("Drag the volume to turn it.")
    section.figure(shown(sample.raw.data), "The exposure, with photon noise: a double helix, out of focus")
    section.figure(plots.projections(sample.found), "The volume found in it: largest values along each axis")
    deep = sample.found.depths[-1] - sample.found.depths[0]
    section.text(
        f"The helix is {deep / um:.0f} µm deep. Richardson-Lucy deconvolution with the microscope's computed "
        "point spread functions finds it from the single raw image."
    )


def _depth(dz: float) -> str:
    return f"{abs(dz) / mm:.1f} mm {'behind' if dz > 0 else 'before'} the focused plane"


def _numbers(page: report.Page, camera: FocusedPlenopticCamera, calibration: str) -> None:
    section = page.section("Numbers of the 2.0 camera", folded=True)
    section.lines(camera_file("focused-plenoptic"))
    description = camera.describe()
    section.table(
        [(row.name, row.text, row.source) for row in description.rows],
        header=("quantity", "value", "where it comes from"),
    )
    for warning in description.warnings:
        section.text(f"Note: {warning}")
    section.lines(calibration)
