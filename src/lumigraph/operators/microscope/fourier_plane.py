r"""Raw images of a plane before a Fourier microscope, and their derivatives by its parts.

Behind each lenslet the image is one convolution with that of a point on the axis, which follows from a pupil
(`fourier_changes`),

.. math:: I = \sum_j h_j * x, \quad x = S o

where S spreads the object's samples onto points as fine as the pixels. Pupils and S are compared between
microscopes a little apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.gradient import times
from lumigraph.operators.lenslets.whole_planes import WholePlane
from lumigraph.operators.microscope.fourier_changes import FourierGradient, LensletImage, SampledPupil, pupils
from lumigraph.operators.microscope.fourier_microscope import FourierMicroscopeOperator, lit_ones
from lumigraph.operators.microscope.fourier_points import FourierPoints
from lumigraph.operators.sampling.resampling import represented

Both = tuple[FourierPoints, FourierPoints]
"""Of a pair."""


@dataclass(frozen=True, eq=False)
class FourierPlane(WholePlane):
    """Images of a plane before a Fourier microscope, with derivatives by differences of pairs of microscopes.

    The object's samples stay where they are; an even object of 1 is 1 behind a whole lenslet on the axis, of
    all microscopes. What stands beyond the field of a lenslet is left out.

    Parameters
    ----------
    points
        The microscope's.
    pairs
        (n,), of microscopes a little to either side.
    grid
        Samples of the object.
    dz
        Depth from the focused plane [m].

    Raises
    ------
    GeometryError
        Microscopes of another number of lenslets, wavelengths or pixels.
    """

    points: FourierPoints
    pairs: Sequence[Both]
    grid: Grid
    dz: float = 0.0

    def __post_init__(self) -> None:
        own = _counts(self.points)
        for end in (end for pair in self.pairs for end in pair):
            if _counts(end) != own:
                raise GeometryError(
                    f"microscopes have {_counts(end)} and {own} wavelengths, lenslets and pixels, but "
                    "derivatives need as many. Give lenslets.count and sensor.shape."
                )

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of a raw image and of an object."""
        return self.points.mosaic.shape, self.grid.shape

    @property
    def _count(self) -> int:
        return len(self.pairs)

    def _forward(self, objects: list[np.ndarray]) -> list[np.ndarray]:
        onto = self._spread(self.points)
        return [self._operator.forward(onto.forward(one)) for one in objects]

    def _derivative(self, objects: list[np.ndarray], change: list[float]) -> list[np.ndarray]:
        images, moved = np.zeros_like(self._operator.images), [np.zeros(self._field) for _ in objects]
        for weight, pair, ends in zip(change, self.pairs, self._ends, strict=True):
            low, high = map(self._spread, pair)
            for one, x in zip(moved, objects, strict=True):
                one += weight * (high.forward(x) - low.forward(x))
            for number, (behind, *both) in enumerate(zip(self._behind, *ends, strict=True)):
                self._window(images, number)[...] += weight * behind.changed(*both)
        changed, onto = self._with(images), self._spread(self.points)
        return [
            self._operator.forward(one) + changed.forward(onto.forward(x))
            for one, x in zip(moved, objects, strict=True)
        ]

    def _gradient(self, objects: list[np.ndarray], pixels: list[np.ndarray]) -> np.ndarray:
        onto, operator = self._spread(self.points), self._operator
        asked = np.zeros_like(operator.images)
        for x, weights in zip(objects, pixels, strict=True):
            asked[0] += operator.by_images(onto.forward(x), weights)
        told, by = [operator.adjoint(weights) for weights in pixels], []
        for number, behind in enumerate(self._behind):
            given = np.zeros((4, *self._window(asked, number).shape))
            given[0] = self._window(asked, number)
            by.append(behind.back(given, FourierGradient.none(behind.pupil)))
        found = np.zeros(len(self.pairs))
        for k, (pair, ends) in enumerate(zip(self.pairs, self._ends, strict=True)):
            found[k] = sum(one.along(*both) for one, *both in zip(by, *ends, strict=True))
            low, high = map(self._spread, pair)
            for x, back in zip(objects, told, strict=True):
                found[k] += times(back, low.forward(x), high.forward(x))
        return found

    def _spread(self, end: FourierPoints) -> Linear:
        """Resampling onto points that stand as the pixels do."""
        pitch = end.mosaic.pixel_pitch / end.mosaic.total_magnification
        return represented(self.grid, Grid(self._field, (pitch, pitch)), upright=True)

    @property
    def _field(self) -> tuple[int, int]:
        n = self.points.mosaic.field
        return n, n

    @cached_property
    def _behind(self) -> list[LensletImage]:
        """A point on the axis, behind each lenslet at each wavelength."""
        return [LensletImage.of(one, 0, np.zeros(2)) for one in self._pupils(self.points, None)]

    @cached_property
    def _ends(self) -> list[tuple[list[SampledPupil], list[SampledPupil]]]:
        own = [one.pupil for one in self._behind]
        return [(self._pupils(low, own), self._pupils(high, own)) for low, high in self.pairs]

    def _pupils(self, end: FourierPoints, like: list[SampledPupil] | None) -> list[SampledPupil]:
        lit = lit_ones(self.points.objectives[0], self.points.mosaic)
        return pupils(end, np.array([self.dz]), lit, end.whole, like)

    @cached_property
    def _operator(self) -> FourierMicroscopeOperator:
        half, lenslets = max(one.pupil.half for one in self._behind), self._lenslets
        images = np.zeros((1, lenslets, 2 * half + 1, 2 * half + 1))
        for number, behind in enumerate(self._behind):
            self._window(images, number)[...] += behind.lit()[0]
        return self._with(images)

    def _with(self, images: np.ndarray) -> FourierMicroscopeOperator:
        """Operator with images (1, lenslets, w, w) of a point on the axis."""
        nearest = np.array([one.nearest for one in self._behind[: self._lenslets]])
        corners = nearest + np.array(self.shape[0]) // 2 - images.shape[-1] // 2 - self._field[0] // 2
        return FourierMicroscopeOperator(images, corners, self.shape[0], self._field)

    @property
    def _lenslets(self) -> int:
        return len(self._behind) // len(self.points.objectives)

    def _window(self, images: np.ndarray, number: int) -> np.ndarray:
        """Window of a lenslet, as wide as its wavelength's image."""
        half, most = self._behind[number].pupil.half, images.shape[-1] // 2
        inside = slice(most - half, most + half + 1)
        return images[0, number % self._lenslets, inside, inside]


def _counts(points: FourierPoints) -> tuple[int, int, tuple[int, int]]:
    return len(points.objectives), len(points.mosaic.centers), points.mosaic.shape
