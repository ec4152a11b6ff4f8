"""Light of each lenslet of a camera or microscope 1.0, and of which part of an object in focus it comes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure
from lumigraph.errors import CalibrationError
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.microscope import LightFieldMicroscope
from lumigraph.metrology.scanning.texture import SAMPLES, PicturePart, Textures
from lumigraph.operators.microscope.volume_operator import MicroscopeOperator

FAINT = 0.5
"""Light of a lenslet, over the median's, below which it does not count."""

FEWEST = 25
"""Lenslets."""

NEAR = 2
"""Distance to which a lenslet's footprint is followed [lenslets]."""

INNER = 0.4
"""Half of the part of micro-images that counts, along each axis, in pitches: towards their rims they hold
light of neighbours, which lenslets at the array's border lack."""

ACCURACY, SPILT = 1e-2, 1e-2
"""Accuracy of images, and part of a lenslet's light followed from beyond the microscope's lenslets."""

Lensed = LensletCamera | LightFieldMicroscope


@dataclass(frozen=True, slots=True, eq=False)
class LensletPixels:
    """Assignment of pixels to lenslets, and their images of the object.

    Parameters
    ----------
    labels, inner
        Number of the lenslet of each pixel (ny, nx), and how much of it counts, from 0 to 1.
    even
        Response of each pixel to an even object (ny, nx).
    places
        Positions of the lenslets in the object (n, 2) [lenslets].
    """

    labels: np.ndarray
    inner: np.ndarray
    even: np.ndarray
    places: np.ndarray
    textures: Textures

    @classmethod
    def of(cls, camera: Lensed) -> "LensletPixels":
        """Light of the lenslets on the camera's own pixels.

        Raises
        ------
        CalibrationError
            Fewer than 5 x 5 lenslets.
        """
        pixels = camera.calibration
        if len(pixels.indices) < FEWEST:
            raise CalibrationError(
                f"the camera has {len(pixels.indices)} lenslets, but shifts need {FEWEST} or more."
            )
        operator, grid = _flat(camera)
        y, x = np.meshgrid(*(np.arange(n) for n in pixels.shape), indexing="ij")
        whole = np.stack(pixels.index(y, x), -1).reshape(-1, 2)
        indices, labels = np.unique(whole, axis=0, return_inverse=True)
        labels = labels.reshape(pixels.shape)
        middle = pixels.indices[np.argmin(np.abs(pixels.indices - pixels.indices.mean(0)).sum(1))]
        away = np.abs(np.stack(pixels.offset(y, x)))
        inner = np.clip(INNER * pixels.lattice.pitch + 0.5 - away, 0, 1).prod(0)

        def shown(which: np.ndarray) -> np.ndarray:
            return np.asarray(operator.adjoint((inner * which[labels]).astype(np.float32)), np.float64)

        places = _places(indices, middle, grid, shown) / camera.lenslet_size
        footprint = _near(shown((indices == middle).all(1)))
        even = np.asarray(operator.forward(np.ones(grid.shape, np.float32)), np.float64)
        return cls(labels, inner, even, places, Textures.of(footprint))

    def seen(self, raws: Sequence[RawImage], exposures: Sequence[Exposure | None]) -> PicturePart:
        """Light of each lenslet that counts in all raw images, over its mean.

        Raises
        ------
        CalibrationError
            A raw image of another shape, an unknown gain, a dark one, or too few lenslets that count.
        """
        found = [
            self._of(raw, Exposure.of(raw) if one is None else one)
            for raw, one in zip(raws, exposures, strict=True)
        ]
        light, noise, even = (np.array(one) for one in zip(*found, strict=True))
        counts = (even > FAINT * np.median(even[even > 0])).all(0) if even.any() else np.zeros(0, bool)
        if counts.sum() < FEWEST:
            raise CalibrationError(
                f"{counts.sum()} lenslets count in all raw images, but shifts need {FEWEST} or more."
            )
        values, noise = light[:, counts] / even[:, counts], noise[:, counts] / even[:, counts] ** 2
        mean = float(values.mean())
        if not mean > 0:
            raise CalibrationError("the raw images are dark: shifts are unknown. Give more light.")
        noise = np.maximum(noise, 0.1 * noise.mean())
        return PicturePart(values / mean, noise / mean**2, self.places[counts], self.textures)

    def _of(self, raw: RawImage, known: Exposure) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Electrons of each lenslet, their variance, and what it shows of an even object."""
        data = np.asarray(to_numpy(raw.data), np.float64)
        if data.shape != self.labels.shape:
            raise CalibrationError(
                f"a raw image has shape {data.shape} but the camera's have {self.labels.shape}."
            )
        if known.gain is None:
            raise CalibrationError(
                "the gain of the raw images is unknown, and their noise. Give exposure=Exposure(gain=...)."
            )
        counts = np.ones(data.shape) if known.weights is None else np.asarray(to_numpy(known.weights)) > 0
        response = 1.0 if known.response is None else np.asarray(to_numpy(known.response), np.float64)
        background = np.asarray(to_numpy(known.background), np.float64)
        light = np.where(counts, known.gain * (data - background), 0.0)
        dark = known.gain * (background - known.black_level) + known.read_noise**2
        noise = counts * (np.maximum(light, 0) + dark)
        even = counts * response * known.light * self.even
        return self._sums(light), self._sums(noise * self.inner), self._sums(even)

    def _sums(self, pixels: np.ndarray) -> np.ndarray:
        return np.bincount(self.labels.ravel(), (self.inner * pixels).ravel(), len(self.places))


def _flat(camera: Lensed) -> tuple[Linear, Grid]:
    """Operator of a flat object in focus that extends beyond the lenslets, and the object's grid."""
    if isinstance(camera, LensletCamera):
        grid = _beyond(camera.operator_grid(SAMPLES))
        return camera.operator_on(grid, accuracy=ACCURACY), grid
    own = cast(MicroscopeOperator, camera.operator(None, SAMPLES, accuracy=ACCURACY))
    operator, _ = own.widened(SPILT)
    return operator, cast(Grid, operator.object_grid)  # a microscope's own


def _beyond(grid: Grid) -> Grid:
    """Grid of an object that extends beyond the lenslets, from where light spills, too."""
    height, width = (n + 2 * NEAR * SAMPLES for n in grid.shape)
    return Grid((height, width), grid.pitch, grid.center)


def _places(
    indices: np.ndarray, middle: np.ndarray, grid: Grid, shown: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Centroids (n, 2) [m] of the lenslets' footprints in the object, each by its own light."""
    first = [_middle(shown((indices == middle + step).all(1)), grid) for step in ((0, 0), (1, 0), (0, 1))]
    steps = np.array(first[1:]) - first[0]
    places = first[0] + (indices - middle) @ steps
    reach = int(NEAR * np.abs(steps).sum(0).max() / grid.pitch[0])
    group = (indices % (2 * NEAR + 1)) @ (2 * NEAR + 1, 1)
    for number in np.unique(group):
        light = shown(group == number)
        for k in np.flatnonzero(group == number):
            row, column = (round(float(n)) for n in (places[k] - (grid.y[0], grid.x[0])) / grid.pitch)
            part = (_around(row, reach), _around(column, reach))
            if (own := light[part]).sum() > 0:
                places[k] = own.sum(1) @ grid.y[part[0]], own.sum(0) @ grid.x[part[1]]
                places[k] /= own.sum()
    return places


def _around(middle: int, reach: int) -> slice:
    return slice(max(middle - reach, 0), max(middle + reach + 1, 0))


def _middle(light: np.ndarray, grid: Grid) -> np.ndarray:
    """Centroid of the light (y, x) [m]."""
    return np.array([light.sum(1) @ grid.y, light.sum(0) @ grid.x]) / light.sum()


def _near(light: np.ndarray) -> np.ndarray:
    """Part of the light near its brightest sample."""
    y, x = (round(float(n)) for n in np.argwhere(light > light.max() / 2).mean(0))
    reach = NEAR * SAMPLES
    return light[max(y - reach, 0) : y + reach, max(x - reach, 0) : x + reach]
