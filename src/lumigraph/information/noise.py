r"""Fisher information of a pixel that counts Poisson electrons and is read with Gaussian noise.

.. math:: \phi(\mu, \sigma) = \int \frac{1}{p} \left(\frac{\partial p}{\partial \mu}\right)^2 dz, \quad
          p(z) = \sum_l e^{-\mu} \frac{\mu^l}{l!} N(z; l, \sigma^2)

is 1/μ without read noise, and at least 1/(μ + σ²), to which it comes for bright pixels.

R. J. Ober, S. Ram & E. S. Ward, Biophys. J. 86, 1185 (2004).
"""

from functools import lru_cache

import numpy as np
from scipy.special import gammaln, xlogy

RESOLVED = 0.1
"""Read noise [electrons] below which single electrons are resolved: φ is 1/μ to 1e-5."""

BRIGHT = 100.0
"""Mean electrons above which φ is 1/(μ + σ²): to 2e-3 for any σ, and less far above."""

_DIM = 1e-7
"""Least mean electrons of the table; dimmer pixels count as this one, which is too little information."""

_NODES = 160


def pixel_information(mean: np.ndarray, read_noise: float) -> np.ndarray:
    """Information of pixels on their mean electrons, φ(μ, σ) [1/electron²].

    Parameters
    ----------
    mean
        Of electrons, 0 or more; where it is 0 and there is no read noise, the result is 0: no light.
    read_noise
        σ [electrons].

    Examples
    --------
    >>> [round(float(v), 4) for v in pixel_information(np.array([0.5, 4.0, 400.0]), 1.0)]
    [0.7598, 0.2009, 0.0025]
    """
    mean = np.asarray(mean, np.float64)
    if read_noise <= RESOLVED:
        return np.divide(1.0, mean, out=np.zeros_like(mean), where=mean > 0)
    gaussian = 1 / (mean + read_noise**2)
    at, ratio = _table(float(read_noise))
    dim = np.interp(np.log(np.clip(mean, _DIM, BRIGHT)), at, ratio)
    return gaussian * np.where(mean < BRIGHT, dim, 1.0)


@lru_cache(maxsize=16)
def _table(read_noise: float) -> tuple[np.ndarray, np.ndarray]:
    """φ over 1/(μ + σ²), and the logarithms of μ at which it stands."""
    at = np.linspace(np.log(_DIM), np.log(BRIGHT), _NODES)
    return at, np.array([_exact(mu, read_noise) * (mu + read_noise**2) for mu in np.exp(at)])


def _exact(mu: float, sigma: float) -> float:
    most = int(mu + 10 * np.sqrt(mu)) + 15  # more have a chance below 1e-14
    counts = np.arange(most + 1)
    chance = np.exp(xlogy(counts, mu) - mu - gammaln(counts + 1))
    step = min(sigma / 6, 0.5)
    z = np.arange(-8 * sigma, most + 8 * sigma, step)
    found = 0.0
    for some in np.array_split(z, max(1, len(z) * len(counts) // 2**20)):
        shape = np.exp(-0.5 * ((some[:, None] - counts) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
        p, slope = shape @ chance, shape @ (chance * (counts / mu - 1))
        found += float(np.sum(slope**2 / np.maximum(p, 1e-300))) * step
    return found
