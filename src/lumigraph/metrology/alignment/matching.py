r"""Micro-images against those of a predicted white image: how far each is displaced, and how much wider.

With a prediction P that is nearly right, the light around a centre is, to first order,

.. math:: I = g\,(P - \delta \cdot \nabla P - \varepsilon\, x \cdot \nabla P)

with x from the centre. Least squares over the pixels of each micro-image give g, δ and ε, without the errors
that pixels and neighbours make in centres found alone: the prediction has them too.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import correlate1d

_SLOPE = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60  # of sixth order: edges are about two pixels wide
_FARTHEST = 1.0  # px rms from which on the prediction is another picture


@dataclass(frozen=True, slots=True, eq=False)
class MatchedImages:
    """Micro-images beside their predictions.

    Parameters
    ----------
    displacement
        (k, 2) [px].
    widening
        Part (k,) by which each is wider.
    """

    displacement: np.ndarray
    widening: np.ndarray

    @property
    def near(self) -> bool:
        """True if the displacements are small enough to be linear in them."""
        return float(np.sqrt(np.mean(self.displacement**2))) < _FARTHEST


def whole_windows(centers: np.ndarray, half: int, shape: tuple[int, ...]) -> np.ndarray:
    """Mask (k,) of centres [px] whose windows of `half` pixels to each side are in the picture."""
    at = np.rint(centers)
    return np.all((at >= half + 1) & (at <= np.array(shape) - 2 - half), axis=1)


def matched(image: np.ndarray, predicted: np.ndarray, centers: np.ndarray, half: int) -> MatchedImages:
    """Micro-images at predicted centres (k, 2) [px] of an image (y, x), in windows of `half` to each side."""
    step = np.arange(-half, half + 1)
    at = np.rint(centers).astype(int)
    rows, columns = at[:, 0, None, None] + step[:, None], at[:, 1, None, None] + step
    slope_y, slope_x = (correlate1d(predicted, _SLOPE, axis)[rows, columns] for axis in (0, 1))
    y, x = rows - centers[:, 0, None, None], columns - centers[:, 1, None, None]
    parts = [predicted[rows, columns], -slope_y, -slope_x, -(y * slope_y + x * slope_x)]
    A = np.stack([one.reshape(len(at), -1) for one in parts], 2)
    light = image[rows, columns].reshape(len(at), -1, 1)
    found = np.linalg.solve(A.transpose(0, 2, 1) @ A, A.transpose(0, 2, 1) @ light)[:, :, 0]
    return MatchedImages(found[:, 1:3] / found[:, :1], found[:, 3] / found[:, 0])


def growing(places: np.ndarray, widening: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Growth (2,) of a widening over places (k, 2), and its standard deviations."""
    A = np.column_stack([places, np.ones(len(places))])
    fit, *_ = np.linalg.lstsq(A, widening, rcond=None)
    spread = float(np.sum((widening - A @ fit) ** 2)) / (len(widening) - 3)
    return fit[:2], np.sqrt(np.diag(np.linalg.inv(A.T @ A))[:2] * spread)
