"""`lumigraph depth`."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, above_zero, length, numbers, section
from lumigraph.cli.origin import NO_ORIGIN, RawOptions
from lumigraph.cli.reporting import REPORTED, ReportOptions, enlarged
from lumigraph.core.progress import Progress, silent
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from lumigraph.core.calibration import Calibration
    from lumigraph.core.grid import Grid
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage
    from lumigraph.depth import DepthMap
    from lumigraph.instruments import Instrument

MAPS = (".pfm", ".tif", ".tiff", ".png", ".zarr", ".ply")
_OF_RAW = ("dense", "correlation")


@Parameter(name="*", group=section("Search"))
@dataclass(frozen=True)
class SearchOptions:
    """Method of measuring depth.

    Parameters
    ----------
    method
        auto: epi for cameras 1.0 and views, dense for cameras 2.0; epi: lines of epipolar-plane images;
        focus: the sharpest picture of a focal stack; fused: both; dense: each pixel of a camera 2.0's
        picture, by all micro-images that show it; correlation: each of its lenslets, as render takes it.
    range
        Least and most that may occur, 'least:most': disparities [px per view] for epi, patches [px] for
        dense and correlation; found by itself if left out.
    alphas
        Refocus factors of the focal stack, a range; if left out, 0.9:1.1:x21 for focus, and those
        that epi has found for fused.
    correct
        Correct what diffraction at the lenslets does to the method, by simulating textured planes before the
        camera of --camera, a plenoptic 1.0; takes half a minute.
    smooth
        Weight of smoothness where the map is not sure, along the picture's edges; 1 is usual.
    views
        Views of a light field to use: all; star: the middle row, column and diagonals; cross: the
        middle row and column; row: the middle row. Fewer take less time.
    """

    method: Literal["auto", "epi", "focus", "fused", "dense", "correlation"] = "auto"
    range: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    alphas: str | None = None
    correct: bool = False
    smooth: float = 0.0
    views: Literal["all", "star", "cross", "row"] = "all"

    def ends(self) -> tuple[float, float] | None:
        """The least and the most."""
        if self.range is None:
            return None
        try:
            low, high = map(float, self.range.split(":"))
        except ValueError:
            raise FormatError(f"--range is {self.range!r} but must be least:most, such as -2:3.") from None
        return low, high

    def of_views(self, views: "LightField", shown: Progress) -> "DepthMap":
        """Disparities or refocus factors of the middle view."""
        from lumigraph import depth, rendering

        if self.method in _OF_RAW:
            raise FormatError(f"--method {self.method} is for raw images of cameras 2.0. Use --method epi.")
        method: Any = "epi" if self.method == "auto" else self.method
        return depth.estimate(
            rendering.arranged(views, self.views), method, disparities=self.ends(),
            alphas=None if self.alphas is None else numbers("--alphas", self.alphas),
            smoothness=self.smooth, progress=shown,
        )  # fmt: skip

    def of_raw(
        self, raw: "RawImage", calibration: "Calibration", sharp: "Sequence[float] | None", shown: Progress
    ) -> "_Measured":
        """Patches of the lenslets, or of the samples of the picture."""
        from lumigraph import depth, preparation, rendering

        if self.views != "all":
            raise FormatError(f"--views {self.views} is for views, and cameras 1.0. Leave it out.")
        if self.method == "correlation":
            found = depth.correlation(raw, calibration, self.ends(), progress=shown)
            return _Measured(self._smoothed(found), calibration)
        found, lenslets, sharp = depth.of_pixels(raw, calibration, self.ends(), focus=sharp, progress=shown)
        picture = preparation.render(raw, calibration, lenslets.values, blend=True, focus=sharp)
        grid = rendering.sight_grid(calibration, lenslets.values)
        return _Measured(self._smoothed(found, picture), calibration, picture, grid)

    def _smoothed(self, found: "DepthMap", picture: Any = None) -> "DepthMap":
        from lumigraph import depth

        return depth.fuse(found, picture, smoothness=self.smooth) if self.smooth else found


@dataclass(frozen=True)
class _Measured:
    """A map, what it was measured on, the picture of the same places and where they are, if known; notes."""

    depth: "DepthMap"
    grounds: "LightField | Calibration"
    picture: Any = None
    grid: "Grid | None" = None
    notes: tuple[str, ...] = ()


@Parameter(name="*", group=section("Lengths"))
@dataclass(frozen=True)
class LengthOptions:
    """Lengths that convert a map to metres, if there is no camera file.

    Parameters
    ----------
    focal_length
        Focal length of the main lens, such as '200 mm'.
    object_distance
        From the main lens to the plane in focus, such as '400 mm'; views of a camera 1.0 know it.
    """

    focal_length: str | None = None
    object_distance: str | None = None

    def known(
        self, camera: "Instrument | None", views: "LightField | None"
    ) -> tuple[float, float | None] | None:
        """Focal length and distance [m], or None where the lens is not known."""
        from lumigraph.design import thin_lens
        from lumigraph.instruments.capabilities import WithMainLens

        focal = above_zero("--focal-length", length("--focal-length", self.focal_length), "m")
        distance = above_zero("--object-distance", length("--object-distance", self.object_distance), "m")
        if isinstance(camera, WithMainLens):
            focal, distance = focal or camera.main_lens.focal_length, distance or camera.object_distance
        if focal is None:
            return None
        if distance is None and views is not None:
            distance = thin_lens.object_distance(focal, views.separation)
        return focal, distance


def depth(
    source: Path,
    /,
    *,
    output: Output,
    confidence: Path | None = None,
    min_confidence: float = 0.5,
    origin: RawOptions = NO_ORIGIN,
    search: SearchOptions = SearchOptions(),
    lengths: LengthOptions = LengthOptions(),
    common: ReportOptions = REPORTED,
) -> Result:
    """Measure the depth of what views or a raw image show.

    Example: `lumigraph depth views.zarr -o disparity.pfm`

    Example: `lumigraph depth raw.png --calibration maker.xml --method correlation -o patches.tiff`

    Example: `lumigraph depth raw.tiff --camera camera.toml -o mesh.ply`

    Parameters
    ----------
    source
        Views (.zarr, .h5, a folder), or a raw image.
    output
        Map (.pfm, .tiff, .zarr), its picture, near to far as white to black, as fine as 'lumigraph refocus'
        makes pictures of the views (.png), or points in space, joined to a mesh that is cut where depth jumps
        (.ply). With a camera file (a microscope's too) or --focal-length depths from the focused plane [m],
        positive farther from the objective; else disparities [px per view], positive nearer, refocus
        factors, or patches [px].
    confidence
        File for the confidence of each place, from 0 to 1.
    min_confidence
        Confidence below which a point is left out of .ply: 0.5 keeps those with an expected error of less
        than 0.45 px, of cameras 2.0 about 0.55 px.
    """
    common.check()
    files.check_output(output, MAPS)
    if confidence is not None:
        files.check_output(confidence, MAPS[:-1])
    if output.suffix.lower() == ".ply" and origin.camera is None and lengths.focal_length is None:
        raise FormatError("points need the camera's lengths. Give --camera FILE, or --focal-length.")
    camera = origin.described("decode" if search.correct else None)
    if search.correct and not _is_correctable(camera):
        raise FormatError("--correct simulates a camera. Give --camera FILE of a plenoptic camera 1.0.")
    with progress("depth") as shown:
        made = _measured(source, (origin, search), shown)
        if search.correct:
            made = replace(made, depth=_corrected(made.depth, made.grounds, (camera, search), shown))
    found, distance = _in_metres(made.depth, made.grounds, lengths, camera)
    made = replace(made, depth=found)
    _save(made, output, (distance, min_confidence))
    if confidence is not None:
        from lumigraph import io

        io.save(found.confidence, confidence)
    return _result(
        found, made.picture, made.notes, tuple(path for path in (output, confidence) if path is not None)
    )


def _measured(source: Path, how: tuple[RawOptions, SearchOptions], shown: Progress) -> _Measured:
    from lumigraph import preparation
    from lumigraph.core.lightfield import LightField
    from lumigraph.instruments.capabilities import Rendered

    origin, search = how
    found, notes = origin.views(source), ()
    if not isinstance(found, LightField):
        raw, camera = origin.prepared(found), origin.described()
        calibration: Any = raw.calibration
        if search.method in _OF_RAW or (search.method == "auto" and _is_focused(camera, calibration)):
            patches = camera.patches_on_raw() if isinstance(camera, Rendered) else ()
            sharp = preparation.sharp_kinds(calibration, patches, origin.calibration)
            return replace(search.of_raw(raw, calibration, sharp, shown), notes=raw.notes)
        found, notes = preparation.decode(raw), raw.notes
    v, u = (n // 2 for n in found.aperture.shape)
    return _Measured(search.of_views(found, shown), found, found.view(v, u), None, notes)


def _is_correctable(camera: "Instrument | None") -> bool:
    from lumigraph.instruments.capabilities import Correctable

    return isinstance(camera, Correctable)


def _is_focused(camera: "Instrument | None", calibration: "Calibration") -> bool:
    from lumigraph.instruments.capabilities import Rendered

    return calibration.lattice.kinds > 1 if camera is None else isinstance(camera, Rendered)


def _corrected(found: "DepthMap", views: Any, how: tuple[Any, SearchOptions], shown: Progress) -> "DepthMap":
    """Refocus factors without the bias of diffraction, measured on planes of known depth."""
    from lumigraph import depth as verbs

    camera, search = how
    return verbs.unbiased(
        verbs.alpha_of(found, views),
        camera.plane_views,
        lambda known: verbs.alpha_of(search.of_views(known, silent), known),
        farthest=camera.alpha(9 * camera.object_distance), progress=shown,
    )  # fmt: skip


def _in_metres(
    found: "DepthMap", grounds: Any, lengths: LengthOptions, camera: "Instrument | None"
) -> "tuple[DepthMap, float | None]":
    """The map in metres where the lens is known, and the distance of the plane in focus."""
    from lumigraph import depth as verbs
    from lumigraph.core.lightfield import LightField
    from lumigraph.instruments.capabilities import WithDepth, WithObjective

    if isinstance(camera, WithObjective):
        return verbs.defocus(found, grounds, camera.depth_per_alpha), None
    lens = lengths.known(camera, grounds if isinstance(grounds, LightField) else None)
    if lens is None:
        return found, None
    if isinstance(camera, WithDepth) and lengths == LengthOptions():
        return camera.in_metres(found, grounds), camera.object_to_pupil()
    return verbs.metric(found, grounds, focal_length=lens[0], object_distance=lens[1]), lens[1]


def _save(made: _Measured, output: Path, points: tuple[float | None, float]) -> None:
    import numpy as np

    from lumigraph import depth as verbs
    from lumigraph import io
    from lumigraph.core.arrays import to_numpy
    from lumigraph.core.lightfield import LightField

    found, name = made.depth, output.name.lower()
    if name.endswith(".ply") and points[0] is not None:
        picture = None if made.picture is None else to_numpy(made.picture).astype(float)
        picture = None if picture is None else np.clip(picture / (np.quantile(picture, 0.999) or 1), 0, 1)
        cloud = verbs.cloud(
            found, made.grounds, object_distance=points[0], colours=picture, min_confidence=points[1],
            grid=made.grid, faces=True,
        )  # fmt: skip
        io.save(cloud, output)
    elif name.endswith(".png"):
        views = made.grounds if isinstance(made.grounds, LightField) else None
        io.save(verbs.drawn(found, views), output, white=1.0)
    else:
        io.save(found, output)


def _result(found: "DepthMap", picture: Any, notes: tuple[str, ...], written: tuple[Path, ...]) -> Result:
    import numpy as np

    trust, ends = np.asarray(found.confidence, float), found.quantiles(0.01, 0.5, 0.99)
    unit, (rows, columns) = "" if found.unit == "1" else found.unit, found.shape
    low, middle, high = (Quantity(name, float(v), unit) for name, v in zip(_ENDS, ends, strict=True))
    text = (
        f"{found.quantity} of {rows} x {columns} places: {low} to {high}, median {middle}"
        f"{_SIGN.get(found.quantity, '')}; half of them with a confidence above {np.median(trust):.2f}"
    )
    usual = found.usual_error
    expected = [] if usual is None else [Quantity("expected_error", usual, unit)]
    unknown = int((~np.isfinite(np.asarray(found.values))).sum())
    notes = (
        (*notes, f"{unknown} places are unknown: not in the middle view, or beyond infinity")
        if unknown
        else notes
    )
    text += f" and an expected error below {expected[0]}" if expected else ""
    values = (
        Quantity("quantity", found.quantity), Quantity("unit", found.unit), Quantity("shape", found.shape),
        Quantity("confidence", float(np.median(trust))), low, middle, high,
        *expected,
    )  # fmt: skip
    return Result(
        "Depth", "How far what is seen stands, and how sure that is.", found, (text,), values,
        lambda: _figures(found, picture), notes, written,
    )  # fmt: skip


_ENDS = ("low", "median", "high")
_SIGN = {"depth": ", above 0 behind the focused plane"}


def _figures(found: "DepthMap", picture: Any) -> "Iterator[Figure]":
    from lumigraph import plots

    yield Figure(plots.show(found), f"{found.quantity.capitalize()}, without the outermost 1 %.", "Map")
    yield Figure(plots.show(found.confidence), "Confidence, 0 to 1.", "Map")
    if found.error is not None:
        yield Figure(plots.show(found.error), f"Expected error [{found.unit}].", "Map")
    if picture is not None:
        zoom = {"zoom": enlarged(picture)}
        yield Figure(picture, "The picture of the same places.", "Map", zoom)
