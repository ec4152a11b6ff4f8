"""A few large micro-images, such as those of a Fourier microscope, drawn from their definition."""

import time

import numpy as np
import pytest

from lumigraph.calibration import calibrate
from lumigraph.core.lattice import Lattice

MIDDLE = (250.3, 247.7)


def drawn(lattice, count, fill, *, halo=0.0, stop=None, noise=0.0, soft=1.2):
    """White image (500, 500) of the discs nearest to the middle, and the centres of those not cut."""
    points = lattice.centers((-500, 1000), (-500, 1000))
    centers = points[np.argsort(np.hypot(*(points - MIDDLE).T).round(6), kind="stable")[:count]]
    y, x = np.mgrid[:500, :500].astype(float)
    radius, picture = fill * min(lattice.pitches) / 2, np.zeros((500, 500))
    for center in centers:
        away = np.hypot(y - center[0], x - center[1])
        disc = 1 / (1 + np.exp(np.clip((away - radius) / soft, -50, 50)))
        ring = halo * np.exp(-(((away - 1.25 * radius) / (0.1 * radius)) ** 2))
        picture = np.maximum(picture, np.maximum(disc, ring))
    if stop is not None:
        picture *= np.hypot(y - MIDDLE[0], x - MIDDLE[1]) < stop
        centers = centers[np.hypot(*(centers - MIDDLE).T) + radius < stop]
    return picture + noise * np.random.default_rng(0).standard_normal(picture.shape), centers


@pytest.mark.parametrize(
    ("layout", "count", "pitch", "fill", "options"),
    [
        ("hex", 7, 125, 0.92, {}),
        ("hex", 13, 110, 0.92, {}),
        ("hex", 19, 95, 0.92, {}),
        ("hex", 19, 95, 1.0, {}),
        ("hex", 19, 95, 0.92, {"halo": 0.3}),
        ("hex", 37, 85, 0.92, {"stop": 215}),
        ("hex", 19, 115, 1.0, {"stop": 220}),
        ("square", 9, 125, 1.0, {}),
        ("square", 13, 90, 1.0, {}),
        ("square", 21, 90, 0.7, {"noise": 0.02}),
    ],
)
def test_a_few_discs_are_found_by_their_edges(layout, count, pitch, fill, options):
    """The spectrum of so few has lines that are lenslets wide: it was half a per cent off."""
    lattice = getattr(Lattice, layout)(float(pitch), 0.02, MIDDLE)
    white, centers = drawn(lattice, count, fill, **options)
    start = time.process_time()
    found = calibrate(white)
    assert time.process_time() - start < 5
    places = found.position(found.indices)
    away = np.hypot(*(centers[:, None] - places).transpose(2, 0, 1)).min(1)
    assert found.lattice.layout == layout
    assert away.max() < 0.02
    assert found.lattice.cell_area == pytest.approx(lattice.cell_area, rel=5e-4)
    assert len(found.missing) == 0
    assert found.fill == pytest.approx(fill, abs=0.01)


def test_rectangular_discs_are_found_by_their_edges():
    lattice = Lattice.rectangular((90.0, 120.0), 0.1, MIDDLE)
    found = calibrate(drawn(lattice, 9, 0.9)[0])
    assert found.lattice.layout == "rectangular"
    np.testing.assert_allclose(found.lattice.pitches, (90, 120), atol=0.02)


def test_a_dark_one_among_a_few_discs_is_missing():
    lattice = Lattice.hex(95.0, 0.0, MIDDLE)
    white = drawn(lattice, 19, 0.9)[0]
    white[np.hypot(*(np.mgrid[:500, :500] - np.array(MIDDLE)[:, None, None])) < 47] = 0
    found = calibrate(white)
    np.testing.assert_allclose(found.position(found.missing), [MIDDLE], atol=0.02)
