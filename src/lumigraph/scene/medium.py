"""What light of a sample goes through before it reaches the objective: slices that delay it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.brief import brief
from lumigraph.core.grid import Grid
from lumigraph.core.volume import Volume
from lumigraph.errors import GeometryError

HELD = 0.9999
"""Of the variance of slices' paths, what is taken for their band."""


@dataclass(frozen=True, slots=True, eq=False)
class Medium:
    """A refracting sample before a microscope, as thin slices: `lumigraph.simulate(..., medium=...)`.

    Parameters
    ----------
    paths
        Optical path (z, y, x) [m] that each slice adds to that through the sample's even index. Paths of
        slices that are far apart are taken as given: only steps between them are estimated.
    grid
        Where the samples of every slice stand [m]; beside it, the border's paths go on.
    depths
        Of the slices from the focused plane (z,) [m], positive farther from the objective; in any order.

    Raises
    ------
    GeometryError
        Paths of another shape, or that are not finite; two slices at one depth.

    Examples
    --------
    >>> grid = Grid.square(4, 1e-6)
    >>> bead = Volume(np.full((3, 4, 4), 0.02), grid, (-4e-6, -2e-6, 0.0))
    >>> Medium.of_index(bead).paths.max().round(12).tolist()  # 0.02 over 2 µm
    4e-08
    """

    paths: np.ndarray
    grid: Grid
    depths: tuple[float, ...]

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.instance("grid", self.grid, Grid)
        paths = np.asarray(to_numpy(self.paths) if hasattr(self.paths, "shape") else self.paths, np.float64)
        depths = tuple(checks.finite("a depth", dz) for dz in np.atleast_1d(self.depths).tolist())
        if paths.shape != (len(depths), *self.grid.shape):
            raise GeometryError(
                f"paths have shape {paths.shape} but must be (z, y, x) with z = {len(depths)} of the depths "
                f"and (y, x) = {self.grid.shape} of the grid."
            )
        checks.finite_array("paths", paths, GeometryError)
        if min(self.grid.shape) < 2:
            raise GeometryError(
                f"grid has shape {self.grid.shape} but a medium needs 2 x 2 samples at least."
            )
        if len(set(depths)) < len(depths):
            raise GeometryError("depths must differ from slice to slice. Add up the paths of slices at one.")
        order = np.argsort(depths)[::-1]
        object.__setattr__(self, "paths", paths[order])
        object.__setattr__(self, "depths", tuple(depths[k] for k in order))

    @classmethod
    def of_index(cls, difference: Volume[Any]) -> "Medium":
        """Of a volume of refractive indices less the sample's even one: each plane stands for its slab.

        Raises
        ------
        GeometryError
            One plane, which has no thickness, or colours.
        """
        data, depths = np.asarray(to_numpy(difference.data), np.float64), np.asarray(difference.depths)
        if data.ndim != 3 or len(depths) < 2:
            raise GeometryError(
                f"the volume has shape {data.shape} but indices need (z, y, x) of two planes at least: their "
                "distance is the thickness. For one slice give Medium its paths."
            )
        return cls(data * np.abs(np.gradient(depths))[:, None, None], difference.grid, difference.depths)

    def before(self, dz: float) -> "Medium | None":
        """The slices that light of a point at a depth meets on its way to the objective; None without."""
        met = [k for k, depth in enumerate(self.depths) if depth < dz]
        return Medium(self.paths[met], self.grid, tuple(self.depths[k] for k in met)) if met else None

    def coarser(self) -> "Medium":
        """With neighbouring slices together, each pair halfway between: what tells how fine the steps are."""
        pairs = [slice(k, k + 2) for k in range(0, len(self.depths), 2)]
        paths = np.stack([self.paths[pair].sum(0) for pair in pairs])
        return Medium(paths, self.grid, tuple(float(np.mean(self.depths[pair])) for pair in pairs))

    @property
    def steepest(self) -> float:
        """Bound of what the slopes of all slices together change of n sin θ."""
        slopes = np.gradient(self.paths, *self.grid.pitch, axis=(1, 2))
        return float(np.hypot(*slopes).max((1, 2)).sum())

    @property
    def finest(self) -> float:
        """Spatial frequency up to which slices hold `HELD` of their paths' variance [1/m]: as gratings."""
        ny, nx = self.grid.shape
        window = np.hanning(ny + 2)[1:-1, None] * np.hanning(nx + 2)[1:-1]
        mean = (self.paths * window).sum((1, 2), keepdims=True) / window.sum()
        power = np.square(np.abs(np.fft.fft2((self.paths - mean) * window))).sum(0)
        f = np.hypot(
            np.fft.fftfreq(ny, self.grid.pitch[0])[:, None], np.fft.fftfreq(nx, self.grid.pitch[1])
        ).ravel()
        order = np.argsort(f)
        held = np.cumsum(power.ravel()[order])
        return float(f[order][min(np.searchsorted(held, HELD * held[-1]), f.size - 1)]) if held[-1] else 0.0
