r"""White images before lenslets: the evenly lit stop of the main lens, without speckle.

It is the image H of one wave along the axis, averaged over the image of the stop (docs/theory/periodic.md),

.. math:: I(s) = \frac{4}{\pi D^2} \int_{|u| < D/2} |H(s + b u / L)|^2 \, d^2u,

which multiplies its frequencies by 2 J₁(x)/x. A stop that each field sees as another ellipse (`stops`)
averages it differently over the field. What lenslets send farther than they are followed falls on all
cells around; its faint fringes are left out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy import fft

from lumigraph.core import arrays
from lumigraph.operators.lenslets import stops
from lumigraph.operators.lenslets.wave_image import FADING, WaveImage
from lumigraph.operators.periodic.coherent import disc
from lumigraph.operators.periodic.glare import fallen
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import HasOptics
from lumigraph.operators.sampling.cells import check_alike
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.tiles import readout

ASIDE = 0.16
"""Of the light through lenslets with opaque rims, 1/n of this goes farther than n λb/p (square and round)."""

FRINGES = 0.15
"""Of the light that goes far, rms of its fringes over its mean (square and round: 0.11 to 0.16)."""

PROMISED = 0.8
"""Part of the accuracy that the fringes may take."""

FARTHER = 1.6
"""How much farther than in the operator light is followed: the border shines far into a white image."""

NEARER = 0.75
"""How far light is followed, over how far it is in the image, in one that is set beside it."""

ENDING = 0.35
"""Where light is followed so much less than until all of it arrives unfaded, or more, the two differ by what
the better one misses behind opaque rims; nearer to its end by more, in proportion."""

FADED = 0.5
"""The same where edges meet: light that fades then is that of few lenslets, far aside, and falls fast."""

SLOWLY = 1.7
"""How much more is missed than that behind discs, and hexagons with gaps, whose light falls off slowly."""

LEAST = 2.2e-6
"""Error that is left where all light is followed: single precision, 1e-6 to 2.5e-6 of 60 drawn cameras."""

RIMS, SMOOTH = 6.0, 2.0
"""Error of the samples behind opaque rims over the accuracy's square, and the number p²/(λb) from which it
falls as its inverse square: 0.003 to 0.19 of 1e-2, 0.002 to 0.02 of 3e-3."""

LEANS = (3, 4, 5, 7)
"""Places along each axis of the stop that waves come from before pixels that respond to angles: tried."""

LARGEST = 2.0**25
"""Samples of a wave's image."""


def white_image(camera: HasOptics, accuracy: float) -> np.ndarray:
    """Raw image (ny, nx) of light of 1 on the lenslets."""
    optics = _of(camera, accuracy)
    return _followed(optics, _pitches(optics), stops.of(optics))[0]


def image_and_error(camera: HasOptics, accuracy: float) -> tuple[np.ndarray, float]:
    """`white_image`, and its relative rms error.

    What comes from farther than light is followed is estimated by following it less far; besides, fringes
    are left out.
    """
    optics = _of(camera, accuracy)
    pitches, stop = _pitches(optics), stops.of(optics)
    raw, fringes = _followed(optics, pitches, stop)
    off = math.hypot(fringes, LEAST, _sampled(optics), leans(optics)[1], stop.left)
    if share := _missed(optics, pitches):
        nearer, _ = _followed(optics, NEARER * pitches, stop)
        off = math.hypot(
            off, share * float(np.linalg.norm(raw - nearer)) / (float(np.linalg.norm(raw)) or 1.0)
        )
    return raw, off


def _missed(optics: Optics, pitches: float) -> float:
    """Part of what following light less far changes that the image misses itself."""
    left = max(0.0, 1 - pitches / _across(optics))
    if _cells.edges(optics.array) == "meet":
        return left * min(1.0, left / FADED) ** 3
    return min(1.0, left / ENDING) * (SLOWLY if _cells.edges(optics.array) == "other" else 1.0)


def _sampled(optics: Optics) -> float:
    """Error of the samples, relative rms: next to none but behind opaque straight rims."""
    if _cells.edges(optics.array) != "straight":
        return 0.0
    return RIMS * optics.fineness.accuracy**2 * min(1.0, SMOOTH / _cells.fresnel_number(optics.camera)) ** 2


def _of(camera: HasOptics, accuracy: float) -> Optics:
    camera = camera.optics()
    check_alike(camera)
    return Optics.of(camera, camera.object_distance, accuracy)


def _followed(optics: Optics, pitches: float, stop: stops.Stops) -> tuple[np.ndarray, float]:
    """Raw image of light that is followed so far, and the relative rms of the fringes that it lacks."""
    cells, wave = optics.cells, WaveImage.of(optics, pitches)
    far = _far(wave)[:, None, :, None]
    image = _over_cells(wave, optics, stop) + wave.aside() * wave.through * stop.area * far
    image = image.reshape([n * k for n, k in zip(cells.image, cells.samples, strict=True)])
    raw = readout(optics).forward(image.astype(np.float32) / optics.image_scale**2)
    return raw, FRINGES * _aside(optics, pitches) * float(far.max())


def endless(optics: Optics) -> tuple[np.ndarray, float]:
    """Image (kinds, samples) in a cell of each kind, of light of 1 on lenslets that go on for ever.

    And how much of it comes from farther than the operator follows light from lenslets.
    """
    lattice, cells = optics.array.lattice, optics.cells
    rows, columns = 1 + cells.staggered, lattice.kinds if cells.staggered else 1
    period = replace(
        cells, size=(rows * cells.size[0], columns * cells.size[1]), count=(1, 1), ring=(0, 0),
        samples=(rows * cells.samples[0], columns * cells.samples[1]), staggered=False, kinds=1,
    )  # fmt: skip
    followed = optics.axes[0].neighbourhood
    optics = replace(optics, array=replace(optics.array, extent=None), cells=period)
    wave = WaveImage.of(optics, _pitches(optics))
    aside = wave.aside() * wave.through / optics.image_scale**2
    image = _through_stop(wave, optics)[0, :, 0] / optics.image_scale**2 + aside
    tiles = image[: cells.samples[0]].reshape(cells.samples[0], columns, cells.samples[1])
    first = [cells.columns(cells.ring[1], cells.ring[1] + columns, 0, k)[0] for k in range(cells.kinds)]
    pictures = np.array([tiles[:, k - cells.ring[1]].ravel() for k in first])
    return pictures, aside * wave.farthest / followed


def _pitches(optics: Optics) -> float:
    """Distance to which light is followed [pitches]: by the accuracy, within the image and the memory."""
    array = optics.array
    number, rims = _cells.fresnel_number(optics.camera), _cells.edges(array)
    pitches = FARTHER * optics.fineness.neighbours(number, 0.0, rims)
    pitches += optics.spill / array.lattice.pitch
    pitches = max(pitches, FRINGES * _aside(optics, 1.0) / (PROMISED * optics.fineness.accuracy))
    pitches = min(pitches, _across(optics))
    while pitches > 2 and WaveImage.of(optics, pitches).samples > LARGEST:
        pitches *= 0.9
    return pitches


def _across(optics: Optics) -> float:
    """Distance from which all light arrives unfaded, across the longer side of the image's cells [pitches].

    Infinite where lenslets go on for ever.
    """
    cells, array = optics.cells, optics.array
    if not array.extent:
        return math.inf
    return max(map(math.prod, zip(cells.image, cells.size, strict=True))) / array.lattice.pitch / (1 - FADING)


def _aside(optics: Optics, pitches: float) -> float:
    """Part of the light that goes so far from lenslets with an opaque rim; next to none does from others."""
    array = optics.array
    if array.shape != "round" and array.fill_factor == 1:
        return 0.0
    return ASIDE / (array.fill_factor * _cells.fresnel_number(optics.camera) * pitches)


def _stop_radius(optics: Optics) -> float:
    """Radius of the stop's image behind a lenslet [m]."""
    camera = optics.camera
    return camera.pupil_diameter / 2 * _cells.telecentric_distance(camera) / camera.separation


def _far(wave: WaveImage) -> np.ndarray:
    """Light of all lenslets in each cell of the image, from farther than they are followed: up to 1."""
    cells, reach = wave.optics.cells, wave.sides[0].axis.neighbourhood
    if wave.sides[0].endless:
        return np.ones(cells.image)
    from scipy.signal import fftconvolve  # it brings scipy.stats: a quarter of a second for every camera

    y, x = (np.arange(1 - n, n) * size for n, size in zip(cells.image, cells.size, strict=True))
    distance = np.hypot(y[:, None], x)
    law = fallen(distance, reach) * math.prod(cells.size)
    there = np.pad(np.ones(cells.count), [(r, r) for r in cells.ring])
    return fftconvolve(there, law, mode="same")


def _over_cells(wave: WaveImage, optics: Optics, stop: stops.Stops) -> np.ndarray:
    """Intensity (cells, samples, cells, samples), with the stop that each cell sees."""
    rows, columns = (side.like for side in wave.sides)
    if not stop.ellipses:
        return _through_stop(wave, optics)[rows][:, :, columns]
    even, total = _Even.of(np.abs(wave.amplitude()) ** 2, optics), 0.0
    for ellipse, weight in zip(stop.ellipses, stop.weights, strict=True):
        short = even.averaged(ellipse.transform)
        total = total + weight[:, None, :, None].astype(np.float32) * short[rows][:, :, columns]
    return np.asarray(total)


def _through_stop(wave: WaveImage, optics: Optics) -> np.ndarray:
    """Mean intensity (cells, samples, cells, samples) of waves from all over the stop.

    All have the same image but for its place, unless pixels respond to angles: then what waves from some
    places along each axis of the stop bring is interpolated between them (Lagrange).
    """
    if _cells.accepted(optics.camera) is None:
        even = _Even.of(np.abs(wave.amplitude()) ** 2, optics)
        return even.averaged(stops.disc_of(_stop_radius(optics)))
    total, edge = np.zeros(()), _stop_radius(optics) / _cells.lenslet_distance(optics.camera)
    places = leans(optics)[0]
    for down, across in product(range(len(places)), repeat=2):
        tilted = replace(wave, tilt=(edge * places[down], edge * places[across]))
        even = _Even.of(np.abs(tilted.amplitude()) ** 2, optics)
        lean = _lagrange(places, down), _lagrange(places, across)
        total = total + even.averaged(_Leaning(_stop_radius(optics), lean))
    return total


def leans(optics: Optics) -> tuple[np.ndarray, float]:
    """Places in the stop (n,), of its half, and what pixels' response is off between them, of it.

    As few as leave the accuracy, all over the light that a lenslet sends to its own image; what most of it
    leaves is a third of that.
    """
    if (pixels := _cells.accepted(optics.camera)) is None:
        return np.zeros(1), 0.0
    response, distance = pixels
    stop, lenslet = _stop_radius(optics) / distance, optics.array.lattice.pitch / 2 / distance
    at, aside = np.linspace(-1, 1, 101), np.linspace(0, lenslet, 51)[:, None]
    true, places, left = response.amplitude(aside - stop * at) ** 2, np.zeros(1), 0.0
    for count in LEANS:
        places = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        known = response.amplitude(aside - stop * places) ** 2
        found = known @ np.array([_lagrange(places, k)(at) for k in range(count)])
        left = math.sqrt(2 * float(np.mean((found - true) ** 2) / np.mean(true**2)))
        if left < optics.fineness.accuracy:
            break
    return places, left


Weight = Callable[[np.ndarray], np.ndarray]
"""By the place in the stop along an axis, of its half."""


@dataclass(frozen=True, slots=True)
class _Leaning:
    """Transform of weights along both axes, over a disc of a radius [m]."""

    radius: float
    lean: tuple[Weight, Weight]

    def __call__(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Transform at frequencies (y, x) [1/m]."""
        turns = 2 * math.pi * self.radius * max(np.abs(y).max(), np.abs(x).max())
        angles, place, shares = disc(48 + math.ceil(1.2 * turns))
        down, across = np.sin(angles), place
        weights = shares * self.lean[0](down)[:, None] * self.lean[1](across)
        left, right = (
            np.exp(2j * np.pi * self.radius * np.outer(f, at)) for f, at in ((y, down), (x, across))
        )
        return left @ weights @ right.T


def _lagrange(places: np.ndarray, number: int) -> Weight:
    """Polynomial that is 1 at one of some places and 0 at the others."""
    others = np.delete(places, number)
    return lambda at: np.prod((at[:, None] - others) / (places[number] - others), axis=1)


@dataclass(frozen=True, slots=True)
class _Frequencies:
    """Frequencies of an image along one axis, with dark cells beside it into which it may spread.

    Parameters
    ----------
    optics, which
        Of the cells; the axis.
    cells, found
        Cells, and samples of each that the image has now.
    """

    optics: Optics
    which: int
    cells: int
    found: int

    @property
    def samples(self) -> int:
        """Samples of each cell that it gets."""
        return self.optics.cells.samples[self.which]

    @property
    def _all(self) -> int:
        if self.optics.array.extent is None:
            return self.cells
        return self.cells + 1 + math.ceil(_stop_radius(self.optics) / self.optics.cells.size[self.which])

    @property
    def given(self) -> int:
        """Samples of the image."""
        return self.cells * self.found

    @property
    def fine(self) -> int:
        """The same with the dark cells."""
        return self._all * self.found

    @property
    def coarse(self) -> int:
        """Samples that all cells get."""
        return self._all * self.samples

    @property
    def length(self) -> float:
        """Length of all cells [m]."""
        return self._all * self.optics.cells.size[self.which]

    @property
    def number(self) -> np.ndarray:
        """Periods along the length, of the frequencies that are kept (coarse,), in the order of an FFT."""
        return np.round(fft.fftfreq(self.coarse) * self.coarse).astype(int)

    def moved(self) -> np.ndarray:
        """Phase (coarse,) from the middle of the fine samples to the coarse ones', times counts' ratio."""
        shift = 1 / self.coarse - 1 / self.fine
        return np.exp(1j * np.pi * self.number * shift) * (self.coarse / self.fine)


@dataclass(frozen=True, slots=True)
class _Even:
    """Transform of the image of one wave, at the frequencies that the samples of an operator hold."""

    spectrum: np.ndarray
    y: _Frequencies
    x: _Frequencies

    @classmethod
    def of(cls, image: np.ndarray, optics: Optics) -> "_Even":
        """Transform of an image (cells, samples, cells, samples)."""
        y, x = (_Frequencies(optics, k, *image.shape[2 * k : 2 * k + 2]) for k in (0, 1))
        spectrum = arrays.rfft2(image.reshape(y.given, x.given), (y.fine, x.fine))
        spectrum = spectrum[y.number][:, : x.coarse // 2 + 1]
        spectrum *= np.outer(y.moved(), x.moved()[: x.coarse // 2 + 1])
        return cls(spectrum, y, x)

    def averaged(self, stop: stops.Transform) -> np.ndarray:
        """Mean (cells, samples, cells, samples) over the image of a stop."""
        y, x = self.y, self.x
        spectrum = self.spectrum.copy()
        spectrum *= stop(y.number / y.length, (x.number / x.length)[: x.coarse // 2 + 1])
        found = arrays.irfft2(spectrum, (y.coarse, x.coarse))
        tiles = found.reshape(-1, y.samples, x.coarse // x.samples, x.samples)
        return tiles[: y.cells, :, : x.cells]
