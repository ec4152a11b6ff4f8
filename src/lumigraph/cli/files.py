"""Reading inputs, checking outputs before a computation, writing them."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lumigraph.errors import CalibrationError, FormatError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage

PICTURES = (".png", ".tif", ".tiff", ".zarr", ".zarr.zip")
VIEWS = (".zarr", ".zarr.zip")
FIGURES = (".png", ".svg", ".pdf")


def check_output(path: Path, endings: Sequence[str]) -> None:
    """Refuse an output that could not be written in the end.

    Raises
    ------
    FormatError
        Another extension, or a folder that does not exist.
    """
    from lumigraph.io.target import check_target

    check_target(path, endings)


def read_raw(path: Path) -> "RawImage":
    """A raw image of finite values.

    Raises
    ------
    FormatError
        Something else, or NaN.
    """
    import lumigraph.io as io
    from lumigraph.core import checks
    from lumigraph.core.raw import RawImage

    raw = io.open(path)
    if not isinstance(raw, RawImage):
        raise FormatError(f"{path} holds a {type(raw).__name__} where a raw image is needed.")
    checks.finite_array(str(path), raw.data, FormatError)
    return raw


def read_views(path: Path) -> "LightField | RawImage":
    """A light field, or the raw image it can be decoded from.

    Raises
    ------
    FormatError
        Something else, or NaN.
    """
    import lumigraph.io as io
    from lumigraph.core import checks
    from lumigraph.core.calibration import Calibration

    found = io.open(path)
    if isinstance(found, Calibration):
        raise FormatError(f"{path} holds a calibration where views (.zarr) or a raw image are needed.")
    checks.finite_array(str(path), found.data, FormatError)
    return found


def read_calibration(path: Path) -> "Calibration":
    """A calibration.

    Raises
    ------
    FormatError
        Another kind of file.
    """
    from lumigraph.io import load_calibration

    return load_calibration(path)


def calibration_for(
    raw: "RawImage", calibration: Path | None, white: Path | None, *, devignette: bool | None = None
) -> "tuple[RawImage, Calibration]":
    """The raw image, devignetted if there is a white image, and its calibration.

    Parameters
    ----------
    raw
        Of the camera.
    calibration
        File made by `lumigraph calibrate`; None calibrates from the white image.
    white
        Taken with the same settings.
    devignette
        Whether to divide by the white image; None does where there is one.

    Raises
    ------
    CalibrationError
        Neither is given, or they do not belong together.
    """
    from lumigraph import calibration as verbs

    if calibration is None and white is None:
        raise CalibrationError(
            "where the micro-images stand is not known. Give --calibration FILE or --white FILE."
        )
    if devignette and white is None:
        raise CalibrationError("--devignette needs the white image. Give --white FILE.")
    picture = None if white is None else read_raw(white)
    found = read_calibration(calibration) if calibration is not None else verbs.calibrate(_given(picture))
    found.check_fits(raw.shape)
    if picture is not None and devignette is not False:
        raw = verbs.devignette(raw, picture)
    return raw, found


def save_figure(figure: Any, path: Path) -> None:
    """Write a matplotlib figure atomically; its extension says which format."""
    from lumigraph.io.target import replacing

    with replacing(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower(), dpi=130)


def _given(picture: "RawImage | None") -> "RawImage":
    assert picture is not None  # the caller has seen to it
    return picture
