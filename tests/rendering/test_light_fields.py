"""Decode and encode, views, mosaics, refocusing: shapes, inverses, array libraries, refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lumigraph.core import memory
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError, GeometryError, LumigraphError
from lumigraph.rendering import (
    decode,
    encode,
    reduce_aperture,
    refocus,
    refocus_fourier,
    refocus_stack,
    render,
    sub_aperture,
    views_from_mosaic,
)
from lumigraph.rendering.focused import rendered_grid
from lumigraph.rendering.geometry import largest_rectangle
from lumigraph.rendering.views import lenslet_mosaic, point_of_view, views_mosaic

NONE = np.zeros((0, 2))


def calibrated(lattice, shape):
    return Calibration(lattice, shape, NONE, NONE, 0.0)


def field(rng, shape=(5, 5, 12, 14), pitch=1.0):
    return LightField(rng.random(shape), Grid(shape[:2], pitch), Grid(shape[2:4], 1.0), 10.0)


@pytest.mark.parametrize("pitch", [7, 8])
@pytest.mark.parametrize("colours", [(), (3,)])
def test_raw_and_light_field_there_and_back(rng, pitch, colours):
    calibration = calibrated(
        Lattice.square(float(pitch), 0, (pitch // 2, pitch // 2)), (6 * pitch, 8 * pitch)
    )
    raw = rng.random((6 * pitch, 8 * pitch, *colours))
    views = decode(raw, calibration)
    assert views.data.shape == (pitch, pitch, 6, 8, *colours)
    again = encode(views, calibration).data
    # With even pitch the first row and column of pixels belong to micro-images before the first one.
    inner = slice(1 - pitch % 2, None)
    np.testing.assert_allclose(again[inner, inner], raw[inner, inner], atol=1e-12)
    np.testing.assert_allclose(decode(again, calibration).data[1:, 1:], views.data[1:, 1:], atol=1e-12)


@settings(max_examples=15, deadline=None)
@given(pitch=st.floats(7, 12), rotation=st.floats(-0.05, 0.05), layout=st.sampled_from(["square", "hex"]))
def test_smooth_light_fields_come_back_through_any_lattice(pitch, rotation, layout):
    calibration = calibrated(getattr(Lattice, layout)(pitch, rotation, (50.2, 60.7)), (100, 120))
    y, x = np.mgrid[:100, :120]
    raw = 2 + np.sin(y / 40) + np.cos(x / 35)
    again = encode(decode(raw, calibration), calibration).data
    covered = again != 0
    assert covered.mean() > 0.35
    # Interpolated twice, and clamped by up to a pixel at the edge of a micro-image: 0.03 of slope per pixel;
    # half a pitch at both ends of the odd rows of a hexagonal lattice.
    assert np.abs(again - raw)[covered].max() < (0.08 if layout == "square" else 0.02 * pitch)


def test_order_of_the_directions_is_turned_round():
    raw = np.zeros((35, 35))
    raw[3 + 14 + 2, 3 + 14 + 1] = 1.0  # below and right of the middle of micro-image (2, 2)
    views = decode(raw, calibrated(Lattice.square(7.0, 0, (3, 3)), (35, 35)))
    v, u, t, s = (int(k) for k in np.argwhere(views.data > 0.5)[0])
    assert (v - 3, u - 3, t, s) == (-2, -1, 2, 2)


def test_lengths_are_metres_where_the_geometry_is_known():
    lattice = Lattice.square(10.0, 0, (5, 5))
    calibration = Calibration(lattice, (100, 120), NONE, NONE, 0.0, 5e-6, 0.2, 4e-3)
    views = decode(np.ones((100, 120)), calibration)
    assert views.separation == 0.2
    assert views.lenslets.pitch[0] == pytest.approx(50e-6 / 1.02)
    assert views.aperture.pitch[0] == pytest.approx(5e-6 * 50)
    # Lenslet (2, 3) stands at pixel (25, 35), the axis at (50, 60).
    assert views.lenslets.y[2] == pytest.approx(-25 * 5e-6 / 1.02)
    assert views.lenslets.x[3] == pytest.approx(-25 * 5e-6 / 1.02)


def test_fewer_directions_are_means_over_their_width(rng):
    calibration = calibrated(Lattice.square(12.0, 0, (5.5, 5.5)), (60, 60))
    raw = np.kron(rng.random((5, 5)), np.ones((12, 12)))
    views = decode(raw, calibration, directions=3, interpolation="linear")
    assert views.data.shape[:2] == (3, 3)
    np.testing.assert_allclose(
        views.data[1, 1], raw[5::12, 5::12][: views.data.shape[2], : views.data.shape[3]]
    )
    assert views.aperture.pitch[0] == pytest.approx(4 * decode(raw, calibration).aperture.pitch[0])


def test_partial_micro_images_are_left_out():
    calibration = calibrated(Lattice.square(10.0, 0, (0, 4.5)), (100, 100))
    assert decode(np.ones((100, 100)), calibration).lenslets.shape == (9, 10)


def test_array_libraries_and_precision(xp, rng):
    calibration = calibrated(Lattice.hex(7.3, 0.02, (30, 30)), (60, 66))
    raw = rng.random((60, 66, 3)).astype(np.float32)
    views = decode(raw, calibration)
    ours = decode(xp.asarray(raw), calibration)
    given_raw = raw.copy()
    pairs = [
        (ours.data, views.data),
        (encode(ours, calibration).data, encode(views, calibration).data),
        (refocus(ours, 1.1, oversample=1), refocus(views, 1.1, oversample=1)),
        (refocus(ours, 0.9, oversample=2), refocus(views, 0.9, oversample=2)),
        (refocus_fourier(ours, 1.1), refocus_fourier(views, 1.1)),
        (render(xp.asarray(raw), calibration, 3.3), render(raw, calibration, 3.3)),
        (render(xp.asarray(raw), calibration, -3.3, blend=True), render(raw, calibration, -3.3, blend=True)),
        (views_mosaic(ours), views_mosaic(views)),
        (point_of_view(ours, 0.3, -0.2), point_of_view(views, 0.3, -0.2)),
        (reduce_aperture(ours, 0.6, shape="round").data, reduce_aperture(views, 0.6, shape="round").data),
    ]
    for got, expected in pairs:
        assert type(got) is type(xp.asarray(raw))
        assert str(got.dtype).endswith("float32")
        np.testing.assert_allclose(to_numpy(got), expected, atol=2e-6)
    np.testing.assert_array_equal(raw, given_raw)


def test_whole_numbers_become_float32(rng):
    calibration = calibrated(Lattice.square(7.0, 0, (3, 3)), (28, 28))
    raw = rng.integers(0, 255, (28, 28)).astype(np.uint8)
    assert decode(raw, calibration).data.dtype == np.float32
    assert render(raw, calibration, 3.0).dtype == np.float32


def test_gradients_of_linear_steps_are_their_adjoints(rng):
    """<A x, y> over random pairs equals the sum over a basis: decode, refocus and render are linear."""
    calibration = calibrated(Lattice.square(7.3, 0.01, (30, 30)), (60, 60))
    for step in (
        lambda r: decode(r, calibration).data,
        lambda r: refocus(decode(r, calibration), 1.13, oversample=1),
        lambda r: render(r, calibration, 3.4),
        lambda r: encode(decode(r, calibration), calibration).data,
    ):
        a, b = rng.standard_normal((2, 60, 60))
        np.testing.assert_allclose(step(2 * a - 3 * b), 2 * step(a) - 3 * step(b), atol=1e-12)


def test_a_uniform_scene_stays_uniform_to_the_frame():
    views = LightField(np.ones((6, 5, 8, 9)), Grid((6, 5), 1.0), Grid((8, 9), 1.0), 10.0)
    for alpha in (0.2, 0.85, 1.0, 1.3):
        for oversample in (1, 3):
            picture = refocus(views, alpha, oversample=oversample)
            np.testing.assert_allclose(picture, 1, atol=1e-12)
    assert refocus(views, 1.1, oversample=3).shape == (22, 25)


def test_oversampled_pictures_hold_the_plain_ones(rng):
    views = field(rng)
    np.testing.assert_allclose(
        refocus(views, 1.2, oversample=4)[::4, ::4], refocus(views, 1.2, oversample=1), atol=1e-12
    )


def test_whole_shifts_are_exact_means(rng):
    views = field(rng, (3, 3, 9, 9))
    expected = np.mean(
        [views.data[v, u, 3 + v - 1 : 6 + v - 1, 3 + u - 1 : 6 + u - 1] for v in range(3) for u in range(3)],
        0,
    )
    # alpha = 0: x = u, one lenslet per view. No camera has this plane.
    np.testing.assert_allclose(refocus(views, 1e-12, oversample=1)[3:6, 3:6], expected, atol=1e-9)


def test_stack_is_its_pictures(rng):
    views = field(rng, (4, 5, 9, 8, 3))
    alphas = [0.8, 1.0, 1.15]
    stack = refocus_stack(views, alphas, interpolation="linear", oversample=1)
    assert stack.shape == (3, 9, 8, 3)
    for picture, alpha in zip(stack, alphas, strict=True):
        np.testing.assert_allclose(picture, refocus(views, alpha, interpolation="linear", oversample=1))


def test_fourier_slice_of_periodic_light_is_exact(rng):
    """A band-limited periodic light field sheared in closed form: the slice errs by its kernel only."""
    t, s = np.arange(12)[:, None], np.arange(14)[None, :]
    aperture, alpha = Grid((5, 6), 0.7), 1.23

    def scene(y, x):
        return 2 + np.cos(2 * np.pi * (2 * y / 12 + x / 14)) + 0.5 * np.sin(2 * np.pi * 3 * x / 14)

    data = np.array(
        [[scene(t - v * (1 - alpha), s - u * (1 - alpha)) for u in aperture.x] for v in aperture.y]
    )
    views = LightField(data, aperture, Grid((12, 14), 1.0), 10.0)
    np.testing.assert_allclose(refocus_fourier(views, alpha), scene(t, s), atol=2e-4)


def test_mosaics_hold_views_and_micro_images(rng):
    views = field(rng, (2, 3, 4, 5, 3))
    mosaic, lenslets = views_mosaic(views), lenslet_mosaic(views)
    np.testing.assert_array_equal(mosaic[4:8, 10:15], views.data[1, 2])
    np.testing.assert_array_equal(lenslets[4:6, 9:12], views.data[:, :, 2, 3])
    again = views_from_mosaic(mosaic, views.aperture, views.lenslets, views.separation)
    np.testing.assert_array_equal(again.data, views.data)


def test_views_and_points_of_view(rng):
    views = field(rng)
    np.testing.assert_array_equal(sub_aperture(views, 1, -1), views.data[1, -1])
    np.testing.assert_allclose(point_of_view(views, 1.0, -2.0), views.data[3, 0])
    np.testing.assert_allclose(point_of_view(views, 0.5, 0), (views.data[2, 2] + views.data[3, 2]) / 2)


@pytest.mark.parametrize("n", [7, 8])
def test_a_smaller_aperture_keeps_the_middle(rng, n):
    views = field(rng, (n, n, 4, 4))
    small = reduce_aperture(views, 0.5)
    assert small.aperture.shape == (4, 4)
    np.testing.assert_array_equal(small.data[2, 2], views.data[n // 2, n // 2])
    assert small.aperture.y[2] == 0
    np.testing.assert_array_equal(reduce_aperture(views, 1).data, views.data)
    np.testing.assert_array_equal(refocus(views, 1.1, aperture=0.5), refocus(small, 1.1))
    assert np.abs(refocus(views, 1.1, aperture=0.5) - refocus(views, 1.1)).max() > 1e-3
    round_one = reduce_aperture(views, 1, shape="round")
    assert not round_one.data[0, 0].any()
    np.testing.assert_array_equal(round_one.data[n // 2, 1], views.data[n // 2, 1])


def test_largest_rectangle_holds_only_good_cells(rng):
    good = rng.random((20, 25)) < 0.97
    top, bottom, left, right = largest_rectangle(good)
    assert good[top:bottom, left:right].all()
    assert largest_rectangle(np.ones((4, 5), bool)) == (0, 4, 0, 5)
    frame = np.ones((10, 12), bool)
    frame[0] = frame[:, -1] = False
    assert largest_rectangle(frame) == (1, 10, 0, 11)


CALIBRATION = calibrated(Lattice.square(7.0, 0, (3, 3)), (35, 42))


def bad_raw():
    raw = np.ones((35, 42))
    raw[1, 2] = np.inf
    return raw


@pytest.mark.parametrize("read", [decode, lambda raw, calibration: render(raw, calibration, 3.0)])
def test_raw_images_that_do_not_belong_are_refused(read):
    with pytest.raises(
        CalibrationError, match="picture has 35 x 35 pixels but its calibration is for 35 x 42"
    ):
        read(np.ones((35, 35)), CALIBRATION)
    with pytest.raises(
        CalibrationError, match=r"the raw image has 1 NaN or infinite values .* index \(1, 2\)"
    ):
        read(bad_raw(), CALIBRATION)
    with pytest.raises(CalibrationError, match=r"has a Bayer pattern \(RGGB\).*\n?.*Demosaic it"):
        read(RawImage(np.ones((35, 42)), bayer="RGGB"), CALIBRATION)


def test_bad_numbers_are_refused(rng):
    views = field(rng)
    with pytest.raises(GeometryError, match=r"alpha is 0.* but must be above 0"):
        refocus(views, 0, oversample=1)
    with pytest.raises(GeometryError, match="alphas is empty"):
        refocus_stack(views, [], oversample=1)
    with pytest.raises(GeometryError, match="alpha is nan"):
        refocus_fourier(views, math.nan)
    with pytest.raises(LumigraphError, match="interpolation is 'nearest' but must be one of linear"):
        refocus(views, 1.1, interpolation="nearest", oversample=1)
    with pytest.raises(GeometryError, match="both numbers must be at least 1"):
        refocus(views, 1.1, oversample=0)
    with pytest.raises(GeometryError, match=r"no view \(5, 0\): the aperture has 5 x 5"):
        sub_aperture(views, 5, 0)
    with pytest.raises(GeometryError, match="y is 3 m but the views lie between -2 and 2 m"):
        point_of_view(views, 3, 0)
    with pytest.raises(GeometryError, match=r"fraction is 1\.5 but must be above 0 and at most 1"):
        reduce_aperture(views, 1.5)
    with pytest.raises(GeometryError, match="shape is 'oval' but must be 'square', 'round'"):
        reduce_aperture(views, 0.5, shape="oval")
    with pytest.raises(
        GeometryError, match="mosaic has 60 x 69 pixels but 5 x 5 views of 12 x 14 make 60 x 70"
    ):
        views_from_mosaic(np.ones((60, 69)), views.aperture, views.lenslets, 1.0)
    with pytest.raises(GeometryError, match="directions is"):
        decode(np.ones((35, 42)), CALIBRATION, directions=0)


def test_bad_patches_are_refused():
    raw = np.ones((35, 42))
    for patch, match in (
        (0.0, r"patch is 0 px but must be above 0 and at most the micro-images' pitch, 7 px"),
        (9.0, r"patch is 9 px but must be above 0 and at most"),
        (math.nan, "patch has 1 NaN"),
        (np.ones((2, 2)), r"map of patches has shape \(2, 2\) but \(5, 6\) lenslets"),
    ):
        with pytest.raises(GeometryError, match=match):
            render(raw, CALIBRATION, patch)
    with pytest.raises(GeometryError, match="samples is"):
        rendered_grid(CALIBRATION, 3.0, samples=0)


def test_pictures_without_a_whole_micro_image_are_refused():
    calibration = calibrated(Lattice.square(50.0, 0, (0, 0)), (40, 40))
    with pytest.raises(
        CalibrationError, match=r"no micro-image of pitch 50\.0 px lies wholly inside 40 x 40 pixels"
    ):
        decode(np.ones((40, 40)), calibration)
    with pytest.raises(GeometryError, match="no patch of 45 px lies wholly on the sensor of 40 x 40 px"):
        render(np.ones((40, 40)), calibration, 45.0)


def test_allocations_that_do_not_fit_are_refused_first(monkeypatch, rng):
    monkeypatch.setattr(memory, "available", lambda: 20_000)
    views = field(rng)
    for call, match in (
        (
            lambda: decode(np.ones((35, 42)), CALIBRATION),
            r"a light field of 7 x 7 views needs .* GiB but .* fewer",
        ),
        (
            lambda: refocus_stack(views, [1.0] * 9, oversample=1),
            r"a stack of 9 pictures, 1 samples per lenslet needs",
        ),
        (lambda: refocus_fourier(views, 1.1), "the spectrum of the light field needs"),
        (
            lambda: render(np.ones((35, 42)), CALIBRATION, 3.0, samples=40),
            "a picture of 40 samples per lenslet",
        ),
        (lambda: encode(views, CALIBRATION), "the raw image needs"),
    ):
        with pytest.raises(LumigraphError, match=match):
            call()
