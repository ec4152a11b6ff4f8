"""The lattice of a rectified picture, whose pitch is known exactly: `exactly`."""

import math
from dataclasses import replace

import numpy as np

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError

_SLIP = 0.25  # of the pitch that the lattice found may slip by at the border of the picture


def exactly(found: Calibration, pitch: float, rotation: float = 0.0) -> Calibration:
    """The calibration with a regular lattice of exactly this pitch: a rectified picture is resampled to one.

    Only where it stands is taken from the picture: the median of what its centres say.

    Parameters
    ----------
    found
        Calibration found by `calibrate`.
    pitch
        Distance of neighbouring micro-images [px].
    rotation
        Direction of the rows of lenslets from +x towards +y [rad].

    Raises
    ------
    CalibrationError
        The lattice found is rectangular, or slips by more than a quarter of a pitch against the exact one.

    Examples
    --------
    >>> from lumigraph.calibration import calibrate
    >>> y, x = np.mgrid[:90, :120]
    >>> white = np.cos(np.pi * (y - 44) / 15.01) ** 2 * np.cos(np.pi * (x - 59) / 15.01) ** 2
    >>> exactly(calibrate(white), 15).lattice.pitch
    15.0
    """
    pitch = checks.positive("pitch", pitch, "px", CalibrationError)
    rotation = checks.finite("rotation", rotation, "rad", CalibrationError)
    if found.lattice.layout == "rectangular":
        down, along = found.lattice.pitches
        raise CalibrationError(
            f"the picture has a rectangular lattice of {down:.2f} x {along:.2f} px, which has no single "
            "exact pitch. Leave out --exact."
        )
    regular = Lattice.hex if found.lattice.layout == "hex" else Lattice.square
    lattice = replace(regular(pitch, _nearest(found.lattice, rotation)), kinds=found.lattice.kinds)
    ways = found.centers - found.indices @ lattice.matrix.T
    y, x = (float(v) for v in np.median(ways, axis=0))
    lattice = replace(lattice, origin=(y, x))
    exact = replace(found, lattice=lattice, warp=None, by_maker=False)
    ny, nx = found.shape
    corners = found.indices_within((0, ny - 1), (0, nx - 1))
    slip = float(np.hypot(*(found.position(corners) - exact.position(corners)).T).max())
    if slip > _SLIP * pitch:
        raise CalibrationError(
            f"the picture has a pitch of {found.lattice.pitch:.3f} px, turned by "
            f"{math.degrees(found.lattice.rotation):+.3f} deg, which slips by {slip / pitch:.2f} of a pitch "
            f"against exactly {pitch:g} px, turned by {math.degrees(rotation):g} deg. Leave out --exact."
        )
    rms = float(np.sqrt(np.square(exact.residuals).sum(-1).mean())) if found.measured else math.nan
    return replace(exact, residual_px=rms)


def _nearest(lattice: Lattice, rotation: float) -> float:
    """The rotation by which a lattice looks the same as by another one, nearest to a lattice's own."""
    step = math.pi / (3 if lattice.layout == "hex" else 2)
    return rotation + step * round((lattice.rotation - rotation) / step)
