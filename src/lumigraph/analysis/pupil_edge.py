"""Directional resolution of lenslets: the main lens' stop as their micro-images show it."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import erf
from scipy.stats import t as student

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.short_repr import brief
from lumigraph.errors import CalibrationError

LEAST_PITCH = 6.0
"""Least pitch of micro-images [px]: smaller ones have no profile."""

_STRIP = 0.06  # pitches on either side of the line between two centres, or half a pixel
_BIN = 0.1  # px along it
_APART = 2.0  # blurs: stops that end so far from each other leave dark between them, which the floor is
_SECTORS = 4  # of the picture, each measured by itself
_PER_SIGMA = 2 * math.sqrt(2 * math.log(2))


@dataclass(frozen=True, slots=True, eq=False)
class PupilEdge:
    """The edges of micro-images on a white image; errors are half the 95 % intervals.

    Parameters
    ----------
    pitch
        From one micro-image to the next [px].
    width, width_error
        Of a micro-image, where it has half its brightness [px].
    blur, blur_error
        Full width at half maximum of what a direction is spread over [px]: diffraction, defocus of the stop
        and the pixel's own width together.
    position, profile
        From the middle of one micro-image to the next [px], and the mean light there over that of the middle.
    """

    pitch: float
    width: float
    width_error: float
    blur: float
    blur_error: float
    position: np.ndarray
    profile: np.ndarray

    __repr__ = brief

    @property
    def directions(self) -> float:
        """Directions that are resolved across a micro-image: its width over the blur."""
        return self.width / self.blur

    @property
    def directions_error(self) -> float:
        """Half the 95 % interval of `directions`."""
        return self.directions * math.hypot(self.width_error / self.width, self.blur_error / self.blur)

    def cross_talk(self, view: float = 1.0) -> float:
        """Part of a direction's light that falls outside the view it belongs to, `view` pixels wide."""
        checks.positive("view", view, "px")
        return 1 - float(erf(view / 2 / (math.sqrt(2) * self.blur / _PER_SIGMA)))

    @property
    def spill(self) -> float:
        """Part of a micro-image's light, along one axis, that falls into the two beside it."""
        sigma = self.blur / _PER_SIGMA
        z = (self.pitch - self.width) / 2 / sigma
        tail = math.exp(-(z**2) / 2) / math.sqrt(2 * math.pi) - z * (1 - float(erf(z / math.sqrt(2)))) / 2
        return 2 * sigma * tail / self.width


def pupil_edge(white: np.ndarray, calibration: Calibration, kind: int | None = None) -> PupilEdge:
    r"""Width and blur of micro-images, along their rows, from a white image.

    The stop of the main lens is a sharp edge in direction. Between two centres a pitch P apart the light is
    that of two stops of half width h, each blurred by a normal distribution,

    .. math:: B + A\,\big[\Phi((h - t)/\sigma) + \Phi((t - P + h)/\sigma)\big]

    B is 0 where micro-images touch: there a floor cannot be separated from their sum. Pitches are not whole
    numbers of pixels, so that many micro-images together sample the profile more finely than the pixels do.
    Intervals come from the scatter over four sectors of the picture.

    Parameters
    ----------
    white
        (y, x), linear in light and less its dark image.
    calibration
        Of that image.
    kind
        Of the lenslets whose edges are measured, in an array of three kinds; None for all.

    Raises
    ------
    CalibrationError
        Micro-images of less than 6 px, fewer than three in a sector, or no dip between them.
    """
    data, pitch = np.asarray(to_numpy(white), np.float64), calibration.lattice.pitches[1]
    if pitch < LEAST_PITCH:
        raise CalibrationError(
            f"micro-images are {pitch:.3g} px wide, but {LEAST_PITCH:g} px are needed to see their edges."
        )
    start, end = _neighbours(calibration, kind)
    sector = _sector((start + end) / 2, calibration.shape)
    parts = [sector == k for k in range(_SECTORS)]
    if min(np.sum(one) for one in parts) < 3:
        raise CalibrationError("there are too few whole micro-images for the profile of their edges.")
    sums = [_along(data, start[one], end[one], pitch) for one in parts]
    whole, *lines = (_profile(*one) for one in (np.sum(sums, 0), *sums))
    if kind is not None:
        whole, *lines = (_near(*line, pitch) for line in (whole, *lines))
    fits = np.array([fitted(*line, pitch) for line in lines])
    width, blur = fitted(*whole, pitch)
    wide = float(student.ppf(0.975, _SECTORS - 1)) / math.sqrt(_SECTORS)
    errors = wide * fits.std(0, ddof=1)
    return PupilEdge(pitch, width, float(errors[0]), blur, float(errors[1]), *whole)


def _near(at: np.ndarray, light: np.ndarray, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """A profile whose farther half is the nearer one, mirrored."""
    near = at < pitch / 2
    return np.append(at[near], pitch - at[near]), np.append(light[near], light[near])


def _neighbours(calibration: Calibration, kind: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 2) of whole micro-images, and of those next to them along their row; both, of one kind."""
    rows, columns = calibration.shape
    margin = calibration.lattice.pitch / 2
    whole = ((margin, rows - 1 - margin), (margin, columns - 1 - margin))
    index = calibration.indices_within(*whole)
    index = index[~calibration.misses(index)]
    beside = index + np.array([0, 1])
    if kind is not None:
        index = index[calibration.lattice.kind(*index.T) == kind]
        beside = np.concatenate([index + np.array([0, 1]), index - np.array([0, 1])])
        index = np.concatenate([index, index])
    at = calibration.position(beside)
    inside = ((at >= margin) & (at <= [rows - 1 - margin, columns - 1 - margin])).all(1)
    inside &= ~calibration.misses(beside)
    return calibration.position(index[inside]), at[inside]


def _sector(at: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return 2 * (at[:, 0] > shape[0] / 2) + (at[:, 1] > shape[1] / 2)


def _along(data: np.ndarray, start: np.ndarray, end: np.ndarray, pitch: float) -> np.ndarray:
    """Number of pixels, and sum of their light over that of the middles, in each bin between neighbours."""
    reach = int(pitch / 2) + 1
    square = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
    pixels = np.rint((start + end) / 2).astype(int)[:, None] + square
    way = (end - start) / np.hypot(*(end - start).T)[:, None]
    offset = pixels - start[:, None]
    along = (offset * way[:, None]).sum(-1)
    aside = offset[..., 0] * way[:, None, 1] - offset[..., 1] * way[:, None, 0]
    rows, columns = data.shape
    seen = (np.abs(aside) <= strip(pitch)) & (along >= 0) & (along <= pitch)
    seen &= ((pixels >= 0) & (pixels < [rows, columns])).all(-1)
    value = data[tuple(np.clip(pixels, 0, [rows - 1, columns - 1]).transpose(2, 0, 1))]
    flat = seen & ((along < pitch / 5) | (along > pitch * 4 / 5))
    level = (value * flat).sum(1) / np.maximum(flat.sum(1), 1)
    seen &= (level > 0)[:, None]
    number = (along[seen] / _BIN).astype(int)
    bins = int(pitch / _BIN) + 1
    light = np.bincount(number, (value / np.where(level > 0, level, 1)[:, None])[seen], bins)
    return np.stack([np.bincount(number, minlength=bins), light])


def _profile(count: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places between neighbours [px], and the mean light there."""
    filled = count > 0
    return (np.flatnonzero(filled) + 0.5) * _BIN, light[filled] / count[filled]


def strip(pitch: float) -> float:
    """Distance from the line between two centres within which light counts [px]."""
    return max(0.5, _STRIP * pitch)


def fitted(at: np.ndarray, light: np.ndarray, pitch: float) -> tuple[float, float]:
    """Width and blur [px] of a profile from the middle of one micro-image to the next, as of `PupilEdge`.

    Raises
    ------
    CalibrationError
        No dip between them.
    """
    top, low = float(np.quantile(light, 0.9)), float(light[np.abs(at - pitch / 2) < pitch / 8].min())
    if top - low < 0.05 * top:
        raise CalibrationError(
            "no dark is seen between micro-images: their edges cannot be measured. Stop the main lens down."
        )

    def edge(t: np.ndarray) -> np.ndarray:
        return (1 + erf(t / math.sqrt(2))) / 2

    def solved(floor: bool) -> np.ndarray:
        def off(numbers: np.ndarray) -> np.ndarray:
            h, sigma, a, b = numbers
            return b * floor + a * (edge((h - at) / sigma) + edge((at - pitch + h) / sigma)) - light

        start = [0.45 * pitch, 0.05 * pitch, top, low * floor]
        ends = ([0.05 * pitch, 0.01 * pitch, 0, -top], [0.75 * pitch, pitch, 10 * top, top])
        return least_squares(off, start, bounds=ends, loss="soft_l1", f_scale=0.05 * top).x

    found = solved(floor=False)
    if pitch - 2 * found[0] > _APART * 2 * found[1]:
        found = solved(floor=True)
    return 2 * float(found[0]), _PER_SIGMA * float(found[1])
