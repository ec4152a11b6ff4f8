"""Linear maps between arrays of fixed shapes, and their transposes: what every operator is."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lumigraph.core import arrays, checks, picture
from lumigraph.core.arrays import Array
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError

Shape = tuple[int, ...]

GIVEN = "an object", "a raw image"
"""Names in errors of what `forward` and `adjoint` take."""


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class Linear(ABC):
    """A linear map A from an object to a raw image, and its transpose.

    `forward` and `adjoint` return the array library, precision and device of what they are given, write
    nothing into it, and satisfy ⟨A x, y⟩ = ⟨x, Aᵀ y⟩. They refuse other shapes, complex numbers and NaN;
    integers and truth values become float32. Maps are combined: ``a @ b`` is a after b, ``a + b`` and
    ``0.5 * a`` are sums, and `stack` makes those of several planes one.

    A child has `shape`, and `_forward` and `_adjoint`, which need not check what they are given.

    Parameters
    ----------
    object_grid
        Samples of the object, of every plane of it; None where it is not known.
    depths
        Depths of an object's planes from the focused one (z,) [m]; None for one plane (y, x).
    resolved_pitch
        Pitch of samples that hold all of the focused plane in a raw image [m]: half the shortest period
        that the instrument resolves; None where it is not known.
    """

    object_grid: Grid | None = None
    depths: tuple[float, ...] | None = None
    resolved_pitch: float | None = None

    title: ClassVar[str] = "Linear map"

    @property
    @abstractmethod
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of what `forward` returns (the raw image) and of what it takes (the object)."""

    @abstractmethod
    def _forward(self, intensity: Array) -> Array: ...

    @abstractmethod
    def _adjoint(self, raw: Array) -> Array: ...

    def forward(self, intensity: Array, /) -> Array:
        """Raw image (ny, nx) of an object's intensity (y, x) or (z, y, x).

        Raises
        ------
        GeometryError
            Another shape than the object's, complex numbers, NaN or infinite values.
        """
        return self._forward(_accepted(GIVEN[0], intensity, self.shape[1]))

    def adjoint(self, raw: Array, /) -> Array:
        """Transpose of `forward`: (y, x) or (z, y, x) from a raw image (ny, nx).

        Raises
        ------
        GeometryError
            Another shape than the raw image's, complex numbers, NaN or infinite values.
        """
        return self._adjoint(_accepted(GIVEN[1], raw, self.shape[0]))

    @property
    def side_by_side(self) -> int:
        """Objects, or raw images, that are mapped together in less time than one after the other."""
        return 1

    def _forwards(self, intensities: Sequence[Array]) -> list[Array]:
        """`_forward` of at most `side_by_side` objects; which others there are does not change a bit."""
        return [self._forward(one) for one in intensities]

    def _adjoints(self, raws: Sequence[Array]) -> list[Array]:
        return [self._adjoint(one) for one in raws]

    def psf(self, index: tuple[int, ...], /) -> np.ndarray:
        """Raw image (ny, nx), float32 of NumPy, of one object sample of intensity 1.

        Raises
        ------
        GeometryError
            The object has no such sample.
        """
        point = np.zeros(self.shape[1], np.float32)
        try:
            if len(index) != len(point.shape):
                raise IndexError
            point[tuple(index)] = 1
        except (IndexError, TypeError):
            raise GeometryError(f"index is {index} but the object has shape {self.shape[1]}.") from None
        return self._of_point(point)

    def _of_point(self, point: np.ndarray) -> np.ndarray:
        return self._forward(point)

    @property
    def memory_bytes(self) -> float:
        """Memory that `forward` and `adjoint` of single-precision arrays take, with the matrices [bytes]."""
        return 4.0 * sum(math.prod(shape) for shape in self.shape)

    @property
    def error(self) -> float:
        """Estimated relative rms error of a raw image; 0 for what is exact but for rounding."""
        return 0.0

    def to_scipy(self, dtype: Any = np.float32) -> Any:
        """The map as `scipy.sparse.linalg.LinearOperator`, of objects and raw images as vectors (C order).

        Parameters
        ----------
        dtype
            Precision that vectors are cast to.

        Examples
        --------
        >>> import lumigraph as lg
        >>> camera = lg.load_camera("thesis-2f").replace(sensor={"shape": (32, 32)})
        >>> camera.operator().to_scipy().shape[0]
        1024
        """
        from lumigraph.core.other_libraries import to_scipy

        return to_scipy(self, dtype)

    def to_pylops(self, dtype: Any = np.float32) -> Any:
        """The map as `pylops.LinearOperator`, of vectors or of arrays of its `dims` and `dimsd`.

        Raises
        ------
        LumigraphError
            PyLops is not installed.
        """
        from lumigraph.core.other_libraries import to_pylops

        return to_pylops(self, dtype)

    @property
    def T(self) -> "Linear":
        """The transpose, as a map of its own."""
        return Transposed(self)

    def __matmul__(self, other: "Linear") -> "Linear":
        return Chain((other, self), object_grid=other.object_grid, depths=other.depths)

    def __add__(self, other: "Linear") -> "Linear":
        return Sum((self, other), (1.0, 1.0), object_grid=self.object_grid, depths=self.depths)

    def __rmul__(self, weight: float) -> "Linear":
        return Sum((self,), (weight,), object_grid=self.object_grid, depths=self.depths)

    def __repr__(self) -> str:
        (raw, given), grid = self.shape, self.object_grid
        pitch = "" if grid is None else f", {' x '.join(map(picture.length, grid.pitch))} apart"
        return (
            f"<{type(self).__name__}: {self.title}\n"
            f"  {picture.sized(raw)} pixels of {picture.sized(given)} samples{pitch}{self._depths_told}\n"
            f"  {self.memory_bytes / 1e6:.4g} MB, estimated error {self.error:.2g}>"
        )

    @property
    def _depths_told(self) -> str:
        if self.depths is None or not len(self.depths):
            return ""
        return f", depths {picture.length(self.depths[0])} to {picture.length(self.depths[-1])}"

    def _repr_html_(self) -> str:
        return picture.operator_card(self.title, self.shape, round(self.memory_bytes))


def _accepted(name: str, array: Array, shape: Shape) -> Array:
    """The array as real floating-point numbers of the shape that a map takes, or an error."""
    checks.array(name, array)
    if tuple(array.shape) != tuple(shape):
        raise GeometryError(f"{name} has shape {tuple(array.shape)} but the operator takes {tuple(shape)}.")
    xp = arrays.namespace(array)
    if arrays.is_complex(array):
        raise GeometryError(f"{name} is complex but an operator takes intensities. Use abs(...)**2 or .real.")
    if not xp.isdtype(array.dtype, "real floating"):
        array = xp.astype(array, xp.float32)
    if not all(bool(xp.isfinite(extreme)) for extreme in (xp.min(array), xp.max(array))):
        checks.finite_array(name, array, GeometryError)
    return array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Transposed(Linear):
    """The transpose of a linear map."""

    of: Linear

    title: ClassVar[str] = "Transpose of a map"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the map, exchanged."""
        return self.of.shape[1], self.of.shape[0]

    def _forward(self, intensity: Array) -> Array:
        return self.of._adjoint(intensity)

    def _adjoint(self, raw: Array) -> Array:
        return self.of._forward(raw)

    @property
    def memory_bytes(self) -> float:
        """Memory of the map [bytes]."""
        return self.of.memory_bytes


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Chain(Linear):
    """Linear maps one after the other, the first one first.

    Raises
    ------
    GeometryError
        A map does not take what the one before it gives.
    """

    maps: tuple[Linear, ...]

    title: ClassVar[str] = "Maps one after the other"

    def __post_init__(self) -> None:
        for before, after in zip(self.maps, self.maps[1:], strict=False):
            if before.shape[0] != after.shape[1]:
                raise GeometryError(
                    f"a map gives shape {before.shape[0]} but the one after it takes {after.shape[1]}."
                )

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the last map's output and of the first map's input."""
        return self.maps[-1].shape[0], self.maps[0].shape[1]

    def _forward(self, intensity: Array) -> Array:
        for part in self.maps:
            intensity = part._forward(intensity)
        return intensity

    def _adjoint(self, raw: Array) -> Array:
        for part in reversed(self.maps):
            raw = part._adjoint(raw)
        return raw

    @property
    def memory_bytes(self) -> float:
        """Memory of all maps together [bytes]."""
        return sum(part.memory_bytes for part in self.maps)

    @property
    def error(self) -> float:
        """Sum of the maps' errors, an upper bound."""
        return sum(part.error for part in self.maps)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Side(Linear):
    """Linear maps side by side, whose images add up."""

    maps: tuple[Linear, ...]

    def __post_init__(self) -> None:
        shapes = {part.shape for part in self.maps}
        if len(shapes) != 1:
            raise GeometryError(f"maps that add up need one shape, not {sorted(shapes)}.")

    @property
    def memory_bytes(self) -> float:
        """Memory of all maps together [bytes]."""
        return sum(part.memory_bytes for part in self.maps)

    @property
    def error(self) -> float:
        """Largest error of the maps, an upper bound."""
        return max(part.error for part in self.maps)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sum(_Side):
    """Weighted sum of linear maps of one shape, such as those of several wavelengths.

    Parameters
    ----------
    maps
        One map or more.
    weights
        One for each.

    Raises
    ------
    GeometryError
        No maps, or maps of several shapes.
    """

    weights: tuple[float, ...]

    title: ClassVar[str] = "Sum of maps"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Output and input shape, the same for every map."""
        return self.maps[0].shape

    def _forward(self, intensity: Array) -> Array:
        return _total([w * a._forward(intensity) for w, a in zip(self.weights, self.maps, strict=True)])

    def _adjoint(self, raw: Array) -> Array:
        return _total([w * a._adjoint(raw) for w, a in zip(self.weights, self.maps, strict=True)])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Slices(_Side):
    """One map for each plane of an object (z, y, x): planes do not hide one another; see `stack`."""

    title: ClassVar[str] = "Maps of several planes"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of one raw image and of all planes."""
        raw, plane = self.maps[0].shape
        return raw, (len(self.maps), *plane)

    def _forward(self, intensity: Array) -> Array:
        return _total([plane._forward(intensity[k, ...]) for k, plane in enumerate(self.maps)])

    def _adjoint(self, raw: Array) -> Array:
        return arrays.namespace(raw).stack([plane._adjoint(raw) for plane in self.maps], axis=0)


def stack(
    maps: Sequence[Linear], *, object_grid: Grid | None = None, depths: Sequence[float] | None = None
) -> Slices:
    """Raw image (ny, nx) of an object (z, y, x), by a map for each of its planes (y, x).

    Parameters
    ----------
    maps
        Maps of one shape.
    object_grid
        Samples of every plane; None for the first map's.
    depths
        Depths of the planes from the focused one (z,) [m].

    Raises
    ------
    GeometryError
        No maps, or maps of several shapes.
    """
    grid = maps[0].object_grid if object_grid is None and maps else object_grid
    return Slices(tuple(maps), object_grid=grid, depths=None if depths is None else tuple(depths))


def _total(images: Sequence[Array]) -> Array:
    return sum(images[1:], images[0])
