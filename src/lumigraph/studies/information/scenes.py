"""`Scenes`: statistics of pictures, as brightness, contrast and power over frequency."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import FormatError, GeometryError

LEAST, MOST = 8, 256
"""Samples across a scene."""

NATURAL = -2.0
"""Exponent of the power of natural pictures over frequency."""


@dataclass(frozen=True, slots=True)
class Scenes:
    r"""Flat objects as a set of pictures has them: Gaussian, with power that falls with frequency.

    A scene is a square of samples, dark around. Its brightness over its mean is

    .. math:: 1 + \sum_f a_f\, e^{2\pi i f x}, \quad \langle |a_f|^2 \rangle = S(|f|)

    with whole waves across the square, none finer than two samples. The mean is about as uncertain as the
    longest waves are.

    Parameters
    ----------
    pitch
        Of the samples [m]: half the finest period that objects have.
    samples
        Across the square.
    contrast
        Standard deviation of the brightness over its mean.
    spectrum
        Power S at 1, 2, ... waves across the square, relative; empty for 1/f², that of natural pictures
        (D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987)).

    Raises
    ------
    GeometryError
        No pitch, no contrast, too few or too many samples, a spectrum that does not reach the corner or is
        not positive.

    Examples
    --------
    >>> scenes = Scenes(20e-6, 16)
    >>> drawn = scenes.drawn(np.random.default_rng(0))
    >>> drawn.shape, round(float(scenes.power.sum() - scenes.power[0, 0]), 6)
    ((16, 16), 0.09)
    """

    pitch: float
    samples: int = 32
    contrast: float = 0.3
    spectrum: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pitch", checks.positive("pitch of scenes", self.pitch))
        checks.positive("contrast of scenes", self.contrast, "1")
        _check_samples(self.samples)
        powers = np.array(self.spectrum, np.float64)
        if len(powers) and not (len(powers) >= rings(self.samples) and np.isfinite(powers).all()):
            raise GeometryError(
                f"spectrum has {len(powers)} powers but scenes of {self.samples} samples need "
                f"{rings(self.samples)}, all finite."
            )
        if len(powers) and not (powers.min() >= 0 and powers.max() > 0):
            raise GeometryError("the spectrum of scenes must be at least 0, and somewhere above.")

    @classmethod
    def of(cls, pictures: Sequence[Any], pitch: float, samples: int = 32) -> "Scenes":
        """Scenes with the mean contrast and power of all squares of so many samples in some pictures.

        Squares overlap by half, and fade out towards their borders.

        Parameters
        ----------
        pictures
            Brightness (ny, nx), in proportion to light.
        pitch
            Of their pixels, in the object [m].
        samples
            Across a scene.

        Raises
        ------
        FormatError
            A picture that is no array of numbers from 0 on, has NaN, is dark or even, or has fewer pixels.
        """
        pitch = checks.positive("pitch of scenes", pitch)
        _check_samples(samples)
        count = rings(samples)
        total, number = np.zeros((samples, samples)), 0
        for picture in pictures:
            for square in _squares(_checked(picture, samples), samples, samples // 2):
                total, number = total + _periodogram(square), number + 1
        if not number or total.sum() <= 0:
            raise FormatError("the pictures are even: they have no contrast. Give pictures of something.")
        mean = total / number
        at, size = frequencies(samples), float(mean.sum() - mean[0, 0])
        powers = ring_means(mean, at, count)
        return cls(float(pitch), samples, math.sqrt(size), tuple(float(p) for p in powers / powers.max()))

    @property
    def size(self) -> float:
        """Width of the square [m]."""
        return self.samples * self.pitch

    @property
    def power(self) -> np.ndarray:
        """(n, n): variance of each wave, in the order of `numpy.fft.fft2`."""
        at = frequencies(self.samples)
        if self.spectrum:
            found = np.interp(at, np.arange(1, len(self.spectrum) + 1), self.spectrum)
        else:
            found = np.maximum(at, 1.0) ** NATURAL
        found *= self.contrast**2 / (found.sum() - found[0, 0])
        return found

    def squares(self, pictures: Sequence[Any], most: int) -> list[np.ndarray]:
        """Squares (n, n) of pictures (ny, nx), side by side and over their mean; dark ones are left out.

        Of more than `most` those are taken that stand evenly over all.

        Raises
        ------
        FormatError
            As of `of`; no picture.
        """
        n = self.samples
        found = [square for one in pictures for square in _squares(_checked(one, n), n, n) if square.any()]
        if not found:
            raise FormatError("there are no pictures of scenes. Give one at least.")
        kept = np.unique(np.linspace(0, len(found) - 1, min(most, len(found))).round().astype(int))
        return [found[k] / found[k].mean() for k in kept]

    def drawn(self, rng: np.random.Generator) -> np.ndarray:
        """A scene (n, n), its brightness over the mean of all, drawn by chance."""
        return 1 + coloured(rng.standard_normal((self.samples, self.samples)), self.power)


def frequencies(samples: int) -> np.ndarray:
    """(n, n): waves across the square, of each Fourier coefficient."""
    one = np.fft.fftfreq(samples, 1 / samples)
    return np.hypot(one[:, None], one)


def rings(samples: int) -> int:
    """Whole numbers of waves up to the corner."""
    return math.ceil(samples / math.sqrt(2))


def ring_means(values: np.ndarray, at: np.ndarray, count: int) -> np.ndarray:
    """(count,): means of coefficients (n, n) with nearly 1, 2, ... waves; between where there is none."""
    which = np.clip(np.rint(at).astype(int), 0, count)
    total, number = (np.bincount(which.ravel(), w, count + 1)[1:] for w in (values.ravel(), None))
    full = np.flatnonzero(number)
    return np.interp(np.arange(count), full, total[full] / number[full])


def coloured(white: np.ndarray, power: np.ndarray) -> np.ndarray:
    """White noise (..., n, n) of variance 1, as noise of a power."""
    return np.fft.ifft2(np.fft.fft2(white) * np.sqrt(power) * len(power)).real


def _check_samples(samples: int) -> None:
    if not LEAST <= checks.whole("samples of scenes", samples) <= MOST:
        raise GeometryError(f"samples of scenes are {samples} but must be {LEAST} to {MOST}.")


def _checked(picture: Any, samples: int) -> np.ndarray:
    """A picture over its mean."""
    found = np.asarray(picture)
    if found.ndim != 2 or min(found.shape) < samples:
        raise FormatError(
            f"a picture of a scene has shape {found.shape} but must be grey, of {samples} x {samples} pixels "
            "at least. Use fewer samples."
        )
    checks.brightness("a picture of a scene", found, FormatError)
    found = found.astype(np.float64)
    if not found.mean() > 0:
        raise FormatError("a picture of a scene is dark. Leave it out.")
    return found / found.mean()


def _squares(picture: np.ndarray, samples: int, step: int) -> Iterator[np.ndarray]:
    for y in range(0, picture.shape[0] - samples + 1, step):
        for x in range(0, picture.shape[1] - samples + 1, step):
            yield picture[y : y + samples, x : x + samples]


def _periodogram(square: np.ndarray) -> np.ndarray:
    """Power of each wave of a square that fades out."""
    fade = np.hanning(len(square) + 2)[1:-1]
    window = np.outer(fade, fade)
    off = square - np.average(square, weights=window)
    return np.abs(np.fft.fft2(off * window)) ** 2 / (window**2).sum() / square.size
