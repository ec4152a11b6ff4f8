"""Pictures that are crops: light from beside them is not taken up by their border."""

import importlib

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.deconvolution import Exposure, RichardsonLucy
from lumigraph.deconvolution.beyond import beyond

DEPTHS = (-30e-6, 0.0)


@pytest.fixture(scope="module")
def crop():
    """An even slice out of focus, wider than the picture, and the operator of the crop that was recorded."""
    scope = lg.LightFieldMicroscope(
        wavelength="550 nm", objective={"magnification": 20, "numerical_aperture": 0.4},
        lenslets={"pitch": "100 um", "focal_length": "2 mm", "count": (9, 9)},
        sensor={"pixel_pitch": "12.5 um"},
    )  # fmt: skip
    operator = scope.operator(DEPTHS, 3, accuracy=1e-2)
    wide, inside = beyond(operator)
    scene = np.zeros(wide.shape[1], np.float32)
    scene[0] = 1.0 + 0.5 * np.sin(np.arange(scene.shape[2]) / 4)
    return operator, wide, inside, scene, np.maximum(wide.forward(scene), 0)


def test_the_wider_operator_is_the_same_inside_and_its_adjoint_is_the_transpose(crop, rng):
    operator, wide, inside, scene, _ = crop
    assert wide.shape[0] == operator.shape[0]
    only = np.zeros_like(scene)
    only[:, inside[0], inside[1]] = scene[:, inside[0], inside[1]]
    expected = operator.forward(scene[:, inside[0], inside[1]])
    np.testing.assert_allclose(wide.forward(only), expected, atol=2e-6 * expected.max())
    raw = rng.random(wide.shape[0], np.float32)
    left, right = np.vdot(wide.forward(scene), raw), np.vdot(scene, wide.adjoint(raw))
    assert left == pytest.approx(right, rel=1e-5)


def framed(plane):
    frame = np.ones(plane.shape, bool)
    frame[3:-3, 3:-3] = False
    return float(plane[frame].mean() / plane[~frame].mean())


def test_light_from_beside_the_picture_is_not_taken_up_by_its_border(crop, monkeypatch):
    operator, _, inside, scene, raw = crop
    found = np.asarray(lg.deconvolve(raw, operator, 12))
    assert found.shape == operator.shape[1]
    truth = framed(scene[0, inside[0], inside[1]])
    assert [framed(plane) / truth for plane in found] == pytest.approx([1, 1], abs=0.3)
    without = importlib.import_module("lumigraph.deconvolution.deconvolve")
    monkeypatch.setattr(without, "beyond", lambda operator: (operator, (slice(None), slice(None))))
    assert max(framed(plane) for plane in np.asarray(lg.deconvolve(raw, operator, 12))) > 1.45 * truth


def test_samples_beside_the_picture_are_cut_and_vignetted_ones_are_not(crop):
    operator, wide, inside, _, raw = crop
    light = np.asarray(wide.adjoint(np.ones(raw.shape, np.float32)))
    beside = (light < 0.3 * light.max())[:, inside[0], inside[1]]
    assert 0 < beside.sum() < 0.4 * beside.size
    response = np.ones(raw.shape, np.float32)
    response[:, : raw.shape[1] // 2] = 0.5
    for exposure, values in ((Exposure(), raw), (Exposure(response=response), raw * response)):
        found = np.asarray(lg.deconvolve(values, operator, 2, exposure=exposure))
        np.testing.assert_array_equal(found == 0, beside)


def test_dead_pixels_and_what_is_outside_a_region_are_not_fitted(crop):
    operator, *_, raw = crop
    spoilt, mask = raw.copy(), np.ones(raw.shape, bool)
    spoilt[20:28, 30:38] = 50 * raw.max()
    mask[20:28, 30:38] = False
    ready = lg.prepare(spoilt, mask=mask, divide=False)
    assert np.array_equal(Exposure.of(ready).weights == 0, ~mask)
    good, bad = (np.asarray(lg.deconvolve(one, operator, 5).data) for one in (ready, lg.RawImage(spoilt)))
    even = np.asarray(lg.deconvolve(raw, operator, 5))
    assert np.abs(good - even).max() < 0.3 * even.max() < np.abs(bad - even).max()


def test_a_start_of_the_object_that_is_asked_for_goes_on_beyond_it(crop):
    operator, *_, raw = crop
    start = np.ones(operator.shape[1], np.float32)
    found = lg.deconvolve(raw, operator, 2, method=RichardsonLucy(start=start))
    assert found.shape == start.shape
