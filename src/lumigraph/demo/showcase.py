"""From two camera files to a report with refocused pictures."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from lumigraph import io, plots, report
from lumigraph.calibration import calibrate, devignette
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.plots import layout
from lumigraph.rendering import decode, reduce_aperture, refocus, render, view
from lumigraph.scene import Scene, targets
from lumigraph.simulation import simulate
from lumigraph.units import mm

Progress = Callable[[str, float], None]

NAMES = ("near", "middle", "far")
"""The three depths, from the camera outwards."""

INTRODUCTION = """
Everything on this page was computed from two camera files. A plenoptic (1.0) camera and a focused plenoptic
(2.0) camera look at the same kind of scene: a fine star in front, a resolution chart in focus, a coarse star
behind. The raw images are wave-optics simulations: light goes from the scene through the main lens and the
lenslets to the sensor. The lattice of micro-images was then found on the simulated white image alone.
"""


@dataclass(frozen=True, slots=True)
class Exposure:
    """What the sensor gave, and the lattice found on the white image."""

    raw: RawImage
    white: RawImage
    calibration: Calibration


def run(output: str | os.PathLike[str] = "demo", progress: Progress | None = None) -> Path:
    """Run the demonstration; returns the path of the report.

    Writes ``report.html`` and, beside it, the camera files, raw and white images (TIFF), calibrations
    (TOML), the decoded views (Zarr) and the refocused pictures (PNG).

    Parameters
    ----------
    output
        Folder to write into; made when missing.
    progress
        Called as ``progress(what, fraction)`` with the fraction of the whole that is done.
    """
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    tell = progress or (lambda what, fraction: None)
    page = report.Page("lumigraph: a demonstration", INTRODUCTION)
    start = time.perf_counter()
    _plenoptic(page, folder, lambda what, part: tell(f"1.0 camera: {what}", 0.65 * part))
    _focused(page, folder, lambda what, part: tell(f"2.0 camera: {what}", 0.65 + 0.35 * part))
    seconds = time.perf_counter() - start
    page.section("Time").text(f"Both cameras took {seconds:.0f} s.")
    page.write(folder / "report.html")
    tell("done", 1.0)
    return folder / "report.html"


def three_depths(grid: Grid, depths: tuple[float, float, float]) -> Scene:
    """A star in front (left), a chart in focus (middle) and a coarser star behind (right)."""
    width = grid.size[1]
    near = targets.siemens_star(grid, 16, 0.28 * width, (0.0, -0.31 * width)).at(depths[0])
    far = targets.siemens_star(grid, 12, 0.32 * width, (0.0, 0.32 * width)).at(depths[2])
    return near + _chart(grid).at(depths[1]) + far


def _chart(grid: Grid) -> Scene:
    """The coarsest group of the USAF-1951 chart that takes at most a third of the width."""
    group = 0
    while True:
        bar = targets.bar_width(group, 1)
        if 16 * bar < 0.33 * grid.size[1]:
            return targets.usaf1951(grid, group)
        group += 1


def camera_file(name: str) -> str:
    """Text of a camera file that comes with the demonstration: "plenoptic" or "focused_plenoptic"."""
    return files("lumigraph.demo").joinpath(f"{name}.toml").read_text("utf-8")


def _expose(camera: PlenopticCamera | FocusedPlenopticCamera, scene: Scene, tell: Progress) -> Exposure:
    """White image, calibration from it, raw image; both with photon and read noise."""
    rng = np.random.default_rng(1)

    def counted(what: str, first: float, last: float) -> Callable[[float, int], None]:
        return lambda done, total: tell(what, first + (last - first) * done / total)

    light = simulate(camera, targets.white(), progress=counted("white image", 0.0, 0.4))
    white = camera.sensor.expose(light.data, rng=rng)
    calibration = calibrate(white, separation=camera.separation, lenslet_distance=camera.lenslet_distance)
    light = simulate(camera, scene, progress=counted("raw image", 0.4, 0.95))
    return Exposure(camera.sensor.expose(light.data, rng=rng), white, calibration)


def _plenoptic(page: report.Page, folder: Path, tell: Progress) -> None:
    with as_file(files("lumigraph.demo").joinpath("plenoptic.toml")) as path:
        camera = PlenopticCamera.from_toml(path)
    depths = (-14 * mm, 0.0, 18 * mm)
    exposure = _expose(camera, three_depths(camera.object_grid, depths), tell)
    tell("decoding", 0.96)
    views = decode(devignette(exposure.raw, exposure.white), exposure.calibration)
    alphas = [camera.alpha(dz) for dz in depths]
    pictures = {name: refocus(views, alpha) for name, alpha in zip(NAMES, alphas, strict=True)}
    io.save(views, folder / "plenoptic_views.zarr")
    _save(folder, "plenoptic", exposure, pictures)

    _cameras(page, "Plenoptic 1.0: lenslets on the main-lens image", "plenoptic", camera)
    _raw(page, "1.0: what the sensor records", exposure)
    section = page.section("1.0: refocused after the exposure")
    section.text(
        "The raw image was decoded into views, one for each place on the main lens, and refocused by "
        "shearing the light field. The factor α' of each depth follows from the lens equation."
    )
    for name, alpha, dz in zip(NAMES, alphas, depths, strict=True):
        section.figure(
            pictures[name], f"Focused on the {name} target: α' = {alpha:.3f}, {_depth(dz)}", zoom=5
        )
    stopped = refocus(reduce_aperture(views, 0.4), 1.0)
    section.figure(stopped, "Aperture stopped down to 40 %: all depths at once, with more noise", zoom=5)
    rim, middle = views.data.shape[1] // 5, views.data.shape[0] // 2
    left, right = view(views, middle, rim), view(views, middle, views.data.shape[1] - 1 - rim)
    section.figure(left, "One view, from one side of the main lens", zoom=5)
    section.figure(right, "From the other side: near and far targets have moved apart", zoom=5)


def _focused(page: report.Page, folder: Path, tell: Progress) -> None:
    with as_file(files("lumigraph.demo").joinpath("focused_plenoptic.toml")) as path:
        camera = FocusedPlenopticCamera.from_toml(path)
    depths = (-4 * mm, 0.0, 5 * mm)
    exposure = _expose(camera, three_depths(camera.object_grid, depths), tell)
    tell("rendering", 0.96)
    raw = devignette(exposure.raw, exposure.white)
    patches = [camera.patch_at(dz) for dz in depths]
    pictures = {
        name: render(raw, exposure.calibration, patch) for name, patch in zip(NAMES, patches, strict=True)
    }
    _save(folder, "focused", exposure, pictures)

    _cameras(page, "Focused plenoptic 2.0: lenslets relay the image", "focused_plenoptic", camera)
    _raw(page, "2.0: what the sensor records", exposure)
    section = page.section("2.0: rendered for each depth")
    section.text(
        "Each lenslet shows a small part of the main-lens image. A patch from each, turned by 180°, tiles "
        "the picture; the patch's size decides which depth fits together without seams."
    )
    for name, patch, dz in zip(NAMES, patches, depths, strict=True):
        section.figure(pictures[name], f"Patches of {patch:.1f} px: the {name} target, {_depth(dz)}")
    blended = render(raw, exposure.calibration, patches[1], blend=True)
    section.figure(blended, "The middle target, neighbouring lenslets blended: smoother, other depths blur")


def _depth(dz: float) -> str:
    if dz == 0:
        return "in the focused plane"
    return f"{abs(dz) / mm:.0f} mm {'behind' if dz > 0 else 'before'} the focused plane"


def _save(folder: Path, name: str, exposure: Exposure, pictures: dict[str, Array]) -> None:
    io.save(exposure.raw, folder / f"{name}_raw.tiff")
    io.save(exposure.white, folder / f"{name}_white.tiff")
    io.save(exposure.calibration, folder / f"{name}_calibration.toml")
    for depth, picture in pictures.items():
        io.save(picture, folder / f"{name}_{depth}.png")


def _cameras(
    page: report.Page, title: str, name: str, camera: PlenopticCamera | FocusedPlenopticCamera
) -> None:
    section = page.section(title)
    section.lines(camera_file(name))
    section.figure(layout(camera), "Rays through the camera; heights are exaggerated", wide=True)
    description = camera.describe()
    rows = [(row.name, row.text, row.source) for row in description.rows]
    section.table(rows, header=("quantity", "value", "where it comes from"))
    for warning in description.warnings:
        section.text(f"Note: {warning}")


def _raw(page: report.Page, title: str, exposure: Exposure) -> None:
    section = page.section(title)
    pitch = exposure.calibration.lattice.pitch
    section.figure(exposure.raw, "Raw image of the scene")
    rows, columns = (n // 2 for n in exposure.raw.shape)
    half = int(3.5 * pitch)
    part = exposure.raw.data[rows - half : rows + half, columns - half : columns + half]
    section.figure(part, "Its middle, 7 lenslets wide", zoom=max(1, 420 // (2 * half)))
    section.figure(exposure.white, "White image: a diffuser before the main lens")
    overlay = plots.lattice(exposure.white, exposure.calibration)
    section.figure(overlay, "The lattice found on the white image", wide=True)
    section.lines(exposure.calibration.report())
