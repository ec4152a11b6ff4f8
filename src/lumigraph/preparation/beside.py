"""The pictures that come with a raw image: `Beside`."""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.calibration.devignette import check_alike, light_of
from lumigraph.core import checks
from lumigraph.core.arrays import is_complex, like, namespace, to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.sensor import demosaic, levels

_BELOW = 0.1  # of the spread of a raw image's values: noise about 0 has a mean within
_LOOKED_AT = 4e6  # values; of larger pictures some rows are


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """White and dark image of one exposure and one zoom."""

    white: RawImage | None = None
    dark: RawImage | None = None

    def check(self, raw: RawImage) -> None:
        """Refuse pictures of other sizes, and values that are not finite or too large to compute with."""
        if is_complex(raw.data):
            raise CalibrationError("the raw image is complex. Give its intensity.")
        checks.brightness("the raw image", raw.data, CalibrationError)
        for name, picture in (("white", self.white), ("dark", self.dark)):
            if picture is not None:
                check_alike(name, picture, raw)

    def doubt(self, raw: RawImage) -> str | None:
        """Warning text for a raw image darker on average than its dark level; None if it is not."""
        some = slice(None, None, math.ceil(math.prod(raw.data.shape) / _LOOKED_AT))
        values, dark = to_numpy(raw.data)[some], self.dark or black_plane(raw)
        black = 0.0 if dark is None else float(to_numpy(dark.data)[some].mean(dtype=float))
        mean, spread = float(values.mean(dtype=float)), float(values.std(dtype=float))
        if mean - black >= -_BELOW * spread:
            return None
        below = "below 0" if dark is None else f"less than its dark level, {black:g}"
        remedy = "Invert it back, or subtract less" if dark is None else "Give the dark image of its exposure"
        return f"the raw image is {mean:g} on average, {below}, which light never is. {remedy}."

    def light(self, raw: RawImage) -> np.ndarray | None:
        """White image above the dark (y, x), the brightest colour of it, 1 at full light."""
        if self.white is None:
            return None
        level = light_of(self.white, self.dark, raw.bayer)
        return level if level.ndim == 2 else level.max(-1)

    def notes(self, raw: RawImage, *, divide: bool) -> tuple[str, ...]:
        """Notes on how the dark and the white image are used."""
        done = ("subtracted", "divided out") if divide else ("in the model", "in the model")
        pictures = [("dark image", self.dark, done[0]), ("white image", self.white, done[1])]
        if self.dark is None:
            pictures[0] = ("recorded black level", black_plane(raw), done[0])
        found = [f"the {name} is {what}" for name, image, what in pictures if image is not None]
        return (*found, *(["the colour mosaic is demosaiced"] if divide and raw.bayer else []))


def black_plane(raw: RawImage) -> RawImage | None:
    """A dark image (y, x) made of the black level that a raw image records; None where it records none."""
    if not np.any(raw.metadata.get("black_level", 0.0)):
        return None
    tiles = [-(-n // 2) for n in raw.shape]
    ny, nx = raw.shape
    return RawImage(np.tile(levels(raw)[0], tiles)[:ny, :nx].astype(np.float32))


def above(raw: RawImage, dark: RawImage) -> RawImage:
    """The raw image less the dark one, as float32."""
    xp = namespace(raw.data)
    data = xp.astype(raw.data, xp.float32)
    black = np.asarray(to_numpy(dark.data), np.float64)
    black = black[..., None] if black.ndim < data.ndim else black
    return RawImage(data - like(black, data), raw.pixel_pitch, None, raw.bayer, raw.metadata)


def coloured(even: RawImage, raw: RawImage) -> RawImage:
    """The colours of an evenly lit mosaic above its dark; 1 is what fills a pixel of the raw image.

    Parameters
    ----------
    even
        Values above the dark, over the white image.
    raw
        Raw image as it was read: its bits and recorded levels say what is full.
    """
    black, white = levels(raw)
    if raw.bit_depth is None and "white_level" not in raw.metadata:
        white = np.full_like(white, max(1.0, float(to_numpy(raw.data).max())))
    (ny, nx), data = raw.shape, np.asarray(to_numpy(even.data), np.float32)
    full = np.tile(white - black, (-(-ny // 2), -(-nx // 2)))[:ny, :nx].astype(np.float32)
    # Light over a vignetted white image exceeds what a pixel can hold: it is scaled down, not cut off.
    most = max(1.0, float((data / full).max()))
    recorded = {**raw.metadata, "black_level": 0.0, "white_level": most}
    found = demosaic(replace(even, data=data / full, metadata=recorded))
    known = {**raw.metadata, "demosaiced": found.metadata["demosaiced"]}
    return replace(found, data=found.data * np.float32(most), metadata=known)
