"""`lumigraph decode`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress, report
from lumigraph.cli.options import COMMON, Common, Output


def decode(
    raw: Path,
    /,
    *,
    output: Output,
    calibration: Path | None = None,
    white: Path | None = None,
    devignette: Annotated[bool | None, Parameter(negative="--no-devignette")] = None,
    common: Common = COMMON,
) -> None:
    """Decode a raw image of a plenoptic camera 1.0 into views.

    Example: `lumigraph decode raw.png --white white.png -o views.zarr`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr).
    output
        Views (.zarr, .zarr.zip).
    calibration
        File made by 'lumigraph calibrate'.
    white
        White image: the raw image is divided by it, and calibrated from it without --calibration.
    devignette
        Whether to divide by the white image; done where there is one.
    """
    from lumigraph import io, rendering

    files.check_output(output, files.VIEWS)
    picture = files.read_raw(raw)
    with progress("decode"):
        picture, found = files.calibration_for(picture, calibration, white, devignette=devignette)
        views = rendering.decode(picture, found)
    io.save(views, output)
    nv, nu, nt, ns = views.data.shape[:4]
    text = f"{nv} x {nu} views of {nt} x {ns} px\nwritten {output}"
    report(common, text, {"shape": views.data.shape, "separation": views.separation, "output": str(output)})
