"""A double helix under a light-field microscope: one exposure, and the volume found in it."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.deconvolution import deconvolve
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.samples.files import camera_path
from lumigraph.units import um

LENSLETS, SAMPLES = (13, 13), 4
DEPTHS = tuple(z * um for z in range(16, 65, 6))
RADIUS, THICKNESS = 22 * um, 3 * um
TURNS = 0.6
PHOTONS = 300.0
ACCURACY = 1e-2
ITERATIONS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Helix:
    """Recording of a microscope, and the volume found in it.

    Parameters
    ----------
    camera
        20x/0.5, the samples' microscope with more lenslets.
    raw
        The exposure, with photon noise.
    truth, found
        Volumes (z, y, x).
    """

    camera: LightFieldMicroscope
    raw: RawImage
    truth: Volume
    found: Volume


def helix(*, seed: int = 1) -> Helix:
    """Double helix, 16 to 64 um beyond the focused plane, exposed and deconvolved."""
    with camera_path("microscope") as path:
        camera = LightFieldMicroscope.from_toml(path).replace(lenslets={"count": LENSLETS})
    operator = camera.operator(DEPTHS, SAMPLES, accuracy=ACCURACY)
    truth = _painted(operator)
    counts = np.random.default_rng(seed).poisson(np.maximum(operator.forward(truth.data), 0) + 1)
    raw = RawImage(counts.astype(np.float32), camera.sensor.pixel_pitch)
    found = deconvolve(raw, operator, ITERATIONS)
    assert isinstance(found, Volume)  # as the depths are a sequence
    return Helix(camera, raw, truth, found)


def _painted(operator: Linear) -> Volume:
    """Two strands, half a turn apart."""
    grid = operator.object_grid
    assert grid is not None  # a microscope's operator has one
    z = np.array(DEPTHS)[:, None, None]
    strands = np.zeros(operator.shape[1], np.float32).reshape(len(DEPTHS), *grid.shape)
    for at, way in _places():
        for part in (1.0, -1.0):
            strands += _bead(z, grid, at, part * RADIUS * way)
    return Volume((PHOTONS * np.minimum(strands, 1)).astype(np.float32), grid, DEPTHS)


def _places() -> list[tuple[float, np.ndarray]]:
    """Depths [m] and directions (y, x) of the first strand."""
    part = np.linspace(0, 1, 60)
    angles = 2 * np.pi * TURNS * part
    depths = DEPTHS[0] + part * (DEPTHS[-1] - DEPTHS[0])
    return [(z, np.array((np.sin(a), np.cos(a)))) for z, a in zip(depths, angles, strict=True)]


def _bead(z: np.ndarray, grid: Grid, depth: float, place: np.ndarray) -> np.ndarray:
    squares = (z - depth) ** 2 + (grid.y[:, None] - place[0]) ** 2 + (grid.x - place[1]) ** 2
    return np.exp(-squares / THICKNESS**2).astype(np.float32)
