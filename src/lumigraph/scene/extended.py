"""Lamps of any shape: incoherent sources whose light gains coherence on its way (van Cittert and Zernike)."""

import math
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError, LumigraphError, SamplingError
from lumigraph.scene import lamps
from lumigraph.scene.sources import warn_if_coarse

Pair = tuple[float, float]

COMPRESSED = 1500
"""Waves that are turned into fewer coherent modes; more would take longer than they save."""

QUADRATURE = 0.1
"""Share of the accuracy that is left to the quadrature of the lamp."""


class Lamp(Protocol):
    """A bright shape, whose directions are seen as sines (y, x)."""

    @property
    def half_size(self) -> Pair:
        """Largest sines along y and x."""
        ...

    @property
    def solid_angle(self) -> float:
        """Area of what is lit, in squared sines."""
        ...

    def transform(self, y: Any, x: Any) -> np.ndarray:
        """Mean of exp(-i(y s_y + x s_x)) over the light, in closed form."""
        ...

    def nodes(self, y: float, x: float, more: int) -> tuple[np.ndarray, np.ndarray]:
        """Sines (waves, 2) and weights of sum 1 (waves,), for transforms at up to y and x."""
        ...

    def scaled(self, factor: float) -> Self:
        """The same, seen under other angles."""
        ...


@dataclass(frozen=True, slots=True)
class ExtendedSource:
    r"""An incoherent source of any shape, seen from the plane that it lights evenly.

    Each of its points lights the plane with a wave of its own. By van Cittert and Zernike's theorem the
    degree of coherence between two points of the plane is the transform of the source's intensity over
    the sines s of its directions,

    .. math:: \mu(r_1, r_2) = e^{i k (r_1^2 - r_2^2) / (2 z)} \int I(s) \, e^{-i k s (r_1 - r_2)} d^2s
              \Big/ \int I(s) \, d^2s

    Paraxial. Use `disc`, `rectangle` or `picture`.

    Parameters
    ----------
    lamp
        Shape of the lamp.
    distance
        z from the source to the plane [m]; infinity for collimated light, negative for light that converges
        to an image of the source behind the plane, such as a condenser's in the main lens.

    Raises
    ------
    GeometryError
        A distance of 0, or sines that are not above 0 or beyond 1.

    References
    ----------
    M. Born and E. Wolf, *Principles of Optics*, 7th edition, section 10.4.2.

    Examples
    --------
    >>> lamp = ExtendedSource.disc(0.5e-3 / 0.2, distance=0.2)  # 1 mm wide, 200 mm away
    >>> round(abs(complex(lamp.degree(0.0, 100e-6, 633e-9))), 4)
    0.4043
    >>> lamp.modes(Grid.square(50, 5e-6), 633e-9).count
    19
    """

    lamp: Lamp
    distance: float = math.inf

    def __post_init__(self) -> None:
        if self.distance != math.inf:
            object.__setattr__(self, "distance", checks.finite("distance", self.distance))
        if self.distance == 0:
            raise GeometryError(
                "distance is 0 m: the plane lies in the source. Give a distance, or math.inf for collimated "
                "light."
            )

    @classmethod
    def disc(cls, radius: float, distance: float = math.inf) -> "ExtendedSource":
        """An even disc; the radius is a sine: that of the disc over the distance, or a numerical aperture."""
        return cls(lamps.Disc(radius), distance)

    @classmethod
    def rectangle(cls, half_size: float | Pair, distance: float = math.inf) -> "ExtendedSource":
        """An even rectangle, from -h to h; sines, one or two (y, x)."""
        return cls(lamps.Rectangle(checks.pair("half_size", half_size, "1")), distance)

    @classmethod
    def picture(cls, intensity: Any, sines: Grid, distance: float = math.inf) -> "ExtendedSource":
        """Pixels (y, x) that are each evenly bright; their grid is one of sines, not of metres.

        Raises
        ------
        GeometryError
            A shape that differs from the grid's.
        LumigraphError
            Intensities that are negative, not finite, complex, or all zero.
        """
        checks.instance("sines", sines, Grid)
        checks.array("intensity", intensity)
        data = np.asarray(to_numpy(intensity))
        if data.shape != sines.shape:
            raise GeometryError(
                f"the source has shape {data.shape} but its sines {sines.shape}. Give its own grid."
            )
        checks.finite_array("intensity", data)
        if np.iscomplexobj(data) or data.min() < 0 or not data.any():
            raise LumigraphError("a source's intensity must be real, at least 0, and above 0 somewhere.")
        return cls(lamps.PictureLamp(data.astype(np.float64), sines), distance)

    def degree(self, dy: Any, dx: Any, wavelength: float) -> np.ndarray:
        """Degree of coherence of two points at r1 - r2 = (dy, dx) [m], in closed form, without curvature."""
        k = 2 * math.pi / checks.positive("wavelength", wavelength)
        return self.lamp.transform(k * np.asarray(dy, np.float64), k * np.asarray(dx, np.float64))

    def modes(
        self,
        grid: Grid,
        wavelength: float,
        distance: float = 0.0,
        *,
        accuracy: float = 1e-3,
        dtype: Any = np.complex128,
    ) -> CoherentModes:
        """The light's modes on a grid, of intensity 1 on the plane that it lights evenly.

        As many as keep the mutual intensity between any two samples to `accuracy`; the result's ``error``
        says what is reached. Up to 1,500 waves from nodes on the source are turned into the fewest modes,
        brightest first; more are taken as they are.

        Parameters
        ----------
        grid, wavelength
            Where it is sampled, and the wavelength in vacuum [m].
        distance
            From the plane to the grid [m].
        accuracy
            Between 0 and 1.
        dtype
            complex128 or complex64.

        Raises
        ------
        SamplingError
            More modes than fit in memory: with the accuracy that could be had.
        GeometryError
            The grid lies in the source.

        Warns
        -----
        SamplingWarning
            Light that is steeper than the samples resolve.
        """
        light = self.sampled(grid, wavelength, distance, accuracy, dtype)
        nearer = self._at(distance)
        along = zip(nearer.lamp.half_size, grid.size, grid.center, strict=True)
        far = [sine + (size / 2 + abs(center)) / abs(nearer.distance) for sine, size, center in along]
        warn_if_coarse("light of the source", grid, wavelength, (far[0], far[1]))
        return light

    def sampled(
        self, grid: Grid, wavelength: float, distance: float, accuracy: float, dtype: Any
    ) -> CoherentModes:
        """Modes as of `modes`, on a grid that may hold fewer directions, such as an illuminated slice."""
        lamps.check(grid, wavelength, accuracy)
        here = self._at(checks.finite("distance", distance))
        here._require(grid, wavelength, accuracy, np.dtype(dtype).itemsize)
        nodes, weights, error = here._nodes(grid, wavelength, accuracy)
        if len(weights) > COMPRESSED:
            needed = np.dtype(dtype).itemsize * len(weights) * math.prod(grid.shape)
            memory.require(needed, "light of the source", "Use fewer pixels of it.", SamplingError)
        rows, columns = _tilts(grid, wavelength, nodes, weights)
        if len(weights) > COMPRESSED:
            data, left = np.einsum("yn,xn->nyx", rows.astype(dtype), columns.astype(dtype)), 0.0
        else:
            data, left = lamps.fewest(rows, columns, accuracy * (1 - QUADRATURE), dtype)
        return CoherentModes(Field(self._bent(here, data, grid, wavelength), grid, wavelength), error + left)

    def mode_count(self, grid: Grid, wavelength: float, distance: float = 0.0) -> float:
        """Number of modes that `modes` makes, about: area times solid angle over λ², or waves where many."""
        waves = self.wave_count(max(grid.size), wavelength, distance)
        if waves > COMPRESSED / 1.3:  # so many more keep an accuracy of 1e-3
            return waves
        return min(waves, self._at(distance).lamp.solid_angle * math.prod(grid.size) / wavelength**2)

    def wave_count(self, reach: float, wavelength: float, distance: float = 0.0, more: int = 0) -> int:
        """Number of `waves`."""
        radians = 2 * math.pi / wavelength * reach
        return len(self._at(distance).lamp.nodes(radians, radians, more)[1])

    def waves(
        self, grid: Grid, wavelength: float, distance: float, reach: float, more: int = 0
    ) -> np.ndarray:
        """Waves (n, y, x), complex64, that have the light's mutual intensity over short distances.

        Parameters
        ----------
        grid, wavelength, distance
            As of `modes`.
        reach
            Distance along y and x up to which samples have it [m]; those farther apart interfere by chance.
        more
            Another number makes other waves, whose chances are others.

        Raises
        ------
        SamplingError
            They do not fit in memory.
        """
        lamps.check(grid, wavelength, 0.5)
        here, radians = self._at(distance), 2 * math.pi / wavelength * checks.positive("reach", reach)
        nodes, weights = here.lamp.nodes(radians, radians, more)
        needed = 16 * len(weights) * math.prod(grid.shape)
        memory.require(
            needed, "waves of the source", "Use fewer samples, or a smaller source.", SamplingError
        )
        rows, columns = _tilts(grid, wavelength, nodes, weights)
        data = np.einsum("yn,xn->nyx", rows.astype(np.complex64), columns.astype(np.complex64))
        return self._bent(here, data, grid, wavelength)

    def _bent(self, here: "ExtendedSource", data: np.ndarray, grid: Grid, wavelength: float) -> np.ndarray:
        """Waves with the curvature and brightness of a source seen from `here`, in place."""
        if here.distance != math.inf:
            data *= abs(self.distance / here.distance) if self.distance != math.inf else 1.0
            turns = 1j * math.pi / (wavelength * here.distance)
            data *= np.outer(*(np.exp(turns * np.square(axis)) for axis in (grid.y, grid.x))).astype(
                data.dtype
            )
        return data

    def _at(self, distance: float) -> "ExtendedSource":
        """The source as seen from so much farther away."""
        if distance == 0 or self.distance == math.inf:
            return self
        there = self.distance + distance
        if there == 0:
            raise GeometryError(f"the grid is {distance:g} m off the plane: it lies in the source. Move it.")
        return ExtendedSource(self.lamp.scaled(self.distance / there), there)

    def _nodes(self, grid: Grid, wavelength: float, accuracy: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Sines and weights of waves, and by how much their degree of coherence is off at most."""
        k = 2 * math.pi / wavelength
        y, x = (k * (n - 1) * p for n, p in zip(grid.shape, grid.pitch, strict=True))
        down, across = np.linspace(0, y, 17), np.linspace(-x, x, 33)
        exact, off = self.lamp.transform(down[:, None], across), math.inf
        for more in range(40):
            nodes, weights = self.lamp.nodes(y, x, more)
            rows, columns = (
                np.exp(-1j * np.outer(c, s)) for c, s in zip((down, across), nodes.T, strict=True)
            )
            off = float(np.abs((rows * weights) @ columns.T - exact).max())
            if off <= QUADRATURE * accuracy:
                return nodes, weights, off
        raise SamplingError(
            f"the source's waves reach an accuracy of {off:.2g}, not of {accuracy:g}. Ask for less."
        )

    def _require(self, grid: Grid, wavelength: float, accuracy: float, itemsize: int) -> None:
        """Refuse what does not fit, before waves are made: at least as many modes as directions differ."""
        y, x = (size / wavelength for size in grid.size)
        least = self.lamp.solid_angle * y * x
        waves = math.pi**2 * math.prod(self.lamp.half_size) * y * x
        plane, free = itemsize * math.prod(grid.shape), memory.available()
        needed = (waves if waves > COMPRESSED else 2 * min(least, waves)) * plane
        if free is None or needed <= free:
            return
        raise SamplingError(
            f"an accuracy of {accuracy:g} takes some {needed / plane:.3g} modes of {grid.shape[0]} x "
            f"{grid.shape[1]} samples, {memory.told(needed)}, but {memory.told(free)} are free. An accuracy "
            f"of {min(max(1 - free / plane / least, accuracy), 1):.2g} could be had; use fewer samples, a "
            "smaller window or source, or TiltedWaves."
        )


def _tilts(
    grid: Grid, wavelength: float, nodes: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Factors along y (ny, waves), weighed, and along x (nx, waves) of waves with these sines."""
    k = 2 * math.pi / wavelength
    rows, columns = (
        np.exp(-1j * k * np.outer(axis, sines)) for axis, sines in zip((grid.y, grid.x), nodes.T, strict=True)
    )
    return rows * np.sqrt(weights), columns
