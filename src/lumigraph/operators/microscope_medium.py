"""Raw images of points that a microscope sees through a medium, by its pupil: each point has its own."""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_pupil import PupilImages
from lumigraph.operators.multislice import Multislice
from lumigraph.scene import Medium

SPLIT = 3.0
"""What slices together in pairs are off by, over what single ones are: errors fall as the square of steps."""


@dataclass(frozen=True, slots=True)
class Through:
    """A point's image.

    Parameters
    ----------
    image
        Raw image (ny, nx) of intensity 1.
    steps
        Relative rms by which the distance of slices puts it off: estimated by putting pairs of them together.
    lost
        Part of its light that falls beside the window that was looked at.
    """

    image: np.ndarray
    steps: float
    lost: float


def image_through(images: PupilImages, medium: Medium, position: np.ndarray) -> Through:
    """Of a point at (y, x, dz) [m], seen through the slices before it.

    Raises
    ------
    SamplingError
        More samples than can be followed.
    """
    met = medium.before(float(position[2]))
    plain = images.through(position, _nothing, _away(images, None, position))
    if met is None:
        return Through(images.placed(plain), 0.0, 0.0)
    fine, share = _seen(images, met, position)
    if len(met.depths) > 1:
        coarse = _seen(images, met.coarser(), position)[0]
        steps = float(np.linalg.norm(fine - coarse) / SPLIT / (np.linalg.norm(fine) or 1.0))
    else:
        steps = 0.0
    lost = max(0.0, 1 - float(fine.sum() / (plain.sum() or 1.0)) / share)
    return Through(images.placed(fine), steps, lost)


def _seen(images: PupilImages, met: Medium, position: np.ndarray) -> tuple[np.ndarray, float]:
    """Samples of a point's image, and the light in its pupil over that without slices."""
    shares = []

    def factor(objective: Objective, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
        y, x, dz = map(float, position)
        found = Multislice(objective, met, dz).factor(y, x, qy, qx)
        shares.append(float(np.mean(np.square(np.abs(found)))))
        return found

    image = images.through(position, factor, _away(images, met, position))
    return image, float(np.mean(shares))


def _away(images: PupilImages, met: Medium | None, position: np.ndarray) -> float:
    """How far from focus a point would be whose light is spread as far as slices spread this one's [m]."""
    dz = float(position[2])
    if met is None:
        return dz
    farthest = 0.0
    for one in images.objectives:
        bent = Multislice(one, met, dz).bent
        cosine = math.sqrt(one.medium**2 - one.aperture**2)
        farthest = max(farthest, (dz - met.depths[-1]) * bent / one.medium * cosine / one.aperture)
    return math.copysign(abs(dz) + farthest, dz)


def _nothing(objective: Objective, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
    return np.ones(np.broadcast(qy, qx).shape)
