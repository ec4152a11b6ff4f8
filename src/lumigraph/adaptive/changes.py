"""Changes of pixels by each bead's unknowns, where it lights them, and their Fisher information."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.operators.resampling import Part


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Derivatives of the pixels that one bead lights.

    Parameters
    ----------
    part
        Rows and columns of the raw image.
    by
        (unknowns, rows, columns): by the bead's place and light, then by each coefficient where it stands.
    at
        Place and coefficients of the bead.
    """

    part: Part
    by: np.ndarray
    at: np.ndarray

    def weighted(self, weights: np.ndarray) -> "Changes":
        """The same derivatives, multiplied by weights of all pixels (ny, nx)."""
        return replace(self, by=self.by * weights[self.part].astype(self.by.dtype))


def told(
    beads: Sequence[Changes], lights: np.ndarray, weights: np.ndarray, away: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Information Jᵀ diag(w) J and slope Jᵀ a of all beads' unknowns, one bead's after another's.

    Beads shine by their lights (beads,). Pixels (ny, nx) have weights w and derivatives a of the
    log-likelihood. Beads that light no pixel together have no information in common.
    """
    n = len(beads[0].by)
    whole = np.zeros((len(beads), n, len(beads), n))
    for p, one in enumerate(beads):
        weighted = one.weighted(weights)
        for q, other in enumerate(beads[: p + 1]):
            whole[p, :, q] = lights[p] * lights[q] * _product(weighted, other)
            whole[q, :, p] = whole[p, :, q].T
    slope = [
        light * np.tensordot(one.by, away[one.part], 2) for one, light in zip(beads, lights, strict=True)
    ]
    return whole.reshape(len(beads) * n, -1), np.concatenate(slope)


def scored(beads: Sequence[Changes], lights: np.ndarray, mixed: np.ndarray, away: np.ndarray) -> np.ndarray:
    """Scores (k, ny, nx): pixels' shares of the slopes along mixed unknowns (unknowns, k); see `told`."""
    found = np.zeros((mixed.shape[1], *away.shape), np.float32)
    for one, light, own in zip(beads, lights, np.split(mixed, len(beads)), strict=True):
        found[(slice(None), *one.part)] += np.tensordot(
            own.T.astype(one.by.dtype) * one.by.dtype.type(light), one.by, 1
        )
    return found * away.astype(np.float32)


def _product(one: Changes, other: Changes) -> np.ndarray:
    """Sums (unknowns, unknowns) over the pixels that both hold."""
    common = tuple(_common(a, b) for a, b in zip(one.part, other.part, strict=True))
    left, right = (_cut(changes, common) for changes in (one, other))
    return left @ right.T


def _common(one: slice, other: slice) -> slice:
    start = max(one.start, other.start)
    return slice(start, max(start, min(one.stop, other.stop)))


def _cut(changes: Changes, part: tuple[slice, ...]) -> np.ndarray:
    """Flat array (unknowns, pixels) of a part of its pixels."""
    own = (slice(p.start - a.start, p.stop - a.start) for p, a in zip(part, changes.part, strict=True))
    found = changes.by[(slice(None), *own)]
    return found.reshape(len(found), -1)
