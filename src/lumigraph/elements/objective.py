"""Field of a point under a microscope objective in the plane of the native image.

It is the Debye integral over the pupil, with the sine condition, in object-space coordinates. The azimuth is
expanded in harmonics, so that only radial integrals remain; they are tabulated once and interpolated.
docs/theory/elements.md has the equations.

B. Richards & E. Wolf, Proc. R. Soc. A 253, 358 (1959); M. Broxton et al., Opt. Express 21, 25418 (2013).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
import scipy

from lumigraph.core import checks
from lumigraph.core.cache import remembered
from lumigraph.elements import radial
from lumigraph.elements.disc import disc, nodes_for, plane
from lumigraph.elements.mismatch import Mismatch
from lumigraph.elements.zernike import noll_to_nm, zernike
from lumigraph.errors import GeometryError

Model = Literal["scalar", "vector", "paraxial", "rays"]

PER_NYQUIST = 16
"""Steps of a radial table in half the smallest period of the field: cubic interpolation errs by 1e-5."""

AZIMUTHS = 64
"""Directions in which aberrations are sampled, at least; harmonics up to half of them."""


@dataclass(frozen=True, slots=True)
class Objective:
    """A microscope objective, as seen from a point in its object space.

    Parameters
    ----------
    wavelength
        Wavelength in vacuum [m].
    numerical_aperture, index
        NA and the immersion's refractive index n.
    model
        "scalar": Debye, good to NA 0.8; "vector": Richards and Wolf; "paraxial": for comparison; "rays":
        no waves, for images that were traced by rays: it has no field.
    axial_share
        With "vector", mean square of the dipoles' axial component: 1/3 for dipoles of all directions, 1 for
        dipoles along the axis, 0 for dipoles across it (of all azimuths).
    aberrations
        Zernike terms over the pupil: Noll index to waves rms.
    mismatch
        `Mismatch` of refractive indices; None for none.
    image_defocus
        Distance from the native image to the plane where the field is wanted, over M² [m]; above 0 behind
        the image. In the paraxial image space of a microscope that is a depth of -a n/M² in front of it.

    Raises
    ------
    GeometryError
        NA not below the index, an unknown model, a share outside 0 to 1, rays with what needs waves.

    Examples
    --------
    >>> objective = Objective(525e-9, 0.5, 1.0)
    >>> y = np.array([0.0, 0.634e-6])
    >>> [round(float(v), 3) for v in objective.intensity(y, 0 * y, 0.0) / objective.intensity(0, 0, 0.0)]
    [1.0, 0.0]
    """

    wavelength: float
    numerical_aperture: float
    index: float = 1.0
    model: Model = "scalar"
    axial_share: float = 1 / 3
    aberrations: Mapping[int, float] | tuple[tuple[int, float], ...] = ()
    mismatch: Mismatch | None = None
    image_defocus: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength", checks.positive("wavelength", self.wavelength))
        checks.choice("model", self.model, get_args(Model))
        if not checks.positive("numerical_aperture", self.numerical_aperture, "1") < self.index:
            raise GeometryError(
                f"the numerical aperture {self.numerical_aperture:g} is not below the refractive index "
                f"{self.index:g}. Check the immersion."
            )
        if not 0 <= checks.finite("axial_share", self.axial_share, "1") <= 1:
            raise GeometryError(f"axial_share is {self.axial_share:g} but must be from 0 to 1.")
        pairs = sorted(dict(self.aberrations).items())
        for j, waves in pairs:
            noll_to_nm(j)
            checks.finite(f"aberration {j}", waves, "waves rms")
        object.__setattr__(self, "aberrations", tuple((int(j), float(w)) for j, w in pairs))
        if self.model == "rays" and (pairs or self.mismatch is not None or self.image_defocus):
            raise GeometryError(
                "model 'rays' has no aberrations, sample index or lenslet offset. "
                "Leave them out or use 'scalar'."
            )

    @property
    def terms(self) -> tuple[tuple[int, float], ...]:
        """Noll index and waves rms of each aberration."""
        return tuple(dict(self.aberrations).items())

    @property
    def orders(self) -> list[tuple[tuple[int, int], float]]:
        """Radial and azimuthal order, and waves rms, of each aberration."""
        return [(noll_to_nm(j), waves) for j, waves in self.terms]

    @property
    def medium(self) -> float:
        """Refractive index around the object."""
        return self.index if self.mismatch is None else self.mismatch.sample_index

    @property
    def aperture(self) -> float:
        """Largest q = n sin θ that reaches the image: NA, or what the medium lets out."""
        return min(self.numerical_aperture, 0.9999 * self.medium)

    @property
    def is_round(self) -> bool:
        """True if the point's image is rotationally symmetric."""
        return all(m == 0 for (_, m), _ in self.orders)

    @property
    def modes(self) -> int:
        """Fields that do not interfere and together are the image."""
        return 5 if self.model == "vector" else 1

    def fields(self, y: np.ndarray | float, x: np.ndarray | float, dz: float) -> np.ndarray:
        """Amplitudes (modes, ...) at positions (y, x) in object space [m] of a point on the axis at `dz`.

        Together they carry the power 1 per unit area: ΣΣ|U|² dy dx = 1.

        Raises
        ------
        GeometryError
            The model is "rays".
        """
        if self.model == "rays":
            raise GeometryError("model 'rays' has no field. Use 'scalar', 'vector' or 'paraxial'.")
        y, x = np.asarray(y, np.float64), np.asarray(x, np.float64)
        if not self.is_round and y.ndim == x.ndim == 2 and y.shape[1] == x.shape[0] == 1:
            return self._plane(y[:, 0], x[0], float(dz))
        y, x = np.broadcast_arrays(y, x)
        radius = np.hypot(y, x)
        farthest = 2.0 ** math.ceil(math.log2(max(float(radius.max()), self.wavelength) * 1.0000001))
        step, tables = _tables(self, float(dz), farthest)
        places = radius / step
        turned = any(order for harmonics in tables for order, _ in harmonics)
        turn = np.where(radius > 0, (x + 1j * y) / np.where(radius > 0, radius, 1), 1) if turned else 1.0
        found = np.zeros((self.modes, *radius.shape), np.complex128)
        for mode, harmonics in enumerate(tables):
            for order, pieces in harmonics:
                part = radial.at(places, pieces)
                found[mode] += part if order == 0 else part * radial.power(turn, order)
        return found

    def intensity(self, y: np.ndarray | float, x: np.ndarray | float, dz: float) -> np.ndarray:
        """Intensity (...) at positions (y, x) in object space [m] of a point on the axis at `dz`."""
        fields = self.fields(y, x, dz)
        return np.asarray(np.square(np.abs(fields)).sum(0))

    def _plane(self, y: np.ndarray, x: np.ndarray, dz: float) -> np.ndarray:
        """Amplitudes (modes, y, x): harmonics of strong aberrations are many, rows of the pupil are few."""
        count = nodes_for(self.steepest(math.hypot(np.abs(y).max(), np.abs(x).max()), dz))
        qy, qx, area = (self.aperture * part for part in disc(count, count))
        k = 2 * np.pi / self.wavelength
        return plane(self.pupil(qy, qx, dz) * area * self.aperture, (k * qy, k * qx), y, x)

    def steepest(self, radius: float, dz: float, part: float = 1.0) -> float:
        """Bound of how much the pupil's phase and the wave to a point within `radius` [m] change per pupil's
        radius [rad]; where aberrations bend the wave less, for this part of the pupil's area.
        """
        k, ray = 2 * math.pi / self.wavelength, self.aperture / math.sqrt(self.medium**2 - self.aperture**2)
        q = np.linspace(0, self.aperture, 64)
        extra = np.abs(np.gradient(_extra_path(self, q), q)).max()
        return k * self.aperture * (radius + abs(dz) * ray + float(extra) + self.spread(part))

    def spread(self, part: float = 1.0) -> float:
        """Largest displacement of this part of the rays by aberrations, in object space [m]."""
        return _slope(self.terms, part) * self.wavelength / self.numerical_aperture

    def depth_path(self, qy: np.ndarray, qx: np.ndarray) -> np.ndarray:
        """Optical path at (qy, qx) of a depth, over the depth: n (cos θ - 1)."""
        sine = np.hypot(qy, qx) / self.medium
        return _depth_path(self, sine, np.sqrt(1 - sine**2))

    def phase(self, qy: np.ndarray, qx: np.ndarray, dz: float) -> np.ndarray:
        """Phase [rad] at (qy, qx) = n sin θ of a point at `dz`: its depth, layers and aberrations."""
        q, angle, k = np.hypot(qy, qx), np.arctan2(qy, qx), 2 * np.pi / self.wavelength
        phase = k * (self.depth_path(qy, qx) * dz + _extra_path(self, q))
        for j, waves in self.terms:
            phase = phase + 2 * np.pi * waves * zernike(j, q / self.numerical_aperture, angle)
        return phase

    def pupil(self, qy: np.ndarray, qx: np.ndarray, dz: float) -> np.ndarray:
        r"""Amplitudes (modes, ...) per unit area of the pupil at (qy, qx) = n sin θ of a point at `dz`.

        .. math:: U(y, x) = \iint P(q_y, q_x)\, e^{i k (q_y y + q_x x)}\, dq_y\, dq_x

        over q up to `aperture` is what `fields` interpolates.

        Raises
        ------
        GeometryError
            The model is "rays".
        """
        if self.model == "rays":
            raise GeometryError("model 'rays' has no field. Use 'scalar', 'vector' or 'paraxial'.")
        angle, sine = np.arctan2(qy, qx), np.hypot(qy, qx) / self.medium
        cosine, k, phase = np.sqrt(1 - sine**2), 2 * np.pi / self.wavelength, self.phase(qy, qx, dz)
        _, around, weight = nodes = _nodes(self, 0.0, 0.0)
        scale = k / (
            2 * np.pi * self.medium * math.sqrt(_power_of(_apodised(self, *nodes[:2]), around, weight))
        )
        wave = np.exp(1j * phase) * (scale / cosine)
        return np.stack([wave * a * _turned(h, angle) for h, _, a in _apodised(self, sine, cosine)])


def focus_intensity(objective: Objective, y: np.ndarray, x: np.ndarray, dz: float) -> np.ndarray:
    """Energy density (...) at (y, x, dz) where the objective focuses light polarised along x, 1 at the focus.

    The inverse of imaging: Richards and Wolf's focus, |I0 + I2 cos 2φ|² + |I2 sin 2φ|² + 4 |I1 cos φ|².

    References
    ----------
    B. Richards & E. Wolf, Proc. R. Soc. A 253, 358 (1959), equations 2.30 to 2.32.
    """
    sine, cosine, weight = _nodes(objective, float(np.max(np.hypot(y, x))), dz)
    k = 2 * np.pi / objective.wavelength
    radius, angle = np.hypot(y, x), np.arctan2(y, x)
    wave = np.sqrt(cosine) * weight * np.exp(1j * k * objective.index * cosine * dz)
    argument = k * objective.index * radius[..., None] * sine
    first = (wave * (1 + cosine) * scipy.special.j0(argument)).sum(-1)
    second = (wave * sine * scipy.special.j1(argument)).sum(-1)
    third = (wave * (1 - cosine) * scipy.special.jv(2, argument)).sum(-1)
    along, across = first + third * np.cos(2 * angle), third * np.sin(2 * angle)
    peak = (np.sqrt(cosine) * weight * (1 + cosine)).sum() ** 2
    return (np.abs(along) ** 2 + np.abs(across) ** 2 + 4 * np.abs(second * np.cos(angle)) ** 2) / peak


def _nodes(objective: Objective, radius: float, dz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sine and cosine of the angles, and weights that include sin θ dθ."""
    half = math.asin(objective.aperture / objective.medium)
    k = 2 * math.pi * objective.medium / objective.wavelength
    phase = k * (radius * math.sin(half) + abs(dz) * (1 - math.cos(half)))
    phase += k * abs(objective.image_defocus) * objective.numerical_aperture**2
    if objective.mismatch is not None:
        phase += k * float(np.ptp(_extra_path(objective, np.linspace(0, objective.aperture, 64))))
    phase += 20 * sum(abs(w) for _, w in objective.terms)
    at, weight = _legendre(64 * math.ceil((48 + 0.6 * phase) / 64))
    angle = half / 2 * (at + 1)
    return np.sin(angle), np.cos(angle), weight * half / 2 * np.sin(angle)


_legendre = lru_cache(maxsize=8)(np.polynomial.legendre.leggauss)


def _extra_path(objective: Objective, q: np.ndarray) -> np.ndarray:
    """Optical path [m] at q of the layers and of the way behind the image."""
    path = -objective.image_defocus * q**2 / 2
    return path if objective.mismatch is None else path + objective.mismatch.path(q, objective.index)


def _apodised(
    objective: Objective, sine: np.ndarray, cosine: np.ndarray
) -> list[tuple[int, int, np.ndarray]]:
    """Harmonic (> 0 cosine, < 0 sine), its order and amplitude of each mode, normalised to the power 1."""
    if objective.model == "paraxial":
        # The integral's sin θ dθ is q dq / (n² cos θ): the paraxial pupil is even in q.
        return [(0, 0, cosine)]
    root = np.sqrt(cosine)
    if objective.model == "scalar":
        return [(0, 0, root)]
    across = math.sqrt((1 - objective.axial_share) / 2 * 2)
    axial = math.sqrt(objective.axial_share) * 2
    return [
        (0, 0, across * root * (1 + cosine)),
        (2, 2, across * root * (1 - cosine)), (-2, 2, across * root * (1 - cosine)),
        (1, 1, axial * root * sine), (-1, 1, axial * root * sine),
    ]  # fmt: skip


@lru_cache(maxsize=256)
def _slope(terms: tuple[tuple[int, float], ...], part: float) -> float:
    """Slope of the wavefront that a part of the pupil's area stays below [waves per radius]."""
    if not terms:
        return 0.0
    rho, angle = np.sqrt(np.linspace(0, 1, 65))[1:, None], np.linspace(0, 2 * np.pi, 129)
    waves = sum((w * zernike(j, rho, angle) for j, w in terms), np.zeros(1))
    radial, around = np.gradient(waves, rho[:, 0], angle)
    return float(np.quantile(np.hypot(radial, around / rho), part))


def _depth_path(objective: Objective, sine: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Optical path of a depth, over the depth."""
    n = objective.medium
    return -n * sine**2 / 2 if objective.model == "paraxial" else n * (cosine - 1)


def _turned(harmonic: int, angle: np.ndarray) -> np.ndarray:
    """Azimuthal factor of a harmonic of `_apodised`."""
    return np.cos(harmonic * angle) if harmonic >= 0 else np.sin(-harmonic * angle)


def _power_of(apodised: list[tuple[int, int, np.ndarray]], cosine: np.ndarray, weight: np.ndarray) -> float:
    """Power of all modes together in the image, by the nodes' weights."""
    return sum((2 if not h else 1) * np.pi * float((a**2 / cosine * weight).sum()) for h, _, a in apodised)


@remembered
def _tables(objective: Objective, dz: float, farthest: float) -> tuple[float, list[radial.Table]]:
    """Step of the radii [m], and for each mode the harmonics with their radial integrals as cubic pieces."""
    nyquist = objective.wavelength / (2 * objective.numerical_aperture)
    steps = np.arange(math.ceil(farthest / nyquist * PER_NYQUIST) + 2) * (nyquist / PER_NYQUIST)
    sine, cosine, weight = _nodes(objective, farthest, dz)
    q, k = objective.medium * sine, 2 * np.pi / objective.wavelength
    wave = np.exp(1j * k * (_depth_path(objective, sine, cosine) * dz + _extra_path(objective, q)))
    apodised = _apodised(objective, sine, cosine)
    scale = k * objective.medium / math.sqrt(_power_of(apodised, cosine, weight))
    count = _azimuths(objective)
    angle = np.arange(count) * (2 * np.pi / count)
    waves = _aberrated(objective, q / objective.numerical_aperture, angle)
    modes = [
        (np.fft.fft(_turned(h, angle)[:, None] * waves, axis=0) / count, amplitude * weight * wave * scale)
        for h, _, amplitude in apodised
    ]
    return float(steps[1]), radial.tables_of(modes, k * q, steps)


def _azimuths(objective: Objective) -> int:
    """Directions that hold the harmonics of the aberrations: more than their phase turns at the rim [rad]."""
    turning = sum(2 * np.pi * abs(w) * abs(m) * math.sqrt(2 * (n + 1)) for (n, m), w in objective.orders)
    return max(AZIMUTHS, 8 * math.ceil((turning + 4 * turning ** (1 / 3) + 12) / 4))


def _aberrated(objective: Objective, rho: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Factor (azimuths, radii) of the Zernike terms over the pupil."""
    phase = np.zeros((len(angle), len(rho)))
    for j, waves in objective.terms:
        phase += 2 * np.pi * waves * zernike(j, rho[None, :], angle[:, None])
    return np.exp(1j * phase)
