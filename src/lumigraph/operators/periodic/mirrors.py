"""Mirrors and quarter turns that leave lenslets and a round main lens as they are.

Behind a round lens whose aberrations change over the field, light from mirrored fields is mirrored. So the
operator behind the lens of one field is that of all fields that mirror it, of a mirrored object and image.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear, Shape
from lumigraph.elements import ThinLens, noll_to_nm
from lumigraph.elements.field_plate import FieldPlate
from lumigraph.elements.train import Element
from lumigraph.operators.lenslets.cell_response import focal_lengths
from lumigraph.operators.sampling.border_classes import Turn
from lumigraph.operators.sampling.optics import Optics

SAME: Turn = (False, False, False)
"""Everything stays where it is."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Mirror(Linear):
    """A plane (y, x), mirrored across the diagonal and then up and down and left and right.

    Parameters
    ----------
    plane
        Its samples.
    turn
        Which of the three.
    """

    plane: Shape
    turn: Turn

    title: ClassVar[str] = "A mirrored plane"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the mirrored plane, and of the plane."""
        return (self.plane[::-1] if self.turn[0] else self.plane), self.plane

    def _forward(self, intensity: Array) -> Array:
        return self._flipped(intensity.T if self.turn[0] else intensity)

    def _adjoint(self, raw: Array) -> Array:
        flipped = self._flipped(raw)
        return flipped.T if self.turn[0] else flipped

    def _flipped(self, plane: Array) -> Array:
        axes = tuple(axis for axis in (0, 1) if self.turn[1 + axis])
        return arrays.namespace(plane).flip(plane, axis=axes) if axes else plane


def turns(optics: Optics) -> tuple[Turn, ...]:
    """Turns that leave the optics as they are, but for the main lens' action on a field; first is `SAME`."""
    cells = optics.cells
    middle = all(
        abs(2 * edge + size * n) < 1e-9 * size
        for edge, size, n in zip(cells.edge, cells.size, cells.count, strict=True)
    )
    if cells.staggered or not middle or len(focal_lengths(optics.array)) > 1:
        return (SAME,)
    if not all(map(_is_round, optics.camera.lens.elements)):
        return (SAME,)
    square = all(a == b for a, b in (cells.count, cells.points, cells.samples, cells.ring))
    square = square and abs(cells.size[0] - cells.size[1]) < 1e-9 * cells.size[0]
    sides = (False, True)
    return tuple((across, up, left) for across in sides[: 1 + square] for up in sides for left in sides)


def _is_round(element: Element) -> bool:
    """True if light from a mirrored field comes out of an element mirrored."""
    if isinstance(element, FieldPlate):
        return element.aberrations.y is None and all(noll_to_nm(j)[1] == 0 for j, _ in element.more)
    return isinstance(element, ThinLens)


def of_fields(turns: Sequence[Turn], rotation: float) -> np.ndarray:
    """Matrices (n, 2, 2) of fields (y, x) for turns of lenslets that stand at an angle [rad]."""
    sin, cos = math.sin(rotation), math.cos(rotation)
    straight = np.array([[cos, -sin], [sin, cos]])
    found = []
    for across, up, left in turns:
        flip = np.diag([-1.0 if up else 1.0, -1.0 if left else 1.0])
        found.append(straight.T @ (flip[:, ::-1] if across else flip) @ straight)
    return np.array(found)
