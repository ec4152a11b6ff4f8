"""Image of a point before a camera with lenslets, and its changes by its place and the main lens' phase.

Light behind the lenslets is linear in the pupil: U = A P. A phase φ_j changes it by A (i φ_j P), and the
image by 2 Re(U* ∂U). The cells that are lit, and what is known of the lenslets, serve all changes.
"""

import math
from collections.abc import Sequence

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.elements import ZernikePlate
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.moving_point import own_changes
from lumigraph.operators.lenslets.paraxial_error import resolved
from lumigraph.operators.lenslets.relay import Relay, RelaySet
from lumigraph.operators.lenslets.sampled_camera import SPARE, SampledCamera, SourcePoint
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sampling_rules import FINEST
from lumigraph.operators.sampling.tiles import readout
from lumigraph.scene import Points


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
    optics = Optics.of(plain, plain.object_distance + float(place[2]), accuracy)
    own, source = _before(optics, place, np.complex64)
    return _seen(own, source, _phases(own, source, terms))


def has_changes(camera: CameraOptics) -> bool:
    """True if `place_changes` takes such a camera: paraxial, a thin lens for all fields before lenslets."""
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
    own, source = _before(lenslets.optics, place, np.complex64, lenslets)
    image, changes = _seen(own, source)
    return np.concatenate([image[None], changes])


def _before(
    optics: Optics, place: np.ndarray, precision: type[np.complexfloating], known: Relay | None = None
) -> tuple[SampledCamera, SourcePoint]:
    """A camera before a point of intensity 1."""
    points = Points(np.asarray(place, float)[None], np.ones(1))
    own = SampledCamera.with_cells(optics, points, precision=precision, known=known)
    return own, own.sources(points)[0]


def _seen(
    own: SampledCamera, source: SourcePoint, phases: Sequence[np.ndarray] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Image (ny, nx) and its derivatives (n, ny, nx) by phases, or by the point's place."""
    found, read = own_changes(own, source, phases), readout(own.optics)
    light = np.zeros((len(found), *own.shape), np.float32)
    light[(slice(None), *source.window)] = found
    pixels = np.stack([read.forward(one) for one in light])
    return pixels[0], pixels[1:]


def _phases(own: SampledCamera, source: SourcePoint, terms: Sequence[int]) -> list[np.ndarray]:
    """Phases (nodes, nodes) in the main lens of terms, in waves rms, and of the point's y and x [rad/m]."""
    camera, grid = own.optics.camera, own.grid
    y, x = grid.y[:, None], grid.x
    plates = (ZernikePlate({j: 2 * math.pi}, camera.pupil_diameter) for j in terms)
    phases = [plate.turned(-own.optics.rotation).phase(y, x) for plate in plates]
    return phases + [down[:, None] + across for down, across in own.moves(source)[:2]]
