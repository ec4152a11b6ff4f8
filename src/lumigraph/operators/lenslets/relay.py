"""Light that is known in the lenslet plane, through the lenslets to the image: cell by cell, nothing is kept.

For what has no use for the matrices of all points of a cell: single points wherever they are, planes of
coherent light, the pupil's own light. As in `cell_response`, each lenslet is a quadrature with exact borders,
and exactly those lenslets count that exist.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Protocol, cast

import numpy as np

from lumigraph.operators.lenslets.models import lenslets_of
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.optics import Optics

_KEPT = 8
"""Relays at a time, of those that are sampled alike; more might fill the memory."""


class Relay(Protocol):
    """Map from amplitudes in the lenslet plane to those on the image, for any block of its cells."""

    optics: Optics

    def places(self, rows: range, columns: range) -> tuple[np.ndarray, np.ndarray]:
        """Places along y and along x where amplitudes are needed [m], without the phase exp(iπw²/(λL))."""
        ...

    def field(self, light: np.ndarray, rows: range, columns: range) -> np.ndarray:
        """Amplitude (y, x) on the samples of the cells, of light (y, x) at those places."""
        ...


def relay(optics: Optics) -> Relay:
    """Relay by a camera's lenslets, in the frame that turns with them."""
    return lenslets_of(optics)


@dataclass(slots=True)
class RelaySet:
    """Relays of depths and accuracies, computed once; those of like cells and windows share their matrices.

    Parameters
    ----------
    blurred
        Distance of the plane whose points are blurred most [m]: all are sampled as it asks for. None where
        each is sampled as it asks for itself.
    """

    blurred: float | None = None
    _known: dict[tuple[float, float], Relay] = field(default_factory=dict)

    def of(self, camera: CameraOptics, dz: float, accuracy: float) -> Relay:
        """Relay of one camera's plane at a depth [m]."""
        if (key := (dz, accuracy)) not in self._known:
            optics = Optics.of(camera, camera.object_distance + dz, accuracy, self.blurred)
            if len(self._known) >= _KEPT and self.blurred is not None:
                self._known.pop(next(iter(self._known)))
            alike = next((one for one in self._known.values() if _alike(one.optics, optics)), None)
            self._known[key] = relay(optics) if alike is None else replace(cast(Any, alike), optics=optics)
        return self._known[key]


def _alike(one: Optics, other: Optics) -> bool:
    same = one.cells == other.cells and one.axes == other.axes
    return same and one.fineness == other.fineness and (one.straight or one.beside == other.beside)
