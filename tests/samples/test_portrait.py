"""The painted scene before cameras, by rays: where its layers are, and what diffraction leaves of them."""

import sys

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.rendering import render_stack
from lumigraph.samples.still_life import LAYERS
from lumigraph.simulation import Incoherent


def depth_of(sample, number):
    """Of a layer [m]: what moves in proportion to the parallax is dz/(z1 + dz)."""
    distance, far = sample.camera.object_distance, sample.depths[1]
    most = max(abs(layer.parallax) for layer in LAYERS)
    part = far / (distance + far) * -LAYERS[number].parallax / most
    return distance * part / (1 - part)


def test_views_of_a_camera_1_have_the_depths_of_the_layers(monkeypatch):
    monkeypatch.setattr(sys.modules["lumigraph.samples.portrait"], "_DEPTHS", 40.0)
    camera = lg.load_camera("thesis-plenoptic-1").replace(
        wavelength="60 nm", lenslets={"count": (61, 61)}, main_lens={"diameter": "3.6 mm"},
        sensor={"shape": None, "pixel_pitch": "10 um"},
    )  # fmt: skip
    sample = lg.samples.portrait(camera)
    views = lg.decode(lg.prepare(sample.raw, camera.calibration, white=sample.white))
    alpha = lg.depth.alpha_of(lg.depth.epi(views), views)
    found = lg.depth.metric(alpha, views, focal_length=camera.main_lens.focal_length).values
    for place, layer in (((slice(5, 12), slice(5, 56)), 0), ((slice(35, 42), slice(24, 38)), 2)):
        expected = depth_of(sample, layer)  # 37 mm, -4 mm
        assert np.nanmedian(found[place]) == pytest.approx(expected, rel=0.1, abs=1.5e-3)


def test_pictures_of_a_camera_2_are_sharp_at_the_patches_of_the_layers():
    camera = lg.load_camera("thesis-plenoptic-2-m025").replace(
        wavelength="200 nm", lenslets={"count": (21, 21)}, sensor={"shape": None, "pixel_pitch": "5 um"}
    )
    sample = lg.samples.portrait(camera)
    raw = lg.prepare(sample.raw, camera.calibration, white=sample.white)
    patches = [camera.patch_at(dz) for dz in (sample.depths[0], 0.0, sample.depths[1])]
    pictures = np.asarray(render_stack(raw, camera.calibration, patches, samples=9))
    nt, ns = pictures.shape[1:]
    wall = pictures[:, nt // 10 : nt // 4, ns // 8 : ns // 3]
    eyes = pictures[:, 3 * nt // 10 : 2 * nt // 5, 2 * ns // 5 : -2 * ns // 5]
    contrast = wall.std((1, 2)), eyes.std((1, 2))
    assert contrast[0][2] > 1.05 * contrast[0][1] > 1.3 * contrast[0][0]
    assert contrast[1][1] > 1.1 * max(contrast[1][0], contrast[1][2])


def test_the_white_image_is_that_of_waves():
    camera = lg.load_camera("thesis-plenoptic-1").replace(lenslets={"count": (5, 5)}, sensor={"shape": None})
    rays = lg.samples.portrait(camera).white.data
    waves = lg.simulate(camera, lg.targets.white(), Incoherent(1e-2)).data
    middle = (slice(40, -40),) * 2
    rays, waves = (part[middle] / part[middle].mean() for part in (rays, waves))
    error = np.sqrt(((rays - waves) ** 2).mean())
    assert error < 0.25 * waves.std()


def test_other_cameras_are_refused():
    with pytest.raises(lg.GeometryError, match="must be a PlenopticCamera or FocusedPlenopticCamera"):
        lg.samples.portrait(lg.load_camera("thesis-2f"))  # type: ignore[arg-type]  # it is refused


def test_the_luminance_of_a_raw_image_in_colour_is_the_grey_one():
    camera = lg.load_camera("thesis-plenoptic-2-m025").replace(
        lenslets={"count": (7, 9)}, sensor={"shape": None}
    )
    grey, colour = (lg.samples.portrait(camera, colour=colour) for colour in (False, True))
    data = np.asarray(colour.raw.data)
    assert data.shape == (*grey.raw.data.shape, 3)
    assert np.ptp(data / data.sum(-1, keepdims=True).clip(1e-6), axis=-1).max() > 0.3
    np.testing.assert_allclose(data @ (0.2126, 0.7152, 0.0722), grey.raw.data, atol=2e-3 * data.max())
    np.testing.assert_array_equal(colour.white.data, grey.white.data)
