"""Scenes imaged through a medium by a microscope: each lit sample is a point with its own image."""

import math
import warnings
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress
from lumigraph.errors import GeometryError, SamplingError, SamplingWarning
from lumigraph.operators.microscope_medium import Seen
from lumigraph.operators.microscope_pupil import PupilImages
from lumigraph.scene import Diffuser, Medium, Points, Scene, Slice
from lumigraph.sensor import Sensor
from lumigraph.simulation import error

MOST = 5000
"""Points that are followed: each takes some seconds."""

SAID = 60.0
"""Seconds that are said before they are spent."""

PUPIL, FINEST = 0.7, 1e-5
"""Part of the accuracy that images without steps are made for: the distance of slices may take the rest."""


class Seeing(Protocol):
    """Protocol of a light-field microscope that images through a medium."""

    @property
    def sensor(self) -> Sensor:
        """Pixels."""
        ...

    @property
    def object_grid(self) -> Grid:
        """Samples of the focused plane: a point of 1 sends what one of them does."""
        ...

    def pupil_images(self, terms: Sequence[int], *, farthest: float, accuracy: float) -> PupilImages:
        """Images of points by the pupil."""
        ...


def lit_points(scope: Seeing, scene: Scene) -> Points:
    """All points and lit samples of a scene.

    Raises
    ------
    GeometryError
        A diffuser, which stands behind any medium, or coloured slices.
    SamplingError
        More points than are followed.
    """
    places, lights = [], []
    for part in scene.parts:
        if isinstance(part, Diffuser):
            raise GeometryError("a white image has no medium before it. Leave the diffuser or medium out.")
        found = part if isinstance(part, Points) else _samples(part, scope.object_grid)
        places.append(found.positions)
        lights.append(found.intensities)
    points = Points(np.concatenate(places), np.concatenate(lights))
    if len(points.intensities) > MOST:
        raise SamplingError(
            f"the scene has {len(points.intensities)} points and lit samples but a medium takes {MOST} at "
            "most: each is imaged separately. Use a smaller scene, or samples farther apart."
        )
    return points


def _samples(part: Slice, grid: Grid) -> Points:
    """Points of a slice, scaled by the area of its samples over those of the microscope."""
    if part.intensity.ndim != 2:
        raise GeometryError(
            f"a slice has shape {tuple(part.intensity.shape)} but a medium needs grey (y, x)."
        )
    picture = arrays.to_numpy(part.intensity)
    rows, columns = np.nonzero(picture)
    depths = np.full(len(rows), part.dz)
    places = np.stack([part.grid.y[rows], part.grid.x[columns], depths], 1)
    share = math.prod(part.grid.pitch) / math.prod(grid.pitch)
    return Points(places, picture[rows, columns] * share)


def medium_image(
    scope: Seeing, points: Points, medium: Medium, accuracy: float, progress: Progress | None
) -> tuple[np.ndarray, float]:
    """Raw image of points through a medium, and its estimated relative rms error.

    Raises
    ------
    GeometryError
        Something else than a `Medium`; a Fourier microscope or rays.
    """
    checks.instance("medium", medium, Medium)
    farthest = max(abs(float(dz)) for dz in (*points.positions[:, 2], *medium.depths))
    own = max(PUPIL * accuracy, FINEST)
    seen = Seen(scope.pupil_images((), farthest=farthest, accuracy=own), medium)
    _say_how_long(seen, points)
    between = _between_planes(seen, points, accuracy)
    whole, off, lost = np.zeros(scope.sensor.shape), 0.0, 0.0
    for number, (light, place) in enumerate(zip(points.intensities, points.positions, strict=True)):
        one = seen.image(place)
        whole += float(light) * one.image
        off += (float(light) * error.norm(one.image)) ** 2 * (own**2 + one.steps**2 + between**2)
        lost = max(lost, one.lost)
        if progress is not None:
            progress((number + 1) / len(points.intensities))
    if lost > 10 * accuracy:
        warnings.warn(
            f"the medium sends {lost:.2g} of a point's light beside the lenslets that are looked at: it is "
            f"missing from the raw image, of which {accuracy:g} was asked.",
            SamplingWarning,
            stacklevel=4,
        )
    return whole, math.sqrt(off) / (error.norm(whole) or 1.0)


def _say_how_long(seen: Seen, points: Points) -> None:
    """Warn, before anything starts, of points that take minutes."""
    count, seconds = len(points.intensities), seen.seconds(points.positions[:, 2])
    if seconds > SAID:
        told = f"{seconds / 60:.2g} min" if seconds < 7200 else f"{seconds / 3600:.2g} h"
        warnings.warn(
            f"{count} point{'s' * (count > 1)} through the medium: some {told} of this processor, at least. "
            "Use fewer points or slices, slices nearer to the points, or a smaller numerical aperture where "
            "that is too long.",
            SamplingWarning,
            stacklevel=5,
        )


def _between_planes(seen: Seen, points: Points, accuracy: float) -> float:
    """Relative rms error from a volume's spacing of planes, for the brightest of the deepest points."""
    deepest = points.positions[:, 2] >= points.positions[:, 2].max()
    place = points.positions[int(np.argmax(np.where(deepest, points.intensities, -np.inf)))]
    between = seen.between_planes(place)
    if between > accuracy:
        depths = seen.medium.depths
        step = abs(depths[0] - depths[-1]) / (len(depths) - 1)
        warnings.warn(
            f"the volume's planes stand {step * 1e6:.3g} µm apart: with twice as many, interpolated, a "
            f"point's image changes by {between:.2g} rms; {accuracy:g} was asked. Give nearer planes.",
            SamplingWarning,
            stacklevel=5,
        )
    return between
