r"""An unknown object as a random texture, of which only the spectrum is known, and its image by lenslets.

Values y of lenslets at places p are Gaussian, with covariances

.. math:: C_{ij} = \int S(f)\, |\hat h(f)|^2 e^{2\pi i f (p_i - p_j)} df, \quad
    S \propto (1 + |L^T f|^2)^{-\gamma}

for the footprint h of a lenslet in the object. The texture itself is integrated out. Its spectrum (strength,
lengths L along and across any direction, steepness γ) is fitted: a wrong one would say wrongly how much of
what two raw images differ by can be texture that lenslets do not resolve.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as linalg
from scipy.ndimage import map_coordinates, spline_filter

SAMPLES = 12
"""Samples of footprints and covariances along a lenslet."""

PERIOD = 32
"""Period of covariances [lenslets]: longer than a part of the picture and what it depends on."""

USUAL = np.array([0.0, np.log(2.0), 0.0, np.log(2.0), np.log(1.5)])
"""Spectra that are expected: logarithms of the strength over the values' variance, of lengths times 2π
[lenslets], which are a triangle L, and of γ."""

WIDE = np.array([3.0, 3.0, 5.0, 3.0, 0.5])
"""Standard deviation of spectra about it."""

ODD = 1e-3
"""Variance, over the texture's, of what no texture of one spectrum shows, such as edges."""

LAMP = 0.05
"""Standard deviation of a raw image's light over the others', as far as it is not known."""

LINES = 64
"""Frequencies along each axis among which lines of one period are looked for."""

ANY = 100.0
"""Variance of the mean, over the values': any."""


@dataclass(frozen=True, slots=True, eq=False)
class Textures:
    """Covariances by spectrum, of lenslets with one footprint.

    Parameters
    ----------
    power
        The footprint's, at the frequencies `fy`, `fx`, a half plane [1/lenslet].
    """

    power: np.ndarray
    fy: np.ndarray
    fx: np.ndarray

    @classmethod
    def of(cls, footprint: np.ndarray) -> "Textures":
        """Textures of a footprint of `SAMPLES` along a lenslet."""
        n = PERIOD * SAMPLES
        power = np.abs(np.fft.rfft2(footprint / footprint.sum(), (n, n))) ** 2
        power[0, 0] = 0.0  # of the mean nothing is assumed
        fy, fx = np.fft.fftfreq(n, 1 / SAMPLES)[:, None], np.fft.rfftfreq(n, 1 / SAMPLES)[None]
        return cls(power, fy, fx)

    def covariances(self, spectrum: np.ndarray) -> list[np.ndarray]:
        """Splines of C, of its changes by the spectrum's parameters, and by places along y and x."""
        strength, along, across, gamma = np.exp(spectrum[[0, 1, 3, 4]])
        u, v = along * self.fy + spectrum[2] * self.fx, across * self.fx
        q = 1 + u * u + v * v
        seen = self.power * q**-gamma
        whole = _total(seen)
        turns = [2 * u * along * self.fy, 2 * u * self.fx, 2 * v * v]
        changes = [*(-gamma * seen / q * turn for turn in turns), -gamma * seen * np.log(q)]
        relative = [(one - seen * (_total(one) / whole)) for one in changes]
        moved = [2j * np.pi * f * seen for f in (self.fy, self.fx)]
        return [_spline(strength / whole * one) for one in (seen, seen, *relative, *moved)]


def _total(half: np.ndarray) -> float:
    return float(2 * half.sum() - half[:, 0].sum() - half[:, -1].sum())


def _spline(half: np.ndarray) -> np.ndarray:
    n = len(half)
    return spline_filter(np.fft.irfft2(half, s=(n, n)) * n**2, mode="grid-wrap")


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """Log-likelihood of a part of the picture, with its derivatives by shifts and spectrum.

    Parameters
    ----------
    likelihood
        Log-likelihood, the prior of spectra included.
    slope, information
        Derivatives by shifts, then by the spectrum.
    moved
        Number of shifts.
    """

    likelihood: float
    slope: np.ndarray
    information: np.ndarray
    moved: int

    def of_shifts(self) -> tuple[np.ndarray, np.ndarray]:
        """Slope and information of shifts where the spectrum follows them."""
        n = self.moved
        taken = self.information[:n, n:] @ np.linalg.inv(self.information[n:, n:])
        own = self.information[:n, :n] - taken @ self.information[n:, :n]
        return self.slope[:n] - taken @ self.slope[n:], own

    def spectrum_step(self, step: np.ndarray) -> np.ndarray:
        """Change of the spectrum that goes with a step of the shifts."""
        n = self.moved
        wanted = self.slope[n:] - self.information[n:, :n] @ step
        found = np.linalg.solve(self.information[n:, n:], wanted)
        return found / max(1.0, float(np.abs(found).max()))


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Lenslets that lie together, and their values in every raw image.

    Parameters
    ----------
    values, noise
        (k, n): light of the object, relative to its mean, and the noise's variance.
    places
        (n, 2) in an object that was not moved [lenslets].
    """

    values: np.ndarray
    noise: np.ndarray
    places: np.ndarray
    textures: Textures

    def of(self, lenslets: np.ndarray) -> "Part":
        """Some of its lenslets."""
        return replace(
            self,
            values=self.values[:, lenslets],
            noise=self.noise[:, lenslets],
            places=self.places[lenslets],
        )

    def lines(self) -> float:
        """Largest part of the variance that lines of one period explain, in each raw image apart."""
        at = np.linspace(-0.5, 0.5, LINES, endpoint=False)
        off = self.values - self.values.mean(1, keepdims=True)
        found = 0.0
        for f in (np.array([fy, fx]) for fy in at for fx in at[at >= 0]):
            phase = 2 * np.pi * self.places @ f
            waves = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
            basis = linalg.orth(waves.T)
            found = max(found, float(((off @ basis) ** 2).sum()))
        return found / float((off**2).sum())

    @property
    def variance(self) -> float:
        """Variance of the texture on the lenslets; not below a tenth of the noise's."""
        noise = float(self.noise.mean())
        return max(float(self.values.var()) - noise, 0.1 * noise)

    def usual(self) -> np.ndarray:
        """The spectrum that is expected."""
        return USUAL + np.array([np.log(self.variance), 0, 0, 0, 0])

    def likelihood(self, shifts: np.ndarray, spectrum: np.ndarray, blunt: float) -> float:
        """Log-likelihood, `blunt` times the variance added to the noise's."""
        pairs = self._pairs(shifts)
        return self._likelihood(_Solved.of(self, pairs, self._splines(spectrum)[0], blunt), spectrum)

    def told(self, shifts: np.ndarray, spectrum: np.ndarray, blunt: float) -> Told:
        """Log-likelihood and derivatives at shifts (k, 2) [lenslets], the first of which is fixed."""
        pairs, splines = self._pairs(shifts), self._splines(spectrum)
        solved = _Solved.of(self, pairs, splines[0], blunt)
        changes = [one for spline in splines[6:] for one in self._by_shifts(pairs.odd(spline))]
        moved = len(changes)
        changes += [pairs.even(spline) for spline in splines[1:6]]
        slope, information = solved.told_of(changes)
        slope[moved:] -= (spectrum - self.usual()) / WIDE**2
        information[moved:, moved:] += np.diag(1 / WIDE**2)
        return Told(self._likelihood(solved, spectrum), slope, information, moved)

    def _splines(self, spectrum: np.ndarray) -> list[np.ndarray]:
        return self.textures.covariances(spectrum)

    def _pairs(self, shifts: np.ndarray) -> "_Pairs":
        return _Pairs.of((self.places[None] - shifts[:, None]).reshape(-1, 2))

    def _likelihood(self, solved: "_Solved", spectrum: np.ndarray) -> float:
        return solved.likelihood - float(((spectrum - self.usual()) ** 2 / WIDE**2).sum()) / 2

    def _by_shifts(self, slope: np.ndarray) -> list[np.ndarray]:
        """Changes of covariances by the shift of each raw image but the first, along one axis."""
        found, n = [], self.values.shape[1]
        for k in range(1, len(self.values)):
            change, own = np.zeros_like(slope), slice(k * n, (k + 1) * n)
            change[own] -= slope[own]
            change[:, own] -= slope[own].T
            found.append(change)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Distances (2, pairs) [samples] between places, of the upper triangle of all pairs."""

    count: int
    triangle: tuple[np.ndarray, np.ndarray]
    apart: np.ndarray

    @classmethod
    def of(cls, places: np.ndarray) -> "_Pairs":
        upper = np.triu_indices(len(places))
        return cls(len(places), upper, (places[upper[0]] - places[upper[1]]).T * SAMPLES)

    def even(self, spline: np.ndarray) -> np.ndarray:
        """Covariances of all pairs."""
        found = self._upper(spline)
        return found + np.triu(found, 1).T

    def odd(self, spline: np.ndarray) -> np.ndarray:
        """Part of a spline that changes its sign when a pair's places are exchanged."""
        found = self._upper(spline)
        return found - found.T

    def _upper(self, spline: np.ndarray) -> np.ndarray:
        found = np.zeros((self.count, self.count))
        found[self.triangle] = map_coordinates(spline, self.apart, order=3, mode="grid-wrap", prefilter=False)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """Values with their covariance's inverse."""

    inverse: np.ndarray
    whitened: np.ndarray
    likelihood: float

    @classmethod
    def of(cls, part: Part, pairs: _Pairs, spline: np.ndarray, blunt: float) -> "_Solved":
        frames, n = part.values.shape
        covariance = pairs.even(spline) + np.kron(np.eye(frames), np.full((n, n), LAMP**2))
        covariance += ANY * part.variance
        covariance += np.diag(part.noise.ravel() + max(blunt, ODD) * part.variance)
        factor = linalg.cho_factor(covariance, lower=True)
        off = part.values.ravel() - part.values.mean()
        inverse = linalg.cho_solve(factor, np.eye(len(off)))
        whitened = inverse @ off
        likelihood = -float(off @ whitened) / 2 - float(np.log(np.diag(factor[0])).sum())
        return cls(inverse, whitened, likelihood)

    def told_of(self, changes: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Slope and Fisher's information of parameters by which covariances change so."""
        turned = [self.inverse @ change for change in changes]
        slope = [
            float(self.whitened @ change @ self.whitened - np.trace(one)) / 2
            for change, one in zip(changes, turned, strict=True)
        ]
        flat = np.array([one.ravel() for one in turned])
        across = np.array([one.T.ravel() for one in turned])
        return np.array(slope), flat @ across.T / 2
