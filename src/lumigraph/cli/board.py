"""`lumigraph board`."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli.files import check_output
from lumigraph.cli.options import Output, length
from lumigraph.cli.reporting import REPORTED, Reported
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.metric import Board, Corners, Measured, Nominal


@Parameter(name="*")
@dataclass(frozen=True)
class Known:
    """What is known of the camera.

    Parameters
    ----------
    focal_length
        Of the main lens, such as '50 mm'.
    focal_length_error
        How well it is known, such as '1 mm'; 2 % if left out.
    pixel_pitch
        Of the sensor, such as '5.5 um'.
    shape
        Rows and columns of the raw images.
    """

    focal_length: str | None = None
    focal_length_error: str | None = None
    pixel_pitch: str | None = None
    shape: tuple[int, int] | None = None

    def nominal(self, given: "Nominal | None") -> "Nominal":
        """Of the options, which come before what a folder says."""
        from dataclasses import replace

        from lumigraph.metric import Nominal

        f, pitch = length("--focal-length", self.focal_length), length("--pixel-pitch", self.pixel_pitch)
        if given is None and None in (f, pitch, self.shape):
            raise FormatError("give --focal-length, --pixel-pitch and --shape of the camera.")
        known = {"focal_length": f, "pixel_pitch": pitch, "shape": self.shape}
        known = {name: value for name, value in known.items() if value is not None}
        nominal = Nominal(**known) if given is None else replace(given, **known)
        error = length("--focal-length-error", self.focal_length_error)
        return nominal if error is None else replace(nominal, focal_length_error=error / nominal.focal_length)


def board(
    corners: Path,
    /,
    *,
    board: Annotated[str | None, Parameter(name="--board")] = None,
    known: Known = Known(),
    output: Output | None = None,
    common: Reported = REPORTED,
) -> Result:
    """Measure a plenoptic camera by a board of known size: its lengths, with their uncertainty.

    CORNERS says where lenslets show the board's corners on three or more pictures: a table (.csv) with the
    columns frame, corner, y, x, center_y, center_x, kind; or a folder of COMPOTE's (bap.csv, centers.csv,
    camera.json, scene.json), which also says what the board and the camera are.

    Example: `lumigraph board corners.csv --board "9 x 5 corners, 10 mm" --focal-length "50 mm" --pixel-pitch
    "5.5 um" --shape 3068 4080 -o camera.json`

    Parameters
    ----------
    corners
        Table or folder.
    board
        Corners across and down and their spacing, such as '9 x 5 corners, 10 mm'.
    output
        File for the camera (.json), which lumigraph.metric.load reads.
    """
    common.check()
    if output is not None:
        check_output(output, (".json",))
    from lumigraph import metric

    seen, target, given = _read(corners)
    if board is not None:
        target = metric.Board.from_text(board)
    if target is None:
        raise FormatError("give --board, such as '9 x 5 corners, 10 mm'.")
    found = metric.board(seen, target, known.nominal(given))
    if output is not None:
        metric.save(found, output)
    return Result(
        "Board",
        f"A camera measured by {len(seen)} corners of {corners.name}.",
        found,
        _headline(found),
        found.quantities(),
        lambda: _figures(found),
        found.notes,
        () if output is None else (output,),
    )


def _read(path: Path) -> "tuple[Corners, Board | None, Nominal | None]":
    from lumigraph import metric

    if path.is_dir():
        return metric.load_compote(path)
    return metric.load_corners(path), None, None


def _headline(found: "Measured") -> tuple[str, ...]:
    lengths = [f"{one.label} {one}" for one in found.quantities()[:3]]
    return (
        *lengths,
        f"residual {found.residual_px:.3f} px along an axis, {len(found.poses)} pictures",
    )


def _figures(found: "Measured") -> Iterable[Figure]:
    rows = [["picture", "distance", "tilt", "off", "expected"]]
    for pose in found.poses:
        tilt = math.degrees(math.hypot(*pose.turn[1:]))
        rows.append([
            str(pose.frame), f"{pose.shift[0] * 1e3:.2f} mm", f"{tilt:.1f}°",
            f"{pose.residual_px:.3f} px", f"{pose.expected_px:.3f} px",
        ])  # fmt: skip
    yield Figure(rows, section="Pictures")
