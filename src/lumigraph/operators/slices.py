"""Operators of several depths as one: raw images of slices add up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lumigraph.core import arrays, checks, picture
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError


class Plane(Protocol):
    """An operator of one plane."""

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, ...]]:
        """Of the raw image and the object."""
        ...

    def forward(self, intensity: Array, /) -> Array:
        """Raw image of an object."""
        ...

    def adjoint(self, raw: Array, /) -> Array:
        """Its transpose."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Slices:
    """Raw image (ny, nx) of an object (z, y, x), slices that do not hide one another, and the adjoint.

    Parameters
    ----------
    planes
        Operators of the slices, on one object grid and one sensor.
    object_grid
        Samples of every slice.
    depths
        From the focused plane (z,) [m].
    """

    planes: Sequence[Plane]
    object_grid: Grid
    depths: tuple[float, ...]

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, ...]]:
        """Pixels (ny, nx) of the raw image, samples (z, y, x) of the object."""
        raw, plane = self.planes[0].shape
        return raw, (len(self.planes), *plane)

    def _repr_html_(self) -> str:
        return picture.operator_card("Operator of several depths", self.shape)

    def forward(self, intensity: Array, /) -> Array:
        """Raw image (ny, nx) of an object's intensity (z, y, x).

        Raises
        ------
        GeometryError
            Another shape than the object's.
        """
        checks.array("an object", intensity)
        if tuple(intensity.shape) != self.shape[1]:
            raise GeometryError(
                f"an object has shape {tuple(intensity.shape)} but the operator takes {self.shape[1]}."
            )
        images = [plane.forward(intensity[k, ...]) for k, plane in enumerate(self.planes)]
        return sum(images[1:], images[0])

    def adjoint(self, raw: Array, /) -> Array:
        """Transpose of `forward`: (z, y, x) from a raw image (ny, nx)."""
        return arrays.namespace(raw).stack([plane.adjoint(raw) for plane in self.planes], axis=0)

    def psf(self, index: tuple[int, ...], /) -> Array:
        """Raw image (ny, nx), float32, of one object sample (iz, iy, ix) of intensity 1."""
        point = np.zeros(self.shape[1], np.float32)
        point[index] = 1
        return self.forward(point)
