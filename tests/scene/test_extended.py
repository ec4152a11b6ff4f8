"""Van Cittert and Zernike: light of extended sources against transforms and against sums over points."""

import math

import numpy as np
import pytest
from scipy.special import jv

from lumigraph import analysis
from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.elements import Train
from lumigraph.elements.masks import random_phase_mask
from lumigraph.errors import GeometryError, LumigraphError, SamplingError, SamplingWarning
from lumigraph.propagation import Propagate
from lumigraph.scene import ExtendedSource
from lumigraph.scene.sources import point_source
from lumigraph.units import mm, nm, um

WAVELENGTH = 633 * nm
K = 2 * math.pi / WAVELENGTH
GRID = Grid((40, 45), (9 * um, 8 * um), (20 * um, -30 * um))
SINE = 0.0035
"""The first zero of a disc's coherence is at 110 um, of a square's at 90 um."""


def far_apart(column=0):
    """Offsets of the middle row from one of its samples [m]."""
    return GRID.x - GRID.x[column]


def measured(light, column=0):
    """Degree of coherence of the middle row with a sample at its end: over the whole window."""
    return analysis.degree_of_coherence(light, (GRID.y[20], GRID.x[column]))[20]


@pytest.mark.parametrize("column", [0, 22])
def test_a_disc_gives_a_jinc(column):
    light = ExtendedSource.disc(SINE).modes(GRID, WAVELENGTH)
    t = np.maximum(np.abs(K * SINE * far_apart(column)), 1e-9)
    np.testing.assert_allclose(measured(light, column), 2 * jv(1, t) / t, atol=1e-3)
    np.testing.assert_allclose(light.intensity, 1, atol=light.error)
    assert light.error < 1e-3


@pytest.mark.parametrize("column", [0, 22])
def test_a_square_gives_a_sinc(column):
    light = ExtendedSource.rectangle(SINE).modes(GRID, WAVELENGTH)
    expected = np.sinc(2 * SINE * far_apart(column) / WAVELENGTH)
    np.testing.assert_allclose(measured(light, column), expected, atol=1e-3)


def test_the_masks_of_the_thesis_give_neither():
    """24 × 24 random areas on 128 × 128 samples: at best 0.20 off a jinc, 0.23 off a sinc."""
    grid, across = Grid((128, 128), 10 * um), np.arange(64)
    mutual = np.zeros(64)
    for rng in np.random.default_rng(1).spawn(60):
        wave = random_phase_mask(grid, WAVELENGTH, 24, rng)
        spectrum = np.abs(np.fft.fft(wave, 256, axis=1)) ** 2
        mutual += np.fft.ifft(spectrum, axis=1).sum(0)[:64].real / (128 - across)
    degree, t = mutual / mutual[0], np.maximum(across, 1e-9)
    for shape in (lambda w: 2 * jv(1, np.pi * t * w) / (np.pi * t * w), lambda w: np.sinc(t * w)):
        assert min(np.abs(shape(w) - degree).max() for w in np.linspace(0.1, 0.6, 60)) > 0.15


def test_a_picture_is_the_sum_of_spherical_waves_of_its_points():
    """Amplitudes, curvature and sides too: a picture without symmetry, at 0.2 m and 0.05 m farther."""
    rng, distance = np.random.default_rng(4), 0.2
    picture, sines = rng.random((3, 4)) ** 2, Grid((3, 4), (0.0012, 0.0009), (0.0008, -0.0011))
    light = ExtendedSource.picture(picture, sines, distance).modes(GRID, WAVELENGTH, 0.05)
    fine = (np.arange(16) + 0.5) / 16 - 0.5  # midpoints: off by 1e-4 of what a pixel's own size does
    mutual, at = np.zeros(GRID.shape, complex), (5, 40)
    for v, row in zip(sines.y, picture, strict=True):
        for u, bright in zip(sines.x, row, strict=True):
            for dv in fine * sines.pitch[0]:
                for du in fine * sines.pitch[1]:
                    place = (distance * (v + dv), distance * (u + du))
                    wave = point_source(GRID, WAVELENGTH, distance + 0.05, place, paraxial=True).data
                    mutual += bright * wave * wave[at].conj()
    data = light.fields[0].data
    found = np.einsum("nyx,n->yx", data, data[:, at[0], at[1]].conj())
    expected = mutual / (picture.sum() * 256) * distance**2
    np.testing.assert_allclose(found, expected, atol=1e-3 * 0.64)
    assert np.abs(found).max() == pytest.approx((0.2 / 0.25) ** 2, rel=2e-3)


def test_light_that_converges_is_seen_turned_over_behind_its_image():
    """Forth by the angular spectrum, or described there at once: behind the image, up is down."""
    grid = Grid((96, 96), 10 * um)
    picture, sines = np.array([[1.0, 0.0], [0.3, 0.0]]), Grid((2, 2), 0.002, (0.001, 0.0))
    source = ExtendedSource.picture(picture, sines, -20 * mm)
    there = source.modes(grid, WAVELENGTH, 40 * mm, accuracy=1e-2)
    assert there.intensity.mean() == pytest.approx(1, abs=0.01)
    tilt = analysis.degree_of_coherence(there, (0.0, 0.0))[48]
    flipped = ExtendedSource.picture(picture[::-1, ::-1], Grid((2, 2), 0.002, (0.001, 0.002)), 20 * mm)
    again = flipped.modes(grid, WAVELENGTH, accuracy=1e-2)
    np.testing.assert_allclose(tilt, analysis.degree_of_coherence(again, (0.0, 0.0))[48], atol=0.02)


def test_fringes_behind_two_pinholes_are_as_clear_as_the_light_is_coherent():
    """Young: two holes 64 um apart, 40 mm before the screen; visibility is the degree of coherence."""
    grid, apart = Grid((48, 320), 4 * um), 64 * um
    holes = np.zeros(grid.shape)
    holes[24, [160 - 8, 160 + 8]] = 1
    for sine in (0.001, 0.003):
        light = ExtendedSource.disc(sine).modes(grid, WAVELENGTH, dtype=np.complex64)
        screen = light.through(
            Train([lambda field: field * holes, Propagate(40 * mm, "fresnel", grid=Grid((1, 401), 2 * um))])
        )
        fringes, x = screen.intensity[0], screen.grid.x
        carrier = 2 * np.pi * x * apart / (WAVELENGTH * 40 * mm)
        basis = np.stack([np.ones_like(x), np.cos(carrier), np.sin(carrier)])
        mean, even, odd = np.linalg.lstsq(basis.T, fringes, rcond=None)[0]
        t = K * sine * apart
        assert even / mean == pytest.approx(2 * jv(1, t) / t, abs=1e-3)
        assert abs(odd / mean) < 1e-3


def test_a_point_is_one_mode_and_a_band_makes_every_sample_its_own():
    assert ExtendedSource.disc(1e-7).modes(GRID, WAVELENGTH).count == 1
    grid = Grid((5, 6), 4 * um)
    light = ExtendedSource.rectangle(WAVELENGTH / (2 * 4 * um)).sampled(grid, WAVELENGTH, 0.0, 1e-3, complex)
    data = light.fields[0].data.reshape(light.count, -1)
    np.testing.assert_allclose(data.T @ data.conj(), np.eye(30), atol=1e-3)
    assert light.count == 30
    assert analysis.overall_coherence(light) == pytest.approx(1 / 30, rel=2e-3)


@pytest.mark.parametrize("accuracy", [1e-1, 1e-2, 1e-4])
def test_the_error_bounds_what_is_missing_between_any_two_samples(accuracy):
    source = ExtendedSource.disc(SINE, 0.3)
    light = source.modes(GRID, WAVELENGTH, accuracy=accuracy)
    data = light.fields[0].data.reshape(light.count, -1)
    y, x = (c.ravel() for c in np.meshgrid(GRID.y, GRID.x, indexing="ij"))
    some = np.random.default_rng(1).integers(0, len(y), 60)
    found = data.T @ data[:, some].conj()
    t = np.maximum(K * SINE * np.hypot(y[:, None] - y[some], x[:, None] - x[some]), 1e-9)
    bend = K / 0.6 * ((y**2 + x**2)[:, None] - (y[some] ** 2 + x[some] ** 2))
    off = np.abs(found - 2 * jv(1, t) / t * np.exp(1j * bend)).max()
    assert off <= light.error <= accuracy
    assert light.error < 5 * off


def test_many_waves_are_taken_as_they_are(monkeypatch):
    from lumigraph.scene import extended

    few = ExtendedSource.disc(SINE, -0.1).modes(GRID, WAVELENGTH)
    monkeypatch.setattr(extended, "COMPRESSED", 3)
    many = ExtendedSource.disc(SINE, -0.1).modes(GRID, WAVELENGTH)
    assert many.count > few.count
    np.testing.assert_allclose(measured(many), measured(few), atol=1e-3)


def test_modes_that_do_not_fit_are_refused_with_the_accuracy_that_could_be_had(monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: 5 * 16 * 40 * 45)
    with pytest.raises(SamplingError, match=r"An accuracy of 0\.\d+ could be had"):
        ExtendedSource.disc(SINE).modes(GRID, WAVELENGTH)
    monkeypatch.undo()
    with pytest.raises(SamplingError, match="An accuracy of 1 could be had"):
        ExtendedSource.disc(0.5).modes(Grid((4000, 4000), 1 * um), WAVELENGTH)


def test_what_is_no_source_is_refused():
    with pytest.raises(GeometryError, match=r"radius is 1\.5 but is a sine"):
        ExtendedSource.disc(1.5)
    with pytest.raises(GeometryError, match=r"half_size \(x\) is 0"):
        ExtendedSource.rectangle((0.1, 0.0))
    with pytest.raises(GeometryError, match="the plane lies in the source"):
        ExtendedSource.disc(0.1, 0.0)
    with pytest.raises(GeometryError, match=r"shape \(2, 2\) but its sines \(3, 3\)"):
        ExtendedSource.picture(np.ones((2, 2)), Grid((3, 3), 0.1))
    for bad in (-np.ones((2, 2)), np.zeros((2, 2)), 1j * np.ones((2, 2))):
        with pytest.raises(LumigraphError, match="must be real, at least 0"):
            ExtendedSource.picture(bad, Grid((2, 2), 0.1))
    with pytest.raises(GeometryError, match="it lies in the source"):
        ExtendedSource.disc(0.01, -0.1).modes(GRID, WAVELENGTH, 0.1)
    with pytest.raises(GeometryError, match="accuracy is 2 but"):
        ExtendedSource.disc(0.01).modes(GRID, WAVELENGTH, accuracy=2)


def test_directions_that_samples_cannot_tell_warn():
    with pytest.warns(SamplingWarning, match="light of the source reaches sin"):
        light = ExtendedSource.disc(0.05).modes(Grid((8, 8), 9 * um), WAVELENGTH)
    assert isinstance(light, CoherentModes)
