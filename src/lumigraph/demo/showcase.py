"""Demonstration: two camera files become a report that leads with the pictures."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lumigraph import io, plots, report
from lumigraph.calibration import calibrate, devignette
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, Stage, silent, within
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.plots import layout
from lumigraph.rendering import decode, reduce_aperture, refocus, render, sub_aperture
from lumigraph.samples import BenchSample, bench, camera_file
from lumigraph.units import mm

Living = Callable[[LightField, Path], None]
"""Writes the viewer's page of a light field into a file."""

NAMES = ("near", "middle", "far")
"""The three depths, from the camera outwards."""

LIVING = "plenoptic_views.html"

INTRODUCTION = """
One exposure of a simulated plenoptic camera, refocused after the fact. A fine star stands in front, a
resolution chart in the focused plane, a coarse star behind.

Two camera files are all that went in. Light was propagated from the scene through the main lens and the
lenslets to the sensor; the lattice of micro-images was found on a simulated white image alone.
"""


@dataclass(frozen=True, slots=True)
class _Shown:
    """One camera's exposure and what came of it."""

    title: str
    kind: str
    sample: BenchSample
    calibration: Calibration


def run(
    output: str | os.PathLike[str] = "demo", progress: Progress | None = None, *, living: Living | None = None
) -> Path:
    """Run the demonstration; returns the path of the report.

    Writes ``report.html`` and, beside it, raw and white images (TIFF), calibrations (TOML), the decoded views
    (Zarr) and the refocused pictures (PNG).

    Parameters
    ----------
    output
        Folder to write into; made when missing.
    progress
        Called as ``progress(fraction)`` of the whole, a `core.progress.Stage`.
    living
        Writes the viewer's page of the views, which the report then shows first.
    """
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    tell = progress or silent
    page = report.Page("lumigraph: a demonstration", INTRODUCTION)
    start = time.perf_counter()
    first = _plenoptic(page, folder, living, within(tell, 0.0, 0.65, "1.0 camera"))
    second = _focused(page, folder, within(tell, 0.65, 1.0, "2.0 camera"))
    for shown in (first, second):
        _recorded(page, shown)
    for shown in (first, second):
        _numbers(page, shown)
    seconds = time.perf_counter() - start
    page.section("Time").text(f"Both cameras took {seconds:.0f} s.")
    page.write(folder / "report.html")
    return folder / "report.html"


def _exposed(title: str, kind: str, tell: Progress) -> _Shown:
    """White image and raw image of a bench, and the lattice found on the white image."""
    sample = bench(kind, progress=within(tell, 0.0, 0.95))
    camera = sample.camera
    found = calibrate(sample.white, separation=camera.separation, lenslet_distance=camera.lenslet_distance)
    return _Shown(title, kind, sample, found)


def _plenoptic(page: report.Page, folder: Path, living: Living | None, tell: Progress) -> _Shown:
    shown = _exposed("Plenoptic 1.0", "plenoptic", tell)
    sample, camera, depths = shown.sample, shown.sample.camera, shown.sample.depths
    tell(Stage(0.96, "decoding"))
    views = decode(devignette(sample.raw, sample.white), shown.calibration)
    alphas = [camera.alpha(dz) for dz in depths]
    pictures = {name: refocus(views, alpha, oversample=1) for name, alpha in zip(NAMES, alphas, strict=True)}
    io.save(views, folder / "plenoptic_views.zarr")
    _save(folder, "plenoptic", shown, pictures)
    if living is not None:
        living(views, folder / LIVING)
        page.section("Click what should be sharp").frame(LIVING, "The light field in the viewer")
    section = page.section("Refocused after the exposure")
    for name, alpha, dz in zip(NAMES, alphas, depths, strict=True):
        section.figure(
            pictures[name], f"Focused on the {name} target, {_depth(dz)}: α' = {alpha:.3f}", zoom=5
        )
    stopped = refocus(reduce_aperture(views, 0.4), 1.0, oversample=1)
    section.figure(stopped, "Aperture stopped down to 40 %: more depth of field, more noise", zoom=5)
    rim, middle = views.data.shape[1] // 5, views.data.shape[0] // 2
    sides = rim, views.data.shape[1] - 1 - rim
    section.figure(sub_aperture(views, middle, sides[0]), "One view, from one side of the main lens", zoom=5)
    section.figure(
        sub_aperture(views, middle, sides[1]), parallax(views, sides, (alphas[0], alphas[2])), zoom=5
    )
    section.text(
        "The raw image was decoded into views, one for each place on the main lens, and refocused by "
        "shearing the light field. The factor α' of each depth follows from the lens equation."
    )
    return shown


def parallax(views: LightField, sides: tuple[int, int], alphas: tuple[float, float]) -> str:
    """Caption of a view: where the near and the far target have gone since the one on the other side.

    In closed form a target of refocus factor α' moves by (1 - α') Δu.
    """
    apart = (views.aperture.x[sides[1]] - views.aperture.x[sides[0]]) / views.lenslets.pitch[1]
    near, far = ((1 - alpha) * apart for alpha in alphas)
    ways = ["right" if move > 0 else "left" for move in (near, far)]
    return (
        f"From the other side: the near target has moved to the {ways[0]}, the far one to the {ways[1]}. "
        f"By geometry {abs(near):.1f} and {abs(far):.1f} lenslets; diffraction mixes neighbouring views and "
        "takes some of it"
    )


def _focused(page: report.Page, folder: Path, tell: Progress) -> _Shown:
    shown = _exposed("Plenoptic 2.0", "focused-plenoptic", tell)
    sample, camera, depths = shown.sample, shown.sample.camera, shown.sample.depths
    tell(Stage(0.96, "rendering"))
    assert isinstance(camera, FocusedPlenopticCamera)  # as its file says
    raw = devignette(sample.raw, sample.white)
    patches = [camera.patch_at(dz) for dz in depths]
    pictures = {
        name: render(raw, shown.calibration, patch) for name, patch in zip(NAMES, patches, strict=True)
    }
    _save(folder, "focused", shown, pictures)
    section = page.section("A focused plenoptic (2.0) camera, rendered for each depth")
    for name, patch, dz in zip(NAMES, patches, depths, strict=True):
        section.figure(pictures[name], f"Patches of {patch:.1f} px: the {name} target, {_depth(dz)}")
    blended = render(raw, shown.calibration, patches[1], blend=True)
    section.figure(blended, "The middle target, neighbouring lenslets blended: smoother, other depths blur")
    section.text(
        "Each lenslet shows a small part of the main-lens image. A patch from each, turned by 180°, tiles "
        "the picture; the patch's size decides which depth fits together without seams."
    )
    return shown


def _depth(dz: float) -> str:
    if dz == 0:
        return "in the focused plane"
    return f"{abs(dz) / mm:.0f} mm {'behind' if dz > 0 else 'before'} the focused plane"


def _save(folder: Path, name: str, shown: _Shown, pictures: dict[str, Array]) -> None:
    io.save(shown.sample.raw, folder / f"{name}_raw.tiff")
    io.save(shown.sample.white, folder / f"{name}_white.tiff")
    io.save(shown.calibration, folder / f"{name}_calibration.toml")
    for depth, picture in pictures.items():
        io.save(picture, folder / f"{name}_{depth}.png")


def _recorded(page: report.Page, shown: _Shown) -> None:
    raw, white = shown.sample.raw, shown.sample.white
    section = page.section(f"{shown.title}: what the sensor recorded")
    section.figure(raw, "Raw image of the scene")
    rows, columns = (n // 2 for n in raw.shape)
    half = int(3.5 * shown.calibration.lattice.pitch)
    part = raw.data[rows - half : rows + half, columns - half : columns + half]
    section.figure(part, "Its middle, 7 lenslets wide", zoom=max(1, 420 // (2 * half)))
    section.figure(white, "White image: a diffuser before the main lens")
    overlay = plots.lattice(white, shown.calibration)
    section.figure(overlay, "The lattice found on the white image", wide=True)
    section.figure(layout(shown.sample.camera), "Rays through the camera; heights are exaggerated", wide=True)


def _numbers(page: report.Page, shown: _Shown) -> None:
    section = page.section(f"{shown.title}: numbers", folded=True)
    section.lines(camera_file(shown.kind))
    description = shown.sample.camera.describe()
    rows = [(row.name, row.text, row.source) for row in description.rows]
    section.table(rows, header=("quantity", "value", "where it comes from"))
    for warning in description.warnings:
        section.text(f"Note: {warning}")
    section.lines(shown.calibration.report())
