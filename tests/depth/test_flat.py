"""Raw images of cameras 2.0 between their pixels."""

import numpy as np
import pytest

from lumigraph.depth.flat import Flat


def test_a_fine_wave_is_read_between_pixels():
    """Linearly it is off by 0.20 of its height between two pixels, by cubic splines by 0.02."""
    wave = np.cos(1.3 * np.arange(60))[:, None] * np.cos(0.9 * np.arange(50))
    flat = Flat(wave.astype(np.float32), 10.0, 10.0, np.ones(1))
    y, x = np.arange(119) / 2, np.arange(99) / 2
    true = np.cos(1.3 * y)[:, None] * np.cos(0.9 * x)
    assert flat.finer.shape == true.shape
    assert flat.finer[::2, ::2] == pytest.approx(flat.image)
    assert np.abs(flat.finer - true)[10:-10, 10:-10].max() < 0.03
