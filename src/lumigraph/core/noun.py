"""Base of the data types: NumPy reads them, they draw themselves, xarray and napari get named axes."""

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self

import numpy as np

from lumigraph.core import labelled, layers
from lumigraph.core.arrays import A, as_numpy
from lumigraph.core.labelled import Labels
from lumigraph.core.upper_floors import draw

if TYPE_CHECKING:
    from numpy.typing import DTypeLike


class Noun(Generic[A]):
    """A dataclass around one array."""

    __slots__ = ()
    pixels: ClassVar[str] = "data"
    """Name of the field that holds the array."""

    axes: ClassVar[str]
    """Names of its axes; "c" may follow."""

    def __array__(self, dtype: "DTypeLike | None" = None, copy: bool | None = None) -> np.ndarray:
        """The array on the CPU, for `numpy.asarray`; shares memory where it can and `copy` is not true.

        Raises
        ------
        ValueError
            `copy` is false but the type, or a GPU, asks for a copy.
        """
        return as_numpy(getattr(self, self.pixels), dtype, copy)

    def plot(self, **options: Any) -> Any:
        """Matplotlib Figure, as `lumigraph.plots.show` draws it; no window is opened."""
        return draw("show", self, **options)

    def to_xarray(self) -> Any:
        """An `xarray.DataArray` with named axes, coordinates in metres, and attributes."""
        return labelled.to_xarray(as_numpy(getattr(self, self.pixels)), self._labels())

    def to_napari(self, name: str = "") -> layers.LayerData:
        """A layer of napari, (data, options, "image"), with scale in micrometres, units and names of axes.

        napari is not needed for it. ``viewer.add_image(data, **options)`` shows it; its metadata hold this
        object as "lumigraph".

        Parameters
        ----------
        name
            Name of the layer; that of the type if left out.
        """
        array = as_numpy(getattr(self, self.pixels))
        return layers.image(array, self._labels(), self, name or type(self).__name__)

    @classmethod
    def from_xarray(cls, array: Any) -> Self:
        """Object restored from `to_xarray`, also after a selection along its axes.

        Raises
        ------
        GeometryError
            Axes of other names or in another order, missing attributes, uneven coordinates.
        """
        return cls._of_labels(labelled.from_xarray(array, cls.__name__, cls.axes))

    @abstractmethod
    def _labels(self) -> Labels: ...

    @classmethod
    @abstractmethod
    def _of_labels(cls, labels: Labels) -> Self: ...
