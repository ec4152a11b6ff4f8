"""Parts of a scene whose images need no shots: points, evenly lit stops, slices in light of one kind."""

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.progress import Progress
from lumigraph.operators import points, single_lens, white
from lumigraph.operators.coherent import coherent_image
from lumigraph.operators.periodic import periodic_operator
from lumigraph.scene import Diffuser, Points, Slice
from lumigraph.simulation import error
from lumigraph.simulation.camera import Camera

Part = Slice | Points | Diffuser


def image_of(
    camera: Camera, part: Part, accuracy: float, progress: Progress, *, coherent: bool = False
) -> tuple[np.ndarray, error.Reached]:
    """Raw image of a part in incoherent light, or of a slice in coherent light, and how far off it is."""
    if coherent and isinstance(part, Slice):
        amplitude = np.sqrt(arrays.to_numpy(part.intensity))
        image = coherent_image(camera, amplitude, part.grid, part.dz, accuracy)
        return image, error.of_quadrature("coherent", accuracy)
    if camera.lattice is None:
        return _without_lenslets(camera, part), error.SINGLE_LENS
    if isinstance(part, Points):
        return points.points_image(camera, part, accuracy), error.of_quadrature("points", accuracy)
    if isinstance(part, Diffuser):
        image, fringes = white.white_image(camera, accuracy)
        return part.intensity * image, error.of_quadrature("white image", accuracy).and_also(fringes)
    part = part.trimmed()
    operator = periodic_operator(camera, part.grid, part.dz, accuracy=accuracy, progress=progress)
    image = operator.forward(arrays.to_numpy(part.intensity).astype(np.float32))
    return image, error.of_quadrature("operator", accuracy)


def _without_lenslets(camera: Camera, part: Part) -> np.ndarray:
    if isinstance(part, Points):
        return single_lens.points_image(camera, part)
    if isinstance(part, Diffuser):  # a sharp image of nothing: even light
        return np.full(camera.sensor.shape, part.intensity)
    return single_lens.slice_image(camera, part.trimmed())
