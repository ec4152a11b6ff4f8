"""Selection of the terms that a raw image justifies, by Schwarz's criterion."""

import math

import numpy as np

UNKNOWN = "the light field holds too little information"


def worth(covariance: np.ndarray, coefficients: np.ndarray, pixels: float, prior: np.ndarray) -> np.ndarray:
    """Mask (terms,) of the coefficients (nodes, terms) that a raw image of so many pixels justifies.

    A term stays if it gains more log-likelihood than ½ ln N (Schwarz's criterion), and than the narrowing of
    the prior's width by the data costs (Laplace's approximation of the evidence), once the others are left
    out. Covariance and the prior's information are (nodes terms, nodes terms).
    """
    nodes, count = coefficients.shape
    free = np.ones(count, bool)
    while free.any():
        x, known = coefficients.copy(), np.tile(free, nodes)
        if not free.all():  # where the others go if these are 0
            inverse = np.linalg.inv(covariance)
            change = np.linalg.solve(inverse[np.ix_(known, known)], inverse[np.ix_(known, ~known)])
            x.ravel()[known] += change @ coefficients.ravel()[~known]
            own = np.linalg.inv(inverse[np.ix_(known, known)])
        else:
            own = covariance
        places = {j: np.flatnonzero(np.flatnonzero(known) % count == j) for j in np.flatnonzero(free)}
        gains = {
            j: x[:, j] @ np.linalg.solve(own[np.ix_(at, at)], x[:, j])
            - max(math.log(pixels), _narrowed(own[np.ix_(at, at)], prior[j::count, j::count]))
            for j, at in places.items()
        }
        weakest = min(gains, key=lambda j: gains[j])
        if gains[weakest] >= 0:
            break
        free[weakest] = False
    return free


def _narrowed(covariance: np.ndarray, prior: np.ndarray) -> float:
    """Twice the logarithm of how much narrower a covariance is than the prior of this information."""
    return -float(np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(prior)[1])
