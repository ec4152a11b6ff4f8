"""`lumigraph refocus`."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.console import Count, progress
from lumigraph.cli.options import Output, length
from lumigraph.cli.origin import NO_ORIGIN, PLENOPTIC, Origin
from lumigraph.cli.reporting import REPORTED, Reported, enlarged, told
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.arrays import Array
    from lumigraph.core.lightfield import LightField

_MOST = 1000
_MOST_SAMPLES = 64
MOST_SHOWN = 24
"""Pictures in a report."""


@Parameter(name="*")
@dataclass(frozen=True)
class Focus:
    """Where to focus: α' = F/F', below 1 nearer than the focused plane was, 1 as it was, above 1 farther.

    Parameters
    ----------
    alpha
        One or more numbers.
    alphas
        A range 'first:last:count', such as 0.9:1.1:9.
    depth
        From the focused plane, such as '5 mm' (farther) or '-5 mm'; may be repeated; needs --camera.
    """

    alpha: Annotated[list[float] | None, Parameter(consume_multiple=True)] = None
    alphas: str | None = None
    depth: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True)] = None

    def chosen(self, camera: Any) -> list[float]:
        """All factors, as given."""
        found = [*(self.alpha or []), *(range_of("--alphas", self.alphas) if self.alphas else [])]
        if self.depth:
            if camera is None:
                raise FormatError("--depth needs the camera's geometry. Give --camera FILE, or --alpha.")
            if not hasattr(camera, "alpha"):
                raise FormatError(
                    f"--depth has no refocus factor in a {camera.KIND}. Give --alpha, or use "
                    "'lumigraph deconvolve --z'."
                )
            found += [camera.alpha(length("--depth", text) or 0.0) for text in self.depth]
        if not found:
            raise FormatError("where to focus is not known. Give --alpha 0.95 or --alphas 0.9:1.1:9.")
        for alpha in found:
            if not math.isfinite(alpha) or alpha <= 0:
                raise FormatError(f"--alpha is {alpha:g} but must be a finite number above 0.")
        return found


@Parameter(name="*")
@dataclass(frozen=True)
class Quality:
    """How pictures are made.

    Parameters
    ----------
    method
        shear: sums sheared views; fourier: slices their spectrum.
    aperture
        Part of the aperture's width that is used: smaller is sharper in depth, and noisier.
    shape
        Of the aperture: all views, those inside a circle, or those in a ring.
    oversample
        Pixels per lenslet: out of the lenslets' plane, views fill in between; for shear.
    interpolation
        Between lenslets; for shear.
    """

    method: Literal["shear", "fourier"] = "shear"
    aperture: float = 1.0
    shape: Literal["square", "round", "ring"] = "square"
    oversample: Annotated[int, Parameter(allow_leading_hyphen=True)] = 1
    interpolation: Literal["linear", "cubic", "band_limited"] = "cubic"

    def check(self) -> None:
        """Refuse what no picture can be made with."""
        if not 0 < self.aperture <= 1:
            raise FormatError(f"--aperture is {self.aperture:g} but must be above 0 and at most 1.")
        if not 1 <= self.oversample <= _MOST_SAMPLES:
            raise FormatError(f"--oversample is {self.oversample} but must be from 1 to {_MOST_SAMPLES}.")
        if self.method == "fourier" and self.oversample != 1:
            raise FormatError("--oversample has no meaning with --method fourier. Use --method shear.")

    def pictures(self, views: "LightField", alphas: list[float], shown: Count) -> "list[Array]":
        """The pictures focused by each factor."""
        from lumigraph import rendering

        views = rendering.reduce_aperture(views, self.aperture, shape=self.shape)
        if self.method == "shear":
            stack = rendering.refocus_stack(
                views,
                alphas,
                interpolation=self.interpolation,
                oversample=self.oversample,
                progress=shown,
            )
            return list(stack)
        images = []
        for alpha in alphas:
            images.append(rendering.refocus_fourier(views, alpha))
            shown(len(images), len(alphas))
        return images


def refocus(
    views: Path,
    /,
    *,
    output: Output,
    focus: Focus = Focus(),
    origin: Origin = NO_ORIGIN,
    quality: Quality = Quality(),
    common: Reported = REPORTED,
) -> None:
    """Focus afresh on one or more depths.

    Example: `lumigraph refocus views.zarr --alpha 0.95 -o near.png`

    Example: `lumigraph refocus raw.png --white white.png --alphas 0.9:1.1:9 -o stack.tiff`

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
    alphas = focus.chosen(origin.described(PLENOPTIC) if focus.depth else None)
    _check_output(output, alphas)
    with progress("refocus") as shown:
        images = quality.pictures(light_field(views, origin), alphas, shown)
    written = _write(images, alphas, output)
    shape = images[0].shape[:2]
    lines = [f"alpha {alpha:g}: {shape[0]} x {shape[1]} px" for alpha in alphas]
    text = "\n".join([*lines, *(f"written {path}" for path in written)])
    values = {"alphas": alphas, "shape": shape, "output": [str(path) for path in written]}
    told(common, text, values, lambda: _page(images, alphas), _numbers(shape, quality))


def _numbers(shape: tuple[int, ...], quality: Quality) -> list[tuple[str, str]]:
    return [
        ("picture", f"{shape[0]} x {shape[1]} px"), ("method", quality.method),
        ("aperture", f"{100 * quality.aperture:g} %, {quality.shape}"),
    ]  # fmt: skip


def _page(images: list[Any], alphas: list[float]) -> Any:
    from lumigraph.report import Page

    page, shown = Page("Refocus", "Pictures focused afresh; α' above 1 is farther."), images[:MOST_SHOWN]
    white = max(float(image.max()) for image in images) or None
    section = page.section("Pictures")
    for image, alpha in zip(shown, alphas, strict=False):
        section.figure(image, f"α' = {alpha:g}", white=white, zoom=enlarged(image))
    if len(images) > len(shown):
        section.text(f"{len(images) - len(shown)} more are not shown.")
    return page


def light_field(path: Path, origin: Origin) -> "LightField":
    """The views in a file, or those of the raw image in it.

    Raises
    ------
    FormatError
        Views, with something that only a raw image needs.
    """
    from lumigraph import rendering
    from lumigraph.core.lightfield import LightField

    found = files.read_views(path)
    if isinstance(found, LightField):
        if origin.is_given:
            raise FormatError(f"{path} holds views, which need no --calibration or --white. Leave them out.")
        return found
    return rendering.decode(*origin.prepared(found, kind=PLENOPTIC))


def _check_output(output: Path, alphas: list[float]) -> None:
    if output.suffix or len(alphas) == 1:
        files.check_output(output, files.PICTURES if len(alphas) == 1 else (".tif", ".tiff", *files.MOVIES))
    elif output.exists() and not output.is_dir():
        raise FormatError(f"{output} is a file. Give a folder, or a stack that ends in .tiff.")
    elif not output.parent.is_dir():
        raise FormatError(f"the folder {output.parent} for {output.name} does not exist. Make it first.")


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
    output.mkdir(exist_ok=True)
    # One white for all, so that the pictures of a folder can be compared.
    white = max(float(image.max()) for image in images) or None
    paths = [output / f"refocused-{k:03}-alpha-{alpha:.4f}.png" for k, alpha in enumerate(alphas)]
    for image, path in zip(images, paths, strict=True):
        io.save(image, path, white=white)
    return paths


def range_of(option: str, text: str) -> list[float]:
    """The numbers of a range 'first:last:count' after an option.

    Raises
    ------
    FormatError
        Another form, or a count that is too large.
    """
    try:
        words = text.split(":")
        first, last, count = float(words[0]), float(words[1]), int(":".join(words[2:]))
    except (IndexError, ValueError):
        raise FormatError(f"{option} is {text!r} but must be first:last:count, such as 0.9:1.1:9.") from None
    if not 2 <= count <= _MOST or not math.isfinite(first) or not math.isfinite(last):
        raise FormatError(f"{option} is {text!r} but needs finite numbers and a count from 2 to {_MOST}.")
    return [first + (last - first) * k / (count - 1) for k in range(count)]
