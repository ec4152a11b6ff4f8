"""The image of one wave along the axis through all lenslets: a sum of the images of one lenslet of each kind.

They stand whole samples apart, so the sum is a convolution. Cells in the middle that look alike are left out.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import fft

from lumigraph.core import arrays
from lumigraph.operators.lenslets.cell_response import CellLenslets, focal_lengths, legendre, nodes
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.cell_axis import CellAxis
from lumigraph.operators.sampling.optics import Optics

KEPT = 5.0
"""How far apart [pitches] lenslets may stand whose fringes the pixels still see; others may alias."""

FADING = 0.4
"""Part of the way that light is followed on which it fades out."""


@dataclass(frozen=True, slots=True)
class Side:
    """One axis of the array, or of a shorter one that looks the same from all cells.

    Parameters
    ----------
    axis
        Of a cell: samples of the wave's image, and how far light is followed.
    first
        Edge of the outermost cell [m].
    cells
        Their number.
    like
        For each cell of the image, the one that it is like.
    limits
        Of the lenslets' centres [m].
    origin
        Of the lattice [m].
    endless
        Whether the lenslets go on for ever.
    """

    axis: CellAxis
    first: float
    cells: int
    like: np.ndarray
    limits: tuple[float, float]
    origin: float
    endless: bool

    @classmethod
    def of(cls, optics: Optics, which: int, pitches: float) -> "Side":
        """With light followed for so many pitches."""
        cells, array, pitch = optics.cells, optics.array, optics.array.lattice.pitch
        size, count, reach = cells.size[which], cells.image[which], pitches * pitch
        axis = replace(optics.axes[which], neighbourhood=reach, band=0.0)
        axis = replace(axis, samples=_samples(optics, which, (pitches + KEPT) * pitch))
        first = cells.edge[which] - cells.ring[which] * size
        kept = count if array.extent else 1
        if array.extent:
            kept = min(count, 2 * math.ceil(reach / size + cells.ring[which] + 2) + 1)
        low = kept // 2
        like = np.minimum(np.arange(count), low) + np.maximum(np.arange(count) - low - (count - kept), 0)
        end = (first, first + kept * size * (1 - 1e-6))
        if array.extent:
            half = array.extent[which] / 2
            end = (-half, half - (count - kept) * size)
        return cls(axis, first, kept, like, end, array.lattice.origin[which], not array.extent)

    @property
    def step(self) -> float:
        """Between samples [m]."""
        return self.axis.size / self.axis.samples

    @property
    def reach(self) -> int:
        """Samples to which the image of a lenslet goes, on each side."""
        return math.ceil(self.axis.neighbourhood / self.step)

    @property
    def length(self) -> int:
        """Samples of all cells, and of what keeps light from coming in at the other end."""
        count = self.cells * self.axis.samples
        return count if self.endless else _fast(count + self.reach)

    def number(self, place: np.ndarray) -> np.ndarray:
        """Of the samples at or before some lenslets."""
        return np.floor((place - self.first) / self.step - 0.5 + 1e-4).astype(int)

    def offsets(self) -> np.ndarray:
        """From a lenslet to the samples around it [m]."""
        place = (self.origin - self.first) / self.step - 0.5
        return (np.arange(-self.reach, self.reach + 1) - (place - math.floor(place + 1e-4))) * self.step

    def spread(self, light: np.ndarray, lenslets: CellLenslets, tilt: float) -> np.ndarray:
        """Amplitude (samples, light) of light at distances from a lenslet's centre [m].

        It fades out where it ends: edges of lenslets that abut cancel.
        """
        places, reach = self.offsets(), self.axis.neighbourhood
        left = np.clip(np.abs(places[:, None] - light) / reach, 1 - FADING, 1) - (1 - FADING)
        return lenslets.spread(places, light, tilt) * np.cos(np.pi / 2 / FADING * left) ** 2


def _fast(count: int) -> int:
    """So many or a few more, which transforms are fast for."""
    return int(fft.next_fast_len(count) or count)


def _samples(optics: Optics, which: int, farthest: float) -> int:
    """Along a cell, for fringes of light from `farthest` apart [m]; lenslets stand whole samples apart."""
    axis, lattice = optics.axes[which], optics.array.lattice
    squared = optics.camera.wavelength * _cells.telecentric_distance(optics.camera)
    least = max(axis.samples, farthest * axis.size / squared)
    parts = 1 if lattice.layout == "square" else (2, 2 * lattice.kinds)[which]
    return parts * _fast(math.ceil(least / parts))


@dataclass(frozen=True)
class WaveImage:
    """Of a wave of amplitude 1; what pixels make of its angles is theirs of light that leans by `tilt`."""

    optics: Optics
    sides: tuple[Side, Side]
    tilt: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, optics: Optics, pitches: float) -> "WaveImage":
        """With light followed for so many pitches."""
        return cls(optics, (Side.of(optics, 0, pitches), Side.of(optics, 1, pitches)))

    def amplitude(self) -> np.ndarray:
        """On the cells of the shorter array (cells, samples, cells, samples)."""
        (y, x), total = self.sides, 0.0
        for number, focal_length in enumerate(focal_lengths(self.optics.array)):
            places = np.zeros((y.length, x.length), np.complex64)
            mine = self._places(number)
            places[y.number(mine[:, 0]), x.number(mine[:, 1])] = 1
            image = _around(self.one[focal_length], places.shape, (y.reach, x.reach))
            total = total + arrays.fft2(image) * arrays.fft2(places)
        image = arrays.ifft2(np.asarray(total), overwrite=True)
        image = image[: y.cells * y.axis.samples, : x.cells * x.axis.samples]
        return image.reshape(y.cells, y.axis.samples, x.cells, x.axis.samples)

    def aside(self) -> float:
        """Part of the light on an endless array that goes farther than it is followed, as pixels count it."""
        if (pixels := self._lenslets.pixels) is not None:
            sent = replace(self, optics=without_angles(self.optics)).aside()
            return sent * float(pixels[0].amplitude(self.farthest / pixels[1])) ** 2
        (y, x), lattice, total = self.sides, self.optics.array.lattice, 0.0
        shape = y.axis.samples, x.axis.samples
        ends = [(s.first, s.first + s.axis.size * (1 - 1e-6)) for s in self.sides]
        pairs = lattice.indices(ends[0], ends[1])
        focal = focal_lengths(self.optics.array)
        kinds = lattice.kind(pairs[:, 0], pairs[:, 1]) % len(focal)
        for kind, place in zip(kinds, lattice.position(pairs), strict=True):
            shift = [int(side.number(place[k])) for k, side in enumerate(self.sides)]
            image = _around(self.one[focal[kind]], shape, (y.reach, x.reach))
            total = total + np.roll(image, shift, (0, 1))
        return max(0.0, 1 - float(np.mean(np.abs(total) ** 2, dtype=np.float64)) / self.through)

    @property
    def farthest(self) -> float:
        """Where half of the light has faded out [m]."""
        return self.sides[0].axis.neighbourhood * (1 - FADING / 2)

    @property
    def samples(self) -> int:
        """Of the wave's image, or of a lenslet's where that is larger, all in all."""
        return math.prod(max(side.length, 2 * side.reach + 1) for side in self.sides)

    @property
    def through(self) -> float:
        """Part of the light on the lenslets that goes through them."""
        return self._open() / self.optics.array.lattice.cell_area

    def _open(self) -> float:
        """Area of a lenslet [m²]."""
        lattice, fill = self.optics.array.lattice, self.optics.array.fill_factor
        if self.optics.array.shape == "square":
            return math.prod(lattice.pitches) * fill**2
        _, weight, chords = self._lenslets.lines
        return float(2 * weight @ chords)

    def _places(self, kind: int) -> np.ndarray:
        """Of the lenslets of a kind (n, 2) [m]."""
        lattice, kinds = self.optics.array.lattice, len(focal_lengths(self.optics.array))
        pairs = lattice.indices(self.sides[0].limits, self.sides[1].limits)
        return lattice.position(pairs[lattice.kind(pairs[:, 0], pairs[:, 1]) % kinds == kind])

    @cached_property
    def one(self) -> dict[float, np.ndarray]:
        """Amplitude (y, x) around a lenslet of each focal length."""
        return {f: self._one(f).astype(np.complex64) for f in focal_lengths(self.optics.array)}

    @cached_property
    def _lenslets(self) -> CellLenslets:
        distance, axes = _cells.telecentric_distance(self.optics.camera), [side.axis for side in self.sides]
        return CellLenslets(
            (axes[0], axes[1]), self.optics.array, self.optics.camera.wavelength, distance,
            _cells.accepted(self.optics.camera),
        )  # fmt: skip

    def _one(self, focal_length: float) -> np.ndarray:
        array = self.optics.array
        if array.shape == "square":
            halves = [array.fill_factor * pitch / 2 for pitch in array.lattice.pitches]
            return np.outer(*(self._along(k, half, focal_length) for k, half in enumerate(halves)))
        (lines, weight, chords), wavelength = self._lenslets.lines, self._lenslets.optics[0]
        different, like = np.unique(chords.round(12), return_inverse=True)
        behind = np.array([self._along(1, chord, focal_length) for chord in different.tolist()])[like]
        bend = weight * np.exp(-1j * np.pi * lines**2 / (wavelength * focal_length))
        return (self.sides[0].spread(lines, self._lenslets, self.tilt[0]) * bend) @ behind

    def _along(self, which: int, half: float, focal_length: float) -> np.ndarray:
        """Amplitude (samples,) along an axis behind a line of a lenslet."""
        side, wavelength = self.sides[which], self._lenslets.optics[0]
        at, weight = legendre(-half, half, nodes(half, focal_length, side.axis, self._lenslets.optics))
        weight = weight * np.exp(-1j * np.pi * at**2 / (wavelength * focal_length))
        return side.spread(at, self._lenslets, self.tilt[which]) @ weight


def without_angles(optics: Optics) -> Optics:
    """The same before pixels that respond alike to all angles."""
    sensor = replace(optics.camera.sensor, angular_response=None)
    return replace(optics, camera=replace(optics.camera, sensor=sensor))


def _around(image: np.ndarray, shape: tuple[int, int], reach: tuple[int, int]) -> np.ndarray:
    """The image of a lenslet at (0, 0) of a plane that comes round to itself."""
    tiles = [math.ceil(n / m) for n, m in zip(image.shape, shape, strict=True)]
    whole = np.zeros([n * m for n, m in zip(tiles, shape, strict=True)], image.dtype)
    whole[: image.shape[0], : image.shape[1]] = image
    folded = whole.reshape(tiles[0], shape[0], tiles[1], shape[1]).sum((0, 2))
    return np.roll(folded, (-reach[0], -reach[1]), (0, 1))
