"""A spectral line of finite width: light that interferes over a bounded path difference."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import hermite, legendre

from lumigraph.core import checks
from lumigraph.core.field import Field
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError, SamplingError

MOST = 200
"""Wavelengths of a quadrature: the most that are tried."""

FEW = 10
"""Wavelengths up to which Gauss and Hermite's rule serves a Gaussian line."""

_COUNTS = (*range(1, 21), *range(22, 60, 2), *range(60, MOST + 1, 5))


@dataclass(frozen=True, slots=True)
class SpectralLine:
    r"""Light of a narrow band, even or Gaussian over frequency, whose wavelengths do not interfere.

    Over a path difference ℓ its degree of coherence falls to

    .. math:: |\gamma| = e^{-(\pi \ell \, \delta)^2 / (4 \ln 2)} \quad \text{or} \quad
              |\operatorname{sinc}(\ell \, \delta)|, \quad \delta = \Delta\lambda / \lambda^2

    Parameters
    ----------
    wavelength
        Central wavelength, in vacuum [m].
    width
        Δλ, full width at half maximum [m].
    profile
        "gaussian", such as of a hot gas, or "even", such as behind a filter.

    Raises
    ------
    GeometryError
        A width that is not above zero, or above a fifth of the wavelength, or an unknown profile.

    References
    ----------
    J. W. Goodman, *Statistical Optics*, 2nd edition, section 5.1.3.

    Examples
    --------
    >>> line = SpectralLine(633e-9, 1e-9)
    >>> round(abs(line.coherence(200e-6)), 4), len(line.nodes(200e-6)[0])
    (0.4119, 5)
    """

    wavelength: float
    width: float
    profile: str = "gaussian"

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength", checks.positive("wavelength", self.wavelength))
        object.__setattr__(self, "width", checks.positive("width", self.width))
        checks.choice("profile", self.profile, ("gaussian", "even"), GeometryError)
        if self.width > self.wavelength / 5:
            raise GeometryError(
                f"width is {self.width * 1e9:.4g} nm, more than a fifth of the wavelength of "
                f"{self.wavelength * 1e9:.4g} nm: that is no line. Add several narrower ones."
            )

    @property
    def _band(self) -> float:
        """Width over wavenumbers, δ [1/m]."""
        return self.width / self.wavelength**2

    def coherence(self, path_difference: float) -> float:
        """Degree of coherence γ of two waves of which one came a longer way [m], without its carrier."""
        turns = self._band * checks.finite("path_difference", path_difference)
        if self.profile == "gaussian":
            return math.exp(-((math.pi * turns) ** 2) / (4 * math.log(2)))
        return float(np.sinc(turns))

    def nodes(self, path_difference: float, accuracy: float = 1e-3) -> tuple[np.ndarray, np.ndarray, float]:
        """Wavelengths [m], their weights, of sum 1, and by how much `coherence` is off with them.

        As few as keep it to an accuracy up to a path difference [m].

        Raises
        ------
        SamplingError
            More than 200 wavelengths: with the path difference that could be had.
        """
        most = abs(checks.finite("path_difference", path_difference))
        if not 0 < checks.finite("accuracy", accuracy, "1") < 1:
            raise GeometryError(f"accuracy is {accuracy:g} but must lie between 0 and 1.")
        longest = min(most, MOST / self._band)
        ways = np.linspace(0, longest, 401 + math.ceil(8 * longest * self._band))
        exact = np.array([self.coherence(way) for way in ways])
        off = np.zeros(0)
        for count in _COUNTS:
            places, weights = self._rule(count, accuracy)
            off = np.abs(np.exp(2j * np.pi * np.outer(ways, places)) @ weights - exact)
            if longest == most and off.max() <= accuracy:
                return 1 / (1 / self.wavelength + places), weights, float(off.max())
        held = ways[np.argmax(off > accuracy) - 1]
        raise SamplingError(
            f"path_difference is {most * 1e3:.4g} mm but {MOST} wavelengths keep an accuracy of {accuracy:g} "
            f"up to {held * 1e3:.4g} mm. Ask for less, or take light beyond as incoherent."
        )

    def over(
        self, source: Callable[[float], CoherentModes | Field], path_difference: float, accuracy: float = 1e-3
    ) -> CoherentModes:
        """The light ``source(wavelength)`` of all the line's wavelengths, as modes that do not interfere.

        Parameters
        ----------
        source
            Such as ``lambda wavelength: lamp.modes(grid, wavelength)``, or a wave of amplitude 1.
        path_difference
            The largest on the light's way that matters [m], as from lens to lenslets.
        accuracy
            Error of the degree of coherence over it; the sources' own ones are added to ``error``.

        Raises
        ------
        SamplingError
            More than 200 wavelengths.
        """
        wavelengths, weights, error = self.nodes(path_difference, accuracy)
        fields, errors = [], []
        for wavelength, weight in zip(wavelengths.tolist(), weights.tolist(), strict=True):
            light = source(wavelength)
            light = CoherentModes(light) if isinstance(light, Field) else light
            checks.instance("the source's light", light, CoherentModes)
            fields += [replace(field, data=field.data * math.sqrt(weight)) for field in light.fields]
            errors.append(light.error)
        return CoherentModes(fields, error + max(errors))

    def _rule(self, count: int, accuracy: float) -> tuple[np.ndarray, np.ndarray]:
        """Wavenumbers from the middle [1/m], and weights."""
        if self.profile == "even":
            unit, weights = legendre.leggauss(count)
            return self._band / 2 * unit, weights / 2
        if count <= FEW:
            unit, weights = hermite.hermgauss(count)
        else:  # even steps: for long ways Gauss and Hermite's nodes grow with their square
            unit = np.linspace(-1, 1, count) * math.sqrt(1 - math.log(accuracy))
            weights = np.exp(-(unit**2))
        return self._band / (2 * math.sqrt(math.log(2))) * unit, weights / weights.sum()
