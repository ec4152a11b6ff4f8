r"""Images in a lamp's light by fewer waves than it has coherent modes: as many as a pixel can tell apart.

A pixel sees a small part of the object, through its lenslet. Only there does the light's mutual intensity
matter: a quadrature of the lamp that keeps it between points up to that far apart gives the image, however
wide the object is. Points farther apart interfere by chance, in proportion to how little light a pixel has
from both. Two quadratures of the lamp are taken; half of what their images differ by is the error of their
mean.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from lumigraph.core import arrays, memory
from lumigraph.core.progress import Progress, Stage
from lumigraph.core.progress import part as share
from lumigraph.elements import ThinLens
from lumigraph.operators.periodic.coherent import coherent_image
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.scene import ExtendedSource, Slice
from lumigraph.simulation import error

if TYPE_CHECKING:
    from lumigraph.simulation.coherence import PartiallyCoherent

AIRY = 1.22
REACH, FARTHER = 3.0, 1.8
"""Radii of a pixel's view to which two quadratures keep light's coherence for an error of 1e-2, and how many
more for a tenth of it: before the laboratory camera one quadrature was 1e-2 off at 2.9 radii, 1e-3 at 4.6."""

WIDER = (1.0, 1.6)
"""Factors of that reach, the second where the first misses the accuracy; the modes where both do."""


def view_radius(camera: CameraOptics, distance: float) -> float | None:
    """Radius of what a pixel sees at a distance from the main lens [m]; None where the lens has no image."""
    power = sum(1 / element.focal_length for element in camera.lens.elements if isinstance(element, ThinLens))
    if not power > 1 / distance:
        return None
    image = 1 / (power - 1 / distance)
    spots = [AIRY * camera.wavelength * image / camera.pupil_diameter]
    array, b = camera.array, camera.lenslet_distance
    if array is not None and b is not None:
        focal, relay = np.asarray(array.focal_length, float), camera.separation - image
        pitch = array.lattice.pitch
        spots.append(AIRY * camera.wavelength * abs(relay) / (pitch * array.fill_factor))
        spots.append(float(np.abs(1 - relay * (1 / focal - 1 / b)).max()) * pitch / 2)
    return math.hypot(*spots) * distance / image


def in_lamp_light(
    camera: CameraOptics, part: Slice, light: "PartiallyCoherent", accuracy: float, progress: Progress
) -> tuple[np.ndarray, error.ReachedError] | None:
    """Image of a slice (ny, nx) in a lamp's light, and its error; None where modes serve better.

    Parameters
    ----------
    camera, part
        Any that `operators.periodic.coherent` follows.
    light
        The lamp, and how far off its image may be.
    accuracy
        Of the lenslets' quadratures.
    progress
        Told the number of waves, their memory and time, first.
    """
    source, radius = light.source, view_radius(camera, camera.object_distance + part.dz)
    if not isinstance(source, ExtendedSource) or radius is None:
        return None
    for wider in WIDER:
        reach = wider * radius * max(1.0, REACH - FARTHER * math.log10(light.accuracy / 1e-2))
        counts = [source.wave_count(reach, camera.wavelength, -part.dz, more) for more in (0, 1)]
        if sum(counts) >= source.mode_count(part.grid, camera.wavelength, -part.dz):
            return None
        free = memory.available()
        if free is not None and 24 * max(counts) * math.prod(part.grid.shape) > free:
            return None
        progress(Stage(0.0, f"{sum(counts)} waves of the source"))
        image, off = _mean(camera, (part, source, reach), accuracy, progress)
        if off <= light.accuracy:
            told = f", {sum(counts)} waves of the source, coherent over {reach * 1e6:.3g} µm of the object"
            reached = error.of_quadrature("coherent", accuracy).through(camera)
            return image, reached.and_also(off, told)
    return None


def _mean(
    camera: CameraOptics, lit: tuple[Slice, ExtendedSource, float], accuracy: float, progress: Progress
) -> tuple[np.ndarray, float]:
    """Mean image (ny, nx) of two quadratures of a source with some reach [m], and its relative error."""
    part, source, reach = lit
    amplitude, images = np.sqrt(arrays.to_numpy(part.intensity)).astype(np.float32), []
    for more in (0, 1):
        light = amplitude * source.waves(part.grid, camera.wavelength, -part.dz, reach, more)
        told = share(progress, more, 2)
        images.append(coherent_image(camera, light, part.grid, part.dz, accuracy, told, times=2 - more))
    image = (images[0] + images[1]) / 2
    return image, error.norm(images[0] - images[1]) / 2 / (error.norm(image) or 1.0)
