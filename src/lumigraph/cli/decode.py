"""`lumigraph decode`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files, pictures
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output, section
from lumigraph.cli.origin import NO_ORIGIN, RawOptions, notes_of
from lumigraph.cli.reporting import REPORTED, ReportOptions, enlarged
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.raw import RawImage

_MOST_SAMPLES = 64


@Parameter(name="*", group=section("Sampling"))
@dataclass(frozen=True)
class SamplingOptions:
    """Sampling of the views.

    Parameters
    ----------
    directions
        Views along each axis; one for each pixel of a micro-image if left out.
    samples
        Samples per lenslet, of a view: those between the lenslets are interpolated.
    interpolation
        Interpolation between pixels, and between lenslets.
    hot_pixels
        Find hot pixels even without --dark, leave them out and mark the samples that depend on them.
    """

    directions: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    samples: Annotated[int, Parameter(allow_leading_hyphen=True)] = 1
    interpolation: Literal["linear", "cubic", "band_limited"] = "cubic"
    hot_pixels: bool = False

    def chosen(self) -> dict[str, Any]:
        """The options of `decode`, refused where they cannot be."""
        if not 1 <= self.samples <= _MOST_SAMPLES:
            raise FormatError(f"--samples is {self.samples} but must be from 1 to {_MOST_SAMPLES}.")
        if self.directions is not None and self.directions < 1:
            raise FormatError(f"--directions is {self.directions} but must be at least 1.")
        return {
            "directions": self.directions,
            "samples": self.samples,
            "interpolation": self.interpolation,
        }


def decode(
    raw: Path,
    /,
    *,
    output: Output,
    origin: RawOptions = NO_ORIGIN,
    devignette: Annotated[bool | None, Parameter(negative="--no-devignette")] = None,
    sampling: SamplingOptions = SamplingOptions(),
    common: ReportOptions = REPORTED,
) -> Result:
    """Decode a raw image of a plenoptic camera 1.0 into views (sub-aperture images).

    Example: `lumigraph decode raw.png --white white.png -o views.zarr`

    Example: `lumigraph decode raw.png --white white.png --dark dark.png --hot-pixels --samples 2 -o views`

    Example: `lumigraph decode IMG_0001-stk.lfp -o pictures`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr, Lytro); a Bayer pattern is demosaiced. A Lytro container of pictures,
        depth and confidence maps is unpacked.
    output
        Views (.zarr, .zarr.zip, .h5, _eslf.png), or a folder of pictures.
    devignette
        Divide by the white image; done where there is one.
    """
    from lumigraph import io, preparation, rendering

    common.check()
    if parts := pictures.parts_of(raw):
        if origin.is_given or origin.camera is not None:
            raise FormatError(
                f"{raw} holds pictures, which need neither --calibration nor --white. Leave them out."
            )
        return pictures.unpack(raw, parts, output)
    files.check_output(output, files.VIEWS)
    options = sampling.chosen()
    picture = origin.read(raw)
    with progress("decode"):
        ready = origin.prepared(picture, use="decode", devignette=devignette)
        bad = ready.dead if sampling.hot_pixels else None
        if bad is not None and origin.dark is None:
            bad = bad | rendering.hot_pixels(picture)
        views = preparation.decode(ready, bad=bad, **options)
    io.save(views, output)
    (nv, nu, nt, ns), values = views.data.shape[:4], _quantities(views)
    lines = [f"{nv} x {nu} views of {nt} x {ns} px"]
    if bad is not None:
        lost = 0.0 if views.valid is None else 1 - float(views.valid.mean())
        lines.append(f"{int(bad.sum())} hot pixels, {100 * lost:.2g} % of the samples are not valid")
        values += (Quantity("hot_pixels", int(bad.sum())), Quantity("invalid", lost))
    return Result(
        "Decode", "A raw image of a plenoptic camera 1.0, and its views.", views, tuple(lines), values,
        lambda: _figures(picture, views), notes_of(ready, origin.camera), (output,),
    )  # fmt: skip


def _quantities(views: Any) -> tuple[Quantity, ...]:
    return (
        Quantity("shape", views.data.shape),
        Quantity("separation", views.separation, "m"),
        Quantity("views_apart", views.aperture.pitch[1], "m"),
        Quantity("samples_apart", views.lenslets.pitch[1], "m"),
    )


def _figures(raw: "RawImage", views: Any) -> "Iterator[Figure]":
    nv, nu = views.data.shape[:2]
    middle = views.view(nv // 2, nu // 2)
    zoom = {"zoom": enlarged(middle)}
    yield Figure(middle, "The middle view.", "Views", zoom)
    side = views.view(nv // 2, nu - 1 - nu // 8)
    yield Figure(side, "A view from the side: what is near or far has moved.", "Views", zoom)
    lines = views.data[nv // 2, :, views.data.shape[2] // 2]
    caption = "Epipolar-plane image: the middle row of lenslets (across) from each view (down)."
    yield Figure(lines, caption, "Views", zoom)
    yield Figure(raw, "As it was read.", "Raw image")
