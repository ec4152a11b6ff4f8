"""`lumigraph refocus`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, lengths, numbers, section
from lumigraph.cli.origin import NO_ORIGIN, RawOptions, notes_of
from lumigraph.cli.reporting import REPORTED, ReportOptions, enlarged
from lumigraph.core.progress import Progress
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.arrays import Array
    from lumigraph.core.lightfield import LightField
    from lumigraph.instruments.capabilities import Decoded

_MOST_SAMPLES = 64
MOST_SHOWN = 24
"""Pictures in a report."""


@Parameter(name="*", group=section("Focus"))
@dataclass(frozen=True)
class FocusOptions:
    """Focus: α' = F/F', below 1 nearer than the focused plane, 1 as recorded, above 1 farther.

    Parameters
    ----------
    alpha
        Refocus factor α'; may be repeated.
    alphas
        A range of refocus factors: first, last and step, such as 0.9:1.1:0.025, or their count, 0.9:1.1:x9.
    depth
        Depth to focus on, from the focused plane, such as '5 mm' (farther), or a range '-10 um:10 um:5 um';
        may be repeated; needs --camera, which may be a microscope.
    tilt
        Focal tilt, for a plane that leans: α' in the last row less the first row's, and in the last column
        less the first column's, such as 0.05 0.
    """

    alpha: Annotated[list[float] | None, Parameter(consume_multiple=True)] = None
    alphas: str | None = None
    depth: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True)] = None
    tilt: Annotated[tuple[float, float], Parameter(allow_leading_hyphen=True)] = (0.0, 0.0)

    def check(self, camera: "Decoded | None") -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if not (self.alpha or self.alphas or self.depth):
            raise FormatError("no focus is given. Give --alpha 0.95 or --alphas 0.9:1.1:x9.")
        if self.depth and camera is None:
            raise FormatError("--depth needs the camera's geometry. Give --camera FILE, or --alpha.")
        for alpha in self.alpha or []:
            _check_alpha(alpha)

    @property
    def count(self) -> int:
        """Number of requested pictures."""
        return len(self._alphas()) + len(lengths("--depth", self.depth))

    def chosen(self, camera: "Decoded | None", views: "LightField") -> list[float]:
        """All factors, as given."""
        found = self._alphas()
        if camera is not None:
            found += [camera.refocus_factor(dz, views.separation) for dz in lengths("--depth", self.depth)]
        for alpha in found:
            _check_alpha(alpha)
        return found

    def _alphas(self) -> list[float]:
        return [*(self.alpha or []), *(numbers("--alphas", self.alphas) if self.alphas else [])]


def _check_alpha(alpha: float) -> None:
    if not math.isfinite(alpha) or alpha <= 0:
        raise FormatError(f"--alpha is {alpha:g} but must be a finite number above 0.")


@Parameter(name="*", group=section("Picture"))
@dataclass(frozen=True)
class PictureOptions:
    """Method of making pictures.

    Parameters
    ----------
    method
        shear: sums sheared views; fourier: slices their spectrum.
    aperture
        Part of the aperture's width that is used: smaller is sharper in depth, and noisier.
    aperture_shape
        Shape of the aperture: all views, those inside a circle, or those in a ring.
    oversample
        Pixels per lenslet, for shear; away from the focused plane the views fill in the detail. If left out,
        a power of two, at most 8, that gives the picture 200 pixels along its longer side.
    interpolation
        Interpolation between lenslets, for shear.
    """

    method: Literal["shear", "fourier"] = "shear"
    aperture: float = 1.0
    aperture_shape: Literal["square", "round", "ring"] = "square"
    oversample: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    interpolation: Literal["linear", "cubic", "band_limited"] = "cubic"

    def check(self) -> None:
        """Refuse what no picture can be made with."""
        if not 0 < self.aperture <= 1:
            raise FormatError(f"--aperture is {self.aperture:g} but must be above 0 and at most 1.")
        if self.oversample is not None and not 1 <= self.oversample <= _MOST_SAMPLES:
            raise FormatError(f"--oversample is {self.oversample} but must be from 1 to {_MOST_SAMPLES}.")
        if self.method == "fourier" and self.oversample not in (None, 1):
            raise FormatError("--oversample has no meaning with --method fourier. Use --method shear.")

    def samples(self, views: "LightField") -> int:
        """Pixels per lenslet."""
        from lumigraph import rendering

        if self.method == "fourier":
            return 1
        return rendering.detail(views) if self.oversample is None else self.oversample

    def pictures(
        self, views: "LightField", alphas: list[float], tilt: tuple[float, float], shown: Progress
    ) -> "list[Array]":
        """The pictures focused by each factor."""
        from lumigraph import rendering

        if any(tilt) and self.method == "fourier":
            raise FormatError("--tilt has no meaning with --method fourier. Use --method shear.")

        views = rendering.reduce_aperture(views, self.aperture, shape=self.aperture_shape)
        if self.method == "shear":
            stack = rendering.refocus_stack(
                views,
                alphas,
                interpolation=self.interpolation,
                oversample=self.samples(views),
                tilt=tilt,
                progress=shown,
            )
            return list(stack)
        images = []
        for alpha in alphas:
            images.append(rendering.refocus_fourier(views, alpha))
            shown(len(images) / len(alphas))
        return images


def refocus(
    views: Path,
    /,
    *,
    output: Output,
    focus: FocusOptions = FocusOptions(),
    origin: RawOptions = NO_ORIGIN,
    quality: PictureOptions = PictureOptions(),
    common: ReportOptions = REPORTED,
) -> Result:
    """Refocus on one or more depths.

    Example: `lumigraph refocus views.zarr --alpha 0.95 -o near.png`

    Example: `lumigraph refocus raw.png --white white.png --alphas 0.9:1.1:x9 -o stack.tiff`

    Example: `lumigraph refocus views.zarr --camera camera.toml --depth "-5 mm" --depth "5 mm" -o two.tiff`

    Parameters
    ----------
    views
        Views (.zarr, .h5, a folder) made by 'lumigraph decode' or by others, or a raw image.
    output
        One focus: a picture (.png, .tiff, .zarr). Several: a stack (.tiff), a film (.gif, .mp4) or a folder
        for PNG files.
    """
    common.check()
    quality.check()
    camera = cast("Decoded | None", origin.described("decode")) if focus.depth else None
    focus.check(camera)
    _check_output(output, focus.count)
    with progress("refocus") as shown:
        source, notes = _light_field(views, origin)
        alphas = focus.chosen(camera, source)
        images = quality.pictures(source, alphas, focus.tilt, shown)
    shape, samples = images[0].shape[:2], quality.samples(source)
    values = (
        Quantity("alphas", alphas), Quantity("shape", shape, "px"), Quantity("method", quality.method),
        Quantity("samples_per_lenslet", samples), Quantity("aperture", quality.aperture),
        Quantity("aperture_shape", quality.aperture_shape), Quantity("tilt", focus.tilt),
    )  # fmt: skip
    return Result(
        "Refocus", "Pictures refocused; α' above 1 is farther.", images,
        tuple(f"alpha {alpha:g}: {shape[0]} x {shape[1]} px{told_of(samples)}" for alpha in alphas), values,
        lambda: _figures(images, alphas), notes, tuple(_write(images, alphas, output)),
    )  # fmt: skip


def told_of(samples: int) -> str:
    """Words on a picture of several samples per lenslet; none where there is one."""
    return f", {samples} samples per lenslet" if samples > 1 else ""


def _figures(images: list[Any], alphas: list[float]) -> "Iterator[Figure]":
    white = max(float(image.max()) for image in images) or None
    for image, alpha in list(zip(images, alphas, strict=True))[:MOST_SHOWN]:
        yield Figure(image, f"α' = {alpha:g}", options={"white": white, "zoom": enlarged(image)})


def _light_field(path: Path, origin: RawOptions) -> "tuple[LightField, tuple[str, ...]]":
    """The views in a file, or those of the raw image in it, and what was done to it."""
    from lumigraph import preparation
    from lumigraph.core.lightfield import LightField

    found = origin.views(path)
    if isinstance(found, LightField):
        return found, ()
    ready = origin.prepared(found, use="decode")
    return preparation.decode(ready), notes_of(ready) if origin.camera is None else ready.notes


def _check_output(output: Path, count: int) -> None:
    if output.suffix or count == 1:
        files.check_output(output, files.PICTURES if count == 1 else (".tif", ".tiff", *files.MOVIES))
    elif output.exists() and not output.is_dir():
        raise FormatError(f"{output} is a file. Give a folder, or a stack that ends in .tiff.")
    else:
        from lumigraph.io.target import check_parent

        check_parent(output)


def _write(images: list[Any], alphas: list[float], output: Path) -> list[Path]:
    import numpy as np

    from lumigraph import io
    from lumigraph.core.stack import Stack

    if len(images) == 1:
        io.save(images[0], output)
        return [output]
    if output.suffix:
        io.save(Stack(np.stack(images), tuple(alphas), "alpha"), output)
        return [output]
    paths = [output / f"refocused-{k:03}-alpha-{alpha:.4f}.png" for k, alpha in enumerate(alphas)]
    files.check_inside(paths)
    output.mkdir(parents=True, exist_ok=True)
    # One white for all, so that the pictures of a folder can be compared.
    white = max(float(image.max()) for image in images) or None
    for image, path in zip(images, paths, strict=True):
        io.save(image, path, white=white)
    return paths
