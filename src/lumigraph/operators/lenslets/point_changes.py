"""Image of a point before a camera with lenslets, and its changes by its place and the main lens' phase.

Light behind the lenslets is linear in the pupil: U = A P. A phase φ_j changes it by A (i φ_j P), and the
image by 2 Re(U* ∂U). The cells that are lit, and what is known of the lenslets, serve all changes.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.elements import ZernikePlate
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.paraxial_error import resolved
from lumigraph.operators.lenslets.point_light import PointLight, SampledPupilLight, paraxial_light
from lumigraph.operators.lenslets.points import SPARE, farthest, lit_cells, on_lenslets, share
from lumigraph.operators.lenslets.relay import Relay, RelaySet, relay
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sampling_rules import FINEST
from lumigraph.operators.sampling.tiles import readout

PUPIL = 512
"""Samples across the main lens, or more where its light is followed far."""


@single_products()
def point_changes(
    camera: HasOptics, place: np.ndarray, terms: Sequence[int], accuracy: float
) -> tuple[np.ndarray, np.ndarray]:
    """Image (ny, nx) of a point of intensity 1, and its derivatives (terms + 2, ny, nx).

    Parameters
    ----------
    camera
        With lenslets, paraxial, behind one lens for all fields.
    place
        (y, x, dz) of the point, dz from the focused plane [m].
    terms
        Noll indices of the main lens' phase; derivatives are by waves rms, then by y and x [1/m].
    accuracy
        Relative rms error of the image.

    Raises
    ------
    GeometryError
        The camera's model is exact, or its lens changes over the field.
    """
    plain = resolved(camera.optics(), accuracy)
    if plain.model == "exact":
        raise GeometryError("derivatives by the pupil's phase are paraxial. Use model = 'paraxial'.")
    lenslets = relay(Optics.of(plain, plain.object_distance + float(place[2]), accuracy))
    optics = lenslets.optics
    at = on_lenslets(optics, place[None, :2], optics.distance)
    light = SampledPupilLight(plain, _cells.lens(plain), optics.distance, farthest(optics, at), PUPIL)
    seen = _PointCells.of(lenslets, light, at[0])
    images = seen.images(light, (one.at(*seen.around) for one in _changed(optics, light, terms)))
    return images[0], images[1:]


def has_changes(camera: CameraOptics) -> bool:
    """Whether `place_changes` is of such a camera: paraxial, a thin lens for all fields before lenslets."""
    plain = camera.array is not None and camera.objects is None and camera.model == "paraxial"
    return plain and field_lenses.plate_of(camera) is None


@single_products()
def place_changes(camera: CameraOptics, place: np.ndarray, accuracy: float, known: RelaySet) -> np.ndarray:
    """Image of a point of intensity 1 and its derivatives by y, x and dz (4, ny, nx) [1/m].

    The part of the light that a sample of the object stands for, by its depth, is not differentiated.

    Parameters
    ----------
    camera
        That `has_changes`.
    place
        (y, x, dz) before the array [m].
    accuracy
        Relative rms error of the image.
    known
        Relays that are used again.
    """
    lenslets = known.of(camera, float(place[2]), max(SPARE * accuracy, FINEST))
    optics = lenslets.optics
    at = on_lenslets(optics, place[None, :2], optics.distance)
    light = paraxial_light(camera, optics.distance, farthest(optics, at), PUPIL)
    seen = _PointCells.of(lenslets, light, at[0])
    down, across, deeper = light.changes(*seen.around)
    moves = [on_lenslets(optics, move[None], optics.distance)[0] for move in np.eye(2)]
    moves.append(-at[0] / optics.distance)  # a deeper point's image is nearer to the axis
    lights = [-move[0] * down - move[1] * across for move in moves]
    lights[2] += deeper
    return seen.images(light, lights)


@dataclass(frozen=True, slots=True, eq=False)
class _PointCells:
    """Cells that a point lights.

    Parameters
    ----------
    lenslets
        To the image.
    rows, columns
        Of the cells.
    around
        Places along y and x where light is needed, from the point's image [m].
    """

    lenslets: Relay
    rows: range
    columns: range
    around: tuple[np.ndarray, np.ndarray]

    @classmethod
    def of(cls, lenslets: Relay, light: PointLight, at: np.ndarray) -> "_PointCells":
        """Of a point imaged at a place (2,)."""
        rows, columns = lit_cells(lenslets.optics, light, at)
        y, x = lenslets.places(rows, columns)
        return cls(lenslets, rows, columns, (y - at[0], x - at[1]))

    def images(self, light: PointLight, changes: Iterable[np.ndarray]) -> np.ndarray:
        """Of the pixels, and how they change (n + 1, ny, nx) with light that changes so (y, x)."""
        middle, read = self._field(light.at(*self.around)), readout(self.lenslets.optics)
        found = [np.abs(middle) ** 2]
        found += [2 * np.real(middle.conj() * self._field(one)) for one in changes]
        return np.stack([read.forward(self._whole(one)) for one in found])

    def _field(self, light: np.ndarray) -> np.ndarray:
        return self.lenslets.field(light.astype(np.complex64), self.rows, self.columns)

    def _whole(self, intensity: np.ndarray) -> np.ndarray:
        """Of all samples."""
        cells = self.lenslets.optics.cells
        ky, kx = cells.samples
        whole = np.zeros([n * k for n, k in zip(cells.image, cells.samples, strict=True)], np.float32)
        rows, columns = (
            slice(mine.start * k, mine.stop * k)
            for mine, k in zip((self.rows, self.columns), (ky, kx), strict=True)
        )
        whole[rows, columns] = share(self.lenslets.optics) * intensity
        return whole


def _changed(optics: Optics, light: SampledPupilLight, terms: Sequence[int]) -> list[SampledPupilLight]:
    """The light's changes by terms, and by the point's place."""
    camera, (grid, _) = optics.camera, light.behind()
    y, x = grid.y[:, None], grid.x
    plates = (ZernikePlate({j: 2 * math.pi}, camera.pupil_diameter).turned(-optics.rotation) for j in terms)
    phases = [plate.phase(y, x) for plate in plates]
    # The image moves by -L/z of the point's move, against it, in the frame that turns with the lenslets.
    tilt = 2 * math.pi / (camera.wavelength * camera.separation)
    for move in np.eye(2):
        down, across = on_lenslets(optics, move[None], optics.distance)[0]
        phases.append(tilt * (down * y + across * x))
    return [light.turned(phase) for phase in phases]
