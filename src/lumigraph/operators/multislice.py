r"""A point's light through thin slices that delay it, to the pupil of an objective: multislice.

Light leaves the point as Weyl's even wave and goes from slice to slice by the angular spectrum,

.. math:: u_j = e^{i k p_j} \, F^{-1} \{ e^{i k \sqrt{n^2 - q^2} (z_{j-1} - z_j)} F u_{j-1} \}

with the paths p_j of the slices. Over what arrives without them, at the same plane, that is a factor of
each of the pupil's amplitudes. Scalar, forwards only: what slices reflect, and what they turn of the
polarisation, is left out. Born's first approximation has one order of the exponential; all are kept.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import fft
from scipy.interpolate import RectBivariateSpline

from lumigraph.core import arrays, memory
from lumigraph.core.grid import Grid
from lumigraph.elements.objective import Objective
from lumigraph.errors import SamplingError
from lumigraph.scene import Medium

LARGEST = 3072
"""Samples along a side: a slice takes some seconds with so many."""

GRAZING = 0.97
"""Of the index: light is followed up to this n sin θ, at the widest."""

TAPER = 0.08
"""Of the index, over which light that is not followed fades out."""

AROUND = 10.0
"""Wavelengths over NA around the cone of light that samples hold."""


@dataclass(frozen=True, eq=False)
class Multislice:
    """Light of points at one depth through the slices before it.

    Parameters
    ----------
    objective
        Its wavelength, aperture and the sample's index.
    medium
        The slices before the points, from theirs on.
    dz
        Depth of the points [m].

    Raises
    ------
    SamplingError
        More samples than can be followed.
    """

    objective: Objective
    medium: Medium
    dz: float

    def __post_init__(self) -> None:
        _ = self.grid

    @cached_property
    def bent(self) -> float:
        """How much slices change n sin θ, by slopes or as gratings."""
        return self.medium.steepest + self.objective.wavelength * self.medium.finest

    @cached_property
    def edge(self) -> tuple[float, float]:
        """N sin θ up to which all light leaves the point, and from which on none does."""
        n, aperture = self.objective.medium, self.objective.aperture
        full = max(min(aperture + self.bent, (GRAZING - TAPER) * n), aperture)
        return full, full + min(TAPER * n, (n - full) / 2)

    @cached_property
    def grid(self) -> Grid:
        """Samples around the point, that hold its light up to the last slice and the finest of its waves."""
        wave, n, widest = self.objective.wavelength, self.objective.medium, self.edge[1]
        finest = max(n, widest + self.bent) * 1.02
        away = self.dz - self.medium.depths[-1]
        half = away * widest / math.sqrt(n * n - widest**2) + AROUND * wave / self.objective.aperture
        count = int(fft.next_fast_len(math.ceil(2.2 * half * 2 * finest / wave)) or 0)
        if count > LARGEST:
            raise SamplingError(
                f"a point {away * 1e6:.4g} µm behind the medium's nearest slice lights "
                f"{2 * half * 1e6:.4g} µm of it, which takes {count} x {count} samples; "
                f"{LARGEST} x {LARGEST} can be followed. Use points or "
                "slices nearer to each other, or a smaller numerical aperture."
            )
        memory.require(100.0 * count**2, "light in the medium", "Use nearer slices.", SamplingError)
        pitch = wave / (2 * finest)
        return Grid((count, count), (pitch, pitch))

    def factor(self, y: float, x: float, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
        """What slices multiply the pupil's amplitudes at (qy, qx) by, of a point at (y, x) [m]."""
        with_slices, plain = self.light(y, x)
        return self._waves(with_slices, qy, qx) / self._waves(plain, qy, qx)

    def light(self, y: float, x: float) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes (y, x) behind the last slice, and there without slices, of a point at (y, x) [m]."""
        grid, above = self.grid, self.dz
        k, along = 2 * np.pi / self.objective.wavelength, self._along()
        spectrum = self._source(along)
        plain, field = spectrum, spectrum
        seen = np.zeros(grid.shape, complex)
        for depth, path in zip(self.medium.depths, self.medium.paths, strict=True):
            step = np.where(along > 0, np.exp(1j * k * along * (above - depth)), 0)
            plain, seen = plain * step, arrays.ifft2(field * step)
            seen = seen * np.exp(1j * k * self._paths(path, y, x))
            field, above = arrays.fft2(seen), depth
        return np.fft.fftshift(seen), np.fft.fftshift(arrays.ifft2(plain))

    def _along(self) -> np.ndarray:
        """N cos θ of the samples' plane waves, 0 where they are evanescent."""
        grid, wave, n = self.grid, self.objective.wavelength, self.objective.medium
        q = wave * fft.fftfreq(grid.shape[0], grid.pitch[0])
        return np.sqrt(np.maximum(n * n - q[:, None] ** 2 - q**2, 0))

    def _source(self, along: np.ndarray) -> np.ndarray:
        """Spectrum of an even wave, which fades out where it is not followed."""
        (full, none), n = self.edge, self.objective.medium
        q = np.sqrt(n * n - along**2)
        fade = np.cos(np.pi / 2 * np.clip((q - full) / (none - full), 0, 1)) ** 2
        return np.where(along > 0, fade * n / np.where(along > 0, along, 1), 0).astype(complex)

    def _paths(self, path: np.ndarray, y: float, x: float) -> np.ndarray:
        """Of a slice (y, x) [m] on the samples around a place, in the order of an FFT."""
        own, here = self.medium.grid, self.grid
        degree = min(3, *(n - 1 for n in own.shape))
        spline = RectBivariateSpline(own.y, own.x, path, kx=degree, ky=degree)
        return np.fft.ifftshift(spline(here.y + y, here.x + x))

    def _waves(self, field: np.ndarray, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
        """Plane waves (rows, nodes) of a field (y, x); those of a row have one qy."""
        k, grid = 2 * np.pi / self.objective.wavelength, self.grid
        rows = np.exp(-1j * k * np.outer(qy[:, 0], grid.y)) @ field
        return np.stack(
            [np.exp(-1j * k * np.outer(q, grid.x)) @ row for q, row in zip(qx, rows, strict=True)]
        )
