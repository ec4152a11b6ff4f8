"""Operators of a microscope for any Zernike terms of its pupil, and their derivatives.

Moving a point by a lenslet moves its image by a lenslet, so that the images of the points of one cell, and
their derivatives, make whole operators.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.core.threads import each
from lumigraph.deconvolution.beyond import beyond
from lumigraph.errors import SamplingError
from lumigraph.operators.microscope_kernels import SliceKernel
from lumigraph.operators.microscope_operator import MicroscopeOperator
from lumigraph.operators.microscope_pupil import PLACES, Lit, PupilImages
from lumigraph.scene import Points

SHARE = 0.5
"""Share of the accuracy, rms, that omitted cells may take."""

COARSE = 0.1
"""Accuracy of derivatives: they show the way, and the images themselves where it ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Operators of a volume by coefficients.

    Parameters
    ----------
    images
        Of points, by the pupil.
    planes
        Depths of the volume [m].
    samples
        Of the volume along a lenslet.
    margin
        Lenslets that the volume reaches beyond the layout's cells on each side; below 0 within them.
    """

    images: PupilImages
    planes: tuple[float, ...]
    samples: int
    margin: int = 0

    @classmethod
    def of(cls, images: PupilImages, planes: Sequence[float], samples: int) -> "Sight":
        """Operators of a volume that reaches as far as light comes from without aberrations."""
        first = cls(images, tuple(planes), samples, -images.layout.frame)
        _, (rows, _) = beyond(first.operator(np.zeros(len(images.terms))))
        return replace(first, margin=first.margin + (rows.start or 0) // samples)

    @property
    def grid(self) -> Grid:
        """Grid of the volume's planes, with what is beyond the picture."""
        return self._grid(self.margin)

    @property
    def picture(self) -> Grid:
        """Grid of the volume's planes before the lenslets of the picture."""
        return self._grid(-self.images.layout.frame)

    def _grid(self, margin: int) -> Grid:
        layout, size = self.images.layout, self.images.lenslet.pitch / self.images.lenslet.magnification
        ny, nx = ((int(n) + 2 * margin) * self.samples for n in layout.cells)
        pitch = size / self.samples
        center = [c + (0.0 if n % 2 else pitch / 2) for c, n in zip(layout.center, (ny, nx), strict=True)]
        return Grid((ny, nx), (pitch, pitch), (float(center[0]), float(center[1])))

    @property
    def inside(self) -> tuple[slice, slice]:
        """Samples (y, x) before the lenslets of the picture."""
        beside = (self.margin + self.images.layout.frame) * self.samples
        ny, nx = self.grid.shape
        return slice(beside, ny - beside), slice(beside, nx - beside)

    def operator(self, coefficients: np.ndarray) -> MicroscopeOperator:
        """Volume (z, y, x) to raw image, for coefficients (terms,) [waves rms]."""
        kernels = []
        for dz in self.planes:
            found = self._lit(self.images, dz, coefficients, np.zeros((0, 0)))
            kernels.append(self._kernel(np.stack([self._parted(one.image) for one in found])))
        return self._of(kernels)

    def changes(self, coefficients: np.ndarray) -> list[MicroscopeOperator]:
        """Derivatives of the operator by each coefficient [1/waves rms]; they reach below 0."""
        terms = len(self.images.terms)
        directions = np.eye(terms, terms + PLACES)
        coarse = replace(self.images, accuracy=max(COARSE, self.images.accuracy))
        kernels: list[list[SliceKernel]] = [[] for _ in range(terms)]
        for dz in self.planes:
            found = self._lit(coarse, dz, coefficients, directions)
            for j, own in enumerate(kernels):
                own.append(self._kernel(np.stack([self._parted(one.changes[j]) for one in found])))
        return [self._of(own) for own in kernels]

    def require_memory(self, changes: int) -> None:
        """Refuse an operator, and so many changes of it, that do not fit."""
        cells = max(self.images.cells_at(dz) for dz in (self.planes[0], self.planes[-1]))
        rows = cells**2 * self.samples**2 * len(self.planes)
        needed = 8.0 * (changes + 2) * rows * self.images.layout.sampling.pixels**2
        also = f" with {changes} derivatives" if changes else ""
        what = f"an operator of {len(self.planes)} depths{also}"
        memory.require(needed, what, "Use fewer depths or terms.", SamplingError)

    def _lit(
        self, images: PupilImages, dz: float, coefficients: np.ndarray, directions: np.ndarray
    ) -> list[Lit]:
        size, s = images.lenslet.pitch / images.lenslet.magnification, self.samples
        at = ((np.arange(s) - (s - 1) / 2) / s) * size
        middle = [  # of the cell n // 2
            c + (n // 2 - (n - 1) / 2) * size
            for c, n in zip(images.layout.center, images.layout.cells, strict=True)
        ]
        places = [(middle[0] + y, middle[1] + x, dz) for y in at for x in at]

        def one(place: tuple[float, float, float]) -> Lit:
            point = Points(np.array([place]), np.ones(1))
            return next(iter(images.lit(point, coefficients, directions)))

        return list(each(one, places))

    @property
    def brighter(self) -> float:
        """Light of a sample of the volume over that of the layout's samples."""
        return (self.images.layout.sampling.points / self.samples) ** 2

    def _parted(self, image: np.ndarray) -> np.ndarray:
        """A window (T N, T N) as cells (T², N²)."""
        N = self.images.layout.sampling.pixels
        T = image.shape[-1] // N
        cells = image.reshape(T, N, T, N).transpose(0, 2, 1, 3).reshape(T * T, N * N)
        return (cells * self.brighter).astype(np.float32)

    def _kernel(self, blocks: np.ndarray) -> SliceKernel:
        """Kernel of images (points, T², N²), without the cells that hold little."""
        T = math.isqrt(blocks.shape[1])
        power = np.square(blocks, dtype=np.float64).sum((0, 2))
        order = np.argsort(power)
        faint = np.cumsum(power[order]) <= (SHARE * self.images.accuracy) ** 2 * power.sum()
        kept = np.sort(order[~faint])
        offsets = np.stack(np.divmod(kept, T), 1) - T // 2
        sampling = replace(self.images.layout.sampling, points=self.samples)
        return SliceKernel(
            offsets, np.ascontiguousarray(blocks[:, kept]), sampling, False, error=self.images.accuracy
        )

    def _of(self, kernels: Sequence[SliceKernel]) -> MicroscopeOperator:
        layout = self.images.layout
        return MicroscopeOperator(
            tuple(kernels), (int(layout.cells[0]), int(layout.cells[1])), layout.placement, self.margin,
            object_grid=self.grid, depths=self.planes,
        )  # fmt: skip
