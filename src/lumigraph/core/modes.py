"""Partially coherent light on a plane, as coherent modes: fields that never interfere with one another."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from lumigraph.core import checks
from lumigraph.core.arrays import Array, namespace
from lumigraph.core.brief import brief, table
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError


@dataclass(frozen=True, slots=True, eq=False, init=False)
class CoherentModes:
    r"""Light whose mutual intensity is a sum over coherent modes.

    .. math:: J(r_1, r_2) = \langle U(r_1) U^*(r_2) \rangle = \sum_n u_n(r_1) \, u_n^*(r_2)

    Each mode goes through lenses and free space as a field of its own; on the way, and on a sensor, their
    intensities add.

    Parameters
    ----------
    fields
        A `Field` (modes, y, x), or several: one for each wavelength. A field (y, x) is one mode.
    error
        Largest error of J between any two samples, over the largest intensity; 0 where all modes are there.

    Raises
    ------
    GeometryError
        No field, data of another shape, or an error below 0.

    References
    ----------
    L. Mandel and E. Wolf, *Optical Coherence and Quantum Optics*, 1995, section 4.7.

    Examples
    --------
    >>> import numpy as np
    >>> two = CoherentModes(Field(np.ones((2, 4, 4)), Grid.square(4, 1.0), 500e-9))
    >>> two.count, float(two.power), two.through(lambda field: field * 0.5).intensity[0, 0].item()
    (2, 32.0, 0.5)
    """

    fields: tuple[Field, ...]
    error: float

    __repr__ = brief
    _repr_html_ = table

    def __init__(self, fields: Field | Iterable[Field], error: float = 0.0) -> None:
        listed = (fields,) if isinstance(fields, Field) else tuple(fields)
        if not listed:
            raise GeometryError("there are no fields. Give at least one Field (modes, y, x).")
        for field in listed:
            checks.instance("a field of the modes", field, Field)
        if checks.finite("error", error, "1") < 0:
            raise GeometryError(f"error is {error:g} but must be at least 0.")
        object.__setattr__(self, "fields", tuple(map(_stacked, listed)))
        object.__setattr__(self, "error", float(error))

    @property
    def count(self) -> int:
        """Number of modes, at all wavelengths together."""
        return sum(field.data.shape[0] for field in self.fields)

    @property
    def grid(self) -> Grid:
        """Grid that all modes share.

        Raises
        ------
        GeometryError
            Wavelengths stand on different grids.
        """
        first = self.fields[0].grid
        for field in self.fields:
            if field.grid != first:
                raise GeometryError(
                    f"modes of {field.wavelength * 1e9:.6g} nm stand on {field.grid}, those of "
                    f"{self.fields[0].wavelength * 1e9:.6g} nm on {first}. Propagate with grid=, so that all "
                    "wavelengths share one."
                )
        return first

    @property
    def wavelengths(self) -> tuple[float, ...]:
        """Wavelengths in vacuum [m]."""
        return tuple(field.wavelength for field in self.fields)

    @property
    def intensity(self) -> Array:
        """The modes' intensities (y, x), added."""
        assert self.grid
        sums = [namespace(f.data).sum(f.intensity, axis=0) for f in self.fields]
        return sum(sums[1:], start=sums[0])

    @property
    def power(self) -> Array:
        """Intensity integrated over the window [amplitude² m²]."""
        sums = [namespace(f.data).sum(f.power) for f in self.fields]
        return sum(sums[1:], start=sums[0])

    def through(self, element: Callable[[Field], Field]) -> "CoherentModes":
        """The light behind an element or a `Train`, such as ``Propagate(0.1)``: each mode goes by itself."""
        return CoherentModes([element(field) for field in self.fields], self.error)


def _stacked(field: Field) -> Field:
    """Field with one leading axis, the modes."""
    if field.data.ndim not in (2, 3):
        raise GeometryError(
            f"a field of the modes has shape {tuple(field.data.shape)} but must be (modes, y, x), or (y, x)."
        )
    return field if field.data.ndim == 3 else replace(field, data=field.data[None])
