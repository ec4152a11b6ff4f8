"""Pictures that were mixed up, full pixels in any container, views out of order."""

import warnings

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from lumigraph.core.raw import RawImage
from lumigraph.core.saturation import saturation_level, with_bits
from lumigraph.errors import CalibrationError, FormatError, SamplingWarning
from lumigraph.io.cameras import from_cameras
from lumigraph.preparation import doubts
from lumigraph.preparation.beside import ReferenceImages
from lumigraph.rendering import check_arrangement

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


def test_a_picture_without_full_pixels_has_none_and_given_bits_count():
    picture = raw(3000 * SCENE * LIGHT)
    assert saturation_level(picture) is None
    full = RawImage(np.minimum(picture.data, 1500), bit_depth=16)
    assert saturation_level(full) == 1500
    assert saturation_level(with_bits(full, 16)) == 65535
    with pytest.raises(FormatError, match="bit depth is 17"):
        with_bits(full, 17)


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
    ],
)  # fmt: skip
def test_views_out_of_order_are_named(turned, told):
    texture = gaussian_filter(np.random.default_rng(0).random((160, 160)), 1.2)
    views = [
        [shift(texture, (-2 * r, -2 * c), order=1)[30:130, 30:130] for c in (-1, 0, 1)] for r in (-1, 0, 1)
    ]
    views = from_cameras(turned(np.array(views)))
    if told is not None:
        with pytest.warns(SamplingWarning, match=f"times better with .*{told}"):
            check_arrangement(views, "folder")
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_arrangement(views, "folder")
