"""Points and white images before lenslets against quadratures that share no code with them."""

from functools import cache

import numpy as np
import pytest
from benchmarks import references
from benchmarks.references import Fineness

import cameras
from lumigraph.instruments import PlenopticCamera
from lumigraph.scene import targets
from lumigraph.simulation import Incoherent, simulate
from lumigraph.units import mm, nm, um

SMALL = {"count": (3, 3), "pixel_pitch": 12 * um}
CAMERAS = {
    "2.0": cameras.focused(**SMALL),
    "Galilean": cameras.focused(magnification=-0.4, focal_length=8 * mm, **SMALL),
    "round": cameras.focused(shape="round", fill_factor=0.9, **SMALL),
    "three kinds": cameras.focused(layout="hex", focal_length=(5.2 * mm, 5.0 * mm, 5.4 * mm), **SMALL),
    "1.0": PlenopticCamera(
        wavelength=633 * nm,
        object_distance=240 * mm,
        main_lens={"focal_length": 120 * mm},
        lenslets={"pitch": 110 * um, "focal_length": 10 * mm, "count": (3, 3)},
        sensor={"pixel_pitch": 12 * um},
    ),
}
QUICK = Fineness(lenslet=40, pixel=3, pupil=500, spline=64)
"""Of the references: good to 2e-6 in the middle of these cameras."""


def relative(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)


DZ = 2 * mm


@cache
def expected(name):
    """Places in the middle, at the border and outside, and the raw images of points there."""
    camera = CAMERAS[name]
    distance = camera.object_distance + DZ
    step = camera.lenslets.pitch * distance / camera.separation
    places = [(0.1 * step, -0.23 * step), (1.3 * step, 0.2 * step), (0.3 * step, -2.9 * step)]
    light = np.prod(camera.object_grid.pitch) * (camera.separation / distance) ** 2
    return [
        (p, light * image)
        for p, image in zip(places, references.points(camera, DZ, places, QUICK), strict=True)
    ]


@pytest.mark.parametrize("name", CAMERAS)
def test_points_are_as_exact_as_asked_inside_at_the_border_and_outside(name):
    for accuracy in (1e-2, 1e-3, 1e-4) if name == "2.0" else (1e-2,):
        for place, reference in expected(name):
            raw = simulate(CAMERAS[name], targets.points([(*place, DZ)]), Incoherent(accuracy=accuracy))
            assert relative(raw.data, reference) < accuracy
            assert raw.metadata["error"]["rms"] <= accuracy


@pytest.mark.parametrize("name", ["2.0", "1.0"])
def test_a_white_image_is_as_exact_as_asked(name):
    """Twice as few places on the stop, or ones that do not end at its edge, miss it."""
    camera = CAMERAS[name].replace(sensor={"pixel_pitch": 20 * um})
    expected = references.white(camera, 36, QUICK)
    for accuracy in (1e-2, 1e-3, 1e-4):
        image = simulate(camera, targets.white(), Incoherent(accuracy=accuracy)).data
        assert relative(image, expected) < accuracy
