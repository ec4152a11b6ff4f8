r"""Images of points before exact lenslets, and how they change with whatever changes of a camera.

As `part_images` has it, :math:`I = R\,|U|^2`. The light U in the lenslet plane is a sum over directions
(`exact_waves`), of a stop whose phase, strength and edge are smooth in them: from one camera to another close
by they change by few numbers. Lenslets are sums of terms, singular vectors; those of other cameras are as
many, and turned so that they go over into the camera's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import numpy as np

from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.exact_lenslets import between, interpolated
from lumigraph.operators.lenslets.exact_light import ObliqueLight
from lumigraph.operators.lenslets.exact_waves import DirectionSum
from lumigraph.operators.lenslets.paraxial_error import is_possible
from lumigraph.operators.lenslets.part_images import PartImages, check_parts
from lumigraph.operators.lenslets.part_waves import Both, CameraChange, Where, before
from lumigraph.operators.lenslets.point_changes import PUPIL
from lumigraph.operators.lenslets.points import share
from lumigraph.operators.lenslets.sampled_camera import SampledCamera, SourcePoint
from lumigraph.operators.lenslets.transmitted import LensletGradient, TransmittedLight, passed, times
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.scene import Points

SMOOTH = 24
"""Numbers along an axis of directions that changes of the stop's phase and strength follow from."""

Numbers = list[np.ndarray]
"""What a point's light follows from, as far as cameras close by differ by it."""


@dataclass(frozen=True, eq=False)
class ExactImages(PartImages):
    """How an exact camera sees points: with square lenslets, exact, behind a thin lens for all fields."""

    def __post_init__(self) -> None:
        check_parts(self.camera, self.pairs, self.accuracy, require_exact)

    def waves(self, own: SampledCamera, spot: SourcePoint) -> "_ExactPoint":
        """As `PartImages.waves`."""
        return _ExactPoint.of(cast(SampledExactCamera, own), spot)

    def by_pairs(
        self, own: SampledCamera, ends: Sequence[Both], moved: Sequence[Where | None]
    ) -> "_ExactPairChanges":
        """As `PartImages.by_pairs`."""
        return _ExactPairChanges(ends, moved)

    def before(
        self, points: Points, moved: Sequence[Where] | None = None, fewest: int = PUPIL
    ) -> tuple["SampledExactCamera", Points, list[Where | None]]:
        """As `PartImages.before`."""
        known: list[Where | None] = [None] * len(self.pairs) if moved is None else [*moved]
        return SampledExactCamera.of(self.camera, points, self.accuracy, fewest), points, known


class SampledExactCamera(SampledCamera):
    """An exact camera before points, and how finely all is sampled."""

    def light(self, spot: SourcePoint) -> ObliqueLight:
        """As `SampledCamera.light`."""
        optics = self._at(spot.dz)
        y, x = self._place(optics, spot.position).tolist()
        return ObliqueLight(optics.camera, _cells.lens(optics.camera), optics.distance, self.nodes, (y, x))

    def strength(self, spot: SourcePoint) -> float:
        """Logarithm of how strong the light of a point of 1 is."""
        return float(np.log(share(self._at(spot.dz)))) / 2

    def around(self, spot: SourcePoint, light: ObliqueLight) -> tuple[np.ndarray, np.ndarray]:
        """Phases (along y, along x) of the places where light is needed [rad, by the cosine]."""
        k = 2 * np.pi / light.camera.wavelength
        y, x = (at - to for at, to in zip(self.lenslets.places(*spot.cells), light.place, strict=True))
        return k * y, k * x


@dataclass(frozen=True, eq=False)
class _ExactPoint:
    """A point's light, before and behind the lenslets.

    Parameters
    ----------
    sight, spot
        The camera's, and the point's.
    within
        How far inside the stop's edge directions are [samples], and a half.
    beams, passed
        In the lenslet plane, and to the samples.
    """

    sight: SampledExactCamera
    spot: SourcePoint
    within: np.ndarray
    beams: DirectionSum
    passed: TransmittedLight

    @classmethod
    def of(cls, sight: SampledExactCamera, spot: SourcePoint) -> "_ExactPoint":
        """Of a point before a camera."""
        light = sight.light(spot)
        y, x = light.directions
        over = light.over(y[:, None], x)
        stop = over.amplitude * np.exp(sight.strength(spot))
        beams = DirectionSum.of(sight.around(spot, light), (y, x), stop, over.bends)
        return cls(sight, spot, over.within, beams, passed(sight.lenslets, beams.light, *spot.cells))

    @property
    def field(self) -> np.ndarray:
        """On the samples (y, x)."""
        return self.passed.field

    @cached_property
    def own(self) -> Numbers:
        """Of the camera itself."""
        return self._numbers(self.sight, self.spot)

    def numbers(self, other: SampledExactCamera, spot: SourcePoint | None = None) -> Numbers:
        """Of a camera close by, and of a point close by; `own` where nothing differs."""
        same = other.before == self.sight.before and other.lenslets is self.sight.lenslets
        if same and (spot is None or spot is self.spot):
            return self.own
        return self._numbers(other, self.spot if spot is None else spot)

    def changed(self, own: SampledCamera, by: CameraChange) -> np.ndarray:
        """As `Waves.changed`."""
        down, across, *directions, smooth, within = self._between(by)
        phase, strength, *bends = self._smooth @ smooth @ self._smooth.T
        stop = self.beams.stop * (strength + 1j * phase)
        stop[self._grey] += self.beams.stop[self._grey] / self.within[self._grey] * within
        moves = (down, across), (directions[0], directions[1]), stop, np.stack(bends)
        return self.passed.changed(self.beams.changed(moves), by.pieces.__getitem__)

    def _between(self, by: CameraChange) -> Numbers:
        """Change of the numbers."""
        found = [np.zeros_like(own) for own in self.own]
        for weight, both, where in by.pairs:
            for number, low, high in zip(found, *self.ends(both, where), strict=True):
                number += weight * (high - low)
        return found

    def ends(self, both: Both, where: Where | None) -> list[Numbers]:
        """Before both cameras of a pair."""
        pairs = zip(both, before(self.spot, where), strict=True)
        return [self.numbers(cast(SampledExactCamera, one), spot) for one, spot in pairs]

    def back(self, by: np.ndarray, slopes: LensletGradient) -> Numbers:
        """Slopes by the numbers, of those by the field; those by matrices are added."""
        (down, across), directions, slope, bends = self.beams.back(self.passed.back(by, slopes))
        slope = slope * self.beams.stop
        stronger = np.real(slope)
        smooth = self._smooth.T @ np.stack([-np.imag(slope), stronger, *bends]) @ self._smooth
        return [down, across, *directions, smooth, stronger[self._grey] / self.within[self._grey]]

    def _numbers(self, sight: SampledExactCamera, spot: SourcePoint) -> Numbers:
        light = sight.light(spot)
        nodes, _ = interpolated(SMOOTH)
        y, x = ((d[-1] + d[0]) / 2 + (d[-1] - d[0]) / 2 * nodes for d in light.directions)
        over = light.over(y[:, None], x)
        smooth = np.stack([over.phase, over.strength + sight.strength(spot), *over.bends])
        grey = light.over(*(d[k] for d, k in zip(light.directions, self._grey, strict=True)))
        return [*sight.around(spot, light), *light.directions, smooth, grey.within]

    @cached_property
    def _grey(self) -> tuple[np.ndarray, ...]:
        """Directions at the stop's edge, which are let through in part."""
        return np.nonzero((self.within > 0) & (self.within < 1))

    @cached_property
    def _smooth(self) -> np.ndarray:
        """From numbers at the nodes to all directions of an axis, which stand evenly."""
        return between(np.linspace(-1, 1, len(self.within)), SMOOTH)


@dataclass(eq=False)
class _ExactPairChanges:
    """As `ByPairs`, of exact cameras."""

    ends: Sequence[Both]
    moved: Sequence[Where | None]
    _lenslets: LensletGradient = field(default_factory=LensletGradient)

    def __post_init__(self) -> None:
        self._found = np.zeros(len(self.ends))

    def add(self, waves: _ExactPoint, by: np.ndarray) -> None:
        """As `ByPairs.add`."""
        slopes = waves.back(by, self._lenslets)
        for k, pair in enumerate(zip(self.ends, self.moved, strict=True)):
            self._found[k] += sum(times(*pieces) for pieces in zip(slopes, *waves.ends(*pair), strict=True))

    def along(self) -> np.ndarray:
        """As `ByPairs.along`."""
        found = [
            self._lenslets.along(first.own.lenslets, first.anew.lenslets, last.anew.lenslets)
            for first, last in self.ends
        ]
        return 2 * (self._found + found)


def require_exact(camera: CameraOptics) -> None:
    """Refuse cameras that `ExactImages` are not of."""
    array = camera.array
    plain = array is not None and array.scatter is None and camera.objects is None
    if not (plain and camera.model == "exact" and is_possible(camera)):
        raise GeometryError(
            "derivatives by a camera's parts with model = 'exact' are of square lenslets of one focal length "
            "that are alike, behind a thin lens, and all cameras have that model. Leave over_field, "
            "prescription and scatter out, or use model = 'paraxial' for all."
        )
