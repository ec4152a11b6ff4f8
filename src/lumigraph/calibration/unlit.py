"""Dark, faint and saturated lenslets, judged by their light alone: `unlit`, `saturated`."""

import numpy as np
from scipy import ndimage, spatial

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.core.saturation import saturation_level

_DARK = 0.1  # of a lit lenslet's light
_CORE, _SAMPLES = 0.3, 7  # of the pitch around a centre that is looked at, and samples along it at most
_AROUND, _QUARTER = 5, 25  # lenslets across a neighbourhood, and percentile of them that a scene must light
_FLOOR = 0.05  # of the brightest lenslets' light: darker neighbourhoods say nothing
_MOST = 0.5  # of a core at the top of the range


def unlit(
    picture: np.ndarray, model: Calibration, centers: np.ndarray, *, white: bool, few: bool = False
) -> np.ndarray:
    """Indices (m, 2) of dark lenslets: dead ones, dust, vignetted corners.

    Parameters
    ----------
    picture
        Brightness (y, x).
    model
        Positions of the micro-images.
    centers
        Centres that were found (k, 2) [px]: lenslets between the outermost of them are judged.
    white
        True for an evenly lit picture. Then a lenslet with less than a tenth of a lit one's light is
        dark. A scene has dark places that are no faults: there a dark lenslet has less than a tenth of what
        three quarters of those around it have.
    few
        Whether they are a few large ones: then lenslets between all of those found are judged, since such
        arrays are rarely rectangular.
    """
    (y0, x0), (y1, x1) = centers.min(0), centers.max(0)
    indices = model.indices_within((float(y0), float(y1)), (float(x0), float(x1)))
    if few:
        inside = spatial.Delaunay(centers).find_simplex(model.position(indices), tol=1e-3) >= 0
        indices = indices[inside]
    black = np.percentile(picture[:: max(1, len(picture) // 512)], 0.5)
    light = _cores(picture, model.position(indices), min(model.lattice.pitches)).mean(-1) - black
    lit = float(np.percentile(light, 80 if white else 95))
    at = tuple((indices - indices.min(0)).T)
    there = np.full(np.ptp(indices, axis=0) + 1, np.inf)  # what is not on the picture darkens nobody
    there[at] = light
    around = ndimage.percentile_filter(there, _QUARTER, _AROUND, mode="constant", cval=np.inf)[at]
    dark = (light < _DARK * np.minimum(around, lit)) & (around > _FLOOR * lit)
    return indices[dark | (light < _DARK * lit) if white else dark]


def saturated(image: RawImage, model: Calibration, indices: np.ndarray) -> int:
    """Number of lenslets (k, 2) at the top of a picture's range over half of their middle."""
    if (level := saturation_level(image)) is None:
        return 0
    data = to_numpy(image.data)
    cores = _cores(
        data if data.ndim == 2 else data.max(-1), model.position(indices), min(model.lattice.pitches)
    )
    return int(((cores >= level).mean(-1) > _MOST).sum())


def _cores(picture: np.ndarray, centers: np.ndarray, pitch: float) -> np.ndarray:
    """Samples (k, n) of a picture around the middle of micro-images (k, 2)."""
    reach = _CORE * pitch
    steps = np.linspace(-reach, reach, min(_SAMPLES, 2 * int(reach) + 1))
    rows, columns = (np.rint(centers[:, axis, None] + steps).astype(int) for axis in (0, 1))
    rows, columns = (np.clip(k, 0, n - 1) for k, n in zip((rows, columns), picture.shape, strict=True))
    return picture[rows[:, :, None], columns[:, None, :]].reshape(len(centers), -1)
