"""Recognition of raw images of a plenoptic camera 2.0, whose micro-images are sharp pictures."""

import math
import warnings

import numpy as np

from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.errors import SamplingWarning
from lumigraph.rendering.interpolate import sample

_MOST_PAIRS = 200
_WINDOW = 0.42  # of the pitch: half the side of the square piece of a micro-image that is compared
_LEAST_SHIFT = 4.0  # pixels: with less, an edge is not seen to be narrower than the shift
_SHIFTS = 0.1, 0.6  # of the pitch
_LEAST_CORRELATION = 0.6
_LEAST_CONTRAST = 0.02  # of the micro-images, rms: white images have none
_LEAST_LIT = 0.5  # part of the micro-images that show something: points before a dark ground tell nothing
_NARROW = 0.82  # width of edges over the shift: 0.9 and more in all 1.0 images tried, 0.3 to 0.76 in 2.0 ones


def warn_if_focused(data: Array, calibration: Calibration) -> None:
    """Warn where the micro-images of a raw image (y, x[, c]) are sharp pictures of the scene.

    A lenslet of a camera 1.0 gathers the light of one pitch, so that it blurs an object out of focus by just
    as much as the object is shifted from its micro-image to the next one's: the slope of a micro-image never
    exceeds its range over that shift. Lenslets that image the scene onto the sensor do not blur it, and
    edges are narrower than the shift.
    """
    found = focused_shift(data, calibration)
    if found is None:
        return
    warnings.warn(
        "this looks like a raw image of a plenoptic camera 2.0: neighbouring micro-images show the same "
        f"sharp details, {abs(found):.1f} px apart. Use render with patch={found:.3g}, or go on if it is one "
        "of a camera 1.0.",
        SamplingWarning,
        stacklevel=3,
    )


def focused_shift(data: Array, calibration: Calibration) -> float | None:
    """Shift between neighbouring micro-images of a 2.0 image [px], the patch of `render`; None of others."""
    picture = np.asarray(to_numpy(data), float)
    picture = picture.mean(-1) if picture.ndim == 3 else picture
    pairs = _pairs(picture, calibration)
    if pairs is None:
        return None
    first, second = pairs
    if not min(float(first.std()), float(second.std())) > _LEAST_CONTRAST:
        return None
    contrasts = first.std((1, 2))
    if np.mean(contrasts > 0.05 * contrasts.max()) < _LEAST_LIT:
        return None
    shift, likeness = _shift(first, second, calibration)
    ranges = np.ptp(first, axis=(1, 2))
    slopes = [np.abs(np.diff(first, axis=axis)).max((1, 2)) for axis in (1, 2)]
    strong = ranges >= np.median(ranges)
    edge = float(np.median(ranges[strong] / np.maximum(np.maximum(*slopes)[strong], 1e-300)))
    is_focused = likeness > _LEAST_CORRELATION and edge < _NARROW * abs(shift)
    return shift if is_focused and abs(shift) >= _LEAST_SHIFT else None


def _pairs(picture: np.ndarray, calibration: Calibration) -> tuple[np.ndarray, np.ndarray] | None:
    """Pieces (k, n, n) of micro-images and of their neighbours along the row, without their mean shading."""
    half = int(_WINDOW * calibration.lattice.pitch)
    low, high = half + 1, np.array(calibration.shape) - 2 - half
    if min(high) <= low:
        return None
    indices = calibration.indices_within((low, high[0]), (low, high[1]))
    beside = calibration.position(indices + np.array((0, 1)))
    indices = indices[((beside >= low) & (beside <= high)).all(1)]
    if len(indices) < 4:
        return None
    indices = indices[np.linspace(0, len(indices) - 1, min(_MOST_PAIRS, len(indices))).astype(int)]
    offsets, pieces = np.arange(-half, half + 1), []
    for step in (0, 1):
        y, x = calibration.position(indices + np.array((0, step))).T[:, :, None, None]
        piece = sample(picture, y + offsets[:, None], x + offsets, "linear")
        shading = piece.mean(0)
        if (most := float(shading.max())) <= 0:
            return None
        piece = piece / np.maximum(shading, 0.1 * most)
        pieces.append(piece - piece.mean((1, 2), keepdims=True))
    return pieces[0], pieces[1]


def _shift(first: np.ndarray, second: np.ndarray, calibration: Calibration) -> tuple[float, float]:
    """Shift of details along the row from one piece (k, n, n) to the next [px], and their correlation."""
    size, pitch = first.shape[-1], calibration.lattice.pitch
    shape = (2 * size, 2 * size)

    def correlation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.fft.irfft2(np.conj(a) * b, shape)

    spectra = [np.fft.rfft2(piece, shape) for piece in (first, second)]
    ones = np.fft.rfft2(np.ones((size, size)), shape)
    energies = [np.fft.rfft2((piece**2).sum(0), shape) for piece in (first, second)]
    cross = np.fft.irfft2((np.conj(spectra[0]) * spectra[1]).sum(0), shape)
    energy = np.maximum(correlation(energies[0], ones), 0) * np.maximum(correlation(ones, energies[1]), 0)
    likeness = np.fft.fftshift(cross / np.sqrt(np.maximum(energy, 1e-6 * energy.max())))
    dy, dx = np.meshgrid(*(np.arange(-size, size),) * 2, indexing="ij")
    y, x = calibration.lattice.basis[0]
    length = math.hypot(y, x)
    along, across = (dy * y + dx * x) / length, (dy * x - dx * y) / length
    near = (np.abs(across) <= 1.5) & (np.abs(along) >= _SHIFTS[0] * pitch)
    near &= np.abs(along) <= _SHIFTS[1] * pitch
    best = int(np.argmax(np.where(near, likeness, -np.inf)))
    return float(along.flat[best]), float(likeness.flat[best])
