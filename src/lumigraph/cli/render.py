"""`lumigraph render`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, length, numbers, section
from lumigraph.cli.origin import NO_ORIGIN, RawOptions
from lumigraph.cli.refocus import MOST_SHOWN, told_of
from lumigraph.cli.reporting import REPORTED, ReportOptions
from lumigraph.core.progress import Progress
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.calibration import Calibration
    from lumigraph.core.depth_map import DepthMap
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage
    from lumigraph.instruments.capabilities import Rendered

_MOST_FINER = 8
_MOST_FRAMES = 1000


@Parameter(name="*", group=section("Raw images of cameras 2.0"))
@dataclass(frozen=True)
class TileOptions:
    """Raw images of a camera 2.0: how large the piece of each micro-image is, and how pieces are joined.

    Parameters
    ----------
    patch
        Size of the piece of each micro-image, in pixels; negative for a Galilean camera.
    patches
        A range of sizes, first:last:step or first:last:xN: one picture focused on each plane.
    depth
        Depth to render without seams, from the focused plane of --camera, such as '5 mm' (farther) or
        '-5 mm' (nearer); or 'auto': measured for each lenslet, so that everything is sharp.
    detail
        Period of the detail in the object whose tiles are to meet by waves, with --camera, such as '0.3 mm':
        diffraction makes the best patch 3 to 25 % larger than rays have it. Left out, the patch of rays.
    blend
        Mix all micro-images that show a place: no seams, and what is at another depth is blurred.
    samples
        Samples per lenslet, of the picture; the size of the patch if left out.
    finer
        Finer sampling than the pixels of a patch, 2 times or more, from all micro-images that show a place.
    smooth
        Weight of smoothness for --finer: 0.02 resolves most; 0.1 to 0.3 removes the mesh that a noisy raw
        image or three kinds of lenslets leave.
    focus
        For three kinds of lenslets without --camera: the patch at which each is sharp, in pixels,
        such as '-13.5,-10.5,-7.5'.
    """

    patch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    patches: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    depth: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    detail: str | None = None
    blend: bool = False
    samples: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    finer: Annotated[int, Parameter(allow_leading_hyphen=True)] = 1
    smooth: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    focus: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None

    @property
    def is_given(self) -> bool:
        """True if some option is given that only a raw image needs."""
        return self != TileOptions()

    @property
    def is_auto(self) -> bool:
        """True if the patches are to be found in the raw image."""
        return self.depth is not None and self.depth.strip().lower() == "auto"

    def check(self, camera: str | None) -> None:
        """Refuse options that contradict each other, before anything is read."""
        if self.patch is not None and (not abs(self.patch) < float("inf") or self.patch == 0):
            raise FormatError(f"--patch is {self.patch:g} px but must be a finite number other than 0.")
        if not self.is_auto:
            if camera is None and self.patch is None and self.patches is None:
                raise FormatError(
                    "the patches' size is not known. Give --patch PIXELS, --camera FILE or --depth auto."
                )
            if self.depth is not None and (camera is None or self.patch is not None):
                raise FormatError(
                    "--depth needs a camera, whose patch follows from it. Give --camera FILE, and no --patch."
                )
        if sum(x is not None for x in (self.patch, self.patches, self.depth)) > 1:
            raise FormatError(
                "--patch, --patches and --depth all set the size of the patches. Give one of them."
            )
        if self.detail is not None and (camera is None or self.is_auto or self.patch or self.patches):
            raise FormatError(
                "--detail changes the patch that follows from a camera. Give --camera FILE, with or without "
                "--depth, and no --patch, --patches or --depth auto."
            )
        self.chosen_focus()
        if self.patches is not None:
            numbers("--patches", self.patches)
        if not 1 <= self.finer <= _MOST_FINER:
            raise FormatError(f"--finer is {self.finer} but must be from 1 to {_MOST_FINER}.")
        if self.smooth is not None and (self.finer == 1 or not 0 <= self.smooth < float("inf")):
            raise FormatError(
                f"--smooth is {self.smooth:g} but must be at least 0, and is for --finer 2 or more."
            )
        if self.finer > 1 and (self.patches is not None or self.samples is not None or self.blend):
            raise FormatError(
                "--finer has no meaning with --patches, --samples or --blend. Leave out the others."
            )

    def chosen_focus(self) -> list[float] | None:
        """The patches after --focus."""
        if self.focus is None:
            return None
        try:
            return [float(word) for word in self.focus.split(",")]
        except ValueError:
            raise FormatError(
                f"--focus is {self.focus!r} but must be three sizes in pixels, such as -13.5,-10.5,-7.5."
            ) from None

    def known(self, camera: "Rendered | None") -> float | None:
        """The one patch [px] that is given, or that the camera has at the depth; None where it is found."""
        if self.patch is not None or camera is None or self.is_auto:
            return self.patch
        dz, period = length("--depth", self.depth) or 0.0, length("--detail", self.detail)
        if period is not None and period <= 0:
            raise FormatError(f"--detail is {self.detail} but must be a period above 0, such as '0.3 mm'.")
        return camera.patch_at(dz, None if period is None else 1 / period)

    def sharp(
        self, camera: "Rendered | None", calibration: "Calibration", origin: RawOptions
    ) -> list[float] | None:
        """The patch at which each kind of lenslets is sharp, where there are three and it is known."""
        if self.focus is not None:
            return self.chosen_focus()
        from lumigraph.preparation import sharp_kinds

        return sharp_kinds(calibration, () if camera is None else camera.patches_on_raw(), origin.calibration)


@Parameter(name="*", group=section("Views of cameras 1.0"))
@dataclass(frozen=True)
class ViewOptions:
    """Views of a camera 1.0: which picture is made of them.

    Parameters
    ----------
    all_in_focus
        Make everything sharp; for a raw image of a camera 2.0 the same as --depth auto.
    alphas
        Refocus factors to try, a range such as 0.9:1.1:x9; taken from the views' disparities if left out.
    path
        Pictures from a point of view that moves over the aperture.
    frames
        Number of pictures along the path.
    radius
        Radius of the path, relative to the aperture's.
    pivot
        Refocus factor of the plane that does not move.
    """

    all_in_focus: bool = False
    alphas: str | None = None
    path: Literal["circle", "line", "eight"] | None = None
    frames: int = 24
    radius: float = 0.7
    pivot: float = 1.0

    def check(self) -> None:
        """Refuse options that contradict each other."""
        if self.all_in_focus == (self.path is not None):
            raise FormatError("for views, give --all-in-focus or --path circle, or use 'lumigraph refocus'.")
        if not 1 <= self.frames <= _MOST_FRAMES:
            raise FormatError(f"--frames is {self.frames} but must be from 1 to {_MOST_FRAMES}.")
        if not 0 < self.radius <= 1:
            raise FormatError(f"--radius is {self.radius:g} but must be above 0 and at most 1.")


def render(
    raw: Path,
    /,
    *,
    output: Output,
    depth_map: Annotated[Path | None, Parameter(name="--map")] = None,
    origin: RawOptions = NO_ORIGIN,
    tiles: TileOptions = TileOptions(),
    look: ViewOptions = ViewOptions(),
    common: ReportOptions = REPORTED,
) -> Result:
    """Render pictures of a focused plenoptic camera 2.0 from its raw image, or out of views.

    Example: `lumigraph render raw.tiff --camera camera.toml --depth "5 mm" -o picture.png`

    Example: `lumigraph render raw.png --calibration maker.xml --depth auto -o sharp.png --map patches.tiff`

    Example: `lumigraph render views.zarr --path circle -o around.gif`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr), or views (.zarr, .h5, a folder).
    output
        Picture (.png, .tiff, .zarr); several planes or a path: a stack (.tiff) or a film (.gif, .mp4).
    depth_map
        File for the map of patches or refocus factors that was found (.tiff, .pfm, .zarr).
    """
    from lumigraph import io
    from lumigraph.core.lightfield import LightField

    common.check()
    several = tiles.patches is not None or look.path is not None
    files.check_output(output, (".tif", ".tiff", *files.MOVIES) if several else files.PICTURES)
    if depth_map is not None:
        files.check_output(depth_map, (".tif", ".tiff", ".pfm", ".zarr"))
        if not (tiles.is_auto or look.all_in_focus):
            raise FormatError(
                "--map writes a map, but none is computed. Give --depth auto or --all-in-focus."
            )
    if look.all_in_focus and not tiles.is_given:
        tiles = TileOptions(depth="auto")
    if not look.all_in_focus and look.path is None:
        tiles.check(origin.camera)
    found = origin.views(raw)
    with progress("render") as shown:
        if isinstance(found, LightField):
            made = _from_views(found, look, output, shown)
        else:
            if look.path is not None:
                raise FormatError(f"{raw} holds a raw image but --path needs views. Use 'lumigraph decode'.")
            made = _from_raw(found, (origin, tiles), output, shown)
    if depth_map is not None:
        io.save(made.depth, depth_map)
    return Result(
        "Render", "The picture that was written.", made.pictures, (made.text,),
        (Quantity("shape", made.shape, "px"), *made.quantities), lambda: _figures(made, output), made.notes,
        tuple(path for path in (output, depth_map) if path is not None),
    )  # fmt: skip


@dataclass(frozen=True)
class _RenderedPicture:
    """Rendered pictures, their report, and the depth map that was found or None."""

    pictures: list[Any]
    text: str
    quantities: tuple[Quantity, ...]
    depth: "DepthMap | None" = None
    notes: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self.pictures[0].shape[:2]
        return rows, columns


def _figures(made: _RenderedPicture, output: Path) -> "Iterator[Figure]":
    if output.suffix.lower() in files.MOVIES:
        yield Figure(made.pictures[0], f"The first picture of the film in {output.name}.", "Picture")
    else:
        for number, image in enumerate(made.pictures[:MOST_SHOWN], 1):
            yield Figure(image, f"Picture {number} of {len(made.pictures)}.", "Picture")
    if made.depth is not None:
        from lumigraph import plots

        drawn = plots.show(made.depth.values)
        yield Figure(drawn, f"{made.depth.quantity} [{made.depth.unit}] of each place.", "Picture")


def _from_raw(
    found: "RawImage", how: tuple[RawOptions, TileOptions], output: Path, shown: Progress
) -> _RenderedPicture:
    from lumigraph import depth, io, preparation

    origin, tiles = how
    camera = cast("Rendered | None", origin.described("render"))
    size: Any = tiles.known(camera)
    ready = origin.prepared(found, use="render")
    calibration: Any = ready.calibration
    sharp = tiles.sharp(camera, calibration, origin)
    extra = None
    if tiles.is_auto:
        matched = None if tiles.focus is not None else sharp
        extra, order = depth.of_lenslets(ready, calibration, focus=matched, progress=shown)
        size, sharp = extra.values, order or sharp
    if tiles.patches is not None:
        sizes = numbers("--patches", tiles.patches)
        stack = preparation.render_stack(ready, calibration, sizes, samples=tiles.samples, focus=sharp)
        return _planes(stack, sizes, output, ready.notes)
    if tiles.finer > 1:
        known: dict[str, Any] = {} if tiles.smooth is None else {"smoothness": tiles.smooth}
        image = preparation.super_resolve(
            ready, calibration, size, factor=tiles.finer, progress=shown, **known
        )
    else:
        blend = tiles.blend or tiles.is_auto
        image = preparation.render(
            ready, calibration, size, samples=tiles.samples, blend=blend, focus=sharp if blend else None
        )
    io.save(image, output)
    patch = size if extra is None else [float(size.min()), float(size.max())]
    told = f"of {size:.4g} px" if extra is None else f"from {patch[0]:.4g} to {patch[1]:.4g} px"
    rows, columns = image.shape[:2]
    text = f"{rows} x {columns} px with patches {told}"
    return _RenderedPicture([image], text, (Quantity("patch_px", patch, "px"),), extra, ready.notes)


def _planes(stack: Any, sizes: list[float], output: Path, notes: tuple[str, ...]) -> _RenderedPicture:
    from lumigraph import io
    from lumigraph.core.stack import Stack

    io.save(Stack(stack, tuple(sizes), "patch"), output)
    count, rows, columns = stack.shape[:3]
    text = f"{count} pictures of {rows} x {columns} px, patches {sizes[0]:.4g} to {sizes[-1]:.4g} px"
    return _RenderedPicture(list(stack), text, (Quantity("patch_px", sizes, "px"),), None, notes)


def _from_views(views: "LightField", look: ViewOptions, output: Path, shown: Progress) -> _RenderedPicture:
    from lumigraph import depth, io, rendering
    from lumigraph.core.stack import Stack

    look.check()
    if look.path is not None:
        stack = rendering.view_path(views, look.frames, path=look.path, radius=look.radius, alpha=look.pivot)
        io.save(Stack(stack), output)
        count, rows, columns = stack.shape[:3]
        text = f"{count} pictures of {rows} x {columns} px"
        return _RenderedPicture(list(stack), text, (Quantity("frames", count),))
    if look.alphas is not None:
        made = rendering.all_in_focus(views, numbers("--alphas", look.alphas), progress=shown)
        extra = depth.DepthMap(made.alpha, made.confidence, "alpha")
    else:
        extra = depth.alpha_of(depth.epi(views, progress=shown), views)
        made = rendering.all_in_focus(views, depth=extra.values)
    io.save(made.picture, output)
    rows, columns = made.picture.shape[:2]
    ends = list(extra.quantiles(0.01, 0.99))
    told = told_of(rendering.detail(views))
    text = f"{rows} x {columns} px{told}, refocus factors from {ends[0]:.4g} to {ends[1]:.4g}"
    return _RenderedPicture([made.picture], text, (Quantity("alpha", ends),), extra)
