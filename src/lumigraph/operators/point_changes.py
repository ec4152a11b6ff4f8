"""Image of a point before a camera with lenslets, and its changes by the main lens' phase and by its place.

Light behind the lenslets is linear in the pupil: U = A P. A phase φ_j changes it by A (i φ_j P), and the
image by 2 Re(U* ∂U). The cells that are lit, and what is known of the lenslets, serve all changes.
"""

import math
from collections.abc import Sequence

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.elements import ZernikePlate
from lumigraph.errors import GeometryError
from lumigraph.operators import cells as _cells
from lumigraph.operators.camera import HasOptics
from lumigraph.operators.optics import Optics
from lumigraph.operators.paraxial import resolved
from lumigraph.operators.point_light import Sampled
from lumigraph.operators.points import farthest, lit_cells, on_lenslets, share
from lumigraph.operators.relay import relay
from lumigraph.operators.tiles import readout

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
    optics = Optics.of(plain, plain.object_distance + float(place[2]), accuracy)
    at, lenslets = on_lenslets(optics, place[None, :2], optics.distance), relay(optics)
    light = Sampled(plain, _cells.lens(plain), optics.distance, farthest(optics, at), PUPIL)
    rows, columns = lit_cells(optics, light, at[0])
    (y, x), scale = lenslets.places(rows, columns), share(optics)
    (ky, kx), whole = (
        optics.cells.samples,
        [n * k for n, k in zip(optics.cells.image, optics.cells.samples, strict=True)],
    )
    read = readout(optics)

    def field(one: Sampled) -> np.ndarray:
        return lenslets.field(one.at(y - at[0, 0], x - at[0, 1]).astype(np.complex64), rows, columns)

    def pixels(intensity: np.ndarray) -> np.ndarray:
        plane = np.zeros(whole, np.float32)
        plane[rows.start * ky : rows.stop * ky, columns.start * kx : columns.stop * kx] = scale * intensity
        return read.forward(plane)

    middle = field(light)
    changes = [pixels(2 * np.real(middle.conj() * field(one))) for one in _changed(optics, light, terms)]
    return pixels(np.abs(middle) ** 2), np.stack(changes)


def _changed(optics: Optics, light: Sampled, terms: Sequence[int]) -> list[Sampled]:
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
