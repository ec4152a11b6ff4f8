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

STEPS = 3
"""Distances between slices whose factors are kept."""

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
        """Change of n sin θ by the slices."""
        n, aperture = self.objective.medium, self.objective.aperture
        return self.medium.bent(self.objective.wavelength, aperture / math.sqrt(n * n - aperture**2))

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
        # What a slice sends beyond propagating waves may come back as others that are cut off
        finest = max(n, widest + self.medium.bent_once(wave) / 2) * 1.02
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
        """Factors of the pupil's amplitudes at (qy, qx) by the slices, of a point at (y, x) [m]."""
        known = self._plain_waves
        if known.get("qx") is not qx:
            known.update(qx=qx, waves=self._waves(np.fft.fftshift(arrays.ifft2(self._plain)), qy, qx))
        return self._waves(self._seen(y, x), qy, qx) / known["waves"]

    def light(self, y: float, x: float) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes (y, x) behind the last slice, and there without slices, of a point at (y, x) [m]."""
        return self._seen(y, x), np.fft.fftshift(arrays.ifft2(self._plain))

    def _seen(self, y: float, x: float) -> np.ndarray:
        """Amplitudes (y, x) behind the last slice."""
        grid, above, k = self.grid, self.dz, 2 * np.pi / self.objective.wavelength
        field, seen = self._source, np.zeros(grid.shape, complex)
        for number, depth in enumerate(self.medium.depths):
            seen = arrays.ifft2(field * self._step(above - depth), overwrite=True)
            path = self.medium.path(number, grid.y + y, grid.x + x)
            seen *= np.exp(1j * k * np.fft.ifftshift(path))
            field, above = arrays.fft2(seen), depth
        return np.fft.fftshift(seen)

    def _step(self, away: float) -> np.ndarray:
        """Factors of plane waves over a distance [m]; slices are often as far apart, so the last are kept."""
        key = round(away * 1e12)
        if key not in self._steps:
            if len(self._steps) >= STEPS:
                self._steps.pop(next(iter(self._steps)))
            turn = 2j * np.pi / self.objective.wavelength * away
            self._steps[key] = np.where(self._along > 0, np.exp(turn * self._along), 0)
        return self._steps[key]

    @cached_property
    def _plain(self) -> np.ndarray:
        """Spectrum behind the last slice, without slices."""
        return self._source * self._step(self.dz - self.medium.depths[-1])

    @cached_property
    def _steps(self) -> dict[int, np.ndarray]:
        return {}

    @cached_property
    def _plain_waves(self) -> dict[str, np.ndarray]:
        return {}

    @cached_property
    def _along(self) -> np.ndarray:
        """N cos θ of the samples' plane waves, 0 where they are evanescent."""
        grid, wave, n = self.grid, self.objective.wavelength, self.objective.medium
        q = wave * fft.fftfreq(grid.shape[0], grid.pitch[0])
        return np.sqrt(np.maximum(n * n - q[:, None] ** 2 - q**2, 0))

    @cached_property
    def _source(self) -> np.ndarray:
        """Spectrum of an even wave, which fades out where it is not followed."""
        (full, none), n, along = self.edge, self.objective.medium, self._along
        q = np.sqrt(n * n - along**2)
        fade = np.cos(np.pi / 2 * np.clip((q - full) / (none - full), 0, 1)) ** 2
        return np.where(along > 0, fade * n / np.where(along > 0, along, 1), 0).astype(complex)

    def _waves(self, field: np.ndarray, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
        """Plane waves (rows, nodes) of a field (y, x); those of a row have one qy."""
        k, grid = 2 * np.pi / self.objective.wavelength, self.grid
        rows = np.exp(-1j * k * np.outer(qy[:, 0], grid.y)) @ field
        return np.stack(
            [np.exp(-1j * k * np.outer(q, grid.x)) @ row for q, row in zip(qx, rows, strict=True)]
        )
