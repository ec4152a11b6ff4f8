"""Scenes: what gives off light, where, and how far from the focused plane.

Depths dz [m] are counted from the focused plane: positive is farther from the camera.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.core.arrays import Array, is_complex, namespace, to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.short_repr import brief, table
from lumigraph.errors import GeometryError, LumigraphError


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """A flat picture across the axis: the intensity of an incoherent object, or a transparency's.

    Parameters
    ----------
    intensity
        (y, x) or (y, x, c), real and not negative; of any array library.
    grid
        Where its samples stand [m].
    dz
        Depth from the focused plane [m], positive farther from the camera.
    opacity
        (y, x), 0 to 1: the part of a sample's area that hides what is farther away; None hides nothing, and
        beside the grid nothing is hidden. What a slice gives off is its intensity alone, whatever it hides.

    Raises
    ------
    GeometryError
        A shape that differs from the grid's, or an opacity out of 0 to 1.
    LumigraphError
        Negative, complex, NaN or infinite intensities.

    Examples
    --------
    >>> picture = np.zeros((8, 8))
    >>> picture[5, 2:4] = 1
    >>> Slice(picture, Grid.square(8, 1.0)).trimmed().grid
    Grid(shape=(1, 2), pitch=(1.0, 1.0), center=(1.0, -1.0))
    """

    intensity: Array
    grid: Grid
    dz: float = 0.0
    opacity: np.ndarray | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.array("a slice", self.intensity)
        checks.instance("grid", self.grid, Grid)
        shape = tuple(self.intensity.shape)
        if len(shape) not in (2, 3) or shape[:2] != self.grid.shape:
            raise GeometryError(
                f"a slice has shape {shape} but must be (y, x) or (y, x, c) with (y, x) = {self.grid.shape} "
                "of its grid."
            )
        object.__setattr__(self, "dz", checks.finite("dz", self.dz))
        _check_intensity("a slice", self.intensity)
        if self.opacity is not None:
            object.__setattr__(self, "opacity", _opacity(self.opacity, self.grid))

    def _repr_html_(self) -> str:
        rows = [("samples", picture.sized(self.grid.shape)), *self._rows()]
        return picture.card("Slice", rows, picture.thumbnail(self.intensity))

    def _rows(self) -> list[tuple[str, str]]:
        size = " × ".join(map(picture.length, self.grid.size))
        return [("size", size), ("depth", picture.length(self.dz))]

    @property
    def amplitude(self) -> Array:
        """Square root of the intensity: the amplitude behind a transparency in even light."""
        return namespace(self.intensity).sqrt(self.intensity)

    @property
    def hides(self) -> bool:
        """True if some part of the slice is opaque."""
        return self.opacity is not None and bool(self.opacity.any())

    def trimmed(self) -> "Slice":
        """The slice cropped to the rows and columns that give light or hide; one sample where none does."""
        lit = to_numpy(self.intensity) > 0
        lit = np.any(lit, axis=2) if lit.ndim == 3 else lit
        lit = lit if self.opacity is None else lit | (self.opacity > 0)
        spans = []
        for axis in (0, 1):
            places = np.flatnonzero(np.any(lit, axis=1 - axis))
            middle = lit.shape[axis] // 2
            spans.append((int(places[0]), int(places[-1]) + 1) if len(places) else (middle, middle + 1))
        (top, bottom), (left, right) = spans
        shape = bottom - top, right - left
        center = self.grid.y[top + shape[0] // 2], self.grid.x[left + shape[1] // 2]
        grid = Grid(shape, self.grid.pitch, (float(center[0]), float(center[1])))
        covers = None if self.opacity is None else self.opacity[top:bottom, left:right]
        return replace(self, intensity=self.intensity[top:bottom, left:right], grid=grid, opacity=covers)

    def at(self, dz: float) -> "Slice":
        """The slice moved by `dz` [m] away from the camera."""
        return replace(self, dz=self.dz + checks.finite("dz", dz))

    def scaled(self, factor: float) -> "Slice":
        """The slice with its intensity multiplied by `factor`."""
        return replace(self, intensity=self.intensity * checks.finite("factor", factor, "1"))


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points that give off spherical waves and never interfere with each other.

    Parameters
    ----------
    positions
        (k, 3) as (y, x, dz) [m].
    intensities
        (k,), not negative.

    Raises
    ------
    GeometryError
        Shapes other than (k, 3) and (k,).
    LumigraphError
        Negative, NaN or infinite numbers.
    """

    positions: np.ndarray
    intensities: np.ndarray

    __repr__ = brief
    _repr_html_ = table

    def __post_init__(self) -> None:
        positions, intensities = (_floats(name, getattr(self, name)) for name in ("positions", "intensities"))
        if positions.ndim != 2 or positions.shape[1] != 3 or intensities.shape != positions.shape[:1]:
            raise GeometryError(
                f"positions have shape {positions.shape} and intensities {intensities.shape} but must be "
                "(k, 3) as (y, x, dz), and (k,)."
            )
        checks.finite_array("positions", positions)
        _check_intensity("points", intensities)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "intensities", intensities)

    def at(self, dz: float) -> "Points":
        """The points moved by `dz` [m] away from the camera."""
        return replace(self, positions=self.positions + np.array([0.0, 0.0, checks.finite("dz", dz)]))

    def scaled(self, factor: float) -> "Points":
        """The points with their intensities multiplied by `factor`."""
        return replace(self, intensities=self.intensities * checks.finite("factor", factor, "1"))


@dataclass(frozen=True, slots=True)
class Diffuser:
    """An evenly lit diffuser just before the main lens: its picture is the white image.

    Parameters
    ----------
    intensity
        Not negative.

    Raises
    ------
    LumigraphError
        A negative intensity, or one that is not finite.
    """

    intensity: float = 1.0

    def __post_init__(self) -> None:
        _check_intensity("a diffuser", np.array([checks.finite("intensity", self.intensity, "1")]))

    def at(self, dz: float) -> "Diffuser":
        """The diffuser itself: it stays at the lens."""
        return self

    def scaled(self, factor: float) -> "Diffuser":
        """The diffuser with its intensity multiplied by `factor`."""
        return Diffuser(self.intensity * checks.finite("factor", factor, "1"))


Part = Slice | Points | Diffuser

_LISTED = 6
"""Parts of a scene that a notebook shows."""


def _about(part: Part) -> str:
    if isinstance(part, Slice):
        return ", ".join(value for _, value in part._rows())
    if isinstance(part, Diffuser):
        return f"intensity {part.intensity:g}"
    depths = [picture.length(float(dz)) for dz in (part.positions[:, 2].min(), part.positions[:, 2].max())]
    return f"{len(part.positions)}, depths {' to '.join(depths)}" if len(part.positions) else "none"


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Parts that give off light together; ``+`` adds scenes. Slices with an opacity hide what is farther.

    Parameters
    ----------
    parts
        Slices, points and diffusers.

    Raises
    ------
    GeometryError
        Something else among the parts.

    Examples
    --------
    >>> near_and_far = Scene([Diffuser()]).scaled(0.5) + Scene([Points([(0, 0, 0)], [1])]).at(0.01)
    >>> len(near_and_far.parts), near_and_far.parts[1].positions.tolist()
    (2, [[0.0, 0.0, 0.01]])
    """

    parts: tuple[Part, ...]

    __repr__ = brief

    def __init__(self, parts: Iterable[Part] = ()) -> None:
        if not isinstance(parts, Iterable):
            raise GeometryError(f"parts are {parts!r} but must be a list of Slice, Points and Diffuser.")
        object.__setattr__(self, "parts", tuple(parts))
        for part in self.parts:
            if not isinstance(part, Part):
                raise GeometryError(
                    f"a scene has a part of type {type(part).__name__} but takes Slice, Points and Diffuser. "
                    "Add whole scenes with +."
                )

    def _repr_html_(self) -> str:
        rows = [(type(part).__name__.lower(), _about(part)) for part in self.parts[:_LISTED]]
        rest = len(self.parts) - _LISTED
        rows += [("", f"and {rest} more")] if rest > 0 else []
        flat = next((part for part in self.parts if isinstance(part, Slice)), None)
        shown = "" if flat is None else picture.thumbnail(flat.intensity)
        return picture.card("Scene", rows, shown, "Its first slice")

    def __add__(self, other: "Scene") -> "Scene":
        """Both scenes together."""
        if not isinstance(other, Scene):
            return NotImplemented
        return Scene(self.parts + other.parts)

    def at(self, dz: float) -> "Scene":
        """The scene moved by `dz` [m] away from the camera; diffusers stay at the lens."""
        return Scene(part.at(dz) for part in self.parts)

    def scaled(self, factor: float) -> "Scene":
        """The scene with all intensities multiplied by `factor`."""
        return Scene(part.scaled(factor) for part in self.parts)


def _opacity(opacity: Any, grid: Grid) -> np.ndarray:
    """The opacity (y, x) of a slice, float32; one number stands for all samples."""
    covers = np.asarray(to_numpy(opacity) if hasattr(opacity, "shape") else opacity)
    if covers.shape not in ((), grid.shape):
        raise GeometryError(
            f"opacity has shape {covers.shape} but must be (y, x) = {grid.shape} of the slice's grid, or a "
            "number."
        )
    checks.finite_array("opacity", covers, GeometryError)
    if covers.min() < 0 or covers.max() > 1:
        raise GeometryError(
            f"opacity lies between {covers.min():g} and {covers.max():g} but must be 0 (clear) to 1 (opaque)."
        )
    return np.broadcast_to(covers.astype(np.float32), grid.shape)


def _floats(name: str, values: Any) -> np.ndarray:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise GeometryError(f"{name} are {values!r} but must be numbers, one row for each point.") from None


def _check_intensity(what: str, intensity: Array) -> None:
    """Refuse intensities that light cannot have."""
    if is_complex(intensity):
        raise LumigraphError(f"the intensity of {what} is complex. Give the squared modulus.")
    checks.finite_array(f"the intensity of {what}", intensity)
    lowest = to_numpy(intensity).min(initial=0)
    if lowest < 0:
        raise LumigraphError(f"the intensity of {what} goes down to {lowest:g} but light is at least 0.")
