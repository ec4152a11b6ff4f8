r"""Images of a point behind square lenslets as products of matrices along y and along x.

A point's field before the lenslets is a sum of plane waves, each of which square lenslets turn into a Bloch
wave b along each axis (`bloch`). Moving the point to (y, x) in its cell only turns phases:

.. math:: V = b_y^T \, e^{-2\pi i f y} \, P \, e^{-2\pi i f x} \, b_x

P is the spectrum of the field, the same for all points of a depth. It is of low rank but for a small rest,
which the left-out singular values measure: docs/theory/microscope.md.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from copy import copy

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.threads import each
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope.bench import (
    faded,
    fineness,
    finest_of,
    guard,
    refined,
    require_finer,
    sampled,
    series,
)
from lumigraph.operators.microscope.cell import CellSampling, Lenslet, parts

SMEARED = 4
"""Periods in a pitch by which the soft border of a window widens a field's spectrum, to each side."""

MIDDLE = 2
"""Cells to each side of a point's own by which the grid is judged."""

DEAR = 300
"""Multiply-adds of a product in the time of a decomposition of n × n numbers, over n³."""

Point = tuple[float, float]
Pair = tuple[np.ndarray, np.ndarray]


def bloch(lenslet: Lenslet, wavelength: float, turns: np.ndarray, finest: int, at: np.ndarray) -> np.ndarray:
    """Plane waves on the sensor (waves, places), of some periods in a pitch before the lenslets (waves,).

    Parameters
    ----------
    lenslet, wavelength
        Square lenslets.
    turns
        Periods in a pitch.
    finest
        Up to so many periods in a pitch a lenslet's Fourier series is followed.
    at
        Places from the middle of a cell [pitches].
    """
    orders, column = np.arange(-finest, finest + 1), turns[:, None]
    curve = np.pi * wavelength * lenslet.distance / lenslet.pitch**2
    paths = np.exp(-1j * curve * (column + orders) ** 2) * series(lenslet, wavelength, finest)
    return (paths @ np.exp(2j * np.pi * np.outer(orders, at))) * np.exp(2j * np.pi * column * at)


def over_cells(waves: np.ndarray, turns: np.ndarray, cells: int) -> np.ndarray:
    """`bloch` of the middle cell (turns, places), for a row of cells (turns, cells × places)."""
    moves = np.exp(2j * np.pi * np.outer(turns, np.arange(cells) - cells // 2)).astype(waves.dtype)
    return (moves[:, :, None] * waves[:, None, :]).reshape(len(turns), -1)


class SeparableLenslets:
    """Square lenslets around a point's own, and the way from there to the pixels; as `LensletBench`.

    Parameters
    ----------
    objective, lenslet, sampling
        Of the microscope.
    reach
        Cells to each side of a point's own whose image is wanted.
    margin
        Samples of the light, over what its band without diffraction at lenslets asks for.
    left_out
        Relative rms of fields that a low rank may leave out.
    beside
        Lenslets beyond `guard` whose light is followed into the window, to each side.
    accuracy
        Relative rms of images: how many nodes the mean over a pixel has.
    """

    def __init__(
        self,
        objective: Objective,
        lenslet: Lenslet,
        sampling: CellSampling,
        reach: int,
        margin: float,
        left_out: float = 0.0,
        beside: int = 0,
        accuracy: float = 1e-2,
    ) -> None:
        self.accuracy = accuracy
        self.objective, self.lenslet, self.sampling = objective, lenslet, sampling
        self.reach, self.left_out = reach, left_out
        self.fine, self.guard = fineness(objective, lenslet, margin), guard(objective, lenslet) + beside
        self.steepest = (
            objective.numerical_aperture / lenslet.magnification / objective.wavelength * lenslet.pitch
        )

    def images(self, dz: float, points: Sequence[Point]) -> Iterator[tuple[np.ndarray, float]]:
        """Samples ((2 reach + 1) N, the same) of points (ky, kx), in order; as of `LensletBench`."""
        turns, modes, missing = self._modes(dz, len(points))
        middle = points[len(points) // 2]
        told = self.fine, 1, self.accuracy
        self.fine, missed = refined(*told, lambda fine: self._middle(fine, turns, modes, middle))
        if self.fine > told[0]:
            require_finer(self.held_bytes(len(points)), self.fine, dz)
        fields = self._fields(turns, modes, points)

        def image(point: Point) -> tuple[np.ndarray, float]:
            samples, lost = self._seen(fields(point))
            return samples * np.float32(self._area), math.hypot(lost, missing, missed)

        return each(image, points)

    def lights(self, dz: float, points: Sequence[Point]) -> Iterator[np.ndarray]:
        """Intensities on the fine grid behind lenslets, for splines' samples; as `LensletBench.lights`."""
        turns, modes, _ = self._modes(dz, len(points))
        fields = self._fields(turns, modes, points)
        return each(lambda point: self._light(fields(point)), points)

    def _modes(self, dz: float, points: int) -> tuple[np.ndarray, list[Pair], float]:
        """Periods in a pitch (m,), pairs of matrices (rank, m) of what does not interfere, and the relative
        rms that these leave out.
        """
        turns, spectra = self._spectra(dz)
        power = float(np.square(np.abs(spectra)).sum())
        allowed = self.left_out**2 / len(spectra) * power
        found = [self._factors(spectrum, points, allowed) for spectrum in spectra]
        missing = math.sqrt(sum(left for *_, left in found) / power)
        return turns, [(down, across) for down, across, _ in found], missing

    def _middle(self, fine: int, turns: np.ndarray, modes: Sequence[Pair], point: Point) -> np.ndarray:
        """Middle of a point's image, on some grid."""
        part = copy(self)
        part.fine, part.reach = fine, min(self.reach, MIDDLE)
        return part._seen(part._fields(turns, modes, [point])(point))[0]

    def _fields(
        self, turns: np.ndarray, modes: Sequence[Pair], points: Sequence[Point]
    ) -> Callable[[Point], list[Pair]]:
        """Function that returns the incoherent parts of a point's light, along y and along x."""
        waves = self._waves(turns)

        def moved(told: tuple[int, float]) -> list[np.ndarray]:
            axis, k = told
            turn = np.exp(-2j * np.pi * turns * self._place(k)).astype(np.complex64)
            return [(factors[axis] * turn) @ waves for factors in modes]

        wanted = sorted({(axis, point[axis]) for point in points for axis in (0, 1)})
        found = dict(zip(wanted, each(moved, wanted), strict=True))
        return lambda point: list(zip(found[0, point[0]], found[1, point[1]], strict=True))

    def held_bytes(self, points: int) -> float:
        """Memory that `images` holds at most, for points on so many lines an axis, in all threads [bytes]."""
        modes, cells = self.objective.modes, 2 * self.reach + 1
        if self.sampling.degree:
            samples, of_each = (cells + 2 * self.guard) * self.fine, 64.0
        else:
            samples, of_each = cells * self.sampling.pixels * self._nodes, 24.0 / self._nodes
        waves = self._count // (2 if self.objective.is_round else 1)
        threads = min(arrays.WORKERS, points**2)
        held = 16.0 * (3 * modes + 6) * self._count**2 + 24.0 * self._count * samples
        return held + 16.0 * modes * points * waves * samples + threads * of_each * samples**2

    @property
    def _window(self) -> int:
        """Cells of a point's field, half of the first and of the last of them its soft border."""
        return 2 * (self.reach + self.guard) + 2

    @property
    def _count(self) -> int:
        """Samples along the window, m."""
        return self._window * (math.ceil(2 * self.steepest) + 2 * SMEARED) // 2 * 2 + 1

    @property
    def _area(self) -> float:
        return (self.lenslet.pitch / self.lenslet.magnification / self.sampling.points) ** 2

    def _place(self, k: float) -> float:
        """Place of a point, from its cell's middle [pitches]."""
        return (k - (self.sampling.points - 1) / 2) / self.sampling.points

    def _spectra(self, dz: float) -> tuple[np.ndarray, np.ndarray]:
        """Periods in a pitch (m,), and the plane waves (modes, m, m) of a point's field around it."""
        cells, count = self._window, self._count
        at = (np.arange(count) - count // 2) * (cells / count)
        taper = np.sin(np.pi / 2 * np.clip(cells - 2 * np.abs(at), 0, 1)) ** 2
        place = at * (self.lenslet.pitch / self.lenslet.magnification)
        fields = self.objective.fields(place[:, None], place[None, :], dz) * np.outer(taper, taper)
        spectra = np.fft.fft2(np.fft.ifftshift(fields, (1, 2)), norm="forward")
        return (np.arange(count) - count // 2) / cells, np.fft.fftshift(spectra, (1, 2))

    def _factors(
        self, spectrum: np.ndarray, points: int, allowed: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Two matrices (rank, m) whose product is the spectrum, and the power that they leave out."""
        count = len(spectrum)
        down = across = np.eye(count, dtype=np.float32)
        if self.objective.is_round:
            down, across = (_of_parity(spectrum, axis) for axis in (0, 1))
        core = (down @ spectrum @ across.T).astype(np.complex64)
        samples = (2 * self.reach + 1) * self.fine
        if not allowed or DEAR * len(core) ** 2 > points * samples**2:
            return down, core @ across, 0.0
        u, s, v = np.linalg.svd(core)
        left = np.cumsum(np.square(s[::-1], dtype=np.float64))[::-1]
        rank = max(int((left > allowed).sum()), 1)
        return (u[:, :rank] * s[:rank]).T @ down, v[:rank] @ across, float(left[rank:][:1].sum())

    def _waves(self, turns: np.ndarray) -> np.ndarray:
        """Waves behind the lenslets (m, nodes × samples): at a pixel's nodes, or on a grid for splines."""
        N, finest = self.sampling.pixels, finest_of(self.objective, self.lenslet, self.fine)
        told = self.lenslet, self.objective.wavelength, turns, finest
        if self.sampling.degree:
            cells = 2 * (self.reach + self.guard) + 1
            waves = over_cells(bloch(*told, centred(self.fine)), turns, cells)
            return (waves * faded(cells, self.fine)).astype(np.complex64)
        nodes, weights = np.polynomial.legendre.leggauss(self._nodes)
        places = centred(N) + nodes[:, None] * self.sampling.width / 2
        own = bloch(*told, places.ravel()).reshape(len(turns), *places.shape)
        own = (own * np.sqrt(weights / 2)[:, None]).astype(np.complex64)
        cells = 2 * self.reach + 1
        return np.concatenate([over_cells(own[:, k], turns, cells) for k in range(len(nodes))], axis=1)

    @property
    def _nodes(self) -> int:
        """Number of nodes of the quadrature over a pixel, along an axis.

        Gauss and Legendre's needs more nodes than half the phase of the steepest light from the middle of a
        pixel to its edge. Measured beside four more: 20x/0.5 and 60x/1.2, 7 to 27 px behind a lenslet, two
        depths, 1e-2 to 1e-4: off by at most 0.67 of the accuracy.
        """
        if self.sampling.degree:
            return 1
        half = math.pi / 4 * self.fine * self.sampling.width
        return math.ceil(half + 0.35 + 0.4 * (-math.log10(self.accuracy) - 2))

    def _seen(self, fields: Sequence[Pair]) -> tuple[np.ndarray, float]:
        """Samples of what does not interfere, and the relative rms that they do not hold."""
        light = self._light(fields)
        if not self.sampling.degree:
            return light, 0.0
        image, lost = sampled(arrays.fft2(light), self.fine, self.sampling)
        edge = self.guard * self.sampling.pixels
        return image[edge:-edge, edge:-edge], lost

    def _light(self, fields: Sequence[Pair]) -> np.ndarray:
        """Sum of intensities of fields, each along y (rank, nodes × samples) and along x."""
        nodes = self._nodes
        count = fields[0][0].shape[1] // nodes
        light = np.zeros((count, 2 * nodes * count), np.float32)
        for down, across in fields:
            for part in np.split(down, nodes, axis=1):
                numbers = (part.T @ across).view(np.float32)
                light += np.square(numbers, out=numbers)
        light = light.reshape(count, nodes, count, 2).sum(1)
        return light[..., 0] + light[..., 1]


def centred(count: int) -> np.ndarray:
    """Middles of the parts of a cell [pitches].

    >>> centred(4).tolist()
    [-0.375, -0.125, 0.125, 0.375]
    """
    return (np.arange(count) - (count - 1) / 2) / count


def _of_parity(spectrum: np.ndarray, axis: int) -> np.ndarray:
    """Orthonormal rows that hold a spectrum that is even, or odd, along an axis."""
    whole, half = parts(len(spectrum)), (len(spectrum) + 1) // 2
    mirrored = np.vdot(spectrum, np.flip(spectrum, axis)).real
    return (whole[:half] if mirrored > 0 else whole[half:]).astype(np.float32)
