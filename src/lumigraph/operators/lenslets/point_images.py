r"""Images of points before a camera, and how they change with whatever changes of it.

A point's light is a product of matrices, and a raw image what pixels take of its square,

.. math:: I = R\,|U|^2, \quad U = A(E_y P E_x^T),

with P the wave in the main lens, E phases of nodes there times those of places before the lenslets, and A the
propagation through these. All of it is computed from a camera's numbers, by lines that an array library
differentiates: derivatives are the numbers' slopes times their differences between two cameras a little
apart. Images of points add up, so that each is followed back alone, once for all cameras.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.cameras import sampled
from lumigraph.operators.lenslets.gradient import Both, Gradient, Moved, Tangent, read_anew
from lumigraph.operators.lenslets.individual import one_by_one
from lumigraph.operators.lenslets.paraxial_error import is_possible
from lumigraph.operators.lenslets.sampled_camera import SPARE, SampledCamera, SourcePoint
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.glass_distortion import seen_points
from lumigraph.operators.sampling.sampling_rules import COARSEST
from lumigraph.scene import Points

FINEST = 1e-3
"""Finest accuracy of derivatives."""

TOGETHER = 256
"""Points whose slopes, and all matrices that they see, are kept at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class _Some:
    """A few of the points.

    Parameters
    ----------
    own, ends
        The camera, which knows no others, and those of each pair.
    sources, moved
        The points, and where they are before the cameras of each pair.
    x
        (k, points), how bright each is in each object.
    """

    own: SampledCamera
    ends: list[Both]
    sources: list[SourcePoint]
    moved: list[Moved | None]
    x: np.ndarray

    def bright(self, source: SourcePoint) -> np.ndarray:
        """(k,), a point's light in each object."""
        return source.intensity * self.x[:, source.number]


@dataclass(frozen=True, eq=False)
class PointImages:
    """Images of points by a camera, with derivatives by what differs in pairs of cameras.

    Points shine as samples of the camera's own object grid, as `simulate` has them. Objects that are made
    of the same points are seen in little more time than one.

    Parameters
    ----------
    camera
        Without lenslets or with some of any shape and focal lengths; squares of one may differ.
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
        check_cameras(self.camera, self.pairs, self.accuracy)
        camera, *ends = one_by_one((self.camera, *(end for pair in self.pairs for end in pair)))
        object.__setattr__(self, "camera", camera)
        object.__setattr__(self, "pairs", tuple(zip(ends[::2], ends[1::2], strict=True)))

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of a raw image."""
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
        for some in self._some((own, []), given, x):
            for source in some.sources:
                _add(light, some, source, squared(some.own.own_field(source)[0]))
        return np.stack([own.read.forward(one) for one in light])

    @single_products()
    def derivatives(self, points: Points, x: np.ndarray, change: list[float]) -> np.ndarray:
        """Changes (k, ny, nx) of `forwards`."""
        own, *given = self.before(points)
        light, moved = np.zeros((2, len(x), *own.shape))
        ends = self.ends(own)
        for some in self._some((own, ends), given, x):
            by = Tangent.of(some.own, list(zip(change, some.ends, some.moved, strict=True)), some.sources)
            for source in some.sources:
                for plane, one in zip((light, moved), by.intensity(source), strict=True):
                    _add(plane, some, source, one)
        found = np.stack([own.read.forward(one) for one in moved])
        for weight, (low, high) in zip(change, ends, strict=True):
            if low.read is not high.read:
                found += [weight * (high.read.forward(one) - low.read.forward(one)) for one in light]
        return found

    @single_products()
    def gradients(self, points: Points, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivatives`: (n,), the sum over objects, each with its weights (k, ny, nx)."""
        own, *given = self.before(points)
        seen, light = np.stack([own.read.adjoint(one) for one in weights]), np.zeros((len(x), *own.shape))
        found, ends = np.zeros(len(self.pairs)), self.ends(own)
        for some in self._some((own, ends), given, x):
            gradient = self.by_pairs(some.own, some.ends, some.moved)
            for source in some.sources:
                asked = np.tensordot(some.bright(source), seen[(slice(None), *source.window)], 1)
                _add(light, some, source, gradient.add(source, asked))
            found += gradient.along()
        return found + sum(read_anew(own, ends, light[n], one) for n, one in enumerate(weights))

    def _some(
        self, cameras: tuple[SampledCamera, list[Both]], given: Sequence[Any], x: np.ndarray
    ) -> Iterator[_Some]:
        """Points that shine, a few at a time, by depth."""
        (own, ends), (points, where) = cameras, given
        order = np.argsort(points.positions[:, 2], kind="stable")
        order = order[x[:, order].any(0)]
        for k in range(0, len(order), TOGETHER):
            kept, few = order[k : k + TOGETHER], own.anew if k else own
            mine = self.ends(few) if k and ends else ends
            moved = [one and (_only(one[0], kept), _only(one[1], kept)) for one in where]
            yield _Some(few, mine, own.sources(_only(points, kept)), moved, x[:, kept])

    def ends(self, own: SampledCamera) -> list[Both]:
        """Cameras of each pair, sampled as another."""
        return [(own.alike(_thin(first)), own.alike(_thin(last))) for first, last in self.pairs]

    def before(
        self, points: Points, moved: Sequence[Moved] | None = None, beside: float = 0.0
    ) -> tuple[SampledCamera, Points, list[Moved | None]]:
        """The camera before points, where its main lens sees these, and where those of each pair do.

        Points that are `moved` are elsewhere before the cameras of each pair. Others may be `beside` the
        points [m in the lenslet plane].
        """
        camera, mine = seen_points(self.camera, points)
        own = sampled(camera).of(camera, mine, SPARE * self.accuracy, beside=beside)
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

    def by_pairs(self, own: SampledCamera, ends: Sequence[Both], moved: Sequence[Moved | None]) -> Gradient:
        """Slopes of a number by all that points' light follows from, to changes between cameras of pairs."""
        return Gradient(own, ends, moved)


def squared(field: np.ndarray) -> np.ndarray:
    """Intensity of a field."""
    return field.real**2 + field.imag**2


def _once(points: Points) -> np.ndarray:
    return np.ones((1, len(points.intensities)))


def _only(points: Points, kept: np.ndarray) -> Points:
    return Points(points.positions[kept], points.intensities[kept])


def _add(light: np.ndarray, some: _Some, source: SourcePoint, image: np.ndarray) -> None:
    """Adds what a point brings to the light (k, y, x) of each object."""
    light[(slice(None), *source.window)] += np.multiply.outer(some.bright(source), image)


def _thin(camera: CameraOptics) -> CameraOptics:
    """The thin lens in the exit pupil, of one of glass."""
    return replace(camera, objects=None)


def check_cameras(
    camera: CameraOptics, pairs: Sequence[tuple[CameraOptics, CameraOptics]], accuracy: float
) -> None:
    """Refuse accuracies out of range, and cameras that are refused or have other numbers of parts."""
    if not FINEST <= accuracy <= COARSEST:
        raise SamplingError(f"accuracy is {accuracy:g} but must lie between {FINEST:g} and {COARSEST:g}.")
    require: Callable[[CameraOptics], None] = require_exact if camera.model == "exact" else require_paraxial
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


def require_exact(camera: CameraOptics) -> None:
    """Refuse cameras that are not exact as images of points are."""
    array = camera.array
    plain = array is not None and array.scatter is None and camera.objects is None
    if not (plain and camera.model == "exact" and is_possible(camera)):
        raise GeometryError(
            "derivatives by a camera's parts with model = 'exact' are of square lenslets of one focal length "
            "that are alike, behind a thin lens, and all cameras have that model. Leave over_field, "
            "prescription and scatter out, or use model = 'paraxial' for all."
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
    """True if points of all fields are seen through the same thin lens."""
    return camera.objects is None and field_lenses.plate_of(camera) is None
