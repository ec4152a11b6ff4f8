"""The lenslet-periodic operator's matrices: in memory, on disk, or built.

The block between two cells, (points, samples), is ``left @ right`` with as many columns in between as the
light there has patterns: over a hundred in front of a lenslet, one or two far from it. `blocks` finds them.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lumigraph import store
from lumigraph.core import memory
from lumigraph.core.cache import ByteCache
from lumigraph.core.progress import Progress
from lumigraph.errors import SamplingError
from lumigraph.operators.blocks import Part, build, build_bytes
from lumigraph.operators.glare import Glare, glare
from lumigraph.operators.optics import Optics
from lumigraph.operators.streamed import Streamed, stream_bytes, streamed


@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """From the points of an object's cells to the samples of an image's.

    Parameters
    ----------
    parts
        The periodic one, then those at the array's border.
    glare
        The rest: faint, and far from the diagonal.
    margin
        Cells (y, x) beyond the rings around the array whose points reach into them.
    """

    parts: tuple[Part, ...]
    glare: Glare
    margin: tuple[int, int]

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        parts = sum(part.factor.nbytes + part.right.nbytes for part in self.parts)
        return parts + self.glare.spectra.nbytes + self.glare.pictures.nbytes


_MATRICES = ByteCache()

HELD = 2.0**32
"""Matrices that take more than this to build [bytes] are computed whenever they are applied."""


def matrix(optics: Optics, progress: Progress | None = None, folder: Path | None = None) -> Matrix | Streamed:
    """Of one depth: from memory, from disk, or built; streamed where building takes more than `HELD`.

    Parameters
    ----------
    optics
        What it depends on.
    progress
        Of building it.
    folder
        Keeps it; None for the user's cache folder (`store`).

    Raises
    ------
    SamplingError
        It does not fit in memory.
    """
    if not _held(optics):
        _require(optics)
        return streamed(optics, progress)

    def built() -> dict[str, np.ndarray]:
        return _build(optics, progress)

    # Packed and unpacked, built or found: products with other strides would round otherwise.
    key = optics.key
    return _MATRICES.get((key, folder), lambda: _unpacked(store.kept(key, built, folder)))


def _held(optics: Optics) -> bool:
    limit = HELD if optics.straight else math.inf  # what cannot be streamed is held where it fits at all
    return build_bytes(optics) <= min(limit, memory.available() or math.inf)


def _streams(optics: Optics) -> bool:
    """Whether blocks are computed fast enough to be let go: those of lenslets whose axes are apart."""
    return optics.straight and stream_bytes(optics) <= (memory.available() or math.inf)


def _require(optics: Optics) -> None:
    """Refuse what can neither be held nor streamed, and name the finest accuracy that can."""
    if _streams(optics):
        return
    coarser = (a for a in (1e-4, 1e-3, 1e-2) if a > optics.fineness.accuracy)
    others = (Optics.of(optics.camera, optics.distance, a) for a in coarser)
    fits = next((o.fineness.accuracy for o in others if _held(o) or _streams(o)), None)
    remedy = "Use slower lenslets" if fits is None else f"An accuracy of {fits:g} fits: ask for that"
    needed = stream_bytes(optics) if optics.straight else build_bytes(optics)
    memory.require(needed, "the periodic operator", f"{remedy}, or use Snapshots.", SamplingError)


def _build(optics: Optics, progress: Progress | None = None) -> dict[str, np.ndarray]:
    """The matrix as a few arrays: the factors of all parts side by side."""
    found, per = build(optics, progress), optics.cells
    rest = glare(found.means, per.size, per.image)
    left = np.empty((found.ranks, math.prod(per.points)), np.float32)
    right = np.empty((found.ranks, math.prod(per.samples)), np.float32)
    places, offsets, start = [], [], 0
    for part in found.parts:
        places.append((*part.rows, *part.columns, len(part.offsets)))
        offsets += part.offsets
        mine = slice(start, start + len(part.right))
        left[mine], right[mine], start = part.factor.T, part.right, mine.stop
    return {
        "places": np.array(places),
        "offsets": np.array(offsets),
        "left": left.T,
        "right": right,
        "spectra": rest.spectra,
        "pictures": rest.pictures,
        "shape": np.array([*rest.image, *rest.margin, *optics.reach]),
    }


def _unpacked(arrays: dict[str, np.ndarray]) -> Matrix:
    """The matrix of what `_build` returns."""
    parts, first, column = [], 0, 0
    for top, bottom, left, right, count in arrays["places"].tolist():
        offsets = [(int(dy), int(dx), int(rank)) for dy, dx, rank in arrays["offsets"][first : first + count]]
        ranks = slice(column, column + sum(rank for _, _, rank in offsets))
        parts.append(
            Part(
                (top, bottom), (left, right), tuple(offsets), arrays["left"][:, ranks], arrays["right"][ranks]
            )
        )
        first, column = first + count, ranks.stop
    rows, columns, *margins = arrays["shape"].tolist()
    glare = Glare(arrays["spectra"], arrays["pictures"], (rows, columns), (margins[0], margins[1]))
    return Matrix(tuple(parts), glare, (margins[2], margins[3]))
