"""Refracting samples: slices that delay light before it reaches the objective."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import shift, zoom

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.brief import brief
from lumigraph.core.grid import Grid
from lumigraph.core.volume import Volume
from lumigraph.errors import GeometryError

STRAY = 1e-5
"""Part of the light that may be bent farther than is followed."""

MOST_SAMPLES = 4096
"""Samples along a side of a path that is examined for how much it bends light."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Medium:
    """A refracting sample before a microscope, as thin slices: `lumigraph.simulate(..., medium=...)`.

    Parameters
    ----------
    paths
        Optical path (z, y, x) [m] that each slice adds to that through the sample's even index. Paths of
        slices that are far apart are taken as given: only steps between them are estimated.
    grid
        Where the samples of every slice stand [m]; beside it, the border's paths go on.
    depths
        Depths from the focused plane (z,) [m], positive farther from the objective; in any order.
    slabs
        True for slabs of an index that changes from one to the next, as `of_index` has them: then
        simulations check that they are close enough to each other.

    Raises
    ------
    GeometryError
        Paths of another shape, or that are not finite; two slices at one depth.

    Examples
    --------
    >>> grid = Grid.square(4, 1e-6)
    >>> bead = Volume(np.full((3, 4, 4), 0.02), grid, (-4e-6, -2e-6, 0.0))
    >>> Medium.of_index(bead).paths.max().round(12).tolist()  # 0.02 over 2 µm
    4e-08
    """

    paths: np.ndarray
    grid: Grid
    depths: tuple[float, ...]
    slabs: bool = False
    _kept: dict[str, Any] = field(default_factory=dict, repr=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.instance("grid", self.grid, Grid)
        paths = np.asarray(to_numpy(self.paths) if hasattr(self.paths, "shape") else self.paths, np.float64)
        depths = tuple(checks.finite("a depth", dz) for dz in np.atleast_1d(self.depths).tolist())
        if paths.shape != (len(depths), *self.grid.shape):
            raise GeometryError(
                f"paths have shape {paths.shape} but must be (z, y, x) with z = {len(depths)} of the depths "
                f"and (y, x) = {self.grid.shape} of the grid."
            )
        checks.finite_array("paths", paths, GeometryError)
        if min(self.grid.shape) < 2:
            raise GeometryError(
                f"grid has shape {self.grid.shape} but a medium needs 2 x 2 samples at least."
            )
        if len(set(depths)) < len(depths):
            raise GeometryError("depths must differ from slice to slice. Add up the paths of slices at one.")
        order = np.argsort(depths)[::-1]
        object.__setattr__(self, "paths", paths[order])
        object.__setattr__(self, "depths", tuple(depths[k] for k in order))

    @classmethod
    def of_index(cls, difference: Volume[Any]) -> "Medium":
        """Medium of a volume of index differences from the sample's mean; each plane stands for its slab.

        Raises
        ------
        GeometryError
            One plane, which has no thickness, or colours.
        """
        data, depths = np.asarray(to_numpy(difference.data), np.float64), np.asarray(difference.depths)
        if data.ndim != 3 or len(depths) < 2:
            raise GeometryError(
                f"the volume has shape {data.shape} but indices need (z, y, x) of two planes at least: their "
                "distance is the thickness. For one slice give Medium its paths."
            )
        paths = data * np.abs(np.gradient(depths))[:, None, None]
        return cls(paths, difference.grid, difference.depths, slabs=True)

    def before(self, dz: float) -> "Medium | None":
        """The slices that light of a point at a depth meets on its way to the objective; None without."""
        met = [k for k, depth in enumerate(self.depths) if depth < dz]
        return self._remembered(f"before {len(met)}", lambda: self._of(met)) if met else None

    def _of(self, met: list[int]) -> "Medium":
        return replace(self, paths=self.paths[met], depths=tuple(self.depths[k] for k in met), _kept={})

    def coarser(self) -> "Medium":
        """Medium with neighbouring slices merged in pairs, each pair halfway between: a test of the step."""

        def paired() -> Medium:
            pairs = [slice(k, k + 2) for k in range(0, len(self.depths), 2)]
            paths = np.stack([self.paths[pair].sum(0) for pair in pairs])
            depths = tuple(float(np.mean(self.depths[pair])) for pair in pairs)
            return replace(self, paths=paths, depths=depths, _kept={})

        return self._remembered("coarser", paired)

    def finer(self) -> "Medium":
        """Medium with twice as many slices, paths interpolated between: a test of the planes' spacing.

        Of slices that are given as such, and not of an index, themselves.
        """
        if not self.slabs or len(self.depths) < 2:
            return self

        def halved() -> Medium:
            depths, paths = np.array(self.depths), self.paths
            step = np.gradient(depths) / 4
            depths = np.stack([depths - step, depths + step], 1).ravel()
            before, after = np.roll(paths, 1, 0), np.roll(paths, -1, 0)
            before[0], after[-1] = paths[0], paths[-1]
            parts = np.stack([(3 * paths + before) / 8, (3 * paths + after) / 8], 1)
            return replace(self, paths=parts.reshape(-1, *paths.shape[1:]), depths=tuple(depths), _kept={})

        return self._remembered("finer", halved)

    def path(self, number: int, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Optical path of a slice at (y,), (x,) [m]: splines through its samples, computed once (y, x)."""

        def spline() -> RectBivariateSpline:
            degree = min(3, *(n - 1 for n in self.grid.shape))
            return RectBivariateSpline(self.grid.y, self.grid.x, self.paths[number], kx=degree, ky=degree)

        return self._remembered(f"spline {number}", spline)(y, x)

    def bent(self, wavelength: float, slope: float) -> float:
        """Change of n sin θ by all slices, for light inclined by up to a slope.

        All but `STRAY` of the light: it goes along straight lines, upright or leaning to four sides, and
        paths along these add up.
        """

        def found() -> float:
            leans = ((0.0, 0.0), (slope, 0.0), (-slope, 0.0), (0.0, slope), (0.0, -slope))
            return max(self._spread(self._along(lean), wavelength) for lean in leans)

        return self._remembered(f"bent {wavelength} {slope}", found)

    def bent_once(self, wavelength: float) -> float:
        """Largest change of n sin θ by a single slice, for all but `STRAY` of the light."""

        def found() -> float:
            return max(self._spread(path, wavelength) for path in self.paths)

        return self._remembered(f"bent once {wavelength}", found)

    def _along(self, lean: tuple[float, float]) -> np.ndarray:
        """Paths (y, x) that add up along lines of a slope (y, x) through the middle of the slices."""
        away, total = np.array(self.depths) - np.mean(self.depths), np.zeros(self.grid.shape)
        for path, z in zip(self.paths, away, strict=True):
            total += shift(path, [z * s / p for s, p in zip(lean, self.grid.pitch, strict=True)], order=1,
                           mode="nearest")  # fmt: skip
        return total

    def _spread(self, path: np.ndarray, wavelength: float) -> float:
        """N sin θ that holds all but `STRAY` of a plane wave behind a path (y, x) [m]."""
        slopes = [np.abs(np.diff(path, axis=k)).max(initial=0.0) for k in (0, 1)]
        finer = min(max(1, math.ceil(4 * max(slopes) / wavelength)), MOST_SAMPLES // max(path.shape))
        path = np.asarray(zoom(path, max(1, finer), order=3, mode="nearest", grid_mode=True))
        windows = [_window(n) for n in path.shape]
        wave = np.exp(2j * np.pi / wavelength * path) * windows[0][:, None] * windows[1]
        power = np.square(np.abs(np.fft.fft2(wave)))
        f = np.hypot(
            *np.meshgrid(
                *(np.fft.fftfreq(n, p / finer) for n, p in zip(path.shape, self.grid.pitch, strict=True)),
                indexing="ij",
            )
        ).ravel()
        order = np.argsort(f)
        held = np.cumsum(power.ravel()[order])
        return wavelength * float(f[order][min(np.searchsorted(held, (1 - STRAY) * held[-1]), f.size - 1)])

    def _remembered(self, name: str, found: Callable[[], T]) -> T:
        if name not in self._kept:
            self._kept[name] = found()
        return self._kept[name]


def _window(count: int) -> np.ndarray:
    """Even but for its ends, which rise and fall over a sixth of it."""
    at = (np.arange(count) + 1) / (count + 1)
    return np.sin(np.pi / 2 * np.clip(6 * np.minimum(at, 1 - at), 0, 1)) ** 2
