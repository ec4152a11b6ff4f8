r"""Low-pass filters of a step's factor, against the lattice's artefacts.

Near the plane in focus every point behind a lenslet sends the same light into it: finer structure is not in
the raw image, and Richardson-Lucy fills it with squares of the lenslets' size. A low-pass of every step's
factor, as wide as the lenslets sample that depth, keeps what was measured. A filter of the estimate itself
would leave the data badly explained, and planes without a filter would take up the light of those with one.

A. Stefanoiu et al., "Artifact-free deconvolution in light field microscopy", Opt. Express 27, 31644 (2019).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.core.banded import Banded, banded
from lumigraph.core.cache import remembered
from lumigraph.errors import GeometryError

LOBES = 4
"""Half width of the Lanczos window [widths]."""


@dataclass(frozen=True, slots=True)
class LowPass:
    r"""A filter for `RichardsonLucy`: removes frequencies above 1/(2 width) from each plane.

    The kernel is Lanczos': sinc(x/w) sinc(x/(4 w)) along y and along x, normalised at the borders too, so
    that an even object stays.

    Parameters
    ----------
    widths
        Distance w at which each plane (z,), or the one plane, is sampled [samples]; up to 1 leaves it as it
        is. In metres over the object's pitch.

    Raises
    ------
    GeometryError
        Widths that are negative or not finite, or not one for each plane.
    """

    widths: float | Sequence[float]

    def __post_init__(self) -> None:
        given = self.widths
        several = given if isinstance(given, Sequence | np.ndarray) else (given,)
        widths = tuple(checks.finite("widths", float(w), "samples") for w in several)
        if not widths or min(widths) < 0:
            raise GeometryError(f"widths are {widths} but must be at least 0 samples, one for each plane.")
        object.__setattr__(self, "widths", widths)

    def __call__(self, estimate: Array) -> Array:
        """The estimate (y, x) or (z, y, x), each plane filtered."""
        xp, widths = arrays.namespace(estimate), cast("tuple[float, ...]", self.widths)
        flat = len(estimate.shape) == 2
        planes = [estimate] if flat else [estimate[k, ...] for k in range(estimate.shape[0])]
        if len(widths) == 1:
            widths *= len(planes)
        if len(widths) != len(planes):
            raise GeometryError(
                f"there are {len(widths)} widths for {len(planes)} planes. Give one for each."
            )
        found = [_filtered(plane, width) for plane, width in zip(planes, widths, strict=True)]
        return found[0] if flat else xp.stack(found)


def _filtered(plane: Array, width: float) -> Array:
    if width <= 1:
        return plane
    rows, columns = (lanczos(n, width) for n in plane.shape)
    return columns.right(rows.down(plane))


@remembered
def lanczos(n: int, width: float) -> Banded:
    """Matrix (n, n) of the filter along one axis; its rows sum to 1. Never write into it."""
    places = np.arange(float(n))

    def kernel(off: np.ndarray) -> np.ndarray:
        return np.sinc(off / width) * np.sinc(off / (LOBES * width))

    whole = banded(places, places, kernel, LOBES * width)
    return Banded(n, tuple((first, m / m.sum(1, keepdims=True)) for first, m in whole.blocks))


def widths_of(distances: Sequence[float], pitch: float) -> tuple[float, ...]:
    """Widths for `LowPass` from the distances [m] at which the lenslets sample each plane, and its pitch [m].

    >>> [round(width, 6) for width in widths_of([6e-6, 3e-6, 0.0], 1.5e-6)]
    [4.0, 2.0, 0.0]
    """
    pitch = checks.positive("pitch", pitch)
    if not all(math.isfinite(d) and d >= 0 for d in distances):
        raise GeometryError(f"distances are {tuple(distances)} m but must be at least 0 m.")
    return tuple(float(d) / pitch for d in distances)
