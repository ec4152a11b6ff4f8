"""`lumigraph render`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import Count, progress
from lumigraph.cli.options import Output, length
from lumigraph.cli.origin import FOCUSED, NO_ORIGIN, Origin
from lumigraph.cli.refocus import MOST_SHOWN, range_of
from lumigraph.cli.reporting import REPORTED, Reported, told
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.calibration import Calibration
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.raw import RawImage

_MOST_FINER = 8
_MOST_FRAMES = 1000


@Parameter(name="*")
@dataclass(frozen=True)
class Tiles:
    """Raw images of a camera 2.0: how large the piece of each micro-image is, and how pieces are joined.

    Parameters
    ----------
    patch
        Size of the piece of each micro-image, in pixels; negative for a Galilean camera.
    patches
        A range 'first:last:count' of sizes: one picture focused on each plane.
    depth
        Of what shall be seamless, from the focused plane of --camera, such as '5 mm' (farther) or
        '-5 mm' (nearer); or 'auto': found for each lenslet, so that everything is sharp.
    blend
        Mix all micro-images that show a place: no seams, and what is at another depth is blurred.
    samples
        Samples of the picture per lenslet; the size of the patch if left out.
    finer
        Times as fine as the pixels of a patch, from all micro-images that show a place: 2 or more.
    smoothness
        With --finer: 0.02 resolves most; 0.1 to 0.3 where a noisy raw image or three kinds of lenslets
        leave a mesh.
    focus
        For three kinds of lenslets without --camera: the patch at which each is sharp, in pixels,
        such as '-13.5,-10.5,-7.5'.
    """

    patch: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    patches: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    depth: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    blend: bool = False
    samples: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    finer: Annotated[int, Parameter(allow_leading_hyphen=True)] = 1
    smoothness: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    focus: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None

    @property
    def is_given(self) -> bool:
        """Whether there is anything that only a raw image needs."""
        return self != Tiles()

    @property
    def is_auto(self) -> bool:
        """Whether the patches are to be found in the raw image."""
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
                raise FormatError("--depth says the patch of a camera. Give --camera FILE, and no --patch.")
        if sum(x is not None for x in (self.patch, self.patches, self.depth)) > 1:
            raise FormatError("--patch, --patches and --depth say the same. Give one of them.")
        self.chosen_focus()
        if self.patches is not None:
            range_of("--patches", self.patches)
        if not 1 <= self.finer <= _MOST_FINER:
            raise FormatError(f"--finer is {self.finer} but must be from 1 to {_MOST_FINER}.")
        if self.smoothness is not None and (self.finer == 1 or not 0 <= self.smoothness < float("inf")):
            raise FormatError(
                f"--smoothness is {self.smoothness:g} but must be at least 0, and is for --finer 2 or more."
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

    def known(self, camera: Any) -> float | None:
        """The one patch [px] that is given, or that the camera has at the depth; None where it is found."""
        if self.patch is not None or camera is None or self.is_auto:
            return self.patch
        return camera.patch_at(length("--depth", self.depth) or 0.0)

    def sharp(self, camera: Any, calibration: "Calibration", origin: Origin) -> list[float] | None:
        """The patch at which each kind of lenslets is sharp, where there are three and it is known."""
        if self.focus is not None or calibration.lattice.kinds == 1:
            return self.chosen_focus()
        if camera is not None and len(camera.lenslets.focal_length) == 3:
            first, second, third = camera.sharp_patches
            return [first, third, second]  # the raw image is turned: the second and third kind trade places
        if origin.calibration is not None and origin.calibration.suffix.lower() == ".xml":
            from lumigraph.io.raytrix import lens_types
            from lumigraph.rendering import sharp_patches

            return list(sharp_patches(calibration, lens_types(origin.calibration)))
        return None


@Parameter(name="*")
@dataclass(frozen=True)
class Look:
    """Views of a camera 1.0: which picture is made of them.

    Parameters
    ----------
    all_in_focus
        Sharp at every depth; of a raw image of a camera 2.0 it is the same as --depth auto.
    alphas
        Refocus factors 'first:last:count' that are tried; found by the views' disparities if left out.
    path
        Pictures from a point of view that moves over the aperture.
    frames
        Pictures of the path.
    radius
        Of the path, over that of the aperture.
    still
        Refocus factor of the plane that does not move.
    """

    all_in_focus: bool = False
    alphas: str | None = None
    path: Literal["circle", "line", "eight"] | None = None
    frames: int = 24
    radius: float = 0.7
    still: float = 1.0

    def check(self) -> None:
        """Refuse options that contradict each other."""
        if self.all_in_focus == (self.path is not None):
            raise FormatError("of views, give --all-in-focus or --path circle, or use 'lumigraph refocus'.")
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
    origin: Origin = NO_ORIGIN,
    tiles: Tiles = Tiles(),
    look: Look = Look(),
    common: Reported = REPORTED,
) -> None:
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
        Where to write the map of patches or refocus factors that was found (.tiff, .pfm, .zarr).
    """
    from lumigraph.core.lightfield import LightField

    common.check()
    several = tiles.patches is not None or look.path is not None
    files.check_output(output, (".tif", ".tiff", *files.MOVIES) if several else files.PICTURES)
    if depth_map is not None:
        files.check_output(depth_map, (".tif", ".tiff", ".pfm", ".zarr"))
        if not (tiles.is_auto or look.all_in_focus):
            raise FormatError("--map needs a map that is found. Give --depth auto or --all-in-focus.")
    if look.all_in_focus and not tiles.is_given:
        tiles = Tiles(depth="auto")
    if not look.all_in_focus and look.path is None:
        tiles.check(origin.camera)
    found = files.read_views(raw)
    with progress("render") as shown:
        if isinstance(found, LightField):
            text, values, extra = _from_views(found, look, output, shown)
        else:
            if look.path is not None:
                raise FormatError(f"{raw} holds a raw image but --path needs views. Use 'lumigraph decode'.")
            text, values, extra = _from_raw(found, (origin, tiles), output, shown)
    values = {**values, "output": str(output)}
    text += f"\nwritten {output}"
    if depth_map is not None:
        text, values = text + _save_map(extra, depth_map), {**values, "map": str(depth_map)}
    told(common, text, values, lambda: _page(output, extra), _numbers(values))


def _numbers(values: dict[str, Any]) -> list[tuple[str, str]]:
    rows, columns = values["shape"][:2]
    found = [("picture", f"{rows} x {columns} px")]
    for key, name, unit in (
        ("patch_px", "patch", " px"),
        ("alpha", "refocus factors", ""),
        ("frames", "frames", ""),
    ):
        if key in values:
            each = values[key] if isinstance(values[key], list | tuple) else [values[key]]
            found.append((name, " to ".join(f"{x:.5g}{unit}" for x in sorted({each[0], each[-1]}))))
    return found


def _page(output: Path, extra: Any) -> Any:
    from lumigraph import io
    from lumigraph.core.stack import Stack
    from lumigraph.report import Page

    page = Page("Render", "The picture that was written.")
    section = page.section("Picture")
    if output.suffix.lower() in files.MOVIES:
        section.text(f"The film is in {output.name}.")
    else:
        found = io.open(output)
        pictures = list(found.data) if isinstance(found, Stack) else [found]
        for number, image in enumerate(pictures[:MOST_SHOWN], 1):
            caption = f"Picture {number} of {len(pictures)}." if len(pictures) > 1 else "The picture."
            section.figure(image, caption)
    if extra is not None:
        from lumigraph import plots

        section.figure(plots.show(extra.values), f"{extra.quantity} [{extra.unit}] of each place.")
    return page


_Made = tuple[str, dict[str, Any], Any]
"""What is told, its values, and the map that was found or None."""


def _from_raw(found: "RawImage", how: tuple[Origin, Tiles], output: Path, shown: Count) -> _Made:
    from lumigraph import depth, io, rendering

    origin, tiles = how
    camera = origin.described(FOCUSED)
    size: Any = tiles.known(camera)
    ready, calibration = origin.prepared(found, kind=FOCUSED)
    sharp = tiles.sharp(camera, calibration, origin)
    extra = None
    if tiles.is_auto:
        extra = depth.correlation(ready, calibration, progress=shown)
        size = extra.values
        if sharp is not None and tiles.focus is None:
            sharp = list(rendering.match_kinds(ready, calibration, size, sharp))
    if tiles.patches is not None:
        sizes = range_of("--patches", tiles.patches)
        return _planes(rendering.render_stack(ready, calibration, sizes, samples=tiles.samples, focus=sharp),
                       sizes, output)  # fmt: skip
    if tiles.finer > 1:
        known: dict[str, Any] = {} if tiles.smoothness is None else {"smoothness": tiles.smoothness}
        image = rendering.super_resolve(ready, calibration, size, factor=tiles.finer, progress=shown, **known)
    else:
        blend = tiles.blend or tiles.is_auto
        image = rendering.render(
            ready, calibration, size, samples=tiles.samples, blend=blend, focus=sharp if blend else None
        )
    io.save(image, output)
    rows, columns = image.shape[:2]
    if extra is None:
        text, patch = f"{rows} x {columns} px with patches of {size:.4g} px", size
    else:
        patch = [float(size.min()), float(size.max())]
        text = f"{rows} x {columns} px with patches from {patch[0]:.4g} to {patch[1]:.4g} px"
    return text, {"shape": image.shape, "patch_px": patch}, extra


def _planes(stack: Any, sizes: list[float], output: Path) -> _Made:
    from lumigraph import io
    from lumigraph.core.stack import Stack

    io.save(Stack(stack, tuple(sizes), "patch"), output)
    count, rows, columns = stack.shape[:3]
    values = {"shape": (rows, columns), "patch_px": sizes}
    return (
        f"{count} pictures of {rows} x {columns} px, patches {sizes[0]:.4g} to {sizes[-1]:.4g} px",
        values,
        None,
    )


def _from_views(views: "LightField", look: Look, output: Path, shown: Count) -> _Made:
    from lumigraph import depth, io, rendering
    from lumigraph.core.stack import Stack

    look.check()
    if look.path is not None:
        stack = rendering.view_path(views, look.frames, path=look.path, radius=look.radius, alpha=look.still)
        io.save(Stack(stack), output)
        count, rows, columns = stack.shape[:3]
        return f"{count} pictures of {rows} x {columns} px", {"shape": (rows, columns), "frames": count}, None
    if look.alphas is not None:
        made = rendering.all_in_focus(views, range_of("--alphas", look.alphas), progress=shown)
        extra = depth.DepthMap(made.alpha, made.confidence, "alpha")
    else:
        extra = depth.alpha_of(depth.epi(views, progress=shown), views)
        made = rendering.all_in_focus(views, depth=extra.values)
    io.save(made.picture, output)
    rows, columns = made.picture.shape[:2]
    ends = [float(made.alpha.min()), float(made.alpha.max())]
    text = f"{rows} x {columns} px, refocus factors from {ends[0]:.4g} to {ends[1]:.4g}"
    return text, {"shape": (rows, columns), "alpha": ends}, extra


def _save_map(found: Any, path: Path) -> str:
    from lumigraph import io

    io.save(found, path)
    return f"\nwritten {path}"
