"""Options of `lumigraph deconvolve`: raw image, object and method."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lumigraph.cli.options import above_zero, planes, region, section
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    import numpy as np

    from lumigraph.core.linear import Linear
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.core.raw import RawImage
    from lumigraph.deconvolution import RichardsonLucy
    from lumigraph.instruments import Instrument


@Parameter(name="*", group=section("Raw image"))
@dataclass(frozen=True)
class RawImageOptions:
    """Raw image and its corrections.

    Parameters
    ----------
    white
        White image: a microscope's lenslets are found on it, and its vignetting is taken into account.
    dark
        Dark image: the readings of pixels without light, which also show hot pixels.
    background
        Value that every pixel reads without light, if there is no dark image.
    calibration
        File made by 'lumigraph calibrate', or by the camera's maker, instead of the lenslets found on the
        white image.
    region
        Rows and columns of the raw image that count, such as '100:501, 80:641'; the rest is ignored in
        the fit, but not cut off.
    page
        Pages of a stack, counted from 0: one, such as 3, several, such as 3:9 or 3-9, or 'all'.
    """

    white: Path | None = None
    dark: Path | None = None
    background: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    calibration: Path | None = None
    region: str | None = None
    page: str | None = None

    def check(self) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if self.dark is not None and self.background is not None:
            raise FormatError("--dark and --background both give the dark level. Give one of them.")
        if self.background is not None and not (math.isfinite(self.background) and self.background >= 0):
            raise FormatError(f"--background is {self.background:g} but must be at least 0.")

    def prepared(self, raw: "RawImage", camera: "Instrument") -> "PreparedImage":
        """The raw image as it was read, with what the model of a deconvolution takes."""
        from lumigraph.preparation.given import Given

        given = Given(self.calibration, self.white, self.dark)
        ready = given.prepared(raw, camera=camera, mask=self._mask(raw.shape), divide=False)
        return ready if self.background is None else replace(ready, background=self.background)

    def _mask(self, shape: tuple[int, int]) -> "np.ndarray | None":
        import numpy as np

        if self.region is None:
            return None
        mask = np.zeros(shape, bool)
        mask[region(self.region, shape)] = True
        return mask

    def frames(self, path: Path) -> "list[tuple[str, Any]]":
        """Raw images and what to add to the output's name for each."""
        from lumigraph.preparation.given import read_pages

        found = read_pages(path, self.page)
        digits = len(str(max(found)))
        return [("" if len(found) == 1 else f"-page-{k:0{digits}}", raw) for k, raw in found.items()]


@Parameter(name="*", group=section("Object"))
@dataclass(frozen=True)
class ObjectOptions:
    """Sampling of the object.

    Parameters
    ----------
    depth
        Depths from the focused plane, positive farther: '-20 um:20 um:2 um' (first, last, step), or some,
        separated by commas; may be repeated; the focused plane if left out.
    samples
        Samples per lenslet, of the object.
    """

    depth: Annotated[tuple[str, ...] | None, Parameter(allow_leading_hyphen=True, negative="")] = None
    samples: Annotated[int | None, Parameter(allow_leading_hyphen=True)] = None

    def depths(self) -> tuple[float, ...] | None:
        """Depths [m]."""
        if self.samples is not None and self.samples < 1:
            raise FormatError(f"--samples is {self.samples} but must be at least 1.")
        return None if self.depth is None else planes("--depth", self.depth)


@Parameter(name="*", group=section("Method"))
@dataclass(frozen=True)
class MethodOptions:
    """Method of the deconvolution.

    Parameters
    ----------
    iterations
        Most iterations of Richardson-Lucy.
    prior
        none; tv: even but for edges (total variation); wavelets: few coefficients that are not noise.
    strength
        Strength of the prior, from 0.001 for bright images to 0.1 for dim ones.
    accelerated
        Accelerated Richardson-Lucy: the same likelihood in about a third of the iterations.
    deviance
        Stop where the deviance per pixel falls to this: to 1 for raw images of 'simulate --noise', whose
        electrons are known; refused where they are not.
    change
        Stop where an iteration changes the object by less than this part of it, such as 0.01.
    raw_lattice
        Leave out the low-pass that keeps squares as large as lenslets out of a microscope's volumes. Objects
        that were moved between raw images have none.
    checkpoint
        File (.npz) to resume from: after an interruption run the same command again.
    warm
        Begin each page of a series with the result of the one before: where little moves, half of the
        iterations are enough.
    """

    iterations: Annotated[int, Parameter(allow_leading_hyphen=True)] = 30
    prior: Literal["none", "tv", "wavelets"] = "none"
    strength: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    accelerated: Annotated[bool, Parameter(negative="")] = False
    deviance: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    change: Annotated[float | None, Parameter(allow_leading_hyphen=True)] = None
    raw_lattice: Annotated[bool, Parameter(negative="")] = False
    checkpoint: Path | None = None
    warm: Annotated[bool, Parameter(negative="")] = False

    def check(self) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if self.iterations < 1:
            raise FormatError(f"--iterations is {self.iterations} but must be at least 1.")
        if self.strength is not None and self.prior == "none":
            raise FormatError("--strength needs a prior. Give --prior tv or --prior wavelets.")
        above_zero("--strength", self.strength)
        above_zero("--deviance", self.deviance)
        above_zero("--change", self.change)

    def method(self, camera: "Instrument", operator: "Linear") -> "RichardsonLucy":
        """`RichardsonLucy` with these options."""
        from lumigraph.deconvolution import RichardsonLucy, TotalVariation, Wavelets
        from lumigraph.instruments.smoothing import low_pass_of

        given: dict[str, Any] = {} if self.strength is None else {"strength": self.strength}
        prior = {"none": None, "tv": TotalVariation(**given), "wavelets": Wavelets(**given)}[self.prior]
        smooth = None if self.raw_lattice else low_pass_of(camera, operator)
        return RichardsonLucy(prior, smooth, accelerated=self.accelerated)


SEEN, WANTED, WAY = RawImageOptions(), ObjectOptions(), MethodOptions()
