import math

import numpy as np
import pytest

from lumigraph import analysis
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError, LumigraphError
from lumigraph.scene.sources import gaussian_beam
from lumigraph.units import mm, nm, um

GRID = Grid((90, 100), (10 * um, 9 * um), (30 * um, 0.0))
WAVELENGTH, WAIST = 500 * nm, 60 * um


def beam(distance=0.0):
    return gaussian_beam(GRID, WAVELENGTH, WAIST, distance)


def test_a_gaussian_beam_is_as_wide_and_divergent_as_its_waist_says():
    for distance in (0.0, 20 * mm):
        light = beam(distance)
        width = WAIST / 2 * math.hypot(1, distance * WAVELENGTH / (math.pi * WAIST**2))
        assert analysis.beam_width(light) == pytest.approx((width, width), rel=1e-6)
        angle = WAVELENGTH / (2 * math.pi * WAIST)
        assert analysis.divergence(light) == pytest.approx((angle, angle), rel=1e-6)
        assert analysis.beam_quality(light) == pytest.approx((1.0, 1.0), rel=1e-6)
        assert analysis.overall_coherence(light) == pytest.approx(1.0)


def test_neither_place_nor_tilt_counts():
    tilt = np.exp(2j * np.pi * 0.004 * GRID.y[:, None] / WAVELENGTH)
    shifted = Field(beam().data * tilt, Grid(GRID.shape, GRID.pitch, (-1 * mm, 2 * mm)), WAVELENGTH)
    assert analysis.beam_width(shifted) == pytest.approx((WAIST / 2,) * 2, rel=1e-6)
    assert analysis.beam_quality(shifted) == pytest.approx((1.0, 1.0), rel=1e-6)


def test_two_beams_that_do_not_interfere_have_the_coherence_of_their_overlap():
    """Modes of powers 3 and 1 without overlap: (9 + 1) / 16."""
    data = np.zeros((2, *GRID.shape))
    data[0, :, :50], data[1, :, 50:] = math.sqrt(3), 1
    light = CoherentModes(Field(data, GRID, WAVELENGTH))
    assert analysis.overall_coherence(light) == pytest.approx(10 / 16)
    degree = analysis.degree_of_coherence(light, (0.0, 100 * um))
    np.testing.assert_allclose(degree, np.broadcast_to(np.arange(100) >= 50, GRID.shape), atol=1e-12)


def test_the_phase_of_the_degree_of_coherence_is_that_towards_the_place():
    tilt = np.exp(2j * np.pi * 0.004 * GRID.x / WAVELENGTH)
    degree = analysis.degree_of_coherence(beam() * tilt, (0.0, 45 * um))
    expected = np.exp(2j * np.pi * 0.004 * (GRID.x - 45 * um) / WAVELENGTH)
    np.testing.assert_allclose(degree[40], expected, atol=1e-9)


def test_what_has_no_measure_is_refused():
    dark = Field(np.zeros(GRID.shape), GRID, WAVELENGTH)
    for measure in (analysis.beam_width, analysis.divergence, analysis.overall_coherence):
        with pytest.raises(LumigraphError, match="there is no light"):
            measure(dark)
    with pytest.raises(GeometryError, match=r"at \(x\) is 0.01 m but the grid reaches from"):
        analysis.degree_of_coherence(beam(), (0.0, 0.01))
    with pytest.raises(LumigraphError, match=r"no light at \(0, 0\) m"):
        analysis.degree_of_coherence(beam() * (GRID.x > 50 * um))
    both = CoherentModes([beam(), gaussian_beam(GRID, 600 * nm, WAIST)])
    with pytest.raises(LumigraphError, match="2 wavelengths but M² is that of one"):
        analysis.beam_quality(both)
    with pytest.raises(LumigraphError, match="light is of type ndarray"):
        analysis.beam_width(np.ones((3, 3)))  # type: ignore[arg-type]  # it is refused
