r"""Places of lenslets on a white image, without the bias of pixels, and the uncertainty of the lattice.

The places are the phases of the lattice's harmonics under a normal window of `WIDTH` pitches, which have
neither the pixels' bias nor that of the array's border:

.. math:: \phi_k = \arg \sum_x w(x - x_k)\, \big(I(x) - \bar I\big)\, e^{2 \pi i\, u(x)}

with u the place in the lattice. Errors shared by overlapping windows, and aliasing: docs/theory/metric.md.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from lumigraph.calibration.centres import Spots, traced
from lumigraph.calibration.fitting import Fitted, fit, surrounded
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError

WIDTH = 0.7
"""Standard deviation of the window [pitches]: the mean light leaks into the phase by exp(-2 pi² WIDTH²)."""

TOGETHER = 4 * math.pi * WIDTH**2
"""Lenslets whose places err as one."""

_FAR = 4  # lenslets that err as one at most
_REACH = 4.0  # standard deviations at which the window ends
_MARGIN = 3.0  # pitches from the array's border, and the picture's, within which windows reach beyond it
_LEAST = 12


def places(white: np.ndarray, calibration: Calibration) -> Fitted:
    """Lenslets that have neighbours on all sides, where they stand, and the lattice and warp through them.

    Parameters
    ----------
    white
        (y, x[, c]), linear in light; an offset, such as the dark signal, does no harm.
    calibration
        Of that image.

    Raises
    ------
    CalibrationError
        Fewer than 12 lenslets that far from the border.
    """
    data = np.asarray(white, np.float64)
    data = data.mean(-1) if data.ndim == 3 else data
    # Windows stand on whole pixels, where the phase is the lenslet's own only if the model's pitch is right.
    first = _traced(data, calibration, calibration)
    return _traced(data, first.model(calibration.shape), calibration)


def _traced(data: np.ndarray, model: Calibration, calibration: Calibration) -> Fitted:
    """The lattice by the phases against that of a model."""
    pitch, lit = calibration.lattice.pitch, calibration.centers
    if calibration.light is not None:  # not what is found in the dark beside the array
        lit = lit[calibration.light > np.median(calibration.light) / 2]
    found = traced(data, model, width=WIDTH, reach=_REACH)
    low = np.maximum(lit.min(0) - pitch / 2, 0) + _MARGIN * pitch
    high = np.minimum(lit.max(0) + pitch / 2, np.array(data.shape) - 1) - _MARGIN * pitch
    kept = found.near & ((found.centers > low) & (found.centers < high)).all(1)
    if kept.sum() < _LEAST:
        raise CalibrationError(
            f"{int(kept.sum())} lenslets are {_MARGIN:g} pitches or more inside the array, but {_LEAST} are "
            "needed to estimate the error of its pitch. Use a picture of more lenslets."
        )
    spots = Spots(found.indices[kept], found.centers[kept], found.light[kept, 0])
    return fit(spots, model)


def _rest(fitted: Fitted) -> np.ndarray:
    """Residuals (n, 2) of lenslets from the lattice and its warp [px]."""
    points = fitted.lattice.position(fitted.spots.indices)
    return fitted.spots.centers - (points if fitted.warp is None else fitted.warp.applied(points))


def _covariance(fitted: Fitted) -> np.ndarray:
    """Covariance (4, 4) of the vectors (y, x) to the next row and to the next lenslet [px²]."""
    inner = surrounded(fitted.spots.indices)  # which alone `fit` lays the lattice through
    index, rest = fitted.spots.indices[inner], _rest(fitted)[inner]
    points = fitted.lattice.position(index)
    flat, none = np.column_stack([np.ones(len(index)), index - index.mean(0)]), np.zeros((len(index), 3))
    design = np.concatenate([np.hstack([flat, none]), np.hstack([none, flat])])
    if (warp := fitted.warp) is not None:
        q, bent = points - warp.center, (*warp.tilt, warp.radial)
        changes = [-q[:, [0]] * q, -q[:, [1]] * q, q * (q**2).sum(-1, keepdims=True)]
        columns = [one.T.ravel() for one, part in zip(changes, bent, strict=True) if part]
        design = np.column_stack([design, *columns])
    scale = np.sqrt((design**2).sum(0))
    design = design / scale
    alike = np.concatenate([_together(index, fitted.lattice, one) for one in np.split(design, 2)])
    back = np.linalg.inv(design.T @ design)
    spread = back @ (design.T @ alike) @ back  # of least squares whose errors are not independent
    freedom = max(rest.size - float(np.trace(back @ (design.T @ alike))), 1.0)
    spread *= (rest**2).sum() / freedom / np.outer(scale, scale)
    vectors = [1, 4, 2, 5]  # (y, x) of a step in i, then in j
    return spread[np.ix_(vectors, vectors)]


def _together(index: np.ndarray, lattice: Lattice, columns: np.ndarray) -> np.ndarray:
    """Columns (n, k) of lenslets, each summed over those around it by how much they err as one."""
    step = np.arange(-_FAR, _FAR + 1)
    ways = np.stack(np.meshgrid(step, step, indexing="ij"), -1) @ lattice.matrix.T
    alike = np.exp(-((ways / lattice.pitch) ** 2).sum(-1) / (4 * WIDTH**2))
    i, j = (index - index.min(0)).T
    table = np.zeros((i.max() + 1, j.max() + 1, columns.shape[1]))
    table[i, j] = columns
    return ndimage.convolve(table, alike[..., None], mode="constant")[i, j]


def pitch_and_rotation(fitted: Fitted) -> tuple[tuple[float, float], tuple[float, float]]:
    """(value, standard deviation) of the pitch [px] and of the rotation [rad], of what `places` found."""
    lattice, spread = fitted.lattice, _covariance(fitted)
    (row, column), (down, across) = lattice.basis[1], lattice.basis[0]
    rows, columns = lattice.pitches
    slopes = np.array(
        [
            [row / rows / 2, column / rows / 2, down / columns / 2, across / columns / 2],
            [0, 0, across / columns**2, -down / columns**2],
        ]
    )
    pitch, turn = np.sqrt(np.einsum("ka,ab,kb->k", slopes, spread, slopes))
    return (lattice.pitch, float(pitch)), (lattice.rotation, float(turn))


def residual(fits: Sequence[Fitted]) -> tuple[float, tuple[float, float]]:
    """Rms distance [px] from the lattice of what `places` found on one white image or two, and its interval.

    Noise is in it of one image; of two of the same light it is not, for products of what both find are
    averaged. Lenslets err together by `TOGETHER`.
    """
    rests = [
        {tuple(index): off for index, off in zip(one.spots.indices.tolist(), _rest(one), strict=True)}
        for one in fits
    ]
    both = [(off, rests[-1][index]) for index, off in rests[0].items() if index in rests[-1]]
    squares = np.array([one @ other for one, other in both])
    mean, half = squares.mean(), 1.96 * float(squares.std()) * math.sqrt(TOGETHER / len(squares))
    low, value, high = (math.sqrt(max(0.0, one)) for one in (mean - half, mean, mean + half))
    return value, (low, high)
