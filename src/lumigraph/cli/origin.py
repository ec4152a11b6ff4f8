"""Options that accompany a raw image: calibration, white and dark image, camera file."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from lumigraph.cli.options import section
from lumigraph.errors import CalibrationError, FormatError

if TYPE_CHECKING:
    from lumigraph.core.lightfield import LightField
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.core.raw import RawImage
    from lumigraph.instruments.loading import AnyCamera

Use = Literal["decode", "render"]
"""The verb that a camera's raw images are for; None for all of them."""


@Parameter(name="*", group=section("Raw image"))
@dataclass(frozen=True)
class RawOptions:
    """Corrections and geometry of a raw image, for views, a picture or a volume.

    Parameters
    ----------
    calibration
        File made by 'lumigraph calibrate', or by the camera's maker (.xml, .ini), for a raw image.
    white
        White image, for a raw image: it is divided by it, and calibrated from it without --calibration.
    dark
        Image with the lens covered: subtracted; shows which pixels are hot.
    camera
        Camera file, or a name of the catalogue: gives the calibration if no other is given, and depths.
    page
        Page of a stack of raw images, counted from 0.
    bit_depth
        Bits of the sensor, such as 12, where the file does not say and full pixels are to be known.
    mosaic
        Views, rows x columns, such as 5x5, of a picture made of blocks, one for each lenslet (ESLF).
    """

    calibration: Path | None = None
    white: Path | None = None
    dark: Path | None = None
    camera: str | None = None
    page: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    bit_depth: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None
    mosaic: str | None = None

    @property
    def is_given(self) -> bool:
        """True if some option is given that only a raw image needs."""
        given = (self.calibration, self.white, self.dark, self.page, self.bit_depth)
        return any(one is not None for one in given)

    def read(self, path: Path) -> "RawImage":
        """The raw image in a file, or on the page of a stack."""
        from lumigraph.core.saturation import with_bits
        from lumigraph.preparation.given import read_pages

        (found,) = read_pages(path, None if self.page is None else str(self.page), one=True).values()
        return with_bits(found, self.bit_depth)

    def views(self, path: Path) -> "LightField | RawImage":
        """The views in a file, or the raw image that they can be decoded from.

        Raises
        ------
        FormatError
            Something else, NaN, or views with something that only a raw image needs.
        """
        from lumigraph import io
        from lumigraph.core import checks
        from lumigraph.core.lightfield import LightField
        from lumigraph.core.raw import RawImage
        from lumigraph.core.short_repr import called
        from lumigraph.core.stack import Stack
        from lumigraph.core.volume import Volume

        one = self.page if self.mosaic is None and io.opens_pages(path) else None
        found = io.open(path, page=one, views=self.views_of_mosaic)
        if isinstance(found, RawImage) or (one is None and isinstance(found, Stack | Volume)):
            return self.read(path)
        if not isinstance(found, LightField):
            raise FormatError(f"{path} holds a {called(found)} where views or a raw image are needed.")
        checks.finite_array(str(path), found.data, FormatError)
        if (self if one is None else replace(self, page=None)).is_given:
            raise FormatError(
                f"{path} holds views, which need no --calibration, --white, --dark, --page or --bit-depth. "
                "Leave them out."
            )
        return found

    @property
    def views_of_mosaic(self) -> tuple[int, int] | None:
        """Views (v, u) of --mosaic."""
        if self.mosaic is None:
            return None
        rows, _, columns = self.mosaic.lower().partition("x")
        try:
            found = int(rows), int(columns or rows)
        except ValueError:
            found = 0, 0
        if min(found) < 1:
            raise FormatError(f"--mosaic is {self.mosaic!r} but must be numbers of views, such as 5x5.")
        return found

    def described(self, use: Use | None = None) -> "AnyCamera | None":
        """The camera, or None; refused if its raw images are for another verb."""
        if self.camera is None:
            return None
        from lumigraph.instruments import load_camera
        from lumigraph.instruments.capabilities import Rendered

        camera = load_camera(self.camera)
        told = f"--camera {self.camera} is a {camera.noun}, which"
        if camera.calibration is None:
            raise FormatError(f"{told} has no lenslets: use 'lumigraph deconvolve'.")
        if use == "render" and not isinstance(camera, Rendered):
            raise FormatError(f"{told} is decoded: use 'lumigraph decode'.")
        if use == "decode" and isinstance(camera, Rendered):
            raise FormatError(f"{told} is rendered: use 'lumigraph render'.")
        return camera

    def prepared(
        self, raw: "RawImage", *, use: Use | None = None, devignette: bool | None = None
    ) -> "PreparedImage":
        """The raw image, ready to use; refused where its lattice is not known.

        Parameters
        ----------
        raw
            Raw image as it was read.
        use
            Verb that the camera's raw images must be suited to; None for any.
        devignette
            True to divide by the white image; None for yes where there is one.
        """
        from lumigraph.preparation.given import Given

        camera = self.described(use)
        if camera is None and self.calibration is None and self.white is None:
            raise CalibrationError(
                "the positions of the micro-images are not known. Give --calibration FILE or --white FILE."
            )
        if devignette and self.white is None:
            raise CalibrationError("--devignette needs the white image. Give --white FILE.")
        return Given(self.calibration, self.white, self.dark).prepared(
            raw, camera=camera, even=devignette is not False
        )


def notes_of(ready: "PreparedImage", camera: str | None = None) -> tuple[str, ...]:
    """Notes on a prepared raw image, and on lengths missing for its views; `camera` as it was given."""
    known = ready.calibration
    if known is None or (known.separation and known.lenslet_distance):
        return ready.notes
    factors = "refocus factors are those of a main lens 20 times as far from the lenslets as the sensor"
    if camera is None:
        return (*ready.notes, f"the camera's lengths are not known: {factors}. Give --camera for its own")
    return (
        *ready.notes,
        f"{camera} has no main lens: {factors}. For depths, give --camera to refocus and depth",
    )


NO_ORIGIN = RawOptions()
