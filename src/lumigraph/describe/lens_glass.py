"""Rows of a camera's table on the glass of its main lens."""

import math
from collections.abc import Iterator

import numpy as np

from lumigraph.instruments.camera import Camera
from lumigraph.instruments.description import Row
from lumigraph.instruments.glass import MARGIN, LensGlass


def rows(camera: Camera) -> Iterator[Row]:
    """Rows on the source and size of the aberrations; none without a prescription."""
    glass = camera.glass
    if glass is None or camera.traced is None or camera.main_lens.prescription is None:
        return
    first, wavelength, far = glass.first_order, camera.wavelength, glass.aberrations.x[-1] / MARGIN
    yield Row("prescription", camera.main_lens.prescription.name, "", "ray traced by Optiland")
    yield Row("focal length of the glass", first.focal_length, "m", "at the wavelength")
    yield Row("entrance pupil", glass.entrance_pupil, "m", "D (m_p + m) / (m_p (1 + m)), the same aperture")
    yield Row("widest entrance pupil", first.widest, "m", "of the prescription")
    yield Row("pupil magnification", first.pupil_magnification, "", "m_p")
    yield Row("exit pupil", first.exit_pupil, "m", "e', behind the rear principal plane")
    yield Row("exit pupil to lenslets", camera.pupil_distance, "m", "L' = L - e'; to the sensor without them")
    yield Row("refocused by", glass.defocus, "m", "paraxial image to the least rms wavefront on the axis")
    for part, name in ((0.0, "on the axis"), (0.5, "half-way out"), (1.0, "farthest out")):
        source = f"at {math.degrees(math.atan(part * far)):.3g} deg, tilt left out"
        yield Row(f"wavefront {name}", glass.rms(part * far, wavelength), "waves rms", source)
    yield Row(
        "left by the fit", glass.left / wavelength, "waves rms", "of rays, Zernike terms leave at worst"
    )
    yield Row("between fields", glass.between / wavelength, "waves rms", "at most, by fields twice as coarse")
    yield Row("rim from its ellipse", glass.rim, "", "of the stop as the image sees it, over its radius")
    along, across = glass.openings.at(far, wavelength)
    yield Row("stop farthest out", along * across, "", "its area as the image sees it, over the round one's")
    yield Row("distortion", _moved(camera, glass), "px", "at most, on the main lens' image, outwards")
    if camera.lenslet_distance:
        aside = _largest(camera.traced.lean) * camera.lenslet_distance / camera.pixels.pixel_pitch
        yield Row(
            "micro-images aside", aside, "px", "at most, outwards from where the exit pupil's middle is"
        )


def _moved(camera: Camera, glass: LensGlass) -> float:
    """Distortion at worst, on the main lens' image [px of the sensor]."""
    return _largest(glass.moved) / camera.pixels.pixel_pitch


def _largest(values: np.ndarray) -> float:
    return float(values[np.argmax(np.abs(values))])
