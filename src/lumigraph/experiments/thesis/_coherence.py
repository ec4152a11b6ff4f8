"""The 2f system as a filter, and random-phase snapshots of a resolution target through it.

In the Fresnel approximation the intensity is |h * (U exp(iπ r²/(λz)))|², h the transform of the pupil: one
snapshot costs one forward transform and a small inverse one. docs/theory/experiments.md has the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import next_fast_len

from lumigraph.core.arrays import fft, ifft2
from lumigraph.core.grid import Grid
from lumigraph.elements.masks import random_phase_mask, white_phase
from lumigraph.experiments.registry import Context
from lumigraph.experiments.thesis import _two_f as two_f
from lumigraph.scene import Slice, targets
from lumigraph.units import mm

SAMPLES, WINDOW = 1765, 10 * mm
"""Sampling of the thesis' section 3.5.1."""
QUICK_SAMPLES = 882
"""Half of the window at the same pitch: the same object detail, masks and speckle."""
INCOHERENCE = 0.14
"""C/N at which the thesis finds its asymptote."""

Light = Callable[[Grid, np.random.Generator], np.ndarray]
"""Complex illumination (ny, nx) of an object, of random phase."""


@dataclass(frozen=True)
class Imager:
    """A USAF-1951 target in the 2f system of the thesis, sampled by `samples` on each axis.

    Its light converges on the lens, or is parallel.
    """

    samples: int
    converging: bool = True

    @classmethod
    def of(cls, context: Context) -> "Imager":
        """Full or quick size."""
        return cls(QUICK_SAMPLES if context.quick else SAMPLES)

    @cached_property
    def grid(self) -> Grid:
        """Grid of the object's samples."""
        return Grid.square(self.samples, WINDOW / SAMPLES)

    @cached_property
    def target(self) -> np.ndarray:
        """Intensity of the object (ny, nx): bars of 2 (quick: 4) to 28 line pairs per millimetre."""
        groups = (1, 4) if self.samples == SAMPLES else (2, 4)
        chart = targets.usaf1951(self.grid, groups).parts[0]
        assert isinstance(chart, Slice)
        return np.asarray(chart.intensity, np.float32)

    @cached_property
    def band(self) -> np.ndarray:
        """Numbers of the frequencies inside the pupil, along one axis."""
        highest = two_f.DIAMETER / (2 * two_f.WAVELENGTH * two_f.DISTANCE) * self.grid.size[0]
        return np.arange(-int(highest), int(highest) + 1)

    @cached_property
    def pupil(self) -> np.ndarray:
        """Pupil over the frequencies of the band, 0 or 1."""
        f = self.band / self.grid.size[0] * two_f.WAVELENGTH * two_f.DISTANCE
        return (np.hypot(f[:, None], f) <= two_f.DIAMETER / 2).astype(np.float32)

    @cached_property
    def image_samples(self) -> int:
        """Enough for the intensity's frequencies, a quick size to transform."""
        return int(next_fast_len(2 * len(self.band)) or 0)

    @cached_property
    def amplitude(self) -> np.ndarray:
        """Object amplitude, in parallel light with the phase exp(iπ r²/(λz)) of the way to the lens."""
        if self.converging:
            return np.sqrt(self.target).astype(np.complex64)
        along = np.exp(1j * np.pi * self.grid.x**2 / (two_f.WAVELENGTH * two_f.DISTANCE))
        return (np.sqrt(self.target) * along[:, None] * along).astype(np.complex64)

    def image(self, light: np.ndarray) -> np.ndarray:
        """Intensity of the image (K, K) under one illumination."""
        spectrum = fft(self.amplitude * light, axis=-1, overwrite=True)[:, self.band]
        spectrum = fft(spectrum, axis=0)[self.band]
        return np.abs(self._inverse(spectrum * self.pupil)) ** 2 / self.samples**2

    @cached_property
    def reference(self) -> np.ndarray:
        """Exact incoherent image (K, K): the mean of `image` over independent phases of all samples."""
        k = self.image_samples
        point = np.abs(self._inverse(self.pupil.astype(np.complex128))) ** 2
        numbers = np.fft.fftfreq(k, 1 / k).astype(int)
        spectrum = np.fft.fft2(self.target.astype(np.float64))[np.ix_(numbers, numbers)]
        return np.fft.ifft2(spectrum * np.fft.fft2(point)).real / self.samples**2

    def _inverse(self, spectrum: np.ndarray) -> np.ndarray:
        k = self.image_samples
        whole = np.zeros((k, k), spectrum.dtype)
        whole[np.ix_(self.band, self.band)] = spectrum
        return ifft2(whole, overwrite=True) * k


def white(grid: Grid, rng: np.random.Generator) -> np.ndarray:
    """An independent phase for each sample."""
    return white_phase(grid, rng)


def masked(coherence_index: int) -> Light:
    """The thesis' random phase masks of C × C sources."""

    def light(grid: Grid, rng: np.random.Generator) -> np.ndarray:
        return random_phase_mask(grid, two_f.WAVELENGTH, coherence_index, rng)

    return light


def snapshots(imager: Imager, light: Light, count: int, seed: int) -> np.ndarray:
    """Sums of images of independent snapshots (2, K, K): of the even and of the odd ones.

    The same seed gives the same sums.
    """
    sums = np.zeros((2, imager.image_samples, imager.image_samples))
    for number, rng in enumerate(np.random.default_rng(seed).spawn(count)):
        sums[number % 2] += imager.image(light(imager.grid, rng))
    return sums


@dataclass(frozen=True)
class Errors:
    """Expected error of any number of snapshots, relative to the reference's rms.

    `bias` is the error that is left of infinitely many, `speckle` the standard deviation of one snapshot:
    M of them have rms² = bias² + speckle²/M.
    """

    bias: float
    speckle: float

    @classmethod
    def of(cls, halves: np.ndarray, count: int, reference: np.ndarray) -> "Errors":
        """Errors from sums of both halves of `count` snapshots: speckle is independent, bias is common."""
        means = halves / (count / 2)
        scale = (reference * means.mean(0)).sum() / np.square(means.mean(0)).sum()
        first, second = scale * means - reference
        power = np.square(reference).sum()
        squared = max(float((first * second).sum() / power), 0.0)
        spread = float(np.square(first - second).sum() / power) * count / 4
        return cls(squared**0.5, spread**0.5)

    def rms(self, count: float | np.ndarray) -> float | np.ndarray:
        """Relative rms error of the mean of `count` snapshots."""
        return np.sqrt(self.bias**2 + self.speckle**2 / count)
