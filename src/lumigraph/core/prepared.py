"""A raw image that is ready to use: which pixels and lenslets count, and why the others do not."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Self

import numpy as np

from lumigraph.core.arrays import Array
from lumigraph.core.brief import brief
from lumigraph.core.calibration import Calibration
from lumigraph.core.labelled import Labels
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError


class Reason(IntEnum):
    """Why a pixel or a lenslet does not count; the highest that applies.

    - good: it counts
    - dark: the white image has no light there: gaps between micro-images, vignetted corners, missing lenslets
    - outside: it belongs to a lenslet whose centre is not on the picture
    - masked: left out on request, such as what is not in a region of interest
    - saturated: at the highest value that the bits can hold
    - dead: it shines without light, stays dark in light, or stands in a border that was never read
    """

    GOOD = 0
    DARK = 1
    OUTSIDE = 2
    MASKED = 3
    SATURATED = 4
    DEAD = 5


@dataclass(frozen=True, slots=True, eq=False)
class Verdicts:
    """A `Reason` for each lenslet whose centre is on the picture.

    Parameters
    ----------
    indices
        Lenslets (k, 2) as (i, j).
    reasons
        Reason of each lenslet (k,), uint8.
    """

    indices: np.ndarray
    reasons: np.ndarray

    __repr__ = brief

    @property
    def valid(self) -> np.ndarray:
        """True for lenslets that count (k,)."""
        return self.reasons == Reason.GOOD

    @property
    def lost(self) -> np.ndarray:
        """True for lenslets that decoding leaves out (k,); saturated ones are bright and stay."""
        return np.isin(self.reasons, (Reason.DARK, Reason.MASKED, Reason.DEAD))


@dataclass(frozen=True, slots=True, eq=False)
class PreparedImage(RawImage):
    """A raw image that `lumigraph.prepare` has looked at.

    Parameters
    ----------
    calibration
        Where its micro-images stand; None where nothing says so.
    reasons
        A `Reason` for each pixel (y, x), uint8.
    lenslets
        A `Reason` for each lenslet; None without a calibration.
    background
        Reading of its pixels without light, in its values: a number or (y, x); None where unknown, 0 where
        it has been subtracted.
    response
        Light that reaches each micro-image (y, x), up to 1; None where unknown, or divided out.
    divisor
        Light of the white image that was divided out (y, x), up to 1, float16; None where none was.
    notes
        Notes on what was done and found, one sentence each.
    """

    calibration: Calibration | None = None
    reasons: np.ndarray = field(default_factory=lambda: np.zeros((1, 1), np.uint8))
    lenslets: Verdicts | None = None
    background: float | Array | None = None
    response: Array | None = None
    divisor: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def valid(self) -> np.ndarray:
        """True for pixels that count (y, x)."""
        return self.reasons == Reason.GOOD

    @property
    def dead(self) -> np.ndarray:
        """Pixels (y, x) that pictures leave out, true or false: a saturated one is bright all the same."""
        return (self.reasons == Reason.DEAD) | (self.reasons == Reason.MASKED)

    def counts(self) -> dict[str, tuple[int, int]]:
        """Pixels and lenslets of each reason but good, by its name."""
        lenslets = np.zeros(0, np.uint8) if self.lenslets is None else self.lenslets.reasons
        return {
            reason.name.lower(): (int((self.reasons == reason).sum()), int((lenslets == reason).sum()))
            for reason in Reason
            if reason is not Reason.GOOD
        }

    @classmethod
    def _of_labels(cls, labels: Labels) -> Self:
        raise GeometryError(
            "reasons and calibration do not travel with xarray. Read a RawImage, and prepare it again."
        )
