"""Round lenslets of a microscope: their series, and the light of a window of them."""

import numpy as np
import pytest
from scipy.special import j1

from lumigraph.operators.microscope.bench import round_series, transmission
from lumigraph.operators.microscope.cell import Lenslet
from lumigraph.operators.microscope.round_lenslets import LensletWindow

LENSLET = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 110e-6, is_round=True)
RNG = np.random.default_rng(4)


def numbers(*shape):
    return RNG.normal(size=shape) + 1j * RNG.normal(size=shape)


def test_the_series_of_a_disc_is_that_of_airys_rings():
    flat = Lenslet(125e-6, 1e12, 2.5e-3, 20.0, 110e-6, is_round=True)
    found, R = round_series(flat, 525e-9, 12), 0.44
    r = np.hypot(*np.meshgrid(*2 * [np.arange(-12, 13)])) + 1e-9
    assert np.allclose(found, R * j1(2 * np.pi * R * r) / r, rtol=0, atol=1e-9)


def test_the_series_of_a_lens_is_its_phase_within_a_disc():
    """Fewer chords than the phase turns asks for are off by 1e-2 and more."""
    n, finest = 1536, 10
    at = ((np.arange(n) + 0.5) / n - 0.5) * 125e-6
    r = np.hypot(at[:, None], at)
    inside = np.clip((55e-6 - r) / 125e-6 * n + 0.5, 0, 1)
    lens = inside * np.exp(-1j * np.pi * r**2 / (525e-9 * 2.5e-3))
    waves = np.exp(-2j * np.pi * np.outer(np.arange(-finest, finest + 1), at / 125e-6)) / n
    true = waves @ lens @ waves.T
    assert np.linalg.norm(round_series(LENSLET, 525e-9, finest) - true) < 5e-5 * np.linalg.norm(true)


@pytest.fixture(scope="module")
def window():
    cells, fine, margin = 5, 16, 20
    one = np.tile(transmission(LENSLET, 525e-9, 6, fine), (cells, cells))
    path = np.exp(-1j * 0.4 * np.fft.fftfreq(cells * fine, 1 / fine) ** 2)
    return LensletWindow(one, path, margin)


def test_light_goes_back_by_the_transpose(window):
    before, given = numbers(2, 80, 80), numbers(2, 40, 40)
    there = np.sum(window.forward(before) * given)
    assert np.sum(before * window.transposed(given)) == pytest.approx(there, rel=1e-12, abs=0)


def test_slopes_by_lenslets_and_path_are_those_of_differences(window):
    before, given, h = numbers(2, 80, 80), numbers(2, 40, 40), 1e-6
    by_lenslets, by_path = window.slopes(before, given)
    for name, own, by in (("lenslets", window.lenslets, by_lenslets), ("path", window.path, by_path)):
        change = numbers(*own.shape)
        change += np.flip(np.roll(change, -1), 0) if name == "path" else 0  # even, as `path` is
        ends = (
            LensletWindow(**{**given_of(window), name: own + s * h * change}).forward(before) for s in (1, -1)
        )
        high, low = (np.sum(end * given) for end in ends)
        assert np.sum(by * change) == pytest.approx((high - low) / (2 * h), rel=1e-6, abs=0)
        moved = window.changed(before, **{"lenslets": 0.0, "path": 0.0, name: change})
        assert np.sum(moved * given) == pytest.approx(np.sum(by * change), rel=1e-9, abs=0)


def given_of(window):
    return {"lenslets": window.lenslets, "path": window.path, "margin": window.margin}
