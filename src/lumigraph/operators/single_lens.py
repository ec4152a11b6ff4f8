"""Incoherent raw images of a camera without lenslets: the object convolved with the image of a point.

In the Fresnel approximation a lens images every point of a plane alike. Its optical transfer function ends at
D/(λL), so that samples λL/(2D) apart hold the image, whatever the object's own samples and the pixels are:
object to samples, one linear convolution by FFTs, samples to pixels (docs/theory/lenslets.md). The whole is
off by 1e-5 to 1e-4 of the image's rms (`error`), but for light farther from its point than some 600 λL/D,
where a point has 3e-4 of its light: what is nearer is made brighter by as much.

Goodman, *Introduction to Fourier Optics*, sections 6.1 to 6.3.
"""

import math
import warnings
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from lumigraph.core import arrays, memory
from lumigraph.core.arrays import Array
from lumigraph.core.cache import ByteCache
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Chain, Linear, Shape
from lumigraph.errors import SamplingError, SamplingWarning
from lumigraph.operators.sampling import band, field_lenses
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.band import Span
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.field_lenses import FieldOperator
from lumigraph.operators.sampling.glass_distortion import Fields, seen_plane, seen_points
from lumigraph.operators.sampling.regrid import Regridded
from lumigraph.operators.sampling.resampling import Resampling, averaged, represented
from lumigraph.propagation import propagate
from lumigraph.propagation.window import smooth_size
from lumigraph.scene import Points, sources

COARSEST_PUPIL = 512
"""Samples across the pupil, at least."""

FINEST_PUPIL = 1500
"""Samples across the pupil, at most, unless a blur is wider than that resolves."""

BLURRED, FINEST_BLURRED = 150.0, 3000
"""Samples across the pupil for each λL/D of a blur's radius, and at most."""

PERIOD = 3.0
"""The pupil's samples make h repeat itself after this many times its largest offset from the axis."""

_TRANSFERS = ByteCache()

TOLD = 40.0
"""How far around a point [λL/D] its images are set beside each other."""

FINEST = 1e-4
"""Accuracy that operators may be asked for: they are better up to blurs of 26 λL/D."""

KERNELS, EDGE = 6e-6, 1.3
"""Relative rms error that kernels leave, and that a pupil's grey edge does, whose samples have the phase of
their middles: so many times the square of a blur's radius [λL/D] over the samples across the pupil.

Against `benchmarks.references`, f/10 to f/30, blurs to 40 λL/D.
"""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Convolution(Linear):
    """A point's image at every sample, on the samples that the sensor sees.

    Parameters
    ----------
    transfer
        DFT (ny, nx // 2 + 1) of a point's image over all offsets between object and sensor.
    window
        Samples (ny, nx) of those DFTs.
    samples, seen
        Of the image that the object covers, and that the sensor does (y, x).
    left
        Relative rms error that the pupil's samples leave.
    """

    transfer: np.ndarray
    window: tuple[int, int]
    samples: tuple[int, int]
    seen: tuple[int, int]
    left: float

    title: ClassVar[str] = "Convolution with a point's image"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes `seen` and `samples`."""
        return self.seen, self.samples

    def _forward(self, intensity: Array) -> Array:
        spectrum = arrays.rfft2(intensity, self.window) * arrays.held(self.transfer, intensity)
        image = arrays.irfft2(spectrum, self.window)
        rows, columns = (slice(n - 1, n - 1 + m) for n, m in zip(self.samples, self.seen, strict=True))
        return image[rows, columns]

    def _adjoint(self, raw: Array) -> Array:
        xp, (rows, columns) = arrays.namespace(raw), self.samples
        spectrum = arrays.rfft2(arrays.framed(raw, (rows - 1, columns - 1), self.window), self.window)
        spectrum = spectrum * xp.conj(arrays.held(self.transfer, raw))
        return arrays.irfft2(spectrum, self.window)[:rows, :columns]

    @property
    def error(self) -> float:
        """Relative rms error of the pupil's samples and of the kernels."""
        return math.hypot(KERNELS, self.left)

    @property
    def memory_bytes(self) -> float:
        """Memory of the transfer, and of two spectra and two windows on the way [bytes]."""
        return self.transfer.nbytes + 4.0 * 4 * math.prod(self.window)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SingleLensOperator(Chain):
    """Raw image, turned by 180°, of an incoherent plane at one depth: samples brought onto the image's, a
    `Convolution`, and means over the pixels.
    """

    title: ClassVar[str] = "Operator of a single lens"


def single_lens_operator(
    camera: HasOptics, grid: Grid, dz: float = 0.0, accuracy: float = 1e-3
) -> SingleLensOperator | FieldOperator | Regridded:
    """Operator from a plane at depth `dz`, sampled on `grid`, to the raw image; transfers are kept for reuse.

    Parameters
    ----------
    camera
        Without lenslets.
    grid
        Samples of the object [m], each of them a point that stands for its area.
    dz
        Depth of the plane from the focused one [m], positive farther.
    accuracy
        Of a lens that changes over the field: how far off other fields may be, relative rms.

    Raises
    ------
    GeometryError
        Light from beyond the fields that a lens is known for.
    SamplingError
        The camera has lenslets, or the image's samples do not fit in memory.
    """
    plain = camera.optics()
    if plain.array is not None:
        raise SamplingError("the camera has lenslets: use periodic_operator.")
    if plain.objects is not None:
        return seen_plane(
            plain, grid, dz, lambda one, seen, depth, fields: _varying(one, seen, depth, fields, accuracy)
        )
    if field_lenses.plate_of(plain) is not None:
        distance = plain.object_distance + dz
        return _varying(plain, grid, dz, (grid.y / distance, grid.x / distance), accuracy)
    scale, pitch = -plain.separation / (plain.object_distance + dz), image_pitch(plain)
    here = _covering((scale * grid.y, scale * grid.x), pitch)
    samples = object_samples(here, scale)
    maps = represented(grid, samples), *_imaging(plain, here, dz)
    return SingleLensOperator(maps, object_grid=grid)


def object_samples(image: tuple[Span, Span], scale: float) -> Grid:
    """Samples of the object whose images are those along y and along x, so many times as large."""
    pitch = [span.pitch / scale for span in image]  # descending in the object
    center = [(span.first + span.count // 2) * step for span, step in zip(image, pitch, strict=True)]
    return Grid((image[0].count, image[1].count), (-pitch[0], -pitch[1]), (center[0], center[1]))


def _varying(camera: CameraOptics, grid: Grid, dz: float, fields: Fields, accuracy: float) -> FieldOperator:
    """Operator of a plane before a lens that changes over the field."""
    distance = camera.object_distance + dz
    found = field_lenses.lenses(camera, fields, _seen(camera, distance), accuracy)

    def of(one: CameraOptics) -> SingleLensOperator:
        result = single_lens_operator(one, grid, dz)
        assert isinstance(result, SingleLensOperator)  # of one lens
        return result

    return field_lenses.operator(camera, grid, distance, found, of)


def _seen(camera: CameraOptics, distance: float) -> field_lenses.Image:
    """Images of a point by lenses of a camera; see `field_lenses`."""
    pitch, spot = image_pitch(camera), _cells.airy(camera)
    reach = max(1.2 * _cells.blur(one, distance) for one in field_lenses.some(camera)) + TOLD * spot
    span = Span.around(-reach, reach, pitch)
    # Coarse pupils do to set lenses beside each other.
    return lambda one: _point_image(one, distance, [span, span], 1.0, 0.0).ravel()


def points_image(instrument: HasOptics, points: Points) -> tuple[np.ndarray, float]:
    """Raw image (ny, nx) of points, wherever they are, and its relative rms error.

    One convolution for each depth or, where the lens changes over the field, for each point.
    """
    camera, points = seen_points(instrument.optics(), points)
    if field_lenses.plate_of(camera) is None:
        return _points_image(camera, points.positions, points.intensities)
    total, off = np.zeros(camera.sensor.shape, np.float32), 0.0
    for position, intensity in zip(points.positions, points.intensities, strict=True):
        distance = camera.object_distance + float(position[2])
        one = field_lenses.at(camera, position[0] / distance, position[1] / distance)
        image, error = _points_image(one, position[None], np.array([intensity]))
        total, off = total + image, max(off, error)
    return total, off


def _points_image(
    camera: CameraOptics, positions: np.ndarray, intensities: np.ndarray
) -> tuple[np.ndarray, float]:
    """Raw image of points by one lens for all, and its relative rms error."""
    total, off = np.zeros(camera.sensor.shape, np.float32), 0.0
    for dz in np.unique(positions[:, 2]):
        chosen = positions[:, 2] == dz
        scale, pitch = -camera.separation / (camera.object_distance + dz), image_pitch(camera)
        y, x = scale * positions[chosen, :2].T
        here = _covering((y, x), pitch)
        along_y, along_x = band.placed(y, here[0]), band.placed(x, here[1])
        # A point of intensity 1 counts as one sample of the camera's own object grid.
        light = intensities[chosen] * camera.object_pitch**2 * (scale / pitch) ** 2
        samples = ((along_y * light) @ along_x.T).toarray().astype(np.float32)
        imaging = Chain(_imaging(camera, here, float(dz)))
        total, off = total + imaging.forward(samples), max(off, imaging.error)
    return total, off


def _covering(places: tuple[np.ndarray, np.ndarray], pitch: float) -> tuple[Span, Span]:
    """Samples of the image around places along y and x [m]."""
    y, x = (Span.around(float(at.min()), float(at.max()), pitch) for at in places)
    return y, x


def _imaging(camera: CameraOptics, here: tuple[Span, Span], dz: float) -> tuple[Convolution, Resampling]:
    """Maps from samples that stand for their own area of the object to the pixels."""
    distance, pitch, pixels = camera.object_distance + dz, image_pitch(camera), camera.sensor.grid
    half_y, half_x = (np.array([-p / 2, p / 2]) for p in pixels.pitch)
    edges = -pixels.y[[-1, 0]] + half_y, -pixels.x[[-1, 0]] + half_x  # a readout is turned by 180°
    there = _covering(edges, pitch)
    offsets = [
        Span(out.first - own.last, own.count + out.count - 1, pitch)
        for own, out in zip(here, there, strict=True)
    ]
    window = smooth_size(offsets[0].count), smooth_size(offsets[1].count)
    followed = _followed(camera, distance, offsets, BLURRED)
    _check_memory(window, followed.across, camera)
    light = (pitch * distance) ** 2 / (math.pi * camera.pupil_diameter**2 / 4)
    key = repr((offsets, distance, camera.wavelength, camera.separation, camera.lens))
    transfer = _TRANSFERS.get(
        key, lambda: arrays.rfft2(_point_image(camera, distance, offsets, light), window)
    )
    samples, seen = ((y.count, x.count) for y, x in (here, there))
    mean = averaged(_grid(list(there)), pixels, camera.sensor.fill_factor)
    return Convolution(transfer, window, samples, seen, followed.left), mean


def image_pitch(camera: CameraOptics) -> float:
    """Distance of the samples that hold the image [m]: λL/(2D) and some closer."""
    return _cells.airy(camera) / 2 / band.OVERSAMPLING


class _FollowedLight(NamedTuple):
    """Distances from the axis of light wanted and followed [m], samples across the pupil, their error."""

    wanted: float
    reach: float
    across: int
    left: float


def _followed(camera: CameraOptics, distance: float, offsets: list[Span], finely: float) -> _FollowedLight:
    spot, blur = _cells.airy(camera), _cells.blur(camera, distance)
    wanted = max(max(abs(span.first), abs(span.last)) * span.pitch for span in offsets)
    reach = min(wanted, max(FINEST_PUPIL * spot / PERIOD, 1.5 * blur + 50 * spot))
    blurred = min(finely * blur / spot, FINEST_BLURRED)
    across = math.ceil(max(COARSEST_PUPIL, PERIOD * reach / spot, blurred))
    return _FollowedLight(wanted, reach, across, EDGE * (blur / spot / across) ** 2)


def _point_image(
    camera: CameraOptics, distance: float, offsets: list[Span], light: float, finely: float = BLURRED
) -> np.ndarray:
    """Image (ny, nx) of a point on the axis at the given offsets, times `light`, float32."""
    wanted, reach, across, _ = _followed(camera, distance, offsets, finely)
    near = [_cropped(span, reach) for span in offsets]
    wide = math.ceil(across * _cells.stop_reach(camera.lens))
    pupil = Grid.square(wide + 3, camera.pupil_diameter / across)
    with warnings.catch_warnings():  # a smooth converging wave: its samples do not stand for points
        warnings.simplefilter("ignore", SamplingWarning)
        point = sources.point_source(pupil, camera.wavelength, distance, paraxial=True)
        behind = camera.lens(point)
        behind = replace(behind, data=behind.data.astype(np.complex64))
        image = propagate(behind, camera.separation, "fresnel", grid=_grid(near)).intensity
    for axis, span in enumerate(near):  # grey edges are means over samples: h is too faint by a sinc, far off
        faint = np.sinc(span.positions * pupil.pitch[axis] / (camera.wavelength * camera.separation)) ** 2
        image /= (faint if axis else faint[:, None]).astype(np.float32)
    whole = all(min(-span.first, span.last) * span.pitch >= reach for span in near)
    if reach < wanted and whole:  # what falls farther stays within
        arriving = np.abs(behind.data).sum(dtype=float) * math.prod(pupil.pitch) / distance
        image *= arriving / (image.sum(dtype=float) * near[0].pitch * near[1].pitch)
    result = np.zeros([span.count for span in offsets], np.float32)
    top, left = (n.first - span.first for n, span in zip(near, offsets, strict=True))
    result[top : top + near[0].count, left : left + near[1].count] = light * image
    return result


def _cropped(span: Span, reach: float) -> Span:
    most = math.ceil(reach / span.pitch - 1e-9)
    first, last = max(span.first, -most), min(span.last, most)
    if last < first:  # the sensor is farther from the object's image than light is followed
        first = last = min(max(0, span.first), span.last)
    return Span(first, last - first + 1, span.pitch)


def _grid(spans: list[Span]) -> Grid:
    shape = tuple(span.count for span in spans)
    center = tuple((span.first + span.count // 2) * span.pitch for span in spans)
    return Grid((shape[0], shape[1]), (spans[0].pitch, spans[1].pitch), (center[0], center[1]))


def _check_memory(window: tuple[int, int], across: int, camera: CameraOptics) -> None:
    memory.require(
        20.0 * math.prod(window) + 56.0 * across**2 + 8 * math.prod(camera.sensor.shape),
        f"the image's {window[0]} x {window[1]} samples",
        "Use fewer pixels, a smaller object, or a larger f-number.",
        SamplingError,
    )
