"""Images of points that are followed back to what differs between pairs of instruments a little apart."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol, cast

import numpy as np

from lumigraph.errors import GeometryError
from lumigraph.information.points import (
    CameraSource,
    MicroscopeSource,
    collected,
    has_phase,
    small,
    source,
    spread,
)
from lumigraph.instruments import LensletCamera, LightFieldMicroscope
from lumigraph.instruments.capabilities import WithObjective
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.with_parts import WithParts
from lumigraph.operators.fourier_changes import Behind, Pupil, Slopes, pupils
from lumigraph.operators.fourier_microscope import Window, lit_ones, overlap
from lumigraph.operators.microscope_pupil import PupilImages
from lumigraph.operators.part_leaning import LeaningPoints, points_before
from lumigraph.operators.part_points import PartPoints
from lumigraph.operators.pupil_points import Lit, PupilPoints
from lumigraph.scene import Points

Pair = tuple[Instrument, Instrument]
"""Instruments a little to either side."""

Back = Callable[[np.ndarray], None]
"""Takes slopes (4, ny, nx) by parts of a point's light and their derivatives."""


class Followed(Protocol):
    """Images of some points, one after the other."""

    @property
    def depths(self) -> Sequence[float]:
        """Depth of each point [m]."""
        ...

    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image (4, ny, nx) of a point with derivatives, as `Source.lit`, and the function back from it."""
        ...

    def along(self) -> np.ndarray:
        """(n,), what the sum of all that went back changes by from the first to the last of each pair."""
        ...


def require_followed(instrument: Instrument) -> None:
    """Refuse an instrument whose images of points are not followed back to its parts.

    Raises
    ------
    GeometryError
        A camera without `part_images`, or a microscope without `pupil_images`.
    """
    if isinstance(instrument, WithParts):
        instrument.part_images([])
    elif not isinstance(instrument, WithObjective):
        raise GeometryError(
            "only cameras and microscopes have derivatives of bounds by an instrument's parts. For others, "
            "use search 'local'."
        )
    elif not instrument.in_pupil and not has_phase(cast(LightFieldMicroscope, instrument)):
        raise GeometryError(
            "derivatives of bounds by a microscope's parts need a model other than 'rays'. Use one, or "
            "search 'local'."
        )


def followed(
    instrument: Instrument, pairs: Sequence[Pair], depths: np.ndarray, numbers: range, accuracy: float
) -> Iterator[Followed]:
    """Images of points at some places of each depth, followed back to pairs' differences.

    They shine alike before all, who collect as much of it as their apertures do.

    Raises
    ------
    GeometryError
        Another instrument, or pairs between which more differs than what images change with by little.
    """
    require_followed(instrument)
    for one in (end for pair in pairs for end in pair):
        require_followed(one)
        require_alike(instrument, one)
    if isinstance(instrument, WithParts):
        yield before_camera(instrument, cast(Sequence[Cameras], pairs), (depths, numbers), accuracy)
        return
    scope, scopes = cast(LightFieldMicroscope, instrument), cast(Sequence[Scopes], pairs)
    if not scope.in_pupil:
        yield before_lenslets(scope, scopes, (depths, numbers), accuracy)
        return
    for far in np.unique(np.abs(depths)):  # windows are as wide as in `bounds`
        yield BeforeMicroscope(scope, scopes, depths[np.abs(depths) == far], numbers)


OPTICAL = ("pixel_pitch", "shape"), ("pixel_pitch", "shape", "fill_factor", "angular_response")
"""Keys of sensors that images, not their noise, follow from: of microscopes and of cameras."""


def require_alike(instrument: Instrument, other: Instrument) -> None:
    """Refuse an instrument that differs by more than optics.

    Raises
    ------
    GeometryError
        Other sensors or numbers of lenslets.
    """
    own, names = instrument.sensor, OPTICAL[isinstance(instrument, WithParts)]
    same = replace(other.sensor, **{name: getattr(own, name) for name in names})
    counts = [_lenslets(one) for one in (instrument, other)]
    if type(instrument) is not type(other) or same != own or counts[0] != counts[1]:
        raise GeometryError(
            "bounds and errors can be differentiated by the optics and the pixels' pitch, but two "
            "instruments have different numbers of lenslets, or different sensors. Use search 'local'."
        )


def _lenslets(instrument: Instrument) -> tuple[int, ...]:
    """Number of lenslets; empty for a camera without any."""
    if isinstance(instrument, WithParts) and not isinstance(instrument, LensletCamera):
        return ()
    return cast(LensletCamera, instrument).lenslets.count


Cameras = tuple[WithParts, WithParts]


def _cut(camera: WithParts, depths: np.ndarray, like: WithParts | None = None) -> WithParts:
    """Camera with as few lenslets as `bounds` has; all pixels without any, since they see background."""
    if isinstance(camera, LensletCamera):
        return small(camera, depths, like=cast(LensletCamera | None, like))
    return camera


def before_camera(
    camera: WithParts, pairs: Sequence[Cameras], where: tuple[np.ndarray, range], accuracy: float
) -> PartPoints | LeaningPoints:
    """Images of a camera, cut to lit lenslets or pixels, at depths, and numbers of places in a cell."""
    depths, own = np.sort(where[0]), _cut(camera, where[0])
    cut = [tuple(_cut(end, where[0], like=own) for end in pair) for pair in pairs]
    images = own.part_images(cast(Sequence[Cameras], cut), accuracy=accuracy)

    def points(end: WithParts, whole: WithParts) -> Points:
        seen, share = CameraSource(end, accuracy), collected(whole) / collected(camera)
        places = [
            [*place, dz] for dz in depths.tolist() for place in spread(seen.cell(dz), where[1]).tolist()
        ]
        return Points(np.array(places), np.array([share * seen.part(dz) for *_, dz in places]))

    ends = [
        (points(low, pair[0]), points(high, pair[1])) for (low, high), pair in zip(cut, pairs, strict=True)
    ]
    return points_before(images, points(own, camera), ends)


Scopes = tuple[LightFieldMicroscope, LightFieldMicroscope]


def before_lenslets(
    scope: LightFieldMicroscope, pairs: Sequence[Scopes], where: tuple[np.ndarray, range], accuracy: float,
    *, double: bool = False,
) -> "BeforeLenslets":  # fmt: skip
    """Images of a microscope whose lenslets stand in its image, at depths and numbers of places."""
    depths, numbers = where
    far = float(np.abs(depths).max())

    def lit(end: LightFieldMicroscope, images: PupilImages) -> Lit:
        seen = MicroscopeSource(end, accuracy)
        light = collected(end) / collected(scope) / seen.whole
        places = [[*place, dz] for dz in depths.tolist() for place in spread(seen.cell(dz), numbers).tolist()]
        return Lit(images, Points(np.array(places), np.full(len(places), light)))

    own, ends = scope.images_alike(pairs, far, accuracy=accuracy, double=double)
    moved = [
        (lit(low, first), lit(high, last)) for (low, high), (first, last) in zip(pairs, ends, strict=True)
    ]
    return BeforeLenslets(lit(scope, own), moved)


class BeforeLenslets(PupilPoints):
    """`Followed` before a microscope whose lenslets stand in its image."""

    @property
    def depths(self) -> Sequence[float]:
        """Depths, as `Followed.depths`."""
        return self.own.points.positions[:, 2].tolist()


class BeforeMicroscope:
    """`Followed` before a Fourier microscope.

    Parameters
    ----------
    scope, pairs
        And others a little to either side.
    depths
        All as far from focus [m].
    numbers
        Of places in a cell, at each depth.
    """

    def __init__(
        self, scope: LightFieldMicroscope, pairs: Sequence[Scopes], depths: np.ndarray, numbers: range
    ) -> None:
        self._scope, self._pairs, self._planes = scope, pairs, depths
        points, cell = scope.fourier_points(), source(scope, depths, 1e-2).cell
        self._lit = lit_ones(points.objectives[0], points.mosaic)
        self._own = pupils(points, depths, self._lit)
        self._by = [Slopes.none(one) for one in self._own]
        self._places = [
            (k, place) for k, dz in enumerate(depths.tolist()) for place in spread(cell(dz), numbers)
        ]

    @property
    def depths(self) -> Sequence[float]:
        """Depths, as `Followed.depths`."""
        return [float(self._planes[k]) for k, _ in self._places]

    def lit(self, number: int) -> tuple[np.ndarray, Back]:
        """Image and function that leads back, as `Followed.lit`."""
        behind = [Behind.of(one, *self._places[number]) for one in self._own]
        windows = [_window(one, self._scope.sensor.shape) for one in behind]
        seen = np.zeros((4, *self._scope.sensor.shape))
        for one, (raw, inside) in zip(behind, windows, strict=True):
            seen[(slice(None), *raw)] += one.lit()[(slice(None), *inside)]
        return seen, partial(self._back, behind, windows)

    def _back(self, behind: list[Behind], windows: list[tuple[Window, Window]], by: np.ndarray) -> None:
        for k, (one, (raw, inside)) in enumerate(zip(behind, windows, strict=True)):
            size = 2 * one.pupil.half + 1
            given = np.zeros((4, size, size))
            given[(slice(None), *inside)] = by[(slice(None), *raw)]
            self._by[k] = one.back(given, self._by[k])

    def along(self) -> np.ndarray:
        """Changes, as `Followed.along`."""
        return np.array([self._between(pair) for pair in self._pairs])

    def _between(self, pair: Scopes) -> float:
        ends = [self._pupils(one) for one in pair]
        return sum(one.along(low, high) for one, low, high in zip(self._by, *ends, strict=True))

    def _pupils(self, scope: LightFieldMicroscope) -> list[Pupil]:
        share = collected(scope) / collected(self._scope)
        return pupils(scope.fourier_points(), self._planes, self._lit, share, self._own)


def _window(one: Behind, shape: tuple[int, int]) -> tuple[Window, Window]:
    corner = one.nearest - one.pupil.half + np.array(shape) // 2
    size = 2 * one.pupil.half + 1
    return overlap(corner.tolist(), (size, size), shape)
