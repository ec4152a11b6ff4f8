r"""Cameras whose array or sensor leans: images by few cameras that do not, each of its distances.

A pixel sees light that went through lenslets δ farther from the main lens than was meant, to a sensor σ
farther. Its value is that of a camera of the distances L + δ and b - δ + σ, smooth in both; so all follow
from those at n Chebyshev nodes of each by Lagrange's polynomials :math:`\ell`,

.. math:: I(s) = \sum_{k,m} \ell_k(\delta(s)) \, \ell_m(\sigma(s)) \, I_{k m}(s)

For a tilted sensor nothing else is left out. Lenslets are taken as far away as the one behind which a pixel
lies: light from its neighbours, and the tilt within a lenslet, is off by as much as they differ.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from lumigraph.core.linear import Chain, Linear, Sum
from lumigraph.elements.tilt import TiltAndBow
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.cell_response import focal_lengths
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.cells import fresnel_number, lenslet_distance
from lumigraph.operators.sampling.field_lenses import lagrange, nodes
from lumigraph.operators.sampling.sample_weights import SampleWeights
from lumigraph.scene import Points

COUNTS = (2, 3, 4, 5, 7, 9)
"""Nodes of a distance that are tried."""

SHARE = 0.4
"""Part of the accuracy that distances between the nodes may be off by."""

TRIED = (-0.83, 0.36)
"""Distances, of half of their range, at which interpolation is measured."""

BESIDE = 0.07
"""Of the phase at a lenslet's edge by which neighbours' distances differ, the relative rms error of an image.

Lenslets before f/6 main lenses, of f/6 themselves, tilts of 60 mrad and bow beside sums lenslet by lenslet:
0.02 to 0.07.
"""

SHARPER = 2.7
"""How much more that is of lenslets that focus on the sensor, as of cameras 1.0, or have gaps: 2.4 to 3."""

SLOW = 3.0, 5.0, 5.0, 1.3
"""Fresnel number p²/(λb) below which light of lenslets farther away arrives, and how much more that is then;
number and power of a growth of both.

Of 30 cameras of numbers 0.5 to 9 and 3 to 35 lenslets, 23 are within a factor 2 of it; one is off by more,
2.1 times.
"""

FOCUSED = 0.1
"""Part of b by which f may differ from it, of lenslets that focus on the sensor."""

FINEST_TRIED = 1e-3
"""Accuracy of the images that are compared, at best: they are off alike."""

CLOSE = 0.01
"""Of the depth of focus behind a lenslet, λ (b/d)², what is between distances by which images are
differentiated, at least: the third order of what they change by is then 1e-4 of it.
"""

Image = Callable[[CameraOptics], np.ndarray]
"""Raw image (ny, nx) by a camera that does not lean."""


@dataclass(frozen=True, slots=True, eq=False)
class FlatCameras:
    """Cameras that do not lean and stand for one that does.

    Parameters
    ----------
    cameras
        Those.
    weights
        Of their pixels (n, ny, nx).
    left
        What is left out between them, relative rms, at the worst of the distances tried, and of lenslets
        beside each other (`BESIDE`).
    """

    cameras: tuple[CameraOptics, ...]
    weights: np.ndarray
    left: float

    def image(self, of: Image) -> np.ndarray:
        """Raw image by all of them."""
        pairs = zip(self.cameras, self.weights, strict=True)
        return sum((weight * of(camera) for camera, weight in pairs), np.zeros(self.weights.shape[1:]))


@dataclass(frozen=True, slots=True)
class _DistanceRange:
    """Range of one distance over the pixels: its middle, and half of how far it goes [m]."""

    middle: float
    half: float

    @classmethod
    def of(cls, values: np.ndarray) -> "_DistanceRange":
        low, high = float(values.min()), float(values.max())
        return cls((low + high) / 2, (high - low) / 2)

    def nodes(self, count: int) -> list[float]:
        """Nodes, so many [m]; the middle alone where nothing changes."""
        return (self.middle + self.half * nodes(count)).tolist() if self.half else [self.middle]

    def shares(self, count: int, values: np.ndarray) -> np.ndarray:
        """Shares of the nodes (n, ...) in values."""
        if not self.half:
            return np.ones((1, *values.shape))
        return lagrange(count, ((values - self.middle) / self.half).ravel()).reshape(count, *values.shape)


@dataclass(frozen=True, slots=True)
class TiltDistances:
    """Distances of array and sensor at which flat cameras stand for one that leans.

    Parameters
    ----------
    ranges, counts
        Of both.
    left
        As of `FlatCameras`.
    """

    ranges: tuple[_DistanceRange, _DistanceRange]
    counts: tuple[int, int]
    left: float

    def of(self, camera: CameraOptics) -> FlatCameras:
        """Flat cameras for one that leans like those that the distances were chosen for, or hardly more."""
        values, both = shifts(camera), list(zip(self.ranges, self.counts, strict=True))
        array, sensor = (one.nodes(n) for one, n in both)
        cameras = tuple(moved(camera, a, s) for a in array for s in sensor)
        first, second = (one.shares(n, v) for (one, n), v in zip(both, values, strict=True))
        weights = (first[:, None] * second[None]).reshape(len(cameras), *values[0].shape)
        return FlatCameras(cameras, weights, self.left)


def moved(camera: CameraOptics, array: float, sensor: float) -> CameraOptics:
    """The camera with a flat array and sensor, so much farther from the main lens [m].

    Raises
    ------
    GeometryError
        The sensor would lie on the lenslets, or before them.
    """
    distance = lenslet_distance(camera) - array + sensor
    if distance <= 0:
        raise GeometryError(
            f"the sensor would stand {distance * 1e6:.4g} µm behind some lenslets. Use less tilt or bow."
        )
    return replace(camera, separation=camera.separation + array, lenslet_distance=distance, lean=None)


def shifts(camera: CameraOptics) -> tuple[np.ndarray, np.ndarray]:
    """Extra distances of lenslets before pixels, and of these, from the main lens: two (ny, nx) [m]."""
    lean, array, pixels = camera.lean or TiltAndBow(), camera.array, camera.sensor.grid
    assert array is not None  # asked by those who call
    y, x = np.meshgrid(-pixels.y, -pixels.x, indexing="ij")  # raw images are turned by 180°
    scale = 1 + lenslet_distance(camera) / camera.separation
    down, across = y / scale, x / scale
    if array.extent is not None:
        half = math.hypot(*array.extent) / 2
        down, across = np.clip(down, -half, half), np.clip(across, -half, half)
    i, j = array.lattice.index(down, across)
    centers = array.lattice.position(np.stack([i.ravel(), j.ravel()], -1)).T.reshape(2, *y.shape)
    return lean.of_array(*centers), lean.of_sensor(y, x)


def flat(camera: CameraOptics, accuracy: float) -> FlatCameras:
    """The fewest cameras that stand for one that leans, to a part of the accuracy, relative rms.

    Raises
    ------
    SamplingError
        It leans farther than `COUNTS` can follow.
    """
    return distances(camera, accuracy).of(camera)


def distances(camera: CameraOptics, accuracy: float) -> TiltDistances:
    """The fewest, as `flat` has it.

    Raises
    ------
    SamplingError
        It leans farther than `COUNTS` can follow.
    """
    array, sensor = map(_DistanceRange.of, shifts(camera))
    ranges, points = (array, sensor), _points(camera)

    def seen(array: float, sensor: float) -> np.ndarray:
        return points_image(moved(camera, array, sensor), points, max(accuracy, FINEST_TRIED))

    counts, left = [], _beside(camera)
    for which in (0, 1):
        count, off = _count(ranges, which, seen, accuracy)
        counts.append(count)
        left = math.hypot(left, off)
    return TiltDistances(ranges, (counts[0], counts[1]), left)


def near(camera: CameraOptics, others: Sequence[CameraOptics], accuracy: float) -> TiltDistances:
    """Distances for a camera and others that lean a little more or less, or of which only these lean.

    What differs between them is followed by three distances at least, which are not too close to be told
    apart.
    """
    plain = TiltDistances((_DistanceRange(0.0, 0.0), _DistanceRange(0.0, 0.0)), (1, 1), 0.0)
    own = distances(camera, accuracy) if camera.lean is not None else plain
    values, ranges, counts = shifts(camera), list(own.ranges), list(own.counts)
    least = CLOSE * camera.wavelength * (lenslet_distance(camera) / _pitch(camera)) ** 2
    for which, mine in enumerate(values):
        if any(not np.array_equal(shifts(other)[which], mine) for other in others):
            ranges[which] = _DistanceRange(ranges[which].middle, max(ranges[which].half, least))
            counts[which] = max(counts[which], 3)
    return TiltDistances((ranges[0], ranges[1]), (counts[0], counts[1]), own.left)


def _pitch(camera: CameraOptics) -> float:
    assert camera.array is not None  # asked by those who call
    return camera.array.lattice.pitch


def _beside(camera: CameraOptics) -> float:
    """Error of lenslets taken as far away as their neighbours: relative rms, at the steepest place."""
    lean, array, b = camera.lean, camera.array, lenslet_distance(camera)
    assert lean is not None  # asked by those who call
    assert array is not None
    corner = math.hypot(*(array.extent or camera.sensor.grid.size)) / 2
    step = array.lattice.pitch * (math.hypot(*lean.array) + 2 * abs(lean.bow) * corner)
    number = fresnel_number(camera)
    sharp = any(abs(f / b - 1) < FOCUSED for f in focal_lengths(array)) or array.fill_factor < 1
    least, more, begins, power = SLOW
    share = BESIDE * (more if number < least else SHARPER if sharp else 1.0)
    share *= max(1.0, begins / number) ** power
    return share * math.pi * (array.lattice.pitch / 2) ** 2 * step / (camera.wavelength * b**2)


def _count(
    ranges: tuple[_DistanceRange, _DistanceRange],
    which: int,
    seen: Callable[[float, float], np.ndarray],
    accuracy: float,
) -> tuple[int, float]:
    """Nodes of one distance, the other in the middle, and what they leave out."""
    mine = ranges[which]
    if not mine.half:
        return 1, 0.0

    def at(value: float) -> np.ndarray:
        pair = [ranges[0].middle, ranges[1].middle]
        pair[which] = value
        return seen(*pair)

    values = mine.middle + mine.half * np.array(TRIED)
    expected, off = [at(value) for value in values.tolist()], math.inf
    for count in COUNTS:
        known, shares = np.array([at(value) for value in mine.nodes(count)]), mine.shares(count, values)
        found = np.einsum("nv,nyx->vyx", shares, known)
        off = max(
            float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in zip(found, expected, strict=True)
        )
        if off <= SHARE * accuracy:
            return count, off
    name = ("array", "sensor")[which]
    raise SamplingError(
        f"the {name} leans by ±{mine.half * 1e6:.4g} µm, over which images change so much that those between "
        f"{COUNTS[-1]} distances are off by {off:.2g} rms; accuracy {accuracy:g} allows "
        f"{SHARE * accuracy:.2g}. Ask for {off / SHARE:.2g}, or lean less."
    )


def _points(camera: CameraOptics) -> Points:
    """One amid the array and one towards a corner, in the focused plane."""
    assert camera.array is not None
    size = camera.array.extent or camera.sensor.grid.size
    pitch, scale = camera.array.lattice.pitch, -camera.object_distance / camera.separation
    if camera.objects is not None:
        scale /= camera.objects.pupil_magnification
    places = np.array([(0.13, -0.21), (0.35 * size[0] / pitch - 0.38, 0.35 * size[1] / pitch + 0.44)]) * pitch
    return Points(np.column_stack([scale * places, np.zeros(2)]), np.ones(2))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TiltedOperator(Sum):
    """Operator of a camera whose array or sensor leans: of few that do not, each on its pixels."""

    left: float = 0.0

    title: ClassVar[str] = "Operator of an array or sensor that leans"

    @property
    def error(self) -> float:
        """Relative rms error of the operators, and of distances between theirs."""
        return math.hypot(max(part.error for part in self.maps), self.left)


def leaning_operator(
    camera: CameraOptics, accuracy: float, of: Callable[[CameraOptics, int, int], Linear]
) -> TiltedOperator:
    """Operator of a camera that leans, from those `of` a flat camera, its number and how many there are."""
    found = flat(camera, accuracy)
    count = len(found.cameras)
    parts = [of(one, number, count) for number, one in enumerate(found.cameras)]
    grid, depths = parts[0].object_grid, parts[0].depths
    maps = tuple(
        Chain((part, SampleWeights(weight.astype(np.float32))), object_grid=grid, depths=depths)
        for part, weight in zip(parts, found.weights, strict=True)
    )
    return TiltedOperator(maps, (1.0,) * count, left=found.left, object_grid=grid, depths=depths)
