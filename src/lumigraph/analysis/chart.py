"""A chessboard on a picture: its corners, its edges' sharpness, and how far it is bent."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d, maximum_filter, spline_filter
from scipy.optimize import least_squares
from scipy.spatial import KDTree

from lumigraph.analysis.saddles import settle
from lumigraph.analysis.slanted_edge import SlantedEdge, slanted_edge
from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.brief import brief
from lumigraph.errors import SamplingError

LEAST_CELL = 20.0
"""Width of a square from which on its edges are measured [samples]: four fifths must be 16."""

_SCALES = (1.0, 1.5, 2.5, 4.0, 6.0)  # samples of blur at which corners are looked for
_FAINT = 0.35  # of the strength of the strongest tenth of corners
_FITS = 0.2  # of a square's width: how far a corner may be from where its neighbour expects it
_ASKEW = 0.5  # sine of the least angle between the sides of a square that is seen askew
_PART = 0.8  # of a square's edge, far enough from its corners
_LONGEST = 48  # samples of an edge that are taken
LEAST_BENT = 12
"""Corners from which a distortion is measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Corners of a chessboard on a picture.

    Parameters
    ----------
    picture
        (y, x), linear in light.
    corners
        (n, 2) as (y, x) [samples].
    indices
        (n, 2) whole numbers: neighbours differ by one.
    """

    picture: np.ndarray
    corners: np.ndarray
    indices: np.ndarray

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.corners)

    def within(self, margin: float) -> "Chart":
        """The corners that are farther from the border of the picture than `margin` [samples]."""
        high = np.array(self.picture.shape) - 1 - margin
        kept = ((self.corners >= margin) & (self.corners <= high)).all(1)
        return replace(self, corners=self.corners[kept], indices=self.indices[kept])

    @property
    def spacing(self) -> float:
        """Width of a square [samples]: the root of its mean area."""
        return float(np.sqrt(abs(np.linalg.det(self._squares()[0]))))

    @property
    def spacing_error(self) -> float:
        """One standard deviation of `spacing`, from what the corners are off straight lines."""
        basis, spread, _ = self._squares()
        back = np.linalg.inv(basis)
        return self.spacing * float(np.sqrt(np.trace(back.T @ spread @ back))) / 2

    @property
    def unevenness(self) -> float:
        """Root mean square distance of the corners from straight lines, over the width of a square."""
        return self._squares()[2] / self.spacing

    def _squares(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Vectors (2, 2) of a square's sides, covariance (2, 2) along an axis, and rms residual."""
        design = np.column_stack([self.indices - self.indices.mean(0), np.ones(len(self))])
        fit = np.linalg.lstsq(design, self.corners, rcond=None)[0]
        left = ((self.corners - design @ fit) ** 2).sum()
        spread = np.linalg.pinv(design.T @ design)[:2, :2] * left / max(2 * len(self) - 6, 1)
        return fit[:2], spread, float(np.sqrt(left / len(self)))

    @property
    def edge_length(self) -> int:
        """Samples along and across an edge that are taken, of squares of the mean width."""
        return min(int(_PART * self.spacing), _LONGEST)

    def edges(self) -> Iterator[tuple[np.ndarray, SlantedEdge]]:
        """(Middle (y, x), MTF in cycles per sample) of each edge between two corners that can be measured."""
        number = {(int(i), int(j)): k for k, (i, j) in enumerate(self.indices)}
        for (i, j), k in number.items():
            for other in ((i + 1, j), (i, j + 1)):
                if other in number:
                    middle = (self.corners[k] + self.corners[number[other]]) / 2
                    length = float(np.hypot(*(self.corners[k] - self.corners[number[other]])))
                    if (found := self._edge(middle, length)) is not None:
                        yield middle, found

    def _edge(self, middle: np.ndarray, length: float) -> SlantedEdge | None:
        n = min(int(_PART * length), _LONGEST)
        top, left = (round(float(c)) - n // 2 for c in middle)
        area = self.picture[max(top, 0) : top + n, max(left, 0) : left + n]
        if min(area.shape) < 16 or area.shape != (n, n):
            return None
        try:
            return slanted_edge(area)
        except SamplingError:
            return None

    def distortion(self) -> tuple[float, float]:
        r"""Radial distortion at the corner of the picture, over the distance from its middle, and its error.

        Corners of a flat board, seen by an ideal camera, lie on a homography of their indices;

        .. math:: x_d = x (1 + k r^2)

        is fitted with it, r from the middle of the picture; k r² of the picture's corner is given. Negative
        is a barrel. The error is one standard deviation, from what the corners are off the fit.

        Raises
        ------
        SamplingError
            Fewer than `LEAST_BENT` corners, or in one or two rows.
        """
        if len(self) < LEAST_BENT or min(np.ptp(self.indices, axis=0)) < 2:
            raise SamplingError(
                f"{len(self)} corners of the chart are seen; {LEAST_BENT} in 3 rows are needed."
            )
        middle = (np.array(self.picture.shape) - 1) / 2
        reach = float(np.hypot(*middle))
        seen, flat = (self.corners - middle) / reach, self.indices - self.indices.mean(0)

        def off(numbers: np.ndarray) -> np.ndarray:
            matrix = np.append(numbers[:8], 1.0).reshape(3, 3)
            places = np.column_stack([flat, np.ones(len(flat))]) @ matrix.T
            ideal = places[:, :2] / places[:, 2:]
            return (ideal * (1 + numbers[8] * (ideal**2).sum(1, keepdims=True)) - seen).ravel()

        affine = np.linalg.lstsq(np.column_stack([flat, np.ones(len(flat))]), seen, rcond=None)[0].T
        fit = least_squares(off, [*affine.ravel(), 0.0, 0.0, 0.0], method="lm")
        freedom = len(fit.fun) - len(fit.x)
        spread = np.linalg.pinv(fit.jac.T @ fit.jac) * 2 * fit.cost / max(freedom, 1)
        return float(fit.x[8]), float(np.sqrt(spread[8, 8]))


def find_chart(picture: Array) -> Chart:
    """The largest piece of a chessboard on a picture, of any spacing and turned by any angle.

    Saddles of the brightness are looked for at several blurs; from the one nearest the middle, neighbours
    are followed along the board's own directions, so that it may be bent. It needs neither a margin nor a
    known number of corners.

    Parameters
    ----------
    picture
        (y, x), linear in light.

    Raises
    ------
    SamplingError
        Fewer than four corners that are neighbours.
    """
    data = np.asarray(to_numpy(picture), np.float64)
    if data.ndim != 2 or min(data.shape) < 16:
        raise SamplingError(f"the picture has shape {data.shape} but needs (y, x) from 16 x 16 samples on.")
    checks.finite_array("the picture", data)
    best = max((_followed(*_saddles(data, scale)) for scale in _SCALES), key=lambda one: len(one[0]))
    if len(best[0]) < 4:
        raise SamplingError(
            f"{len(best[0])} corners of a chessboard were found where 4 are needed. Bring the chart into the "
            "picture, or use one with other squares."
        )
    return Chart(data, *best)


def _saddles(data: np.ndarray, scale: float) -> tuple[np.ndarray, float]:
    """Places (n, 2) that may be corners, and the scale."""
    yy, yx, xx = (_derived(data, scale, order) for order in ((2, 0), (1, 1), (0, 2)))
    strength = yx**2 - yy * xx
    size = 2 * round(2 * scale) + 1
    rim = round(3 * scale)
    top = (strength == maximum_filter(strength, size)) & (strength > 0)
    top[:rim], top[-rim:], top[:, :rim], top[:, -rim:] = False, False, False, False
    places = np.argwhere(top)
    if len(places) < 4:
        return np.zeros((0, 2)), scale
    power = strength[top]
    places = places[power > _FAINT * np.quantile(power, 0.9)]
    smooth = spline_filter(gaussian_filter(data, scale / 2), 3)
    at, found = settle(smooth, places.astype(float), max(2, round(1.5 * scale)), stray=2 * scale + 1)
    return _once(at[found], scale), scale


def _once(places: np.ndarray, scale: float) -> np.ndarray:
    """Places without those that are nearer than a blur to one before: equal samples beside a saddle."""
    pairs = KDTree(places).query_pairs(scale, output_type="ndarray") if len(places) else np.zeros((0, 2), int)
    return np.delete(places, pairs.max(1), axis=0)


def _derived(data: np.ndarray, scale: float, order: tuple[int, int]) -> np.ndarray:
    """Derivative of the blurred picture, so many times along y and x."""
    return gaussian_filter1d(gaussian_filter1d(data, scale, 0, order[0]), scale, 1, order[1])


def _followed(places: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 2) and indices (n, 2) of the places that are neighbours on a board."""
    if len(places) < 4:
        return places[:0], np.zeros((0, 2), int)
    tree = KDTree(places)
    near, around = (np.asarray(one) for one in tree.query(places, 2))
    width = float(np.median(near[:, 1]))
    ways = places[around[:, 1]] - places
    turn = float(np.angle(np.exp(4j * np.arctan2(*ways.T)).sum())) / 4
    basis = width * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    if width < 3 * scale:
        return places[:0], np.zeros((0, 2), int)
    starts = _starts(places)
    bases = [(k, one) for k in starts for one in (basis, _leaning(places, tree, k)) if one is not None]
    sets = [_grown(places, tree, one, k) for k, one in bases]
    return max(sets, key=lambda one: len(one[0]))


def _leaning(places: np.ndarray, tree: KDTree, k: int) -> np.ndarray | None:
    """Ways (2, 2) from a place to its nearest neighbours on two lines: sides of a square seen askew."""
    around = np.asarray(tree.query(places[k], min(9, len(places)))[1])[1:]
    ways = places[around] - places[k]
    length = np.hypot(*ways.T)
    across = np.abs(ways[:, 0] * ways[0, 1] - ways[:, 1] * ways[0, 0]) > _ASKEW * length * length[0]
    if not across.any():
        return None
    sides = np.stack([ways[0], ways[across][0]])
    sides = sides[np.argsort(-np.abs(sides[:, 0]))]  # downwards first, and not mirrored
    sides[0] *= np.copysign(1, sides[0, 0])
    sides[1] *= np.copysign(1, np.linalg.det(sides))
    return sides


def _starts(places: np.ndarray) -> list[int]:
    """The places nearest to the middle of them all."""
    return np.argsort(np.hypot(*(places - np.median(places, axis=0)).T))[:5].tolist()


def _grown(places: np.ndarray, tree: KDTree, basis: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    index, taken, todo = {first: (0, 0)}, {(0, 0)}, deque([(first, basis)])
    while todo:
        k, local = todo.popleft()
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            distance, other = tree.query(places[k] + sign * local[axis])
            width = float(np.hypot(*local[axis]))
            i, j = index[k]
            at = (i + sign, j) if axis == 0 else (i, j + sign)
            if distance > _FITS * width or at in taken or other in index:
                continue
            bent = local.copy()
            bent[axis] = (local[axis] + sign * (places[other] - places[k])) / 2
            index[int(other)] = at
            taken.add(at)
            todo.append((int(other), bent))
    chosen = np.array(list(index))
    return places[chosen], np.array(list(index.values()))
