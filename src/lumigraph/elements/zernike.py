"""Zernike polynomials in Noll's order, and a phase plate made of them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import eval_jacobi

from lumigraph.core import checks
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements.apertures import CircularAperture
from lumigraph.elements.transmission import Edge, check_edge, transmit
from lumigraph.errors import GeometryError

HIGHEST = 1000
"""Highest Noll index: order 43."""

STABLE = 16
"""Highest order whose polynomials are summed by powers: to 1e-9."""


def noll_to_nm(j: int) -> tuple[int, int]:
    """Radial order n and azimuthal order m of Noll's index j = 1, 2, ...; m < 0 is the sine.

    Raises
    ------
    GeometryError
        j is not a whole number from 1 to `HIGHEST`.

    Examples
    --------
    >>> [noll_to_nm(j) for j in (1, 2, 3, 4, 5, 6, 11)]
    [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (4, 0)]
    """
    if isinstance(j, bool) or not isinstance(j, int | np.integer) or j < 1:
        raise GeometryError(f"Noll's index is {j!r} but must be a whole number of at least 1 (1 is piston).")
    if j > HIGHEST:
        raise GeometryError(
            f"Noll's index is {j} but must be at most {HIGHEST}: polynomials of higher order overflow."
        )
    n = (math.isqrt(8 * int(j) - 7) - 1) // 2
    place = int(j) - n * (n + 1) // 2 - 1
    order = n % 2 + 2 * ((place + (n + 1) % 2) // 2)
    return n, order if j % 2 == 0 else -order


FAMILIES = ("spherical aberration", "coma", "astigmatism", "trefoil", "quadrafoil", "pentafoil")
"""Names by the order over the angle."""

ORDERS = ("", "secondary ", "tertiary ")


def zernike_name(j: int) -> str:
    """Name of the Zernike polynomial of Noll's index j.

    Raises
    ------
    GeometryError
        j is not a whole number of at least 1.

    Examples
    --------
    >>> [zernike_name(j) for j in (1, 2, 4, 6, 7, 11, 12, 22)]  # doctest: +NORMALIZE_WHITESPACE
    ['piston', 'tilt along x', 'defocus', 'astigmatism, cos 2θ', 'coma along y', 'spherical aberration',
     'secondary astigmatism, cos 2θ', 'secondary spherical aberration']
    """
    n, m = noll_to_nm(j)
    order = abs(m)
    beyond = (n - order) // 2 - (2 - order if order < 2 else 0)  # the lowest are piston, defocus and tilt
    if beyond < 0:
        return ("piston", "defocus")[n // 2] if order == 0 else f"tilt along {'x' if m > 0 else 'y'}"
    family = FAMILIES[order] if order < len(FAMILIES) else f"{order}-foil"
    name = (ORDERS[beyond] if beyond < len(ORDERS) else f"{beyond + 1}th ") + family
    if order == 1:
        return f"{name} along {'x' if m > 0 else 'y'}"
    return name if order == 0 else f"{name}, {'cos' if m > 0 else 'sin'} {order}θ"


def zernike(j: int, rho: np.ndarray, theta: np.ndarray) -> np.ndarray:
    r"""Zernike polynomial of Noll's index j, with rms 1 over the unit disc.

    .. math:: Z_j = \sqrt{n + 1} \, R_n^m(\rho) \times
              \{1,\ \sqrt{2} \cos m\theta \ (j\ \text{even}),\ \sqrt{2} \sin m\theta \ (j\ \text{odd})\}

    Parameters
    ----------
    j
        Noll's index: 1 piston, 2 tilt along x, 3 tilt along y, 4 defocus, 5 and 6 astigmatism, 7 and 8 coma,
        11 spherical aberration.
    rho, theta
        Radius over the disc's, and angle [rad] from +x towards +y; they broadcast.

    Raises
    ------
    GeometryError
        j is not a whole number of at least 1.

    References
    ----------
    Noll, J. Opt. Soc. Am. 66, 207 (1976), equations 1 and 2.

    Examples
    --------
    >>> float(zernike(4, np.array(1.0), np.array(0.0)))  # sqrt(3) (2ρ² - 1)
    1.7320508075688772
    """
    n, m = noll_to_nm(j)
    order = abs(m)
    k = (n - order) // 2
    radial = (-1) ** k * rho**order * eval_jacobi(k, order, 0, 1 - 2 * np.square(rho))
    if m == 0:
        return math.sqrt(n + 1) * radial * np.ones_like(theta)
    return math.sqrt(2 * (n + 1)) * radial * (np.cos(m * theta) if m > 0 else np.sin(order * theta))


def _summed(table: Mapping[int, float], place: np.ndarray) -> np.ndarray:
    """Sum of terms of few orders at places x + iy: a polynomial of ρ² times each power of the place."""
    phase, squared, power = np.zeros(place.shape), np.abs(place) ** 2, np.ones_like(place)
    for m, parts in enumerate(_powers(table)):
        power = power * place if m else power
        for own, along in zip(parts, (np.real(power), np.imag(power)), strict=True):
            if own.any():
                radial = np.zeros(place.shape)
                for coefficient in np.trim_zeros(own, "b")[::-1]:
                    radial *= squared
                    radial += coefficient
                phase += radial * along
    return phase


def _powers(table: Mapping[int, float]) -> np.ndarray:
    """Coefficients (m, cosine and sine, power of ρ²) of terms without their ρ^m."""
    orders = [noll_to_nm(j) for j in table]
    highest = max((n for n, _ in orders), default=0)
    found = np.zeros((highest + 1, 2, highest // 2 + 1))
    for (n, m), coefficient in zip(orders, table.values(), strict=True):
        scale, half = coefficient * math.sqrt((n + 1) * (2 if m else 1)), (n - abs(m)) // 2
        for k in range(half + 1):
            ways = (-1) ** k * math.comb(n - k, k) * math.comb(n - 2 * k, half - k)
            found[abs(m), int(m < 0), half - k] += scale * ways
    return found


@dataclass(frozen=True, slots=True)
class ZernikePlate:
    r"""Phase plate in a round or elliptic stop: aberrations.

    .. math:: t = \exp(i \sum_j c_j Z_j(2r/D, \theta)), \quad r < D/2

    Of an elliptic stop, places are divided by its `axes` first.

    Parameters
    ----------
    coefficients
        Phase c_j [rad rms] by Noll's index j; one wave rms is 2π. The phase is the same for every wavelength.
    diameter
        Diameter of the unit disc [m]; opaque outside.
    center
        (y, x) [m].
    edge
        Edge of the stop: "grey" or "hard".
    axes
        Widths of an elliptic stop along `direction` and across it, over the diameter.
    direction
        Direction from +x towards +y [rad].

    Raises
    ------
    GeometryError
        A coefficient that is not finite, an index below 1, or a diameter or an axis that is not above zero.

    Examples
    --------
    >>> ZernikePlate({11: 0.5, 4: 0.1}, 5e-3).coefficients
    ((4, 0.1), (11, 0.5))
    """

    coefficients: Mapping[int, float] | tuple[tuple[int, float], ...]
    diameter: float
    center: tuple[float, float] = (0.0, 0.0)
    edge: Edge = "grey"
    axes: tuple[float, float] = (1.0, 1.0)
    direction: float = 0.0

    def __post_init__(self) -> None:
        try:
            table = dict(self.coefficients)
        except (TypeError, ValueError):
            raise GeometryError(
                f"coefficients are {self.coefficients!r} but must be a mapping of Noll's index to [rad rms], "
                "such as {4: 0.5}."
            ) from None
        for j in table:
            noll_to_nm(j)
        pairs = sorted(table.items())
        for j, value in pairs:
            checks.finite(f"coefficient {j}", value, "rad rms")
        object.__setattr__(self, "coefficients", tuple((int(j), float(value)) for j, value in pairs))
        object.__setattr__(self, "diameter", checks.positive("diameter", self.diameter))
        object.__setattr__(self, "center", checks.pair("center", self.center))
        check_edge(self.edge)
        object.__setattr__(self, "axes", checks.pair("axes", self.axes))
        for axis in self.axes:
            checks.positive("an axis", axis, "1")
        checks.finite("direction", self.direction, "rad")

    @property
    def reach(self) -> float:
        """Farthest place of the stop from (0, 0), over the diameter's half."""
        return max(self.axes) + 2 * math.hypot(*self.center) / self.diameter

    @property
    def area(self) -> float:
        """Area of the stop, over that of a round one of its diameter."""
        return self.axes[0] * self.axes[1]

    def transmission(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Complex factor (ny, nx) of each sample."""
        return np.exp(1j * self.phase(grid.y[:, None], grid.x)) * self._stop(grid, wavelength)

    def _stop(self, grid: Grid, wavelength: float) -> np.ndarray:
        if self.axes[0] == self.axes[1]:
            round_one = CircularAperture(self.diameter * self.axes[0], self.center, self.edge)
            return round_one.transmission(grid, wavelength)
        half = self.diameter / 2
        y, x = self._stretched(grid.y[:, None] - self.center[0], grid.x - self.center[1])
        rho = np.hypot(y, x)
        if self.edge == "hard":
            return (rho <= half * (1 + 1e-12)).astype(np.float64)
        # Distance from the edge, and how far a sample reaches along its normal.
        down, across = (part / np.maximum(rho, 1e-300) for part in self._stretched(y, x))
        slope = np.maximum(np.abs(down) * grid.pitch[0], np.abs(across) * grid.pitch[1])
        return np.clip((half - rho) / np.maximum(slope, 1e-300) + 0.5, 0.0, 1.0)

    def _stretched(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places, from the centre, at which the stop is round."""
        if self.axes == (1.0, 1.0):
            return y, x
        sin, cos = math.sin(self.direction), math.cos(self.direction)
        along, across = (x * cos + y * sin) / self.axes[0], (y * cos - x * sin) / self.axes[1]
        return along * sin + across * cos, along * cos - across * sin

    def phase(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Phase [rad] at places that broadcast [m], whatever the stop lets through."""
        y, x = self._stretched(y - self.center[0], x - self.center[1])
        place = (x + 1j * y) / (self.diameter / 2)
        place = place / np.maximum(1.0, np.abs(place) / 1.5)  # high orders overflow far outside the stop
        table = dict(self.coefficients)
        if all(noll_to_nm(j)[0] <= STABLE for j in table):
            return _summed(table, place)
        rho, theta = np.abs(place), np.angle(place)
        phase = np.zeros(np.shape(rho))
        for j, coefficient in table.items():
            phase += coefficient * zernike(j, rho, theta)
        return phase

    def turned(self, angle: float) -> "ZernikePlate":
        """The plate turned about (0, 0) by `angle` [rad], from +x towards +y."""
        table: dict[int, float] = {}
        for j, coefficient in dict(self.coefficients).items():
            n, m = noll_to_nm(j)
            own, other = math.cos(m * angle), math.sin(m * angle)
            table[j] = table.get(j, 0.0) + coefficient * own
            if m:
                partner = j + 1 if j < HIGHEST and noll_to_nm(j + 1) == (n, -m) else j - 1
                table[partner] = table.get(partner, 0.0) + coefficient * other
        (y, x), sin, cos = self.center, math.sin(angle), math.cos(angle)
        center = y * cos + x * sin, x * cos - y * sin
        direction = 0.0 if self.axes[0] == self.axes[1] else self.direction + angle
        return replace(self, coefficients=table, center=center, direction=direction)

    def __call__(self, field: Field) -> Field:
        """The field just behind the plate."""
        return transmit(self, field)
