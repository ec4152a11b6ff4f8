"""Layers that an objective was not made for."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True)
class Mismatch:
    r"""Layers that an objective was not made for: Gibson and Lanni's aberration.

    .. math:: \Phi = k \sum_j t_j \left(\sqrt{n_j^2 - q^2} - \frac{n_i}{n_j}\sqrt{n_i^2 - q^2}\right)

    over the sample between coverslip and focus, the coverslip, and, subtracted, the coverslip of the design.
    The second term is the immersion's share that refocusing takes away, so that no paraxial defocus is left.

    Parameters
    ----------
    sample_index
        n of the medium around the object.
    focus_depth
        Depth of the focused plane below the coverslip [m].
    coverslip, design
        (index, thickness [m]) of the coverslip in use and of the one in the design; both or neither.

    References
    ----------
    S. F. Gibson & F. Lanni, J. Opt. Soc. Am. A 9, 154 (1992).
    """

    sample_index: float
    focus_depth: float = 0.0
    coverslip: tuple[float, float] | None = None
    design: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        checks.positive("sample_index", self.sample_index, "1")
        if checks.finite("focus_depth", self.focus_depth) < 0:
            raise GeometryError(f"focus_depth is {self.focus_depth:g} m but must be at least 0 m.")
        if (self.coverslip is None) != (self.design is None):
            raise GeometryError("give both coverslip= and design=, or neither: their difference counts.")

    def path(self, q: np.ndarray, index: float) -> np.ndarray:
        """Optical path Φ/k [m] at q = n sin θ, for an immersion of this index."""
        layers = [(self.sample_index, self.focus_depth)]
        if self.coverslip is not None and self.design is not None:
            layers += [self.coverslip, (self.design[0], -self.design[1])]
        immersion = np.sqrt(index**2 - q**2)
        return sum((t * (np.sqrt(n**2 - q**2) - index / n * immersion) for n, t in layers), np.zeros_like(q))
