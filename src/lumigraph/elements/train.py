"""Elements one after the other."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from lumigraph.core.field import Field
from lumigraph.errors import GeometryError


@runtime_checkable
class Element(Protocol):
    """Anything that turns a field into a field: a lens, a stop, a propagation, a train, any function."""

    def __call__(self, field: Field, /) -> Field:
        """The field behind the element."""
        ...


@dataclass(frozen=True, slots=True)
class Train:
    """Elements one after the other, itself an element; trains within it are unpacked.

    Parameters
    ----------
    elements
        In the order in which light meets them.

    Raises
    ------
    GeometryError
        Something in it is not an element.

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.grid import Grid
    >>> wave = Field(np.ones((4, 4)), Grid.square(4, 1.0), 633e-9)
    >>> half = lambda field: field * 0.5
    >>> [float(plane.power) for plane in Train([half, Train([half])]).planes(wave)]
    [16.0, 4.0, 1.0]
    """

    elements: tuple[Element, ...]

    def __init__(self, elements: Iterable[Element] = ()) -> None:
        object.__setattr__(self, "elements", tuple(_flat(elements)))

    def __call__(self, field: Field) -> Field:
        """The field behind the last element."""
        for element in self.elements:
            field = element(field)
        return field

    def planes(self, field: Field) -> Iterator[Field]:
        """The field before the train, then behind each element."""
        yield field
        for element in self.elements:
            field = element(field)
            yield field


def _flat(elements: Iterable[Element]) -> Iterator[Element]:
    if not isinstance(elements, Iterable):
        raise GeometryError(f"a train is {elements!r} but must be a list of elements.")
    for number, element in enumerate(elements):
        if isinstance(element, Train):
            yield from element.elements
        elif callable(element):
            yield element
        else:
            raise GeometryError(
                f"element {number} of a train is {element!r}, which is not callable. "
                "Give elements such as ThinLens(...), or functions from Field to Field."
            )
