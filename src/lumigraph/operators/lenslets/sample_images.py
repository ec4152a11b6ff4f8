"""Operator of known images of each sample, for instruments before which no image repeats."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, vstack

from lumigraph.core import arrays, memory
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear, Shape
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.part_volume import PartVolume

TOGETHER = 32
"""Samples whose images are computed at a time."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SampleImages(Linear):
    """Raw image of planes, each sample's image times how bright it is.

    Parameters
    ----------
    images
        Of each sample, sparse (samples of all planes, pixels).
    sizes
        Of a raw image, and of an object (z, y, x).
    """

    images: csr_array
    sizes: tuple[Shape, Shape]

    title: ClassVar[str] = "Operator of samples' images"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of a raw image and of an object."""
        return self.sizes

    def _forward(self, intensity: Array) -> Array:
        return arrays.like((self.images.T @ _plain(intensity).ravel()).reshape(self.sizes[0]), intensity)

    def _adjoint(self, raw: Array) -> Array:
        return arrays.like((self.images @ _plain(raw).ravel()).reshape(self.sizes[1]), raw)

    @property
    def memory_bytes(self) -> float:
        """Memory of the images [bytes]."""
        return float(self.images.data.nbytes + self.images.indices.nbytes)


def sample_images(volume: PartVolume, depths: tuple[float, ...]) -> SampleImages:
    """Operator of planes that shine at once, by the image of each of their samples.

    Parameters
    ----------
    volume
        What sees the planes.
    depths
        Theirs [m].

    Raises
    ------
    SamplingError
        Images that do not fit in memory.
    """
    found: list[csr_array] = []
    for number, images in enumerate(_images(volume)):
        found.append(images)
        if not number:
            count, each = math.prod(volume.shape[1]), len(images.data) / (len(images.indptr) - 1)
            memory.require(
                16.0 * each * count, f"the images of {count} samples",
                "Use fewer samples, lenslets or pixels.", SamplingError,
            )  # fmt: skip
    whole = csr_array(vstack(found))
    return SampleImages(whole, volume.shape, object_grid=volume.grid, depths=depths)


def _images(volume: PartVolume) -> Iterator[csr_array]:
    """Images of some samples of a plane after the other, sparse (samples, pixels)."""
    samples = volume.shape[1][1:]
    count = samples[0] * samples[1]
    for plane in volume.planes:
        for first in range(0, count, TOGETHER):
            each = np.eye(min(TOGETHER, count - first), count, first).reshape(-1, *samples)
            yield csr_array(plane.forward(each).reshape(len(each), -1).astype(np.float32))


def _plain(array: Array) -> np.ndarray:
    """Array on the CPU, where sparse matrices are; no gradient goes through them."""
    if getattr(array, "requires_grad", False):
        raise GeometryError(
            "the object asks for gradients, which do not go through images of samples. Use operator.adjoint."
        )
    return arrays.to_numpy(array)
