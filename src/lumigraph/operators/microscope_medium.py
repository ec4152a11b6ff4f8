"""Raw images of points that a microscope sees through a medium, by its pupil: each point has its own."""

import math
import time
from dataclasses import dataclass, field

import numpy as np

from lumigraph.core import arrays
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope_pupil import PupilImages
from lumigraph.operators.multislice import Multislice
from lumigraph.scene import Medium

SPLIT = 3.0
"""What slices together in pairs are off by, over what single ones are: errors fall as the square of steps."""

TRANSFORMS = 4.0
"""What a slice takes, in transforms of its samples: two of them, and factors and splines."""

KEPT = 6
"""Depths, of whole slices and of pairs of them, whose waves are held."""


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


@dataclass(frozen=True, eq=False)
class Seen:
    """Images of points through a medium: the common part of one depth is computed once.

    Parameters
    ----------
    images
        Of points by the pupil.
    medium
        All slices.
    """

    images: PupilImages
    medium: Medium
    _lights: dict[tuple[Objective, int, float], Multislice] = field(default_factory=dict)

    def image(self, position: np.ndarray) -> Through:
        """Image of a point at (y, x, dz) [m], through the slices before it.

        Raises
        ------
        SamplingError
            More samples than can be followed.
        """
        images, met = self.images, self.medium.before(float(position[2]))
        plain = images.through(position, _nothing, self._away(None, position))
        if met is None:
            return Through(images.placed(plain), 0.0, 0.0)
        fine, share = self._through(met, position)
        steps = 0.0
        if len(met.depths) > 1:
            coarse = self._through(met.coarser(), position)[0]
            steps = _apart(fine, coarse) / SPLIT
        lost = max(0.0, 1 - float(fine.sum() / (plain.sum() or 1.0)) / share)
        return Through(images.placed(fine), steps, lost)

    def between_planes(self, position: np.ndarray) -> float:
        """Relative rms by which twice as many slices, between which an index goes over evenly, differ."""
        met = self.medium.before(float(position[2]))
        if met is None or met.finer() is met:
            return 0.0
        fine, finer = (self._through(one, position)[0] for one in (met, met.finer()))
        return _apart(fine, finer)

    def seconds(self, depths: np.ndarray) -> float:
        """Least time that points at some depths [m] take, as transforms take on this machine [s].

        Raises
        ------
        SamplingError
            More samples than can be followed, at any of the depths.
        """
        total, known = 0.0, {}
        for dz, points in zip(*np.unique(depths, return_counts=True), strict=True):
            if (met := self.medium.before(float(dz))) is None:
                continue
            for objective in self.images.objectives:
                count, slices = self._light(objective, met, float(dz)).grid.shape[0], len(met.depths)
                if count not in known:
                    known[count] = _transform(count)
                halves = slices + (slices + 1) // 2 if slices > 1 else 1
                total += int(points) * halves * TRANSFORMS * known[count]
        return total

    def _through(self, met: Medium, position: np.ndarray) -> tuple[np.ndarray, float]:
        """Samples of a point's image, and the light in its pupil over that without slices."""
        shares = []

        def factor(objective: Objective, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
            y, x, dz = map(float, position)
            found = self._light(objective, met, dz).factor(y, x, qy, qx)
            shares.append(float(np.mean(np.square(np.abs(found)))))
            return found

        image = self.images.through(position, factor, self._away(met, position))
        return image, float(np.mean(shares))

    def _away(self, met: Medium | None, position: np.ndarray) -> float:
        """Distance from focus of a point whose light spreads as far as slices spread this one's [m]."""
        dz = float(position[2])
        if met is None:
            return dz
        farthest = 0.0
        for one in self.images.objectives:
            bent = self._light(one, met, dz).bent
            cosine = math.sqrt(one.medium**2 - one.aperture**2)
            farthest = max(farthest, (dz - met.depths[-1]) * bent / one.medium * cosine / one.aperture)
        return math.copysign(abs(dz) + farthest, dz)

    def _light(self, objective: Objective, met: Medium, dz: float) -> Multislice:
        """Light of points at a depth; `met` is remembered by the medium, which is kept here."""
        key = objective, id(met), dz
        if key not in self._lights:
            if len(self._lights) >= KEPT:
                self._lights.pop(next(iter(self._lights)))
            self._lights[key] = Multislice(objective, met, dz)
        return self._lights[key]


def _apart(fine: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(fine - other) / (np.linalg.norm(fine) or 1.0))


def _transform(count: int) -> float:
    """Processor time of a transform of so many samples along a side [s]."""
    plane = np.zeros((count, count), complex)
    start = time.process_time()
    arrays.fft2(plane, overwrite=True)
    return time.process_time() - start


def _nothing(objective: Objective, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
    return np.ones(np.broadcast(qy, qx).shape)
