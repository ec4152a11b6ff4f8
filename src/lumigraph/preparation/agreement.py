"""Comparison of a picture with the camera that its file describes: `implied`."""

import math
from functools import cached_property
from typing import Protocol

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError

_PITCH, _TURN = 0.005, math.radians(0.3)
"""Differences of pitch and rotation that a camera file cannot mean."""


class Described(Protocol):
    """A camera, as a raw image of it is judged."""

    @cached_property
    def calibration(self) -> Calibration | None:
        """Expected positions of the micro-images; None without lenslets."""
        ...

    def would_be(self, share: float) -> str:
        """Change of the description that would explain a lattice so many times as large."""
        ...


def implied(seen: Lattice, camera: Described, *, used: bool = True) -> tuple[str, bool]:
    """One line on what a picture's lattice says about the camera, and whether the two agree.

    Parameters
    ----------
    seen
        Measured on a picture [px].
    camera
        Whose file says where its micro-images should stand.
    used
        True if the picture's lattice is used, not the camera's.

    Returns
    -------
    tuple
        The line, and whether pitches agree to 0.5 %, rotations to 0.3° and kinds of lenslets.
    """
    if camera.calibration is None:
        raise CalibrationError("the camera has no lenslets whose micro-images could be compared.")
    told = camera.calibration.lattice
    share, turn = seen.pitch / told.pitch, _between(seen.rotation, told.rotation, seen.layout)
    alike = seen.layout == told.layout and (seen.kinds == told.kinds or seen.kinds == 1)
    agree = alike and abs(share - 1) <= _PITCH and abs(turn) <= _TURN
    line = (
        f"the picture has a pitch of {seen.pitch:.3f} px, turned by {math.degrees(turn):+.2f} deg "
        f"({_lenslets(seen)}); by the camera file it has {told.pitch:.3f} px "
        f"({_lenslets(told)}): "
    )
    verdict = (
        "they agree"
        if agree
        else (f"{camera.would_be(share)}. The {'picture' if used else 'camera'}'s lattice is used")
    )
    return line + verdict, agree


def _between(seen: float, told: float, layout: str) -> float:
    """Smallest turn [rad] from one lattice to the other, which looks the same after a part of a turn."""
    period = math.pi / (3 if layout == "hex" else 2)
    return (seen - told + period / 2) % period - period / 2


def _lenslets(lattice: Lattice) -> str:
    return f"{lattice.layout}, {lattice.kinds} kinds" if lattice.kinds > 1 else lattice.layout
