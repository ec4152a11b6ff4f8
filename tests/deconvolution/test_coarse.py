"""Samples too coarse to explain a raw image are warned of, where the operator knows what is resolved."""

import warnings

import numpy as np
import pytest

import lumigraph as lg
from deconvolution.models import Matrix, blur
from lumigraph.core.grid import Grid
from lumigraph.deconvolution import Deconvolver, Exposure
from lumigraph.units import mm, nm, um

SCOPE = lg.LightFieldMicroscope(
    wavelength=525 * nm,
    objective={"magnification": 20.0, "numerical_aperture": 0.5},
    lenslets={"pitch": 125 * um, "focal_length": 2.5 * mm, "count": (3, 3)},
    sensor={"pixel_pitch": 6.5 * um},
)
CAMERA = lg.PlenopticCamera(
    wavelength=600 * nm,
    object_distance=300 * mm,
    main_lens={"focal_length": 200 * mm},
    lenslets={"pitch": 120 * um, "focal_length": 2.5 * mm, "count": (3, 3)},
    sensor={"pixel_pitch": 8 * um},
)
FINE, COUNTED = 24, Exposure(background=1.0, gain=1.0)
COUNTED_TOO_MUCH = Exposure(background=1.0, gain=30.0)


def seen_by(samples):
    """A blur of 24 samples of 1 µm along each axis, which resolves 1 µm, as an operator of fewer samples."""
    held = blur(FINE, 1.5) @ np.repeat(np.eye(samples), FINE // samples, 0)
    grid = Grid.square(samples, FINE / samples * um)
    whole = np.kron(held, held)
    return Matrix(whole, (FINE, FINE), (samples, samples), object_grid=grid, resolved_pitch=1 * um)


@pytest.fixture
def raw(rng):
    scene = 2000 * (rng.uniform(size=(FINE, FINE)) < 0.05) + 20.0
    return rng.poisson(seen_by(FINE).forward(scene) + 1).astype(float)


def test_coarse_samples_that_leave_more_than_noise_are_warned_of_with_numbers(raw):
    told = r"deviance of \d+.* per pixel, where noise leaves 1,.*4 µm apart.* of 1 µm.*4 times as many"
    with pytest.warns(lg.SamplingWarning, match=told):
        lg.deconvolve(raw, seen_by(6), 60, exposure=COUNTED)


def test_side_by_side_they_are_warned_of_too(raw):
    with pytest.warns(lg.SamplingWarning, match="times as many"):
        Deconvolver(seen_by(6), 60).several([raw], [COUNTED])


@pytest.mark.parametrize(
    ("samples", "iterations", "exposure", "part"),
    [
        (FINE, 60, COUNTED_TOO_MUCH, 1),
        (6, 60, Exposure(background=1.0), 1),
        (6, 60, COUNTED, 0.02),
        (12, 3, COUNTED, 1),
    ],
    ids=["fine, and the gain is wrong", "gain not known", "dim", "more iterations explain more"],
)
def test_nothing_is_said_where_samples_need_not_be_the_reason(samples, iterations, exposure, part, raw, rng):
    raw = raw if part == 1 else rng.binomial(raw.astype(int), part).astype(float)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lg.deconvolve(raw, seen_by(samples), iterations, exposure=exposure)


@pytest.mark.parametrize(
    ("instrument", "finest"),
    [
        (SCOPE, 525 * nm / (4 * 0.5)),
        (CAMERA, 600 * nm * CAMERA.object_distance / (2 * CAMERA.pupil_diameter)),
    ],
    ids=["microscope", "camera"],
)
def test_lines_as_close_as_samples_of_the_resolved_pitch_are_not_seen_and_wider_ones_are(instrument, finest):
    """The finest lines of samples are on and off, two pitches wide; the cut-off is at λ/(2 NA) or λ z/D."""
    contrast = []
    for part in (0.99, 1.5):
        samples = int(np.ceil(instrument.lenslet_size / (part * finest)))
        operator = instrument.operator(samples_per_lenslet=samples, accuracy=1e-2)
        assert operator.resolved_pitch == pytest.approx(finest)
        lines = np.zeros(operator.shape[1], np.float32)
        lines[:, ::2] = 2
        bright = operator.forward(np.ones_like(lines))
        middle = tuple(slice(n // 3, -(n // 3)) for n in bright.shape)
        contrast.append(np.std((operator.forward(lines) - bright)[middle]) / bright[middle].mean())
    assert contrast[0] < 0.02  # of an accuracy of 1e-2
    assert contrast[1] > 3 * contrast[0]
