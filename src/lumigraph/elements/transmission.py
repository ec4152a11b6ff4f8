"""Base of thin elements: a factor for each sample, computed once for each grid."""

import warnings
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, like, placement
from lumigraph.core.cache import ByteCache
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, SamplingWarning

Edge = Literal["grey", "hard"]

TRANSMISSIONS = ByteCache()
"""Transmissions by (element, grid, wavelength, placement); bounded, the least recently used go first."""


@runtime_checkable
class Thin(Protocol):
    """A hashable element that multiplies a field by one factor for each sample."""

    def __hash__(self) -> int: ...

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Factor (ny, nx), float64 or complex128."""
        ...


def transmit(element: Thin, field: Field) -> Field:
    """The field behind a thin element; the factor is computed in double precision and cast last."""
    checks.instance("field", field, Field)
    key = element, field.grid, field.wavelength, placement(field.data)

    def build() -> Array:
        memory.require_plane(field.grid.shape, 16, "the transmission of an element")
        return like(element.transmission(field.grid, field.wavelength), field.data)

    return field * TRANSMISSIONS.get(key, build)


def check_edge(edge: str) -> None:
    """Refuse an unknown kind of edge."""
    if not isinstance(edge, str) or edge not in ("grey", "hard"):
        raise GeometryError(f"edge is {edge!r} but must be 'grey' (area fractions) or 'hard' (0 or 1).")


def warn_if_coarse(what: str, grid: Grid, wavelength: float, focal_length: float, radii: tuple[float, float]):
    """Warn where a lens' phase turns by more than π from sample to sample: dx > λ|f| / (2r)."""
    for name, pitch, radius in zip("yx", grid.pitch, radii, strict=True):
        if radius > 0 and pitch > (limit := wavelength * abs(focal_length) / (2 * radius)) * (1 + 1e-9):
            warnings.warn(
                f"{what} of f = {focal_length * 1e3:.4g} mm and radius {radius * 1e3:.4g} mm has samples "
                f"{pitch * 1e6:.4g} µm apart along {name} but needs {limit * 1e6:.4g} µm. "
                "Use a finer grid or a smaller diameter.",
                SamplingWarning,
                stacklevel=4,
            )
            return
