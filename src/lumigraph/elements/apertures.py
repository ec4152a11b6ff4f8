"""Stops: openings in an opaque screen."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, coverage
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements.transmission import Edge, check_edge, transmit


@dataclass(frozen=True, slots=True)
class CircularAperture:
    """Round opening; with ``obstruction=True`` the screen is the disc and light passes around it.

    Parameters
    ----------
    diameter
        [m].
    center
        (y, x) [m].
    edge
        "grey": a sample on the edge passes amplitude in proportion to its open area, so that the image
        forming power is right on coarse grids. "hard": 0 or 1 by the sample's centre, for on-axis
        near-field values, which a grey edge lowers.
    obstruction
        Opaque disc instead of an opening.

    Raises
    ------
    GeometryError
        A diameter that is not above zero, or an unknown edge.

    Examples
    --------
    >>> stop = CircularAperture(2.0)
    >>> area = stop.transmission(Grid.square(64, 0.05), 633e-9).sum() * 0.05**2
    >>> round(float(area), 9)
    3.141592654
    """

    diameter: float
    center: tuple[float, float] = (0.0, 0.0)
    edge: Edge = "grey"
    obstruction: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "diameter", checks.positive("diameter", self.diameter))
        object.__setattr__(self, "center", checks.pair("center", self.center))
        check_edge(self.edge)

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Open fraction (ny, nx) of each sample; the same for every wavelength."""
        y, x = (grid.y - self.center[0])[:, None], grid.x - self.center[1]
        if self.edge == "hard":
            # A rim that passes through sample centres is inside whatever the rounding of y² + x².
            opening = (y**2 + x**2 <= (self.diameter / 2) ** 2 * (1 + 1e-12)).astype(np.float64)
        else:
            opening = coverage.disc(y, x, self.diameter / 2, grid.pitch)
        return 1.0 - opening if self.obstruction else opening

    def __call__(self, field: Field) -> Field:
        """The field just behind the stop."""
        return transmit(self, field)


@dataclass(frozen=True, slots=True)
class RectangularAperture:
    """Rectangular opening along the axes of the grid; see `CircularAperture`.

    Parameters
    ----------
    size
        (height, width) [m]; one number for a square.
    center
        (y, x) [m].
    edge
        "grey" (area fractions) or "hard".
    obstruction
        Opaque rectangle instead of an opening.

    Raises
    ------
    GeometryError
        A size that is not above zero, or an unknown edge.
    """

    size: tuple[float, float]
    center: tuple[float, float] = (0.0, 0.0)
    edge: Edge = "grey"
    obstruction: bool = False

    def __post_init__(self) -> None:
        size = checks.pair("size", self.size)
        for name, value in zip(("height", "width"), size, strict=True):
            checks.positive(name, value)
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "center", checks.pair("center", self.center))
        check_edge(self.edge)

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Open fraction (ny, nx) of each sample; the same for every wavelength."""
        sides = []
        for axis, coordinates in enumerate((grid.y, grid.x)):
            offset, half = coordinates - self.center[axis], self.size[axis] / 2
            if self.edge == "hard":
                sides.append((np.abs(offset) <= half * (1 + 1e-12)).astype(np.float64))
            else:
                sides.append(coverage.interval(offset, grid.pitch[axis], -half, half))
        opening = np.outer(*sides)
        return 1.0 - opening if self.obstruction else opening

    def __call__(self, field: Field) -> Field:
        """The field just behind the stop."""
        return transmit(self, field)
