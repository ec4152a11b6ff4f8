"""Pictures that were mixed up, full pixels in any container, views out of order."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

import cameras
from lumigraph.cli.simulate import SceneOptions
from lumigraph.core.raw import RawImage
from lumigraph.core.saturation import saturation_level, with_bits
from lumigraph.errors import CalibrationError, FormatError, SamplingWarning
from lumigraph.io.cameras import from_cameras
from lumigraph.io.view_order import check_order
from lumigraph.preparation import doubts
from lumigraph.preparation.beside import ReferenceImages
from lumigraph.simulation import simulate

Y, X = np.mgrid[:300, :360]
LIGHT = 0.3 + 0.7 * (np.cos(np.pi * (Y - 74) / 15) * np.cos(np.pi * (X - 89) / 15)) ** 2
SCENE = np.kron(np.random.default_rng(1).random((20, 24)), np.ones((15, 15)))


def raw(values, seed=0):
    noisy = values + np.random.default_rng(seed).normal(0, 3, values.shape)
    return RawImage(np.clip(np.round(noisy), 0, 65535).astype(np.uint16), bit_depth=16)


@pytest.mark.parametrize(("top", "shift"), [(4095, 0), (1023, 6), (4095, 4), (3900, 0), (65535, 0)])
def test_full_pixels_are_seen_whatever_the_container(top, shift):
    values = np.minimum(np.round(1.6 * SCENE * LIGHT * top), top).astype(np.uint16) << shift
    assert saturation_level(RawImage(values, bit_depth=16)) == top << shift


def test_hot_pixels_above_the_full_ones_do_not_hide_them():
    values = np.minimum(np.round(4000 * SCENE * LIGHT), 3700).astype(np.uint16)
    for hot in (np.arange(3801, 3813).reshape(3, 4), 4095, 65535):
        values[::100, ::100] = hot
        assert saturation_level(RawImage(values, bit_depth=16)) == 3700


def test_a_picture_without_full_pixels_has_none_and_given_bits_count():
    picture = raw(3000 * SCENE * LIGHT)
    assert saturation_level(picture) is None
    full = RawImage(np.minimum(picture.data, 1500), bit_depth=16)
    assert saturation_level(full) == 1500
    assert saturation_level(with_bits(full, 16)) == 65535
    with pytest.raises(FormatError, match="bit depth is 17"):
        with_bits(full, 17)


@pytest.mark.parametrize("scene", ["white", "usaf1951", "slanted_edge", "chessboard"])
@pytest.mark.parametrize("camera", [cameras.focused, cameras.plenoptic])
def test_scenes_that_lumigraph_draws_have_no_full_pixels(scene, camera):
    """Micro-images without noise repeat their values: a heap at the maximum is no chance there."""
    described, drawn = camera(), SceneOptions(scene=[scene])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # of a target's finest bars
        image = np.asarray(simulate(described, drawn.built(described)).data, float)
    for bits in (8, 10, 12, 14, 16):
        values = np.round(0.8 * image / image.max() * (2**bits - 1)).astype(
            np.uint8 if bits == 8 else np.uint16
        )
        assert saturation_level(RawImage(values, bit_depth=8 if bits == 8 else 16)) is None
        exposed = replace(described.sensor, bits=bits).expose(image, rng=np.random.default_rng(0))
        level = saturation_level(exposed)
        assert level is None or exposed.data.max() < level


def test_white_and_raw_swapped_are_noticed():
    scene, white = raw(3000 * SCENE * LIGHT), raw(3500 * LIGHT, 1)
    assert doubts.mixed_up(scene, white, 15) is None
    assert "look swapped" in (doubts.mixed_up(white, scene, 15) or "")


def test_a_dark_image_given_as_white_is_named():
    dark = raw(np.full(LIGHT.shape, 100.0), 2)
    with pytest.raises(CalibrationError, match=r"looks like a dark image: 100 on average where .* 700.5"):
        doubts.check_kinds(raw(3000 * SCENE * LIGHT), ReferenceImages(dark))
    with pytest.raises(CalibrationError, match="Swap the two"):
        doubts.check_kinds(raw(3000 * SCENE * LIGHT), ReferenceImages(dark, raw(3500 * LIGHT)))


def test_a_floor_is_measured_without_a_white_image_and_none_is_where_there_is_none():
    smooth = 0.1 + 0.9 * (1 + np.sin(X / 60) * np.cos(Y / 70)) / 2
    gaps = np.clip(LIGHT - 0.35, 0, None)  # dark between the micro-images
    for scene in (smooth, SCENE):
        told = doubts.floor_under(raw(3000 * scene * gaps + 200), ReferenceImages(), 15)
        assert told is not None
        assert abs(float(told.split("about ")[1].split(",")[0]) - 200) < 8
    for scene in (smooth, SCENE, np.ones_like(SCENE)):
        for light in (gaps, LIGHT):
            assert doubts.floor_under(raw(3000 * scene * light + 5), ReferenceImages(), 15) is None
    dark = raw(np.full(LIGHT.shape, 200.0), 2)
    assert doubts.floor_under(raw(3000 * smooth * gaps + 200), ReferenceImages(dark=dark), 15) is None


def test_an_offset_left_in_is_measured_and_none_is_where_there_is_none():
    told = doubts.left_in(raw(3000 * SCENE * LIGHT + 200), ReferenceImages(raw(3500 * LIGHT + 200, 1)), 15)
    assert told is not None
    assert abs(float(told.split("about ")[1].split(",")[0]) - 200) < 3
    assert doubts.left_in(raw(3000 * SCENE * LIGHT), ReferenceImages(raw(3500 * LIGHT, 1)), 15) is None


@pytest.mark.parametrize(
    ("turned", "told"),
    [
        (lambda a: a, None), (lambda a: a[::-1, ::-1], None), (lambda a: a[:, ::-1], "columns mirrored"),
        (lambda a: a.swapaxes(0, 1), "rows and columns swapped"),
        (lambda a: a[:2, 1::-1], "columns mirrored"),
    ],
)  # fmt: skip
def test_views_out_of_order_are_named(turned, told):
    texture = gaussian_filter(np.random.default_rng(0).random((160, 160)), 1.2)
    views = [
        [shift(texture, (-2 * r, -2 * c), order=1)[30:130, 30:130] for c in (-1, 0, 1)] for r in (-1, 0, 1)
    ]
    levels = 2 * np.random.default_rng(1).random((3, 3, 1, 1))  # not all views are as bright
    views = from_cameras(turned(np.array(views) + levels))
    if told is not None:
        with pytest.warns(SamplingWarning, match=f"times better with .*{told}"):
            check_order(views, "folder")
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_order(views, "folder")
