"""`lumigraph wavefront`: a camera with lenslets as wavefront sensor."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from cyclopts import Parameter

from lumigraph.cli import files
from lumigraph.cli.adaptive import Modes, indices
from lumigraph.cli.console import progress
from lumigraph.cli.deconvolve_options import SEEN, RawImageOptions
from lumigraph.cli.options import Output, length
from lumigraph.cli.reporting import REPORTED, ReportOptions, enlarged
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.instruments import Instrument
    from lumigraph.studies.adaptive import Wavefront as Found
    from lumigraph.studies.adaptive.start import ViewSlopes


def wavefront(
    raw: Path,
    /,
    *,
    camera: str,
    object: Literal["star", "scene"] = "star",  # noqa: A002 - what it is called everywhere
    terms: str = "4-21",
    place: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    seen: RawImageOptions = SEEN,
    output: Output | None = None,
    common: ReportOptions = REPORTED,
) -> Result:
    """Find the wavefront at a camera's main lens, from one raw image of a star or of a scene.

    For a star, any point of light, Zernike terms are fitted to the pixels through the camera's wave optics.
    For a flat scene with texture they follow from the shifts of views, by rays: for a camera of kind
    "plenoptic" or a microscope of configuration "1.0", and less exactly. Terms have standard deviations.

    Example: `lumigraph wavefront star.tiff --camera telescope.toml --dark dark.tiff --report wavefront.html`

    Example: `lumigraph wavefront scene.tiff --camera camera.toml --object scene --terms 4-11 -o bent.toml`

    Parameters
    ----------
    raw
        Raw image (TIFF, PNG, Zarr), as it was read.
    camera
        Camera file (TOML), or the name of a bundled one.
    object
        Content of the raw image: star, one point of light; scene, something flat in the focused plane.
    terms
        Noll indices of the Zernike terms to find, such as 4-21 or 4,5,6.
    place
        Position of the star, y, x and z from the focused plane, such as '0 um, 0 um, 2 mm'; the middle of
        the picture if left out. y and x need be known to within half a lenslet.
    output
        Camera file with these aberrations (.toml).
    """
    from lumigraph import store
    from lumigraph.instruments import load_camera

    if output is not None:
        files.check_output(output, (".toml",))
    for options in (common, seen):
        options.check()
    asked, at = indices(terms), _place(place)
    _check(object, place, seen)
    described, frames = load_camera(camera), seen.frames(raw)
    if len(frames) > 1:
        raise FormatError(f"{raw} has {len(frames)} pages, and each its wavefront. Give one --page.")
    ready = seen.prepared(frames[0][1], described)
    found = _of_star(ready, described, asked, at) if object == "star" else _of_scene(ready, described, asked)
    if output is not None:
        store.write_bytes(output, found.thing.instrument.to_toml().encode())
    written = () if output is None else (output,)
    return replace(found, notes=(*found.notes, *ready.notes), written=written)


def _check(seen_as: str, place: str | None, seen: RawImageOptions) -> None:
    """Refuse what only the other kind of object has."""
    if seen_as == "scene" and (place, seen.region) != (None, None):
        raise FormatError("--place and --region are of a star. Leave them out, or use --object star.")
    if seen_as == "star" and seen.calibration is not None:
        raise FormatError(
            "--calibration is of scenes: before a star the camera file says where lenslets stand. "
            "Leave it out."
        )


def _place(text: str | None) -> tuple[float, float, float]:
    """Position of the star [m].

    >>> _place("1 um, -2 um, 3 mm")
    (1e-06, -2e-06, 0.003)
    """
    if text is None:
        return 0.0, 0.0, 0.0
    parts = [length("--place", part.strip()) for part in text.split(",")]
    if len(parts) != 3:
        raise FormatError(f"--place is {text!r} but must be y, x and z, such as '0 um, 0 um, 2 mm'.")
    return cast("tuple[float, float, float]", tuple(parts))


def _of_star(
    ready: "PreparedImage", camera: "Instrument", terms: tuple[int, ...], place: tuple[float, float, float]
) -> Result:
    from lumigraph.studies.adaptive import sense

    with progress("wavefront") as shown:
        found = sense(ready, cast("Any", camera), terms, place=place, progress=shown)
    modes, (at,) = Modes.of(found), found.beads.positions
    about = (
        Quantity("star", (float(at[0]), float(at[1])), "m"),
        Quantity("electrons", float(found.beads.intensities[0])),
        Quantity("variance left over that of noise", found.pearson),
    )
    before, after = found.deviance
    note = f"deviance per pixel {before:.4g} without aberrations, {after:.4g} with them"
    return _result(found, modes, about, ready, (note,))


def _of_scene(ready: "PreparedImage", camera: "Instrument", terms: tuple[int, ...]) -> Result:
    import numpy as np

    from lumigraph.studies.adaptive import start

    dark = 0.0 if ready.background is None else ready.background
    light = np.asarray(ready.data, np.float32) - np.asarray(dark, np.float32)
    found = start(light, cast("Any", camera), terms, pixels=ready.calibration)
    modes = Modes(found.coefficients, found.deviations, {}, {})
    about = (
        Quantity("views", len(found.places)),
        Quantity("shifts left", found.residual, "m"),
    )
    return _result(found, modes, about, ready, ("by the shifts of views, as rays see them",))


def _result(
    found: "Found | ViewSlopes", modes: Modes, about: tuple[Quantity, ...], ready: "PreparedImage",
    notes: tuple[str, ...],
) -> Result:  # fmt: skip
    expected = float(sum(d**2 for d in modes.deviations.values()) ** 0.5)

    def figures() -> Iterator[Figure]:
        yield from modes.figures()
        yield Figure(ready, "As it was read.", "Raw image", {"zoom": enlarged(ready)})

    return Result(
        "Wavefront", "Aberrations of a camera, from one raw image.", found,
        (*modes.lines(), f"expected error {expected:.2g} waves rms in all"),
        (Quantity("wavefront", modes.rms, "waves"), Quantity("expected error", expected, "waves"), *about),
        figures, notes, extra=modes.values(),
    )  # fmt: skip
