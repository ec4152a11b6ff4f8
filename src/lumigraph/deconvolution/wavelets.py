r"""Wavelets: objects have few coefficients that are not noise.

The noise of a Richardson-Lucy step grows as √o, that of √o is the same everywhere: coefficients of √o are
drawn towards 0 by one threshold, and o stays positive because it is a square. The picture is shifted before
each transform by another number of samples (cycle spinning), without which the blocks of the wavelets show.
Proximal map: docs/theory/deconvolution.md.

R. R. Coifman & D. L. Donoho, "Translation-invariant de-noising", Lecture Notes in Statistics 103, 125 (1995);
F. J. Anscombe, Biometrika 35, 246 (1948).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pywt

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import GeometryError

_SHIFTS = (0.7548776662, 0.5698402910, 0.4301597090)
"""Steps of a quasi-random sequence in up to three dimensions (Roberts' R2)."""

_THIN = 4
"""An axis of fewer samples has no scales."""


@dataclass(frozen=True, slots=True)
class Wavelets:
    """A prior for `RichardsonLucy`: keeps texture that total variation flattens.

    The transform runs in NumPy on the CPU, whatever the library of the arrays.

    Parameters
    ----------
    strength
        λ, without unit: threshold for a coefficient of √o, over the root of the mean intensity. 0.005 for
        bright images, 0.05 for dim ones.
    name
        Of an orthogonal wavelet that PyWavelets knows, such as "db2", "haar" or "sym4".
    levels
        Scales, each twice as coarse as the last; fewer along a short axis.

    Raises
    ------
    GeometryError
        A strength that is not above zero, levels that are no whole number, or an unknown wavelet.
    """

    strength: float = 0.01
    name: str = "db2"
    levels: int = 3

    def __post_init__(self) -> None:
        checks.positive("strength", self.strength, "1")
        checks.whole("levels", self.levels)
        known: Any = pywt  # whose names are compiled
        if self.name not in known.wavelist(kind="discrete") or not known.Wavelet(self.name).orthogonal:
            raise GeometryError(f"name is {self.name!r} but must be an orthogonal wavelet such as 'db2'.")

    def shrink(self, problem: Problem, before: Array, state: State) -> tuple[Array, dict[str, Array]]:
        """The step of Richardson-Lucy with its small coefficients drawn to 0."""
        roots = np.sqrt(arrays.to_numpy(before))
        threshold = self.strength * math.sqrt(problem.level)
        shrunk = self.denoised(roots, threshold, state.done)
        return arrays.like(np.square(np.maximum(shrunk, 0)), before), {}

    def denoised(self, values: np.ndarray, threshold: float, turn: int = 0) -> np.ndarray:
        """`values` with their details drawn towards 0 by `threshold`; `turn` shifts the transform."""
        wide, margins = self._widened(values)
        axes = tuple(axis for axis, n in enumerate(wide.shape) if self._levels(n))
        if not axes:
            return values
        levels = min(self._levels(wide.shape[axis]) for axis in axes)
        shift = tuple(int((turn * step) % 1 * 2**levels) for step in _SHIFTS[: len(axes)])
        tree = pywt.wavedecn(
            np.roll(wide, shift, axes), self.name, mode="periodization", level=levels, axes=axes
        )
        for details in tree[1:]:
            for key, found in details.items():
                details[key] = np.sign(found) * np.maximum(np.abs(found) - threshold, 0)
        back: Any = pywt.waverecn(tree, self.name, mode="periodization", axes=axes)
        back = np.roll(back, tuple(-k for k in shift), axes)
        return back[margins].astype(values.dtype, copy=False)

    def _levels(self, n: int) -> int:
        """Number of scales that fit into n samples, at most the given one."""
        return min(self.levels, pywt.dwt_max_level(n, self.name))

    def _widened(self, values: np.ndarray) -> tuple[np.ndarray, tuple[slice, ...]]:
        """Mirrored at the borders to a length that halves at each scale, and where the values stand."""
        block, pads = 2**self.levels, []
        for n in values.shape:
            thin = n < _THIN
            pads.append((0, 0) if thin else (block, block + (-n) % block))
        margins = tuple(slice(first, first + n) for n, (first, _) in zip(values.shape, pads, strict=True))
        return np.pad(values, pads, mode="symmetric"), margins
