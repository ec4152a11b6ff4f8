r"""The curved side of plano-convex lenslets, by rays along the axis through glass.

With the sagitta s of a conic, v² / (r + √(r² - (1 + K) v²)) and r = (n - 1) f, a ray at the height v leaves
the surface turned by θ. Seen from the plane through the vertex it comes from the height v' = v ∓ s tan θ,
with another path than there: this path by v', and the density of rays, are what the lenslet does to light.
(The sagitta alone, taken at v, has half of the spherical aberration.)
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import Chebyshev

from lumigraph.errors import GeometryError

DEGREE = 24
"""Degree of polynomials of the squared height: off by 2e-12 of the path at f/2.8, 8e-7 at grazing."""

MARGIN = 1.03
"""Factor by which the surface has to extend beyond the corners."""

D_LINE, F_LINE, C_LINE = 587.56e-9, 486.13e-9, 656.27e-9
"""Wavelengths of Abbe's number [m]."""


def index_at(wavelength: float, index: float, abbe: float) -> float:
    """Refractive index by Cauchy's A + B/λ², of a glass of an index n_d and Abbe's number V_d.

    Examples
    --------
    >>> round(index_at(486.13e-9, 1.5168, 64.17), 4)
    1.5224
    """
    spread = (index - 1) / (abbe * (F_LINE**-2 - C_LINE**-2))
    return index + spread * (wavelength**-2 - D_LINE**-2)


@dataclass(frozen=True, slots=True)
class GlassSurface:
    """A conic of glass, flat on the other side.

    Parameters
    ----------
    index
        Refractive index n.
    conic
        Constant K: 0 of a sphere, -n² of what faces the sensor without spherical aberration.
    thickness
        Thickness of the glass, vertex to flat side [m], if it faces the main lens; None if it faces
        the sensor.
    """

    index: float
    conic: float = 0.0
    thickness: float | None = None

    def path(self, squared: np.ndarray, half: float, focal_length: float) -> np.ndarray:
        """Path [m] that lenslets half so wide [m] take away, by the squared distance from the vertex."""
        return _light(self, half, focal_length)[0](squared)

    def amplitude(self, squared: np.ndarray, half: float, focal_length: float) -> np.ndarray:
        """Amplitude of the light there, 1 at the vertex: no power is lost."""
        return _light(self, half, focal_length)[1](squared)

    def seen(self, half: float, focal_length: float) -> float:
        """Half the width of a square lenslet in the vertex' plane, on average over a side [m]."""
        at = half * (np.arange(8) + 0.5) / 8
        heights = np.hypot(half, at)
        return float(half * np.mean(self._rays(heights, focal_length)[0] / heights))

    def curved(self, squared: np.ndarray, focal_length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sagitta [m], and the normal's cosines along the axis and, over the height, across it [1/m].

        Of a curved side that faces the sensor, by the squared distance from the axis.
        """
        radius = (self.index - 1) * focal_length
        root = np.sqrt(radius**2 - (1 + self.conic) * squared)
        cosine = root / np.sqrt(root**2 + squared)
        return squared / (radius + root), cosine, cosine / root

    def check(self, half: float, focal_length: float) -> None:
        """Refuse square lenslets half so wide [m] as glass has no surface for, or as light does not leave.

        Raises
        ------
        GeometryError
            With the values and what to do.
        """
        radius, corner = (self.index - 1) * focal_length, math.sqrt(2) * half
        inside = radius**2 - (1 + self.conic) * (MARGIN * corner) ** 2
        slope = MARGIN * corner / math.sqrt(inside) if inside > 0 else math.inf
        if not (self.index if self.thickness is None else 1) * math.sin(math.atan(slope)) < 1:
            raise GeometryError(
                f"the surface's radius (n - 1) f is {radius * 1e6:.5g} µm, on which the corner, "
                f"{corner * 1e6:.5g} µm from the vertex, is too steep for light to pass. Use a longer focal "
                "length, a higher index, a lower conic or a smaller fill_factor."
            )
        if self.thickness is not None:
            sag = corner**2 / (radius + math.sqrt(inside))
            longest = self.index * focal_length
            if not sag <= self.thickness < longest:
                raise GeometryError(
                    f"thickness is {self.thickness * 1e6:.5g} µm but must be from {sag * 1e6:.5g} µm, which "
                    f"the corners take, to n f = {longest * 1e6:.5g} µm, where light comes to its focus."
                )

    def _rays(self, height: np.ndarray, focal_length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights and paths in the vertex' plane, and cosines, of rays that meet the surface at heights."""
        n, radius = self.index, (self.index - 1) * focal_length
        root = np.sqrt(radius**2 - (1 + self.conic) * height**2)
        sag, normal = height**2 / (radius + root), np.arctan(height / root)
        if self.thickness is None:
            turn = np.arcsin(n * np.sin(normal)) - normal
            return height - sag * np.tan(turn), -n * sag + sag / np.cos(turn), np.cos(turn)
        turn = normal - np.arcsin(np.sin(normal) / n)
        behind, left, air = self.thickness - sag, np.arcsin(n * np.sin(turn)), self.thickness / n
        path = sag + n * behind / np.cos(turn) - air / np.cos(left) - n * self.thickness + air
        return height - behind * np.tan(turn) + air * np.tan(left), path, np.cos(left)


@lru_cache(maxsize=64)
def _light(surface: GlassSurface, half: float, focal_length: float) -> tuple[Chebyshev, Chebyshev]:
    """Path taken away and amplitude, by the squared distance from the vertex."""
    widest = MARGIN * math.sqrt(2) * half
    squared = widest**2 * (1 - np.cos(np.pi * (np.arange(4 * DEGREE) + 0.5) / (4 * DEGREE))) / 2
    seen, path, cosine = surface._rays(np.sqrt(squared), focal_length)
    spread = Chebyshev.fit(squared, seen**2, DEGREE, domain=[0.0, widest**2]).deriv()(squared)
    domain = [0.0, float(seen.max() ** 2)]
    taken, amplitude = (
        Chebyshev.fit(seen**2, values, DEGREE, domain=domain) for values in (-path, (spread * cosine) ** -0.5)
    )
    return taken, amplitude
