"""White images of a bench measured as by `twin`, up to whole lenslets of the shift."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.ndimage import uniform_filter

from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.instruments import LensletCamera
from lumigraph.metrology.alignment.rays import MEASURES, BenchRays
from lumigraph.metrology.twin import CAUSES, BenchModel, shown

_STOP = 0.04  # part of the stop by which it is opened and closed, for the width's derivative
_FARTHEST = 4  # whole lenslets by which an array may be shifted
_NOISE = 0.0025
"""Noise of the camera file's white image, of its brightest pixel: it decides what is used."""

_TILT, _COPIES = 2e-5, 5  # rad by which such an image may err, and how many are averaged at most
_SATURATED = 1e-3
"""Part of the pixels from which on a picture is too bright."""

_LIT = 0.4
"""Light in the middle of a lit micro-image at least, over the usual one's."""

_CLEARLY = 5  # micro-images by which one shift fits better than the next
_PLACED = 1e-3  # px, as in `twin`
_PERIODIC = 5e-5  # px of lattice vectors: what pixels do to the fit of far and near lattices alike


@dataclass(frozen=True, slots=True, eq=False)
class WhiteReading:
    """Measures of one white image.

    Parameters
    ----------
    values, errors
        (9,) as `BenchRays.measures` has them, and their standard deviations [px].
    reach
        Distance from the middle that the slope refers to [px].
    lenslets
        Whole lenslets of the shift, in the origin already; None where the array's border is not seen.
    centers
        Micro-images (k, 2) [px].
    brightness
        Mean of the picture.
    """

    values: np.ndarray
    errors: np.ndarray
    reach: float
    lenslets: tuple[int, int] | None
    centers: np.ndarray
    brightness: float


@dataclass(frozen=True, eq=False)  # without slots: it keeps what is computed
class WhiteReader:
    """Reader of white images of a bench.

    Parameters
    ----------
    camera
        What the bench is meant to be.
    dark
        Picture without light; None for the sensor's black level.
    """

    camera: LensletCamera
    dark: RawImage | None = None

    @cached_property
    def _start(self) -> "tuple[WhiteReading, _Lit]":
        light = BenchModel(self.camera).white(np.zeros(len(CAUSES)))
        first, lit = _measured(_noisy(light, 0))
        b, pixel = self.camera.lenslet_distance, self.camera.sensor.pixel_pitch
        lever = first.reach**2 * pixel / (self.camera.separation + b)
        count = math.ceil((float(first.errors[6:8].max()) / (_TILT * lever)) ** 2)
        others = [_measured(_noisy(light, k))[0].values for k in range(1, min(count, _COPIES))]
        values, errors = np.mean([first.values, *others], 0), first.errors / math.sqrt(1 + len(others))
        return replace(first, values=values, errors=errors), lit

    @cached_property
    def rays(self) -> BenchRays:
        """The bench by its rays, from white images of the camera file with its stop, and with two others."""
        start, _ = self._start
        model = BenchModel(self.camera)
        lights = [_noisy(model.white([*6 * [0.0], one]), 0) for one in (_STOP, -_STOP)]
        opened = [_measured(light)[0].values[8] / start.values[8] - 1 for light in lights]
        first, second = (opened[0] - opened[1]) / (2 * _STOP), (opened[0] + opened[1]) / (2 * _STOP**2)
        optics = self.camera.optics()
        lengths = (optics.separation, float(optics.lenslet_distance or 0), self.camera.sensor.pixel_pitch)
        return BenchRays(lengths, start.values, start.reach, (float(first), float(second)))

    def read(self, image: np.ndarray, top: float | None = None) -> WhiteReading:
        """Measures of a white image (y, x).

        Parameters
        ----------
        image
            As the camera gives it.
        top
            Value of a saturated pixel.

        Raises
        ------
        CalibrationError
            Another size than the camera's sensor, too bright, too dark, or without a lattice.
        """
        light = self._bare(image, top)
        try:
            found, lit = _measured(light)
        except CalibrationError as error:
            raise CalibrationError(f"the white image shows no lattice of micro-images: {error}") from None
        lenslets = self._whole(lit)
        values, errors = found.values.copy(), np.hypot(found.errors, self._start[0].errors)
        values[6:8] *= (self.rays.reach / found.reach) ** 2
        if lenslets is not None:
            values[4:6] += np.array(lenslets) @ values[:4].reshape(2, 2)
        errors[:4] = np.hypot(errors[:4], _PERIODIC)
        errors[4:6] = np.hypot(errors[4:6], _PLACED)
        return replace(found, values=values, errors=errors, reach=self.rays.reach, lenslets=lenslets)

    def _bare(self, image: np.ndarray, top: float | None) -> np.ndarray:
        shape, data = self.camera.sensor.shape, np.asarray(image, float)
        if data.shape != shape:
            raise CalibrationError(
                f"the bench's picture has {' x '.join(map(str, data.shape))} pixels but the camera file "
                f"{shape[0]} x {shape[1]}. Correct its [sensor] shape, or the camera's region."
            )
        if top is not None and (part := float(np.mean(data >= top))) > _SATURATED:
            raise CalibrationError(
                f"{part:.1%} of the picture's pixels are saturated (at {top:g}). Shorten the exposure time."
            )
        dark = (
            self.camera.sensor.black_level
            if self.dark is None
            else np.asarray(to_numpy(self.dark.data), float)
        )
        return data - dark

    def _whole(self, lit: "_Lit") -> tuple[int, int] | None:
        """Whole lenslets by which an array with these lit micro-images is shifted."""
        array = {tuple(one) for one in self._start[1].index[self._start[1].lit].tolist()}
        if len(array) != math.prod(self.camera.lenslets.count or (0, 0)):
            return None  # the array ends outside the picture
        span = range(-_FARTHEST, _FARTHEST + 1)
        seen = list(zip(lit.index.tolist(), lit.lit.tolist(), strict=True))
        score = {
            (i, j): sum(((y - i, x - j) in array) == bright for (y, x), bright in seen)
            for i, j in product(span, span)
        }
        (best, most), (_, next_most) = sorted(score.items(), key=lambda one: -one[1])[:2]
        return best if most - next_most >= _CLEARLY else None


@dataclass(frozen=True, slots=True, eq=False)
class _Lit:
    """Indices (k, 2) of lenslets whose micro-images are in the picture, and whether they are lit (k,)."""

    index: np.ndarray
    lit: np.ndarray


def _measured(white: np.ndarray) -> tuple[WhiteReading, _Lit]:
    """Measures, and which micro-images are lit, counted from the one nearest to the middle."""
    seen = shown(white)
    found = seen.found
    assert found is not None  # `shown` gives it
    middle = np.array([n // 2 for n in white.shape], float)
    nearest = found.indices[np.argmin(np.hypot(*(found.centers - middle).T))]
    beyond = found.lattice.pitch / 4  # micro-images that the picture cuts still show at its border
    index = found.indices_within(*((-beyond, n - 1 + beyond) for n in white.shape))
    y, x = np.clip(np.rint(found.position(index)).astype(int), 0, np.array(white.shape) - 1).T
    light, usual = uniform_filter(white, 3), np.rint(found.centers).astype(int)
    lit = light[y, x] > _LIT * np.median(light[tuple(usual.T)])
    values, errors = seen.values[:MEASURES], seen.errors[:MEASURES]
    reading = WhiteReading(values, errors, seen.reach, None, found.centers, float(white.mean()))
    return reading, _Lit(index - nearest, lit)


def _noisy(light: np.ndarray, seed: int) -> np.ndarray:
    return light + _NOISE * light.max() * np.random.default_rng(seed).standard_normal(light.shape)
