"""`lumigraph calibrate`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress, report
from lumigraph.cli.options import COMMON, Common, Output, above_zero, length

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration


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
            known = {name: getattr(described, name) for name in ("separation", "lenslet_distance")}
            known["pixel_pitch"] = described.sensor.pixel_pitch
        for name in known:
            option = f"--{name.replace('_', '-')}"
            given = above_zero(option, length(option, getattr(self, name)), "m")
            known[name] = known[name] if given is None else given
        return known


def calibrate(
    white: Path,
    /,
    *,
    output: Output,
    layout: Literal["square", "hex"] | None = None,
    pitch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    overlay: Path | None = None,
    bench: Bench = Bench(),
    common: Common = COMMON,
) -> None:
    """Find the micro-images on a white image and write their lattice.

    Example: `lumigraph calibrate white.png -o calibration.toml --overlay lattice.png`

    Parameters
    ----------
    white
        Picture of an evenly lit surface (TIFF, PNG, Zarr).
    output
        Calibration file (.toml).
    layout
        Found by itself if left out.
    pitch
        Distance of micro-images in pixels, if it is not found by itself.
    overlay
        Draw the lattice over the white image into this file (.png, .svg, .pdf).
    """
    from lumigraph import calibration as verbs
    from lumigraph import io

    files.check_output(output, (".toml",))
    if overlay is not None:
        files.check_output(overlay, files.FIGURES)
    above_zero("--pitch", pitch, "px")
    known = bench.lengths()
    picture = files.read_raw(white)
    with progress("calibrate"):
        found = verbs.calibrate(picture, layout, pitch, **known)
        if overlay is not None:
            from lumigraph import plots

            files.save_figure(plots.lattice(picture, found), overlay)
    io.save(found, output)
    report(common, f"{found.report()}\nwritten     {output}", {**_values(found), "output": str(output)})


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
        "residual_px": found.residual_px,
        "pixel_pitch": found.pixel_pitch,
        "separation": found.separation,
        "lenslet_distance": found.lenslet_distance,
    }
