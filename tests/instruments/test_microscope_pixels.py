"""Pixels of a microscope: the same ones behind each lenslet, or others, and as exact as asked for."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.operators.microscope.kernels import _near

PIXEL = 125e-6 / 19


def scope(shape, pitch=PIXEL):
    return lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        wavelength="525 nm",
        objective={
            "magnification": 20.0,
            "numerical_aperture": 0.5,
            "immersion_index": 1.0,
            "model": "scalar",
        },
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": (9, 7)},
        sensor={"shape": shape, "pixel_pitch": pitch},
    )


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("shape", [(171, 133), (176, 140)])  # whole cells, and parts of more
def test_pixels_that_are_the_samples_agree_with_interpolated_ones(shape, rng):
    """Lenslets of 19.0002 px are sampled and interpolated: the same pictures but for the accuracy."""
    depths = (-20e-6, 0.0, 20e-6)
    same, between = (
        scope(shape, pitch).operator(depths, 3, accuracy=1e-2) for pitch in (PIXEL, PIXEL * (1 + 1e-5))
    )
    assert [one.kernels[0].sampling.degree for one in (same, between)] == [0, 3]
    assert same.shape == between.shape
    assert same.object_grid.center == pytest.approx(between.object_grid.center, abs=1e-12)
    volume = rng.random(same.shape[1]).astype(np.float32)
    image = same.forward(volume)
    assert rms(image - between.forward(volume)) < 4e-3 * rms(image)
    point = (1, same.shape[1][1] // 2, same.shape[1][2] // 2 + 1)
    assert rms(same.psf(point) - between.psf(point)) < 1e-2 * rms(same.psf(point))
    raw = rng.random(shape).astype(np.float32)
    assert np.vdot(image, raw) == pytest.approx(np.vdot(volume, same.adjoint(raw)), rel=1e-5)


def test_a_larger_sensor_sees_the_same_around_whole_cells(rng):
    whole, larger = (scope(shape).operator((-20e-6, 20e-6), 3) for shape in ((171, 133), (179, 141)))
    assert whole.placement is None
    assert larger.placement is not None
    point = (1, 13, 10)
    more = [(n - m) // 2 for n, m in zip(larger.shape[1], whole.shape[1], strict=True)]
    inner = larger.psf(tuple(k + n for k, n in zip(point, more, strict=True)))
    np.testing.assert_allclose(inner[4:-4, 4:-4], whole.psf(point), atol=1e-6 * float(inner.max()))


@pytest.mark.parametrize("accuracy", [1e-2, pytest.param(3e-3, marks=pytest.mark.long)])
def test_interpolated_pixels_are_as_exact_as_asked_for_at_the_finest_depth(accuracy):
    """By the focused plane and the farthest one alone, -15 um was off by 1.4e-2 where 1e-2 was asked for."""
    operator = scope((176, 140), "6.5789 um").operator(
        (-60e-6, -30e-6, -15e-6, -10e-6, 0.0), 5, accuracy=accuracy
    )
    assert operator.kernels[0].sampling.degree == 3
    assert 0.3 * accuracy < operator.error <= accuracy


def test_an_operator_that_is_less_exact_than_asked_for_warns(monkeypatch):
    monkeypatch.setattr("lumigraph.operators.microscope.layout.samples_needed", lambda *_: 17)
    asked = scope((176, 140), "6.5789 um")
    with pytest.warns(lg.errors.SamplingWarning, match=r"accuracy of 0\.01 .* at -15 um are off by some 0"):
        operator = asked.operator((-15e-6, 0.0), 3, accuracy=1e-2)
    assert operator.error > 1e-2


def test_cells_that_are_as_strong_are_near_or_far_together():
    """All four beside a cell were dropped where the accuracy allows three: 1.6e-2 where 1e-2 was asked."""
    off = np.array([[0.01, 0.3, 0.01], [0.3, 9.0, 0.3], [0.01, 0.3, 0.01]])
    kept, lost = _near(off.ravel(), 3, 1.0, symmetric=True)
    np.testing.assert_array_equal(kept, [False, True, False, True, True, True, False, True, False])
    assert lost == pytest.approx(0.2)


def test_ten_pixels_behind_a_lenslet_are_as_exact_as_asked_for():
    shown, truth = (
        scope((90, 90)).operator((-12e-6,), 3, pixels=10, accuracy=accuracy) for accuracy in (1e-2, 1e-3)
    )
    point = (0, *(n // 2 - 1 for n in shown.shape[1][1:]))
    assert 1e-3 < rms(shown.psf(point) - truth.psf(point)) / rms(truth.psf(point)) < 5e-3
