"""Spectral lines: fringes of two waves of which one comes a longer way."""

import math

import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.scene import ExtendedSource, SpectralLine
from lumigraph.simulation import Spectrum
from lumigraph.units import nm, um

PATHS = np.linspace(-400 * um, 400 * um, 4001)
GRID = Grid((1, len(PATHS)), 1 * um)


def interferometer(wavelength):
    """Two waves of amplitude 1, one of which came farther, by another way at each sample."""
    return Field((1 + np.exp(2j * np.pi * PATHS / wavelength))[None], GRID, wavelength)


@pytest.mark.parametrize("profile", ["gaussian", "even"])
def test_fringes_fade_as_the_line_is_wide(profile):
    """Against integrals over 20,000 wavelengths, by a sum; three wavelengths too few are 0.2 off."""
    line = SpectralLine(600 * nm, 0.8 * nm, profile)
    light = line.over(interferometer, 400 * um)
    width = 0.8 * nm / (600 * nm) ** 2
    numbers = np.linspace(-2.5, 2.5, 20_001) * width
    shape = (
        np.exp(-4 * math.log(2) * (numbers / width) ** 2)
        if profile == "gaussian"
        else np.where(np.isclose(np.abs(numbers), width / 2), 0.5, np.abs(numbers) < width / 2)
    )
    every = slice(None, None, 40)
    phase = np.exp(2j * np.pi * np.outer(PATHS[every], numbers))
    fade = (phase @ shape / shape.sum()).real
    expected = 2 + 2 * fade * np.cos(2 * np.pi * PATHS[every] / (600 * nm))
    np.testing.assert_allclose(light.intensity[0, every], expected, atol=2.5e-3)
    np.testing.assert_allclose([line.coherence(p) for p in PATHS[every]], fade, atol=2e-4)
    assert light.error <= 1e-3
    assert 3 < len(light.wavelengths) < 12


def test_errors_and_modes_of_a_source_are_kept():
    line, grid = SpectralLine(600 * nm, 1 * nm), Grid((20, 20), 10 * um)
    light = line.over(lambda wavelength: ExtendedSource.disc(0.003).modes(grid, wavelength), 100 * um)
    one = ExtendedSource.disc(0.003).modes(grid, 600 * nm)
    assert light.count > 2 * one.count
    assert light.error > one.error / 2 + line.nodes(100 * um)[2]
    np.testing.assert_allclose(light.intensity, 1, atol=1e-3)


def test_a_line_is_a_spectrum_of_a_camera():
    line = SpectralLine(600 * nm, 1 * nm, "even")
    spectrum = Spectrum.line(line, 500 * um)
    assert spectrum.wavelengths == pytest.approx(tuple(line.nodes(500 * um)[0]))
    assert sum(w[0] for w in spectrum.weights) == pytest.approx(1)
    assert min(spectrum.wavelengths) > 599.5 * nm
    assert max(spectrum.wavelengths) < 600.5 * nm


def test_too_long_a_way_is_refused_with_the_one_that_could_be_had():
    line = SpectralLine(600 * nm, 1 * nm)
    with pytest.raises(SamplingError, match=r"up to \d\d\.\d+ mm") as refused:
        line.nodes(1.0)
    held = float(str(refused.value).split("up to ")[1].split(" mm")[0]) * 1e-3
    assert line.nodes(0.9 * held)[2] <= 1e-3


def test_what_is_no_line_is_refused():
    with pytest.raises(GeometryError, match="width is 0 m"):
        SpectralLine(600 * nm, 0.0)
    with pytest.raises(GeometryError, match="that is no line"):
        SpectralLine(600 * nm, 130 * nm)
    with pytest.raises(GeometryError, match="profile is 'flat' but must be one of gaussian, even"):
        SpectralLine(600 * nm, 1 * nm, "flat")
    with pytest.raises(GeometryError, match="accuracy is 0"):
        SpectralLine(600 * nm, 1 * nm).nodes(1e-3, 0.0)
    with pytest.raises(GeometryError, match="must be a CoherentModes"):
        SpectralLine(600 * nm, 1 * nm).over(lambda wavelength: 3, 1e-3)  # type: ignore[return-value]  # it is refused


def test_short_ways_need_one_wavelength():
    light = SpectralLine(600 * nm, 1 * nm).over(interferometer, 1 * um)
    assert isinstance(light, CoherentModes)
    assert light.wavelengths == (pytest.approx(600 * nm),)
