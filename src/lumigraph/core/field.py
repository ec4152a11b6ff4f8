"""A complex scalar wave on a plane."""

from dataclasses import dataclass, replace
from typing import Any

from lumigraph.core import checks, picture
from lumigraph.core.arrays import Array, as_complex, intensity, namespace
from lumigraph.core.grid import Grid
from lumigraph.core.short_repr import brief
from lumigraph.core.upper_floors import draw
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Complex amplitude on a grid, with the time factor exp(-i2πνt): a forward wave is exp(+ikz).

    Parameters
    ----------
    data
        Amplitude (..., y, x); leading axes are a batch. Real input becomes complex of its precision.
    grid
        Where the samples stand.
    wavelength
        Wavelength in vacuum [m].

    Raises
    ------
    GeometryError
        The data's last two axes differ from the grid's shape, or the wavelength is not above zero.

    Examples
    --------
    >>> import numpy as np
    >>> wave = Field(np.ones((4, 6), np.complex64), Grid((4, 6), 2.0), 633e-9)
    >>> float((wave * 0.5).power)
    24.0
    """

    data: Array
    grid: Grid
    wavelength: float

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.positive("wavelength", self.wavelength)
        checks.array("data", self.data)
        checks.instance("grid", self.grid, Grid)
        if tuple(self.data.shape[-2:]) != self.grid.shape:
            raise GeometryError(
                f"data has shape {tuple(self.data.shape)} but the grid has {self.grid.shape}: "
                "the last two axes must be (y, x) of the grid."
            )
        object.__setattr__(self, "data", as_complex(self.data))

    def plot(self, **options: Any) -> Any:
        """A matplotlib Figure of intensity and phase, as `lumigraph.plots.show` draws it."""
        return draw("show", self, **options)

    def _repr_html_(self) -> str:
        size = " × ".join(map(picture.length, self.grid.size))
        rows = [
            ("samples", picture.sized(self.data.shape)), ("size", size),
            ("wavelength", picture.length(self.wavelength)), ("numbers", str(self.data.dtype)),
        ]  # fmt: skip
        flat = self.intensity.reshape((-1, *self.grid.shape))[0]
        return picture.card("Field", rows, picture.thumbnail(flat), "Intensity, black to white")

    @property
    def intensity(self) -> Array:
        """Squared modulus (..., y, x)."""
        return intensity(self.data)

    @property
    def power(self) -> Array:
        """Intensity integrated over the window (...), [amplitude² m²]."""
        dy, dx = self.grid.pitch
        return namespace(self.data).sum(self.intensity, axis=(-2, -1)) * (dy * dx)

    def __mul__(self, transmission: Array) -> "Field":
        """Multiply the field by a transmission: a number or an array that broadcasts against (y, x)."""
        return replace(self, data=self.data * transmission)
