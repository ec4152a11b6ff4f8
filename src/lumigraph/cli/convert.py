"""`lumigraph convert`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lumigraph.cli.files import check_output
from lumigraph.cli.options import COMMON, Common, Output, length
from lumigraph.core.result import Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration
    from lumigraph.metrology import MetricCamera

_ENDINGS = {"compote": (".json",), "lftoolbox": (".json",), None: (".toml", ".xml")}


def convert(
    source: Path,
    /,
    *,
    to: Literal["compote", "lftoolbox"] | None = None,
    calibration: Path | None = None,
    shape: tuple[int, int] | None = None,
    distance: str | None = None,
    f_number: float | None = None,
    directions: int | None = None,
    pixel_pitch: str | None = None,
    view_pitch: float | None = None,
    output: Output,
    common: Common = COMMON,
) -> Result:
    """Turn a camera, or the calibration of its lenslets, into the file of another program.

    SOURCE is a camera that 'lumigraph board' measured (.json), which needs --calibration; a file of COMPOTE
    (intrinsics.json) or LFToolbox (CalInfo.json); or a calibration (.toml, Raytrix' .xml, .ini). What a file
    cannot hold is refused, or named. Without --to the output is a calibration of lumigraph (.toml), with the
    lengths that decode, render and depth use, or Raytrix' (.xml).

    Example: `lumigraph convert camera.json --calibration white.toml --to compote -o intrinsics.json`

    Example: `lumigraph convert camera.json --calibration white.toml --to lftoolbox --directions 9 -o a.json`

    Example: `lumigraph convert intrinsics.json -o calibration.toml`

    Example: `lumigraph convert calibration.toml -o calibration.xml`

    Parameters
    ----------
    source
        The file.
    to
        Program whose format is written, if the ending does not determine it.
    calibration
        Micro-images of a camera that 'lumigraph board' measured, which 'lumigraph calibrate' finds.
    shape
        Rows and columns of the raw images, for files without them (Raytrix' .xml).
    distance
        Distance where COMPOTE's distortion equals the camera's, such as '0.4 m'; the plane in focus if left
        out.
    f_number
        F-number of the main lens, for COMPOTE.
    directions
        Views along each axis of LFToolbox' light fields.
    pixel_pitch
        Pixel pitch, such as '1.4 um', if LFToolbox' file does not contain it.
    view_pitch
        Distance between views of LFToolbox' file [px]; the micro-images' pitch over the views if left out.
    output
        File to write.
    """
    check_output(output, _ENDINGS[to])
    from lumigraph import io, metrology

    camera, found = _read(source, calibration, shape, length("--pixel-pitch", pixel_pitch), view_pitch)
    notes = found.notes
    if to is None:
        io.save(found, output)
    elif camera is None:
        raise FormatError(f"{source} holds no lengths of a camera. Give one that `lumigraph board` measured.")
    else:
        far = length("--distance", distance)
        left = metrology.save_camera(
            camera, found, output, to, distance=far, f_number=f_number, directions=directions
        )
        notes = (*notes, *left)
    return Result(
        "Converted", "A camera in the format of another program.", camera or found, (_headline(found),),
        () if camera is None else tuple(_quantities(camera)), notes=notes, written=(output,),
    )  # fmt: skip


def _read(
    source: Path,
    calibration: Path | None,
    shape: tuple[int, int] | None,
    pixel: float | None,
    views: float | None,
) -> "tuple[MetricCamera | None, Calibration]":
    """Lengths, where the file has them, and micro-images."""
    from lumigraph import io, metrology
    from lumigraph.core.calibration import Calibration

    if source.suffix.lower() != ".json":
        return None, io.open(source, Calibration, shape=shape)
    if not metrology.is_measured(source):
        return metrology.load_camera(source, pixel_pitch=pixel, view_pitch=views)
    camera = metrology.load(source).camera
    if calibration is None:
        raise FormatError(
            f"{source} has no lattice of micro-images. Give --calibration, of `lumigraph calibrate`."
        )
    found = io.open(calibration, Calibration, shape=shape)
    known = {"separation": camera.separation, "lenslet_distance": camera.lenslet_distance}
    return camera, replace(found, pixel_pitch=camera.pixel_pitch, **known)


def _headline(found: "Calibration") -> str:
    lattice = found.lattice
    kinds = f", {lattice.kinds} kinds" if lattice.kinds > 1 else ""
    return f"{lattice.layout} lattice, {lattice.pitch:.4f} px{kinds}, {found.shape[0]} x {found.shape[1]} px"


def _quantities(camera: "MetricCamera") -> list[Quantity]:
    return [
        Quantity("focal_length", camera.focal_length, "m"),
        Quantity("separation", camera.separation, "m"),
        Quantity("lenslet_distance", camera.lenslet_distance, "m"),
        Quantity("exit_pupil", camera.exit_pupil, "m"),
        Quantity("pixel_pitch", camera.pixel_pitch, "m"),
    ]
