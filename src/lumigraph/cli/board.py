"""`lumigraph board`."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lumigraph.cli.console import progress
from lumigraph.cli.files import check_output
from lumigraph.cli.options import Output, length, section
from lumigraph.cli.origin import NO_ORIGIN, RawOptions
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.result import Figure, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.checks import Pair
    from lumigraph.metrology import Board, Corners, Measured, Nominal, Plan


_ARRAY = ("lenslet_pitch", "micro_images")
"""Values of the array, which `Nominal` takes as their ratio."""


@Parameter(name="*", group=section("Known beforehand"))
@dataclass(frozen=True)
class KnownCamera:
    """Camera properties that are known beforehand.

    Parameters
    ----------
    focal_length
        Focal length of the main lens, such as '50 mm'; that of --camera if left out.
    focal_length_error
        Standard error of the focal length, such as '1 mm'; 2 % if left out.
    pixel_pitch
        Pixel pitch of the sensor, such as '5.5 um'; that of the raw images or of --camera if left out.
    shape
        Rows and columns of the raw images, for a table of corners.
    lenslet_distance
        Lenslets to sensor, such as '0.42 mm', of a camera 1.0 their focal length; that of --camera if
        left out. It checks the board's spacing, which nothing else does.
    lenslet_distance_error
        Standard error of that distance, such as '0.02 mm'; 5 % if left out.
    lenslet_pitch
        Pitch of the lenslets, if it is known well, such as '125.02 um': with the pitch of the micro-images it
        gives f and distances.
    lenslet_pitch_error
        Standard error of the pitch, such as '0.01 um'; 0.03 % if left out. With it, --camera's pitch is used.
    micro_image_pitch
        Pixels between micro-images, for a table of corners; of raw images it is measured.
    wavelength
        Wavelength, such as '532 nm', for raw images: what lenslets of a camera 1.0 spill into their
        neighbours' micro-images, and how far outwards those of a camera 2.0 show corners, is allowed for.
        That of --camera, or 550 nm, if left out.
    """

    focal_length: str | None = None
    focal_length_error: str | None = None
    pixel_pitch: str | None = None
    shape: tuple[int, int] | None = None
    lenslet_distance: str | None = None
    lenslet_distance_error: str | None = None
    lenslet_pitch: str | None = None
    lenslet_pitch_error: str | None = None
    micro_image_pitch: float | None = None
    wavelength: str | None = None

    def nominal(self, given: dict[str, Any]) -> "Nominal":
        """Nominal camera: options come before values from files."""
        from lumigraph.metrology import Nominal

        apart, known = self._apart(given), self._lengths(given)
        nominal = self._sure(Nominal(**known))
        if apart is None:
            return nominal
        lenslets, seen = apart
        nominal = replace(nominal, pitch_ratio=seen * nominal.pixel_pitch / lenslets)
        error = length("--lenslet-pitch-error", self.lenslet_pitch_error)
        return nominal if error is None else replace(nominal, pitch_ratio_error=error / lenslets)

    def _lengths(self, given: dict[str, Any]) -> dict[str, Any]:
        """Values of main lens, sensor and b from options and files, by their names in `Nominal`."""
        own = {
            name: length(f"--{name.replace('_', '-')}", getattr(self, name))
            for name in ("focal_length", "pixel_pitch", "lenslet_distance")
        } | {"shape": self.shape}
        known = {name: value for name, value in given.items() if name not in _ARRAY}
        known |= {name: value for name, value in own.items() if value is not None}
        lacking = [
            f"--{name.replace('_', '-')}"
            for name in ("focal_length", "pixel_pitch", "shape")
            if name not in known
        ]
        if lacking:
            raise FormatError(f"give {', '.join(lacking)} of the camera.")
        return known

    def _sure(self, nominal: "Nominal") -> "Nominal":
        """Nominal camera with errors that are given as lengths."""
        f = length("--focal-length-error", self.focal_length_error)
        b = length("--lenslet-distance-error", self.lenslet_distance_error)
        if f is not None:
            nominal = replace(nominal, focal_length_error=f / nominal.focal_length)
        if b is None:
            return nominal
        if nominal.lenslet_distance is None:
            raise FormatError("--lenslet-distance-error needs --lenslet-distance, or --camera.")
        return replace(nominal, lenslet_distance_error=b / nominal.lenslet_distance)

    def _apart(self, given: dict[str, Any]) -> "Pair | None":
        """Pitch of the lenslets [m], and that of their micro-images [px]."""
        pitch = length("--lenslet-pitch", self.lenslet_pitch)
        if pitch is None and self.lenslet_pitch_error is None:
            return None
        lenslets, seen = (
            pitch or given.get("lenslet_pitch"),
            self.micro_image_pitch or given.get("micro_images"),
        )
        if lenslets is None or seen is None:
            lacking = "--lenslet-pitch, or --camera" if lenslets is None else "--micro-image-pitch, in pixels"
            raise FormatError(f"give {lacking}: the lenslets' pitch is compared with the micro-images'.")
        return lenslets, seen


def board(
    sources: Annotated[tuple[Path, ...], Parameter(negative="")],
    /,
    *,
    board: Annotated[str | None, Parameter(name="--board")] = None,
    origin: RawOptions = NO_ORIGIN,
    known: KnownCamera = KnownCamera(),
    in_views: Annotated[bool, Parameter(negative="")] = False,
    table: Path | None = None,
    pictures: Annotated[int, Parameter(allow_leading_hyphen=True)] = 8,
    output: Output | None = None,
    common: ReportOptions = REPORTED,
) -> Result:
    """Measure a plenoptic camera by a board of known size: its lengths, with their uncertainty.

    SOURCES are raw images of the board, three or more, in which the corners are found: behind the lenslets
    of a camera 2.0, or in the views of a camera 1.0 (--in-views, or --camera of such a camera). All of the
    board must be on each picture, but of ChArUco boards any six corners do. Finding boards needs OpenCV
    (pip install 'lumigraph[board]'), but for chessboards in views. Or SOURCES are one table (.csv) of where
    lenslets show them, with the columns frame, corner, y, x, center_y, center_x, kind, and in_views of a
    camera 1.0; or one folder of COMPOTE's (bap.csv, centers.csv, camera.json, scene.json), which also says
    what the board and the camera are. Or the word plan: which pictures of the board to take with --camera,
    and how precise its lengths will be.

    Example: `lumigraph board plan --camera camera.toml --board "9 x 5 corners, 10 mm"`

    Example: `lumigraph board raw1.png raw2.png raw3.png --white white.png --board "9 x 5 corners, 10 mm"
    --focal-length "50 mm" --pixel-pitch "5.5 um" -o camera.json`

    Example: `lumigraph board raw*.png --white white.png --board "9 x 6 charuco, 10 mm, markers 7 mm,
    DICT_4X4_50" --focal-length "50 mm" --pixel-pitch "5.5 um" -o camera.json`

    Example: `lumigraph board corners.csv --board "9 x 5 corners, 10 mm" --focal-length "50 mm" --pixel-pitch
    "5.5 um" --shape 3068 4080 -o camera.json`

    Parameters
    ----------
    sources
        Raw images, or one table or folder, or plan.
    board
        Inner corners of a chessboard across and down and their spacing, such as '9 x 5 corners, 10 mm'. Or
        dots, with their diameter unless it is half of the spacing: '11 x 4 dots, 10 mm, dots 4 mm'; or, with
        the way from row to row, '4 x 11 asymmetric dots, 10 mm'. Or a ChArUco board, by its inner corners
        (one less than squares): '9 x 6 charuco, 10 mm, markers 7 mm, DICT_4X4_50'.
    in_views
        The raw images are of a camera 1.0, whose views show the corners.
    table
        File for the corners that were found on raw images (.csv).
    pictures
        Number of pictures to plan.
    output
        File for the camera (.json), which lumigraph.metrology.load reads.
    """
    common.check()
    for path, endings in ((output, (".json",)), (table, (".csv",))):
        if path is not None:
            check_output(path, endings)
    from lumigraph import metrology

    target = None if board is None else metrology.Board.from_text(board)
    if sources == (Path("plan"),):
        return _planned(origin, target, known, pictures)
    seen, target, given, told = _read(
        sources, target, origin, in_views, length("--wavelength", known.wavelength)
    )
    found = metrology.board(seen, target, known.nominal(given))
    written = [path for path in (output, table) if path is not None]
    if output is not None:
        metrology.save(found, output)
    if table is not None:
        metrology.save_corners(seen, table)
    return Result(
        "Board",
        f"A camera measured by {len(seen)} places of corners on {len(seen.frames)} pictures.",
        found,
        _headline(found),
        found.quantities(),
        lambda: _figures(found),
        (*told, *found.notes),
        tuple(written),
    )


def _read(
    sources: tuple[Path, ...],
    board: "Board | None",
    origin: RawOptions,
    views: bool,
    wavelength: float | None,
) -> "tuple[Corners, Board, dict[str, Any], tuple[str, ...]]":
    """Corners, their board, what the files say of the camera, and what was done to raw images."""
    from lumigraph import metrology

    first, alone = sources[0], len(sources) == 1
    if alone and first.is_dir():
        seen, told, known = metrology.load_compote(first)
        given = {name: getattr(known, name) for name in ("focal_length", "pixel_pitch", "shape")}
        return seen, board or told, given, ()
    if board is None:
        raise FormatError("give --board, such as '9 x 5 corners, 10 mm'.")
    if alone and first.suffix.lower() == ".csv":
        return metrology.load_corners(first), board, {}, ()
    return _found(sources, board, origin, views, wavelength)


def _found(
    sources: tuple[Path, ...], board: "Board", origin: RawOptions, views: bool, wavelength: float | None
) -> "tuple[Corners, Board, dict[str, Any], tuple[str, ...]]":
    """Corners found in raw images, with the board, known values and notes."""
    from lumigraph import metrology
    from lumigraph.instruments import LensletCamera
    from lumigraph.instruments.capabilities import Rendered, WithMainLens
    from lumigraph.metrology.boards.spill import GREEN

    camera = origin.described("decode" if views else None)
    in_views = views or (camera is not None and not isinstance(camera, Rendered))
    ready = [origin.prepared(origin.read(path)) for path in sources]
    with progress("board") as tell:
        light = wavelength or (GREEN if camera is None else camera.wavelength)
        seen = metrology.find_corners(ready, board, in_views=in_views, wavelength=light, progress=tell)
    told = {"shape": ready[0].shape, "pixel_pitch": ready[0].pixel_pitch}
    if ready[0].calibration is not None and (origin.white or origin.calibration):
        told["micro_images"] = ready[0].calibration.lattice.pitch
    if isinstance(camera, WithMainLens):
        told |= {"focal_length": camera.main_lens.focal_length, "pixel_pitch": camera.sensor.pixel_pitch}
    if isinstance(camera, LensletCamera):
        told |= {"lenslet_distance": camera.lenslet_distance, "lenslet_pitch": camera.lenslets.pitch}
    known = {name: value for name, value in told.items() if value is not None}
    return seen, board, known, ready[0].notes


def _planned(origin: RawOptions, board: "Board | None", known: KnownCamera, pictures: int) -> Result:
    """Plan of the pictures to take."""
    from lumigraph import metrology
    from lumigraph.instruments import LensletCamera
    from lumigraph.instruments.capabilities import Rendered

    camera = origin.described()
    if board is None or not isinstance(camera, LensletCamera):
        raise FormatError("a plan needs --camera, a file of a plenoptic camera, and --board.")
    ideal = metrology.MetricCamera.of(camera)
    told = {name: getattr(ideal, name) for name in ("focal_length", "pixel_pitch")}
    calibration = replace(camera.calibration, fill=camera.micro_image_fill)
    told |= {"lenslet_pitch": camera.lenslets.pitch, "micro_images": calibration.lattice.pitch}
    nominal = known.nominal(told | {"shape": camera.sensor.shape})
    in_views = not isinstance(camera, Rendered)
    found = metrology.plan(ideal, calibration, board, nominal, pictures=pictures, in_views=in_views)
    table = found.table()
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in table]
    return Result(
        "Plan", f"{pictures} pictures of a board to take, the most telling first.", found, tuple(lines),
        found.quantities(), lambda: iter((Figure(table, section="Pictures"),)),
        (_enough(found), *_hardly_told(found, nominal)),
    )  # fmt: skip


def _enough(found: "Plan") -> str:
    """Number of pictures after which lengths and distances are known to 1 %, and their final errors."""
    from lumigraph.metrology.boards.calibration import WELL

    names, counts = ("f", "L", "b", "distances"), found.enough(WELL)
    well = [f"{name} from picture {n} on" for name, n in zip(names, counts, strict=True) if n is not None]
    last = [f"{name} ± {part:.2g} %" for name, part in zip(names, 100 * found.known[-1], strict=True)]
    return (
        f"known to {WELL:.0%}, in 95 of 100 cases: {', '.join(well) or 'no length'}; with all "
        f"{len(found.steps)} pictures: {', '.join(last)}"
    )


def _hardly_told(found: "Plan", nominal: "Nominal") -> tuple[str, ...]:
    """Note if the pictures hardly improve on the f that is known beforehand."""
    if found.steps[-1].errors[0] < 0.7 * nominal.focal_length_error * nominal.focal_length:
        return ()
    return (
        f"f, and with it L and distances, stays as well known as it is beforehand "
        f"(± {1.96 * nominal.focal_length_error:.2g} of it): measure it, and give --focal-length-error, "
        "or the lenslets' pitch, and give --lenslet-pitch-error",
    )


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
