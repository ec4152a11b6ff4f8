r"""Raw images of whole planes, and how they change with whatever differs between instruments a little apart.

Behind a lattice of lenslets images repeat themselves from cell to cell: with x the light of points of all
cells, K the images of those of one cell, and R what pixels take,

.. math:: I = R \sum_{p,c} x_{c,p}\, K_p(\cdot - c), \quad x = S o

where S spreads the object's samples onto the points. K is differentiated, and S and R compared between
instruments a little apart. Backwards, what all objects and weights say of K_p is a sum over cells: each
point is followed back once, however many objects there are.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.gradient import times


class PlaneImages(Protocol):
    """Images of points, or of a plane (y, x), with derivatives by what differs in pairs of instruments."""

    @property
    def shape(self) -> Any:
        """Shape of a raw image first, or alone."""
        ...

    def forward(self, x: Any, /) -> np.ndarray:
        """Raw image."""
        ...

    def derivative(self, x: Any, change: np.ndarray, /) -> np.ndarray:
        """Change of the raw image along a change of the pairs (n,)."""
        ...

    def gradient(self, x: Any, weights: np.ndarray, /) -> np.ndarray:
        """The transpose of `derivative`."""
        ...


class WholePlane(ABC):
    """Images of a plane by an instrument, with derivatives by what differs in pairs of instruments.

    The object's samples stay where they are, and as bright, before all of them.
    """

    grid: Grid

    @property
    @abstractmethod
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of a raw image and of an object."""

    @property
    @abstractmethod
    def _count(self) -> int:
        """Pairs."""

    @abstractmethod
    def _forward(self, objects: list[np.ndarray]) -> list[np.ndarray]:
        """Raw image of each object."""

    @abstractmethod
    def _derivative(self, objects: list[np.ndarray], change: list[float]) -> list[np.ndarray]:
        """Change of each raw image."""

    @abstractmethod
    def _gradient(self, objects: list[np.ndarray], pixels: list[np.ndarray]) -> np.ndarray:
        """(n,), of weights of each raw image's pixels."""

    @single_products()
    def forward(self, x: np.ndarray) -> np.ndarray:
        """Raw image (ny, nx) of an object (y, x); of several (k, y, x) theirs, faster than one by one."""
        return self._stacked(x, self._forward(self._objects(x)))

    @single_products()
    def derivative(self, x: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Change of `forward`, so many times (n,) from the first to the last instrument of each pair."""
        if np.shape(change) != (self._count,):
            raise GeometryError(f"change has shape {np.shape(change)} but must be ({self._count},).")
        weights = np.asarray(change, np.float64).tolist()
        return self._stacked(x, self._derivative(self._objects(x), weights))

    @single_products()
    def gradient(self, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels.

        Of several objects (k, y, x) and weights (k, ny, nx) their sum, faster than one by one.
        """
        given, raw = self._objects(x), self.shape[0]
        pixels = np.asarray(weights, np.float64).reshape(-1, *np.shape(weights)[-2:])
        if pixels.shape != (len(given), *raw):
            raise GeometryError(f"weights have shape {np.shape(weights)} but must be ({len(given)}, {raw}).")
        return self._gradient(given, list(pixels))

    def _objects(self, x: np.ndarray) -> list[np.ndarray]:
        if np.ndim(x) not in (2, 3) or np.shape(x)[-2:] != self.grid.shape:
            raise GeometryError(f"the object has shape {np.shape(x)} but the grid {self.grid.shape}.")
        return list(np.asarray(x, np.float64).reshape(-1, *self.grid.shape))

    def _stacked(self, x: np.ndarray, raws: list[np.ndarray]) -> np.ndarray:
        return np.stack(raws).reshape(*np.shape(x)[:-2], *self.shape[0])


@dataclass(frozen=True, slots=True, eq=False)
class RepeatedImages:
    """Images of some points of one cell, which those of all other cells have as well.

    Parameters
    ----------
    kernel
        (rows, columns, n, samples) of the cells that they light.
    numbers
        Of the points, in their cell.
    first
        Row and column of the points whose light falls, by the kernel's first cell, on the image's first.
    """

    kernel: np.ndarray
    numbers: slice
    first: tuple[int, int]

    def add(self, light: np.ndarray, points: np.ndarray) -> None:
        """Add the light of points (rows, columns, points) to cells (rows, columns, samples) of the image."""
        flat = light.reshape(-1, light.shape[-1])
        for offset in np.ndindex(*self.kernel.shape[:2]):
            flat += self._shining(points, offset, light.shape) @ self.kernel[offset]

    def return_to(self, points: np.ndarray, seen: np.ndarray) -> None:
        """The transpose of `add`."""
        flat = seen.reshape(-1, seen.shape[-1])
        for offset in np.ndindex(*self.kernel.shape[:2]):
            back = flat @ self.kernel[offset].T
            points[(*self._from(offset, seen.shape), self.numbers)] += back.reshape(*seen.shape[:2], -1)

    def asked(self, points: Sequence[np.ndarray], seen: Sequence[np.ndarray]) -> np.ndarray:
        """Slopes by the kernel, of objects' points and slopes by their light in the image's cells."""
        found = np.zeros_like(self.kernel)
        for one, light in zip(points, seen, strict=True):
            flat = light.reshape(-1, light.shape[-1])
            for offset in np.ndindex(*found.shape[:2]):
                found[offset] += self._shining(one, offset, light.shape).T @ flat
        return found

    def _from(self, offset: tuple[int, ...], shape: tuple[int, ...]) -> tuple[slice, slice]:
        """Slices of the points whose light falls into the image's cells so many away."""
        starts = [first - k for first, k in zip(self.first, offset, strict=True)]
        y, x = (slice(start, start + n) for start, n in zip(starts, shape[:2], strict=True))
        return y, x

    def _shining(self, points: np.ndarray, offset: tuple[int, ...], shape: tuple[int, ...]) -> np.ndarray:
        """(cells, n): points' light that falls into the image's cells."""
        mine = points[(*self._from(offset, shape), self.numbers)]
        return mine.reshape(-1, mine.shape[-1])


End = TypeVar("End")
"""An instrument as it is compared with those a little apart."""


class RepeatedKernel(Protocol):
    """Images of points that repeat themselves; see `RepeatedImages`."""

    def add(self, light: np.ndarray, points: np.ndarray, /) -> None:
        """Add the light of points to that on the image."""
        ...

    def return_to(self, points: np.ndarray, seen: np.ndarray, /) -> None:
        """The transpose of `add`."""
        ...

    def asked(self, points: Sequence[np.ndarray], seen: Sequence[np.ndarray], /) -> np.ndarray:
        """Slopes by the kernel, of objects' points and slopes by their light."""
        ...


Some = TypeVar("Some", bound=RepeatedKernel)
Given = TypeVar("Given", bound=RepeatedKernel, contravariant=True)


class PlaneGradient(Protocol[Given]):
    """Slopes of a number by what images of a cell's points follow from."""

    def add(self, block: Given, asked: np.ndarray) -> None:
        """Add the slopes that come from slopes by a block's kernel."""
        ...

    def along(self) -> np.ndarray:
        """(n,), what they come to from the first to the last instrument of each pair."""
        ...


class CellPlane(WholePlane, Generic[End, Some]):
    """Images of a plane by an instrument whose images repeat themselves from cell to cell."""

    @abstractmethod
    def _whole(self) -> End:
        """The instrument."""

    @abstractmethod
    def _pairs(self) -> Sequence[tuple[End, End]]:
        """Pairs of instruments a little to either side."""

    @abstractmethod
    def _points(self, end: End, x: np.ndarray) -> np.ndarray:
        """Light (rows, columns, points) of cells in a margin around the array."""

    @abstractmethod
    def _dark(self) -> np.ndarray:
        """No light in the cells (rows, columns, samples) of the image."""

    @abstractmethod
    def _plane(self, light: np.ndarray) -> np.ndarray:
        """Samples (y, x) of the image, of those of its cells."""

    @abstractmethod
    def _cells(self, plane: np.ndarray) -> np.ndarray:
        """The transpose of `_plane`."""

    @abstractmethod
    def _read(self, end: End) -> Linear:
        """Map from the samples of the image to the pixels."""

    @abstractmethod
    def _blocks(self) -> Iterator[Some]:
        """Blocks of the images of all points of a cell."""

    @abstractmethod
    def _changed(self, change: list[float]) -> Callable[[Some], RepeatedKernel]:
        """Gives how a block's images change."""

    @abstractmethod
    def _slopes(self) -> PlaneGradient[Some]:
        """Slopes of a number that does not change yet."""

    @property
    def _count(self) -> int:
        return len(self._pairs())

    def _forward(self, objects: list[np.ndarray]) -> list[np.ndarray]:
        own = self._whole()
        points, light = [self._points(own, one) for one in objects], [self._dark() for _ in objects]
        for block in self._blocks():
            for mine, one in zip(light, points, strict=True):
                block.add(mine, one)
        return [self._read(own).forward(self._plane(one)) for one in light]

    def _derivative(self, objects: list[np.ndarray], change: list[float]) -> list[np.ndarray]:
        own, changed = self._whole(), self._changed(change)
        points = [self._points(own, one) for one in objects]
        onto = [np.zeros_like(one) for one in points]
        for moved, one in zip(onto, objects, strict=True):
            for weight, (first, last) in zip(change, self._pairs(), strict=True):
                moved += weight * (self._points(last, one) - self._points(first, one))
        light, moving = ([self._dark() for _ in objects] for _ in range(2))
        for block in self._blocks():
            anew = changed(block)
            for k, one in enumerate(points):
                block.add(light[k], one)
                block.add(moving[k], onto[k])
                anew.add(moving[k], one)
        return [
            self._read(own).forward(self._plane(moved)) + self._read_anew(self._plane(one), change)
            for one, moved in zip(light, moving, strict=True)
        ]

    def _read_anew(self, plane: np.ndarray, change: list[float]) -> np.ndarray:
        found = np.zeros(self.shape[0])
        for weight, ends in zip(change, self._pairs(), strict=True):
            low, high = map(self._read, ends)
            if low is not high:
                found += weight * (high.forward(plane) - low.forward(plane))
        return found

    def _gradient(self, objects: list[np.ndarray], pixels: list[np.ndarray]) -> np.ndarray:
        own = self._whole()
        points = [self._points(own, one) for one in objects]
        seen = [self._cells(self._read(own).adjoint(one)) for one in pixels]
        light, told, by = (
            [self._dark() for _ in objects],
            [np.zeros_like(one) for one in points],
            self._slopes(),
        )
        for block in self._blocks():
            for k, one in enumerate(points):
                block.add(light[k], one)
                block.return_to(told[k], seen[k])
            by.add(block, block.asked(points, seen))
        found, planes = by.along(), [self._plane(one) for one in light]
        for k, ends in enumerate(self._pairs()):
            low, high = map(self._read, ends)
            for plane, weights in zip(planes, pixels, strict=True) if low is not high else ():
                found[k] += times(weights, low.forward(plane), high.forward(plane))
            for one, back in zip(objects, told, strict=True):
                found[k] += times(back, *(self._points(end, one) for end in ends))
        return found
