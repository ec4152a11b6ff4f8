r"""Cameras whose array or sensor leans, with derivatives by whatever differs between those a little apart.

As `leaning` has it, an image is :math:`\sum_n w_n I_n` of few flat cameras, at distances that are the same
for all that are compared: what changes are their images and, with the tilts, the weights of their pixels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from lumigraph.operators.lenslets.gradient import Moved
from lumigraph.operators.lenslets.paraxial_error import resolved
from lumigraph.operators.lenslets.part_points import Back, PartPoints, SteppedPoints
from lumigraph.operators.lenslets.point_images import PointImages, one_lens, require_paraxial
from lumigraph.operators.lenslets.tilted_planes import near
from lumigraph.operators.lenslets.whole_planes import PlaneImages
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.scene import Points

Seen = TypeVar("Seen", bound=PlaneImages)
Other = TypeVar("Other", bound=PlaneImages)


@dataclass(frozen=True, eq=False)
class TiltedImages(Generic[Seen]):
    """Images of points or planes by a camera that leans, with derivatives by what differs in pairs of it.

    Parameters
    ----------
    parts
        (n,), of flat cameras.
    weights
        (n, ny, nx), of their pixels.
    moved
        (pairs, n, ny, nx), from the first to the last camera of each pair.
    """

    parts: tuple[Seen, ...]
    weights: np.ndarray
    moved: np.ndarray

    @property
    def shape(self) -> Any:
        """Shape as of the flat cameras."""
        return self.parts[0].shape

    def each(self, of: Callable[[Seen], Other]) -> "TiltedImages[Other]":
        """The same of something else of each flat camera."""
        return TiltedImages(tuple(map(of, self.parts)), self.weights, self.moved)

    def forward(self, x: Any) -> np.ndarray:
        """Raw image (ny, nx): those of the flat cameras, weighed and added."""
        return np.sum([weight * part.forward(x) for weight, part in self._both()], axis=0)

    def derivative(self, x: Any, change: np.ndarray) -> np.ndarray:
        """Change of the raw image (ny, nx) along a change of the pairs (n,)."""
        found = np.sum([weight * part.derivative(x, change) for weight, part in self._both()], axis=0)
        by = np.tensordot(np.asarray(change, np.float64), self.moved, 1)
        return found + np.sum([one * part.forward(x) for one, part in self._both(by)], axis=0)

    def gradient(self, x: Any, weights: np.ndarray) -> np.ndarray:
        """Gradient by the pairs (n,) of a weighed raw image: the transpose of `derivative`."""
        given = np.asarray(weights, np.float64)
        found = np.sum([part.gradient(x, weight * given) for weight, part in self._both()], axis=0)
        if not self.moved.any():
            return found
        return found + weighed(self.moved, [given * part.forward(x) for part in self.parts])

    def _both(self, weights: np.ndarray | None = None) -> list[tuple[np.ndarray, Seen]]:
        return list(zip(self.weights if weights is None else weights, self.parts, strict=True))


@dataclass(eq=False)
class TiltedPoints:
    """Points one by one before a camera that leans.

    Parameters
    ----------
    each
        (n,), before flat cameras.
    weights, moved
        As of `TiltedImages`.
    """

    each: Sequence[PartPoints]
    weights: np.ndarray
    moved: np.ndarray

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.moved))

    @property
    def depths(self) -> Sequence[float]:
        """Depths of the points, as of a flat camera [m]."""
        return self.each[0].depths

    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image of a point (ny, nx), and the way back from weights of it."""
        some = [one.lit(number) for one in self.each]
        image = np.sum([weight * seen for weight, (seen, _) in zip(self.weights, some, strict=True)], axis=0)
        return image, partial(self._back, some)

    def along(self) -> np.ndarray:
        """Slopes along the pairs (n,), as of a flat camera."""
        return self._found + np.sum([one.along() for one in self.each], axis=0)

    def _back(self, some: list[tuple[np.ndarray, Back]], given: np.ndarray) -> None:
        self._found += weighed(self.moved, [given * seen for seen, _ in some])
        for weight, (_, back) in zip(self.weights, some, strict=True):
            back(weight * given)


def weighed(moved: np.ndarray, seen: Sequence[np.ndarray]) -> np.ndarray:
    """(pairs,), sums over pixels of changes of weights times what each flat camera shows (..., ny, nx)."""
    pixels = np.stack([one.reshape(-1, *moved.shape[2:]).sum(0) for one in seen])
    return np.tensordot(moved, pixels, 3)


def by_parts(
    camera: HasOptics, pairs: Sequence[tuple[HasOptics, HasOptics]], accuracy: float
) -> PointImages | TiltedImages[PointImages]:
    """Images by an instrument and pairs a little beside it, which have its model where theirs is "auto".

    Raises
    ------
    GeometryError
        As of `PointImages`.
    SamplingError
        As of `leaning.flat`.
    """
    own, ends = resolved(camera.optics(), accuracy), [end.optics() for both in pairs for end in both]
    ends = [replace(end, model=own.model) if end.model == "auto" else end for end in ends]
    both = tuple(zip(ends[::2], ends[1::2], strict=True))
    plain = own.model == "exact" or all(one.lean is None for one in (own, *ends))
    return PointImages(own, both, accuracy) if plain else _leaning(own, both, accuracy)


def points_before(
    images: PointImages | TiltedImages[PointImages], points: Points, moved: Sequence[Moved]
) -> PartPoints | TiltedPoints:
    """Points one by one, before any camera; elsewhere before those of each pair."""
    if isinstance(images, TiltedImages):
        each = [_flat(one, points, moved) for one in images.parts]
        return TiltedPoints(each, images.weights, images.moved)
    return _flat(images, points, moved)


def _flat(images: PointImages, points: Points, moved: Sequence[Moved]) -> PartPoints:
    turned = images.camera.model == "paraxial" and one_lens(images.camera)
    return (PartPoints if turned else SteppedPoints)(images, points, moved)


def _leaning(
    camera: CameraOptics, pairs: Sequence[tuple[CameraOptics, CameraOptics]], accuracy: float
) -> TiltedImages[PointImages]:
    """Images of points by cameras of which one leans at least."""
    for one in (camera, *(end for pair in pairs for end in pair)):
        require_paraxial(one)
    found = near(camera, [end for pair in pairs for end in pair], accuracy)
    own, ends = found.of(camera), [(found.of(low), found.of(high)) for low, high in pairs]
    parts = tuple(
        PointImages(one, tuple((low.cameras[n], high.cameras[n]) for low, high in ends), accuracy)
        for n, one in enumerate(own.cameras)
    )
    moved = np.array([high.weights - low.weights for low, high in ends])
    return TiltedImages(parts, own.weights, moved.reshape(len(ends), *own.weights.shape))
