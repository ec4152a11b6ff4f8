"""Valid pixels and lenslets of a raw image, judged by their light: `pixel_reasons`, `verdicts`."""

import math

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.prepared import Reason, Verdicts
from lumigraph.core.raw import RawImage
from lumigraph.core.saturation import saturation_level
from lumigraph.preparation.beside import ReferenceImages
from lumigraph.rendering import hot_pixels

DARK = 0.1
"""Part of full light below which a white image is dark, as `devignette` divides by no less."""

_BORDER = 8  # px: thinner borders of one value may be gaps between micro-images
_MOST = 0.5  # share of a lenslet's pixels of one reason from which it has that reason itself
_CORE = 0.35  # of the pitch around a lenslet's centre: what is looked at


def pixel_reasons(
    raw: RawImage, beside: ReferenceImages, calibration: Calibration | None, mask: np.ndarray | None = None
) -> np.ndarray:
    """A `Reason` for each pixel (y, x), uint8.

    Parameters
    ----------
    raw
        Raw image as it was read.
    beside
        Dark and white image: the white one shows what is dark, the dark one what is dead.
    calibration
        Calibration of the micro-images, if it is known.
    mask
        Pixels to use (y, x), true or false.
    """
    reasons = np.full(raw.shape, Reason.GOOD, np.uint8)
    if (light := beside.light(raw)) is not None:
        reasons[light < DARK] = Reason.DARK
    if calibration is not None:
        reasons[_cut(calibration)] = Reason.OUTSIDE
    if mask is not None:
        reasons[~mask] = Reason.MASKED
    values = to_numpy(raw.data)
    if (level := saturation_level(raw)) is not None:
        full = values >= level
        reasons[full if full.ndim == 2 else full.any(-1)] = Reason.SATURATED
    least = _BORDER if calibration is None else math.ceil(0.5 * calibration.lattice.pitch)
    reasons[_unread(values, least)] = Reason.DEAD
    if beside.dark is not None:
        reasons[to_numpy(hot_pixels(raw, dark=beside.dark))] = Reason.DEAD
    return reasons


def verdicts(reasons: np.ndarray, calibration: Calibration) -> Verdicts:
    """A `Reason` for each lenslet: the one that most of the pixels around its centre have.

    Those that the calibration misses are dark.
    """
    ny, nx = reasons.shape
    indices = calibration.indices_within((-0.5, ny - 0.5), (-0.5, nx - 0.5))
    reach = max(1, int(_CORE * calibration.lattice.pitch))
    steps = np.arange(-reach, reach + 1)
    centers = np.rint(calibration.position(indices)).astype(int)
    y = np.clip(centers[:, :1] + steps, 0, ny - 1)
    x = np.clip(centers[:, 1:] + steps, 0, nx - 1)
    seen = reasons[y[:, :, None], x[:, None, :]].reshape(len(indices), -1)
    found = np.full(len(indices), Reason.GOOD, np.uint8)
    for reason in (one for one in Reason if one is not Reason.GOOD and (reasons == one).any()):
        found[(seen == reason).mean(-1) > _MOST] = reason
    found[(found == Reason.GOOD) & calibration.misses(indices)] = Reason.DARK
    return Verdicts(indices, found)


def _cut(calibration: Calibration) -> np.ndarray:
    """Pixels (y, x) of lenslets whose centres are not on the picture; only its border is looked at."""
    ny, nx = calibration.shape
    wide = math.ceil(max(calibration.lattice.pitches)) + 1
    found = np.zeros((ny, nx), bool)
    for rows, columns in (
        (slice(0, min(wide, ny)), slice(0, nx)), (slice(max(ny - wide, 0), ny), slice(0, nx)),
        (slice(0, ny), slice(0, min(wide, nx))), (slice(0, ny), slice(max(nx - wide, 0), nx)),
    ):  # fmt: skip
        y, x = np.arange(ny)[rows, None] + 0.0, np.arange(nx)[None, columns] + 0.0
        centre = calibration.position(np.stack(calibration.index(y, x), -1))
        found[rows, columns] = ((centre < -0.5) | (centre > [ny - 0.5, nx - 0.5])).any(-1)
    return found


def _unread(values: np.ndarray, least: int) -> np.ndarray:
    """Borders (y, x) of at least so many rows or columns that hold one value: cropped, or not read out."""
    picture = values if values.ndim == 2 else values.max(-1)
    dead = np.zeros(picture.shape, bool)
    for axis in (0, 1):
        flat = picture.max(1 - axis) == picture.min(1 - axis)
        if flat.all():
            continue
        rows = np.moveaxis(dead, axis, 0)
        first, last = int(np.argmin(flat)), int(np.argmin(flat[::-1]))
        if first >= least:
            rows[:first] = True
        if last >= least:
            rows[len(rows) - last :] = True
    return dead
