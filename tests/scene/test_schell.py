"""A Gaussian-Schell source against its closed forms, through free space and lenses."""

import math

import numpy as np
import pytest

from lumigraph import analysis
from lumigraph.core import memory
from lumigraph.core.grid import Grid
from lumigraph.elements import ThinLens, Train
from lumigraph.errors import GeometryError, SamplingError, SamplingWarning
from lumigraph.propagation import Propagate
from lumigraph.scene import GaussianSchell
from lumigraph.units import mm, nm, um

WAVELENGTH = 633 * nm
K = 2 * math.pi / WAVELENGTH
GRID = Grid((96, 120), (16 * um, 13 * um))
WIDTH, COHERENCE = 110 * um, 90 * um
SOURCE = GaussianSchell(WIDTH, COHERENCE)
SPREAD = math.sqrt(1 / (4 * WIDTH**2) + 1 / COHERENCE**2) / K
"""Of directions, rms (Friberg and Sudol)."""


@pytest.fixture(scope="module")
def light():
    return SOURCE.modes(GRID, WAVELENGTH)


def test_the_mutual_intensity_is_that_of_the_model(light):
    """Between all samples of the middle row and one aside, and over a column; 1e-3 is asked for."""
    assert light.error <= 1e-3
    data, (row, column) = light.fields[0].data, (48, 66)
    mutual = np.einsum("nyx,n->yx", data, data[:, row, column].conj())
    squares = (GRID.y[:, None] ** 2 + GRID.x**2) + GRID.x[column] ** 2
    apart = GRID.y[:, None] ** 2 + (GRID.x - GRID.x[column]) ** 2
    expected = np.exp(-squares / (4 * WIDTH**2) - apart / (2 * COHERENCE**2))
    np.testing.assert_allclose(mutual, expected, atol=light.error)


@pytest.mark.parametrize("distance", [0.0, 60 * mm, -90 * mm])
def test_width_divergence_and_coherence_after_a_distance_are_the_closed_forms(light, distance):
    """Modes go by the band-limited angular spectrum; a coherent beam is 2.6 times less divergent."""
    behind = light.through(Propagate(distance))
    growth = math.hypot(1, distance * SPREAD / WIDTH)
    assert analysis.beam_width(behind) == pytest.approx((WIDTH * growth,) * 2, rel=1e-3)
    assert analysis.divergence(behind) == pytest.approx((SPREAD, SPREAD), rel=1e-3)
    assert SOURCE.width_after(distance, WAVELENGTH) == pytest.approx((WIDTH * growth,) * 2, rel=1e-12)
    assert SOURCE.divergence(WAVELENGTH) == pytest.approx((SPREAD, SPREAD), rel=1e-12)
    degree = np.abs(analysis.degree_of_coherence(behind)[48])
    near = np.abs(GRID.x) < 2.5 * WIDTH * growth  # beyond, next to no light is left to tell from
    expected = np.exp(-((GRID.x / (COHERENCE * growth)) ** 2) / 2)
    np.testing.assert_allclose(degree[near], expected[near], atol=5e-3)
    assert behind.power == pytest.approx(float(light.power), rel=1e-6)


def test_modes_at_a_distance_are_those_that_are_propagated_there(light):
    there = SOURCE.modes(GRID, WAVELENGTH, 50 * mm)
    behind = light.through(Propagate(50 * mm, pad=1.0))
    np.testing.assert_allclose(there.fields[0].data, behind.fields[0].data, atol=2e-5)


def test_beam_quality_is_kept_by_a_lens_and_inverse_to_the_overall_coherence(light):
    quality = 2 * K * WIDTH * SPREAD / 1
    focused = light.through(Train([ThinLens(80 * mm), Propagate(60 * mm)]))
    for there in (light, focused):
        assert analysis.beam_quality(there) == pytest.approx((quality, quality), rel=2e-3)
    assert SOURCE.beam_quality == pytest.approx((quality, quality))
    assert analysis.overall_coherence(light) == pytest.approx(1 / quality**2, rel=1e-3)


def test_axes_may_differ_and_be_coherent():
    source = GaussianSchell((80 * um, 120 * um), (math.inf, 60 * um))
    light = source.modes(GRID, WAVELENGTH)
    assert light.fields[0].data.shape[0] == light.count < 40  # along x alone
    assert analysis.beam_quality(light) == pytest.approx((1.0, math.hypot(1, 4)), rel=1e-3)
    assert analysis.beam_width(light) == pytest.approx((80 * um, 120 * um), rel=1e-3)
    assert GaussianSchell(80 * um, math.inf).modes(GRID, WAVELENGTH).count == 1


def test_a_better_accuracy_takes_more_modes_and_is_reached():
    counts = []
    for accuracy in (1e-1, 1e-2, 1e-4):
        light = SOURCE.modes(GRID, WAVELENGTH, accuracy=accuracy, dtype=np.complex64)
        counts.append(light.count)
        squared = (analysis.beam_width(light)[0] / WIDTH) ** 2
        assert accuracy / 30 < abs(1 - squared) < accuracy
        assert light.fields[0].data.dtype == np.complex64
    assert counts == sorted(counts)
    assert counts[0] < counts[2] / 3


def test_modes_that_do_not_fit_are_refused_with_the_accuracy_that_could_be_had(monkeypatch):
    many = GaussianSchell(WIDTH, 30 * um)
    monkeypatch.setattr(memory, "available", lambda: 100 * 16 * 96 * 120)
    with pytest.raises(SamplingError, match=r"An accuracy of 0\.\d+ could be had"):
        many.modes(GRID, WAVELENGTH)
    monkeypatch.undo()
    with pytest.raises(SamplingError, match="up to order 2"), pytest.warns(SamplingWarning):
        GaussianSchell((1 * mm, 1 * mm), (math.inf, 5 * um)).modes(GRID, WAVELENGTH)


def test_light_that_misses_the_window_or_the_samples_warns():
    with pytest.warns(SamplingWarning, match=r"0\.\d+ misses the window of 1\.5\d+ mm along [yx]"):
        GaussianSchell(500 * um, math.inf).modes(GRID, WAVELENGTH)
    with pytest.warns(SamplingWarning, match="is steeper than the sine of 0.0"):
        GaussianSchell(60 * um, 4 * um).modes(Grid((48, 60), 16 * um), WAVELENGTH, accuracy=0.2)


@pytest.mark.parametrize(
    ("width", "coherence", "told"),
    [
        (0.0, 1e-4, "width is 0 m but must be above 0"),
        (1e-4, -1.0, "coherence is -1 m"),
        (math.inf, 1e-4, "width is inf but must be a finite number"),
        ((1e-4, 1e-4, 1e-4), 1e-4, "width has 3 numbers"),
        (1e-4, math.nan, "coherence is nan"),
    ],
)
def test_what_is_no_source_is_refused(width, coherence, told):
    with pytest.raises(GeometryError, match=told):
        GaussianSchell(width, coherence)


def test_what_modes_cannot_be_sampled_to_is_refused():
    for accuracy in (0.0, 1.0, math.nan):
        with pytest.raises(GeometryError, match="accuracy is"):
            SOURCE.modes(GRID, WAVELENGTH, accuracy=accuracy)
    with pytest.raises(GeometryError, match="wavelength is 0"):
        SOURCE.modes(GRID, 0.0)
