"""The micro-images found on a white image, or known from a camera's geometry."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.core.lattice import Lattice, Vector
from lumigraph.core.lattice_offsets import LatticeOffsets
from lumigraph.core.short_repr import brief
from lumigraph.core.upper_floors import draw
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError


def _none() -> np.ndarray:
    return np.zeros((0, 2), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Positions of the micro-images on a raw image, and how light reached them.

    Micro-images stand at `position(indices)`: the points of `lattice`, moved by `warp` and `aside` where the
    camera has them. Whoever needs a place on the picture asks `position`, `index`, `offset` or
    `centers_within`; the lattice by itself holds pitches and directions.

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
        Root mean square distance of the measured centres from the lattice [px]; NaN, or 0, where none was
        measured (`measured`).
    pixel_pitch
        Pixel pitch of the sensor [m]; None where unknown.
    separation
        Main lens to lenslets, F or z2 + a [m]; None where unknown.
    lenslet_distance
        Lenslets to sensor, b [m]; None where unknown.
    warp
        Tilt and radial distortion that move the lattice points [px]; None where the lattice is regular.
    light
        Brightness (k,) of the measured micro-images, 1 for a bright one; None where unknown.
    fill
        Width of the lit part of a micro-image over the pitch: 1 where the f-numbers of main lens and
        lenslets match, less where the main lens is stopped down; None where it could not be measured.
    missing
        Indices (m, 2) of lenslets that ought to stand on the picture and send no light: dead ones, dust.
    sharpness
        Contrast of each of the three kinds of lenslets, `lattice.kind`, over their mean; empty for one kind.
    notes
        Cautions about the result, one sentence each.
    by_maker
        True for the file of a camera's maker, which gives pitch and rotation well, but not where a
        picture was cropped: `calibration.aligned` moves it.
    aside
        Ways of single lenslets beside the lattice; None where all stand on it.
    """

    lattice: Lattice
    shape: tuple[int, int]
    indices: np.ndarray
    centers: np.ndarray
    residual_px: float
    pixel_pitch: float | None = None
    separation: float | None = None
    lenslet_distance: float | None = None
    warp: Warp | None = None
    light: np.ndarray | None = None
    fill: float | None = None
    missing: np.ndarray = field(default_factory=_none)
    sharpness: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    by_maker: bool = False
    aside: LatticeOffsets | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.instance("lattice", self.lattice, Lattice, CalibrationError)
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        if self.indices.shape != self.centers.shape or self.centers.shape[1:] != (2,):
            raise CalibrationError(
                f"indices have shape {self.indices.shape} and centers {self.centers.shape}: "
                "both must be (k, 2), one row for each lenslet."
            )
        if self.light is not None and self.light.shape != self.centers.shape[:1]:
            raise CalibrationError(
                f"light has shape {self.light.shape} but there are {len(self.centers)} centers: "
                "give one brightness for each."
            )
        if self.missing.ndim != 2 or self.missing.shape[1] != 2:
            raise CalibrationError(f"missing has shape {self.missing.shape} but must be (m, 2).")
        if self.warp is not None:
            checks.instance("warp", self.warp, Warp, CalibrationError)
        if self.aside is not None:
            checks.instance("aside", self.aside, LatticeOffsets, CalibrationError)
        for name in ("pixel_pitch", "separation", "lenslet_distance", "fill"):
            if (value := getattr(self, name)) is not None:
                checks.positive(name, value, error=CalibrationError)

    @property
    def measured(self) -> bool:
        """True if `centers` were measured on a picture; otherwise they are the lattice points themselves."""
        return self.residual_px > 0  # false for NaN

    @property
    def residuals(self) -> np.ndarray:
        """Measured centre minus the fitted place of each lenslet (k, 2) as (y, x) [px]."""
        return self.centers - self.position(self.indices)

    @property
    def residual_map(self) -> np.ndarray:
        """Distance of each measured centre from the lattice (i, j) [px]; NaN where none was measured."""
        return self._mapped(np.hypot(*self.residuals.T))

    @property
    def light_map(self) -> np.ndarray:
        """Brightness of each measured micro-image (i, j), the vignetting; NaN where none is known."""
        return self._mapped(np.full(len(self.centers), np.nan) if self.light is None else self.light)

    def _mapped(self, values: np.ndarray) -> np.ndarray:
        if not len(values):
            return np.full((1, 1), np.nan)
        first = self.indices.min(0)
        result = np.full(self.indices.max(0) - first + 1, np.nan)
        result[tuple((self.indices - first).T)] = values
        return result

    def position(self, indices: np.ndarray) -> np.ndarray:
        """Micro-image centres (..., 2) as (y, x) [px] of lenslets (..., 2) as (i, j)."""
        points = self.flat(indices)
        return points if self.warp is None else self.warp.applied(points)

    def flat(self, indices: np.ndarray) -> np.ndarray:
        """Micro-image centres without the warp (..., 2) [px]."""
        points = self.lattice.position(indices)
        return points if self.aside is None else points + self.aside.of(indices)

    def straightened(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places of the picture [px] in the plane of the regular lattice; y and x broadcast."""
        if self.warp is None:
            return y, x
        points = self.warp.removed(np.stack(np.broadcast_arrays(y, x), -1))
        return points[..., 0], points[..., 1]

    def index(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Index (i, j) of the lenslet whose micro-image each place [px] belongs to; y and x broadcast."""
        return self.lattice.index(*self.straightened(y, x))

    def offset(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Offset (dy, dx) [px] of each place from the centre of its micro-image; y and x broadcast."""
        center = self.position(np.stack(self.index(y, x), -1))
        return y - center[..., 0], x - center[..., 1]

    def indices_within(self, y_range: Vector, x_range: Vector) -> np.ndarray:
        """Index pairs (k, 2) as (i, j) of all lenslets whose centres lie in the closed ranges [px]."""
        if self.warp is None:
            return self.lattice.indices(y_range, x_range)
        border = np.array([(y, x) for y in np.linspace(*y_range, 33) for x in np.linspace(*x_range, 33)])
        flat, margin = self.warp.removed(border), self.lattice.pitch
        (y0, x0), (y1, x1) = flat.min(0) - margin, flat.max(0) + margin
        indices = self.lattice.indices((y0, y1), (x0, x1))
        y, x = self.position(indices).T
        inside = (y >= y_range[0]) & (y <= y_range[1]) & (x >= x_range[0]) & (x <= x_range[1])
        return indices[inside]

    def misses(self, indices: np.ndarray) -> np.ndarray:
        """True for missing lenslets (...), of indices (..., 2) as (i, j)."""
        keys = [each[..., 0] * (1 << 32) + each[..., 1] for each in (indices, self.missing)]
        return np.isin(keys[0], keys[1])

    def centers_within(self, y_range: Vector, x_range: Vector) -> np.ndarray:
        """Micro-image centres (k, 2) as (y, x) [px] in the closed ranges, row by row."""
        return self.position(self.indices_within(y_range, x_range))

    def transposed(self) -> "Calibration":
        """The same micro-images on the picture with y and x exchanged; indices are exchanged too."""
        lattice, kinds = self.lattice, self.sharpness
        basis, origin = tuple(vector[::-1] for vector in reversed(lattice.basis)), lattice.origin[::-1]
        return replace(
            self,
            lattice=replace(lattice, basis=basis, origin=origin),
            shape=self.shape[::-1],
            indices=self.indices[:, ::-1],
            centers=self.centers[:, ::-1],
            missing=self.missing[:, ::-1],
            warp=None if self.warp is None else self.warp.transposed(),
            aside=None if self.aside is None else self.aside.transposed(),
            sharpness=(kinds[0], kinds[2], kinds[1]) if len(kinds) == 3 else kinds,
        )

    def require_regular(self, what: str) -> None:
        """Refuse lenslets that are displaced from the lattice, for `what` needs a regular one.

        Raises
        ------
        CalibrationError
            Some are displaced.
        """
        if self.aside is not None:
            raise CalibrationError(
                f"{what} needs lenslets on a lattice, but micro-images of {len(self.aside.indices)} stand "
                f"beside it, by up to {np.hypot(*self.aside.ways.T).max():.3g} px. Use views instead."
            )

    def check_fits(self, shape: tuple[int, int]) -> None:
        """Refuse a picture of another size.

        Raises
        ------
        CalibrationError
            The sizes differ; the message gives both.
        """
        if tuple(shape) != self.shape:
            raise CalibrationError(
                f"the picture has {shape[0]} x {shape[1]} pixels but its calibration is for "
                f"{self.shape[0]} x {self.shape[1]}. Calibrate on a white image with the same settings; "
                "if it is a camera file's, correct its [sensor] shape."
            )

    def plot(self, white: Any, **options: Any) -> Any:
        """A matplotlib Figure of the micro-images over a raw or white image: `lumigraph.plots.lattice`."""
        return draw("lattice", white, self, **options)

    def _repr_html_(self) -> str:
        rows = [(line[:12].strip(), line[12:]) for line in self.report().splitlines()]
        known = ("pixel_pitch", "separation", "lenslet_distance")
        rows += [(name.replace("_", " "), picture.length(getattr(self, name))) for name in known]
        drawn = picture.dots(self.position(self.indices), self.shape)
        return picture.card("Calibration", rows, drawn, "Micro-image centres")

    def report(self) -> str:
        """Layout, pitches, rotation, origin and quality of the fit as a few lines of text."""
        (column, row), mrad = self.lattice.pitches, round(self.lattice.rotation * 1e3, 3) + 0.0
        worst = float(np.hypot(*self.residuals.T).max()) if self.measured and len(self.centers) else 0.0
        fit = f"{self.residual_px:.3f} px rms, {worst:.3f} px at worst" if self.measured else "not measured"
        lines = [
            f"layout      {self.lattice.layout}, {len(self.centers)} lenslets on "
            f"{self.shape[0]} x {self.shape[1]} px",
            f"pitch       {self.lattice.pitch:.3f} px ({row:.3f} along rows, {column:.3f} to the next row)",
            f"rotation    {mrad:+.3f} mrad ({math.degrees(mrad / 1e3):+.3f} deg)",
            f"origin      ({self.lattice.origin[0]:.3f}, {self.lattice.origin[1]:.3f}) px (y, x)",
            f"residual    {fit}",
            f"missing     {len(self.missing)} lenslets without light",
        ]
        return "\n".join(lines)
