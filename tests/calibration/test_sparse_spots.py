"""Bright spots on dark ground, as a stopped-down main lens leaves behind each lenslet."""

import time

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real
from lumigraph.calibration import calibrate
from lumigraph.core.lattice import Lattice


def drawn(lattice, size, width, *, jitter=0.0, noise=0.0, ground=0.0):
    """Picture (size, size) of 8 bits: spots drawn on whole pixels, as calibration targets are rendered."""
    rng = np.random.default_rng(0)
    centers = lattice.centers((-5, size + 5), (-5, size + 5))
    centers = centers + rng.normal(0, jitter, centers.shape)
    y, x = np.mgrid[:size, :size]
    picture = np.full((size, size), ground)
    for center in centers:
        picture[np.hypot(y - center[0], x - center[1]) < width / 2] = 200
    return np.clip(picture + 200 * noise * rng.standard_normal(picture.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("layout", "pitch", "width", "options"),
    [
        ("square", 20.367, 3.8, {"jitter": 0.3}),  # found half a pitch off
        ("hex", 20.367, 3.8, {"jitter": 0.3}),
        ("square", 29.6, 4.0, {"jitter": 0.2, "noise": 0.02, "ground": 20.0}),
        ("square", 14.2, 3.0, {"noise": 0.05}),
        ("hex", 25.0, 10.0, {"jitter": 0.3, "noise": 0.1}),
        ("square", 40.3, 3.0, {"jitter": 0.3}),
    ],
)
def test_spots_are_the_centres_not_the_places_between_them(layout, pitch, width, options):
    lattice = getattr(Lattice, layout)(pitch, 0.0, (7.3, 7.3))
    found = calibrate(lg.RawImage(drawn(lattice, 300, width, **options)))
    off = np.array(found.offset(*lattice.centers((12, 288), (12, 288)).T))
    assert found.lattice.layout == layout
    assert np.abs(off.mean(1)).max() < 0.1  # half a pitch is 7 px and more
    assert np.hypot(*off).max() < 0.3  # the jitter of single spots


def test_a_real_picture_of_ten_thousand_spots_takes_seconds():
    import tifffile

    white = tifffile.imread(real("lfit_particles", "SixCali.tif"))
    start, told = time.process_time(), []
    found = calibrate(white, progress=told.append)
    assert time.process_time() - start < 15  # 37 before, on the machine where it takes 7
    np.testing.assert_allclose(found.lattice.pitches, 29.601, atol=0.001)
    centers = np.rint(found.position(found.indices)).astype(int)
    assert white[tuple(centers.T)].mean() > 0.9 * white.max()
    assert told == sorted(told)
    assert len(told) > 5
