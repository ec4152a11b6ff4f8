"""`lumigraph process`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import line, progress
from lumigraph.cli.options import section
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Quantity, Result

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.processing import Processed

_PICTURES = {
    "all-in-focus.png": "Sharp at every depth.",
    "depth.png": "Depth: near to far as white to black, unknown as black.",
}


@Parameter(name="*", group=section("Raw image"))
@dataclass(frozen=True)
class GivenOptions:
    """Files and camera that belong to the raw image.

    Parameters
    ----------
    white
        White image (flat-field): shows the micro-images, and evens the brightness.
    dark
        Image with the lens covered: subtracted; shows which pixels are hot.
    camera
        Camera file, or a name of the catalogue: gives lengths; of a microscope it gives a volume. Left out,
        napari-LF's metadata.txt beside the raw image is read, and the white and dark images that it names.
    calibration
        File made by 'lumigraph calibrate', or by the camera's maker; one that lies beside the raw image
        under its name (.xml, .ini) is found.
    """

    white: Path | None = None
    dark: Path | None = None
    camera: str | None = None
    calibration: Path | None = None


GIVEN = GivenOptions()


def process(
    raw: Path,
    /,
    *,
    folder: Annotated[Path, Parameter(name=["--output", "-o"])],
    given: GivenOptions = GIVEN,
    common: ReportOptions = REPORTED,
) -> Result:
    """Make everything from a raw image: a sharp picture, depth, a film, a page to look at and to send.

    Finds out whether it is of a plenoptic camera 1.0 or 2.0, of a multi-focus camera or of a microscope,
    calibrates it, decodes or renders it, and says why it took it for what. Run again, it keeps what stands
    in the folder and has not changed.

    Example: `lumigraph process raw.png --white white.png -o results`

    Example: `lumigraph process raw.tif --white white.tif --dark dark.tif --camera lfm-guv -o results`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr, ...), or views (.zarr, .h5, a folder).
    folder
        Folder for the results, which is made.
    """
    from lumigraph.processing import process as run

    common.check()
    files.check_inside([folder / name for name in ("calibration.toml", "views.zarr", "depth.tiff")])
    line(_expected(given))
    with progress("process") as shown:
        made = run(
            raw, white=given.white, dark=given.dark, camera=given.camera, calibration=given.calibration,
            folder=folder, progress=shown,
        )  # fmt: skip
    kept = (f"kept from before: {', '.join(made.kept)}",) if made.kept else ()
    values = (Quantity("kind", made.kind), Quantity("kept", list(made.kept)))
    guesses = {guess.what: {"value": guess.value, "reason": guess.reason} for guess in made.guesses}
    return Result(
        "Process", f"Results of {raw.name}.", made, (*(str(guess) for guess in made.guesses), *kept), values,
        lambda: _figures(made), made.notes, tuple(made.folder / name for name in made.files),
        {"guesses": guesses},
    )  # fmt: skip


def _expected(given: GivenOptions) -> str:
    """Estimated time and memory, before it begins."""
    if given.camera is None:
        return "process: for a raw image of some megapixels half a minute and 1 GB; progress follows"
    return "process: half a minute and 1 GB, of a microscope up to 2 minutes and 3 GB; progress follows"


def _figures(made: "Processed") -> "Iterator[Figure]":
    from lumigraph import io

    for name, caption in _PICTURES.items():
        picture: Any = io.open(made.folder / name)
        yield Figure(picture.data, caption)
