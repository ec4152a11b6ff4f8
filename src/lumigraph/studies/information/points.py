"""Images of points of light and their derivatives by place, of any instrument, as parts of the light.

Derivatives are exact before microscopes whose images are not traced by rays, and paraxial cameras with
lenslets behind a thin lens. Those of others are central differences.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, cast

import numpy as np

from lumigraph.core.lattice import Lattice
from lumigraph.errors import GeometryError
from lumigraph.instruments import Camera, LensletCamera, LightFieldMicroscope
from lumigraph.instruments.capabilities import WithPupil
from lumigraph.instruments.instrument import Instrument
from lumigraph.operators import single_lens
from lumigraph.operators.lenslets.paraxial_error import resolved
from lumigraph.operators.lenslets.point_changes import has_changes, place_changes
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.lenslets.relay import RelaySet
from lumigraph.operators.lenslets.tilted_planes import FlatCameras, flat
from lumigraph.operators.microscope.fourier_points import FourierPoints
from lumigraph.operators.microscope.pupil import PupilImages
from lumigraph.operators.sampling import cells
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.scene import Points
from lumigraph.simulation.microscope_scene import SAMPLES

ACROSS, ALONG = 1 / 32, 1 / 4
"""Steps of central differences: of the finest period λz/D that a stop lets through, and of λ(z/D)².

They turn the phase at the stop's edge by 0.2 rad either way: a derivative is off by 0.6 % at most.
"""

SLIGHT = 0.02
"""Change of an image by a step, over the image, to which errors of smaller changes are compared."""

GOLDEN = (0.7548776662466927, 0.5698402909980532)
"""Steps of places that fill a cell evenly, however many (R. Roberts' sequence)."""

SPARE = 2
"""Lenslets beside those that the light reaches, on each side."""


class PointSource(Protocol):
    """An instrument's images of points."""

    @property
    def pixels(self) -> int:
        """Number of pixels of each image."""
        ...

    def cell(self, dz: float) -> np.ndarray:
        """Two vectors (y, x) [m] at a depth, by which points may move until their images are alike."""
        ...

    def image(self, place: np.ndarray) -> np.ndarray:
        """Image (ny, nx) of a point (y, x, dz) [m], parts of the light that enters."""
        ...

    def lit(self, place: np.ndarray, *, checked: bool) -> tuple[np.ndarray, np.ndarray]:
        """(4, ny, nx): the image and its derivatives by y, x and dz [1/m]; and the latter's error (3,).

        The error is relative, rms; NaN where it was not `checked`, 0 of exact derivatives.
        """
        ...


def source(instrument: Instrument, depths: np.ndarray, accuracy: float) -> PointSource:
    """Images of points of an instrument.

    Raises
    ------
    GeometryError
        A kind without images of points, a depth that it does not image.
    """
    if isinstance(instrument, WithPupil):
        return _of_microscope(cast(LightFieldMicroscope, instrument), depths, accuracy)
    if isinstance(instrument, Camera):
        for dz in depths:
            instrument.defocused(float(dz))
        cut = small(instrument, depths) if isinstance(instrument, LensletCamera) else instrument
        return CameraSource(cut, accuracy, depths)
    raise GeometryError(f"{type(instrument).__name__} has no images of points.")


def spread(cell: np.ndarray, numbers: range) -> np.ndarray:
    """Places (count, 2) of these numbers in a sequence that fills a cell evenly, around its middle."""
    steps = (0.5 + np.outer(numbers, GOLDEN)) % 1 - 0.5
    return steps @ cell


def collected(instrument: Instrument) -> float:
    """Part of a point's light that enters an instrument: of the sphere, on the axis, in focus."""
    if isinstance(instrument, WithPupil):
        one = cast(LightFieldMicroscope, instrument).objectives[0]
        return (1 - math.sqrt(1 - (one.aperture / one.medium) ** 2)) / 2
    if isinstance(instrument, Camera):
        return (1 - math.cos(math.atan(instrument.pupil_diameter / 2 / instrument.object_distance))) / 2
    raise GeometryError(f"{type(instrument).__name__} has no aperture.")


def differences(
    image: Callable[[np.ndarray], np.ndarray], place: np.ndarray, steps: np.ndarray, checked: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Image and derivatives, as `PointSource.lit`, by central differences; by two steps if checked."""
    found, errors = [image(place)], []
    for axis, step in enumerate(steps):
        move = np.eye(3)[axis] * step
        slope = (image(place + move) - image(place - move)) / (2 * step)
        if checked:
            wide = (image(place + 2 * move) - image(place - 2 * move)) / (4 * step)
            least = SLIGHT * float(np.linalg.norm(found[0])) / step  # in focus images stand still
            size = max(float(np.linalg.norm(slope)), least) or 1.0
            errors.append(float(np.linalg.norm(slope - wide)) / 3 / size)
            slope = slope + (slope - wide) / 3
        found.append(slope)
    return np.stack(found), np.array(errors) if checked else np.full(3, np.nan)


@dataclass(frozen=True, eq=False)
class CameraSource:
    """Images of points of a camera with a main lens.

    Parameters
    ----------
    camera
        With as many lenslets as the light reaches.
    accuracy
        Relative rms error of images.
    depths
        (nz,), whose points lenslets are sampled for [m].
    """

    camera: Camera
    accuracy: float
    depths: np.ndarray = field(default_factory=lambda: np.zeros(1))

    @property
    def pixels(self) -> int:
        """Number of pixels, as `PointSource.pixels`."""
        return math.prod(self.camera.sensor.shape)

    def cell(self, dz: float) -> np.ndarray:
        """Cell of the lattice, as the main lens images it; a pixel's without lenslets."""
        scale = (self.camera.object_distance + dz) / self.camera.separation
        lattice = self.camera.lattice
        if lattice is None:
            return np.eye(2) * self.camera.sensor.pixel_pitch * scale
        return _cell(lattice) * scale

    def image(self, place: np.ndarray) -> np.ndarray:
        """Image, as `PointSource.image`."""
        points = Points(place[None], np.ones(1))
        if self.camera.lattice is None:
            found, _ = single_lens.points_image(self._optics, points)
        else:
            found = self._seen(lambda optics, known: points_image(optics, points, self.accuracy, known))
        return self.part(float(place[2])) * np.asarray(found, np.float64)

    def lit(self, place: np.ndarray, *, checked: bool) -> tuple[np.ndarray, np.ndarray]:
        """Image and derivatives, as `PointSource.lit`."""
        if has_changes(self._optics):
            found = self._seen(lambda optics, known: place_changes(optics, place, self.accuracy, known))
            return self.part(float(place[2])) * found.astype(np.float64), np.zeros(3)
        ratio = (self.camera.object_distance + place[2]) / self.camera.pupil_diameter
        across, along = ACROSS * self.camera.wavelength * ratio, ALONG * self.camera.wavelength * ratio**2
        return differences(self.image, place, np.array([across, across, along]), checked)

    @cached_property
    def _optics(self) -> CameraOptics:
        return resolved(self.camera.optics(), self.accuracy)

    def _seen(self, of: Callable[[CameraOptics, RelaySet], np.ndarray]) -> np.ndarray:
        """Sum over the camera, or over the upright cameras that replace a leaning one."""
        if self._flat is None:
            return of(self._optics, self._relays[0])
        both = zip(self._flat.cameras, self._relays, self._flat.weights, strict=True)
        return np.sum([weight * of(one, known) for one, known, weight in both], axis=0)

    @cached_property
    def _flat(self) -> FlatCameras | None:
        return None if self._optics.lean is None else flat(self._optics, self.accuracy)

    @cached_property
    def _relays(self) -> list[RelaySet]:
        """Relays of the camera, or of each upright camera that replaces it."""
        return [self._relays_of(one) for one in (self._flat.cameras if self._flat else (self._optics,))]

    def _relays_of(self, optics: CameraOptics) -> RelaySet:
        distances = (optics.object_distance + self.depths).tolist()
        return RelaySet(max(distances, key=lambda z: cells.blur(optics, z)))

    def part(self, dz: float) -> float:
        """Light of the main lens in an image of 1: a sample of the object sends more from nearer by."""
        optics = self._optics
        depth = dz if optics.objects is None else float(optics.objects.depth(dz))
        step = optics.object_pitch * optics.separation / (optics.object_distance + depth)
        return (optics.sensor.pixel_pitch / step) ** 2


def _cell(lattice: Lattice) -> np.ndarray:
    """Vectors (y, x) of a cell; in multi-focus arrays three lenslets wide."""
    cell = np.array(lattice.basis)
    cell[0] *= lattice.kinds
    return cell


def near_axis(camera: Camera, depths: np.ndarray, width: float = 0.0, like: Camera | None = None) -> Camera:
    """Camera with only the lenslets, or pixels, that light of planes of a width [m] around the axis reaches.

    Or with as many as `like` another.
    """
    if isinstance(camera, LensletCamera):
        return small(camera, depths, width, cast(LensletCamera | None, like))
    widest, pitch = _reached(camera, depths, width), camera.sensor.pixel_pitch
    wanted = math.ceil(widest / pitch) + 2 * SPARE
    shape = tuple(min(n, wanted + (n - wanted) % 2) for n in camera.sensor.shape)
    return camera.replace(sensor={"shape": shape if like is None else like.sensor.shape})


def small(
    camera: LensletCamera, depths: np.ndarray, width: float = 0.0, like: LensletCamera | None = None
) -> LensletCamera:
    """Camera with only the lenslets that light of these depths reaches, and some; or as `like` another."""
    if like is None:
        shape, count = None, _lit(camera, depths, width)
    else:
        shape, count = like.sensor.shape, like.lenslets.count
    lens, lenslets = {"diameter": camera.pupil_diameter}, camera.lenslets.amid(count)
    cut = camera.replace(lenslets=lenslets, sensor={"shape": shape}, main_lens=lens)
    if not camera.built.array_bow:
        return cut
    nearer = math.hypot(*cut.lenslets.reach) / math.hypot(*camera.lenslets.reach)
    return cut.replace(built={"array_bow": camera.built.array_bow * nearer**2})  # it is that of the corners


def _lit(camera: LensletCamera, depths: np.ndarray, width: float) -> tuple[int, ...]:
    """Number of lenslets (rows, columns) that light reaches."""
    pitch = camera.lenslets.pitch * (3 if camera.lattice.kinds > 1 else 1)  # points move by a cell
    wanted = math.ceil((_reached(camera, depths, width) + pitch) / camera.lenslets.row_pitch) + 2 * SPARE
    return tuple(min(n, wanted + (n - wanted) % 2) for n in camera.lenslets.count)


def _reached(camera: Camera, depths: np.ndarray, width: float) -> float:
    """Width of the light of planes of a width, before lenslets, or on the sensor without them [m]."""
    diameter, farthest = camera.pupil_diameter, 0.0
    for dz in depths:
        distance = camera.defocused(float(dz))
        focus = 1 / camera.main_lens.focal_length - 1 / distance
        blur = diameter * abs(1 - camera.separation * focus)
        waves = 2.44 + 12 * sum(map(abs, camera.main_lens.aberrations.values()))
        if camera.main_lens.mask is not None:
            waves += 2 * camera.main_lens.mask.element(diameter).steepest
        edge = 2 * waves * camera.wavelength * camera.separation / diameter
        farthest = max(farthest, blur + edge + width * camera.separation / distance)
    return farthest


def has_phase(scope: LightFieldMicroscope) -> bool:
    """True if images of points are computed by the pupil, not traced by rays."""
    return scope.objective.model != "rays"


def _of_microscope(scope: LightFieldMicroscope, depths: np.ndarray, accuracy: float) -> PointSource:
    if scope.configuration == "fourier":
        return FourierSource(scope, scope.fourier_points())
    if not has_phase(scope):
        return MicroscopeSource(scope, accuracy)
    farthest = float(np.abs(depths).max())
    return PupilSource(scope, scope.pupil_images((), farthest=farthest, accuracy=accuracy))


@dataclass(frozen=True, slots=True, eq=False)
class FourierSource:
    """Images of points of a Fourier microscope."""

    scope: LightFieldMicroscope
    points: FourierPoints

    @property
    def pixels(self) -> int:
        """Number of pixels, as `PointSource.pixels`."""
        return math.prod(self.scope.sensor.shape)

    def cell(self, dz: float) -> np.ndarray:
        """Cell of a pixel in the object: behind every lenslet points move alike."""
        return np.eye(2) * self.scope.object_grid.pitch[0]

    def image(self, place: np.ndarray) -> np.ndarray:
        """Image, as `PointSource.image`."""
        return self.points.image(*place.tolist()) / self.points.whole

    def lit(self, place: np.ndarray, *, checked: bool) -> tuple[np.ndarray, np.ndarray]:
        """Image and derivatives, as `PointSource.lit`."""
        y, x, dz = place.tolist()
        return self.points.lit(y, x, dz) / self.points.whole, np.zeros(3)


@dataclass(frozen=True, slots=True, eq=False)
class MicroscopeSource:
    """Images of points of a microscope, without derivatives."""

    scope: LightFieldMicroscope
    accuracy: float

    @property
    def pixels(self) -> int:
        """Number of pixels, as `PointSource.pixels`."""
        return math.prod(self.scope.sensor.shape)

    def cell(self, dz: float) -> np.ndarray:
        """Cell of a lenslet in the object."""
        return np.array(self.scope.lattice.basis) / self.scope.magnification

    @property
    def whole(self) -> float:
        """Sum of the image of a point that is as bright as a sample of the object, if no light is lost."""
        pixels = self.scope.micro_image_pitch / self.scope.sensor.pixel_pitch
        return (pixels / SAMPLES) ** 2

    def image(self, place: np.ndarray) -> np.ndarray:
        """Image, as `PointSource.image`."""
        y, x, dz = place.tolist()
        return self.scope.point_image(y, x, dz, accuracy=self.accuracy) / self.whole

    def lit(self, place: np.ndarray, *, checked: bool) -> tuple[np.ndarray, np.ndarray]:
        """Image and derivatives, as `PointSource.lit`."""
        one = self.scope.objectives[0]
        across = ACROSS * one.wavelength / (2 * one.aperture)
        along = ALONG * one.wavelength * one.medium / (4 * one.aperture**2)
        return differences(self.image, place, np.array([across, across, along]), checked)


@dataclass(frozen=True, eq=False)
class PupilSource(MicroscopeSource):
    """Images of points of a microscope, by its pupil."""

    images: PupilImages

    def __init__(self, scope: LightFieldMicroscope, images: PupilImages) -> None:
        super().__init__(scope, images.accuracy)
        object.__setattr__(self, "images", images)

    def image(self, place: np.ndarray) -> np.ndarray:
        """Image, as `PointSource.image`."""
        return self.images.forward(Points(place[None], np.ones(1)), np.zeros(0)) / self.whole

    def lit(self, place: np.ndarray, *, checked: bool) -> tuple[np.ndarray, np.ndarray]:
        """Image and derivatives, as `PointSource.lit`."""
        (one,) = self.images.lit(Points(place[None], np.ones(1)), np.zeros(0))
        (rows, columns), pixels = self.images.seen(np.concatenate([one.image[None], one.changes]), one.cell)
        found = np.zeros((len(pixels), *self.images.shape))
        found[:, rows, columns] = pixels
        return found / self.whole, np.zeros(3)
