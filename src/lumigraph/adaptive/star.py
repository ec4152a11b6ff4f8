"""Images of a point of light before a camera, for any Zernike terms of its main lens, and derivatives."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lumigraph.adaptive.checked import bent
from lumigraph.core.linear import Linear, Shape
from lumigraph.instruments import LensletCamera
from lumigraph.operators.microscope_pupil import PLACES, Lit
from lumigraph.operators.point_changes import point_changes
from lumigraph.operators.resampling import Part
from lumigraph.scene import Points

ACCURACY = 1e-2
"""Accuracy of points' images."""


@dataclass(frozen=True, slots=True, eq=False)
class Star:
    """Images of a point at a known depth before a camera, as `PupilImages` has them of microscopes.

    Parameters
    ----------
    camera
        Without the terms' coefficients.
    terms
        Noll indices.
    """

    camera: LensletCamera
    terms: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (ny, nx) of a raw image."""
        return self.camera.sensor.shape

    def period(self, dz: float) -> float:
        """Finest period of the object that the stop lets through, λz/D [m]."""
        return self.camera.wavelength * (self.camera.object_distance + dz) / self.camera.pupil_diameter

    def cell(self, dz: float) -> float:
        """Size of a lenslet in the object [m]."""
        camera = self.camera
        return camera.lenslets.pitch * (camera.object_distance + dz) / camera.separation

    def forward(self, points: Points, coefficients: np.ndarray) -> np.ndarray:
        """Raw image (ny, nx) of points, for coefficients (terms,) [waves rms]: parts of their light."""
        images = (
            light * self._seen(place, coefficients, ())[0]
            for place, light in zip(points.positions, points.intensities, strict=True)
        )
        return sum(images, np.zeros(self.shape))

    def fixed(self, coefficients: np.ndarray) -> "Star":
        """The same with these coefficients (terms,) [waves rms] among the camera's own, and no terms left."""
        return Star(bent(self.camera, self.terms, coefficients), ())

    def lit(
        self, points: Points, coefficients: np.ndarray, directions: np.ndarray | None = None
    ) -> Iterator[Lit]:
        """Image of each point of intensity 1, and derivatives along directions (k, terms + 3).

        By all coefficients, y, x and dz if left out; those by the last three are 0.
        """
        along = np.eye(len(self.terms) + PLACES) if directions is None else directions
        for place in points.positions:
            image, changes = self._seen(place, coefficients, self.terms if len(along) else ())
            yield Lit(image, np.tensordot(along[:, : len(changes)], changes, 1), (0, 0))

    def _seen(
        self, place: np.ndarray, coefficients: np.ndarray, terms: tuple[int, ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        camera = bent(self.camera, self.terms, coefficients)
        step = camera.object_grid.pitch[0] * camera.separation / (camera.object_distance + float(place[2]))
        image, changes = point_changes(camera, place, terms, ACCURACY)
        part = (camera.sensor.pixel_pitch / step) ** 2
        return part * image.astype(np.float64), part * changes.astype(np.float64)

    def share(self, dz: float) -> float:
        """All of the raw image."""
        return 1.0

    def seen(self, images: np.ndarray, cell: tuple[int, int]) -> tuple[Part, np.ndarray]:
        """Images (k, ny, nx) as they are: of the whole raw image."""
        ny, nx = self.shape
        return (slice(0, ny), slice(0, nx)), images


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Alone(Linear):
    """Light of one point to raw image.

    Parameters
    ----------
    image
        (ny, nx), of a point of intensity 1.
    """

    image: np.ndarray

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shapes of the raw image, and of one number."""
        return self.image.shape, (1,)

    def _forward(self, intensity: np.ndarray) -> np.ndarray:
        return (intensity[0] * self.image).astype(intensity.dtype)

    def _adjoint(self, raw: np.ndarray) -> np.ndarray:
        return np.array([np.vdot(self.image, raw)], raw.dtype)

    @property
    def memory_bytes(self) -> float:
        """Size of the image [bytes]."""
        return float(self.image.nbytes)
