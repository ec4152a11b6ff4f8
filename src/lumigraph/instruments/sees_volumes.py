"""Instruments whose raw images of volumes have derivatives: sums of those of planes."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError

if TYPE_CHECKING:
    from lumigraph.operators.lenslets.part_volume import PartVolume
    from lumigraph.operators.lenslets.whole_planes import PlaneImages


class VolumeGradients:
    """Instrument whose raw images of planes have derivatives."""

    @abstractmethod
    def part_plane(
        self,
        pairs: Sequence[tuple[Any, Any]],
        grid: Grid | None = None,
        dz: float = 0.0,
        *,
        accuracy: float = 1e-2,
    ) -> "PlaneImages":
        """Raw images of a plane, with derivatives by any difference between pairs of nearby instruments."""

    def part_volume(
        self,
        pairs: Sequence[tuple[Self, Self]],
        grid: Grid,
        depths: Sequence[float],
        *,
        accuracy: float = 1e-2,
    ) -> "PartVolume":
        """Raw images of transparent planes that shine together: the sum of those of `part_plane`.

        Parameters
        ----------
        pairs, accuracy
            As of `part_plane`.
        grid
            Samples of the object at each depth.
        depths
            (nz,), from the focused plane [m], positive farther.

        Raises
        ------
        GeometryError
            As of `part_plane`; no depths.

        Examples
        --------
        >>> import numpy as np
        >>> import lumigraph as lg
        >>> camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
        ...     lenslets={"count": (5, 5)}, sensor={"shape": (61, 61)}, main_lens={"diameter": "1 mm"}
        ... )
        >>> pair = (camera.replace(lenslets={"focal_length": f}) for f in ("5.1999 mm", "5.2001 mm"))
        >>> volume = camera.part_volume([tuple(pair)], lg.Grid.square(20, 50e-6), [0.0, 2e-3])
        >>> volume.shape
        ((61, 61), (2, 20, 20))
        """
        from lumigraph.operators.lenslets.part_volume import PartVolume

        if not len(depths):
            raise GeometryError("depths are empty. Give at least one, such as [0.0].")
        planes = (self.part_plane(pairs, grid, float(dz), accuracy=accuracy) for dz in depths)
        return PartVolume(tuple(planes), grid)
