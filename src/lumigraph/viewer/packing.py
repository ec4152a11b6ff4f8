"""Encoding of arrays in a page that is written: without loss, or as pictures."""

import numpy as np

from lumigraph.errors import LumigraphError
from lumigraph.viewer.encoding import Coded
from lumigraph.viewer.parts import Parts

LOSSLESS = 100

_EXACT_16 = 64 << 20  # bytes of 16-bit views that still go into a page without loss


def check_quality(quality: int) -> None:
    """Refuse a quality that is not from 1 to 100."""
    if not 1 <= quality <= LOSSLESS:
        raise LumigraphError(f"quality is {quality} but must be from 1 to 100.")


def packed(name: str, coded: Coded, part: Parts, quality: int) -> bytes:
    """An array as a blob: views (n, y, x[, c]) and pictures of them as WebP, all else without loss."""
    if name == "poster":  # stands until the views are there
        return coded.pictures(min(quality, LOSSLESS - 1))
    if name == "sharp" and quality < LOSSLESS:
        one = Coded(coded.numbers[None], coded.scale, coded.offset)
        return _eight_bits(one, part.about["views"]["white"]).pictures(quality)
    if name not in ("views", "stack") or (name == "stack" and "fallback" not in part.about["stack"]):
        return coded.deflated()
    small = coded.bits == 16 and coded.numbers.nbytes <= _EXACT_16 and name == "views"
    if quality == LOSSLESS or small:
        return coded.deflated()
    return _eight_bits(coded, part.about[name]["white"]).pictures(quality)


def _eight_bits(coded: Coded, white: float) -> Coded:
    """Numbers of 8 bits, 0 to white; those that have 8 bits stay as they are."""
    if coded.bits == 8:
        return coded
    pictures = [np.clip(coded.offset + coded.scale * p.astype(np.float32), 0, white) for p in coded.numbers]
    numbers = np.stack([np.rint(p / white * 255).astype(np.uint8) for p in pictures])
    return Coded(numbers, white / 255, 0.0)
