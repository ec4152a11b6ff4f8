r"""Raw images of a plane before a microscope with lenslets, and how they change with whatever changes of it.

As `whole_planes` has them, K the images of points of one cell: a microscope is telecentric, and those of all
others are the same. With P the wave of a point in the pupil, B_y and B_x the Bloch waves behind the lenslets,
and S what samples take (`pupil_points`),

.. math:: U = B_y t_y (P t_x B_x), \quad K = S |U|^2 S^T

where t turn the phase as a point moves along y and along x. What is in brackets is the same for a column of
points, which go through it, and back to it, at once.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.operators.lenslets.whole_planes import CellPlane, RepeatedImages
from lumigraph.operators.microscope.building import points_grid
from lumigraph.operators.microscope.pupil import BLOCK, PupilImages
from lumigraph.operators.microscope.pupil_cells import (
    CellChange,
    CellOptics,
    ColumnGradient,
    ColumnImages,
    PupilColumn,
)
from lumigraph.operators.microscope.pupil_points import Both, require_alike
from lumigraph.operators.sampling.resampling import represented


@dataclass(frozen=True, eq=False)
class PupilPlane(CellPlane[PupilImages, ColumnImages]):
    """Images of a plane by a microscope, with derivatives by what differs in pairs of microscopes.

    The object's samples stay where they are, along the lenslets' rows and columns, and as bright, before all
    microscopes. Light from beyond the lenslets that are seen comes in; what goes beyond a point's window, a
    share of the accuracy, is left out.

    Parameters
    ----------
    images
        The microscope's, without terms.
    pairs
        (n,), of microscopes a little to either side, sampled alike and in double precision.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].

    Raises
    ------
    GeometryError
        Microscopes of another number of lenslets before the pixels, or of wavelengths.
    """

    images: PupilImages
    pairs: Sequence[Both]
    grid: Grid
    dz: float = 0.0

    def __post_init__(self) -> None:
        for end in (end for pair in self.pairs for end in pair):
            require_alike(end, self.images)

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of a raw image and of an object."""
        return self.images.shape, self.grid.shape

    def _whole(self) -> PupilImages:
        return self.images

    def _pairs(self) -> Sequence[Both]:
        return self.pairs

    def _points(self, end: PupilImages, x: np.ndarray) -> np.ndarray:
        points = points_grid(end.lenslet, end.layout, end.layout.frame + self._reach)
        return _tiled(represented(self.grid, points, upright=True).forward(x), end.layout.sampling.points)

    def _dark(self) -> np.ndarray:
        layout = self.images.layout
        return np.zeros((*layout.cells, layout.sampling.pixels**2))

    def _plane(self, light: np.ndarray) -> np.ndarray:
        N = self.images.layout.sampling.pixels
        return arrays.untiled(light.reshape(*light.shape[:2], N, N))

    def _cells(self, plane: np.ndarray) -> np.ndarray:
        return _tiled(plane, self.images.layout.sampling.pixels)

    def _read(self, end: PupilImages) -> Linear:
        assert end.layout.placement is not None  # pixels may stand anywhere
        return end.layout.placement

    def _blocks(self) -> Iterator[ColumnImages]:
        s = self.images.layout.sampling.points
        at = (np.arange(s) - (s - 1) / 2) / s
        step = max(1, BLOCK // max(one.field_numbers for one in self._behind))
        for k in range(s):
            columns = [PupilColumn.of(one, float(at[k])) for one in self._behind]
            for first in range(0, s, step):
                places = at[first : first + step]
                numbers = slice(first * s + k, (first + len(places)) * s, s)
                yield ColumnImages.of(columns, places, numbers, self._reach)

    def _changed(self, change: list[float]) -> Callable[[ColumnImages], RepeatedImages]:
        by = [CellChange.of(one, change, self.pairs) for one in self._behind]
        brighter = sum(w * (high.unit - low.unit) for w, (low, high) in zip(change, self.pairs, strict=True))
        return lambda block: block.changed(by, brighter)

    def _slopes(self) -> "_PupilGradient":
        return _PupilGradient(
            self.pairs, [ColumnGradient(one, one.parts(self.pairs)) for one in self._behind]
        )

    @cached_property
    def _behind(self) -> list[CellOptics]:
        return [CellOptics.of(self.images, k, self.dz) for k in range(len(self.images.objectives))]

    @property
    def _reach(self) -> int:
        """Cells to each side that light comes to from a point's own."""
        return max(one.told[0] for one in self._behind) // 2


@dataclass(eq=False)
class _PupilGradient:
    """`whole_planes.Told` before a microscope: slopes behind each objective, and by how bright points are."""

    pairs: Sequence[Both]
    by: list[ColumnGradient]
    bright: float = 0.0

    def add(self, block: ColumnImages, asked: np.ndarray) -> None:
        unit = block.columns[0].behind.images.unit
        for k, (one, given) in enumerate(zip(self.by, block.of_each(asked), strict=True)):
            one.add(block, k, unit * given)
        self.bright += float(np.vdot(block.kernel, asked)) / unit

    def along(self) -> np.ndarray:
        found = [
            self.bright * (high.unit - low.unit) + sum(one.along((low, high)) for one in self.by)
            for low, high in self.pairs
        ]
        return np.array(found, np.float64)


def _tiled(plane: np.ndarray, n: int) -> np.ndarray:
    """(rows n, columns n) to (rows, columns, n²)."""
    tiles = arrays.tiled(plane, (n, n))
    return tiles.reshape(*tiles.shape[:2], -1)
