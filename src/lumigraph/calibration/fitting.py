"""Lattice, tilt and distortion through measured micro-images, by robust least squares."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lumigraph.calibration.centres import Spots
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice, Vector
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError, GeometryError

_SIGMAS = 4.0  # standard deviations beyond which a micro-image is left out
_LEAST = 0.02  # px, within which none is left out
_NEAR = 0.01  # of a pitch, within which a micro-image is not called missing
_GAIN = 0.98  # of the residual's root mean square must a warp at least bring it down to
_EVIDENCE = 12.0  # by how much the Bayesian information criterion must fall for a warp
_FEWEST = 30  # micro-images that a warp is fitted to
_MANY = 20000  # micro-images tell all that a fit can know
_LARGEST_CHANGE = 1.15  # of the area of a cell
_CONFIRMED, _COUNTED = 0.33, 16  # of a quarter's micro-images must be on the lattice, where it has as many
_QUARTERS = ("upper left", "upper right", "lower left", "lower right")
_HINT = "Check the white image, or pass pitch= and layout=."
_FREE = ((False, False), (True, False), (False, True), (True, True))  # tilt, radial


class Fitted(NamedTuple):
    """Kept micro-images and the lattice and warp through them."""

    spots: Spots
    lattice: Lattice
    warp: Warp | None

    def model(self, shape: tuple[int, int]) -> Calibration:
        """Calibration without tables of indices and centres, for its positions."""
        none = np.zeros((0, 2), np.int64)
        return Calibration(self.lattice, shape, none, none.astype(float), 0.0, warp=self.warp)


def fit(spots: Spots, model: Calibration, *, warped: bool = True) -> Fitted:
    """Least squares over micro-images, leaving out those beyond four standard deviations.

    Those left out that stand within a hundredth of a pitch are kept in the result: they are no faults.

    Tilt (2 numbers) and radial distortion (1) are added, singly or together, only where the Bayesian
    information criterion n ln(rms²) + p ln n falls by more than 12 for n coordinates and p parameters, and
    the residual falls by at least 2 %: a straight lattice is never bent by the noise of its centres.

    Parameters
    ----------
    spots
        Measured micro-images.
    model
        The lattice so far.
    warped
        True to fit tilt and distortion, too.

    Raises
    ------
    CalibrationError
        Fewer than 3 x 3 micro-images, or too few of them on one lattice.
    """
    check_count(spots, model.lattice, "lit micro-images")
    try:
        best = _fitted(_some(spots), model, warped)
    except GeometryError as error:  # parallel basis vectors
        raise CalibrationError(f"the micro-images stand on no lattice. {_HINT}") from error
    distance = _distances(best, spots)
    keep = distance <= max(_NEAR * best.lattice.pitch, float(_distances(best, best.spots).max()))
    return best._replace(spots=Spots(*(column[keep] for column in spots)))


def _some(spots: Spots) -> Spots:
    """Enough of many micro-images, none at the border of the array."""
    if len(spots.indices) <= _MANY:
        return spots
    inner = np.flatnonzero(surrounded(spots.indices))
    return Spots(*(column[inner[:: -(-len(inner) // _MANY)]] for column in spots))


def _fitted(spots: Spots, model: Calibration, warped: bool) -> Fitted:
    best, least = _robust(spots, model, _FREE[0]), np.inf
    if warped and len(best.spots.indices) >= _FEWEST:
        least = _criterion(best, 6)
        straight = _rms(best)
        for tilt, radial in _FREE[1:]:
            other = _robust(spots, model, (tilt, radial))
            value = _criterion(other, 6 + 2 * tilt + radial)
            # Those at the array's border, which stand inwards, are outliers only of a fit that is good.
            kept = len(other.spots.indices) >= len(best.spots.indices) * 0.95 - 1
            kept = kept or _rms(other._replace(spots=best.spots)) < _GAIN * straight
            gained = value < least - _EVIDENCE and _rms(other) < _GAIN * straight
            if kept and gained:
                best, least, straight = other, value, _rms(other)
    _check(best, spots, model.shape)
    if not _LARGEST_CHANGE > best.lattice.cell_area / model.lattice.cell_area > 1 / _LARGEST_CHANGE:
        raise CalibrationError(
            f"the micro-images lead from a lattice of pitch {model.lattice.pitch:.2f} px to one of "
            f"{best.lattice.pitch:.2f} px. {_HINT}"
        )
    return best


def _criterion(fitted: Fitted, parameters: int) -> float:
    count = 2 * len(fitted.spots.indices)
    return count * float(np.log(_rms(fitted) ** 2 + 1e-8)) + parameters * float(np.log(count))


def _distances(fitted: Fitted, spots: Spots) -> np.ndarray:
    points = fitted.lattice.position(spots.indices)
    points = points if fitted.warp is None else fitted.warp.applied(points)
    return np.hypot(*(spots.centers - points).T)


def _rms(fitted: Fitted) -> float:
    return float(np.sqrt(np.mean(_distances(fitted, fitted.spots) ** 2)))


def _robust(spots: Spots, model: Calibration, free: tuple[bool, bool]) -> Fitted:
    keep, inner = np.ones(len(spots.indices), bool), surrounded(spots.indices)
    fitted = Fitted(spots, model.lattice, None)
    for _ in range(10):
        used = keep & inner
        lattice, warp = _solved(spots.indices[used], spots.centers[used], model, free)
        fitted = Fitted(spots, lattice, warp)
        distance = _distances(fitted, spots)
        # Of one coordinate: the median of a Rayleigh distribution is 1.18 of it.
        spread = 0.85 * float(np.median(distance[used]))
        closer = distance <= max(_SIGMAS * spread, _LEAST)
        if np.array_equal(closer, keep) or _flat(spots.indices[closer & inner]):
            break
        keep = closer
    return Fitted(Spots(*(column[keep] for column in spots)), fitted.lattice, fitted.warp)


def _flat(indices: np.ndarray) -> bool:
    """True if indices lie on one line, or are too few for a warp."""
    design = np.concatenate([np.ones((len(indices), 1)), indices], -1)
    return len(indices) < 9 or np.linalg.matrix_rank(design) < 3


def _solved(
    indices: np.ndarray, centers: np.ndarray, model: Calibration, free: tuple[bool, bool]
) -> tuple[Lattice, Warp | None]:
    """Least squares by Gauss and Newton: the warp is small, and three steps are exact to 1e-6 px."""
    middle = np.array([(n - 1) / 2 for n in model.shape])
    size = float(np.hypot(*middle))
    design = np.concatenate([np.ones((len(indices), 1)), indices], -1)
    weights = np.linalg.lstsq(design, centers, rcond=None)[0]
    bend = np.zeros(3)
    columns = [k for k, use in enumerate((free[0], free[0], free[1])) if use]
    for _ in range(5 if columns else 0):
        points = design @ weights
        warp = Warp(_vector(middle), _vector(bend[:2] / size), float(bend[2] / size**2))
        q = (points - middle) / size
        tilted = [-q[:, [k]] * q * size for k in (0, 1)]
        radial = q * (q**2).sum(-1, keepdims=True) * size
        changes = np.stack([*tilted, radial])[columns]
        full = _blocks(design, changes)
        rest = (centers - warp.applied(points)).T.ravel()
        step = np.linalg.lstsq(full, rest, rcond=None)[0]
        weights = weights + step[:6].reshape(2, 3).T
        bend[columns] += step[6:]
        if np.abs(step[6:]).max() * size < 1e-7:
            break
    origin, column, row = (_vector(w) for w in weights)
    lattice = Lattice((row, column), origin, model.lattice.layout, model.lattice.kinds)
    if not columns:
        return lattice, None
    return lattice, Warp(_vector(middle), _vector(bend[:2] / size), float(bend[2] / size**2))


def _blocks(design: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Design of both coordinates: three weights of y, three of x, and the warp's numbers."""
    count = len(design)
    full = np.zeros((2 * count, 6 + len(changes)))
    full[:count, :3], full[count:, 3:6] = design, design
    for k, change in enumerate(changes):
        full[:, 6 + k] = change.T.ravel()
    return full


def _vector(values: np.ndarray) -> Vector:
    return float(values[0]), float(values[1])


def _check(fitted: Fitted, spots: Spots, shape: tuple[int, int]) -> None:
    kept, pitch, rms = len(fitted.spots.indices), fitted.lattice.pitch, _rms(fitted)
    if kept < 0.5 * len(spots.indices):
        raise CalibrationError(
            f"only {kept} of {len(spots.indices)} micro-images stand on one lattice of pitch "
            f"{pitch:.1f} px. {_HINT}"
        )
    if rms > 0.1 * pitch:
        raise CalibrationError(
            f"the micro-images stand {rms:.2f} px rms away from a lattice of pitch {pitch:.1f} px, "
            f"where a tenth of the pitch is too much. {_HINT}"
        )
    on, seen = (_quartered(some.centers, shape) for some in (fitted.spots, spots))
    if np.any((seen >= _COUNTED) & (on < _CONFIRMED * seen)):
        worst = int(np.argmin(on / np.maximum(seen, 1) + (seen < _COUNTED)))
        raise CalibrationError(
            f"only {on[worst]} of {seen[worst]} micro-images in the {_QUARTERS[worst]} quarter of the "
            f"picture stand on the lattice of pitch {pitch:.2f} px that the others stand on. {_HINT}"
        )
    check_count(fitted.spots, fitted.lattice, "micro-images on one lattice")


def _quartered(centers: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Number of micro-images in each quarter of a picture (4,)."""
    lower = centers > np.array(shape) / 2
    return np.bincount(2 * lower[:, 0] + lower[:, 1], minlength=4)


def surrounded(indices: np.ndarray) -> np.ndarray:
    """Spots with neighbours on all sides, or all spots where fewer than 5 x 5 are left.

    At the border of an array the light of the missing neighbours is missing too, which moves a
    micro-image's centre inwards: by half a pixel where diffraction blurs micro-images into each other.
    """
    first = indices.min(0) - 1
    present = np.zeros(indices.max(0) - first + 2, bool)
    i, j = (indices - first).T
    present[i, j] = True
    inner = np.ones(len(indices), bool)
    for di, dj in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, -1), (-1, 1)):
        inner &= present[i + di, j + dj]
    return inner if inner.sum() >= 25 else np.ones(len(indices), bool)


def check_count(spots: Spots, lattice: Lattice, what: str) -> None:
    """Refuse fewer than 3 x 3 micro-images."""
    count = [len(np.unique(spots.indices[:, axis])) for axis in (0, 1)]
    if min(count) < 3 or len(spots.indices) < 9:
        raise CalibrationError(
            f"the white image has {len(spots.indices)} {what} of pitch {lattice.pitch:.1f} px, "
            f"in {count[0]} rows and {count[1]} columns, but a lattice needs at least 3 x 3. "
            "Use the whole sensor's picture, evenly lit."
        )


def recentred(fitted: Fitted, shape: tuple[int, int]) -> Fitted:
    """The same points, with index (0, 0) nearest to the middle of the picture."""
    model, lattice = fitted.model(shape), fitted.lattice
    index = np.stack(model.index(np.array(shape[0] // 2), np.array(shape[1] // 2)), -1)
    origin = _vector(lattice.position(index))
    spots = fitted.spots._replace(indices=fitted.spots.indices - index)
    return Fitted(spots, replace(lattice, origin=origin), fitted.warp)
