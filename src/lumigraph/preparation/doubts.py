"""Pictures that were mixed up: white image and raw image, white image and dark image, no dark image."""

import math

import numpy as np
from scipy import ndimage

from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.preparation.beside import ReferenceImages, black_plane

_ALIKE = 0.2  # correlation of neighbouring pixels below which a picture is noise
_TEXTURE, _TIMES = 0.05, 2.0
"""Relative contrast from lenslet to lenslet that no white image has, and how many times the raw image's."""

_DIFFERENT, _FEWEST = 0.2, 12
"""Difference of brightness, as a share of the white image's, of tiles that show an offset; how many."""

_SEEN, _SURE = 0.01, 6.0
"""An offset that is worth a word, as a share of the raw image's range, and in standard errors."""

_RISE, _ALIKE_FLOORS = 0.1, 0.2
"""Rise of the tiles' brightness, as a share of the range, that shows a floor; spread of it, at most."""

_MOST_TILES, _WINDOW = 60, 5  # along each axis; tiles that are averaged for what is smooth


def check_kinds(raw: RawImage, beside: ReferenceImages) -> None:
    """Refuse a dark image in the place of the white one.

    Raises
    ------
    CalibrationError
        Levels of both, and what to give.
    """
    if beside.white is None:
        return
    light, scene = _grey(beside.white), _grey(raw)
    white, mean = float(light.mean()), float(scene.mean())
    if beside.dark is not None and (dark := float(_grey(beside.dark).mean())) > white:
        raise CalibrationError(
            f"the white image is {white:.4g} on average, darker than the dark image, {dark:.4g}. Swap the "
            "two, or give pictures of one exposure."
        )
    if light.std() > 0 and white < mean and (alike := _neighbours(light)) < _ALIKE:
        raise CalibrationError(
            f"the white image looks like a dark image: {white:.4g} on average where the raw image has "
            f"{mean:.4g}, and its pixels are noise (neighbours correlate by {alike:.2f}). Give it as the "
            "dark image, and a picture of an evenly lit surface as the white one."
        )


def doubts_of(raw: RawImage, beside: ReferenceImages, pitch: float) -> tuple[str | None, ...]:
    """Lines on what looks wrong with the pictures, None each where nothing does.

    Parameters
    ----------
    raw, beside
        The pictures.
    pitch
        Of the micro-images [px].
    """
    swapped = mixed_up(raw, beside.white, pitch)
    return swapped, None if swapped else left_in(raw, beside, pitch)


def mixed_up(raw: RawImage, white: RawImage | None, pitch: float) -> str | None:
    """Warning where the white image shows a scene and the raw image shows none; else None.

    Parameters
    ----------
    raw, white
        Of one size.
    pitch
        Of the micro-images [px].
    """
    if white is None:
        return None
    of_white, of_raw = (_texture(_grey(one), pitch) for one in (white, raw))
    if of_white is None or of_raw is None or of_white < max(_TEXTURE, _TIMES * of_raw):
        return None
    return (
        f"the white image varies by {of_white:.1%} from lenslet to lenslet, the raw image by {of_raw:.1%}: "
        "the two look swapped. Give the picture of the evenly lit surface as the white image."
    )


def left_in(raw: RawImage, beside: ReferenceImages, pitch: float) -> str | None:
    """Warning of an offset of the sensor that no dark image takes away; else None.

    In a small tile the raw image is b + r (white - b): what remains where its pixels have no light, over
    1 - r, is b for every tile, however bright.

    Parameters
    ----------
    raw, beside
        The pictures.
    pitch
        Of the micro-images [px].
    """
    if beside.white is None or beside.dark is not None or black_plane(raw) is not None:
        return None
    light, scene = _grey(beside.white), _grey(raw)
    slopes, rests = _lines(_tiles(light, pitch), _tiles(scene, pitch))
    good = np.isfinite(slopes) & (np.abs(1 - slopes) > _DIFFERENT)
    if good.sum() < _FEWEST:
        return None
    found = rests[good] / (1 - slopes[good])
    offset = float(np.median(found))
    error = 1.4826 * float(np.median(np.abs(found - offset))) / math.sqrt(good.sum())
    wide = float(np.quantile(scene, 0.99) - np.quantile(scene, 0.01))
    if (
        offset < _SEEN * wide
        or offset < _SURE * error
        or offset > float(np.quantile(light, 0.05)) + 3 * error
    ):
        return None
    return (
        f"raw image and white image both have an offset of about {offset:.3g}, {offset / wide:.1%} of the "
        "raw image's range, which is no light: it makes what is dark too bright. Give the dark image."
    )


def floor_under(raw: RawImage, beside: ReferenceImages, pitch: float) -> str | None:
    """Note on a floor under the raw image, where there is neither a white nor a dark image.

    Gaps between micro-images are dark: where the darkest pixels of all tiles are alike, however bright the
    brightest ones are, they show the floor.

    Parameters
    ----------
    raw, beside
        The pictures.
    pitch
        Of the micro-images [px].
    """
    if beside.white is not None or beside.dark is not None or black_plane(raw) is not None:
        return None
    scene = _grey(raw)
    floors, tops = np.quantile(_tiles(scene, pitch), (0.02, 0.9), axis=(2, 3)).reshape(2, -1)
    dim, bright = np.quantile(tops, (0.2, 0.8))
    offset, least, most = (float(value) for value in np.quantile(floors, (0.5, 0.05, 0.95)))
    wide = float(np.quantile(scene, 0.99) - np.quantile(scene, 0.01))
    alike = most - least < _ALIKE_FLOORS * min(offset, bright - dim)
    if len(tops) < _FEWEST or offset < _SEEN * wide or bright - dim < _RISE * wide or not alike:
        return None
    return (
        f"the raw image has a floor of about {offset:.3g}, {offset / wide:.1%} of its range, however bright "
        "its parts are: an offset of the sensor, or light everywhere. Give the dark image if the sensor's"
    )


def _grey(image: RawImage) -> np.ndarray:
    values = np.asarray(to_numpy(image.data), np.float32)
    return values if values.ndim == 2 else values.mean(-1)


def _neighbours(values: np.ndarray) -> float:
    """Correlation of neighbouring pixels along the axis along which they are less alike; outliers are cut."""
    low, high = np.quantile(values, (0.001, 0.999))
    cut = np.clip(values, low, high if high > low else values.max())
    if cut.std() == 0:
        return 1.0
    pairs = ((cut[:, 1:], cut[:, :-1]), (cut[1:], cut[:-1]))
    found = [float(np.corrcoef(a.ravel(), b.ravel())[0, 1]) for a, b in pairs if a.std() and b.std()]
    return min(found, default=1.0)


def _tiles(values: np.ndarray, pitch: float) -> np.ndarray:
    """Square tiles (n, m, side, side) of two pitches or more."""
    side = max(math.ceil(2 * pitch), math.ceil(max(values.shape) / _MOST_TILES))
    side = min(side, min(values.shape))
    ny, nx = (n // side for n in values.shape)
    return values[: ny * side, : nx * side].reshape(ny, side, nx, side).swapaxes(1, 2)


def _texture(values: np.ndarray, pitch: float) -> float | None:
    """Relative rms contrast of tiles against what is smooth; None of less than four by four."""
    tiles = _tiles(values, pitch).mean((2, 3), dtype=float)
    if min(tiles.shape) < 4:
        return None
    smooth = ndimage.uniform_filter(tiles, _WINDOW, mode="nearest")
    lit = smooth > 0.2 * smooth.max()
    return float(np.std(tiles[lit] / smooth[lit])) if lit.sum() > 4 and smooth.max() > 0 else None


def _lines(light: np.ndarray, scene: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slope and rest of the straight line of the raw image over the white one, for each tile."""
    x, y = (one.reshape(-1, one.shape[-1] ** 2).astype(float) for one in (light, scene))
    mx, my = x.mean(1, keepdims=True), y.mean(1, keepdims=True)
    spread = ((x - mx) ** 2).mean(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.where(spread > 0, ((x - mx) * (y - my)).mean(1) / spread, np.nan)
    return slopes, my[:, 0] - slopes * mx[:, 0]
