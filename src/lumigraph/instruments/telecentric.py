"""Cameras that show the white images of microscopes."""

from lumigraph.errors import GeometryError
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.microscope import LightFieldMicroscope
from lumigraph.instruments.plenoptic1 import PlenopticCamera

FAR = 10.0
"""Distance of a pupil that counts as infinitely far [m]."""


def white_camera(camera: Instrument) -> LensletCamera:
    """Camera whose white images a bench shows: itself, or one with the evenly lit pupil of a microscope.

    Raises
    ------
    GeometryError
        A camera without lenslets, or a Fourier microscope, whose white images are not discs on a lattice.
    """
    if isinstance(camera, LensletCamera):
        return camera
    if not isinstance(camera, LightFieldMicroscope) or camera.configuration == "fourier":
        what = "Fourier microscope" if isinstance(camera, LightFieldMicroscope) else camera.noun
        raise GeometryError(
            f"a {what} has no white images of micro-images on a lattice: its bench cannot be aligned. "
            "Give a plenoptic camera, or a light-field microscope of configuration '1.0' or '2.0'."
        )
    part, b, pixels = camera.lenslets, camera.lenslet_distance, camera.pixels
    lenslets = part.model_dump(exclude_defaults=True) | {"pitch": part.pitch / (1 + b / FAR)}
    native = {"pixel_pitch": pixels.pixel_pitch / camera.relay_magnification, "shape": camera.sensor.shape}
    table = {
        "wavelength": camera.wavelength, "object_distance": 1.0, "lenslets": lenslets,
        "main_lens": {"focal_length": 1 / (1 + 1 / FAR), "diameter": camera.pupil_diameter * FAR},
        "built": {"lenslet_distance": b}, "sensor": pixels.model_dump(exclude_defaults=True) | native,
    }  # fmt: skip
    return PlenopticCamera.model_validate(table)


def is_telecentric(camera: LensletCamera) -> bool:
    """True if its pupil is as if at infinity."""
    return camera.separation >= FAR / 2
