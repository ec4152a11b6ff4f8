"""Light through slices that delay it: a thin lens, Born's orders, energy, and other steps."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope.multislice import Multislice
from lumigraph.units import nm, um

WAVE = 525 * nm
K = 2 * np.pi / WAVE


def directions(aperture, count=15):
    """n sin θ along y and x (rows, nodes), and which lie in the aperture."""
    q = np.linspace(-aperture, aperture, count)
    qy, qx = np.meshgrid(q, q, indexing="ij")
    return qy, qx, np.hypot(qy, qx) <= aperture


def test_a_slice_with_the_phase_of_a_lens_moves_the_focus():
    grid, away, focal = lg.Grid.square(61, 1 * um), 40 * um, 400 * um
    lens = lg.Medium(-(grid.y[:, None] ** 2 + grid.x**2)[None] / (2 * focal), grid, (-away,))
    light = Multislice(Objective(WAVE, 0.1, 1.0), lens, 0.0)
    qy, qx, inside = directions(0.1)
    factor = light.factor(0.0, 0.0, qy, qx)
    seen_from = 1 / (1 / away - 1 / focal)  # the lens shows the point farther, and larger
    assert abs(factor[7, 7]) == pytest.approx(seen_from / away, rel=1e-3)
    moved = np.exp(1j * K * (np.sqrt(1 - qy**2 - qx**2) - 1) * (seen_from - away))
    assert np.abs(moved - 1)[inside].max() > 0.2
    np.testing.assert_allclose((factor / factor[7, 7])[inside], moved[inside], atol=4e-3)


def test_a_weak_grating_sends_borns_two_orders():
    aperture, n, height, period, away = 0.5, 1.33, 2 * nm, 3 * um, 20 * um
    grid = lg.Grid.square(400, 0.15 * um)
    path = height * np.cos(2 * np.pi * grid.x / period) * np.ones((400, 1))
    light = Multislice(Objective(WAVE, aperture, n), lg.Medium(path[None], grid, (-away,)), 0.0)
    qy, qx, inside = directions(aperture)

    def arrived(at):
        along = np.sqrt(n * n - qy**2 - at**2)
        return np.exp(1j * K * along * away) / along

    orders = arrived(qx - WAVE / period) + arrived(qx + WAVE / period)
    born = 1j * K * height / 2 * orders / arrived(qx)
    found = light.factor(0.0, 0.0, qy, qx) - 1
    second = (K * height) ** 2
    assert np.abs(found - born)[inside].max() < second  # 5.7e-4; the orders have 2.4e-2
    assert np.abs(born)[inside].max() > 40 * second


def bead(depths, grid):
    """Refractive index of a soft ball, less the sample's, at some depths."""
    squared = grid.y[:, None] ** 2 + grid.x**2 + (np.asarray(depths)[:, None, None] + 6 * um) ** 2
    return 0.03 / (1 + np.exp((np.sqrt(squared) - 4 * um) / (0.4 * um)))


def planes(count):
    return -6 * um + ((np.arange(count) + 0.5) / count - 0.5) * 12 * um


def test_slices_that_only_delay_keep_the_light():
    grid = lg.Grid.square(80, 0.4 * um)
    medium = lg.Medium.of_index(lg.Volume(bead(planes(6), grid), grid, tuple(planes(6))))
    seen, plain = Multislice(Objective(WAVE, 0.4, 1.33), medium, 4 * um).light(0.5 * um, 0.0)
    assert np.abs(seen - plain).max() > 0.1 * np.abs(plain).max()
    assert (np.abs(seen) ** 2).sum() == pytest.approx((np.abs(plain) ** 2).sum(), rel=1e-6)


def by_halved_steps(aperture, n, count, place, dz, q):
    """Factor of the pupil along qx, by other samples, steps and transforms than the product's."""
    pitch, samples = 0.13 * um, 320
    at = (np.arange(samples) - samples / 2) * pitch
    f = np.fft.fftfreq(samples, pitch)
    squared = (WAVE * f[:, None]) ** 2 + (WAVE * f) ** 2
    along = np.sqrt(np.maximum(n * n - squared, 0))
    limit = 0.5 * (1 + np.cos(np.pi * np.clip((np.sqrt(squared) - aperture - 0.35) / 0.15, 0, 1)))
    shifted = np.exp(-2j * np.pi * np.add.outer(f, f) * at[0])
    spectrum = [np.where(along > 0.3, limit / np.maximum(along, 0.3), 0) / shifted] * 2
    depths, above = planes(count)[::-1], dz
    step = 12 * um / count
    for depth in depths:
        go = np.exp(1j * K * along * (above - depth))
        spectrum = [one * go for one in spectrum]
        y, x, z = at[:, None] + place[0], at + place[1], depth + 6 * um
        index = 0.03 / (1 + np.exp((np.sqrt(y**2 + x**2 + z**2) - 4 * um) / (0.4 * um)))
        spectrum[0] = np.fft.fft2(np.fft.ifft2(spectrum[0]) * np.exp(1j * K * index * step))
        above = depth
    fields = [np.fft.ifft2(one) for one in spectrum]
    waves = np.exp(-1j * K * np.outer(q, at))
    seen, plain = (waves @ field @ waves.T for field in fields)
    return seen / plain


def test_slices_are_off_by_no_more_than_independent_ones_of_half_the_step():
    grid, place, dz = lg.Grid.square(120, 0.2 * um), (0.5 * um, -1 * um), 4 * um
    qy, qx, inside = directions(0.4, 9)
    expected = by_halved_steps(0.4, 1.33, 24, place, dz, qy[:, 0])
    off = []
    for count in (6, 12):
        medium = lg.Medium.of_index(lg.Volume(bead(planes(count), grid), grid, tuple(planes(count))))
        found = Multislice(Objective(WAVE, 0.4, 1.33), medium, dz).factor(*place, qy, qx)
        off.append(np.linalg.norm((found - expected)[inside]) / np.linalg.norm(expected[inside]))
    assert off[0] < 0.03
    assert off[1] < 1e-3  # half the step: a quarter at least
    assert np.linalg.norm((expected - 1)[inside]) > np.linalg.norm(expected[inside])


def test_what_cannot_be_followed_is_refused():
    grid = lg.Grid.square(8, 1 * um)
    with pytest.raises(lg.GeometryError, match=r"paths have shape \(2, 8, 8\) but must be"):
        lg.Medium(np.zeros((2, 8, 8)), grid, (0.0,))
    with pytest.raises(lg.GeometryError, match="depths must differ"):
        lg.Medium(np.zeros((2, 8, 8)), grid, (0.0, 0.0))
    with pytest.raises(lg.GeometryError, match="two planes at least"):
        lg.Medium.of_index(lg.Volume(np.zeros((1, 8, 8)), grid, (0.0,)))
    far = lg.Medium(np.zeros((1, 8, 8)), grid, (-2e-3,))
    with pytest.raises(lg.SamplingError, match=r"a point 2000 µm behind .* takes \d+ x \d+ samples; 3072"):
        Multislice(Objective(WAVE, 0.5, 1.33), far, 0.0)
