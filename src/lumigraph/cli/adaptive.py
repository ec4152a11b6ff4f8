"""Options of `lumigraph deconvolve` for unknown aberrations, and its report of them."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from cyclopts import Parameter

from lumigraph.cli.options import section
from lumigraph.core.progress import Progress
from lumigraph.core.result import Figure, Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from lumigraph.core.prepared import PreparedImage
    from lumigraph.instruments import Instrument, LightFieldMicroscope
    from lumigraph.studies.adaptive import Wavefront

TERMS = "5-11"
"""Default terms: up to coma, trefoil and spherical aberration."""

FLAT = "4-11"
"""The same of a picture at a known depth: with defocus."""

HIGHEST = 66
"""Highest Noll index, order 10: more than a light field can determine."""


def indices(text: str) -> tuple[int, ...]:
    """Noll indices, each once.

    >>> indices("5-7, 11")
    (5, 6, 7, 11)
    """
    found: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"\s*(\d{1,3})(?:\s*-\s*(\d{1,3}))?\s*", part)
        first, last = (int(ends[1]), int(ends[2] or ends[1])) if ends else (0, 0)
        if not 1 <= first <= last <= HIGHEST:
            raise FormatError(
                f"--terms is {text!r} but must be Noll indices from 1 to {HIGHEST}, such as '5-11' "
                "or '5, 6, 8'."
            )
        found += range(first, last + 1)
    return tuple(dict.fromkeys(found))


@Parameter(name="*", group=section("Adaptive optics"))
@dataclass(frozen=True)
class Adaptive:
    """Aberrations to find before the object.

    Parameters
    ----------
    adaptive
        Find the aberrations of a microscope or of a camera of kind plenoptic from the raw image, or the first
        of several pages, and deconvolve with them. Takes minutes.
    terms
        Noll indices of the Zernike terms to find, such as 5,6,8; left out, 5-11, or 4-11 for a
        picture.
    object
        Content of the raw image: volume, anything with texture; picture, something flat at one known depth;
        beads, sparse points. Left out, a volume, or for cameras a picture.
    """

    adaptive: Annotated[bool, Parameter(negative="")] = False
    terms: str | None = None
    object: Literal["volume", "picture", "beads"] | None = None

    def check(self, count: int) -> None:
        """Refuse what can be seen to be wrong before anything is read."""
        if not self.adaptive and (self.terms, self.object) != (None, None):
            raise FormatError("--terms and --object are of aberrations that are found. Add --adaptive.")
        if self.adaptive and count > 1:
            raise FormatError(f"--adaptive takes one raw image, but there are {count} files. Give one.")
        self.indices()

    def indices(self, flat: bool = False) -> tuple[int, ...]:
        """Noll indices, each once; of something flat at a known depth with defocus."""
        return indices(self.terms or (FLAT if flat else TERMS))

    def found(
        self, raw: "PreparedImage", camera: "Instrument", planes: tuple[float, ...] | None, shown: Progress
    ) -> "Wavefront | None":
        """Wavefront, if requested; `estimate` refuses cameras that have none."""
        if not self.adaptive:
            return None
        from lumigraph.instruments import LensletCamera
        from lumigraph.studies.adaptive import estimate

        shown(0.0)
        focused = isinstance(camera, LensletCamera)
        kind = self.object or ("picture" if focused else "volume")
        return estimate(
            raw,
            cast("LightFieldMicroscope", camera),
            planes or (0.0,),
            self.indices(kind == "picture"),
            pixels=None if focused else raw.calibration,  # as `operator_for` has it
            object=kind,
            progress=shown,
        )


ADAPTIVE = Adaptive()


def signed(value: float, deviation: float) -> tuple[str, str]:
    """A value with its sign and its deviation, to thousandths or as finely as the deviation needs.

    >>> signed(0.1, 0.0123), signed(-0.08, 0.00042)
    (('+0.100', '0.012'), ('-0.0800', '0.0004'))
    """
    small = 0 < deviation < 1e-3
    digits = min(-math.floor(math.log10(deviation)), 9) if small else 3
    return f"{value:+.{digits}f}", f"{deviation:.{digits}f}"


@dataclass(frozen=True)
class Modes:
    """Zernike terms that were found, in the form of the report.

    Parameters
    ----------
    coefficients, deviations
        Noll index to waves rms.
    untold
        Why others are not known.
    explained
        Part of a term's information that the object takes; empty where that is not known.
    """

    coefficients: Mapping[int, float]
    deviations: Mapping[int, float]
    untold: Mapping[int, str]
    explained: Mapping[int, float]

    @classmethod
    def of(cls, found: "Wavefront") -> "Modes":
        """Modes of a wavefront, averaged over the field."""
        deviations = dict(zip(found.terms, found.deviations.mean((0, 1)).tolist(), strict=True))
        return cls(found.coefficients, deviations, found.untold, found.explained)

    @property
    def rms(self) -> float:
        """Rms of the wavefront [waves]."""
        return math.hypot(*self.coefficients.values())

    def lines(self) -> tuple[str, ...]:
        """Lines for people."""
        known = (signed(c, self.deviations[j]) for j, c in self.coefficients.items())
        text = ", ".join(f"Z{j} {c} ± {d}" for j, (c, d) in zip(self.coefficients, known, strict=True))
        untold = (f"Z{j} is not known: {reason}" for j, reason in self.untold.items())
        return (f"wavefront of {self.rms:.3f} waves rms: {text}", *untold)

    def values(self) -> dict[str, Any]:
        """Values for programs."""
        terms = {
            str(j): {"waves": c, "deviation": self.deviations[j], "explained": self.explained.get(j)}
            for j, c in self.coefficients.items()
        }
        return {"rms_waves": self.rms, "terms": terms, "untold": {str(j): r for j, r in self.untold.items()}}

    def quantities(self) -> tuple[Quantity, ...]:
        """Each term, within one standard deviation."""
        known = ((j, c, self.deviations[j]) for j, c in self.coefficients.items())
        return tuple(Quantity(f"Z{j}", c, "waves", (c - d, c + d)) for j, c, d in known)

    def table(self) -> list[list[str]]:
        """Terms by name, the header first."""
        from lumigraph.elements.zernike import zernike_name

        rows = [["term", "name", "waves rms", "standard deviation"]]
        for j, c in self.coefficients.items():
            rows.append([f"Z{j}", zernike_name(j), *signed(c, self.deviations[j])])
        return rows + [[f"Z{j}", zernike_name(j), "not known", reason] for j, reason in self.untold.items()]

    def figures(self) -> "Iterator[Figure]":
        """The map over the pupil, and the terms."""
        import numpy as np

        from lumigraph import plots
        from lumigraph.studies.adaptive import wavefront_map

        phase = wavefront_map(self.coefficients)
        most = float(np.nanmax(np.abs(phase))) or 1.0
        drawn = plots.show(phase, label="wavefront [waves]", cmap="RdBu_r", limits=(-most, most))
        drawn.axes[0].set_axis_off()
        yield Figure(drawn, "Over the pupil as the raw image says, y downwards.", "Wavefront")
        yield Figure(self.table(), section="Wavefront")


def with_wavefront(result: Result, found: "Wavefront") -> Result:
    """A result of the deconvolution with what was found of the wavefront."""
    modes, wide = Modes.of(found), tuple(_widths(found))

    def figures() -> "Iterator[Figure]":
        yield from modes.figures()
        yield from result.figures()

    return replace(
        result,
        headline=(*modes.lines(), *(f"beads are {width} wide" for width in wide), *result.headline),
        quantities=(*result.quantities, *modes.quantities(), *wide),
        extra={**result.extra, "wavefront": modes.values()}, figures=figures,
    )  # fmt: skip


def _widths(found: "Wavefront") -> "Iterator[Quantity]":
    """Width of beads that are balls, with an interval of one standard deviation."""
    if width := found.bead_width:
        deviation = found.bead_width_deviation
        yield Quantity("bead_width", width, "m", (max(0.0, width - deviation), width + deviation))
