"""White images of a bench measured as by `twin`, up to whole lenslets of the shift."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.ndimage import uniform_filter

from lumigraph.core.arrays import to_numpy
from lumigraph.core.lattice import Layout
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.instruments import LensletCamera
from lumigraph.instruments.telecentric import is_telecentric
from lumigraph.metrology.alignment.matching import growing, matched, whole_windows
from lumigraph.metrology.alignment.rays import MEASURES, BenchRays
from lumigraph.metrology.alignment.stood import white_of
from lumigraph.metrology.twin import CAUSES, BenchModel, leaning_centers, leaning_lattice, shown

_STOP = 0.04  # part of the stop by which it is opened and closed, for the width's derivative
_FARTHEST = 4  # whole lenslets by which an array may be shifted
_NOISE = 0.0025
"""Noise of the camera file's white image, of its brightest pixel: it decides what is used."""

_TILT = 5e-5
"""Error of tilts [rad] from which on a picture is compared with a predicted one, pixel by pixel."""

_LEFT = 3e-6, 1e-4, 1e-4  # px of lattice vectors, origin and slope that such a comparison may err by
_SATURATED = 1e-3
"""Part of the pixels from which on a picture is too bright."""

_LIT = 0.4
"""Light in the middle of a lit micro-image at least, over the usual one's."""

_UNSEEN = 10.0  # growth of widths that one picture alone does not show
_FEWEST = 16  # micro-images that are compared at least
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
    matched
        Whether it was compared with a predicted picture: then pixels make no errors of their own.
    """

    values: np.ndarray
    errors: np.ndarray
    reach: float
    lenslets: tuple[int, int] | None
    centers: np.ndarray
    brightness: float
    matched: bool = False


@dataclass(frozen=True, eq=False)  # without slots: it keeps what is computed
class WhiteReader:
    """Reader of white images of a bench.

    Parameters
    ----------
    camera
        What the bench is meant to be; of a microscope, its `white_camera`.
    dark
        Picture without light; None for the sensor's black level.
    """

    camera: LensletCamera
    dark: RawImage | None = None

    @cached_property
    def _start(self) -> "tuple[WhiteReading, _Lit]":
        light = BenchModel(self.camera).white(np.zeros(len(CAUSES)))
        first, lit = self._measured(_noisy(light, 0))
        return first, lit

    @cached_property
    def rays(self) -> BenchRays:
        """The bench by its rays, from white images of the camera file with its stop, and with two others."""
        start, _ = self._start
        model = BenchModel(self.camera)
        lights = [_noisy(model.white([*6 * [0.0], one]), 0) for one in (_STOP, -_STOP)]
        opened = [self._measured(light)[0].values[8] / start.values[8] - 1 for light in lights]
        first, second = (opened[0] - opened[1]) / (2 * _STOP), (opened[0] + opened[1]) / (2 * _STOP**2)
        optics = self.camera.optics()
        lengths = (optics.separation, float(optics.lenslet_distance or 0), self.camera.sensor.pixel_pitch)
        growing = np.zeros(2 * is_telecentric(self.camera))
        measures = np.concatenate([start.values, growing])
        return BenchRays(lengths, measures, start.reach, (float(first), float(second)))

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
            found, lit = self._measured(light)
        except CalibrationError as error:
            raise CalibrationError(f"the white image shows no lattice of micro-images: {error}") from None
        lenslets = self._whole(lit)
        values, errors = found.values.copy(), np.hypot(found.errors, self._start[0].errors)
        values[6:8] *= (self.rays.reach / found.reach) ** 2
        if lenslets is not None:
            values[4:6] += np.array(lenslets) @ values[:4].reshape(2, 2)
        errors[:4] = np.hypot(errors[:4], _PERIODIC)
        errors[4:6] = np.hypot(errors[4:6], _PLACED)
        unseen = len(self.rays.start) - MEASURES
        values, errors = np.append(values, unseen * [0.0]), np.append(errors, unseen * [_UNSEEN])
        return replace(found, values=values, errors=errors, reach=self.rays.reach, lenslets=lenslets)

    def matched(self, image: np.ndarray, reading: WhiteReading, state: np.ndarray) -> WhiteReading:
        """Measures of the same image (y, x) beside the one that `STATES` (10,) near the truth predict.

        The reading itself where it is sure of the tilts anyway, or where the prediction is another picture.
        """
        rays, telecentric = self.rays, is_telecentric(self.camera)
        lever = rays.reach**2 * rays.lengths[2] / sum(rays.lengths[:2])
        if reading.errors[6:8].max() < _TILT * lever and not telecentric:
            return reading
        light, predicted = self._bare(image, None), white_of(self.camera, state)
        numbers, middle = rays.measures(state), np.array([n // 2 for n in light.shape])
        centers = leaning_centers(numbers, self._array, rays.reach) + middle
        half = int(math.sqrt(abs(np.linalg.det(numbers[:4].reshape(2, 2)))) / 2) - 1
        whole = whole_windows(centers, half, light.shape)
        index, centers = self._array[whole], centers[whole]
        if len(index) < _FEWEST or not (seen := matched(light, predicted, centers, half)).near:
            return reading
        placed = centers + seen.displacement - middle
        found, errors = leaning_lattice(placed, index, rays.reach, numbers[:8])
        values, deviations = reading.values.copy(), reading.errors.copy()
        values[:8], deviations[:8] = found, np.hypot(errors, np.repeat(_LEFT, (4, 2, 2)))
        if telecentric:
            growth, error = growing((centers - middle) / rays.reach, seen.widening)
            values[MEASURES:], deviations[MEASURES:] = numbers[MEASURES:] + growth / self._widening, error
        return replace(reading, values=values, errors=deviations, matched=True)

    @cached_property
    def _array(self) -> np.ndarray:
        """Indices (k, 2) of the lenslets whose micro-images the camera file shows."""
        _, lit = self._start
        return lit.index[lit.lit].astype(float)

    @cached_property
    def _widening(self) -> float:
        """Widening that `matched` finds, over that of the micro-images' whole images."""
        model, centers = BenchModel(self.camera), self._start[0].centers
        lights = [model.white([*6 * [0.0], one]) for one in (0.0, _STOP / 4)]
        half = int(math.sqrt(abs(np.linalg.det(self.rays.start[:4].reshape(2, 2)))) / 2) - 1
        whole = whole_windows(centers, half, lights[0].shape)
        return float(np.mean(matched(lights[1], lights[0], centers[whole], half).widening)) / (_STOP / 4)

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

    def _measured(self, white: np.ndarray) -> "tuple[WhiteReading, _Lit]":
        camera = self.camera
        return _measured(white, camera.lenslets.layout, camera.micro_image_pitch / camera.sensor.pixel_pitch)

    def _whole(self, lit: "_Lit") -> tuple[int, int] | None:
        """Whole lenslets by which an array with these lit micro-images is shifted."""
        array = self._array.astype(int)
        if len(array) != math.prod(self.camera.lenslets.count or (0, 0)):
            return None  # the array ends outside the picture
        reach = int(np.abs(lit.index).max() + np.abs(array).max()) + _FARTHEST
        there = np.zeros((2 * reach + 1, 2 * reach + 1), bool)
        there[tuple((array + reach).T)] = True
        span = range(-_FARTHEST, _FARTHEST + 1)
        score = {
            one: int((there[tuple((lit.index - one + reach).T)] == lit.lit).sum())
            for one in product(span, span)
        }
        (best, most), (_, next_most) = sorted(score.items(), key=lambda one: -one[1])[:2]
        return best if most - next_most >= _CLEARLY else None


@dataclass(frozen=True, slots=True, eq=False)
class _Lit:
    """Indices (k, 2) of lenslets whose micro-images are in the picture, and whether they are lit (k,)."""

    index: np.ndarray
    lit: np.ndarray


def _measured(white: np.ndarray, layout: Layout, pitch: float) -> tuple[WhiteReading, _Lit]:
    """Measures, and which micro-images are lit, counted from the one nearest to the middle."""
    seen = shown(white, layout, pitch)
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
