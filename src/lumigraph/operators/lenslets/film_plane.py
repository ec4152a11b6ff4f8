r"""Raw images of a plane before a camera without lenslets, and how they change with whatever changes of it.

Behind one lens for all fields a plane's image is one convolution with that of a point on the axis,

.. math:: I = R\,(h * S o)

where S brings the object's samples onto those of the image, and R is what pixels take. h is differentiated
(`part_images`), and S and R are compared between cameras a little apart.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from lumigraph.core import arrays, memory
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.errors import SamplingError
from lumigraph.operators.lenslets.gradient import Both, Gradient, Tangent
from lumigraph.operators.lenslets.no_lenslets import FilmCamera
from lumigraph.operators.lenslets.point_images import PointImages, squared
from lumigraph.operators.lenslets.sampled_camera import SourcePoint
from lumigraph.operators.lenslets.whole_planes import CellPlane
from lumigraph.operators.sampling.band import Span
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.resampling import represented
from lumigraph.operators.single_lens import object_samples
from lumigraph.propagation.window import smooth_size
from lumigraph.scene import Points


@dataclass(frozen=True, slots=True, eq=False)
class BlurredPoint:
    """Image of a point, which all have, as `whole_planes.RepeatedImages` has those of a cell.

    Parameters
    ----------
    kernel
        (y, x), on samples around it.
    source
        The point.
    """

    kernel: np.ndarray
    source: SourcePoint

    def add(self, light: np.ndarray, points: np.ndarray) -> None:
        """Add the light of points (y, x) to the image's samples, beyond which they go for half a kernel."""
        y, x = (n - 1 for n in self.kernel.shape)
        light += _inverse(_spectrum(points, points) * _spectrum(self.kernel, points), points)[y:, x:]

    def return_to(self, points: np.ndarray, seen: np.ndarray) -> None:
        """The transpose of `add`."""
        back = _spectrum(self._framed(seen), points) * _spectrum(self.kernel, points).conj()
        points += _inverse(back, points)

    def asked(self, points: Sequence[np.ndarray], seen: Sequence[np.ndarray]) -> np.ndarray:
        """Gradient by the kernel (y, x), as of `RepeatedImages.asked`."""
        both = zip(points, seen, strict=True)
        found = sum(_spectrum(self._framed(light), one) * _spectrum(one, one).conj() for one, light in both)
        y, x = self.kernel.shape
        return _inverse(np.asarray(found), points[0])[:y, :x]

    def _framed(self, seen: np.ndarray) -> np.ndarray:
        y, x = (n - 1 for n in self.kernel.shape)
        return np.pad(seen, ((y, 0), (x, 0)))


@dataclass(frozen=True, eq=False)
class FilmPlane(CellPlane[FilmCamera, BlurredPoint]):
    """Images of a plane by a camera without lenslets, with derivatives by what differs in pairs of cameras.

    The object's samples stay where they are, and as bright for their area, before all cameras.

    Parameters
    ----------
    images
        The cameras', behind one thin lens for all fields.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].

    Raises
    ------
    SamplingError
        By its methods: images that do not fit in memory.
    """

    images: PointImages
    grid: Grid
    dz: float = 0.0

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of a raw image and of an object."""
        return self.images.shape, self.grid.shape

    def _whole(self) -> FilmCamera:
        return self._own

    def _pairs(self) -> Sequence[tuple[FilmCamera, FilmCamera]]:
        return self._ends

    def _read(self, end: FilmCamera) -> Linear:
        return end.read

    def _points(self, end: FilmCamera, x: np.ndarray) -> np.ndarray:
        spans = tuple(
            Span(span.first - half, span.count + 2 * half, span.pitch)
            for span, half in zip(self._own.film.spans, self._halves, strict=True)
        )
        scale = -end.film.camera.separation / (end.film.camera.object_distance + self.dz)
        return represented(self.grid, object_samples((spans[0], spans[1]), scale)).forward(x)

    def _dark(self) -> np.ndarray:
        return np.zeros(self._own.shape)

    def _plane(self, light: np.ndarray) -> np.ndarray:
        return light

    def _cells(self, plane: np.ndarray) -> np.ndarray:
        return plane

    def _blocks(self) -> Iterator[BlurredPoint]:
        sight, source = self._point
        yield BlurredPoint(squared(sight.own_field(source)[0]), source)

    def _changed(self, change: list[float]) -> Callable[[BlurredPoint], BlurredPoint]:
        sight, source = self._point
        weighed = [(weight, both, None) for weight, both in zip(change, self._around, strict=True)]
        changed = Tangent.of(sight, weighed, [source])
        return lambda one: replace(one, kernel=changed.intensity(one.source)[1])

    def _slopes(self) -> "_BlurGradient":
        return _BlurGradient(self._bright.by_pairs(self._point[0], self._around, [None] * len(self._around)))

    @cached_property
    def _bright(self) -> PointImages:
        """The same cameras, of which a point stands for a sample of the image: as bright before all."""

        def seeing(camera: CameraOptics) -> CameraOptics:
            scale = (camera.object_distance + self.dz) / camera.separation
            return replace(camera, object_pitch=self._own.film.spans[0].pitch * scale)

        pairs = tuple((seeing(low), seeing(high)) for low, high in self.images.pairs)
        return replace(self.images, camera=seeing(self.images.camera), pairs=pairs)

    @cached_property
    def _own(self) -> FilmCamera:
        """Camera of the whole image, if it fits in memory."""
        own = cast(FilmCamera, self.images.before(self._middle)[0])
        window = [smooth_size(n + 2 * half) for n, half in zip(own.shape, self._halves_of(own), strict=True)]
        memory.require(
            8.0 * 8 * math.prod(window), f"the image's {window[0]} x {window[1]} samples",
            "Use fewer pixels, or a larger f-number.", SamplingError,
        )  # fmt: skip
        return own

    @cached_property
    def _ends(self) -> list[tuple[FilmCamera, FilmCamera]]:
        return cast(list[tuple[FilmCamera, FilmCamera]], self.images.ends(self._own))

    @cached_property
    def _point(self) -> tuple[FilmCamera, SourcePoint]:
        """A point on the axis, and the camera sampled around its image."""
        own = cast(FilmCamera, self._bright.before(self._middle)[0])
        y, x = (
            Span(-half, 2 * half + 1, span.pitch)
            for half, span in zip(self._halves, own.film.spans, strict=True)
        )
        sight = replace(own, optics=cast(Any, replace(own.film, spans=(y, x))))
        return sight, sight.sources(self._middle)[0]

    @cached_property
    def _around(self) -> list[Both]:
        return self._bright.ends(self._point[0])

    @property
    def _middle(self) -> Points:
        return Points(np.array([[0.0, 0.0, self.dz]]), np.ones(1))

    @property
    def _halves(self) -> tuple[int, int]:
        return self._halves_of(self._own)

    @staticmethod
    def _halves_of(own: FilmCamera) -> tuple[int, int]:
        """Samples to which a point's light is followed, along y and along x."""
        y, x = (math.floor(own.film.far / span.pitch) for span in own.film.spans)
        return y, x


@dataclass(frozen=True, slots=True, eq=False)
class _BlurGradient:
    """Slopes of a number by a point's image; see `whole_planes`."""

    by: Gradient

    def add(self, block: BlurredPoint, asked: np.ndarray) -> None:
        self.by.add(block.source, asked)

    def along(self) -> np.ndarray:
        return self.by.along()


def _window(points: np.ndarray) -> tuple[int, int]:
    y, x = map(smooth_size, points.shape)
    return y, x


def _spectrum(plane: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Spectrum of a plane, on a window that holds all points."""
    return arrays.rfft2(plane, _window(points))


def _inverse(spectrum: np.ndarray, points: np.ndarray) -> np.ndarray:
    y, x = points.shape
    return arrays.irfft2(spectrum, _window(points))[:y, :x]
