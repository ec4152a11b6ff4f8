"""A bench with a plenoptic camera: white image and raw image of three targets at three depths."""

from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress, within
from lumigraph.core.raw import RawImage
from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.samples.files import camera_path
from lumigraph.scene import Scene, targets
from lumigraph.simulation import Incoherent, simulate
from lumigraph.units import mm

DEPTHS = {"plenoptic": (-14 * mm, 0.0, 18 * mm), "focused-plenoptic": (-4 * mm, 0.0, 5 * mm)}
"""Depths of the near, the middle and the far target, from the focused plane [m]."""

ACCURACY = 2e-3
"""Accuracy of the images: parabolic lenslets as fast as these, f/35, are off by 1.1e-3; noise is more."""

_CLASSES = {"plenoptic": PlenopticCamera, "focused-plenoptic": FocusedPlenopticCamera}


@dataclass(frozen=True, slots=True, eq=False)
class BenchSample:
    """Recording of a camera, and the scene that stood before it.

    Parameters
    ----------
    camera
        1.0 or 2.0.
    scene
        A fine star in front (left), a USAF-1951 chart in focus (middle), a coarse star behind (right).
    depths
        Depths of the three, from the focused plane [m], positive farther.
    white, raw
        Images of a diffuser and of the scene, with photon and read noise.
    """

    camera: PlenopticCamera | FocusedPlenopticCamera
    scene: Scene
    depths: tuple[float, float, float]
    white: RawImage
    raw: RawImage


def bench(kind: str = "plenoptic", *, seed: int = 1, progress: Progress | None = None) -> BenchSample:
    """Simulated pictures of a small plenoptic camera on a bench, to calibrate, decode and refocus.

    Wave optics, incoherent light; some ten seconds on two cores.

    Parameters
    ----------
    kind
        "plenoptic" (1.0) or "focused-plenoptic" (2.0).
    seed
        Seed of the sensor's noise.
    progress
        Called as ``progress(fraction)``, a `core.progress.Stage`.

    Raises
    ------
    LumigraphError
        Another kind.
    """
    checks.choice("kind", kind, DEPTHS)
    with camera_path(kind) as path:
        camera = _CLASSES[kind].from_toml(path)
    scene, rng = three_depths(camera.object_grid, DEPTHS[kind]), np.random.default_rng(seed)
    coherence = Incoherent(accuracy=ACCURACY)
    light = simulate(camera, targets.white(), coherence, progress=within(progress, 0.0, 0.4, "white image"))
    white = camera.sensor.expose(light.data, rng=rng)
    light = simulate(camera, scene, coherence, progress=within(progress, 0.4, 1.0, "raw image"))
    return BenchSample(camera, scene, DEPTHS[kind], white, camera.sensor.expose(light.data, rng=rng))


def three_depths(grid: Grid, depths: tuple[float, float, float]) -> Scene:
    """A star in front (left), a chart in focus (middle) and a coarser star behind (right)."""
    width = grid.size[1]
    near = targets.siemens_star(grid, 16, 0.28 * width, (0.0, -0.31 * width)).at(depths[0])
    far = targets.siemens_star(grid, 12, 0.32 * width, (0.0, 0.32 * width)).at(depths[2])
    return near + _chart(grid).at(depths[1]) + far


def _chart(grid: Grid) -> Scene:
    """The coarsest group of the USAF-1951 chart that takes at most a third of the width."""
    group = 0
    while 16 * targets.bar_width(group, 1) >= 0.33 * grid.size[1]:
        group += 1
    return targets.usaf1951(grid, group)
