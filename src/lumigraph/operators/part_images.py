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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators import varying
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.each import one_by_one
from lumigraph.operators.fineness import COARSEST
from lumigraph.operators.part_lens import LensSight
from lumigraph.operators.part_sight import Sight
from lumigraph.operators.part_waves import Both, Change, Slopes, Waves, Where, pupils, read_anew, times
from lumigraph.operators.seen import seen_points
from lumigraph.scene import Points

FINEST = 1e-3
"""Accuracy that can be asked for: finer ones would need many samples across the main lens."""


@dataclass(frozen=True, eq=False)
class PartImages:
    """How a camera sees points, with derivatives by what differs between pairs of cameras.

    Points shine as samples of the camera's own object grid, as `simulate` has them.

    Parameters
    ----------
    camera
        Paraxial, without lenslets or with some of any shape and focal lengths; squares of one may differ by
        chance.
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

    @single_products()
    def forward(self, points: Points) -> np.ndarray:
        """Raw image (ny, nx) of points."""
        own, mine, _ = self.before(points)
        light = np.zeros(own.shape)
        for spot in own.spots(mine):
            light[spot.window] += spot.intensity * np.abs(Waves.of(own, spot).field) ** 2
        return own.read.forward(light)

    @single_products()
    def derivative(self, points: Points, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward`, so many times (n,) from the first to the last camera of each pair."""
        check_change(self.pairs, change)
        own, mine, moved = self.before(points)
        light, changed, spots = np.zeros(own.shape), np.zeros(own.shape), own.spots(mine)
        weights = np.asarray(change, np.float64).tolist()
        by = Change.of(own, zip(weights, self.ends(own), moved, strict=True), spots)
        for spot in spots:
            waves = Waves.of(own, spot)
            light[spot.window] += spot.intensity * np.abs(waves.field) ** 2
            changed[spot.window] += 2 * spot.intensity * np.real(waves.field.conj() * waves.changed(own, by))
        return own.read.forward(changed) + by.sum(lambda one: one.read.forward(light))

    @single_products()
    def gradient(self, points: Points, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels."""
        check_weights(self.shape, weights)
        own, mine, moved = self.before(points)
        seen, by, light = own.read.adjoint(np.asarray(weights, np.float64)), Slopes(), np.zeros(own.shape)
        found, ends = np.zeros(len(self.pairs)), self.ends(own)
        for _, some in groupby(own.spots(mine), own.seen_from):
            pupil, spots = np.zeros(()), list(some)
            for spot in spots:
                waves = Waves.of(own, spot)
                light[spot.window] += spot.intensity * np.abs(waves.field) ** 2
                pupil = pupil + by.add(waves, spot.intensity * seen[spot.window] * waves.field.conj())
            found += [times(pupil, *pupils(spots[0], *pair)) for pair in zip(ends, moved, strict=True)]
        seen_anew = [read_anew(both, light, weights) for both in ends]
        along = [
            by.along((first.anew, last.anew), where) for (first, last), where in zip(ends, moved, strict=True)
        ]
        return 2 * (found + along) + seen_anew

    def ends(self, own: Sight) -> list[Both]:
        """Cameras of each pair."""
        return [(own.alike(_thin(first)), own.alike(_thin(last))) for first, last in self.pairs]

    def before(
        self, points: Points, moved: Sequence[Where] | None = None
    ) -> tuple[Sight, Points, list[Where | None]]:
        """The camera before points, where its main lens sees these, and where those of each pair do.

        Points that are `moved` are elsewhere before the cameras of each pair.
        """
        camera, mine = seen_points(self.camera, points)
        own = (Sight if camera.array else LensSight).of(camera, mine, self.accuracy)
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
    kinds = [(varying.plate_of(one) is None, one.objects is None) for one in (camera, other)]
    if kinds[0] != kinds[1]:
        raise GeometryError(
            "the main lens of one camera changes over the field, or is of glass, and that of another is not. "
            "Derivatives are between lenses of one kind: give over_field or prescription to all."
        )


def one_lens(camera: CameraOptics) -> bool:
    """Whether points of all fields are seen through the same thin lens."""
    return camera.objects is None and varying.plate_of(camera) is None
