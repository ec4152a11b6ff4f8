"""A Gaussian-Schell source: partially coherent light whose modes are known in closed form."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError, SamplingError, SamplingWarning
from lumigraph.scene.lamps import check

Pair = tuple[float, float]

HIGHEST = 700
"""Order of a mode along an axis: beyond, its Gaussian underflows before its last maximum."""


@dataclass(frozen=True, slots=True)
class GaussianSchell:
    r"""Light of Gaussian intensity and Gaussian coherence, such as that of a multimode laser.

    At its waist, with Δ between two points,

    .. math:: I(r) = e^{-r^2 / (2 \sigma_I^2)}, \quad |\mu(\Delta)| = e^{-\Delta^2 / (2 \sigma_\mu^2)}

    for each axis. Its modes are Hermite-Gauss beams of waist :math:`w = \sqrt{2 \sigma_I \delta}`, whose
    light falls by q from order to order:

    .. math:: \frac{1}{\delta^2} = \frac{1}{4 \sigma_I^2} + \frac{1}{\sigma_\mu^2}, \quad
              q = \frac{M^2 - 1}{M^2 + 1}, \quad M^2 = 2 \sigma_I / \delta

    Parameters
    ----------
    width
        Root mean square σI of the intensity [m]; one number, or two (y, x).
    coherence
        Coherence width σµ [m]; infinity is a Gaussian beam.

    Raises
    ------
    GeometryError
        A width or coherence that is not above zero.

    References
    ----------
    A. Starikov and E. Wolf, J. Opt. Soc. Am. 72, 923 (1982); A. T. Friberg and R. J. Sudol, Opt. Commun. 41,
    383 (1982).

    Examples
    --------
    >>> source = GaussianSchell(width=100e-6, coherence=100e-6)
    >>> light = source.modes(Grid.square(160, 8e-6), 633e-9)
    >>> light.count, light.error < 1e-3, round(source.beam_quality[0], 3)
    (70, True, 2.236)
    """

    width: float | Pair
    coherence: float | Pair

    def __post_init__(self) -> None:
        for name in ("width", "coherence"):
            object.__setattr__(self, name, _above_zero(name, getattr(self, name), name == "coherence"))

    @property
    def beam_quality(self) -> Pair:
        """M² along y and x: 1 is coherent."""
        return self._each(lambda width, coherence: math.hypot(1, 2 * width / coherence))

    def rayleigh_range(self, wavelength: float) -> Pair:
        """Distance (y, x) over which the width grows by √2, 4πσI²/(λM²) [m]."""
        wavelength = checks.positive("wavelength", wavelength)
        quality = self.beam_quality
        widths = self._each(lambda width, _: 4 * math.pi * width**2 / wavelength)
        return widths[0] / quality[0], widths[1] / quality[1]

    def width_after(self, distance: float, wavelength: float) -> Pair:
        """Root mean square of the intensity (y, x) [m] after a distance from the waist, paraxial."""
        z = checks.finite("distance", distance)
        ranges = self.rayleigh_range(wavelength)
        widths = self._each(lambda width, _: width)
        return widths[0] * math.hypot(1, z / ranges[0]), widths[1] * math.hypot(1, z / ranges[1])

    def divergence(self, wavelength: float) -> Pair:
        """Root mean square of the direction sines (y, x): λM²/(4πσI)."""
        ranges = self.rayleigh_range(wavelength)
        widths = self._each(lambda width, _: width)
        return widths[0] / ranges[0], widths[1] / ranges[1]

    def modes(
        self,
        grid: Grid,
        wavelength: float,
        distance: float = 0.0,
        *,
        accuracy: float = 1e-3,
        dtype: Any = np.complex128,
    ) -> CoherentModes:
        """The light's modes, brightest first, of intensity 1 in the middle of the waist.

        As many as keep the squared width and divergence, the power, and the mutual intensity between any two
        points (over the largest intensity) to `accuracy`; what they leave out is the result's ``error``.

        Parameters
        ----------
        grid, wavelength
            Where it is sampled, and the wavelength in vacuum [m].
        distance
            From the waist to the grid [m].
        accuracy
            Between 0 and 1.
        dtype
            complex128 or complex64.

        Raises
        ------
        SamplingError
            More modes than fit in memory, or of a higher order than 700: with the accuracy that could be had.

        Warns
        -----
        SamplingWarning
            The grid's window or directions hold less of the light than the accuracy asks for.
        """
        self._warn(grid, wavelength, distance, accuracy)
        return self.sampled(grid, wavelength, distance, accuracy, dtype)

    def sampled(
        self, grid: Grid, wavelength: float, distance: float, accuracy: float, dtype: Any
    ) -> CoherentModes:
        """Modes as of `modes`, on a grid that may be smaller than the light, such as a lit slice."""
        check(grid, wavelength, accuracy)
        distance = checks.finite("distance", distance)
        orders, weights, error = self._chosen(grid, accuracy, np.dtype(dtype).itemsize)
        rows, columns = (
            _beams(axis, int(most) + 1, waist, wavelength, distance).astype(dtype)
            for axis, most, waist in zip((grid.y, grid.x), orders.max(1), self._waists, strict=True)
        )
        scale = np.sqrt(weights * 2 * math.pi * math.prod(self._each(lambda width, _: width))).astype(dtype)
        data = np.empty((len(weights), *grid.shape), dtype)
        for mode, m, n, factor in zip(data, *orders, scale, strict=True):
            np.multiply((factor * rows[m])[:, None], columns[n], out=mode)
        return CoherentModes(Field(data, grid, wavelength), error)

    def _each(self, function: Callable[[float, float], float]) -> Pair:
        """A function of width and coherence, along y and x."""
        widths, coherences = (np.broadcast_to(value, 2).tolist() for value in (self.width, self.coherence))
        return function(widths[0], coherences[0]), function(widths[1], coherences[1])

    @property
    def _waists(self) -> Pair:
        return self._each(lambda width, coherence: 2 * width / math.hypot(1, 2 * width / coherence) ** 0.5)

    def _chosen(self, grid: Grid, accuracy: float, itemsize: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Orders (2, modes) of the modes that an accuracy asks for, their shares, and the error."""
        quality = self.beam_quality
        falls = [(m - 1) / (m + 1) for m in quality]
        self._require(falls, grid, accuracy, itemsize)
        along = [_shares(q, m, accuracy) for q, m in zip(falls, quality, strict=True)]
        table = np.outer(*along).ravel()
        order = np.argsort(-table, kind="stable")
        m, n = np.unravel_index(order, (len(along[0]), len(along[1])))
        share = table[order]
        power = 1 - np.cumsum(share)
        left = [power * math.sqrt(math.prod(quality))]
        left += [1 - np.cumsum(share * (2 * k + 1)) / M for k, M in zip((m, n), quality, strict=True)]
        worst = np.max([*left, power], axis=0)
        count = int(np.argmax(worst <= accuracy)) + 1 if (worst <= accuracy).any() else len(worst)
        return np.stack([m, n])[:, :count], share[:count], max(float(worst[count - 1]), 0.0)

    def _require(self, falls: list[float], grid: Grid, accuracy: float, itemsize: int) -> None:
        """Refuse modes that do not fit, before any is made, by how many of them fall by how much."""
        steps, reach = [-math.log(q) if q else math.inf for q in falls], _reach(accuracy)
        orders = [max(reach / step, 1) for step in steps]
        count, highest = max(*orders, math.prod(orders) / 2), max(orders)
        plane, free = itemsize * math.prod(grid.shape), memory.available()
        fitting = math.inf if free is None else free / plane
        if count <= fitting and highest <= HIGHEST:
            return
        held = fitting * min(steps) if math.inf in steps else math.sqrt(2 * fitting * math.prod(steps))
        could = _left(min(held, HIGHEST * min(steps)))
        raise SamplingError(
            f"an accuracy of {accuracy:g} takes some {count:.3g} modes of {grid.shape[0]} x {grid.shape[1]} "
            f"samples, {memory.told(count * plane)}, up to order {highest:.0f}. An accuracy of {could:.2g} "
            f"could be had, with {memory.told(free or 0)} free and orders to {HIGHEST}: use fewer samples or "
            "a larger coherence."
        )

    def _warn(self, grid: Grid, wavelength: float, distance: float, accuracy: float) -> None:
        """Warn if light misses the window, or oscillates too fast for the samples."""
        check(grid, wavelength, accuracy)
        widths, angles = self.width_after(distance, wavelength), self.divergence(wavelength)
        for axis, (name, size, pitch) in enumerate(zip("yx", grid.size, grid.pitch, strict=True)):
            if grid.shape[axis] == 1:
                continue
            seen = size / 2 - abs(grid.center[axis])
            sine = wavelength / (2 * pitch)
            outside = math.erfc(max(seen, 0) / widths[axis] / math.sqrt(2))
            steep = math.erfc(sine / angles[axis] / math.sqrt(2))
            if max(outside, steep) > accuracy:
                warnings.warn(
                    f"of the light {outside:.2g} misses the window of {size * 1e3:.4g} mm along {name}, "
                    f"where it is {widths[axis] * 1e3:.4g} mm wide (rms), and {steep:.2g} is steeper than "
                    f"the sine of {sine:.3g} that samples {pitch * 1e6:.4g} µm apart hold; asked for: "
                    f"{accuracy:g}. "
                    "Use a larger window or a finer pitch.",
                    SamplingWarning,
                    stacklevel=3,
                )


def _above_zero(name: str, value: Any, infinite: bool) -> Any:
    """One number or two, above zero; infinite where it may be."""
    pair = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    values: tuple[Any, ...] = tuple(value) if pair else (value,)
    if len(values) not in (1, 2):
        raise GeometryError(f"{name} has {len(values)} numbers but must be one, or two (y, x).")
    found = [
        math.inf if infinite and isinstance(v, float) and v == math.inf else checks.positive(name, v)
        for v in values
    ]
    return found[0] if len(found) == 1 else (found[0], found[1])


def _shares(fall: float, quality: float, accuracy: float) -> np.ndarray:
    """Share of the light of each order along an axis, as many as matter."""
    count = 1 if fall == 0 else math.ceil(math.log(accuracy / (20 * quality)) / math.log(fall) * 1.5) + 1
    return (1 - fall) * fall ** np.arange(count)


def _left(reach: float) -> float:
    """Part of the second moments lost without modes fainter than exp(-reach) of the brightest."""
    return math.exp(-reach) * (1 + reach + reach**2 / 2)


def _reach(accuracy: float) -> float:
    """The inverse of `_left`."""
    reach = -math.log(accuracy)
    for _ in range(40):
        reach = -math.log(accuracy) + math.log(1 + reach + reach**2 / 2)
    return reach


def _beams(axis: np.ndarray, count: int, waist: float, wavelength: float, distance: float) -> np.ndarray:
    """Hermite-Gauss beams (count, samples) along an axis, of unit power, at a distance from their waist."""
    ranged = math.pi * waist**2 / wavelength
    here = waist * math.hypot(1, distance / ranged)
    scaled, found = axis * math.sqrt(2) / here, np.zeros((count, len(axis)))
    found[0] = (2 / math.pi) ** 0.25 / math.sqrt(here) * np.exp(-(scaled**2) / 2)
    for n in range(1, count):
        found[n] = math.sqrt(2 / n) * scaled * found[n - 1]
        if n > 1:
            found[n] -= math.sqrt((n - 1) / n) * found[n - 2]
    if distance == 0:
        return found
    curved = np.exp(1j * math.pi / wavelength * axis**2 * distance / (distance**2 + ranged**2))
    gouy = np.exp(-1j * (np.arange(count) + 0.5) * math.atan2(distance, ranged))
    carrier = np.exp(1j * math.pi * math.fmod(distance / wavelength, 2.0))  # each axis half of exp(ikz)
    return found * gouy[:, None] * curved * carrier
