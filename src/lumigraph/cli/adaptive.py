"""What `lumigraph deconvolve` is told of aberrations to find, and what it reports of them."""

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal, cast

from cyclopts import Parameter

from lumigraph.core.progress import Progress
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.adaptive import Wavefront
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.instruments import Instrument, LightFieldMicroscope

TERMS = "5-11"
"""Unless others are asked for: up to coma, trefoil and spherical aberration."""

HIGHEST = 66
"""Noll index: order 10. More of them than a light field tells."""


@Parameter(name="*")
@dataclass(frozen=True)
class Adaptive:
    """Aberrations that are found first.

    Parameters
    ----------
    adaptive
        Find the microscope's aberrations from the raw image, of several pages from the first, and deconvolve
        with them. Takes minutes.
    terms
        Noll indices of the Zernike terms that are looked for, such as 5-11 (the default) or 5,6,8.
    object
        What the raw image shows: volume, anything with texture; beads, sparse points.
    """

    adaptive: Annotated[bool, Parameter(negative="")] = False
    terms: str | None = None
    object: Literal["volume", "beads"] | None = None

    def check(self, count: int) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if not self.adaptive and (self.terms, self.object) != (None, None):
            raise FormatError("--terms and --object are of aberrations that are found. Add --adaptive.")
        if self.adaptive and count > 1:
            raise FormatError(f"--adaptive takes one raw image, but there are {count} files. Give one.")
        self.indices()

    def indices(self) -> tuple[int, ...]:
        """Noll indices, each once.

        >>> Adaptive(terms="5-7, 11").indices()
        (5, 6, 7, 11)
        """
        found: list[int] = []
        for part in (self.terms or TERMS).split(","):
            ends = re.fullmatch(r"\s*(\d{1,3})(?:\s*-\s*(\d{1,3}))?\s*", part)
            first, last = (int(ends[1]), int(ends[2] or ends[1])) if ends else (0, 0)
            if not 1 <= first <= last <= HIGHEST:
                raise FormatError(
                    f"--terms is {self.terms!r} but must be Noll indices from 1 to {HIGHEST}, such as '5-11' "
                    "or '5, 6, 8'."
                )
            found += range(first, last + 1)
        return tuple(dict.fromkeys(found))

    def found(
        self, raw: "PreparedImage", camera: "Instrument", planes: tuple[float, ...] | None, shown: Progress
    ) -> "Wavefront | None":
        """The wavefront, if it is asked for; cameras that have none are refused by `estimate`."""
        if not self.adaptive:
            return None
        from lumigraph.adaptive import estimate

        shown(0.0)
        scope = cast("LightFieldMicroscope", camera)
        return estimate(
            raw,
            scope,
            planes or (0.0,),
            self.indices(),
            pixels=raw.calibration,
            object=self.object or "volume",
            progress=shown,
        )


ADAPTIVE = Adaptive()


def with_wavefront(result: Result, found: "Wavefront") -> Result:
    """A result of the deconvolution with what was found of the wavefront."""
    deviations = dict(zip(found.terms, found.deviations.mean((0, 1)).tolist(), strict=True))
    known = found.coefficients
    text = ", ".join(f"Z{j} {known[j]:+.3f} ± {deviations[j]:.3f}" for j in found.terms)
    lines = [f"wavefront of {found.rms:.3f} waves rms: {text}"]
    lines += [f"Z{j} is not known: {reason}" for j, reason in found.untold.items()]
    terms = {
        str(j): {"waves": known[j], "deviation": deviations[j], "explained": found.explained.get(j)}
        for j in found.terms
    }
    told = {"rms_waves": found.rms, "terms": terms, "untold": {str(j): r for j, r in found.untold.items()}}
    quantities = tuple(
        Quantity(f"Z{j}", known[j], "waves", (known[j] - deviations[j], known[j] + deviations[j]))
        for j in found.terms
    )

    def figures() -> "Iterator[Figure]":
        import numpy as np

        from lumigraph import plots

        phase = found.phase()
        most = float(np.nanmax(np.abs(phase))) or 1.0
        drawn = plots.show(phase, label="wavefront [waves]", cmap="RdBu_r", limits=(-most, most))
        drawn.axes[0].set_axis_off()
        yield Figure(drawn, "Over the objective's pupil, as the raw image says.", "Wavefront")
        yield from result.figures()

    return replace(
        result, headline=(*lines, *result.headline), quantities=(*result.quantities, *quantities),
        extra={**result.extra, "wavefront": told}, figures=figures,
    )  # fmt: skip
