"""What a picture says about the camera that its file describes: `implied`."""

import math
from typing import Any, Protocol, runtime_checkable

from lumigraph.core.calibration import Calibration

_PITCH, _TURN = 0.005, math.radians(0.3)
"""Differences of pitch and rotation that a camera file cannot mean."""


@runtime_checkable
class Relayed(Protocol):
    """A camera with lenses between the lenslets' images and the sensor."""

    @property
    def relay_magnification(self) -> float:
        """Of those lenses."""
        ...


def implied(found: Calibration, camera: Any) -> tuple[str, bool]:
    """One line on what a picture's lattice says about the camera, and whether the two agree.

    Parameters
    ----------
    found
        Measured on a picture.
    camera
        Whose file says where its micro-images should stand.

    Returns
    -------
    tuple
        The line, and whether pitches agree to 0.5 %, rotations to 0.3° and kinds of lenslets.
    """
    told, seen = camera.calibration.lattice, found.lattice
    share, turn = seen.pitch / told.pitch, _between(seen.rotation, told.rotation, seen.layout)
    alike = seen.layout == told.layout and (seen.kinds == told.kinds or seen.kinds == 1)
    agree = alike and abs(share - 1) <= _PITCH and abs(turn) <= _TURN
    line = (
        f"the picture has a pitch of {seen.pitch:.3f} px, turned by {math.degrees(turn):+.2f} deg "
        f"({_lenslets(found)}); by the camera file it has {told.pitch:.3f} px "
        f"({_lenslets(camera.calibration)}): "
    )
    return line + ("they agree" if agree else _remedy(camera, share)), agree


def _remedy(camera: Any, share: float) -> str:
    if isinstance(camera, Relayed):
        relay = camera.relay_magnification
        return f"a relay of {relay * share:.4g} instead of {relay:.4g}. The picture's lattice is used"
    return (
        f"pixels of {camera.calibration.pixel_pitch / share * 1e6:.4g} µm instead of "
        f"{camera.calibration.pixel_pitch * 1e6:.4g} µm. The picture's lattice is used"
    )


def _between(seen: float, told: float, layout: str) -> float:
    """Smallest turn [rad] from one lattice to the other, which looks the same after a part of a turn."""
    period = math.pi / (3 if layout == "hex" else 2)
    return (seen - told + period / 2) % period - period / 2


def _lenslets(calibration: Calibration) -> str:
    kinds = f", {calibration.lattice.kinds} kinds" if calibration.lattice.kinds > 1 else ""
    return f"{calibration.lattice.layout}{kinds}"
