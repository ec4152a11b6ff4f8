"""Raw images to judge others by: sums of quadratures that share no code with lumigraph's operators.

All are paraxial, for 1 of light in all on the lenslets. The main lens' light is a Hankel integral over its
round stop; behind the lenslets the Fresnel integral goes line by line over each lenslet's own Gauss-Legendre
nodes, so that edges are exact, squares', hexagons' and discs'; pixels are Gauss-Legendre means too. There is
no grid that could wrap light round, miss an edge or clip what goes steeply. `Fineness` doubles to converge.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_array
from scipy.special import j0

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Fineness:
    """Nodes along a lenslet, in a pixel, across the stop, and spline points to a λL/D."""

    lenslet: int = 96
    pixel: int = 4
    pupil: int = 1200
    spline: int = 96


TAPS = 28
"""Samples to each side by which light is interpolated: errs by exp(-π TAPS/4), 3e-10."""

FINE, COARSE = Fineness(), Fineness(72, 3, 900, 64)


@dataclass(frozen=True, slots=True, eq=False)
class _Row:
    """Light of one line across a row of lenslets: its y and weight, and the nodes along x with theirs."""

    y: float
    weight: float
    x: np.ndarray
    lens: np.ndarray


class Relay:
    """A camera's lenslets and pixels; lattices along the axes, not turned."""

    def __init__(self, camera: Any, fineness: Fineness = FINE) -> None:
        self.camera, self.fineness = camera, fineness
        (self.array,) = camera.relay_train().elements[:1]
        self.unit, self.weight = np.polynomial.legendre.leggauss(fineness.lenslet)
        nodes, self.shares = np.polynomial.legendre.leggauss(fineness.pixel)
        grid = camera.sensor.grid
        self.at = [
            (-c[:, None] + nodes * p / 2).ravel()  # the raw image is turned by 180°
            for c, p in zip((grid.y, grid.x), grid.pitch, strict=True)
        ]

    @cached_property
    def lenslets(self) -> list[tuple[float, float, float]]:
        """(y, x, focal length) of each that exists."""
        lattice, focal = self.array.lattice, np.atleast_1d(self.array.focal_length)
        reach = [1.5 * e for e in self.array.extent]
        pairs = lattice.indices((-reach[0], reach[0]), (-reach[1], reach[1]))
        places = lattice.position(pairs)
        exists = (np.abs(places) <= np.array(self.array.extent) / 2 * (1 + 1e-9)).all(1)
        kinds = lattice.kind(pairs[:, 0], pairs[:, 1]) % len(focal)
        return [(*place, focal[kind]) for place, kind in zip(places[exists], kinds[exists], strict=True)]

    def _chords(self) -> list[tuple[float, float, float]]:
        """(y, weight, half width) of the lines across a lenslet."""
        half = self.array.fill_factor * self.array.lattice.pitch / 2
        if self.array.shape == "square":
            return [(half * u, half * w, half) for u, w in zip(self.unit, self.weight, strict=True)]
        if self.array.shape == "round":  # u = sin t: smooth at both ends
            t, w = np.pi / 2 * self.unit, np.pi / 2 * self.weight
            return list(zip(half * np.sin(t), half * np.cos(t) * w, half * np.cos(t), strict=True))
        corner, result = 2 * half / math.sqrt(3), []
        for low, high in ((-corner, -corner / 2), (-corner / 2, corner / 2), (corner / 2, corner)):
            for u, w in zip(self.unit, self.weight, strict=True):
                y = (low + high) / 2 + (high - low) / 2 * u
                result.append((y, (high - low) / 2 * w, min(half, (corner - abs(y)) * math.sqrt(3))))
        return result

    @cached_property
    def lines(self) -> list[_Row]:
        """All lines of light behind the lenslets."""
        rows: dict[float, list[tuple[float, float]]] = {}
        for y, x, focal in self.lenslets:
            rows.setdefault(round(y, 12), []).append((x, focal))
        result = []
        for y, members in rows.items():
            for dy, weight, half in self._chords():
                dx = half * self.unit
                lens = [
                    half * self.weight * np.exp(-1j * np.pi * (dx**2 + dy**2) / (self.camera.wavelength * f))
                    for _, f in members
                ]
                x = np.concatenate([middle + dx for middle, _ in members])
                result.append(_Row(y + dy, weight, x, np.concatenate(lens)))
        return result

    def _spread(self, at: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        return np.exp(1j * np.pi * np.subtract.outer(at, nodes) ** 2 / self._squared) / math.sqrt(
            self._squared
        )

    @property
    def _squared(self) -> float:
        return self.camera.wavelength * self.camera.lenslet_distance

    @cached_property
    def _separable(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
        """Of square lenslets: nodes along y and x, and the matrices behind them."""
        if self.array.shape != "square":
            return None
        found = []
        half = self.array.fill_factor * self.array.lattice.pitch / 2
        for axis in (0, 1):
            centers = np.unique(np.round([c[axis] for c in self.lenslets], 12))
            nodes = (centers[:, None] + half * self.unit).ravel()
            lens = (
                half
                * self.weight
                * np.exp(
                    -1j * np.pi * (half * self.unit) ** 2 / (self.camera.wavelength * self.array.focal_length)
                )
            )
            found.append((nodes, self._spread(self.at[axis], nodes) * np.tile(lens, len(centers))))
        return found[0][0], found[1][0], found[0][1], found[1][1]

    def _sampled(self, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As `_separable`, from samples of light a step apart, of which the nodes' are interpolated."""
        assert self._separable is not None
        y, x, down, across = self._separable
        found = [_interpolation(nodes, step) for nodes in (y, x)]
        wide = [(share.T @ matrix.T).T for (_, share), matrix in zip(found, (down, across), strict=True)]
        return found[0][0], found[1][0], wide[0], wide[1]

    def fields(self, lights: Sequence[Any], band: float | None = None) -> Iterator[np.ndarray]:
        """Amplitudes at all pixels' nodes, of each ``light(y, x)`` of the lenslet plane.

        Of lights that hold no frequency above `band` [1/m], before square lenslets, four samples a period are
        enough.
        """
        if self._separable is not None:
            y, x, down, across = self._separable if band is None else self._sampled(1 / (4 * band))
            yield from (down @ light(y, x) @ across.T for light in lights)
            return
        ys, weights, behind, spreads = [], [], [], {}
        for line in self.lines:
            key = line.x.tobytes()
            if key not in spreads:
                spreads = {k: spreads[k] for k in list(spreads)[-400:]} | {
                    key: self._spread(self.at[1], line.x)
                }
            here = np.stack([line.lens * light(np.array([line.y]), line.x)[0] for light in lights], axis=1)
            behind.append(spreads[key] @ here)
            ys.append(line.y)
            weights.append(line.weight)
        down, across = self._spread(self.at[0], np.array(ys)) * weights, np.array(behind)
        yield from (down @ across[:, :, k] for k in range(len(lights)))

    def pixels(self, intensity: np.ndarray) -> np.ndarray:
        """Means over pixels (ny, nx)."""
        q = self.fineness.pixel
        ny, nx = (len(at) // q for at in self.at)
        shares = self.shares / 2
        return np.einsum("yixj,i,j->yx", intensity.reshape(ny, q, nx, q), shares, shares)


def _interpolation(nodes: np.ndarray, step: float) -> tuple[np.ndarray, csr_array]:
    """Places a step apart, and weights (nodes, places) of light there, whose band is half of theirs."""
    first, last = (math.floor(end / step) for end in (nodes.min(), nodes.max()))
    at = np.arange(first - TAPS + 1, last + TAPS + 1)
    index = np.floor(nodes / step).astype(int)[:, None] + np.arange(-TAPS + 1, TAPS + 1)
    away = nodes[:, None] / step - index
    weights = np.sinc(away) * np.exp(-np.pi * away**2 / (4 * TAPS))
    rows = np.arange(len(nodes) + 1) * 2 * TAPS
    return at * step, csr_array((weights.ravel(), (index - at[0]).ravel(), rows), (len(nodes), len(at)))


class Lens:
    """Amplitude of a point's light behind a round main lens, for 1 of light."""

    def __init__(self, camera: Any, dz: float, fineness: Fineness = FINE, farthest: float = 0.0) -> None:
        self.camera, self.distance = camera, camera.object_distance + dz
        wavelength, L, half = camera.wavelength, camera.separation, camera.pupil_diameter / 2
        (lens,) = camera.lens_train().elements
        power = 1 / self.distance + 1 / L - 1 / lens.focal_length
        farthest = farthest or 7 * max(camera.lenslets.reach)
        unit, weight = np.polynomial.legendre.leggauss(fineness.pupil)
        rho, weight = half * (unit + 1) / 2, half / 2 * weight
        pupil = np.exp(1j * np.pi * power * rho**2 / wavelength) * 2 * np.pi * rho * weight
        at = np.linspace(0, farthest, 2 + int(farthest / (wavelength * L / half / fineness.spline)))
        parts = np.array_split(at, max(1, len(at) * len(rho) // 2**22))
        values = [j0(2 * np.pi / (wavelength * L) * np.outer(part, rho)) @ pupil for part in parts]
        self._spline = CubicSpline(at, np.concatenate(values) / (wavelength * L * half * np.sqrt(np.pi)))

    def light(self, point: Point) -> Any:
        """Function ``(y, x)`` of a point's amplitude in the lenslet plane."""
        L, squared = self.camera.separation, self.camera.wavelength * self.camera.separation
        dy, dx = (c * L / self.distance for c in point)
        phase = np.pi * (point[0] ** 2 + point[1] ** 2) / (self.camera.wavelength * self.distance)

        def amplitude(y: np.ndarray, x: np.ndarray) -> np.ndarray:
            bend = np.outer(np.exp(1j * np.pi * y**2 / squared), np.exp(1j * np.pi * x**2 / squared))
            return np.exp(1j * phase) * bend * self._spline(np.hypot((y + dy)[:, None], x + dx))

        return amplitude


def points(camera: Any, dz: float, at: Sequence[Point], fineness: Fineness = FINE) -> list[np.ndarray]:
    """Raw image (ny, nx) of each point, for 1 of light on the lenslets."""
    relay, lens = Relay(camera, fineness), Lens(camera, dz, fineness)
    return [relay.pixels(np.abs(f) ** 2) for f in relay.fields([lens.light(point) for point in at])]


class Sensor:
    """Pixels of a camera without lenslets, and what a point's light is on their nodes."""

    def __init__(self, camera: Any, dz: float, fineness: Fineness = FINE) -> None:
        self.grid, (nodes, self.shares) = camera.sensor.grid, np.polynomial.legendre.leggauss(fineness.pixel)
        self.lens = Lens(camera, dz, fineness, 2 * max(self.grid.size))
        self.y, self.x = (
            (-c[:, None] + nodes * p / 2).ravel()
            for c, p in zip((self.grid.y, self.grid.x), self.grid.pitch, strict=True)
        )

    def field(self, point: Point) -> np.ndarray:
        """Amplitude at all nodes, for 1 of light."""
        return self.lens.light(point)(self.y, self.x)

    def pixels(self, intensity: np.ndarray) -> np.ndarray:
        """Means over pixels (ny, nx)."""
        (ny, nx), q, shares = self.grid.shape, len(self.shares), self.shares / 2
        return np.einsum("yixj,i,j->yx", intensity.reshape(ny, q, nx, q), shares, shares)


def focused(camera: Any, dz: float, at: Sequence[Point], fineness: Fineness = FINE) -> list[np.ndarray]:
    """Raw image (ny, nx) of each point before a camera without lenslets, for 1 of light on the sensor."""
    sensor = Sensor(camera, dz, fineness)
    return [sensor.pixels(np.abs(sensor.field(point)) ** 2) for point in at]


def coherent_focused(
    camera: Any, dz: float, samples: Iterator[tuple[Point, float]], area: float, fineness: Fineness = FINE
) -> np.ndarray:
    """As `coherent`, before a camera without lenslets."""
    sensor, distance = Sensor(camera, dz, fineness), camera.object_distance + dz
    total: Any = sum(amplitude * sensor.field(place) for place, amplitude in samples)
    pupil = math.pi * camera.pupil_diameter**2 / 4
    return sensor.pixels(np.abs(total) ** 2) * area**2 * pupil / (camera.wavelength * distance) ** 2


def coherent(
    camera: Any, dz: float, samples: Iterator[tuple[Point, float]], area: float, fineness: Fineness = FINE
) -> np.ndarray:
    """Raw image (ny, nx) of samples (place, amplitude) of an area that one wave along the axis lights.

    A uniform amplitude of 1 gives 1 on the lenslets, times the square of the demagnification.
    """
    relay, lens, chosen = Relay(camera, fineness), Lens(camera, dz, fineness), list(samples)
    fields = relay.fields([lens.light(place) for place, _ in chosen])
    total: Any = sum(amplitude * f for (_, amplitude), f in zip(chosen, fields, strict=True))
    # From light of 1 at each point to the Fresnel integral of an amplitude over the sample's area.
    pupil = math.pi * camera.pupil_diameter**2 / 4
    return relay.pixels(np.abs(total) ** 2) * area**2 * pupil / (camera.wavelength * lens.distance) ** 2


def white(camera: Any, across: int = 96, fineness: Fineness = FINE) -> np.ndarray:
    """Raw image (ny, nx) of an evenly lit stop, for 1 of light to the area on the lenslets."""
    relay, squared = Relay(camera, fineness), camera.wavelength * camera.separation
    unit, weight = np.polynomial.legendre.leggauss(across)
    half, total = camera.pupil_diameter / 2, 0.0
    t = np.pi / 2 * unit
    down = half * np.sin(t), half * np.cos(t) * np.pi / 2 * weight
    if relay._separable is not None:
        return _white_of_squares(relay, half, down, (unit, weight)) / (math.pi * half**2)
    for v, w in zip(*down, strict=True):
        chord = math.sqrt(half**2 - v**2)
        waves = [_from(v, u, squared) for u in chord * unit]
        for share, f in zip(chord * weight * w, relay.fields(waves), strict=True):
            total = total + share * np.abs(f) ** 2
    return relay.pixels(np.asarray(total)) / (math.pi * half**2)


Nodes = tuple[np.ndarray, np.ndarray]
"""Places and weights of a quadrature."""


def _white_of_squares(relay: Relay, half: float, down: Nodes, across: Nodes) -> np.ndarray:
    """Integral over the stop behind square lenslets, whose waves are products of one along each axis."""
    assert relay._separable is not None
    y, x, behind_y, behind_x = relay._separable
    squared = relay.camera.wavelength * relay.camera.separation

    def seen(behind: np.ndarray, at: np.ndarray, places: np.ndarray) -> np.ndarray:
        waves = np.exp(1j * np.pi * np.subtract.outer(at, places) ** 2 / squared)
        light = np.abs(behind @ waves) ** 2
        return np.einsum("iqn,q->in", light.reshape(-1, relay.fineness.pixel, len(places)), relay.shares / 2)

    rows, columns = seen(behind_y, y, down[0]), []
    for v in down[0]:
        chord = math.sqrt(half**2 - v**2)
        columns.append(seen(behind_x, x, chord * across[0]) @ (chord * across[1]))
    return (rows * down[1]) @ np.array(columns)


def _from(v: float, u: float, squared: float) -> Any:
    """Light of amplitude 1 from a place (v, u) of the stop."""

    def wave(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return np.outer(
            np.exp(1j * np.pi * (y - v) ** 2 / squared), np.exp(1j * np.pi * (x - u) ** 2 / squared)
        )

    return wave
