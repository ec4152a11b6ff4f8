"""A vesicle under a light-field microscope: one noisy exposure, and the volume that it shows."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.samples.files import camera_path
from lumigraph.units import um

ACCURACY = 1e-2
"""Relative rms error of a point's image; photon noise is larger."""


@dataclass(frozen=True, slots=True, eq=False)
class VolumeSample:
    """Recording of a microscope, and the volume that it shows.

    Parameters
    ----------
    camera
        20x/0.5, lenslets of 125 um.
    samples_per_lenslet
        Samples of the volume, for ``camera.operator(volume.depths, samples_per_lenslet, accuracy=1e-2)``.
    volume
        Truth (z, y, x) [photons].
    raw
        The exposure, with photon noise.
    """

    camera: LightFieldMicroscope
    samples_per_lenslet: int
    volume: Volume
    raw: RawImage


def volume(photons: float = 200.0, *, seed: int = 1) -> VolumeSample:
    """A spherical shell of 40 um across, 16 to 64 um beyond the focused plane, and its raw image.

    Some seconds on two cores, most of them for the operator.

    Parameters
    ----------
    photons
        Brightness of the shell; less of it is noisier.
    seed
        Seed of the noise.

    Raises
    ------
    LumigraphError
        Photons not above zero.
    """
    checks.positive("photons", photons, "1")
    with camera_path("microscope") as path:
        camera = LightFieldMicroscope.from_toml(path)
    depths = tuple(z * um for z in range(16, 65, 8))
    operator = camera.operator(depths, 3, accuracy=ACCURACY)
    grid = operator.object_grid
    assert grid is not None
    radius = np.sqrt((np.array(depths)[:, None, None] - 40 * um) ** 2 + grid.y[:, None] ** 2 + grid.x**2)
    shell = (photons * np.exp(-(((radius - 20 * um) / (2 * um)) ** 2))).astype(np.float32)
    counts = np.random.default_rng(seed).poisson(np.maximum(operator.forward(shell), 0) + 1)
    raw = RawImage(counts.astype(np.float32), camera.sensor.pixel_pitch)
    return VolumeSample(camera, 3, Volume(shell, grid, depths), raw)
