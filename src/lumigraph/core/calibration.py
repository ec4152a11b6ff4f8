"""The micro-images found on a white image, or known from a camera's geometry."""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Where the micro-images stand on a raw image, and how light reached them.

    Parameters
    ----------
    lattice
        Micro-image centres [px]: pixel (0, 0) is the centre of the first pixel.
    shape
        Rows and columns of the raw images it belongs to.
    indices, centers
        Lenslet indices (k, 2) as (i, j) and the centres (k, 2) as (y, x) [px] measured for them. For a
        calibration computed from a camera file these are the lattice points themselves.
    residual_px
        Root mean square distance of the measured centres from the lattice [px].
    pixel_pitch
        Of the sensor [m]; None where unknown.
    separation
        Main lens to lenslets, F or z2 + a [m]; None where unknown.
    lenslet_distance
        Lenslets to sensor, b [m]; None where unknown.
    """

    lattice: Lattice
    shape: tuple[int, int]
    indices: np.ndarray
    centers: np.ndarray
    residual_px: float
    pixel_pitch: float | None = None
    separation: float | None = None
    lenslet_distance: float | None = None

    def __post_init__(self) -> None:
        checks.instance("lattice", self.lattice, Lattice, CalibrationError)
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        if self.indices.shape != self.centers.shape or self.centers.shape[1:] != (2,):
            raise CalibrationError(
                f"indices have shape {self.indices.shape} and centers {self.centers.shape}: "
                "both must be (k, 2), one row for each lenslet."
            )
        for name in ("pixel_pitch", "separation", "lenslet_distance"):
            if (value := getattr(self, name)) is not None:
                checks.positive(name, value, error=CalibrationError)

    @property
    def residuals(self) -> np.ndarray:
        """Measured centre minus lattice point of each lenslet (k, 2) as (y, x) [px]."""
        return self.centers - self.lattice.position(self.indices)

    def check_fits(self, shape: tuple[int, int]) -> None:
        """Refuse a raw image of another size.

        Raises
        ------
        CalibrationError
            The sizes differ; the message gives both.
        """
        if tuple(shape) != self.shape:
            raise CalibrationError(
                f"the raw image has {shape[0]} x {shape[1]} pixels but the calibration was made on "
                f"{self.shape[0]} x {self.shape[1]}. Use the white image taken with the same camera settings."
            )

    def report(self) -> str:
        """Layout, pitches, rotation, origin and quality of the fit as a few lines of text."""
        (column, row), mrad = self.lattice.pitches, round(self.lattice.rotation * 1e3, 3) + 0.0
        worst = float(np.hypot(*self.residuals.T).max()) if len(self.centers) else 0.0
        lines = [
            f"layout      {self.lattice.layout}, {len(self.centers)} lenslets on "
            f"{self.shape[0]} x {self.shape[1]} px",
            f"pitch       {self.lattice.pitch:.3f} px ({row:.3f} along rows, {column:.3f} to the next row)",
            f"rotation    {mrad:+.3f} mrad ({math.degrees(mrad / 1e3):+.3f} deg)",
            f"origin      ({self.lattice.origin[0]:.3f}, {self.lattice.origin[1]:.3f}) px (y, x)",
            f"residual    {self.residual_px:.3f} px rms, {worst:.3f} px at worst",
        ]
        return "\n".join(lines)
