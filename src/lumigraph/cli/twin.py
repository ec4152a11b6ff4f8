"""`lumigraph twin`."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli import console
from lumigraph.cli.console import progress
from lumigraph.cli.files import PICTURES, check_output
from lumigraph.cli.options import Output, above_zero
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.raw import RawImage
    from lumigraph.metrology import Twin

_PAUSE = 0.5  # seconds between looks into a folder
_SETTLED = 1.0  # seconds since a picture was written last


def twin(
    whites: Annotated[tuple[Path, ...], Parameter(negative="")] = (),
    /,
    *,
    camera: str,
    dark: Path | None = None,
    pitch_error: float | None = None,
    watch: Path | None = None,
    output: Output | None = None,
    common: ReportOptions = REPORTED,
) -> Result:
    """Compare a bench with its camera file by white images, and print the adjustments to make.

    WHITES are white images of the bench as it stands, which are averaged. The array's height, tilt, shift
    and rotation and the diameter of the stop are reported with 95 % intervals, or as undetermined.

    Example: `lumigraph twin white.tiff --camera camera.toml`

    Example: `lumigraph twin --watch pictures/ --camera camera.toml`

    Parameters
    ----------
    whites
        White images of one state of the bench.
    camera
        Camera file, or a name of the catalogue: the intended bench.
    dark
        Picture without light.
    pitch_error
        Standard deviation of the lenslets' pitch over the pixels', as a part of it; 3e-4 if left
        out. Height and stop are known no better than that allows.
    watch
        Folder: every new picture in it is compared, until Ctrl-C; the last result is the command's.
    output
        Camera file to write (.toml): the bench as it stands, as far as a camera file holds it.
    """
    common.check()
    if output is not None:
        check_output(output, (".toml",))
    if (watch is None) == (not whites):
        raise FormatError("give white images, or --watch FOLDER.")
    above_zero("--pitch-error", pitch_error)
    from lumigraph import metrology, store
    from lumigraph.instruments import load_camera
    from lumigraph.metrology.datasheet.charts import check_camera
    from lumigraph.preparation.given import read_raw

    bench = metrology.BenchModel(check_camera(load_camera(camera)))
    unlit = None if dark is None else read_raw(dark, "dark image")

    def compared(images: "list[RawImage]") -> "Twin":
        with progress("twin") as tell:
            return metrology.twin(images, bench, dark=unlit, pitch_error=pitch_error, progress=tell)

    if watch is None:
        found = compared([read_raw(path, "white image") for path in whites])
    else:
        found = None
        try:
            for path in _arriving(watch):
                found = compared([read_raw(path, "white image")])
                for line in (path.name, *_lines(found)):
                    console.line(line)
        except KeyboardInterrupt:
            if found is None:
                raise
    assert found is not None  # the folder is watched until there is one
    notes, written = found.notes, ()
    if output is not None:
        fixed, left = metrology.corrected(bench.camera, found)
        store.write_bytes(output, fixed.to_toml().encode())
        notes, written = (*notes, *left), (output,)
    about = "What is out of place on a bench, by its white images against those of the camera file."
    rows = [["what to do"], *([one] for one in _lines(found))]
    return Result(
        "Twin", about, found, _lines(found), found.quantities(),
        lambda: iter((Figure(rows, section="Instructions"),)), notes, written,
        extra={"instructions": found.instructions()},
    )  # fmt: skip


def _lines(found: "Twin") -> tuple[str, ...]:
    return found.instructions() or ("nothing is out of place as far as the white images tell",)


def _arriving(folder: Path) -> Iterator[Path]:
    """Pictures that come into a folder after the command began, each once it is written."""
    if not folder.is_dir():
        raise FormatError(f"--watch {folder} is no folder.")
    known = {path: path.stat().st_mtime for path in folder.iterdir()}
    while True:
        for path in sorted(folder.iterdir()):
            if path.suffix.lower() not in PICTURES or not path.is_file():
                continue
            written = path.stat().st_mtime
            if known.get(path) != written and time.time() - written > _SETTLED:
                known[path] = written
                yield path
        time.sleep(_PAUSE)
