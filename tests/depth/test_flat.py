"""Raw images of cameras 2.0 between their pixels."""

import numpy as np
import pytest

from lumigraph.calibration.devignette import devignette
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.depth.flat import FlatImage
from lumigraph.preparation import prepare


def test_a_fine_wave_is_read_between_pixels():
    """Linearly it is off by 0.20 of its height between two pixels, by cubic splines by 0.02."""
    wave = np.cos(1.3 * np.arange(60))[:, None] * np.cos(0.9 * np.arange(50))
    flat = FlatImage(wave.astype(np.float32), 10.0, 10.0, np.ones(1))
    y, x = np.arange(119) / 2, np.arange(99) / 2
    true = np.cos(1.3 * y)[:, None] * np.cos(0.9 * x)
    assert flat.finer.shape == true.shape
    assert flat.finer[::2, ::2] == pytest.approx(flat.image)
    assert np.abs(flat.finer - true)[10:-10, 10:-10].max() < 0.03


def test_how_far_lenslets_are_lit_is_told_by_the_white_image_that_was_divided_out(rng):
    """Divided, the picture no longer shows it."""
    lattice = Lattice.square(20.0, 0.0, (9.5, 9.5))
    indices = lattice.indices((0, 199), (0, 239))
    calibration = Calibration(lattice, (200, 240), indices, lattice.position(indices), 0.0, fill=1.0)
    y, x = np.mgrid[:200, :240] % 20 - 9.5
    white = RawImage(np.clip(1.6 - np.hypot(y, x) / 10, 0.3, 1).astype(np.float32))  # even to 6 px
    light = white.data * (1 + 0.3 * rng.random((10, 12)).repeat(20, 0).repeat(20, 1))
    raw = RawImage(light.astype(np.float32))
    ready = prepare(raw, calibration, white=white)
    np.testing.assert_allclose(ready.divisor, white.data, rtol=1e-3)
    plain, known = FlatImage.of(raw, calibration), FlatImage.of(ready, calibration)
    assert known.even == pytest.approx(plain.even, abs=0.3) == pytest.approx(6.5, abs=0.8)
    assert known.image == pytest.approx(np.sqrt(ready.data / np.quantile(ready.data, 0.999)), rel=1e-4)
    assert FlatImage.of(devignette(raw, white), calibration).even > 8
    assert prepare(raw, calibration).divisor is None
    assert prepare(raw, calibration, white=white, divide=False).divisor is None
