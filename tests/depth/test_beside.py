"""Lenslets around places of a 2.0 picture, against the definition, place by place."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.depth.blurred import BlurLevels
from lumigraph.depth.flat import FlatImage
from lumigraph.depth.sightings import Sightings
from lumigraph.rendering.patches import Patches, PatchLayout

MOST, PITCH, EVEN = 0.1, 13.0, 5.2


@pytest.fixture
def sights(rng):
    shape, none = (110, 120), np.zeros((0, 2))
    calibration = Calibration(Lattice.square(PITCH, 0.02, (6, 7)), shape, none.astype(int), none, 0.0)
    flat = FlatImage(rng.random(shape).astype(np.float32), EVEN, EVEN, np.ones(1))
    return Sightings(flat, calibration, PatchLayout.of(calibration, Patches.of(4.0, calibration), None), None)


def differ(sights, y, x, size):
    """How much lenslets differ at a place, by the words of the docstring."""
    lattice, image = sights.calibration.lattice, sights.flat.image
    index = np.stack(np.meshgrid(np.arange(-2, 12), np.arange(-2, 12)), -1).reshape(-1, 2)
    center = lattice.position(index)
    whole = ((center >= PITCH / 2 - 1) & (center + PITCH / 2 <= image.shape)).all(1)
    away = (np.array([y, x]) - center[whole]) / PITCH
    seen = map_coordinates(image, (center[whole] - size * away).T, order=1, mode="nearest")
    distance = np.hypot(*away.T)
    weight = np.clip(EVEN - size * distance, 0, 1)
    near = np.argmax(weight / (1 + distance))
    off = np.minimum(np.abs(seen - seen[near]), MOST)
    weight[near] = 0
    total = 0
    for axis in (0, 1):
        sides = [weight * (side < 0.15) for side in (away[:, axis], -away[:, axis])]
        total += min(((w * off).sum() + 0.05 * 0.8 * MOST) / (w.sum() + 0.05) for w in sides)
    return total


def test_lenslets_differ_as_they_should(sights):
    sizes = np.array([2.2, 4.0, 6.5])
    blurred = sights.blurred(sizes)
    found = np.full((3, *sights.shape), np.nan)
    for rows, columns, part in sights.blocks:
        found[:, rows, columns] = part.disagreements(sizes, MOST, blurred)
    for row in (0, 9, sights.shape[0] - 1):
        for column in (0, 1, 14, sights.shape[1] - 1):
            at = sights.layout.y[row], sights.layout.x[column]
            true = [differ(sights, *at, size) for size in sizes]
            # Weights are read from a table of 64 to a pixel.
            assert found[:, row, column] == pytest.approx(true, rel=0.02)


def test_kinds_of_lenslets_are_blurred_as_the_most_blurred_one(rng):
    """At patches of 8 px kinds sharp at 7, 6 and 8.5 px spread over 1, 2 and 0.5 px, a quarter the sigma."""
    image, focus = rng.random((40, 50)).astype(np.float32), np.array([7.0, 6.0, 8.5])
    trust = np.array([0.5, 0.3, 1.0])
    blurred = BlurLevels.of(image, focus, [(8.0, trust)])
    at, kind = rng.uniform(5, 30, (2, 300)).astype(np.float32), rng.integers(0, 3, 300)
    found = blurred.read(list(at), kind, 8.0, trust)
    for number, sigma in enumerate(np.sqrt(0.5**2 - np.array([0.25, 0.5, 0.125]) ** 2)):
        here = kind == number
        true = map_coordinates(gaussian_filter(image, sigma), at[:, here], order=1)
        # Deviations are rounded to 0.02 px; without blur it is 0.1 off in the mean.
        assert np.abs(found[here] - true).mean() < 0.005


def test_of_one_kind_nothing_is_blurred(rng):
    image = rng.random((20, 30)).astype(np.float32)
    at = rng.uniform(2, 17, (2, 100)).astype(np.float32)
    found = BlurLevels.of(image, None, []).read(list(at), np.zeros(100, np.int8), 8.0, None)
    assert found == pytest.approx(map_coordinates(image, at, order=1), abs=1e-5)
