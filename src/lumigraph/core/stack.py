"""Pictures of one size in an order: planes of focus, pages of a file, frames of a film."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array
from lumigraph.core.brief import brief
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """Pictures one after the other; indexing and iterating give the pictures as arrays.

    Parameters
    ----------
    data
        Pictures (n, y, x) or (n, y, x, c).
    positions
        One number for each picture: α' of a refocus stack, a depth, a time; empty where unknown.
    quantity
        What the positions are: "alpha", "dz [m]", "lambda" (Lytro), "time [s]"; "page" where unknown.
    pixel_pitch
        Distance between pixels [m]; None where unknown.
    bit_depth
        Significant bits of whole numbers; None for floats.
    metadata
        Whatever else is known, by name.

    Raises
    ------
    GeometryError
        The data is not (n, y, x) or (n, y, x, c), or has another number of positions.

    Examples
    --------
    >>> stack = Stack(np.zeros((3, 4, 5)), (0.9, 1.0, 1.1), "alpha")
    >>> len(stack), stack[0].shape
    (3, (4, 5))
    """

    data: Array
    positions: tuple[float, ...] = ()
    quantity: str = "page"
    pixel_pitch: float | None = None
    bit_depth: int | None = None
    metadata: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.array("a stack", self.data)
        shape = tuple(self.data.shape)
        if len(shape) not in (3, 4) or min(shape) < 1:
            raise GeometryError(f"a stack has shape (n, y, x) or (n, y, x, c), not {shape}.")
        positions = tuple(checks.finite("positions", p, "1") for p in np.ravel(self.positions).tolist())
        object.__setattr__(self, "positions", positions)
        if positions and len(positions) != shape[0]:
            raise GeometryError(
                f"{len(positions)} positions are given for {shape[0]} pictures. Give one each."
            )
        if not isinstance(self.quantity, str):
            raise GeometryError(f"quantity is {self.quantity!r} but must be text, such as 'alpha'.")
        if self.pixel_pitch is not None:
            checks.positive("pixel_pitch", self.pixel_pitch)
        if not isinstance(self.metadata, Mapping):
            raise GeometryError(f"metadata is {self.metadata!r} but must be a mapping of names to values.")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns (ny, nx) of every picture."""
        return int(self.data.shape[1]), int(self.data.shape[2])

    def __len__(self) -> int:
        return int(self.data.shape[0])

    def __getitem__(self, index: int) -> Array:
        return self.data[range(len(self))[index], ...]

    def __iter__(self) -> Iterator[Array]:
        return (self.data[k, ...] for k in range(len(self)))
