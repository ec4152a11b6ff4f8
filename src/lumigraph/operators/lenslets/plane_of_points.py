r"""Raw images of a plane before cameras in which no image repeats: of its samples, each a point of light.

With K_s the image of sample s (`part_images`), :math:`I_n = \sum_s x_{n,s} K_s`. Each point is seen, and
followed back, once for all objects: what these and their weights say of its image is a sum over them. No
image is kept, so that memory does not grow with the samples.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError
from lumigraph.operators.lenslets.film_plane import FilmPlane
from lumigraph.operators.lenslets.paraxial_error import field_matters
from lumigraph.operators.lenslets.part_images import PartImages, one_lens
from lumigraph.operators.lenslets.part_plane import PartPlane
from lumigraph.operators.lenslets.whole_planes import WholePlane
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.time_limits import A_MINUTE, LONGEST, said
from lumigraph.scene import Points

SQUARE = 16
"""Samples along the sides of squares, one after the other: points in one share what lenslets do to light."""

EXACT = 8
"""Operations of a point before an exact camera, over those of a paraxial one that is sampled alike."""


@dataclass(frozen=True, eq=False)
class PlaneOfPoints(WholePlane):
    """How a camera sees a plane, with derivatives by what differs between pairs of cameras.

    The object's samples stay where they are, and as bright for their area, before all cameras.

    Parameters
    ----------
    images
        The cameras'.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].

    Raises
    ------
    SamplingError
        By its methods: images that do not fit in memory, or points that take too long.

    Warns
    -----
    SamplingWarning
        By its methods: points that take more than a minute.
    """

    images: PartImages
    grid: Grid
    dz: float = 0.0

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Of a raw image and of an object."""
        return self.images.shape, self.grid.shape

    @property
    def _count(self) -> int:
        return len(self.images.pairs)

    def _forward(self, objects: list[np.ndarray]) -> list[np.ndarray]:
        return list(self._as_bright.forwards(self._points, self._bright(objects)))

    def _derivative(self, objects: list[np.ndarray], change: list[float]) -> list[np.ndarray]:
        return list(self._as_bright.derivatives(self._points, self._bright(objects), change))

    def _gradient(self, objects: list[np.ndarray], pixels: list[np.ndarray]) -> np.ndarray:
        return self._as_bright.gradients(self._points, self._bright(objects), np.stack(pixels))

    def _bright(self, objects: list[np.ndarray]) -> np.ndarray:
        """(k, points) of objects that can be seen."""
        x = np.stack([one.ravel()[self._order] for one in objects])
        self._check(len(x), int(x.any(0).sum()))
        return x

    def _check(self, objects: int, points: int) -> None:
        """Refuse what takes too much memory or time; warn of minutes."""
        own, mine, _ = self._as_bright.before(self._points)
        (spot,) = own.spots(Points(mine.positions[len(mine.positions) // 2, None], np.ones(1)))
        y, x = (len(places) for places in own.lenslets.places(*spot.cells))
        sums = EXACT if self.images.camera.model == "exact" else 1
        memory.require(
            8.0 * (3 * objects * math.prod(own.shape) + 4 * sums * (own.nodes + y) * (own.nodes + x)),
            f"light of {objects} objects on {own.shape[0]} x {own.shape[1]} samples",
            "Use fewer pixels or lenslets, or fewer objects at a time.", SamplingError,
        )  # fmt: skip
        operations = 8.0 * points * sums * own.nodes * x * (own.nodes + y)
        if operations > LONGEST:
            raise SamplingError(
                f"{points} samples are as many points, of which an image takes {operations:.0e} operations, "
                f"{operations / A_MINUTE:.0f} min of a processor that does 1e11 a second; {LONGEST:.0e} are "
                "allowed. Use a smaller grid, or one of fewer samples."
            )
        said(operations, f"an image of {points} samples, as many points, takes")

    @cached_property
    def _as_bright(self) -> PartImages:
        """The same cameras, of which a point stands for a sample: as bright before all."""
        area = math.prod(self.grid.pitch)

        def seeing(camera: CameraOptics) -> CameraOptics:
            scale = 1.0 if camera.objects is None else camera.objects.pupil_magnification
            return replace(camera, object_pitch=scale * math.sqrt(area))

        pairs = tuple((seeing(low), seeing(high)) for low, high in self.images.pairs)
        return replace(self.images, camera=seeing(self.images.camera), pairs=pairs)

    @cached_property
    def _order(self) -> np.ndarray:
        """Numbers of the samples, one square after the other."""
        numbers = np.arange(math.prod(self.grid.shape)).reshape(self.grid.shape)
        rows = (np.array_split(part, -(-part.shape[1] // SQUARE), 1) for part in np.array_split(
            numbers, -(-len(numbers) // SQUARE)
        ))  # fmt: skip
        return np.concatenate([square.ravel() for row in rows for square in row])

    @cached_property
    def _points(self) -> Points:
        y, x = (one.ravel()[self._order] for one in np.meshgrid(self.grid.y, self.grid.x, indexing="ij"))
        return Points(np.stack([y, x, np.full(y.shape, self.dz)], axis=1), np.ones(y.size))


def plane_before(images: PartImages, grid: Grid, dz: float) -> WholePlane:
    """Before cameras that see points as `images` have them: whole where images repeat, or by points."""
    camera = images.camera
    if one_lens(camera) and camera.array is None and camera.model == "paraxial":
        return FilmPlane(images, grid, dz)
    return (PartPlane if _repeats(camera, images.accuracy) else PlaneOfPoints)(images, grid, dz)


def _repeats(camera: CameraOptics, accuracy: float) -> bool:
    """Whether points of all cells of an array have the same images."""
    if not one_lens(camera) or camera.array is None or camera.array.scatter is not None:
        return False
    return camera.model != "exact" or not field_matters(camera, accuracy)
