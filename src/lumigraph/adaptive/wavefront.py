"""`Wavefront`: an instrument's aberrations, estimated from a light field."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.core.volume import Volume
from lumigraph.elements.zernike import zernike
from lumigraph.instruments import LensletCamera, LightFieldMicroscope
from lumigraph.scene import Points


@dataclass(frozen=True, slots=True, eq=False)
class Wavefront:
    """Aberrations that were estimated together with the object, and how well they are known.

    Parameters
    ----------
    terms
        Noll indices.
    values, deviations
        Of each term at the nodes of the field (rows, columns, terms) [waves rms], beyond what the
        instrument's description holds; standard deviations from Fisher's information and from how pixels'
        scores scatter, over lenslets and over places behind them, where the object does not explain the raw
        image, as far as that is more than chance. A term that explains no more than noise has the value 0,
        and its deviation holds the value that it had.
    nodes
        Places (y, x) of the rows and of the columns of nodes [m].
    untold
        Terms that cannot be known here, and why.
    beads
        The object; none where it is a volume.
    deviance
        Poisson deviance per pixel with the object alone, and with the wavefront.
    pearson
        Mean of (r - m)²/m, electrons: 1 where only noise is left; see `pearson_deviation`.
    rounds, steps
        How often objects were looked for, and steps of the fit.
    instrument
        The description with the mean aberrations of the field.
    covariance
        Of all values, in order (nodes terms, nodes terms) [waves² rms].
    volume
        The object; None where it is beads.
    explained
        Part of each term's information, from 0 to 1, that is lost as the volume could explain what the term
        does; empty of beads.
    pearson_deviation
        Standard deviation of `pearson` by noise alone.
    bead_width, bead_width_deviation
        Diameter that all beads have as balls that shine evenly [m], and its standard deviation; 0 where
        points explain the raw image as well, and the deviation is what they may still be wide.
    """

    terms: tuple[int, ...]
    values: np.ndarray
    deviations: np.ndarray
    nodes: tuple[np.ndarray, np.ndarray]
    untold: Mapping[int, str]
    beads: Points
    deviance: tuple[float, float]
    pearson: float
    rounds: int
    steps: int
    instrument: LightFieldMicroscope | LensletCamera
    covariance: np.ndarray
    volume: Volume | None = None
    explained: Mapping[int, float] = field(default_factory=dict)
    pearson_deviation: float = 0.0
    bead_width: float = 0.0
    bead_width_deviation: float = 0.0

    __repr__ = brief

    @property
    def coefficients(self) -> dict[int, float]:
        """Mean over the field of each term [waves rms]."""
        means = self.values.mean((0, 1))
        return {j: float(value) for j, value in zip(self.terms, means, strict=True)}

    @property
    def rms(self) -> float:
        """Rms of the mean wavefront [waves]."""
        return float(np.linalg.norm(self.values.mean((0, 1))))

    def phase(self, samples: int = 129) -> np.ndarray:
        """The mean wavefront (samples, samples) over the pupil [waves]; NaN outside.

        Raises
        ------
        GeometryError
            No whole number of samples above zero.
        """
        return wavefront_map(self.coefficients, samples)


def wavefront_map(coefficients: Mapping[int, float], samples: int = 129) -> np.ndarray:
    """Wavefront (samples, samples) of Zernike terms over the pupil [waves]; NaN outside.

    Parameters
    ----------
    coefficients
        Noll index to waves rms.
    samples
        Across the pupil.

    Raises
    ------
    GeometryError
        No whole number of samples above zero.

    Examples
    --------
    >>> float(np.nanmax(wavefront_map({2: 0.5}, 3)).round(3))  # 2 ρ / 2 at ρ = 2/3
    0.667
    """
    n = checks.whole("samples", samples)
    at = (np.arange(n) - (n - 1) / 2) / (n / 2)
    rho, angle = np.hypot(at[:, None], at), np.arctan2(at[:, None], at)
    terms = (waves * zernike(j, np.minimum(rho, 1), angle) for j, waves in coefficients.items())
    return np.where(rho <= 1, sum(terms, 0 * rho), np.nan)
