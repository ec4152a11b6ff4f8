r"""Images of points before a camera with lenslets, and how they change with whatever changes of it.

A point's light is a product of matrices, and a raw image what pixels take of its square,

.. math:: I = R\,|U|^2, \quad U = A(E_y P E_x^T), \quad
          \delta I = R\,2\,\mathrm{Re}(U^* \delta U) + \delta R\,|U|^2

with P the wave in the main lens, E phases of nodes there times those of places before the lenslets, and A
the way past these, whose steps are each linear in a matrix (`passed`). How all matrices change with a length,
the wavelength or a term of the phase is the difference of two cameras a little apart, sampled alike; all else
is differentiated. What is made of the image is followed back to them once, so that each camera more
costs no product of large matrices.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.individual_lenslets import one_by_one
from lumigraph.operators.lenslets.part_lens import SampledLens
from lumigraph.operators.lenslets.part_waves import (
    Both,
    CameraChange,
    PairChanges,
    PointWaves,
    Where,
    read_anew,
)
from lumigraph.operators.lenslets.point_changes import PUPIL
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.glass_distortion import seen_points
from lumigraph.operators.sampling.sampling_rules import COARSEST
from lumigraph.scene import Points

FINEST = 1e-3
"""Accuracy that can be asked for: finer ones would need many samples across the main lens."""

TOGETHER = 256
"""Points whose slopes, and all matrices that they see, are kept at a time."""

Weighed = tuple[float, Both, Where | None]
"""How many times from the first to the last of a pair, both, and where points are before them."""


class Gradient(Protocol):
    """Slopes of a number by what points' fields follow from."""

    def add(self, waves: Any, by: np.ndarray) -> None:
        """Those that come from slopes by the field of a point, without conjugates."""
        ...

    def along(self) -> np.ndarray:
        """(n,), what they come to from the first to the last camera of each pair."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class _Some:
    """A few of the points.

    Parameters
    ----------
    own, ends
        The camera, which knows no others, and those of each pair.
    spots, where
        The points.
    x
        (k, points), how bright each is in each object.
    """

    own: SampledCamera
    ends: list[Both]
    spots: list[SourcePoint]
    where: list[Where | None]
    x: np.ndarray

    def weighed(self, change: Sequence[float]) -> list[Weighed]:
        """So many times from the first to the last of each pair."""
        return list(zip(change, self.ends, self.where, strict=True))

    def bright(self, spot: SourcePoint) -> np.ndarray:
        """(k,), a point's light in each object."""
        return spot.intensity * self.x[:, spot.number]


@dataclass(frozen=True, eq=False)
class PartImages:
    """How a camera sees points, with derivatives by what differs between pairs of cameras.

    Points shine as samples of the camera's own object grid, as `simulate` has them. Objects that are made
    of the same points are seen in little more time than one.

    Parameters
    ----------
    camera
        Paraxial, without lenslets or with some of any shape and focal lengths; squares of one may differ.
    pairs
        (n,), cameras a little to either side of it: by a length, a term of the phase, the wavelength.
    accuracy
        Relative rms error of points' images.

    Raises
    ------
    GeometryError
        Another camera; one of a pair that has another number of pixels or lenslets, or others missing.
    SamplingError
        An accuracy out of 1e-3 to 1e-2.
    """

    camera: CameraOptics
    pairs: tuple[tuple[CameraOptics, CameraOptics], ...]
    accuracy: float = 1e-2

    def __post_init__(self) -> None:
        check_parts(self.camera, self.pairs, self.accuracy, require_paraxial)
        camera, *ends = one_by_one((self.camera, *(end for pair in self.pairs for end in pair)))
        object.__setattr__(self, "camera", camera)
        object.__setattr__(self, "pairs", tuple(zip(ends[::2], ends[1::2], strict=True)))

    @property
    def shape(self) -> tuple[int, int]:
        """Of a raw image."""
        return self.camera.sensor.shape

    def forward(self, points: Points) -> np.ndarray:
        """Raw image (ny, nx) of points."""
        return self.forwards(points, _once(points))[0]

    def derivative(self, points: Points, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward`, so many times (n,) from the first to the last camera of each pair."""
        check_change(self.pairs, change)
        return self.derivatives(points, _once(points), np.asarray(change, np.float64).tolist())[0]

    def gradient(self, points: Points, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels."""
        check_weights(self.shape, weights)
        return self.gradients(points, _once(points), np.asarray(weights, np.float64)[None])

    @single_products()
    def forwards(self, points: Points, x: np.ndarray) -> np.ndarray:
        """Raw images (k, ny, nx) of objects in which points are so many times as bright (k, points)."""
        own, *given = self.before(points)
        light = np.zeros((len(x), *own.shape))
        for some in self._some(own, given, x):
            for spot in some.spots:
                _add(light, some, spot, np.abs(self.waves(some.own, spot).field) ** 2)
        return np.stack([own.read.forward(one) for one in light])

    @single_products()
    def derivatives(self, points: Points, x: np.ndarray, change: list[float]) -> np.ndarray:
        """Changes (k, ny, nx) of `forwards`."""
        own, *given = self.before(points)
        light, moved = np.zeros((2, len(x), *own.shape))
        for some in self._some(own, given, x):
            changed = self.changing(some.own, some.spots, some.weighed(change))
            for spot in some.spots:
                waves = self.waves(some.own, spot)
                _add(light, some, spot, np.abs(waves.field) ** 2)
                _add(moved, some, spot, 2 * np.real(waves.field.conj() * changed(waves)))
        found = np.stack([own.read.forward(one) for one in moved])
        for weight, (low, high) in zip(change, self.ends(own), strict=True):
            if low.read is not high.read:
                found += [weight * (high.read.forward(one) - low.read.forward(one)) for one in light]
        return found

    @single_products()
    def gradients(self, points: Points, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivatives`: (n,), the sum over objects, each with its weights (k, ny, nx)."""
        own, *given = self.before(points)
        seen, light = np.stack([own.read.adjoint(one) for one in weights]), np.zeros((len(x), *own.shape))
        found = np.zeros(len(self.pairs))
        for some in self._some(own, given, x):
            told = self.by_pairs(some.own, some.ends, some.where)
            for spot in some.spots:
                waves = self.waves(some.own, spot)
                _add(light, some, spot, np.abs(waves.field) ** 2)
                asked = np.tensordot(some.bright(spot), seen[(slice(None), *spot.window)], 1)
                told.add(waves, asked * waves.field.conj())
            found += told.along()
        for k, both in enumerate(self.ends(own)):
            found[k] += sum(read_anew(both, light[n], one) for n, one in enumerate(weights))
        return found

    def _some(self, own: SampledCamera, given: Sequence[Any], x: np.ndarray) -> Iterator[_Some]:
        """Those that shine, a few at a time, by depth."""
        points, where = given
        order = np.argsort(points.positions[:, 2], kind="stable")
        order = order[x[:, order].any(0)]
        for k in range(0, len(order), TOGETHER):
            kept, sight = order[k : k + TOGETHER], own.anew
            moved = [one and (_only(one[0], kept), _only(one[1], kept)) for one in where]
            yield _Some(sight, self.ends(sight), own.spots(_only(points, kept)), moved, x[:, kept])

    def ends(self, own: SampledCamera) -> list[Both]:
        """Cameras of each pair."""
        return [(own.alike(_thin(first)), own.alike(_thin(last))) for first, last in self.pairs]

    def before(
        self, points: Points, moved: Sequence[Where] | None = None, fewest: int = PUPIL
    ) -> tuple[SampledCamera, Points, list[Where | None]]:
        """The camera before points, where its main lens sees these, and where those of each pair do.

        Points that are `moved` are elsewhere before the cameras of each pair. Light is sampled by so many
        nodes across the lens at least.
        """
        camera, mine = seen_points(self.camera, points)
        own = (SampledCamera if camera.array else SampledLens).of(camera, mine, self.accuracy, fewest)
        if moved is None and self.camera.objects is None:
            return own, mine, [None] * len(self.pairs)
        known = [(points, points)] * len(self.pairs) if moved is None else moved
        return (
            own,
            mine,
            [
                (seen_points(low, first)[1], seen_points(high, last)[1])
                for (low, high), (first, last) in zip(self.pairs, known, strict=True)
            ],
        )

    def waves(self, own: SampledCamera, spot: SourcePoint) -> Any:
        """A point's light on its way, whose `field` is on the samples (y, x)."""
        return PointWaves.of(own, spot)

    def changing(
        self, own: SampledCamera, spots: Sequence[SourcePoint], pairs: Sequence[Weighed]
    ) -> Callable[[Any], np.ndarray]:
        """Gives how the field of some points changes between cameras, by their light on its way."""
        by = CameraChange.of(own, pairs, spots)
        return lambda waves: waves.changed(own, by)

    def by_pairs(self, own: SampledCamera, ends: Sequence[Both], moved: Sequence[Where | None]) -> Gradient:
        """What takes slopes by such light, to changes between the cameras of pairs."""
        return PairChanges(own, ends, moved)


def _once(points: Points) -> np.ndarray:
    return np.ones((1, len(points.intensities)))


def _only(points: Points, kept: np.ndarray) -> Points:
    return Points(points.positions[kept], points.intensities[kept])


def _add(light: np.ndarray, some: _Some, spot: SourcePoint, image: np.ndarray) -> None:
    """What a point brings to the light (k, y, x) of each object."""
    light[(slice(None), *spot.window)] += np.multiply.outer(some.bright(spot), image)


def _thin(camera: CameraOptics) -> CameraOptics:
    """The thin lens in the exit pupil, of one of glass."""
    return replace(camera, objects=None)


def check_parts(
    camera: CameraOptics,
    pairs: Sequence[tuple[CameraOptics, CameraOptics]],
    accuracy: float,
    require: Callable[[CameraOptics], None],
) -> None:
    """Refuse accuracies out of range, and cameras that are refused or have other numbers of parts."""
    if not FINEST <= accuracy <= COARSEST:
        raise SamplingError(f"accuracy is {accuracy:g} but must lie between {FINEST:g} and {COARSEST:g}.")
    for one in (camera, *(end for pair in pairs for end in pair)):
        require(one)
        _require_as_many(one, camera)
        _require_as_thin(one, camera)


def check_change(pairs: Sequence[object], change: np.ndarray) -> None:
    """Refuse another number of changes than of pairs."""
    if np.shape(change) != (len(pairs),):
        raise GeometryError(f"change has shape {np.shape(change)} but must be ({len(pairs)},).")


def check_weights(shape: tuple[int, int], weights: np.ndarray) -> None:
    """Refuse weights that are no raw image."""
    if np.shape(weights) != shape:
        raise GeometryError(f"weights have shape {np.shape(weights)} but the raw image {shape}.")


def require_paraxial(camera: CameraOptics) -> None:
    """Refuse cameras whose light behind lenslets is no product along two axes."""
    if camera.model != "paraxial":
        raise GeometryError(
            "derivatives by a camera's parts are between cameras of one model, but one of a pair is exact "
            "and the camera itself is not. Use model = 'paraxial' for all, or 'exact'."
        )


def _require_as_many(camera: CameraOptics, other: CameraOptics) -> None:
    """Refuse cameras between which more differs than numbers that change by little."""
    counts = []
    for one in (camera, other):
        extent, pitches = (one.array.extent, one.array.lattice.pitches) if one.array else (None, ())
        counts.append(tuple(round(e / p) for e, p in zip(extent or (), pitches, strict=False)))
    if camera.sensor.shape != other.sensor.shape or counts[0] != counts[1]:
        raise GeometryError(
            f"cameras have {camera.sensor.shape} and {other.sensor.shape} pixels, {counts[0]} and "
            f"{counts[1]} lenslets, but derivatives need as many. Give lenslets.count and sensor.shape."
        )


def _require_as_thin(camera: CameraOptics, other: CameraOptics) -> None:
    """Refuse main lenses of which one alone changes over the field, or is of glass."""
    kinds = [(field_lenses.plate_of(one) is None, one.objects is None) for one in (camera, other)]
    if kinds[0] != kinds[1]:
        raise GeometryError(
            "the main lens of one camera changes over the field, or is of glass, and that of another is not. "
            "Derivatives are between lenses of one kind: give over_field or prescription to all."
        )


def one_lens(camera: CameraOptics) -> bool:
    """Whether points of all fields are seen through the same thin lens."""
    return camera.objects is None and field_lenses.plate_of(camera) is None
