r"""White images before square lenslets: the evenly lit stop of the main lens, without speckle.

Light of each place u of the stop is a tilted wave in the lenslet plane, whose image behind square lenslets is
a product of one factor along y and one along x. So the white image is a double sum,

.. math:: I(y, x) = \sum_{ij} |E_y(y; v_i)|^2 \, W_{ij} \, |E_x(x; u_j)|^2

with weights W that integrate polynomials over the disc exactly: Gauss-Legendre nodes along y, by the angle,
and along x the integral over each chord of what interpolates the nodes.
"""

import math

import numpy as np
from numpy.polynomial import legendre

from lumigraph.operators import cells as _cells
from lumigraph.operators.camera import HasOptics
from lumigraph.operators.optics import Optics
from lumigraph.operators.periodic import readout
from lumigraph.operators.relay import Straight

NODES = 32
"""Along each axis of the stop, and two for each turn of the images' phase across it."""


def separable(camera: HasOptics, accuracy: float) -> bool:
    """Whether a camera's white image is a sum of products."""
    camera = camera.optics()
    return Optics.of(camera, camera.object_distance, accuracy).straight


def white_image(camera: HasOptics, accuracy: float) -> np.ndarray:
    """Raw image (ny, nx) of light of 1 on square lenslets, to a relative rms error of `accuracy`."""
    camera = camera.optics()
    optics = Optics.of(camera, camera.object_distance, accuracy)
    lenslets, half = Straight(optics), camera.pupil_diameter / 2
    count = NODES + max(map(math.ceil, (2 * _turns(optics, which) for which in (0, 1))))
    angles, across, weights = disc(count)
    along_y, along_x = (_seen(lenslets, which, half * at) for which, at in ((0, np.sin(angles)), (1, across)))
    image = along_y @ weights @ along_x.T / optics.image_scale**2
    return readout(optics).forward(image.astype(np.float32))


def _turns(optics: Optics, which: int) -> float:
    """Turns across the stop of the phase between the light of the farthest lenslets that meet."""
    axis = optics.axes[which]
    return (axis.size + 2 * axis.neighbourhood) / _cells.airy(optics.camera)


def _seen(lenslets: Straight, which: int, stop: np.ndarray) -> np.ndarray:
    """Intensity (samples, places) along one axis of all cells, of light of each place of the stop [m]."""
    optics = lenslets.optics
    cells = range(optics.cells.image[which])
    at = lenslets.places(cells, cells)[which]
    turn = -2j * np.pi / (optics.camera.wavelength * optics.camera.separation)
    field = lenslets.along(which, np.exp(turn * np.outer(at, stop)).astype(np.complex64), cells)
    return np.abs(field) ** 2


def disc(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (count,), places along x (count,), and weights (angles, places) of means over the unit disc.

    Exact for polynomials of a degree below `count` along x.

    >>> t, x, w = disc(12)
    >>> round(float(w.sum()), 12), round(float(np.sin(t) ** 2 @ w @ x**2), 8)  # 1, and 1/24
    (1.0, 0.04166667)
    """
    x, weight = legendre.leggauss(count)
    angles, chord = np.pi / 2 * x, np.cos(np.pi / 2 * x)
    at_nodes, at_ends = legendre.legvander(x, count - 1), legendre.legvander(chord, count)
    # The integral of P_k over a chord is 2 (P_{k+1} - P_{k-1}) / (2k + 1) for even k, and 0 for odd.
    integrals = at_ends[:, 1:].copy()
    integrals[:, 1:] -= at_ends[:, : count - 1]
    integrals[:, 1::2] = 0
    rows = integrals @ (at_nodes.T * weight)
    return angles, x, rows * (np.pi / 2 * weight * chord)[:, None] / np.pi
