"""Thin lens."""

import math
import warnings
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements.apertures import CircularAperture
from lumigraph.elements.transmission import Edge, check_edge, transmit, warn_if_coarse
from lumigraph.errors import GeometryError

_LONGEST, _WIDEST = 10.0, 1.0  # focal lengths in whole metres, and diameters [m], that no bench has


def lens_phase(distance: np.ndarray, focal_length: float, wavelength: float) -> np.ndarray:
    """exp(-iπ d² / (λ f)), complex128: the factor of a thin lens along one axis."""
    return np.exp(-1j * np.pi * np.square(distance) / (wavelength * focal_length))


@dataclass(frozen=True, slots=True)
class ThinLens:
    r"""Thin lens: a paraxial phase, and a stop where a diameter is given.

    .. math:: t(y, x) = \exp(-i \pi r^2 / (\lambda f)), \quad r < D / 2

    It is sampled well where dx ≤ λ f / (2 r) (the thesis' equation 2.90 lacks the 2); beyond, the
    outer light is lost to aliases, and a `SamplingWarning` gives the numbers.

    Parameters
    ----------
    focal_length
        [m], or text such as "158 mm"; negative for a diverging lens. A 0-d array such as a PyTorch scalar is
        differentiated through.
    diameter
        [m]; None for a lens as large as the field.
    center
        (y, x) [m].
    edge
        Edge of the stop: "grey" or "hard", see `CircularAperture`.

    Raises
    ------
    GeometryError
        A focal length of zero, a diameter that is not above zero, or an unknown edge.

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, 3rd ed., section 5.1.

    Examples
    --------
    >>> lens = ThinLens(0.1)
    >>> phase = np.angle(lens.transmission(Grid.square(4, 50e-6), 500e-9))
    >>> round(float(phase[2, 1]), 6)  # -π (50 um)² / (500 nm · 100 mm)
    -0.15708
    """

    focal_length: float | Array
    diameter: float | None = None
    center: tuple[float, float] = (0.0, 0.0)
    edge: Edge = "grey"

    def __post_init__(self) -> None:
        object.__setattr__(self, "focal_length", checks.parameter("focal_length", self.focal_length))
        if arrays.number(self.focal_length) == 0:
            raise GeometryError("focal_length is 0 m. Give a length, negative for a diverging lens.")
        if self.diameter is not None:
            object.__setattr__(self, "diameter", checks.positive("diameter", self.diameter))
        object.__setattr__(self, "center", checks.pair("center", self.center))
        check_edge(self.edge)
        self._warn_of_metres()

    def _warn_of_metres(self) -> None:
        """Warn of a lens that was probably given in millimetres; computed lengths are no whole numbers."""
        f, diameter = arrays.number(self.focal_length), self.diameter or 0.0
        if diameter > _WIDEST or (abs(f) >= _LONGEST and float(f).is_integer()):
            wide = f" and a diameter of {diameter:g} m" if diameter else ""
            warnings.warn(
                f"a lens has a focal length of {f:g} m{wide}. If millimetres are meant, write '{f:g} mm' or "
                f"{f:g} * mm.",
                stacklevel=4,
            )

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Complex factor (ny, nx) of each sample."""
        focal_length = arrays.number(self.focal_length)
        phase = np.outer(
            lens_phase(grid.y - self.center[0], focal_length, wavelength),
            lens_phase(grid.x - self.center[1], focal_length, wavelength),
        )
        if self.diameter is None:
            return phase
        return phase * CircularAperture(self.diameter, self.center, self.edge).transmission(grid, wavelength)

    def __call__(self, field: Field) -> Field:
        """The field just behind the lens."""
        stop = math.inf if self.diameter is None else self.diameter / 2
        checks.instance("field", field, Field)
        offsets = (field.grid.y - self.center[0], field.grid.x - self.center[1])
        radii = tuple(min(stop, float(np.abs(offset).max())) for offset in offsets)
        focal_length = arrays.number(self.focal_length)
        warn_if_coarse("a lens", field.grid, field.wavelength, focal_length, (radii[0], radii[1]))
        if not arrays.is_parameter(self.focal_length):
            return transmit(self, field)
        squares = np.square(offsets[0])[:, None] + np.square(offsets[1])
        factor = arrays.like(self.transmission(field.grid, field.wavelength), field.data)
        bend = 1 / arrays.parameter(self.focal_length) - 1 / focal_length
        return field * arrays.turned(factor, -np.pi / field.wavelength * squares, bend)
