"""Options of `lumigraph deconvolve` for several raw images of one object."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli.options import length, section
from lumigraph.core.progress import Progress
from lumigraph.core.result import Quantity, Result
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.core.prepared import PreparedImage
    from lumigraph.instruments import Instrument
    from lumigraph.metrology.scanning import FoundShifts

MOST_STEPS = 30
"""Most steps of a scan, along each axis."""

Shifts = tuple[tuple[float, float], ...]


@Parameter(name="*", group=section("Several raw images"))
@dataclass(frozen=True)
class SeveralOptions:
    """Differences between raw images of one object.

    Parameters
    ----------
    shifts
        Displacements of the object: '3x3', thirds of a lenslet in the object, row after row from the least
        y and x; or a pair for each raw image, such as '0 um, 0 um; 33 um, 0 um', y first.
    find_shifts
        Find the shifts from the raw images, whose noise is known, near those of --shifts: for an object with
        texture, flat and in focus before a camera 1.0, of any depth before a microscope 1.0, moved by a stage
        that is off by some tenths of a lenslet.
    light
        Relative exposure of each raw image, such as '1, 1, 4': exposure times. Left out, as the raw images
        of 'simulate' record it, else the same.
    """

    shifts: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    find_shifts: Annotated[bool, Parameter(negative="")] = False
    light: str | None = None

    def check(self, count: int) -> None:
        """Refuse what does not go with so many raw images, before anything is read."""
        if count == 1 and (self.shifts, self.light) != (None, None):
            raise FormatError("--shifts and --light are of several raw images. Name all their files.")
        if count == 1 and self.find_shifts:
            raise FormatError("--find-shifts are between several raw images. Name all their files.")
        _check_count("--shifts", self._count(), count)
        _check_count("--light", None if self.light is None else len(self.lights()), count)

    def _count(self) -> int | None:
        if self.shifts is None:
            return None
        steps = _steps(self.shifts)
        return len(_pairs(self.shifts)) if steps is None else steps**2

    def moved(self, camera: "Instrument", count: int) -> Shifts:
        """Shifts (y, x) [m], one for each raw image."""
        from lumigraph.instruments.capabilities import WithLenslets
        from lumigraph.metrology.scanning import scan

        if self.shifts is None:
            return ((0.0, 0.0),) * count
        steps = _steps(self.shifts)
        if steps is None:
            return _pairs(self.shifts)
        if not isinstance(camera, WithLenslets):
            raise FormatError(
                f"a {camera.noun} camera has no lenslets that --shifts {self.shifts} divides. Give lengths."
            )
        return tuple((float(y), float(x)) for y, x in scan(steps, camera.lenslet_size).tolist())

    def where(
        self, camera: "Instrument", raws: "Sequence[PreparedImage]", shown: Progress
    ) -> "tuple[Shifts | None, FoundShifts | None]":
        """Shifts of several raw images, and with what errors they were found, if they were."""
        if len(raws) == 1:
            return None, None
        given = self.moved(camera, len(raws))
        if not self.find_shifts:
            return given, None
        from lumigraph.deconvolution import Exposure
        from lumigraph.metrology.scanning import find_shifts

        known = [Exposure.of(raw) for raw in raws]
        if self.light is not None:
            known = [replace(one, light=t) for one, t in zip(known, self.lights(), strict=True)]
        found = find_shifts(raws, camera, given, exposure=known, progress=shown)
        return tuple((float(y), float(x)) for y, x in found.shifts.tolist()), found

    def lights(self) -> tuple[float, ...]:
        """Relative light of each raw image."""
        words = (self.light or "").split(",")
        try:
            found = tuple(float(word) for word in words)
        except ValueError:
            found = ()
        if not found or not all(0 < one < float("inf") for one in found):
            raise FormatError(f"--light is {self.light!r} but must be numbers above 0, such as '1, 1, 4'.")
        return found


SEVERAL = SeveralOptions()


def with_shifts(result: Result, found: "FoundShifts | None") -> Result:
    """A result of the deconvolution with the shifts, if they were found."""
    if found is None:
        return result
    worst = float(found.errors.max())
    moved = "; ".join(f"{1e6 * y:.2f}, {1e6 * x:.2f}" for y, x in found.shifts)
    line = f"shifts (y, x) in µm: {moved}; between them to ± {1e6 * worst:.2g} µm (one standard deviation)"
    told = {name: getattr(found, name).tolist() for name in ("shifts", "errors")}
    return replace(
        result, headline=(line, *result.headline),
        quantities=(*result.quantities, Quantity("error_of_shifts", worst, "m")),
        extra={**result.extra, "found_shifts": told},
    )  # fmt: skip


def _check_count(option: str, found: int | None, count: int) -> None:
    if found not in (None, count):
        raise FormatError(f"{option} is for {found} raw images, but there are {count}. Give one for each.")


def _steps(text: str) -> int | None:
    """Number of steps of a scan written as '3x3'; None for any other text."""
    found = re.fullmatch(r"\s*(\d+)\s*[x×]\s*(\d+)\s*", text)
    if found is None:
        return None
    if found[1] != found[2] or not 1 <= int(found[1]) <= MOST_STEPS:
        raise FormatError(
            f"--shifts is {text!r} but a scan is square, from 1x1 to {MOST_STEPS}x{MOST_STEPS}."
        )
    return int(found[1])


def _pairs(text: str) -> Shifts:
    """Shifts written as 'y, x; y, x'."""
    return tuple(map(_pair, text.split(";")))


def _pair(text: str) -> tuple[float, float]:
    """A shift written as 'y, x'."""
    words = text.split(",")
    if len(words) != 2:
        raise FormatError(
            f"--shifts has {text.strip()!r} but must be pairs such as '0 um, 0 um; 33 um, 0 um'."
        )
    y, x = (length("--shifts", word.strip()) or 0.0 for word in words)
    return y, x
