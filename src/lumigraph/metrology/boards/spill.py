"""Displacement of board corners by light that lenslets spread and spill.

Behind each lenslet stands a picture of the main lens' stop, spread by diffraction at the lenslet's opening
(`lumigraph.metrology.boards.waves`). Away from the middle of a micro-image of a camera 1.0 there is light of
neighbouring lenslets, too, which a view takes for its own lenslet's: corners are displaced. Edges are found
where `analysis.crossings` fits them to the light: light farther away than the edge is soft has no effect. In
micro-images of a camera 2.0 corners are found outwards (`lumigraph.metrology.boards.rims`).
"""

import itertools
import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import least_squares
from scipy.special import erf

from lumigraph.core import checks
from lumigraph.core.checks import Pair
from lumigraph.core.lattice import Lattice
from lumigraph.metrology.boards import rims
from lumigraph.metrology.boards.waves import SpilledWaves

if TYPE_CHECKING:
    from lumigraph.metrology.boards.camera import MetricCamera

GREEN = 550e-9
"""Wavelength where none is said [m]."""

LEAST_ACROSS = 8
"""Lenslets across which light is looked for, beside those that corners move from view to view."""

NARROW, _APART = 0.1, 1.1
"""λ b/d² below which it is computed for this, and ratio of those for which it is: what spills is proportional
to it, within 4 % down to 0.015."""

_UNSURE, _UNSURE_BEHIND, _UNSURE_EDGE = 0.15, 0.4, 0.2
"""Relative uncertainty of the correction: by wave optics, up to 0.009 of 0.065 is left from view to view; in
micro-images of a camera 2.0, where the stop's width is taken from `Calibration.fill` and the lenslets' focus
from the corners, by 2 % and 10 to 30 %; and where both follow from edges on a white image, within 0.6 %.
"""

_WAYS, _SLOPES = 0.05, 0.5  # steps of ways [pitches] and of σ, between which it is interpolated
_RIM, _STEEP = 0.5, 4.0  # ways and σ beyond which it is taken to be what it is there
_SLOPES_BEHIND, _NARROW_BEHIND = (1.5, 8.0), 0.06  # of cameras 2.0: as `_STEEP`, and as `NARROW`
_LEAST_EDGE, _MOST_EDGE = np.array([0.3, 0.01]), np.array([1.05, 1.5])  # stop and focus that edges may tell
_SETTLED = 2e-3
_MADE = 0.01  # pitches: between an edge and one that waves make, which is that edge
_FALLS = 1.7  # power of λ b/d² by which corners move outwards from that down, as from 0.08 to 0.04
_CLOSE = 0.02  # steps of the logarithm of λ b/d²
_SOFT = 0.3  # pitches: blur of an edge over its sample, as in `analysis.crossings`
_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class Spill:
    """Model of the light that lenslets spill, but for their distance from the sensor.

    Parameters
    ----------
    lattice
        Of the micro-images [px].
    fill
        Width of a micro-image over their pitch, as white images show it.
    wavelength
        Of the light [m].
    sharp
        How far micro-images of a point in focus move, over the way from lenslet to lenslet; 0 of a camera
        1.0. Where the edge is known only its sign counts: whether the image lies behind the lenslets.
    edges
        Width and blur of micro-images on a white image, over their pitch (`analysis.pupil_edge`), of each
        kind of lenslets, or of all: they give the stop's width and the focus. Empty if not measured.

    Raises
    ------
    GeometryError
        A wavelength, a fill or an edge that is not above 0.
    """

    lattice: Lattice
    fill: float
    wavelength: float
    sharp: float = 0.0
    edges: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength", checks.positive("wavelength", self.wavelength))
        checks.positive("fill", self.fill, "1")
        for value in itertools.chain(*self.edges):
            checks.positive("edges", value, "1")

    def width(self, camera: "MetricCamera") -> float:
        """λ b/d over the micro-images' pitch: that of the light behind one of a camera's lenslets, d wide."""
        apart = self.lattice.pitch * camera.pixel_pitch
        lenslets = apart / (1 + camera.lenslet_distance / camera.exit_pupil)
        return self.wavelength * camera.lenslet_distance / lenslets / apart

    def unsure(self, camera: "MetricCamera") -> float:
        """Relative uncertainty of the displacement of corners: one standard deviation."""
        if not self.sharp:
            return _UNSURE
        if not self.edges:
            return _UNSURE_BEHIND
        return _UNSURE_EDGE if self.unmade(camera) is None else 1.0

    def unmade(self, camera: "MetricCamera") -> tuple[Pair, Pair] | None:
        """An edge (width, blur) that no such light makes, and the nearest that it does; None without one."""
        waves, apart = self._waves(_close(self.width(camera))), self._apart
        for edge in self.edges:
            made = _nearest(waves, edge, apart)
            if np.abs(np.subtract(made, edge)).max() > _MADE:
                return edge, made
        return None

    @property
    def _apart(self) -> float:
        return round(self.lattice.pitch, 1)

    def aside(self, way: np.ndarray, slope: np.ndarray, width: float) -> np.ndarray:
        """Displacement (n, 2) of corners in views at ways (n, 2) [px].

        Parameters
        ----------
        way
            Of the views.
        slope
            (n,), how far corners move from view to view, over the way.
        width
            As `width` gives it.
        """
        pitch, axes = self.lattice.pitch, self._axes()
        ways = np.clip(np.asarray(way) @ axes.T / pitch, -_RIM, _RIM)
        slope = np.clip(slope, -_STEEP, _STEEP)
        computed = max(NARROW, _APART ** round(math.log(max(width, NARROW), _APART)))
        table = _table(
            self._waves(computed),
            math.ceil(float(np.abs(ways).max()) / _WAYS),
            (math.floor(slope.min()), math.floor(slope.max()) + 2),
        )  # fmt: skip
        return table(np.column_stack([ways, slope])) @ axes * pitch * (width / computed)

    def outwards(self, way: np.ndarray, moved: np.ndarray, width: float, kind: np.ndarray) -> np.ndarray:
        """Displacement (n, 2) [px] of corners at ways (n, 2) [px] in micro-images of a camera 2.0.

        Parameters
        ----------
        way
            From the micro-images' middles.
        moved
            (n,), how far micro-images of a point move, over the way from lenslet to lenslet.
        width
            As of `aside`.
        kind
            (n,) Of the lenslets.
        """
        sign, size = math.copysign(1.0, float(np.median(moved))), np.hypot(*way.T)
        steps = np.log(np.clip(1 / np.maximum(sign * moved, 1e-9), *_SLOPES_BEHIND)) / math.log(rims.RATIO)
        nodes = range(math.floor(steps.min()), math.floor(steps.max()) + 2)
        slopes = tuple(sign * rims.RATIO**k for k in nodes)
        computed = _close(width)
        found = np.zeros(len(way))
        for one in np.unique(kind).tolist():
            mine, table = kind == one, self._table_behind(computed, one, slopes)
            far = np.minimum(size[mine], table.grid[0][-1])
            found[mine] = table(np.column_stack([far, steps[mine] * math.log(rims.RATIO)]))
        return (found / np.maximum(size, 1e-9) * min(1.0, width / computed) ** _FALLS)[:, None] * way

    def _table_behind(self, width: float, kind: int, slopes: tuple[float, ...]) -> RegularGridInterpolator:
        """`rims.outwards` of lenslets of one kind."""
        waves, apart = self._waves(width), self._apart
        told = _edged(waves, self.edges[kind % len(self.edges)], apart) if self.edges else _filled(waves)
        return rims.outwards(told, apart, slopes)

    def _axes(self) -> np.ndarray:
        """Unit vectors (2, 2) along the lattice's rows, and across them."""
        down, right = self.lattice.basis[0]
        return np.array([(down, right), (right, -down)]) / self.lattice.pitch

    def _waves(self, width: float) -> SpilledWaves:
        """Waves behind a lattice whose rows run along the first axis."""
        lenslets = (np.array(self.lattice.basis) @ self._axes().T / self.lattice.pitch).round(9).tolist()
        return SpilledWaves(width, self.fill, tuple(map(tuple, lenslets)), self.sharp)


def _close(width: float) -> float:
    """The λ b/d² next to one for which corners in micro-images are computed."""
    return math.exp(_CLOSE * round(math.log(max(width, _NARROW_BEHIND)) / _CLOSE))


@lru_cache(maxsize=16)
def _filled(waves: SpilledWaves) -> SpilledWaves:
    """Waves with the stop whose micro-images are seen to fill as much as its own do."""
    return replace(waves, fill=2 * waves.fill - waves.seen_fill())


@lru_cache(maxsize=16)
def _edged(waves: SpilledWaves, edge: Pair, pitch: float) -> SpilledWaves:
    """Waves with the stop and the focus whose micro-images have this edge."""
    sign = math.copysign(1.0, waves.sharp)

    def off(told: np.ndarray) -> np.ndarray:
        return np.subtract(replace(waves, fill=told[0], sharp=sign * told[1]).edge(pitch), edge)

    start = np.clip([edge[0], abs(waves.sharp)], 1.01 * _LEAST_EDGE, 0.99 * _MOST_EDGE)
    fill, sharp = least_squares(
        off, start, bounds=(_LEAST_EDGE, _MOST_EDGE), diff_step=0.02, xtol=_SETTLED, ftol=_SETTLED**2
    ).x
    return replace(waves, fill=float(fill), sharp=sign * float(sharp))


@lru_cache(maxsize=16)
def _nearest(waves: SpilledWaves, edge: Pair, pitch: float) -> Pair:
    """Nearest edge that such waves make."""
    return _edged(waves, edge, pitch).edge(pitch)


@lru_cache(maxsize=16)
def _table(waves: SpilledWaves, reach: int, slopes: tuple[int, int]) -> RegularGridInterpolator:
    """Table of `_Waves.aside`, for ways up to so many steps and slopes from one to another."""
    line = np.arange(-max(reach, 2), max(reach, 2) + 1) * _WAYS
    moved = np.arange(slopes[0], slopes[1] + _SLOPES / 2, _SLOPES)
    ways = np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)
    half = np.array([_views(waves, way, moved) for way in ways[: len(ways) // 2 + 1]])
    found = np.concatenate([half, -half[-2::-1]])  # lenslets on the other side spill the other way
    return RegularGridInterpolator((line, line, moved), found.reshape(len(line), len(line), -1, 2), "cubic")


def _views(waves: SpilledWaves, way: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """(slopes, 2) Where one view shows corners that move by slopes (m,)."""
    found = []
    across = LEAST_ACROSS + math.ceil(np.abs(slopes).max())
    u = waves.directions(across)
    field = waves.opened(u, way)
    for slope in slopes:
        light, at = waves.light(u, field, slope)
        found.append([_edge(light.sum(1 - k), at + slope * way[k]) for k in (0, 1)])
    return -np.array(found)


def _edge(light: np.ndarray, at: np.ndarray) -> float:
    """Position of an edge that is found in light (n,) of points at (n,) [pitches]."""
    place = 0.0
    for _ in range(_ROUNDS):
        place += float(light @ _half(at - place) / light.sum()) * _PULL
    return place


def _half(way: np.ndarray) -> np.ndarray:
    """Part of a soft edge, sampled by lenslets, on the near side of a way: -1/2 to 1/2."""
    ends = np.stack([way + 0.5, way - 0.5])
    risen = ends * erf(ends / (math.sqrt(2) * _SOFT)) + _SOFT * math.sqrt(2 / np.pi) * np.exp(
        -0.5 * (ends / _SOFT) ** 2
    )
    return (risen[0] - risen[1]) / 2


_PULL = 1 / float((np.diff(_half(np.arange(-3, 3, 0.01))) ** 2).sum() / 0.01)
"""Shift of an edge for each part of light on one side of it [pitches]."""
