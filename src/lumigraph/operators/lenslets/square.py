r"""Square lenslets along an axis: light around each, through it, to the samples of all cells that it lights.

In lengths of a lenslet's pitch p, with ω on the lenslet and σ from its middle on the image, its light is

.. math:: E(\sigma) = \sqrt{a} \int u(\omega) \, e^{-i \pi c \omega^2} \,
          e^{i \pi a (\sigma - \omega)^2} \, d\omega,
          \quad a = \frac{p^2}{\lambda b}, \quad c = \frac{p^2}{\lambda f}

with the telecentric distance b, by Gauss-Legendre quadrature between its edges. Nodes and samples are frozen
in pitches: a camera's numbers are a and c alone, and where fill factors differ the nodes.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from lumigraph.operators.lenslets.array_libraries import NUMPY, Array, ArrayLibrary, Numbers
from lumigraph.operators.lenslets.cell_response import focal_lengths, legendre, nodes
from lumigraph.operators.lenslets.lenslet_light import AROUND
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.cell_axis import STEP, CellAxis
from lumigraph.operators.sampling.optics import Optics

Ways = tuple[range, range]
"""Rows and columns of cells of the image."""

Key = tuple[Any, ...]
"""Name of an array."""

WIDER = 1.02
"""Steps of the periods in a cell that bands are rounded up to: cameras a little apart interpolate alike."""

TOGETHER = 8
"""Cells along an axis whose samples one matrix brings light to."""


@dataclass(eq=False)
class SquareLenslets:
    """Square lenslets that are alike: light in their plane to light on the image.

    Parameters
    ----------
    optics
        Camera, cells and sampling.
    precision
        Of amplitudes.
    like
        Those of a camera that hardly differs, whose sampling is taken.
    """

    optics: Optics
    precision: type[np.complexfloating] = np.complex64
    like: "SquareLenslets | None" = None
    _known: dict[Key, Array] = field(default_factory=dict)
    _prepared: dict[Key, Array] = field(default_factory=dict)

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Places of light along y and x that the samples of some cells need [m]."""
        y, x = (self._places(which, cells) for which, cells in enumerate((rows, columns)))
        return y, x

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """Amplitude (y, x) on the samples of the cells, of light (y, x) at those places."""
        cells = rows, columns
        prepared = self.prepared(self.keys(cells))
        return self.amplitude(NUMPY, prepared, light.astype(self.precision), cells, self.lit(light, cells))

    def along(self, which: int, light: np.ndarray, cells: range) -> np.ndarray:
        """Amplitudes (samples, n) of some cells along an axis, of light (places, n) there."""
        keys = [key for key, _ in self._blocks(which, cells) if key[-1]]
        return self._along(NUMPY, self.prepared(keys), which, light.astype(self.precision), cells)

    def lit(self, light: np.ndarray, cells: Ways) -> Any:
        """Choice of lenslets that are not dark: all of these."""
        return None

    def keys(self, cells: Ways) -> list[Key]:
        """Names of the arrays that light behind some cells is computed with."""
        return list(
            {
                key: None
                for which, mine in enumerate(cells)
                for key, *_ in self._blocks(which, mine)
                if key[-1]  # some lenslets
            }
        )

    def grouped(self, keys: Iterable[Key]) -> list[list[Key]]:
        """Arrays that are followed back together: all."""
        return [list(keys)]

    def numbers(self, keys: Iterable[Key]) -> dict[Key, np.ndarray]:
        """Numbers of the camera that some arrays follow from."""
        wanted = {key for which in {key[1] for key in keys} for key in self._along_axis(which)}
        return {key: self.number(key) for key in sorted(wanted, key=str)}

    def number(self, key: Key) -> np.ndarray:
        """One of them; the other's where it follows from the same."""
        if key not in self._known:
            same = self.like is not None and self._given(key) == self.like._given(key)
            self._known[key] = self.like.number(key) if same else self._made(key)  # type: ignore[union-attr]
        return self._known[key]

    def prepared(self, keys: Iterable[Key]) -> dict[Key, Array]:
        """Arrays of the camera itself, computed once."""
        keys = list(keys)
        if missing := [key for key in keys if key not in self._prepared]:
            found = self.prepare(NUMPY, self.numbers(missing), missing)
            self._prepared |= {key: one.astype(self.precision) for key, one in found.items()}
        return {key: self._prepared[key] for key in keys}

    def prepare(self, xp: ArrayLibrary, numbers: Numbers, keys: Iterable[Key]) -> dict[Key, Array]:
        """Matrices (samples, places) of blocks of cells along an axis, of a camera's numbers."""
        ones: dict[int, Array] = {}
        found = {}
        for key in keys:
            _, which, cells, first, count = key
            if which not in ones:
                ones[which] = self._one(xp, numbers, which)
            found[key] = self._block(xp, ones[which], which, (cells, first, count))
        return found

    def amplitude(self, xp: ArrayLibrary, prepared: Numbers, light: Array, cells: Ways, lit: Any) -> Array:
        """Amplitude (..., y, x) on the samples of cells, of light (..., y, x) in the lenslet plane."""
        rows, columns = cells
        down = self._along(xp, prepared, 0, light, rows)
        return self._along(xp, prepared, 1, down.swapaxes(-1, -2), columns).swapaxes(-1, -2)

    def _along(self, xp: ArrayLibrary, prepared: Numbers, which: int, light: Array, cells: range) -> Array:
        """Amplitudes (..., samples, n) along an axis, of light (..., places, n)."""
        parts = []
        for key, start in self._blocks(which, cells):
            if not key[-1]:
                shape = (*light.shape[:-2], key[2] * self._sides[which].samples, light.shape[-1])
                parts.append(xp.asarray(np.zeros(shape, self.precision)))
            else:
                matrix = prepared[key]
                parts.append(matrix @ xp.part(light, start, start + matrix.shape[1], -2))
        return parts[0] if len(parts) == 1 else xp.concatenate(parts, -2)

    def _blocks(self, which: int, cells: range) -> list[tuple[Key, int]]:
        """Blocks of cells: name of each one's matrix, and the first place of its light."""
        around, step, found = self._around(which, cells), self._step(which), []
        reach = self._reach[which]
        for low in range(cells.start, cells.stop, TOGETHER):
            high = min(low + TOGETHER, cells.stop)
            first, last = max(low - reach, around.start), min(high + reach, around.stop)
            count = max(0, last - first)
            found.append((("block", which, high - low, first - low, count), (first - around.start) * step))
        return found

    def _block(self, xp: ArrayLibrary, one: Array, which: int, block: tuple[int, int, int]) -> Array:
        """Matrix (samples, places) of some cells, of so many lenslets from a cell on."""
        cells, first, count = block
        axis, size = self._sides[which], cells * self._sides[which].samples
        starts = [(first + k - self._reach[which]) * axis.samples for k in range(count)]
        onto = xp.stack([xp.overlap_add(xp.stack([one]), [start], size, 0) for start in starts])
        step = self._step(which)
        return xp.overlap_add(onto, [k * step for k in range(count)], (count - 1) * step + one.shape[1], 1)

    def _one(self, xp: ArrayLibrary, numbers: Numbers, which: int) -> Array:
        """Matrix (samples of all cells that it lights, places of light around it) of one lenslet."""
        bend = xp.exp(-1j * np.pi * numbers["focus", which] * numbers["nodes", which] ** 2)
        spread = self._spread(xp, numbers, which) * bend
        return spread @ (numbers["light", which] + 0j)

    def _spread(self, xp: ArrayLibrary, numbers: Numbers, which: int, *one: int) -> Array:
        """Matrix (samples of all cells that it lights, nodes) from a lenslet's nodes."""
        strength, off = numbers["strength", which], numbers["nodes", which, *one]
        reach, axis = self._reach[which], self._sides[which]
        cells = np.arange(-reach, reach + 1)[:, None, None]
        apart = xp.asarray(cells + (axis.image / axis.size)[:, None]) - off
        spread = numbers["weights", which, *one][:, None, :] * xp.exp(1j * np.pi * strength * apart**2)
        if self._pixels is not None:
            spread = spread * numbers["accepted", which, *one]
        return (strength**0.5 * spread).reshape((-1, off.shape[0]))

    def _along_axis(self, which: int) -> list[Key]:
        """Names of the numbers that a lenslet's matrix along an axis follows from."""
        more = ["accepted"] if self._pixels is not None else []
        return [(name, which) for name in ("strength", "focus", "nodes", "weights", "light", *more)]

    def _given(self, key: Key) -> tuple[Any, ...]:
        """Values that a number follows from, beside the sampling that all share."""
        array, size = self.optics.array, self.optics.cells.size
        if key[0] in ("nodes", "weights", "light"):
            return (array.fill_factor, *np.divide(self._aside(*key[2:]), size).tolist())
        if key[0] == "accepted":
            return self._pixels, size, self._squared, array.fill_factor, self._aside(*key[2:])
        return self._squared, size, array.focal_length, self.optics.camera.wavelength

    def _made(self, key: Key) -> np.ndarray:
        """Number of the camera."""
        name, which, *one = key
        size, own = self.optics.cells.size[which], tuple(one)
        if name == "strength":
            return np.asarray(size**2 / self._squared)
        if name == "focus":
            (focal_length,) = focal_lengths(self.optics.array)
            return np.asarray(size**2 / (self.optics.camera.wavelength * focal_length))
        off, weight = self._quadrature(which, *own)
        if name == "nodes":
            return off
        if name == "light":
            return self._held[which](off)
        reach, axis = self._reach[which], self._sides[which]
        apart = off - np.arange(-reach, reach + 1)[:, None]
        if name == "weights":
            return weight * axis.fade(apart * axis.size, axis.size)
        response, distance = self._pixels  # type: ignore[misc]  # asked by `_along_axis`
        aside = (axis.image / axis.size)[:, None] - apart[:, None, :]
        return response.amplitude(aside * size / distance)

    def _quadrature(self, which: int, *one: int) -> tuple[np.ndarray, np.ndarray]:
        """Nodes from the middle of a lenslet's cell, and their weights [sizes of a cell]."""
        half, aside = self.optics.array.fill_factor / 2, self._aside(*one)[which]
        aside = aside / self.optics.cells.size[which]
        return legendre(aside - half, aside + half, self._counts[which])

    def _aside(self, *one: int) -> tuple[float, float]:
        """Offset (y, x) of the middle of a lenslet from the lattice [m]."""
        return 0.0, 0.0

    @cached_property
    def _sides(self) -> tuple[CellAxis, CellAxis]:
        """Sampling of a cell along y and along x, computed once."""
        return self.optics.axes

    @cached_property
    def _squared(self) -> float:
        """Wavelength times the telecentric distance to the image [m²]."""
        return self.optics.camera.wavelength * _cells.telecentric_distance(self.optics.camera)

    @cached_property
    def _pixels(self) -> Any:
        """Angular response of the pixels, and the distance that its angles are seen over; None without."""
        return _cells.accepted(self.optics.camera)

    @cached_property
    def _axes(self) -> tuple[CellAxis, CellAxis]:
        """Samples of the light around a lenslet, and periods of its band."""
        found = []
        for axis in self._sides:
            more = AROUND[0] + AROUND[1] * max(0.0, math.log10(1e-3 / self.optics.fineness.accuracy))
            margin = replace(axis, neighbourhood=more / axis.band / 2).margin
            steps = math.ceil(math.log(axis.band * axis.size) / math.log(WIDER) - 1e-9)
            beyond = (margin - 0.5) * axis.size / axis.points  # so many samples, however rounded
            found.append(replace(axis, neighbourhood=beyond, band=WIDER**steps / axis.size))
        return found[0], found[1]

    @cached_property
    def _held(self) -> list[Any]:
        """Gives the matrix (nodes, places) from light around a lenslet to nodes [sizes of a cell]."""
        return self.like._held if self.like is not None else [_held(axis) for axis in self._axes]

    @cached_property
    def _windows(self) -> tuple[np.ndarray, np.ndarray]:
        """Places of the light around a lenslet [sizes of a cell]."""
        if self.like is not None:
            return self.like._windows
        y, x = (axis.window / axis.size for axis in self._axes)
        return y, x

    @cached_property
    def _reach(self) -> tuple[int, int]:
        """Cells beside it to which a lenslet sends light, along y and along x."""
        if self.like is not None:
            return self.like._reach
        y, x = (math.floor(0.5 + axis.neighbourhood / axis.size + 1e-9) for axis in self._sides)
        return y, x

    @cached_property
    def _counts(self) -> tuple[int, int]:
        """Nodes of the quadrature along y and along x."""
        if self.like is not None:
            return self.like._counts
        (focal_length,) = focal_lengths(self.optics.array)
        y, x = (self._nodes(which, focal_length) for which in (0, 1))
        return y, x

    def _nodes(self, which: int, focal_length: float) -> int:
        """Nodes of a quadrature across a lenslet of a focal length."""
        axis, wavelength = self._sides[which], self.optics.camera.wavelength
        half = self.optics.array.fill_factor * axis.size / 2
        return nodes(half, focal_length, axis, (wavelength, self._squared / wavelength))

    def _step(self, which: int) -> int:
        """Samples of light from a lenslet to the next."""
        return self._sides[which].points // STEP

    def _middles(self, which: int, mine: range) -> np.ndarray:
        """Middles of cells [m]."""
        cells = self.optics.cells
        number = np.arange(mine.start, mine.stop) - cells.ring[which] + 0.5
        return cells.edge[which] + number * cells.size[which]

    def _around(self, which: int, mine: range) -> range:
        """Cells along an axis whose lenslets send light to some cells, as far as the array has any."""
        reach, extent = self._reach[which], self.optics.array.extent
        far = range(mine.start - reach, mine.stop + reach)
        if extent is None:
            return far
        inside = np.abs(self._middles(which, far)) <= extent[which] / 2 + 1e-9 * self.optics.cells.size[which]
        kept = np.flatnonzero(inside).tolist()
        return far[kept[0] : kept[-1] + 1] if kept else far[:0]

    def _places(self, which: int, cells: range) -> np.ndarray:
        """Places of the light around those lenslets [m]."""
        around, window, size = self._around(which, cells), self._windows[which], self.optics.cells.size[which]
        count = len(window) + (len(around) - 1) * self._step(which) if around else 0
        start = self._middles(which, around[:1])[0] + window[0] * size if around else 0.0
        return start + np.arange(count) * (window[1] - window[0]) * size


def _held(axis: CellAxis) -> Any:
    coefficients, light = axis.basis()
    return lambda off: light(off * axis.size) @ coefficients
