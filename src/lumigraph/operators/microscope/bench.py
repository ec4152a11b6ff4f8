"""A point's light behind the lenslets of a microscope, on a fine grid, and its samples over pixels.

Neither fields nor lenslets are aliased on the grid. Pixels are averaged exactly, by their transfer function.
What is kept of an image are the coefficients of the B-splines that come nearest to it, so that what they
leave out is known for each image from its own spectrum.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from copy import copy

import numpy as np
import scipy.fft
from scipy.sparse import csr_array

from lumigraph.core import arrays, memory
from lumigraph.core.cache import remembered
from lumigraph.core.threads import each
from lumigraph.elements.objective import Objective
from lumigraph.errors import SamplingError
from lumigraph.operators.microscope.cell import CellSampling, Lenslet

DEGREE = 3
"""Of the B-splines from which pixels are interpolated: higher degrees ring, and what is below 0 is cut."""

MORE = 1.2
"""How many more samples along a lenslet may be taken so that the fields of all points are windows of one."""

ALIASES = np.arange(-6, 7)
"""Repetitions of a sampled spectrum that are followed."""


FINER = 1.4
"""Factor of the samples of the light on the grid that tells what one misses.

It tells 0.7 to 1.1 times what the whole image is off by, beside three times as many samples: 20x/0.5 and
40x/0.95, 9 to 21 px behind a lenslet, -9 to 30 um, 1e-2 and 1e-3. Where it is below a tenth of these, 0.4 to
1.2 times. Round lenslets: 0.5 to 1 times.
"""

GRID = 0.5
"""Of the accuracy, that the grid of the light may take; it is made finer where it takes more."""

MIDDLE = 6
"""Cells to each side of a point's own by which the grid behind round lenslets is judged.

Of images that reach as far it tells 0.5 to 1 times what they are off by; 0.2 to 0.5 with 2 cells, as steep
light goes far.
"""


def fineness(objective: Objective, lenslet: Lenslet, margin: float, points: int = 1) -> int:
    """Samples of the light along a lenslet; a multiple of `points` where that takes few more."""
    steepest = objective.numerical_aperture / lenslet.magnification
    steepest += lenslet.pitch / (2 * abs(lenslet.focal_length))
    return shared_length(math.ceil(lenslet.pitch * 2 * margin * steepest / objective.wavelength), points)


def refined(fine: int, points: int, accuracy: float, seen: Callable[[int], np.ndarray]) -> tuple[int, float]:
    """Samples of the light along a lenslet that images need, and the relative rms that their grid misses.

    By an image `seen` on grids of so many samples, from `fine` on.
    """
    most = 4 * fine
    while True:
        finer = shared_length(math.ceil(FINER * fine), points)
        shown, truth = each(seen, (fine, finer))
        missed = float(np.linalg.norm(truth - shown) / np.linalg.norm(truth))
        if missed <= GRID * accuracy or finer > most:
            return fine, missed
        fine = finer


def bench_bytes(modes: int, cells: int, fine: int, points: int) -> float:
    """Memory of images of points on at most `points` lines of a `LensletBench`, in all threads [bytes]."""
    field, threads = 16.0 * modes + 64, min(arrays.WORKERS, points)
    # Points share one field if it moves by whole samples, and each thread holds its light.
    of_each = threads * field if fine % points else max(field, 8.0 * modes + 8 + 32 * threads)
    return of_each * (cells * fine) ** 2


def require_finer(needed: float, fine: int, dz: float) -> None:
    """Refuse images for which the grid had to be made so fine that they do not fit in memory [bytes].

    Raises
    ------
    SamplingError
        The depth and the samples.
    """
    what = f"the image of a point at {dz * 1e6:.4g} µm, on {fine} samples along a lenslet,"
    remedy = "Ask for less accuracy, or use depths nearer to the focused plane."
    memory.require(needed, what, remedy, SamplingError)


def shared_length(least: int, points: int) -> int:
    """Number of samples, at least `least`, quick to transform; a multiple of `points` if few more."""
    shared = fast_length(math.ceil(least / points)) * points
    return shared if points > 1 and shared <= MORE * least else fast_length(least)


def fast_length(least: int) -> int:
    """Number of samples, at least `least`, that is quick to transform."""
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
    power = np.sinc((f - np.rint(f))[:, None] + ALIASES) ** (2 * degree + 2)  # which repeats
    own = np.sinc(f) ** (degree + 1)
    return own / power.sum(1), own**2 / power.sum(1)


@remembered
def transmission(lenslet: Lenslet, wavelength: float, finest: int, samples: int) -> np.ndarray:
    """Transmission of a lenslet (samples, samples), by its Fourier series up to `finest` per pitch."""
    waves = _waves(finest, samples)
    if lenslet.is_round:
        return waves @ round_series(lenslet, wavelength, finest) @ waves.T
    line = waves @ series(lenslet, wavelength, finest)
    return np.outer(line, line)


def series(lenslet: Lenslet, wavelength: float, finest: int) -> np.ndarray:
    """Fourier series (2 finest + 1,) of a square lenslet along an axis."""
    return next(_lines(lenslet, wavelength, finest, [lenslet.width / 2]))


def round_series(lenslet: Lenslet, wavelength: float, finest: int) -> np.ndarray:
    """Fourier series (2 finest + 1, 2 finest + 1) of a round lenslet, of chords, each a line with edges.

    They stand at R cos θ: over even steps of θ a smooth function's mean errs by less than any power of these.
    """
    count = 2 * (math.ceil(2 * _turns(lenslet, wavelength, finest)) + 16)
    angle, radius = (np.arange(count // 2) + 0.5) * np.pi / count, lenslet.width / 2
    at, half = radius * np.cos(angle), radius * np.sin(angle)
    lines = np.stack(list(_lines(lenslet, wavelength, finest, half.tolist())))
    wave = half * np.exp(-1j * np.pi * at**2 / (wavelength * lenslet.focal_length))
    orders = np.arange(-finest, finest + 1)
    down = np.cos(2 * np.pi * np.outer(orders, at / lenslet.pitch)) * wave  # of chords on both sides
    return down @ lines * (2 * np.pi / count / lenslet.pitch)


def _lines(lenslet: Lenslet, wavelength: float, finest: int, halves: Sequence[float]) -> Iterator[np.ndarray]:
    """Fourier series (2 finest + 1,) along lines through a lens, of some half widths, by quadrature."""
    unit, weight = np.polynomial.legendre.leggauss(math.ceil(4 * _turns(lenslet, wavelength, finest)) + 32)
    orders, curve = np.arange(-finest, finest + 1), np.pi / (wavelength * lenslet.focal_length)
    for half in halves:
        at = unit * half
        wave = weight * half / lenslet.pitch * np.exp(-1j * curve * at**2)
        yield np.exp(-2j * np.pi * np.outer(orders, at / lenslet.pitch)) @ wave


def _turns(lenslet: Lenslet, wavelength: float, finest: int) -> float:
    """Turns of the phase that a lenslet's series is made of, over its width."""
    return finest + lenslet.pitch**2 / (wavelength * abs(lenslet.focal_length))


def _waves(finest: int, samples: int) -> np.ndarray:
    """Waves (samples, 2 finest + 1) over a pitch."""
    at = (np.arange(samples) - (samples - 1) / 2) / samples
    return np.exp(2j * np.pi * np.outer(at, np.arange(-finest, finest + 1)))


def finest_of(objective: Objective, lenslet: Lenslet, fine: int) -> int:
    """Periods in a pitch up to which lenslets are followed on so many samples, without aliases."""
    steepest = objective.numerical_aperture / lenslet.magnification / objective.wavelength
    return math.floor(fine / 2 - steepest * lenslet.pitch)


def faded(cells: int, fine: int) -> np.ndarray:
    """(cells fine,), 1 but half a cell at each border.

    Light that goes out on one side comes in on the other, without an edge.
    """
    at = np.arange(cells * fine) + 0.5
    return np.sin(np.pi / 2 * np.minimum(2 * np.minimum(at, at[::-1]) / fine, 1)) ** 2


class LensletBench:
    """The lenslets around a point's own, and the way from there to the pixels; see `Crossed`."""

    def __init__(
        self, objective: Objective, lenslet: Lenslet, sampling: CellSampling, reach: int, margin: float,
        beside: int = 0, accuracy: float = 1e-2,
    ) -> None:  # fmt: skip
        self.objective, self.lenslet, self.sampling = objective, lenslet, sampling
        self.accuracy, self.guard = accuracy, guard(objective, lenslet) + beside
        self._lay(fineness(objective, lenslet, margin, sampling.points), reach)

    def _lay(self, fine: int, reach: int) -> None:
        """Make the grid of so many samples along a lenslet, over so many cells to each side."""
        self.fine, self.reach = fine, reach
        self.cells, step = 2 * (reach + self.guard) + 1, self.lenslet.pitch / fine
        n = self.cells * fine
        self.at = (np.arange(n) - (n - 1) / 2) * step
        self.lenslets = self._lenslets()
        path = -1j * np.pi * self.objective.wavelength * self.lenslet.distance
        self.transfer = np.exp(path * np.fft.fftfreq(n, step) ** 2).astype(np.complex64)

    def _lenslets(self) -> np.ndarray:
        """Transmission of the lenslets on the grid, as finely as neither they nor the field are aliased.

        Light that a lenslet's border sends steeper than that goes far, and makes fringes that are finer than
        pixels with what is brighter: it is better left out than where it does not belong.
        """
        finest = finest_of(self.objective, self.lenslet, self.fine)
        own = transmission(self.lenslet, self.objective.wavelength, finest, self.fine)
        taper = faded(self.cells, self.fine)
        return (np.tile(own, (self.cells, self.cells)) * np.outer(taper, taper)).astype(np.complex64)

    def images(self, dz: float, points: Sequence[tuple[float, float]]) -> Iterator[tuple[np.ndarray, float]]:
        """`image` of points (ky, kx) at a depth, in order; what the grid misses counts."""
        middle = points[len(points) // 2]
        lines = self.sampling.points
        fine, missed = refined(self.fine, lines, self.accuracy, lambda fine: self._middle(fine, dz, middle))
        if fine > self.fine:
            require_finer(bench_bytes(self.objective.modes, self.cells, fine, lines), fine, dz)
            self._lay(fine, self.reach)
        fields = self.fields(dz)

        def image(point: tuple[float, float]) -> tuple[np.ndarray, float]:
            found, lost = self.image(fields(point))
            return found, math.hypot(lost, missed)

        return each(image, points)

    def _middle(self, fine: int, dz: float, point: tuple[float, float]) -> np.ndarray:
        """Middle of a point's image, on some grid."""
        part = copy(self)
        part._lay(fine, min(self.reach, MIDDLE))
        return part.image(part.fields(dz)(point))[0]

    def image(self, field: np.ndarray) -> tuple[np.ndarray, float]:
        """Samples ((2 reach + 1) N, the same) of a point of the middle cell, from its `fields`.

        For a point that sends s⁻² of the light of a lenslet's area: the mean over all points is 1. And the
        relative rms of what the samples do not hold.
        """
        edge, lost = self.guard * self.sampling.pixels, 0.0
        inner = slice(edge, self.cells * self.sampling.pixels - edge)
        light = self.intensity(field)
        if self.sampling.degree:
            image, lost = sampled(arrays.fft2(light), self.fine, self.sampling)
            image = image[inner, inner]
        else:
            factors = responses(len(light), self.fine, self.sampling)[0][: len(light) // 2 + 1]
            across = _averaged(light, factors, self.cells * self.sampling.pixels)[:, inner]
            image = np.maximum(_averaged(across.T, factors, self.cells * self.sampling.pixels)[:, inner].T, 0)
        area = (self.lenslet.pitch / self.lenslet.magnification / self.sampling.points) ** 2
        return image * np.float32(area), lost

    def fields(self, dz: float) -> Callable[[tuple[float, float]], np.ndarray]:
        """Function that returns the field (modes, n, n) before the lenslets of a point (ky, kx) [samples]."""
        s, pitch = self.sampling.points, self.lenslet.pitch / self.lenslet.magnification
        at, step = self.at / self.lenslet.magnification, self.fine // s

        def field(point: tuple[float, float]) -> np.ndarray:
            y, x = (at - (k - (s - 1) / 2) / s * pitch for k in point)
            return self.objective.fields(y[:, None], x[None, :], dz).astype(np.complex64)

        if s == 1 or self.fine % s:
            return field
        # From one point to the next it moves by whole samples.
        wide = np.arange(len(at) + (s - 1) * step) - (len(at) - 1 + (s - 1) * step) / 2
        wide *= pitch / self.fine
        whole = self.objective.fields(wide[:, None], wide[None, :], dz).astype(np.complex64)

        def window(point: tuple[float, float]) -> np.ndarray:
            if any(k % 1 for k in point):
                return field(point)
            top, left = ((s - 1 - int(k)) * step for k in point)
            return whole[:, top : top + len(at), left : left + len(at)]

        return window

    def lights(self, dz: float, points: Sequence[tuple[float, float]]) -> Iterator[np.ndarray]:
        """`intensity` of points (ky, kx) at a depth, in order."""
        fields = self.fields(dz)
        return each(lambda point: self.intensity(fields(point)), points)

    def intensity(self, field: np.ndarray) -> np.ndarray:
        """Intensity on the whole fine grid behind the lenslets, by the field (modes, n, n) before them."""
        image = np.zeros((len(self.at),) * 2, np.float32)
        for mode in field:
            behind = mode * self.lenslets
            spectrum = arrays.fft2(behind, overwrite=True)
            spectrum *= self.transfer[:, None]
            spectrum *= self.transfer
            behind = arrays.ifft2(spectrum, overwrite=True)
            image += np.square(behind.real) + np.square(behind.imag)
        return image


def sampled(spectrum: np.ndarray, fine: int, sampling: CellSampling) -> tuple[np.ndarray, float]:
    """Samples, none below 0, of the spectrum of an intensity over whole cells, and the relative rms that they
    do not hold.
    """
    n = len(spectrum)
    count, lost = n // fine * sampling.pixels, 0.0
    coefficients, averaged, held = responses(n, fine, sampling)
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


def responses(count: int, fine: int, sampling: CellSampling) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Along an axis of `count` samples, `fine` to a lenslet: factors of samples, and the parts of amplitudes
    that pixels average and that samples hold, the latter squared.
    """
    f = np.fft.fftfreq(count) * fine  # in periods of a pitch
    averaged = np.sinc(f * sampling.width)
    held = spline_response(f / sampling.pixels, sampling.degree)[1] if sampling.degree else 1.0
    return factors(count, fine, sampling).astype(np.complex64), averaged, averaged**2 * held


def factors(count: int, fine: int, sampling: CellSampling) -> np.ndarray:
    """The first of `responses`, in double precision."""
    f = np.fft.fftfreq(count) * fine
    own = spline_response(f / sampling.pixels, sampling.degree)[0] if sampling.degree else 1.0
    return np.sinc(f * sampling.width) * own * np.exp(1j * np.pi * f * (1 / sampling.pixels - 1 / fine))


def _averaged(light: np.ndarray, factors: np.ndarray, count: int) -> np.ndarray:
    """Light (k, n) in `count` samples for n, (k, count), by the factors of its frequencies from 0 on."""
    n = light.shape[1]
    spectrum = arrays.rfft(light, n, axis=1)
    spectrum *= factors * np.float32(count / n)
    half = count // 2 + 1
    folded = np.zeros((len(light), half), spectrum.dtype)
    # What is taken less finely than it was computed has its spectrum folded.
    for start in range(0, n // 2 + 1, count):
        part = spectrum[:, start : start + half]
        folded[:, : part.shape[1]] += part
    for start in range(count, (n - 1) // 2 + half, count):
        first = max(start - (n - 1) // 2, 0)
        part = spectrum[:, start - half + 1 : start - first + 1]
        folded[:, first:] += part[:, ::-1].conj()
    return arrays.irfft(folded, count, axis=1)
