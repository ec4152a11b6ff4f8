"""Pictures of one size in an order: planes of focus, pages of a file, frames of a film."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.core.arrays import A, to_numpy
from lumigraph.core.labelled import Labels
from lumigraph.core.noun import Noun
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError

_SHOWN, _SIDE = 4, 160
"""Pictures in a notebook's strip, and pixels across each."""


@dataclass(frozen=True, slots=True, eq=False)
class Stack(Noun[A]):
    """Pictures one after the other; indexing and iterating give the pictures as arrays.

    Parameters
    ----------
    data
        Pictures (n, y, x) or (n, y, x, c).
    positions
        One number for each picture: α' of a refocus stack, a depth, a time; empty where unknown.
    quantity
        Quantity of the positions: "alpha", "dz [m]", "lambda" (Lytro), "time [s]"; "page" where unknown.
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

    axes: ClassVar[str] = "nyx"

    data: A
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
            object.__setattr__(self, "pixel_pitch", checks.positive("pixel_pitch", self.pixel_pitch))
        if not isinstance(self.metadata, Mapping):
            raise GeometryError(f"metadata is {self.metadata!r} but must be a mapping of names to values.")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns (ny, nx) of every picture."""
        return int(self.data.shape[1]), int(self.data.shape[2])

    def __len__(self) -> int:
        return int(self.data.shape[0])

    def __getitem__(self, index: int) -> A:
        return self.data[range(len(self))[index], ...]

    def __iter__(self) -> Iterator[A]:
        return (self.data[k, ...] for k in range(len(self)))

    @property
    def titles(self) -> tuple[str, ...]:
        """Title of each picture, such as "alpha 0.95", "dz 20 mm" or "page 3"."""
        name, _, unit = self.quantity.removesuffix("]").partition(" [")
        if not self.positions:
            return tuple(f"{name} {k}" for k in range(len(self)))
        if unit == "m":
            return tuple(f"{name} {picture.length(position)}" for position in self.positions)
        return tuple(f"{name} {position:.5g} {unit}".rstrip() for position in self.positions)

    def _repr_html_(self) -> str:
        titles = self.titles
        ends = titles[0] if len(self) == 1 else f"{titles[0]} to {titles[-1]}"
        rows = [
            ("pictures", f"{len(self)}, {ends}"), ("size", f"{picture.sized(self.shape)} px"),
            ("numbers", picture.numbers(self.data)), ("pixel pitch", picture.length(self.pixel_pitch)),
        ]  # fmt: skip
        some = np.unique(np.linspace(0, len(self) - 1, min(len(self), _SHOWN)).round().astype(int))
        strip = np.concatenate([to_numpy(self[int(k)]) for k in some], axis=1)
        return picture.card("Stack", rows, picture.thumbnail(strip, _SHOWN * _SIDE), "Some of its pictures")

    def _labels(self) -> Labels:
        unit = self.quantity.removesuffix("]").partition(" [")[2]
        labels = Labels("nyx", "pixel value", units={"n": unit, "y": "px", "x": "px"})
        labels.along["n"] = np.asarray(self.positions or range(len(self)), np.float64)
        for axis, count in zip("yx", self.shape, strict=True):
            labels.along[axis] = np.arange(count) * (self.pixel_pitch or 1.0)
        about = {"quantity": self.quantity, "pixel_pitch": self.pixel_pitch, "bit_depth": self.bit_depth}
        labels.attributes = {**about, "positioned": bool(self.positions), "metadata": dict(self.metadata)}
        if self.pixel_pitch:
            labels.units.update(y="m", x="m")
        return labels

    @classmethod
    def _of_labels(cls, labels: Labels) -> Self:
        about = labels.attributes
        positions = tuple(labels.coordinate("n").tolist()) if np.any(about.get("positioned")) else ()
        known = about.get("pixel_pitch"), about.get("bit_depth"), about.get("metadata", {})
        return cls(labels.data, positions, about.get("quantity", "page"), *known)
