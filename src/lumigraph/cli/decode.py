"""`lumigraph decode`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli import files, pictures
from lumigraph.cli.console import progress
from lumigraph.cli.options import Output
from lumigraph.cli.origin import NO_ORIGIN, PLENOPTIC, Origin
from lumigraph.cli.reporting import REPORTED, Reported, enlarged, told
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.raw import RawImage

_MOST_SAMPLES = 64


@Parameter(name="*")
@dataclass(frozen=True)
class Sampling:
    """How the raw image is sampled.

    Parameters
    ----------
    directions
        Views along each axis; one for each pixel of a micro-image if left out.
    samples
        Samples of a view per lenslet: those between the lenslets are interpolated.
    interpolation
        Between pixels, and between lenslets.
    hot_pixels
        Find pixels that shine by themselves, leave them out and mark what rests on them.
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
    origin: Origin = NO_ORIGIN,
    devignette: Annotated[bool | None, Parameter(negative="--no-devignette")] = None,
    sampling: Sampling = Sampling(),
    common: Reported = REPORTED,
) -> None:
    """Decode a raw image of a plenoptic camera 1.0 into views.

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
        Whether to divide by the white image; done where there is one.
    """
    from lumigraph import io, rendering

    common.check()
    if parts := pictures.parts_of(raw):
        if origin.is_given or origin.camera is not None:
            raise FormatError(
                f"{raw} holds pictures, which need neither --calibration nor --white. Leave them out."
            )
        return pictures.unpack(raw, parts, output, common)
    files.check_output(output, files.VIEWS)
    options = sampling.chosen()
    picture = files.read_raw(raw)
    bad = _hot(picture, origin) if sampling.hot_pixels else None
    with progress("decode"):
        ready, found = origin.prepared(picture, kind=PLENOPTIC, devignette=devignette)
        views = rendering.decode(ready, found, bad=bad, **options)
    io.save(views, output)
    nv, nu, nt, ns = views.data.shape[:4]
    lines = [f"{nv} x {nu} views of {nt} x {ns} px", f"written {output}"]
    values = {"shape": views.data.shape, "separation": views.separation, "output": str(output)}
    if bad is not None:
        share = 0.0 if views.valid is None else 1 - float(views.valid.mean())
        lines.insert(1, f"{int(bad.sum())} hot pixels, {100 * share:.2g} % of the samples are not valid")
        values |= {"hot_pixels": int(bad.sum()), "invalid": share}
    told(common, "\n".join(lines), values, lambda: _page(picture, views), _numbers(views))


def _numbers(views: Any) -> list[tuple[str, str]]:
    from lumigraph.core.picture import length

    nv, nu, nt, ns = views.data.shape[:4]
    return [
        ("views", f"{nv} x {nu}"), ("samples of a view", f"{nt} x {ns} px"),
        ("main lens to lenslets", length(views.separation)),
        ("views apart", length(views.aperture.pitch[1])), ("samples apart", length(views.lenslets.pitch[1])),
    ]  # fmt: skip


def _page(raw: "RawImage", views: Any) -> Any:
    from lumigraph.report import Page

    nv, nu = views.data.shape[:2]
    page = Page("Decode", "A raw image of a plenoptic camera 1.0, and its views.")
    section = page.section("Views")
    middle = views.view(nv // 2, nu // 2)
    zoom = enlarged(middle)
    section.figure(middle, "The middle view.", zoom=zoom)
    section.figure(
        views.view(nv // 2, nu - 1 - nu // 8),
        "A view from the side: what is near or far has moved.",
        zoom=zoom,
    )
    section.figure(
        views.data[nv // 2, :, views.data.shape[2] // 2],
        "Epipolar-plane image: the middle row of lenslets (across) from each view (down).",
        zoom=zoom,
    )
    page.section("Raw image").figure(raw, "As it was read.")
    return page


def _hot(picture: "RawImage", origin: Origin) -> Any:
    from lumigraph import rendering

    dark = None if origin.dark is None else files.read_raw(origin.dark)
    return rendering.hot_pixels(picture, dark=dark)
