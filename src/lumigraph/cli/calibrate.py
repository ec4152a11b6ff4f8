"""`lumigraph calibrate`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, above_zero, length
from lumigraph.cli.reporting import REPORTED, Reported, told
from lumigraph.errors import CalibrationError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.raw import RawImage


@Parameter(name="*")
@dataclass(frozen=True)
class Bench:
    """What is known of the camera.

    Parameters
    ----------
    pixel_pitch
        Of the sensor, such as '6.45 um'; the white image's own if left out.
    separation
        Main lens to lenslets, such as '400 mm'.
    lenslet_distance
        Lenslets to sensor, such as '18.6 mm'.
    camera
        Camera file that says all three.
    """

    pixel_pitch: str | None = None
    separation: str | None = None
    lenslet_distance: str | None = None
    camera: str | None = None

    def lengths(self) -> dict[str, float | None]:
        """The three lengths [m]; those given by themselves go before those of the camera."""
        known: dict[str, float | None] = dict.fromkeys(("pixel_pitch", "separation", "lenslet_distance"))
        if self.camera is not None:
            from lumigraph.instruments import load_camera

            described = load_camera(self.camera)
            known = {name: getattr(described, name, None) for name in ("separation", "lenslet_distance")}
            known["pixel_pitch"] = described.sensor.pixel_pitch
        for name in known:
            option = f"--{name.replace('_', '-')}"
            given = above_zero(option, length(option, getattr(self, name)), "m")
            known[name] = known[name] if given is None else given
        return known


def calibrate(
    *white: Path,
    output: Output,
    layout: Literal["square", "hex"] | None = None,
    pitch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    rotation: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    explain: Annotated[bool, Parameter(negative=())] = False,
    overlay: Path | None = None,
    bench: Bench = Bench(),
    common: Reported = REPORTED,
) -> None:
    """Find the micro-images on a white image, or on a raw image alone, and write their lattice.

    Example: `lumigraph calibrate white.png -o calibration.toml --overlay lattice.png`

    Parameters
    ----------
    white
        Picture of an evenly lit surface, several of them to average, or a raw image where there is none
        (TIFF, PNG, Zarr).
    output
        Calibration file (.toml).
    layout
        Found by itself if left out.
    pitch
        Distance of micro-images in pixels, if it is not found by itself.
    rotation
        Of the rows of lenslets from +x towards +y in degrees, if it is not found by itself.
    explain
        Say what to turn on the bench: rotation, shift, distance, tilt and aperture, against --camera.
    overlay
        Draw the lattice over the white image into this file (.png, .svg, .pdf).
    """
    from lumigraph import calibration as verbs
    from lumigraph import io

    common.check()
    files.check_output(output, (".toml",))
    if overlay is not None:
        files.check_output(overlay, files.FIGURES)
    if not white:
        raise CalibrationError(
            "no white image is given. Write 'lumigraph calibrate white.png -o lattice.toml'."
        )
    above_zero("--pitch", pitch, "px")
    if explain and bench.camera is None:
        raise CalibrationError("--explain compares with what was meant: give the camera file, --camera FILE.")
    known = bench.lengths()
    pictures = [files.read_raw(path) for path in white]
    picture = pictures[0]
    turn = None if rotation is None else math.radians(rotation)
    with progress("calibrate"):
        found = verbs.calibrate(pictures, layout, pitch, rotation=turn, **known)
        if overlay is not None:
            from lumigraph import plots

            files.save_figure(plots.lattice(picture, found), overlay)
        advice = _advice(picture, bench) if explain else {}
    io.save(found, output)
    lines = [found.report(), *(f"note        {note}" for note in found.notes), *advice.get("advice", ())]
    text = "\n".join([*lines, f"written     {output}"])
    values = {**_values(found), **advice, "output": str(output)}
    told(common, text, values, lambda: _page(picture, found, advice), _numbers(found))


def _advice(white: "RawImage", bench: Bench) -> dict[str, Any]:
    """What to turn, one line each, and the numbers behind it."""
    from lumigraph.calibration import diagnose
    from lumigraph.instruments import load_camera
    from lumigraph.instruments.lenslet_camera import LensletCamera

    camera = load_camera(str(bench.camera))
    if not isinstance(camera, LensletCamera):
        raise CalibrationError(
            f"{bench.camera} is a {camera.KIND}: --explain is for plenoptic cameras. Leave it out."
        )
    found = diagnose(white, camera)
    return {"advice": found.report().splitlines(), "faults": list(found.faults)}


def _numbers(found: "Calibration") -> list[tuple[str, str]]:
    from lumigraph.core.picture import length

    lines = [(line[:12].strip(), line[12:]) for line in found.report().splitlines()]
    known = ("pixel_pitch", "separation", "lenslet_distance")
    return [*lines, *((name.replace("_", " "), length(getattr(found, name))) for name in known)]


def _page(white: "RawImage", found: "Calibration", advice: dict[str, Any]) -> Any:
    import numpy as np

    from lumigraph import plots
    from lumigraph.report import Page

    page = Page("Calibrate", "Where the micro-images stand on the sensor.")
    page.section("Lattice").figure(
        plots.lattice(white, found), "The lattice over the white image.", wide=True
    )
    distance = np.sort(np.hypot(*found.residuals.T))
    if not found.measured:
        page.section("Residuals").text("Not measured: the centres are the lattice points themselves.")
    elif len(distance):
        share = np.arange(1, len(distance) + 1) / len(distance)
        drawn = plots.curves(distance, {"": share}, xlabel="distance from the lattice [px]", ylabel="share")
        page.section("Residuals").figure(
            drawn, "Share of the micro-images that stand as near to their place."
        )
        maps = [
            (np.nan_to_num(found.residual_map), "residual [px]"),
            (np.nan_to_num(found.light_map), "light"),
        ]
        page.section("Lenslet by lenslet").figure(
            plots.images(maps, columns=2, label="0: none found"),
            "How far each micro-image stands from the lattice, and its brightness: the vignetting.",
        )
    if found.notes or advice:
        page.section("What to know").text("\n\n".join([*found.notes, *advice.get("advice", ())]))
    return page


def _values(found: "Calibration") -> dict[str, Any]:
    lattice = found.lattice
    return {
        "layout": lattice.layout,
        "lenslets": len(found.centers),
        "shape": found.shape,
        "pitch_px": lattice.pitch,
        "pitches_px": lattice.pitches,
        "rotation_rad": lattice.rotation,
        "origin_px": lattice.origin,
        "basis_px": lattice.basis,
        "residual_px": found.residual_px if found.measured else None,
        "missing": len(found.missing),
        "fill": found.fill,
        "sharpness": found.sharpness,
        "notes": found.notes,
        "pixel_pitch": found.pixel_pitch,
        "separation": found.separation,
        "lenslet_distance": found.lenslet_distance,
    }
