"""Raw images of cameras 2.0 as depth needs them: grey, even in noise, without the shading of micro-images."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import convolve1d, spline_filter1d

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.raw import RawImage
from lumigraph.rendering.interpolate import as_float

_spline: Any = spline_filter1d

Pair = tuple[np.ndarray, np.ndarray]

_POWERS = 5  # of the square of the distance from a centre: light falls steeply at the edge
_EVEN = 0.95  # of the middle's light: less comes from lenslets that are lit in part
_SPARE = 1.5  # px from the edge of the lit part of a micro-image
_FALL_OFF = 0.2, 1.3  # of the mean light: what is darker is not made brighter
_CHANCE = 2.0  # standard errors below which shading is chance
_BRIGHT = 0.98  # part of the pixels of a ring that are darker than what lights it


@dataclass(frozen=True)
class Flat:
    """Square roots (y, x) of a raw image over its white, as bright at the edge of micro-images as inside.

    `radius` is how far lenslets show it [px from a centre], `even` how far all of a lenslet is lit: beyond,
    it sees a place through one side only, which moves what is not in focus. `fall_off` are the factors of
    even powers of the distance, in half pitches, of the light that had reached them there.
    """

    image: np.ndarray
    radius: float
    even: float
    fall_off: np.ndarray

    @classmethod
    def of(cls, raw: RawImage, calibration: Calibration) -> "Flat":
        """A raw image, divided by how light falls off from the middle of its micro-images to their edge.

        That shading stands still while details move from one micro-image to the next, and would pull patches
        to 0. Without a white image it is what all micro-images have in common. A white image that has been
        divided out gives it, and how far all of a lenslet is lit.
        """
        image, divisor = grey(raw), raw.divisor if isinstance(raw, PreparedImage) else None
        shaded = image if divisor is None else divisor.astype(np.float32)
        (i, j), (dy, dx) = _places(image.shape, calibration)
        radius = lit_radius(shaded, calibration, np.hypot(dy, dx))
        half = np.float32(calibration.lattice.pitch / 2)
        way = dy / half, dx / half
        lenslet = (i - i.min()) * (np.ptp(j) + 1) + j - j.min()
        factors = _light(shaded, way, np.hypot(*way) < radius / half, lenslet)
        terms = zip(factors, _shapes(*way), strict=True)
        light = sum((np.float32(factor) * term for factor, term in terms), np.float32(0))
        even = image if divisor is not None else image / np.clip(light, *_FALL_OFF)
        flat = cls(np.sqrt(even), radius, radius, factors[:_POWERS])
        steps = np.linspace(0, radius, 101, dtype=np.float32)
        dim = np.flatnonzero(flat.light(steps / half) < _EVEN * flat.light(np.zeros(1, np.float32)))
        return replace(flat, even=max(float(steps[dim[0]]), radius / 2) if len(dim) else radius)

    @cached_property
    def finer(self) -> np.ndarray:
        """The image by cubic splines at whole and half pixels (2 y - 1, 2 x - 1).

        Read linearly between these it errs a quarter as much: finest textures are not taken for noise.
        """
        return _halved(_halved(self.image, 0), 1)

    def light(self, distance: np.ndarray) -> np.ndarray:
        """Part of the light that reaches places at a distance from a centre, in half pitches."""
        return np.clip(np.polyval(np.float32(self.fall_off[::-1]), distance**2), *_FALL_OFF)


def grey(raw: RawImage) -> np.ndarray:
    """A raw image (y, x) over its white, the mean of its colours, float32."""
    image = to_numpy(as_float(raw.data)).astype(np.float32)
    image = np.maximum(image.mean(2) if image.ndim == 3 else image, 0)
    return image / np.float32(float(np.quantile(image, 0.999)) or 1.0)


def _halved(image: np.ndarray, axis: int) -> np.ndarray:
    """An image and, between its samples along an axis, its cubic spline."""
    spline: np.ndarray = _spline(image, 3, axis, np.float32)
    between = convolve1d(spline, [1 / 48, 23 / 48, 23 / 48, 1 / 48, 0], axis, mode="mirror")
    out = np.insert(between, range(image.shape[axis]), image, axis)
    return np.ascontiguousarray(np.delete(out, -1, axis))


def _shapes(dy: np.ndarray, dx: np.ndarray) -> list[np.ndarray]:
    """Even powers of the distance from a centre, and a tilt, for a middle that is off it."""
    square = dy**2 + dx**2
    return [*(square**k for k in range(_POWERS)), dy, dx]


def _light(
    image: np.ndarray, way: tuple[np.ndarray, np.ndarray], inside: np.ndarray, lenslet: np.ndarray
) -> np.ndarray:
    """Factors of the shapes that make up the light over the mean of the lit part.

    Each micro-image is projected on shapes that are orthogonal over it. What their mean has of each beyond
    its own standard error is shading; the rest is chance, of a scene with few lenslets.
    """
    seen = np.stack([shape[inside] for shape in _shapes(*way)], -1).astype(float)
    alone = np.eye(seen.shape[1])[0]
    if len(seen) <= seen.shape[1]:
        return alone
    turn = np.linalg.inv(np.linalg.cholesky(seen.T @ seen / len(seen)).T)
    orthogonal, lit, lenslet = seen @ turn, image[inside], lenslet[inside]
    sums = np.stack([np.bincount(lenslet, lit * shape) for shape in orthogonal.T])
    if not sums[0].sum() > 0:
        return alone
    own = sums[:, sums[0] > 0] / sums[0, sums[0] > 0].mean()
    mean, chance = own.mean(1), own.std(1) / math.sqrt(own.shape[1])
    part = mean * np.maximum(1 - (_CHANCE * chance / np.maximum(np.abs(mean), 1e-12)) ** 2, 0)
    part[0] = 1
    return turn @ part


def _places(shape: tuple[int, ...], calibration: Calibration) -> tuple[Pair, Pair]:
    """The lenslet (i, j) of each pixel (y, x), and the way to it from its centre, along y and x [px]."""
    y, x = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in shape), indexing="ij", sparse=True)
    i, j = calibration.index(y, x)
    center = calibration.position(np.stack([i, j], -1)).astype(np.float32)
    return (i, j), (y - center[..., 0], x - center[..., 1])


def lit_radius(image: np.ndarray, calibration: Calibration, distance: np.ndarray | None = None) -> float:
    """Radius of the lit part of the micro-images of an image (y, x) [px], a pixel and a half from their edge.

    `distance` (y, x) of each pixel from its centre is found where None.
    """
    half = calibration.lattice.pitch / 2
    if calibration.fill is not None:
        return min(1.0, calibration.fill) * half - _SPARE
    distance = np.hypot(*_places(image.shape, calibration)[1]) if distance is None else distance
    rings = np.rint(distance).astype(np.int32)
    profile = np.array([np.quantile(image[rings == k], _BRIGHT) for k in range(int(half) + 1)])
    dark = np.flatnonzero(profile < 0.5 * np.median(profile))
    return min(half, float(dark[0]) if len(dark) else half) - _SPARE
