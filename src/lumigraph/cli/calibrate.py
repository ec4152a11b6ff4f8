"""`lumigraph calibrate`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, above_zero, length, pixels, section
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import CalibrationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.calibration import Calibration
    from lumigraph.core.raw import RawImage


@Parameter(name="*", group=section("Known beforehand"))
@dataclass(frozen=True)
class CameraOptions:
    """Camera properties that are known beforehand.

    Parameters
    ----------
    pixel_pitch
        Pixel pitch of the sensor, such as '6.45 um'; that of the white image's file if left out.
    separation
        Main lens to lenslets, such as '400 mm'.
    lenslet_distance
        Lenslets to sensor, such as '18.6 mm'.
    camera
        Camera file with all three lengths.
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
            known = {
                "pixel_pitch": described.sensor.pixel_pitch, "separation": described.pupil_distance,
                "lenslet_distance": described.lenslet_distance,
            }  # fmt: skip
        for name in known:
            option = f"--{name.replace('_', '-')}"
            given = above_zero(option, length(option, getattr(self, name)), "m")
            known[name] = known[name] if given is None else given
        return known

    def compared(self, found: "Calibration") -> tuple[str, ...]:
        """Comparison of the picture with the camera of --camera, in a line."""
        from lumigraph.instruments import load_camera
        from lumigraph.preparation.agreement import implied

        camera = None if self.camera is None else load_camera(self.camera)
        return () if camera is None or camera.calibration is None else (implied(found.lattice, camera)[0],)


def calibrate(
    *white: Path,
    output: Output,
    layout: Literal["square", "hex", "rectangular"] | None = None,
    pitch: Annotated[float | None, Parameter(allow_leading_hyphen=True, converter=pixels)] = None,
    rotation: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    exact: Annotated[bool, Parameter(negative=())] = False,
    explain: Annotated[bool, Parameter(negative=())] = False,
    overlay: Path | None = None,
    bench: CameraOptions = CameraOptions(),
    common: ReportOptions = REPORTED,
) -> Result:
    """Find the micro-images of a microlens array (MLA) on a white image (flat-field), or on raw images alone.

    Example: `lumigraph calibrate white.png -o calibration.toml --overlay lattice.png`

    Parameters
    ----------
    white
        Picture of an evenly lit surface, several of them, or a stack, to average, or a raw image where there
        is none (TIFF, PNG, Zarr).
    output
        Calibration file (.toml).
    layout
        Arrangement of the lenslets (rectangular: two pitches); found automatically if left out.
    pitch
        Distance between micro-images in pixels, such as 15 or '15 px', where the search needs it; the mean
        of the two of a rectangular lattice.
    rotation
        Angle of the rows of lenslets from +x towards +y [degrees], where the search needs it.
    exact
        For a rectified picture: take --pitch and --rotation (0 if left out) as exact.
    explain
        Print the adjustments to make: rotation, shift, distance, tilt and aperture, against --camera.
    overlay
        Draw the lattice over the white image into this file (.png, .svg, .pdf).
    """
    from lumigraph import calibration as verbs
    from lumigraph import io
    from lumigraph.preparation.given import read_pages

    common.check()
    if not white:
        raise CalibrationError(
            "no white image is given. Write 'lumigraph calibrate white.png -o lattice.toml'."
        )
    files.check_output(output, (".toml",))
    if overlay is not None:
        files.check_output(overlay, files.FIGURES)
    above_zero("--pitch", pitch, "px")
    if explain and bench.camera is None:
        raise CalibrationError("--explain compares with the design: give the camera file, --camera FILE.")
    if exact and pitch is None:
        raise CalibrationError("--exact takes the pitch as it is given: add --pitch, such as --pitch 19.")
    known = bench.lengths()
    pictures = [page for path in white for page in read_pages(path, "all").values()]
    picture = pictures[0]
    turn = None if rotation is None else math.radians(rotation)
    with progress("calibrate") as told:
        found = verbs.calibrate(pictures, layout, pitch, rotation=turn, progress=told, **known)
        if exact and pitch is not None:
            found = verbs.exactly(found, pitch, turn or 0.0)
        if overlay is not None:
            from lumigraph import plots

            files.save_figure(plots.lattice(picture, found), overlay)
        advice = _advice(picture, bench) if explain else None
        compared = bench.compared(found)
    io.save(found, output)
    faults = () if advice is None else (Quantity("faults", list(advice.faults)),)
    lines = () if advice is None else tuple(advice.report().splitlines())
    told = () if advice is None else (Quantity("advice", list(lines)),)
    return Result(
        "Calibrate", "Where the micro-images stand on the sensor.", found,
        (*found.report().splitlines(), *lines), (*_quantities(found), *told, *faults),
        lambda: _figures(picture, found), (*found.notes, *compared), (output,),
    )  # fmt: skip


def _advice(white: "RawImage", bench: CameraOptions) -> Any:
    """Adjustments to make on the bench."""
    from lumigraph.calibration import diagnose
    from lumigraph.instruments import load_camera
    from lumigraph.instruments.lenslet_camera import LensletCamera

    camera = load_camera(str(bench.camera))
    if not isinstance(camera, LensletCamera):
        raise CalibrationError(
            f"{bench.camera} is a {camera.noun}: --explain is for plenoptic cameras. Leave it out."
        )
    return diagnose(white, camera)


def _figures(white: "RawImage", found: "Calibration") -> "Iterator[Figure]":
    import numpy as np

    from lumigraph import plots

    drawn = plots.lattice(white, found)
    yield Figure(drawn, "The lattice over the white image.", "Lattice", {"wide": True})
    distance = np.sort(np.hypot(*found.residuals.T))
    if not found.measured or not len(distance):
        return
    share = np.arange(1, len(distance) + 1) / len(distance)
    drawn = plots.curves(distance, {"": share}, xlabel="distance from the lattice [px]", ylabel="share")
    yield Figure(drawn, "Share of the micro-images that stand as near to their place.", "Residuals")
    maps = [(np.nan_to_num(found.residual_map), "residual [px]"), (np.nan_to_num(found.light_map), "light")]
    drawn = plots.images(maps, columns=2, label="0: none found")
    caption = "How far each micro-image stands from the lattice, and its brightness: the vignetting."
    yield Figure(drawn, caption, "Lenslet by lenslet")


def _quantities(found: "Calibration") -> tuple[Quantity, ...]:
    lattice = found.lattice
    return (
        Quantity("layout", lattice.layout),
        Quantity("lenslets", len(found.centers)),
        Quantity("shape", found.shape, "px"),
        Quantity("pitch_px", lattice.pitch, "px"),
        Quantity("pitches_px", lattice.pitches, "px"),
        Quantity("rotation_rad", lattice.rotation, "rad"),
        Quantity("origin_px", lattice.origin, "px"),
        Quantity("basis_px", lattice.basis),
        Quantity("residual_px", found.residual_px if found.measured else None, "px"),
        Quantity("missing", len(found.missing)),
        Quantity("fill", found.fill),
        Quantity("sharpness", found.sharpness),
        Quantity("pixel_pitch", found.pixel_pitch, "m"),
        Quantity("separation", found.separation, "m"),
        Quantity("lenslet_distance", found.lenslet_distance, "m"),
    )
