"""Demosaicing: colours come back, at the right places, with what the camera recorded."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core.raw import BAYER_PATTERNS, RawImage
from lumigraph.errors import FormatError
from lumigraph.sensor import colour, mosaic
from lumigraph.sensor.colour import demosaic

COLOUR = np.array([0.2, 0.5, 0.35])
GAINS = [1.0, 1.25, 1.3, 2.0]  # r, gr, gb, b
MATRIX = np.array([[1.7, -0.6, -0.1], [-0.3, 1.5, -0.2], [0.1, -0.8, 1.7]])


def inner(picture, border=8):
    return picture[border:-border, border:-border]


@pytest.mark.parametrize("pattern", BAYER_PATTERNS)
@pytest.mark.parametrize("method", colour.METHODS)
def test_an_even_colour_comes_back_from_every_pattern_by_every_method(pattern, method):
    raw = RawImage(mosaic(np.broadcast_to(COLOUR, (24, 30, 3)).astype(np.float32), pattern), bayer=pattern)
    picture = demosaic(raw, method=method)
    assert picture.data.dtype == np.float32
    assert (picture.bayer, picture.metadata["demosaiced"]) == (None, method)
    np.testing.assert_allclose(picture.data, np.broadcast_to(COLOUR, picture.data.shape), atol=1e-6)


@pytest.mark.parametrize("pattern", BAYER_PATTERNS)
@pytest.mark.parametrize("method", ["bilinear", "malvar"])
def test_ramps_come_back_exactly_and_nothing_is_shifted(pattern, method):
    # Linear methods reproduce planes; half a pixel of shift would be 0.01 here.
    y, x = np.mgrid[:40, :48]
    ramps = np.stack([0.02 * x, 0.5 + 0.01 * y, 0.9 - 0.01 * x - 0.005 * y], -1) / 2
    picture = demosaic(RawImage(mosaic(ramps, pattern), bayer=pattern), method=method).data
    assert picture.dtype == np.float64
    np.testing.assert_allclose(inner(picture), inner(ramps), atol=1e-12)


@pytest.mark.parametrize("method", colour.METHODS)
@pytest.mark.parametrize("rows", [15, 16, 33])
def test_strips_do_not_show(monkeypatch, rng, method, rows):
    raw = RawImage(rng.random((rows * 2 + 7, 21)), bayer="GBRG")
    whole = demosaic(raw, method=method).data
    monkeypatch.setattr(colour, "_ROWS", rows + rows % 2)
    np.testing.assert_array_equal(demosaic(raw, method=method).data, whole)


@pytest.mark.parametrize("pattern", BAYER_PATTERNS)
def test_levels_gains_and_matrix_are_applied_as_recorded(pattern):
    # What a sensor with these levels and gains reads of a colour whose sRGB is COLOUR.
    camera = np.linalg.solve(MATRIX, COLOUR)
    black, white = [100.0, 110.0, 120.0, 130.0], [4000.0, 4010.0, 4020.0, 4095.0]
    data = np.empty((20, 20))
    for k, name in enumerate(pattern):
        beside_red = pattern[k ^ 1] == "R"
        c = {"R": 0, "B": 3, "G": 1 if beside_red else 2}[name]
        light = camera["RGB".index(name)]
        data[k // 2 :: 2, k % 2 :: 2] = black[c] + light / GAINS[c] * (white[c] - black[c])
    known = {"black_level": black, "white_level": white, "white_balance": GAINS, "colour_matrix": MATRIX}
    raw = RawImage(data, bayer=pattern, metadata=known)
    np.testing.assert_allclose(demosaic(raw).data, np.broadcast_to(COLOUR, (20, 20, 3)), atol=1e-12)
    plain = demosaic(raw, colour_matrix=False).data
    np.testing.assert_allclose(plain, np.broadcast_to(camera, (20, 20, 3)), atol=1e-12)


def test_a_full_pixel_is_white_whatever_the_gains():
    known = {"white_balance": GAINS, "black_level": 168}
    raw = RawImage(np.full((12, 12), 4095, np.uint16), bit_depth=12, bayer="BGGR", metadata=known)
    np.testing.assert_allclose(demosaic(raw).data, 1.0, atol=1e-6)
    # Without white balance nothing is cut; three gains stand for four.
    np.testing.assert_allclose(demosaic(raw, white_balance=False).data, 1.0, atol=1e-6)
    three = RawImage(raw.data // 4, bit_depth=12, bayer="BGGR", metadata={"white_balance": [1, 1.25, 2]})
    np.testing.assert_allclose(demosaic(three).data[6, 6], np.array([1, 1.25, 2]) * 1023 / 4095, atol=1e-6)


def test_grey_and_colour_stay_as_they_are():
    for data in (np.ones((4, 4), np.uint16), np.ones((4, 4, 3))):
        raw = RawImage(data, metadata={"white_balance": GAINS})
        assert lg.demosaic(raw) is raw


def test_arrays_of_other_libraries_are_taken(xp):
    raw = RawImage(xp.asarray([[0.5] * 8] * 8, dtype=xp.float32), bayer="RGGB")
    np.testing.assert_allclose(demosaic(raw).data, 0.5, atol=1e-6)


@pytest.mark.parametrize(
    ("known", "message"),
    [
        ({"white_balance": [1, 0, 1]}, "white_balance is .* must be gains above 0"),
        ({"white_balance": "warm"}, r"white_balance is warm but must be one number, \(r, g, b\)"),
        ({"black_level": [1, 2]}, r"black_level is \[1, 2\] but must be one number"),
        ({"white_level": np.nan}, "white_level is nan"),
        ({"black_level": 300}, "white_level .* must be above black_level"),
        ({"colour_matrix": [1, 2, 3]}, "colour_matrix is .* must be 3 x 3"),
        ({"colour_matrix": "sRGB"}, "colour_matrix is sRGB"),
    ],
)
def test_records_that_cannot_be_are_refused(known, message):
    raw = RawImage(np.ones((4, 4), np.uint8), bit_depth=8, bayer="RGGB", metadata=known)
    with pytest.raises(FormatError, match=message):
        demosaic(raw)


def test_other_mistakes_are_named():
    with pytest.raises(FormatError, match="method is 'nearest' but must be one of bilinear, malvar, menon"):
        demosaic(RawImage(np.ones((4, 4)), bayer="RGGB"), method="nearest")
    with pytest.raises(FormatError, match=r"a Bayer mosaic is \(y, x\) from 2 x 2 on but .* \(4, 4, 3\)"):
        demosaic(RawImage(np.ones((4, 4, 3)), bayer="RGGB"))
    with pytest.raises(FormatError, match="raw is of type ndarray but must be a RawImage"):
        demosaic(np.ones((4, 4)))
    with pytest.raises(FormatError, match="the raw image has 1 NaN"):
        demosaic(RawImage(np.array([[1.0, np.nan], [1, 1]]), bayer="RGGB"))
