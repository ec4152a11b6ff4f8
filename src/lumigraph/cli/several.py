"""What `lumigraph deconvolve` is told of several raw images of one object."""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lumigraph.cli.options import length
from lumigraph.errors import FormatError

if TYPE_CHECKING:
    from lumigraph.instruments import Instrument

MOST_STEPS = 30
"""Of a scan, along each axis."""

Shifts = tuple[tuple[float, float], ...]


@Parameter(name="*")
@dataclass(frozen=True)
class Several:
    """How raw images of one object differ.

    Parameters
    ----------
    shifts
        By which the object was moved: '3x3', thirds of a lenslet in the object, row after row from the least
        y and x; or a pair for each raw image, such as '0 um, 0 um; 33 um, 0 um', y first.
    light
        Of each raw image over the first one's, such as '1, 1, 4': exposure times. Left out, as the raw images
        of 'simulate' record it, else the same.
    """

    shifts: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    light: str | None = None

    def check(self, count: int) -> None:
        """Refuse what does not go with so many raw images, before anything is read."""
        if count == 1 and (self.shifts, self.light) != (None, None):
            raise FormatError("--shifts and --light are of several raw images. Name all their files.")
        _check_count("--shifts", self._count(), count)
        _check_count("--light", None if self.light is None else len(self.lights()), count)

    def _count(self) -> int | None:
        if self.shifts is None:
            return None
        steps = _steps(self.shifts)
        return len(_pairs(self.shifts)) if steps is None else steps**2

    def moved(self, camera: "Instrument", count: int) -> Shifts:
        """Shifts (y, x) [m], one for each raw image."""
        from lumigraph.instruments import scan
        from lumigraph.instruments.capabilities import WithLenslets

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

    def lights(self) -> tuple[float, ...]:
        """Of each raw image."""
        words = (self.light or "").split(",")
        try:
            found = tuple(float(word) for word in words)
        except ValueError:
            found = ()
        if not found or not all(0 < one < float("inf") for one in found):
            raise FormatError(f"--light is {self.light!r} but must be numbers above 0, such as '1, 1, 4'.")
        return found


SEVERAL = Several()


def _check_count(option: str, found: int | None, count: int) -> None:
    if found not in (None, count):
        raise FormatError(f"{option} is for {found} raw images, but there are {count}. Give one for each.")


def _steps(text: str) -> int | None:
    """Of a scan written as '3x3'; None of anything else."""
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
