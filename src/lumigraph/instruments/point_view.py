"""The image of one point of light by wave optics, at once: on the few lenslets that it reaches."""

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.linear import Linear
from lumigraph.errors import SamplingError, SamplingWarning
from lumigraph.instruments.grids import Sampling
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.simulation.camera import Camera

MOST_ALONG = 15
"""Lenslets along each side that are simulated."""

MOST_SAMPLES = 9e6
"""Largest number of samples of a plane: about two seconds."""

_MOST_PIXELS = 1200


@dataclass(frozen=True, slots=True, eq=False)
class PointImage:
    """Image of a point on the sensor.

    Parameters
    ----------
    data
        Intensity (y, x), upright as raw images are.
    pixel_pitch
        [m].
    lenslets
        Along y and x, that were simulated; None without lenslets.
    notes
        Remarks on doubtful sampling, and on what was left out.
    """

    data: np.ndarray
    pixel_pitch: float
    lenslets: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()


class Simulated(Camera, Protocol):
    """A camera with few lenslets, or none."""

    @cached_property
    def sampling(self) -> Sampling:
        """Sampling of the planes."""
        ...


def of_camera(small: Simulated, dz: float, count: tuple[int, int] | None = None) -> PointImage:
    """Image of a point on the axis, through the camera's own train of elements.

    Parameters
    ----------
    small
        The camera, with only as many lenslets as the light reaches.
    dz
        From the focused plane [m].
    count
        Number of those lenslets; None without them.

    Raises
    ------
    GeometryError
        A depth inside the focal length.
    SamplingError
        Planes too large for an answer at once.
    """
    _check(small.sampling)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        raw = simulate(small, targets.points([(0.0, 0.0, dz)]))
    notes = tuple(str(each.message) for each in caught if issubclass(each.category, SamplingWarning))
    return PointImage(_middle(to_numpy(raw.data)), small.sensor.pixel_pitch, count, notes)


def of_operator(operator: Linear, pixel_pitch: float) -> PointImage:
    """Image of the middle of an operator's only plane."""
    _, ny, nx = operator.shape[1]
    return PointImage(_middle(to_numpy(operator.psf((0, ny // 2, nx // 2)))), pixel_pitch)


def reached(spread: float, pitch: float, count: tuple[int, int]) -> tuple[int, int]:
    """Odd numbers of lenslets (ny, nx) that light so wide [m] reaches, two more, at most those there are."""
    wanted = 2 * math.ceil(spread / pitch / 2) + 3
    y, x = (min(max(wanted, 5), n, MOST_ALONG) for n in count)
    return y, x


def _check(sampling: Sampling) -> None:
    grids = [sampling.pupil_grid, sampling.image_grid, sampling.lenslet_grid]
    largest = max(math.prod(grid.shape) for grid in grids if grid is not None)
    if largest > MOST_SAMPLES:
        raise SamplingError(
            f"the point's image needs planes of {largest:.3g} samples, more than the {MOST_SAMPLES:.3g} that "
            "are simulated at once. Use 'lumigraph simulate', or a slower main lens."
        )


def _middle(data: np.ndarray) -> np.ndarray:
    """The middle of a large picture."""
    cut = [slice(max(0, (n - _MOST_PIXELS) // 2), max(0, (n - _MOST_PIXELS) // 2) + _MOST_PIXELS)
           for n in data.shape[:2]]  # fmt: skip
    return data[cut[0], cut[1]]
