"""What a deconvolution asks of a camera: images of objects, and back."""

from typing import Protocol, runtime_checkable

from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid


@runtime_checkable
class ForwardModel(Protocol):
    """A linear map A from an object's intensities to a raw image, and its transpose.

    `forward` and `adjoint` return the array library, precision and device of what they are given, write
    nothing into it, and satisfy ⟨A o, r⟩ = ⟨o, Aᵀ r⟩. All entries of A are at least 0, but for the rounding
    and ringing that an operator states.

    An operator that also knows where its object stands has ``object_grid`` (`Grid`) and, for an object of
    several planes, ``depths`` (z,) [m].
    """

    @property
    def shape(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Pixels (ny, nx) of the raw image; samples (y, x) or (z, y, x) of the object."""
        ...

    def forward(self, intensity: Array, /) -> Array:
        """Raw image (ny, nx) of an object (y, x) or (z, y, x)."""
        ...

    def adjoint(self, raw: Array, /) -> Array:
        """Transpose of `forward`: an object's shape from a raw image (ny, nx)."""
        ...

    def psf(self, index: tuple[int, ...], /) -> Array:
        """Raw image (ny, nx) of one object sample (y, x) or (z, y, x) of intensity 1."""
        ...


def grid_of(operator: ForwardModel) -> Grid | None:
    """Samples of every plane of the object [m]; None for an operator that has no ``object_grid``."""
    grid = getattr(operator, "object_grid", None)
    return grid if isinstance(grid, Grid) else None


def depths_of(operator: ForwardModel) -> tuple[float, ...] | None:
    """Depths of the object's planes from the focused one (z,) [m]; None for an operator that has none."""
    depths = getattr(operator, "depths", None)
    return None if depths is None else tuple(float(dz) for dz in depths)
