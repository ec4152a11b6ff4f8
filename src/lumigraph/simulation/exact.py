"""Parts of a scene whose images need no shots: points, evenly lit stops, slices in light of one kind."""

from dataclasses import replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.progress import Progress
from lumigraph.operators import points, single_lens, white
from lumigraph.operators.coherent import coherent_image
from lumigraph.operators.paraxial import left_by_field, resolved
from lumigraph.operators.periodic import periodic_operator
from lumigraph.scene import Diffuser, Points, Slice
from lumigraph.simulation import error
from lumigraph.simulation.camera import Camera

Part = Slice | Points | Diffuser


def image_of(
    camera: Camera, part: Part, accuracy: float, progress: Progress, *, coherent: bool = False
) -> tuple[np.ndarray, error.Reached]:
    """Raw image of a part in incoherent light, or of a slice in coherent light, and how far off it is."""
    plain = camera.optics()
    if coherent and isinstance(part, Slice):
        plain = replace(plain, model="paraxial")
        amplitude = np.sqrt(arrays.to_numpy(part.intensity))
        image = coherent_image(plain, amplitude, part.grid, part.dz, accuracy)
        return image, error.of_quadrature("coherent", accuracy).through(plain)
    if camera.lattice is None:
        return _without_lenslets(camera, part), error.SINGLE_LENS
    if isinstance(part, Diffuser):
        image, fringes = white.white_image(plain, accuracy)
        reached = error.of_quadrature("white image", accuracy).and_also(fringes)
        return part.intensity * image, reached.through(plain)
    plain = resolved(plain, accuracy)
    if isinstance(part, Points):
        image, off = points.image_and_error(plain, part, accuracy)
        reached = error.of_points(off, accuracy)
        return image, reached if plain.model == "exact" else reached.through(plain)
    part = part.trimmed()
    operator = periodic_operator(plain, part.grid, part.dz, accuracy=accuracy, progress=progress)
    image = operator.forward(arrays.to_numpy(part.intensity).astype(np.float32))
    reached = error.of_quadrature("operator", accuracy)
    if plain.model == "exact":
        return image, reached.and_also(left_by_field(plain, accuracy), ", alike over the field")
    return image, reached.through(plain)


def _without_lenslets(camera: Camera, part: Part) -> np.ndarray:
    if isinstance(part, Points):
        return single_lens.points_image(camera, part)
    if isinstance(part, Diffuser):  # a sharp image of nothing: even light
        return np.full(camera.sensor.shape, part.intensity)
    return single_lens.slice_image(camera, part.trimmed())
