"""Which terms a raw image is worth: Schwarz's criterion."""

import math

import numpy as np

UNKNOWN = "the light field holds too little information"


def worth(covariance: np.ndarray, coefficients: np.ndarray, pixels: float) -> np.ndarray:
    """Which terms (terms,) gain more log-likelihood than Schwarz's criterion asks for, without the others."""
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
        gains = {j: x[:, j] @ np.linalg.solve(own[np.ix_(at, at)], x[:, j]) for j, at in places.items()}
        weakest = min(gains, key=lambda j: gains[j])
        if gains[weakest] >= nodes * math.log(pixels):
            break
        free[weakest] = False
    return free
