"""Reconstructed volumes: intensities in space."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.core.arrays import A, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.labelled import Labels
from lumigraph.core.noun import Noun
from lumigraph.core.short_repr import brief
from lumigraph.core.upper_floors import draw
from lumigraph.errors import GeometryError

_EVEN = 1e-6
"""Steps that differ by this part of their mean count as equal."""


@dataclass(frozen=True, slots=True, eq=False)
class Volume(Noun[A]):
    """Intensity of a stack of planes across the optical axis, in object space.

    Parameters
    ----------
    data
        Intensities (z, y, x) or (z, y, x, c).
    grid
        Where the samples of every plane stand [m].
    depths
        Depths of the planes from the focused one (z,) [m], positive farther from the camera; ascending or
        descending.

    Raises
    ------
    GeometryError
        The data's shape differs from the grid's and the depths', depths that are not finite or not in order.

    Examples
    --------
    >>> volume = Volume(np.ones((3, 4, 5)), Grid((4, 5), 1e-6), (-2e-6, 0.0, 2e-6))
    >>> volume.depth_step, volume.shape
    (2e-06, (3, 4, 5))
    """

    axes: ClassVar[str] = "zyx"

    data: A
    grid: Grid
    depths: tuple[float, ...]

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.array("data", self.data)
        checks.instance("grid", self.grid, Grid)
        given = np.atleast_1d(self.depths).ravel().tolist()
        depths = np.array([checks.finite("depths", z) if isinstance(z, str) else z for z in given], float)
        object.__setattr__(self, "depths", tuple(float(dz) for dz in depths.ravel()))
        shape = tuple(self.data.shape)
        if len(shape) not in (3, 4) or shape[:3] != depths.shape + self.grid.shape:
            raise GeometryError(
                f"data has shape {shape} but must be (z, y, x[, c]) with z = {len(self.depths)} of the "
                f"depths and (y, x) = {self.grid.shape} of the grid."
            )
        if not np.isfinite(depths).all():
            raise GeometryError(f"depths are {self.depths} but must be finite numbers [m].")
        steps = np.diff(depths)
        if len(steps) and not ((steps > 0).all() or (steps < 0).all()):
            raise GeometryError(
                "depths must ascend or descend, each plane at its own depth. Sort the planes."
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns (nz, ny, nx)."""
        return len(self.depths), *self.grid.shape

    @property
    def depth_step(self) -> float | None:
        """Distance from each plane to the next [m]; None for one plane, or steps that differ."""
        steps = np.diff(self.depths)
        if not len(steps) or np.ptp(steps) > _EVEN * abs(steps.mean()):
            return None
        return float(steps.mean())

    @property
    def spacing(self) -> tuple[float, float, float]:
        """Mean distance between neighbouring samples (dz, dy, dx) [m]; dz is 0 for one plane."""
        steps = np.abs(np.diff(self.depths))
        return float(steps.mean()) if len(steps) else 0.0, *self.grid.pitch

    def _repr_html_(self) -> str:
        low, high = (picture.length(dz) for dz in (self.depths[0], self.depths[-1]))
        rows = [
            ("samples (z, y, x)", picture.sized(self.shape)), ("depths", f"{low} to {high}"),
            ("sample pitch", picture.length(self.grid.pitch[1])), ("numbers", picture.numbers(self.data)),
        ]  # fmt: skip
        brightest = picture.thumbnail(to_numpy(self.data).max(0))
        return picture.card("Volume", rows, brightest, "The brightest sample along z")

    def plane(self, dz: float) -> A:
        """The plane (y, x[, c]) whose depth is nearest to `dz` [m]."""
        nearest = int(np.argmin(np.abs(np.asarray(self.depths) - checks.finite("dz", dz))))
        return self.data[nearest, ...]

    def plot(self, **options: Any) -> Any:
        """A matplotlib Figure of the brightest sample along each axis: `lumigraph.plots.projections`."""
        return draw("projections", self, **options)

    def _labels(self) -> Labels:
        return Labels("zyx", "intensity", along={"z": np.asarray(self.depths)}).stands_on(self.grid)

    @classmethod
    def _of_labels(cls, labels: Labels) -> Self:
        return cls(labels.data, labels.grid(), tuple(labels.coordinate("z").tolist()))
