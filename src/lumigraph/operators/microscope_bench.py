"""A point's light behind the lenslets of a microscope, on a fine grid, and its samples over pixels.

Neither fields nor lenslets are aliased on the grid. Pixels are averaged exactly, by their transfer function.
What is kept of an image are the coefficients of the B-splines that come nearest to it, so that what they
leave out is known for each image from its own spectrum.
"""

import math
from functools import lru_cache

import numpy as np
import scipy.fft
from scipy.sparse import csr_array

from lumigraph.core import arrays
from lumigraph.core.cache import remembered
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_cell import CellSampling, Lenslet

DEGREE = 3
"""Of the B-splines from which pixels are interpolated: higher degrees ring, and what is below 0 is cut."""

WIDEST = 8
"""Cells to each side of the window by which the number of samples is chosen."""

ALIASES = np.arange(-6, 7)
"""Repetitions of a sampled spectrum that are followed."""


def fineness(objective: Objective, lenslet: Lenslet, margin: float) -> int:
    """Samples of the light along a lenslet."""
    steepest = objective.numerical_aperture / lenslet.magnification
    steepest += lenslet.pitch / (2 * abs(lenslet.focal_length))
    least = math.ceil(lenslet.pitch * 2 * margin * steepest / objective.wavelength)
    return int(scipy.fft.next_fast_len(least) or least)


def guard(objective: Objective, lenslet: Lenslet) -> int:
    """Lenslets to each side from which light goes into a window of lenslets."""
    slope = objective.numerical_aperture / lenslet.magnification
    slope += lenslet.pitch / 2 * abs(1 / lenslet.focal_length - 1 / lenslet.distance)
    return math.ceil(slope * lenslet.distance / lenslet.pitch + 0.25)


def spline_response(f: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Factor of a spectrum that gives B-spline coefficients, and the part of its power that they hold.

    `f` is in cycles per sample.
    """
    power = np.sinc(f[:, None] + ALIASES) ** (2 * degree + 2)
    own = np.sinc(f) ** (degree + 1)
    return own / power.sum(1), own**2 / power.sum(1)


@remembered
def transmission(lenslet: Lenslet, wavelength: float, finest: int, samples: int) -> np.ndarray:
    """Of a lenslet (samples, samples), of its Fourier series up to `finest` periods in a pitch."""
    if not lenslet.is_round:
        line = _series(lenslet, wavelength, finest)
        line = _waves(finest, samples) @ line
        return np.outer(line, line)
    n = 4 * 2 ** math.ceil(math.log2(4 * finest + 64))
    at = ((np.arange(n) + 0.5) / n - 0.5) * lenslet.pitch
    r2 = at[:, None] ** 2 + at**2
    inside = np.clip((lenslet.width / 2 - np.sqrt(r2)) / lenslet.pitch * n + 0.5, 0, 1)
    whole = inside * np.exp(-1j * np.pi * r2 / (wavelength * lenslet.focal_length))
    back = _waves(finest, n).conj().T / n
    return _waves(finest, samples) @ (back @ whole @ back.T) @ _waves(finest, samples).T


def _series(lenslet: Lenslet, wavelength: float, finest: int) -> np.ndarray:
    """Fourier series (2 finest + 1,) of a square lenslet along an axis, by quadrature with its edges."""
    turns = finest + lenslet.pitch**2 / (wavelength * abs(lenslet.focal_length))
    unit, weight = np.polynomial.legendre.leggauss(math.ceil(4 * turns) + 32)
    at, weight = unit * lenslet.width / 2, weight * lenslet.width / (2 * lenslet.pitch)
    wave = weight * np.exp(-1j * np.pi * at**2 / (wavelength * lenslet.focal_length))
    return np.exp(-2j * np.pi * np.outer(np.arange(-finest, finest + 1), at / lenslet.pitch)) @ wave


def _waves(finest: int, samples: int) -> np.ndarray:
    """Waves (samples, 2 finest + 1) over a pitch."""
    at = (np.arange(samples) - (samples - 1) / 2) / samples
    return np.exp(2j * np.pi * np.outer(at, np.arange(-finest, finest + 1)))


class Bench:
    """The lenslets around a point's own, and the way from there to the pixels."""

    def __init__(
        self, objective: Objective, lenslet: Lenslet, sampling: CellSampling, reach: int, margin: float
    ) -> None:
        self.objective, self.lenslet, self.sampling = objective, lenslet, sampling
        wave, p = objective.wavelength, lenslet.pitch
        self.fine = fineness(objective, lenslet, margin)
        self.guard = guard(objective, lenslet)
        self.cells = 2 * (reach + self.guard) + 1
        self.step = p / self.fine
        n = self.cells * self.fine
        self.at = (np.arange(n) - (n - 1) / 2) * self.step
        self.lenslets = self._lenslets()
        f2 = np.fft.fftfreq(n, self.step) ** 2
        self.transfer = np.exp(-1j * np.pi * wave * lenslet.distance * f2).astype(np.complex64)

    def _lenslets(self) -> np.ndarray:
        """What the lenslets do to the field on the grid, as finely as neither is aliased.

        Light that a lenslet's border sends steeper than that goes far, and makes fringes that are finer than
        pixels with what is brighter: it is better left out than where it does not belong.
        """
        steepest = self.objective.numerical_aperture / self.lenslet.magnification / self.objective.wavelength
        finest = math.floor(self.fine / 2 - steepest * self.lenslet.pitch)
        own = transmission(self.lenslet, self.objective.wavelength, finest, self.fine)
        taper = (
            np.sin(np.pi / 2 * np.clip((np.arange(self.cells * self.fine) + 0.5) / self.fine * 2, 0, 1)) ** 2
        )
        taper *= taper[::-1]  # light that goes out on one side comes in on the other, without an edge
        return (np.tile(own, (self.cells, self.cells)) * np.outer(taper, taper)).astype(np.complex64)

    def image(self, point: tuple[float, float], dz: float) -> tuple[np.ndarray, float]:
        """Samples ((2 reach + 1) N, the same) of a point (ky, kx) of the middle cell [samples].

        For a point that sends s⁻² of the light of a lenslet's area: the mean over all points is 1. And the
        relative rms of what the samples do not hold.
        """
        edge = self.guard * self.sampling.pixels
        image, lost = self.sampled(arrays.fft2(self.intensity(point, dz)), self.sampling)
        light = (self.lenslet.pitch / self.lenslet.magnification / self.sampling.points) ** 2
        return image[edge:-edge, edge:-edge] * np.float32(light), lost

    def sampled(self, spectrum: np.ndarray, sampling: CellSampling) -> tuple[np.ndarray, float]:
        """Samples, none below 0, of an intensity's spectrum, and the relative rms that they do not hold."""
        coefficients, averaged, held = self.responses(sampling)
        n, count, lost = len(self.at), self.cells * sampling.pixels, 0.0
        # What is taken less finely than it was computed has its spectrum folded.
        rows = np.rint(np.fft.fftfreq(n) * n).astype(int) % count
        fold = csr_array((coefficients * np.float32(count / n), (rows, np.arange(n))), shape=(count, n))
        image = arrays.ifft2((fold @ (fold @ spectrum).T).T, overwrite=True).real
        if sampling.degree:
            power = np.square(np.abs(spectrum))
            whole = float(averaged**2 @ power @ averaged**2)
            clipped = np.square(np.minimum(image, 0)).sum(dtype=np.float64) * (n * n / count) ** 2
            lost = math.sqrt(max(whole - float(held @ power @ held) + clipped, 0.0) / whole)
        return np.maximum(image, 0), lost

    def intensity(self, point: tuple[float, float], dz: float) -> np.ndarray:
        """On the whole fine grid behind the lenslets, of a point that sends 1 to an object area of 1."""
        s, p, M = self.sampling.points, self.lenslet.pitch, self.lenslet.magnification
        y, x = ((self.at - ((k - (s - 1) / 2) / s) * p) / M for k in point)
        image = np.zeros((len(self.at),) * 2, np.float32)
        for field in self.objective.fields(y[:, None], x[None, :], dz):
            behind = field.astype(np.complex64) * self.lenslets
            spectrum = arrays.fft2(behind, overwrite=True)
            spectrum *= self.transfer[:, None]
            spectrum *= self.transfer
            behind = arrays.ifft2(spectrum, overwrite=True)
            image += np.square(behind.real) + np.square(behind.imag)
        return image

    def responses(self, sampling: CellSampling) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Along an axis of the fine grid: factors of samples, and the parts of amplitudes that pixels average
        and that samples hold, the latter squared.
        """
        f = np.fft.fftfreq(len(self.at)) * self.fine  # in periods of a pitch
        shift = np.exp(1j * np.pi * f * (1 / sampling.pixels - 1 / self.fine))
        averaged = np.sinc(f * sampling.width)
        if sampling.degree == 0:
            return (averaged * shift).astype(np.complex64), averaged, averaged**2
        own, held = spline_response(f / sampling.pixels, sampling.degree)
        return (averaged * own * shift).astype(np.complex64), averaged, averaged**2 * held


@lru_cache(maxsize=64)
def samples_needed(objective: Objective, lenslet: Lenslet, width: float, dz: float, accuracy: float) -> int:
    """Samples N along a lenslet from which pixels of a width [lenslets] are interpolated to an accuracy.

    By the spectra of two points, in the focused plane and at a depth.
    """
    cutoff = 2 * lenslet.pitch**2 / (objective.wavelength * abs(lenslet.distance))
    lit = abs(dz) * objective.aperture / math.sqrt(objective.medium**2 - objective.aperture**2)
    reach = min(2 + math.ceil(lit * lenslet.magnification / lenslet.pitch), WIDEST)
    bench = Bench(objective, lenslet, CellSampling(1, 1, width), reach, 3.0)
    places = {((0.03, -0.46), 0.0), ((0.21, 0.37), dz)}
    spectra = [arrays.fft2(bench.intensity(*place)) for place in places]
    N = max(2, math.floor(cutoff))
    while max(bench.sampled(one, CellSampling(1, N, width, DEGREE))[1] for one in spectra) > accuracy:
        N = math.ceil(1.06 * N)
    return N
