r"""`depth_mask`: a phase in the pupil that leaves detail alike over a range of defocus.

The best linear filter for all defoci ψ of detail of a spatial frequency leaves the mean squared error

.. math:: 1 - \frac{|\langle H_\psi \rangle|^2}{\langle |H_\psi|^2 \rangle + \epsilon}

with the transfer functions H and the relative power of the noise, ε (Wiener). Its mean over all frequencies
is minimised by gradients: see docs/theory/optimisation.md. E. R. Dowski & W. T. Cathey, Appl. Opt. 34, 1859
(1995), found a cubic phase for square pupils.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize

from lumigraph.core import checks
from lumigraph.elements.zernike import noll_to_nm, zernike
from lumigraph.errors import GeometryError

RADIUS, SAMPLES = 16, 72
"""Radius of the pupil in samples, and width of the window: all of its autocorrelation has room."""

EDGE = 1.9
"""Highest frequency that counts, of the pupil's radius; 2 is the cut-off, where nothing is left."""

DEPTHS = 9
"""Values of defocus over the range."""

ROUGH = 0.1
"""Standard deviation of each term where a search begins [waves rms]."""


@dataclass(frozen=True, slots=True)
class DepthMask:
    """A phase in the pupil, and what it is worth.

    Parameters
    ----------
    terms
        Noll index to waves rms, as `main_lens.aberrations` takes them.
    error
        Mean squared error of detail behind it, over its power.
    without
        The same of a clear pupil.
    """

    terms: dict[int, float]
    error: float
    without: float


@dataclass(frozen=True, slots=True, eq=False)
class MaskedPupil:
    """A round pupil with a phase, and the error of detail over a range of defocus.

    Parameters
    ----------
    terms
        Noll indices of the phase.
    defocus
        Largest, either way [waves at the pupil's edge].
    noise
        Of its power over that of detail.
    """

    terms: tuple[int, ...]
    defocus: float
    noise: float = 1e-4
    _amplitude: np.ndarray = field(init=False)
    _shapes: np.ndarray = field(init=False)
    _beyond: np.ndarray = field(init=False)
    _counted: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        for j in self.terms:
            noll_to_nm(j)
        if min(self.terms, default=1) < 4:
            raise GeometryError(
                f"terms are {self.terms} but must be Noll indices from 4 on: others move images."
            )
        checks.positive("defocus", self.defocus, "waves")
        checks.positive("noise", self.noise, "1")
        at = (np.arange(SAMPLES) - SAMPLES // 2) / RADIUS
        whole, angle = np.hypot(at[:, None], at), np.arctan2(at[:, None], at)
        radius = np.minimum(whole, 1)
        open_part = np.clip((1 - whole) * RADIUS + 0.5, 0, 1)
        shapes = [zernike(j, radius, angle) for j in self.terms]
        steps = np.linspace(-self.defocus, self.defocus, DEPTHS)[:, None, None]
        frequency = np.fft.fftfreq(SAMPLES) * SAMPLES / RADIUS
        size = np.hypot(frequency[:, None], frequency)
        object.__setattr__(self, "_amplitude", open_part / np.sqrt(np.square(open_part).sum()))
        object.__setattr__(self, "_shapes", np.stack(shapes) * (open_part > 0))
        object.__setattr__(self, "_beyond", np.exp(2j * math.pi * steps * radius**2))
        object.__setattr__(self, "_counted", (size < EDGE) & (size > 0))

    def transfer(self, waves: np.ndarray) -> np.ndarray:
        """Transfer functions (depths, y, x), frequency 0 first, with so many waves rms of each term."""
        return self._followed(waves)[2]

    def error(self, waves: np.ndarray) -> tuple[float, np.ndarray]:
        """Mean squared error of detail, and its gradient by the waves."""
        fields, spectra, transfer = self._followed(waves)
        mean, power = transfer.mean(0), np.square(np.abs(transfer)).mean(0) + self.noise
        kept, count = np.square(np.abs(mean)) / power, self._counted.sum()
        changes = self._counted * (kept / power * transfer - mean / power) / len(transfer)
        by_light = 2 * np.fft.ifft2(changes.conj()).real
        back = np.fft.ifft2(by_light * spectra) * SAMPLES**2
        by_phase = 2 * (back.conj() * 1j * fields).real.sum(0)
        gradient = 2 * math.pi * np.tensordot(self._shapes, by_phase, 2)
        return float(1 - kept[self._counted].mean()), gradient / count

    def _followed(self, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Fields in the pupil, their spectra and transfer functions, (depths, y, x) each."""
        phase = 2 * math.pi * np.tensordot(waves, self._shapes, 1)
        fields = self._amplitude * np.exp(1j * phase) * self._beyond
        spectra = np.fft.fft2(fields)
        return fields, spectra, np.fft.ifft2(np.square(np.abs(spectra)))


def depth_mask(
    defocus: float,
    terms: tuple[int, ...] = tuple(range(4, 16)),
    *,
    noise: float = 1e-4,
    starts: int = 6,
    rng: np.random.Generator,
) -> DepthMask:
    """The best phase of a round pupil that a search from noise finds, for detail over a range of defocus.

    Each search goes downhill from terms drawn by chance; the least error of all counts. There are many
    minima: more starts may find a better one.

    Parameters
    ----------
    defocus
        Largest, either way, in waves at the pupil's edge: D² dz / (8 λ z²) of a point dz from focus at z.
    terms
        Noll indices of the phase, from 4 on.
    noise
        Its power over that of detail.
    starts
        Searches.
    rng
        Random numbers.

    Raises
    ------
    GeometryError
        No defocus, noise or start, or a term that only moves images.

    Examples
    --------
    >>> found = depth_mask(1.0, starts=1, rng=np.random.default_rng(1))
    >>> found.error < found.without
    True
    """
    pupil = MaskedPupil(tuple(terms), defocus, noise)
    best = None
    for _ in range(checks.whole("starts", starts)):
        drawn = rng.normal(0, ROUGH, len(pupil.terms))
        found = optimize.minimize(pupil.error, drawn, jac=True, method="L-BFGS-B")
        best = found if best is None or found.fun < best.fun else best
    assert best is not None
    waves = {j: float(w) for j, w in zip(pupil.terms, best.x, strict=True)}
    return DepthMask(waves, float(best.fun), pupil.error(np.zeros(len(waves)))[0])
