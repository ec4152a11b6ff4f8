"""The lenslet-periodic operator's matrices: in memory, on disk, or built.

The block between two cells, (points, samples), is ``left @ right`` with as many columns in between as the
light there has patterns: over a hundred in front of a lenslet, one or two far from it. `blocks` finds them.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lumigraph import store
from lumigraph.core import memory
from lumigraph.core.cache import ByteCache
from lumigraph.core.progress import Progress
from lumigraph.core.threads import each
from lumigraph.errors import SamplingError
from lumigraph.operators.periodic.blocks import MatrixPart, build
from lumigraph.operators.periodic.glare import Glare, aside, glare
from lumigraph.operators.periodic.sizes import build_bytes, build_operations, stream_operations
from lumigraph.operators.periodic.streamed import StreamedMatrix, stream_bytes, streamed
from lumigraph.operators.periodic.white import endless
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.time_limits import A_MINUTE, LONGEST, said


@dataclass(frozen=True, slots=True, eq=False)
class KernelMatrix:
    """Matrix from the points of an object's cells to the samples of an image's.

    Parameters
    ----------
    parts
        The periodic one, then those at the array's border.
    glare
        The rest, faint and far from the diagonal: what the main lens sends there, and the lenslets.
    margin
        Cells (y, x) beyond the rings around the array whose points reach into them.
    """

    parts: tuple[MatrixPart, ...]
    glare: tuple[Glare, Glare]
    margin: tuple[int, int]

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        shared = {part.right.ctypes.data: part.factor.nbytes + part.right.nbytes for part in self.parts}
        return sum(shared.values()) + sum(g.spectra.nbytes + g.pictures.nbytes for g in self.glare)


_MATRICES = ByteCache()

HELD = 2.0**32
"""Matrices that take more than this to build [bytes] are computed whenever they are applied."""
"""Operations in a minute of that processor."""


def matrix(
    optics: Optics, progress: Progress | None = None, folder: Path | None = None
) -> KernelMatrix | StreamedMatrix:
    """Matrix of one depth: from memory, from disk, or built; streamed if building takes more than `HELD`.

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
        It does not fit in memory, or takes more than `LONGEST`.

    Warns
    -----
    SamplingWarning
        It takes more than a minute, each time that it is computed.
    """
    if not _held(optics):
        _require(optics)
        said(operations(optics), "each image through the periodic operator, too large to keep, takes")
        return streamed(optics, progress)

    def built() -> dict[str, np.ndarray]:
        _require(optics)
        said(operations(optics), "the periodic operator takes once")
        return _build(optics, progress)

    # Packed and unpacked, built or found: products with other strides would round otherwise.
    key = optics.key
    return _MATRICES.get((key, folder), lambda: _unpacked(store.kept(key, built, folder), optics))


def operations(optics: Optics) -> float:
    """Multiply-adds of building it or, where it is streamed, of each image."""
    return build_operations(optics) if _held(optics) or not optics.straight else stream_operations(optics)


def _held(optics: Optics) -> bool:
    """True if it is kept. Independent of the free memory: streamed images differ by rounding.

    What cannot be streamed is held where it fits at all.
    """
    if build_operations(optics) > LONGEST:
        return False
    return not optics.straight or build_bytes(optics) <= HELD


def _needed(optics: Optics) -> float:
    """Memory that it takes, kept or streamed [bytes]."""
    return build_bytes(optics) if _held(optics) or not optics.straight else stream_bytes(optics)


def _can(optics: Optics) -> bool:
    """True if it fits in memory and is fast enough; only lenslets whose axes are apart are streamed."""
    fast = _held(optics) or (optics.straight and stream_operations(optics) <= LONGEST)
    return fast and _needed(optics) <= (memory.available() or math.inf)


def _require(optics: Optics) -> None:
    """Refuse what can neither be held nor streamed, and name the finest accuracy that can."""
    if _can(optics):
        return
    coarser = (a for a in (1e-4, 1e-3, 1e-2) if a > optics.fineness.accuracy)
    others = (Optics.of(optics.camera, optics.distance, a, optics.blurred).bricks for a in coarser)
    fits = next(filter(_can, others), None)
    remedy = "Use slower lenslets" if fits is None else f"{_price(fits)}: ask for that"
    if (needed := operations(optics)) > LONGEST:
        what = "for each image" if optics.straight else "to build"
        raise SamplingError(
            f"the periodic operator takes {needed:.0e} operations {what}, {needed / A_MINUTE:.0f} "
            f"min of a processor that does 1e11 a second; {LONGEST:.0e} are allowed. "
            f"{remedy}, or use Snapshots."
        )
    memory.require(_needed(optics), "the periodic operator", f"{remedy}, or use Snapshots.", SamplingError)


def _price(fits: Optics) -> str:
    """Cost of the finest operator that fits, in words."""
    needed = _needed(fits)
    minutes, each = operations(fits) / A_MINUTE, "" if _held(fits) else " for each image"
    time = f", some {minutes:.2g} min of a processor{each}" if minutes > 1 else ""
    return f"An accuracy of {fits.fineness.accuracy:g} fits ({needed / 2**30:.2g} GiB{time})"


def _build(optics: Optics, progress: Progress | None = None) -> dict[str, np.ndarray]:
    """The matrix as a few arrays: the factors of all parts side by side."""
    found, per = build(optics, progress), optics.cells
    even, sent = endless(optics)
    rest = glare(found.means, per, even - sent)
    left = np.empty((found.ranks, math.prod(per.points)), np.float32)
    right = np.empty((found.ranks, math.prod(per.samples)), optics.precision)
    places, offsets = [], []

    def put(job: tuple[slice, MatrixPart]) -> None:
        mine, part = job
        left[mine], right[mine] = part.factor.T, part.right

    def pieces() -> Iterator[tuple[slice, MatrixPart]]:
        mine, last = slice(0, 0), None
        for part in found.parts:
            if part.right is not last:
                mine, last = slice(mine.stop, mine.stop + len(part.right)), part.right
                yield mine, part
            ranges = [n for r in (part.rows, part.columns) for n in (r.start, r.stop, r.step)]
            places.append([*ranges, len(part.offsets), mine.start])
            offsets.extend(part.offsets)

    for _ in each(put, pieces()):
        pass
    return {
        "places": np.array(places),
        "offsets": np.array(offsets),
        "left": left.T,
        "right": right,
        "spectra": rest.spectra,
        "pictures": rest.pictures,
        "aside": np.array([sent, optics.axes[0].neighbourhood]),
    }


def _unpacked(arrays: dict[str, np.ndarray], optics: Optics) -> KernelMatrix:
    """The matrix of what `_build` returns."""
    parts, first, margin = [], 0, optics.margin(optics.reach)
    for *ranges, count, column in arrays["places"].tolist():
        offsets = [(int(dy), int(dx), int(rank)) for dy, dx, rank in arrays["offsets"][first : first + count]]
        ranks = slice(column, column + sum(rank for _, _, rank in offsets))
        left, right = arrays["left"][:, ranks], arrays["right"][ranks]
        parts.append(MatrixPart(range(*ranges[:3]), range(*ranges[3:]), tuple(offsets), left, right))
        first += count
    rest = Glare(arrays["spectra"], arrays["pictures"], optics.cells, margin)
    return KernelMatrix(tuple(parts), (rest, aside(optics.cells, margin, *arrays["aside"].tolist())), margin)
