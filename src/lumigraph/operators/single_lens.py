r"""Incoherent raw images of a camera without lenslets: the object convolved with the image of a point.

In the Fresnel approximation a lens images every point of a plane alike. Of an object point at x, a distance d
before the lens, the sensor at L receives

.. math:: |h(s - M x)|^2, \quad h(s) = \int P(u) \exp\left(i\pi \frac{u^2}{\lambda}
          \left(\frac1d + \frac1L\right) - 2\pi i \frac{s u}{\lambda L}\right) du, \quad M = -L/d

with the pupil P: lens, stop and aberrations. Its Fourier transform, the optical transfer function, ends at
D/(λL), so that samples λL/(2D) apart hold the image, whatever the object's own samples and the pixels are:

1. the object's samples, or points anywhere, are brought onto those samples as band-limited points;
2. one linear convolution, by FFTs on a window that holds every offset between object and sensor, so that
   nothing wraps round;
3. the band-limited image is integrated over each pixel.

Steps 1 and 3 are sparse matrices along each axis (`band`). The whole is exact to 1e-4 of the image's rms, but
for light farther from its point than some 600 λL/D, where a point has 3e-4 of its light: what is nearer is
made brighter by as much.

Goodman, *Introduction to Fourier Optics*, sections 6.1 to 6.3.
"""

import math
import warnings
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import arrays, memory, picture
from lumigraph.core.arrays import Array
from lumigraph.core.cache import ByteCache
from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens
from lumigraph.errors import SamplingError, SamplingWarning
from lumigraph.operators import band
from lumigraph.operators.band import Span
from lumigraph.operators.camera import Camera
from lumigraph.propagation import propagate
from lumigraph.propagation.window import smooth_size
from lumigraph.scene import Points, Slice, sources

COARSEST_PUPIL = 512
"""Samples across the pupil, at least."""

FINEST_PUPIL = 1500
"""Samples across the pupil, at most, unless a blur is wider than that resolves."""

PERIOD = 3.0
"""The pupil's samples make h repeat itself after this many times its largest offset from the axis."""

_TRANSFERS = ByteCache()


@dataclass(frozen=True, slots=True, eq=False)
class SingleLensOperator:
    """Raw image of an incoherent plane at one depth, and its adjoint: a `ForwardModel`.

    Parameters
    ----------
    transfer
        DFT (ny, nx // 2 + 1) of a point's image over all offsets between object and sensor.
    window
        Samples (ny, nx) of those DFTs.
    spread
        Matrices that bring the object onto the image's samples, along y and along x.
    collect
        Matrices that integrate the image over the pixels, along y and along x.
    object_grid
        Samples of the object.
    """

    transfer: np.ndarray
    window: tuple[int, int]
    spread: tuple[band.Sparse, band.Sparse]
    collect: tuple[band.Sparse, band.Sparse]
    object_grid: Grid

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Pixels (ny, nx) of the raw image, samples (y, x) of the object."""
        pixels = self.collect[0].shape[0], self.collect[1].shape[0]
        return pixels, self.object_grid.shape

    def _repr_html_(self) -> str:
        return picture.operator_card("Operator of a single lens", self.shape)

    def forward(self, intensity: Array, /) -> Array:
        """Raw image (ny, nx), turned by 180°, of an object's intensity (y, x) on `object_grid`."""
        return self.imaged(band.both(self.spread, intensity))

    def adjoint(self, raw: Array, /) -> Array:
        """Transpose of `forward`: (y, x) on `object_grid` from a raw image (ny, nx)."""
        xp, (rows, columns) = arrays.namespace(raw), self._samples
        arrived = _framed(band.both_adjoint(self.collect, raw), (rows - 1, columns - 1))
        spectrum = arrays.rfft2(arrived, self.window) * xp.conj(arrays.like(self.transfer, raw))
        return band.both_adjoint(self.spread, arrays.irfft2(spectrum, self.window)[:rows, :columns])

    def psf(self, index: tuple[int, ...], /) -> Array:
        """Raw image (ny, nx) of one object sample (y, x) of intensity 1."""
        point = np.zeros(self.object_grid.shape, np.float32)
        point[index] = 1
        return self.forward(point)

    @property
    def _samples(self) -> tuple[int, int]:
        """Of the image that the object covers."""
        return self.spread[0].shape[0], self.spread[1].shape[0]

    def imaged(self, samples: Array) -> Array:
        """Raw image of what was brought onto the image's samples."""
        spectrum = arrays.rfft2(samples, self.window) * arrays.like(self.transfer, samples)
        (top, left), (rows, columns) = self._samples, (matrix.shape[1] for matrix in self.collect)
        image = arrays.irfft2(spectrum, self.window)
        return band.both(self.collect, image[top - 1 : top - 1 + rows, left - 1 : left - 1 + columns])


def fits(camera: Camera) -> bool:
    """Whether the camera has no lenslets."""
    return camera.lattice is None


def single_lens_operator(camera: Camera, grid: Grid, dz: float = 0.0) -> SingleLensOperator:
    """Operator from a plane at depth `dz`, sampled on `grid`, to the raw image; transfers are kept for reuse.

    Parameters
    ----------
    camera
        Without lenslets.
    grid
        Samples of the object [m], each of them a point that stands for its area.
    dz
        Depth of the plane from the focused one [m], positive farther.

    Raises
    ------
    SamplingError
        The camera has lenslets, or the image's samples do not fit in memory.
    """
    return _operator(camera, (grid.y, grid.x), grid, dz)


def slice_image(camera: Camera, part: Slice) -> np.ndarray:
    """Raw image (ny, nx) of a slice."""
    operator = single_lens_operator(camera, part.grid, part.dz)
    return operator.forward(arrays.to_numpy(part.intensity).astype(np.float32))


def points_image(camera: Camera, points: Points) -> np.ndarray:
    """Raw image (ny, nx) of points, wherever they are: one convolution for each depth."""
    total = np.zeros(camera.sensor.shape, np.float32)
    for dz in np.unique(points.positions[:, 2]):
        chosen = points.positions[:, 2] == dz
        y, x, _ = points.positions[chosen].T
        # A point of intensity 1 counts as one sample of the camera's own object grid.
        operator = _operator(camera, (y, x), camera.object_grid, float(dz))
        along_y, along_x = (matrix.matrix for matrix in operator.spread)
        samples = (along_y * points.intensities[chosen]) @ along_x.T
        total += operator.imaged(samples.toarray().astype(np.float32))
    return total


def _operator(
    camera: Camera, places: tuple[np.ndarray, np.ndarray], grid: Grid, dz: float
) -> SingleLensOperator:
    """Operator from points at `places` along y and x; `grid` says how large a sample is."""
    if not fits(camera):
        raise SamplingError("the camera has lenslets: use periodic_operator.")
    distance, pitch = camera.object_distance + dz, image_pitch(camera)
    scale, pixels = -camera.separation / distance, camera.sensor.grid
    spans, spread, collect = [], [], []
    for at, centers, width in zip(places, (pixels.y, pixels.x), pixels.pitch, strict=True):
        here = Span.around(scale * float(at.max()), scale * float(at.min()), pitch)  # scale is below 0
        there = Span.around(-centers[-1] - width / 2, -centers[0] + width / 2, pitch)
        spans.append((here, there))
        spread.append(band.placed(scale * at, here))
        collect.append(band.integrated(-centers, width, there))  # a readout is turned by 180°
    rows, columns = (smooth_size(here.count + there.count - 1) for here, there in spans)
    window = rows, columns
    _check_memory(window, camera)
    offsets = [Span(there.first - here.last, here.count + there.count - 1, pitch) for here, there in spans]
    light = math.prod(grid.pitch) * camera.separation**2 / (math.pi * camera.pupil_diameter**2 / 4)
    key = repr((offsets, distance, light, camera.wavelength, camera.separation, camera.lens_train()))
    transfer = _TRANSFERS.get(
        key, lambda: arrays.rfft2(_point_image(camera, distance, offsets, light), window)
    )
    return SingleLensOperator(transfer, window, (spread[0], spread[1]), (collect[0], collect[1]), grid)


def image_pitch(camera: Camera) -> float:
    """Distance of the samples that hold the image [m]: λL/(2D) and some closer."""
    finest = camera.wavelength * camera.separation / (2 * camera.pupil_diameter)
    return finest / band.OVERSAMPLING


def _point_image(camera: Camera, distance: float, offsets: list[Span], light: float) -> np.ndarray:
    """Image (ny, nx) of a point on the axis at the given offsets, times `light`, float32."""
    spot = camera.wavelength * camera.separation / camera.pupil_diameter
    blur = _blur(camera, distance)
    wanted = max(max(abs(span.first), abs(span.last)) * span.pitch for span in offsets)
    reach = min(wanted, max(FINEST_PUPIL * spot / PERIOD, 1.5 * blur + 50 * spot))
    near = [_cropped(span, reach) for span in offsets]
    across = max(COARSEST_PUPIL, math.ceil(PERIOD * reach / spot))
    pupil = Grid.square(across + 3, camera.pupil_diameter / across)
    with warnings.catch_warnings():  # a smooth converging wave: its samples do not stand for points
        warnings.simplefilter("ignore", SamplingWarning)
        point = sources.point_source(pupil, camera.wavelength, distance, paraxial=True)
        behind = camera.lens_train()(point)
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


def _blur(camera: Camera, distance: float) -> float:
    """Radius of a point's geometric image [m]."""
    lenses = [part for part in camera.lens_train().elements if isinstance(part, ThinLens)]
    vergence = sum(1 / lens.focal_length for lens in lenses) - 1 / distance
    return camera.pupil_diameter / 2 * abs(1 - camera.separation * vergence)


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


def _framed(array: Array, before: tuple[int, int]) -> Array:
    """(y, x) with so many rows of zeros above and columns of zeros to the left."""
    xp = arrays.namespace(array)
    kind = {"dtype": array.dtype, "device": array.device}
    array = xp.concat([xp.zeros((array.shape[0], before[1]), **kind), array], axis=1)
    return xp.concat([xp.zeros((before[0], array.shape[1]), **kind), array], axis=0)


def _check_memory(window: tuple[int, int], camera: Camera) -> None:
    memory.require(
        20.0 * math.prod(window) + 8 * math.prod(camera.sensor.shape),
        f"the image's {window[0]} x {window[1]} samples",
        "Use fewer pixels, a smaller object, or a larger f-number.",
        SamplingError,
    )
