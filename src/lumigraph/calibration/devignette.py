"""Divide out what the lenslets and the main lens do to a uniform white."""

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, is_complex, like, namespace, to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError


def devignette(
    raw: RawImage | Array,
    white: RawImage | Array,
    *,
    dark: RawImage | Array | None = None,
    floor: float = 0.1,
) -> RawImage:
    """Raw image divided by the white image, so that a uniform scene gives uniform pixels.

    The white image is scaled to 1 at its 99th percentile, each colour (of a Bayer pattern too) by itself,
    so that the colours of the raw image stay. Pixels whose white is below `floor` (the gaps between
    micro-images) are divided by `floor`: they stay dark instead of becoming noise.

    Parameters
    ----------
    raw
        Picture (y, x[, c]); its array library is kept, its values become float32.
    white
        Picture of a uniform scene with the same settings, of the same shape, or (y, x) for a colour raw.
    dark
        Picture taken with the lens covered; subtracted from both.
    floor
        Smallest divisor, between 0 and 1.

    Raises
    ------
    CalibrationError
        Another shape, NaN or infinite values, a white image without light, or a floor outside 0 to 1.

    Examples
    --------
    >>> import numpy as np
    >>> white = np.tile([[100.0, 50.0], [50.0, 25.0]], (8, 8))
    >>> float(np.ptp(devignette(2 * white, white).data))
    0.0
    """
    return divided(raw, white, dark=dark, floor=floor)[0]


def divided(
    raw: RawImage | Array,
    white: RawImage | Array,
    *,
    dark: RawImage | Array | None = None,
    floor: float = 0.1,
) -> tuple[RawImage, np.ndarray]:
    """`devignette`, and what it divides by (y, x[, c])."""
    raw, white = as_raw(raw), as_raw(white)
    if not 0 < checks.finite("floor", floor, "1", CalibrationError) < 1:
        raise CalibrationError(f"floor is {floor:g} but must be between 0 and 1, such as 0.1.")
    pictures = {"raw": raw, "white": white}
    if dark is not None:
        pictures["dark"] = as_raw(dark)
    for name, picture in pictures.items():
        check_alike(name, picture, raw)
    data = namespace(raw.data).astype(raw.data, namespace(raw.data).float32)
    if dark is not None:
        data = data - like(_aligned(np.asarray(to_numpy(pictures["dark"].data), np.float64), raw), data)
    divisor = np.maximum(light_of(white, pictures.get("dark"), raw.bayer), floor)
    found = data / like(_aligned(divisor, raw), data)
    return RawImage(found, raw.pixel_pitch, None, raw.bayer, dict(raw.metadata)), divisor


def light_of(white: RawImage, dark: RawImage | None = None, bayer: str | None = None) -> np.ndarray:
    """White image above its dark one (y, x[, c]), each colour 1 at its 99th percentile.

    Parameters
    ----------
    white, dark
        Pictures of one size.
    bayer
        Colours of the white image's pixels where it does not say so itself.

    Raises
    ------
    CalibrationError
        A white image without light.
    """
    level = np.array(to_numpy(white.data), np.float64)
    if dark is not None:
        level = level - _aligned(np.asarray(to_numpy(dark.data), np.float64), white)
    return _normalised(level, white.bayer or bayer)


def as_raw(image: RawImage | Array) -> RawImage:
    """The image as a `RawImage`, whatever it came as."""
    return image if isinstance(image, RawImage) else RawImage(image)


def grey(white: RawImage) -> np.ndarray:
    """White image (y, x) as one grey float32 picture, each colour scaled by its own mean first.

    Without the scaling, a Bayer pattern's green pixels would look like a lattice of pitch 2 px.
    """
    data = np.asarray(to_numpy(white.data), np.float32)
    if data.ndim == 3:
        means = data.mean((0, 1))
        return np.mean(data / np.where(means > 0, means, 1), -1)
    if white.bayer is None:
        return data
    result = np.empty_like(data)
    for phase in _phases(white.bayer):
        mean = data[phase].mean()
        result[phase] = data[phase] / (mean if mean > 0 else 1)
    return result


def _phases(bayer: str | None) -> list[tuple[slice, slice]]:
    """Slices of the four Bayer colours; one of the whole picture without a pattern."""
    if bayer is None:
        return [(slice(None), slice(None))]
    return [(slice(row, None, 2), slice(column, None, 2)) for row in (0, 1) for column in (0, 1)]


def check_alike(name: str, picture: RawImage, raw: RawImage) -> None:
    """Refuse a white or dark image of another size than the raw image, complex, or with unusable values."""
    shape, expected = tuple(picture.data.shape), tuple(raw.data.shape)
    if shape not in (expected, expected[:2]):
        raise CalibrationError(
            f"the {name} image has shape {shape} but the raw image {expected}. "
            f"Use the {name} image taken with the same camera settings."
        )
    if is_complex(picture.data):
        raise CalibrationError(f"the {name} image is complex. Give its intensity.")
    checks.brightness(f"the {name} image", picture.data, CalibrationError)


def _aligned(values: np.ndarray, picture: RawImage) -> np.ndarray:
    """Grey values (y, x) made to broadcast against a colour picture."""
    return values[..., None] if values.ndim < len(picture.data.shape) else values


def _normalised(level: np.ndarray, bayer: str | None) -> np.ndarray:
    result = np.empty_like(level)
    for phase in _phases(bayer if level.ndim == 2 else None):
        top = np.percentile(level[phase], 99, axis=(0, 1))
        if np.any(top <= 0):
            raise CalibrationError(
                f"the white image has no light: its 99th percentile is {float(np.min(top)):g} above dark. "
                "Take a picture of an evenly lit white surface."
            )
        result[phase] = level[phase] / top
    return result
