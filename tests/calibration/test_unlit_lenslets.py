"""Missing lenslets are dark ones; saturated ones are counted."""

import numpy as np

from calibration_drawing import sampled
from lumigraph.calibration import calibrate
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage


def test_a_lenslet_is_missing_for_its_darkness_not_for_its_place():
    """One dead, one half covered by dust, which moves its centre by more than four standard deviations."""
    lattice = Lattice.square(15.0, 0.01, (7.0, 7.0))
    white = sampled(lattice, (180, 200))
    y, x = np.mgrid[:180, :200]
    i, j = lattice.index(y, x)
    white[(i == 4) & (j == 5)] = 0
    _, dx = lattice.offset(y, x)
    white[(i == 7) & (j == 6) & (dx > -2)] *= 0.4
    found = calibrate(white)
    dead, dusty = (found.lattice.index(*lattice.position(np.array(at)))[:2] for at in ((4, 5), (7, 6)))
    assert found.missing.tolist() == [list(map(int, dead))]
    assert list(map(int, dusty)) not in found.indices.tolist()  # it is not fitted


def test_dark_places_of_a_scene_are_no_missing_lenslets(rng):
    """Half of the scene is dark; one lenslet is dead in the bright half."""
    lattice = Lattice.square(16.0, 0.0, (8.0, 8.0))
    raw = sampled(lattice, (320, 320), fill=0.85)
    y, x = np.mgrid[:320, :320]
    scene = np.where(x < 150, 0.01, 1.0) * (1 + 0.5 * np.sin(x / 7.3) * np.sin(y / 9.1))
    i, j = lattice.index(y, x)
    raw = raw * scene * ~((i == 9) & (j == 14)) + 0.01 + 0.001 * rng.standard_normal(raw.shape)
    found = calibrate(raw)
    dead = lattice.position(np.array([9, 14]))
    np.testing.assert_allclose(found.position(found.missing), [dead], atol=0.5)
    assert "missing     1 lenslets" in found.report()


def test_saturated_micro_images_are_counted():
    white = sampled(Lattice.square(15.0, 0.0, (7.0, 7.0)), (150, 150))
    found = calibrate(RawImage(np.uint8(255 * white), bit_depth=8))
    assert not len(found.missing)
    assert any("100 of 100 micro-images are saturated" in note for note in found.notes)
