r"""Uncertainty of coefficients where the object does not explain the raw image, by the scatter of scores.

White's sandwich C = S⁻¹ V S⁻¹ of Fisher's information S, clustered over lenslets and over places behind them:
V = V_lenslets + V_places - V_both. What so few clusters of noise scatter by chance is left out; where there
are few lenslets, their parts are clusters.

H. White, Econometrica 50, 1 (1982); A. C. Cameron, J. B. Gelbach & D. L. Miller, J. Bus. Econ. Stat. 29, 238
(2011).
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.operators.microscope_pixels import on_lattice

PLACES = 5
"""Along each side of a lenslet, in which pixels are alike, at least."""

SURE = 2.0
"""Standard deviations of chance, above which scores scatter by more than noise."""


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """Clusters of pixels, each an array (ny, nx) of whole numbers from 0.

    Parameters
    ----------
    lenslets
        Behind which lenslet a pixel stands, or which part of it.
    places
        Where it stands behind its lenslet.
    """

    lenslets: np.ndarray
    places: np.ndarray

    @classmethod
    def of(cls, calibration: Calibration, terms: int) -> "Clusters":
        """Clusters of a calibration's pixels, in more places than twice the number of terms.

        Parts of lenslets, each with `PLACES` along its sides, where there are no more than that.
        """
        own = on_lattice(calibration)
        nearest = np.rint(own)
        count = max(PLACES, math.ceil(math.sqrt(2 * terms)))
        lenslets, (places, parts) = _numbered(nearest), (_places(own - nearest, n) for n in (count, PLACES))
        few = len(np.unique(lenslets)) <= 2 * terms
        return cls(lenslets * PLACES**2 + parts if few else lenslets, places)

    def scatter(self, scores: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """V (terms, terms) of scores (terms, ny, nx) that add up to little: not always positive.

        As far as it is other than the covariance by noise (terms, terms) by more than chance: with n terms,
        noise in G clusters differs from it by n (n + 1)/G, sum of squares, to a part of 2/√(n (n + 1)).
        """
        root, count = np.linalg.cholesky(noise), len(noise)
        n = count * (count + 1)
        white = np.linalg.solve(root, scores.reshape(count, -1))
        both = self.lenslets * (int(self.places.max()) + 1) + self.places
        lenslets, places, each = (_summed(white, one) for one in (self.lenslets, self.places, both))
        alike = _free(places) * (places @ places.T - each @ each.T)
        beyond = _free(lenslets) * lenslets @ lenslets.T + alike - np.eye(count)
        chance = (n + SURE * 2 * math.sqrt(n)) * (1 / _filled(lenslets) + 1 / _filled(places))
        part = max(0.0, 1 - chance / float((beyond**2).sum()))
        return noise + part * root @ beyond @ root.T


def widened(information: np.ndarray, known: np.ndarray, scatter: np.ndarray) -> np.ndarray:
    """Covariance (terms, terms) by the scatter of scores; nowhere below the inverse of `known`."""
    inverse = np.linalg.inv(information)
    root = np.linalg.cholesky(np.linalg.inv(known))
    back = np.linalg.inv(root)
    sizes, axes = np.linalg.eigh(back @ inverse @ scatter @ inverse @ back.T)
    wide = root @ axes * np.sqrt(np.maximum(sizes, 1))
    return wide @ wide.T


def _places(away: np.ndarray, count: int) -> np.ndarray:
    """Number (ny, nx) of the place, `count` along each side, by the offset from a lenslet's middle."""
    return _numbered(np.clip(np.floor((away + 0.5) * count), 0, count - 1))


def _numbered(places: np.ndarray) -> np.ndarray:
    """Pairs (ny, nx, 2) of whole numbers as one each, from 0."""
    first, second = (places[..., k] - places[..., k].min() for k in (0, 1))
    return (first * (second.max() + 1) + second).astype(np.int64)


def _summed(scores: np.ndarray, clusters: np.ndarray) -> np.ndarray:
    """Sums (terms, clusters) of scores (terms, pixels), of clusters that have pixels."""
    own = np.unique(clusters, return_inverse=True)[1].ravel()  # most pairs of lenslet and place have no pixel
    return np.stack([np.bincount(own, one) for one in scores])


def _free(sums: np.ndarray) -> float:
    """Clusters over those that are left when the sums (terms, clusters) add up to 0."""
    count = np.count_nonzero(sums.any(0))
    return count / max(count - len(sums), 1)


def _filled(sums: np.ndarray) -> float:
    """Effective number of clusters: equal ones that scatter as much as these sums (terms, clusters)."""
    powers = (sums**2).sum(0)
    return float(powers.sum() ** 2 / (powers**2).sum()) * (1 + 2 / len(sums))
