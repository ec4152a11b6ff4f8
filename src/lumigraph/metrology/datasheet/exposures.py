"""Exposures of one light, read or drawn only when they are used, and their mean."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import overload

import numpy as np

from lumigraph.core.arrays import to_numpy
from lumigraph.core.raw import RawImage
from lumigraph.core.short_repr import brief
from lumigraph.errors import FormatError
from lumigraph.preparation.given import read_raw
from lumigraph.sensor import Sensor


class Exposures(Sequence[RawImage]):
    """Raw images of one light that are not kept in memory: sixty of a large sensor would not fit.

    A child says how many there are, and gives each.
    """

    @abstractmethod
    def one(self, number: int) -> RawImage:
        """The raw image of a number from 0."""

    @overload
    def __getitem__(self, index: int) -> RawImage: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[RawImage, ...]: ...
    def __getitem__(self, index: int | slice) -> RawImage | tuple[RawImage, ...]:
        numbers = range(len(self))[index]
        return self.one(numbers) if isinstance(numbers, int) else tuple(self.one(k) for k in numbers)

    def __iter__(self) -> Iterator[RawImage]:
        return (self.one(k) for k in range(len(self)))


@dataclass(frozen=True, slots=True, eq=False)
class FileExposures(Exposures):
    """Raw images of files.

    Parameters
    ----------
    paths
        Of the files.
    what
        Is in them, for an error's words.
    """

    paths: tuple[Path, ...]
    what: str = "raw image"

    def __len__(self) -> int:
        return len(self.paths)

    def one(self, number: int) -> RawImage:
        """The raw image of a number from 0."""
        return read_raw(self.paths[number], self.what)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnExposures(Exposures):
    """Exposures of a light with a sensor's noise, the same whenever they are drawn.

    Parameters
    ----------
    light
        Of each pixel (y, x).
    sensor
        That sees it.
    reference
        Light that fills `fill` of a full well.
    fill
        Part of a full well.
    seeds
        Of the noise, one of each exposure.
    """

    light: np.ndarray
    sensor: Sensor
    reference: float
    fill: float
    seeds: tuple[int, ...]

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.seeds)

    def one(self, number: int) -> RawImage:
        """The exposure of a number from 0."""
        rng = np.random.default_rng(self.seeds[number])
        return self.sensor.expose(self.light, reference=self.reference, fill=self.fill, rng=rng)


def mean_image(images: Iterable[RawImage]) -> RawImage:
    """Mean of several raw images of one light, one in memory at a time; a single one as it is.

    Raises
    ------
    FormatError
        None, or images of several sizes.
    """
    first, total, count = None, np.zeros(0), 0
    for image in images:
        data = np.asarray(to_numpy(image.data), float)
        if first is None:
            first, total = image, data
        elif data.shape != total.shape:
            raise FormatError(
                f"exposures of one light have {' x '.join(map(str, total.shape))} and "
                f"{' x '.join(map(str, data.shape))} px. Give one camera's."
            )
        else:
            total = total + data
        count += 1
    if first is None:
        raise FormatError("there is no exposure to take the mean of.")
    return first if count == 1 else replace(first, data=(total / count).astype(np.float32), metadata={})
