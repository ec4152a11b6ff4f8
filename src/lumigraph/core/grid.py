"""Sampling of a plane: `Grid`."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True)
class Grid:
    """A rectangular grid of samples on a plane across the optical axis.

    Sample ``n // 2`` of each axis stands at `center`; pairs are (y, x).

    Parameters
    ----------
    shape
        Samples (ny, nx).
    pitch
        Distance between samples (dy, dx) [m]; one number for both.
    center
        Position (y, x) of sample (ny // 2, nx // 2) [m].

    Raises
    ------
    GeometryError
        A shape below one sample, or a pitch that is not above zero.

    Examples
    --------
    >>> Grid((4, 5), 0.5).x.tolist()
    [-1.0, -0.5, 0.0, 0.5, 1.0]
    >>> Grid((4, 5), 0.5).y.tolist()
    [-1.0, -0.5, 0.0, 0.5]
    """

    shape: tuple[int, int]
    pitch: tuple[float, float]
    center: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        pitch = checks.pair("pitch", self.pitch)
        for axis, value in zip("yx", pitch, strict=True):
            checks.positive(f"pitch ({axis})", value)
        object.__setattr__(self, "shape", checks.shape("shape", self.shape))
        object.__setattr__(self, "pitch", pitch)
        object.__setattr__(self, "center", checks.pair("center", self.center))

    def _repr_html_(self) -> str:
        pairs = {"pitch (y, x)": self.pitch, "size (y, x)": self.size, "centre (y, x)": self.center}
        lengths = [(name, ", ".join(map(picture.length, pair))) for name, pair in pairs.items()]
        return picture.card("Grid", [("samples (y, x)", picture.sized(self.shape)), *lengths])

    @classmethod
    def square(cls, n: int, pitch: float) -> "Grid":
        """Grid of n × n samples of one pitch [m], centred on the axis."""
        return cls((n, n), (pitch, pitch))

    @property
    def y(self) -> np.ndarray:
        """Positions of the rows (ny,) [m], float64."""
        return self.center[0] + (np.arange(self.shape[0]) - self.shape[0] // 2) * self.pitch[0]

    @property
    def x(self) -> np.ndarray:
        """Positions of the columns (nx,) [m], float64."""
        return self.center[1] + (np.arange(self.shape[1]) - self.shape[1] // 2) * self.pitch[1]

    @property
    def fy(self) -> np.ndarray:
        """Frequencies of the DFT along y (ny,) [1/m], in FFT order, float64."""
        return np.fft.fftfreq(self.shape[0], self.pitch[0])

    @property
    def fx(self) -> np.ndarray:
        """Frequencies of the DFT along x (nx,) [1/m], in FFT order, float64."""
        return np.fft.fftfreq(self.shape[1], self.pitch[1])

    @property
    def size(self) -> tuple[float, float]:
        """Width of the window (y, x) [m]: samples times pitch."""
        return self.shape[0] * self.pitch[0], self.shape[1] * self.pitch[1]

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Outer edges (left, right, top, bottom) [m] for a picture whose first row is on top."""
        (dy, dx), y, x = self.pitch, self.y, self.x
        return x[0] - dx / 2, x[-1] + dx / 2, y[-1] + dy / 2, y[0] - dy / 2

    def resized(self, shape: int | tuple[int, int]) -> "Grid":
        """Same pitch and centre, other number of samples; its samples coincide with this grid's."""
        return Grid(checks.shape("shape", shape), self.pitch, self.center)

    def samples_to(self, other: "Grid") -> tuple[int, int]:
        """Index in `other` of this grid's first sample (iy, ix); may be negative.

        Raises
        ------
        GeometryError
            The grids have different pitches, or their samples do not coincide (to 1e-6 of a pitch).
        """
        first = []
        for axis, name in enumerate("yx"):
            ours, theirs = self.pitch[axis], other.pitch[axis]
            if abs(ours - theirs) > 1e-9 * theirs:
                raise GeometryError(
                    f"the grids have different pitches along {name}: {ours:.6g} m and {theirs:.6g} m. "
                    "Use one pitch, or a method with its own output grid such as 'zoom'."
                )
            steps = (self.center[axis] - other.center[axis]) / theirs
            if abs(steps - round(steps)) > 1e-6:
                raise GeometryError(
                    f"the grids are shifted by {steps:.6g} samples along {name}, not by a whole number. "
                    "Move a centre, or use a method with its own output grid such as 'zoom'."
                )
            first.append(round(steps) + other.shape[axis] // 2 - self.shape[axis] // 2)
        return first[0], first[1]
