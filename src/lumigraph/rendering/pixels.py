"""Pixels that cannot be trusted: found, and filled from their neighbours."""

import numpy as np
from scipy.ndimage import median_filter

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, namespace, to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError

_REACH = 2  # pixels to either side that a bad pixel is filled from
_LEAST_CONTRAST = 4.0  # a hot pixel is as many times brighter than its neighbours' median, in a raw image


def hot_pixels(raw: RawImage | Array, *, dark: RawImage | Array | None = None, sigmas: float = 8.0) -> Array:
    """Mask (y, x) of hot pixels in a raw image, for ``decode(bad=...)``.

    With a dark image, those that stand out of it by `sigmas` robust standard deviations; without, single
    pixels of the raw image that do so over the median of their eight neighbours (of their own colour, where
    there is a Bayer pattern) and are four times as bright: a real detail is blurred over its neighbours.

    Parameters
    ----------
    raw
        Picture (y, x[, c]).
    dark
        Picture of the same size taken with the lens covered.
    sigmas
        Above 0.

    Raises
    ------
    CalibrationError
        Images of different sizes, or a number of sigmas that is not above 0.

    Examples
    --------
    >>> raw = np.ones((20, 20))
    >>> raw[3, 4] = 50
    >>> np.argwhere(hot_pixels(raw)).tolist()
    [[3, 4]]
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    checks.positive("sigmas", sigmas, "1", CalibrationError)
    image, least = raw, _LEAST_CONTRAST
    if dark is not None:
        image, least = dark if isinstance(dark, RawImage) else RawImage(dark), 0.0
        if image.shape != raw.shape:
            raise CalibrationError(
                f"the dark image has {image.shape[0]} x {image.shape[1]} pixels but the raw image "
                f"{raw.shape[0]} x {raw.shape[1]}. Take both with the same camera settings."
            )
    data = np.asarray(to_numpy(image.data), np.float32)
    data = data[..., None] if data.ndim == 2 else data
    found = np.zeros(image.shape, bool)
    step = 1 if raw.bayer is None else 2
    for channel in np.moveaxis(data, -1, 0):
        for y in range(step):
            for x in range(step):
                found[y::step, x::step] |= _standing_out(channel[y::step, x::step], sigmas, least)
    xp = namespace(raw.data)
    return xp.asarray(found, device=raw.data.device) if hasattr(raw.data, "device") else xp.asarray(found)


def _standing_out(picture: np.ndarray, sigmas: float, least: float) -> np.ndarray:
    around = np.ones((3, 3), bool)
    around[1, 1] = False
    usual = median_filter(picture, footprint=around, mode="mirror")
    excess = picture - usual
    spread = 1.4826 * float(np.median(np.abs(excess)))
    level = max(sigmas * spread, 1e-3 * float(np.abs(picture).max()))
    return (excess > level) & (picture > least * usual)


def checked_mask(bad: Array, raw: RawImage) -> np.ndarray:
    """The mask of bad pixels as true and false (y, x).

    Raises
    ------
    CalibrationError
        It has another size than the raw image, or leaves nothing.
    """
    checks.array("bad", bad, CalibrationError)
    mask = np.asarray(to_numpy(bad))
    if mask.shape != raw.shape:
        raise CalibrationError(
            f"bad has shape {mask.shape} but the raw image has {raw.shape[0]} x {raw.shape[1]} pixels. "
            "Give one true or false for each pixel."
        )
    mask = mask != 0
    if mask.all():
        raise CalibrationError("bad marks every pixel of the raw image. Give true for the bad ones only.")
    return mask


def repaired(data: Array, bad: np.ndarray) -> Array:
    """Image (y, x[, c]) whose bad pixels are the weighted mean of the good ones up to two pixels away.

    A pixel without good neighbours becomes 0. Nothing is interpolated where pixels are good.
    """
    xp, tail = namespace(data), data.ndim - 2
    good = like(np.pad(~bad, _REACH).astype(float), data)
    light = xp.where(_trailing(xp.asarray(bad, device=data.device), tail), xp.zeros_like(data), data)
    shape = (_REACH, data.shape[1], *data.shape[2:])
    light = xp.concat([like(np.zeros(shape), data), light, like(np.zeros(shape), data)], axis=0)
    shape = (light.shape[0], _REACH, *data.shape[2:])
    light = xp.concat([like(np.zeros(shape), data), light, like(np.zeros(shape), data)], axis=1)
    total, seen = xp.zeros_like(data), like(np.zeros(bad.shape), data)
    ny, nx = bad.shape
    for dy in range(2 * _REACH + 1):
        for dx in range(2 * _REACH + 1):
            weight = float(np.exp(-((dy - _REACH) ** 2 + (dx - _REACH) ** 2)))
            total = total + weight * light[dy : dy + ny, dx : dx + nx, ...]
            seen = seen + weight * good[dy : dy + ny, dx : dx + nx]
    seen = xp.where(seen > 0, seen, xp.ones_like(seen))
    return xp.where(_trailing(xp.asarray(bad, device=data.device), tail), total / _trailing(seen, tail), data)


def _trailing(values: Array, count: int) -> Array:
    xp = namespace(values)
    return xp.reshape(values, (*values.shape, *(1,) * count))
