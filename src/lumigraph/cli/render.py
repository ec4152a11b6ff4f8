"""`lumigraph render`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress, report
from lumigraph.cli.options import COMMON, Common, Output
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration


def render(
    raw: Path,
    /,
    *,
    output: Output,
    calibration: Path | None = None,
    white: Path | None = None,
    patch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None,
    camera: str | None = None,
    common: Common = COMMON,
) -> None:
    """Render the picture of a focused plenoptic camera 2.0 from its raw image.

    Example: `lumigraph render raw.tiff --camera camera.toml -o picture.png`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr).
    output
        Picture (.png, .tiff, .zarr).
    calibration
        File made by 'lumigraph calibrate'.
    white
        White image: the raw image is divided by it, and calibrated from it without --calibration.
    patch
        Size of the piece of each micro-image, in pixels; negative for a Galilean camera.
    camera
        Camera file: gives the patch, and the calibration if no other is given.
    """
    from lumigraph import calibration as verbs
    from lumigraph import io, rendering

    files.check_output(output, files.PICTURES)
    size, known = _from_camera(camera, patch)
    picture = files.read_raw(raw)
    with progress("render"):
        if known is not None and calibration is None and white is None:
            known.check_fits(picture.shape)
        elif known is not None and calibration is None and white is not None:
            picture = verbs.devignette(picture, files.read_raw(white))
            known.check_fits(picture.shape)
        else:
            picture, known = files.calibration_for(picture, calibration, white)
        image = rendering.render(picture, known, patch=size)
    io.save(image, output)
    rows, columns = image.shape[:2]
    text = f"{rows} x {columns} px with patches of {size:.4g} px\nwritten {output}"
    report(common, text, {"shape": image.shape, "patch_px": size, "output": str(output)})


def _from_camera(camera: str | None, patch: float | None) -> "tuple[float, Calibration | None]":
    """Patch and calibration of a camera file; a patch given by itself goes before it."""
    if camera is None and patch is None:
        raise FormatError("the size of the patches is not known. Give --patch PIXELS or --camera FILE.")
    if patch is not None and (not abs(patch) < float("inf") or patch == 0):
        raise FormatError(f"--patch is {patch:g} px but must be a finite number other than 0.")
    if camera is None:
        return float(patch or 0.0), None
    from lumigraph.instruments import FocusedPlenopticCamera, load_camera

    described = load_camera(camera)
    if not isinstance(described, FocusedPlenopticCamera):
        raise FormatError(
            f"--camera {camera} is a {described.KIND}, which is decoded: use 'lumigraph decode'."
        )
    return (described.patch if patch is None else patch), described.calibration
