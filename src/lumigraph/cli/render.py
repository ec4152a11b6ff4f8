"""`lumigraph render`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress, report
from lumigraph.cli.options import COMMON, Common, Output, length
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration


@Parameter(name="*")
@dataclass(frozen=True)
class Tiles:
    """How large the piece of each micro-image is.

    Parameters
    ----------
    patch
        Size of the piece of each micro-image, in pixels; negative for a Galilean camera.
    camera
        Camera file: gives the patch, and the calibration if no other is given.
    depth
        Of what shall be seamless, from the focused plane of the camera, such as '5 mm' (farther) or
        '-5 mm' (nearer); the focused plane if left out.
    """

    patch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    camera: str | None = None
    depth: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None

    def found(self) -> "tuple[float, Calibration | None]":
        """Patch [px] and the calibration of the camera file; a patch given by itself goes before its own."""
        if self.camera is None and self.patch is None:
            raise FormatError("the size of the patches is not known. Give --patch PIXELS or --camera FILE.")
        if self.patch is not None and (not abs(self.patch) < float("inf") or self.patch == 0):
            raise FormatError(f"--patch is {self.patch:g} px but must be a finite number other than 0.")
        if self.depth is not None and (self.camera is None or self.patch is not None):
            raise FormatError("--depth says the patch of a camera. Give --camera FILE, and no --patch.")
        if self.camera is None:
            return float(self.patch or 0.0), None
        from lumigraph.instruments import FocusedPlenopticCamera, load_camera

        described = load_camera(self.camera)
        if not isinstance(described, FocusedPlenopticCamera):
            raise FormatError(
                f"--camera {self.camera} is a {described.KIND}, which is decoded: use 'lumigraph decode'."
            )
        size = described.patch_at(length("--depth", self.depth) or 0.0) if self.patch is None else self.patch
        return size, described.calibration


def render(
    raw: Path,
    /,
    *,
    output: Output,
    calibration: Path | None = None,
    white: Path | None = None,
    tiles: Tiles = Tiles(),
    common: Common = COMMON,
) -> None:
    """Render the picture of a focused plenoptic camera 2.0 from its raw image.

    Example: `lumigraph render raw.tiff --camera camera.toml --depth "5 mm" -o picture.png`

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
    """
    from lumigraph import calibration as verbs
    from lumigraph import io, rendering

    files.check_output(output, files.PICTURES)
    size, known = tiles.found()
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
