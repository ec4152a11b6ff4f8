"""Decoding: where samples stand, what bad pixels do, distorted lattices, and images of the other camera."""

import warnings

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.core.warp import Warp
from lumigraph.errors import CalibrationError, GeometryError, SamplingWarning
from lumigraph.rendering import decode, hot_pixels, interpolate, refocus
from lumigraph.rendering.kind_check import focused_shift

NONE = np.zeros((0, 2))
LATTICES = {
    "square": Lattice.square(9.3, 0.02, (70.2, 80.9)),
    "hexagonal": Lattice.hex(9.6, -0.02, (70.2, 80.9)),
    "hexagonal columns": Lattice.hex(9.6, np.pi / 6 + 0.01, (70.2, 80.9)),
}


def calibrated(lattice, shape=(140, 160), **more):
    return Calibration(lattice, shape, NONE, NONE, 0.0, **more)


def per_lenslet(calibration, function):
    """Raw image (y, x) in which each micro-image has one value, a function of its centre (y, x)."""
    y, x = np.mgrid[: calibration.shape[0], : calibration.shape[1]].astype(float)
    centers = calibration.position(np.stack(calibration.index(y, x), -1))
    return function(centers[..., 0], centers[..., 1])


@pytest.mark.parametrize("name", LATTICES)
@pytest.mark.parametrize("samples", [1, 3])
def test_samples_stand_where_the_grid_says(name, samples):
    calibration = calibrated(LATTICES[name])
    raw = per_lenslet(calibration, lambda y, x: 3 * y + 5 * x)
    views = decode(raw, calibration, directions=3, samples=samples)
    angle = calibration.lattice.rotation if "columns" not in name else 0.01
    # Lengths are in pitches of the raw image over 1 + b/F, with F/b = 20, from the middle pixel.
    scale = calibration.lattice.pitch
    t, s = np.meshgrid(views.lenslets.y * scale, views.lenslets.x * scale, indexing="ij")
    y, x = 70 + t * np.cos(angle) + s * np.sin(angle), 80 - t * np.sin(angle) + s * np.cos(angle)
    middle = views.data[1, 1]
    inner = slice(3 * samples, -3 * samples)  # the edges are repeated, and taps reach two lenslets
    # Half a sample's error would be 5 x 9.3 / 2 = 23, an exchanged half pitch of odd rows as much.
    np.testing.assert_allclose(middle[inner, inner], (3 * y + 5 * x)[inner, inner], atol=1e-6)


@pytest.mark.parametrize("name", ["hexagonal", "hexagonal columns"])
def test_hexagonal_views_have_square_pixels(name):
    views = decode(np.ones((140, 160)), calibrated(LATTICES[name]))
    pitch_t, pitch_s = views.lenslets.pitch
    assert pitch_t == pytest.approx(pitch_s, rel=1e-9)
    # In pitches, as no length is known; √3/2 of one is the distance of the rows.
    assert pitch_t == pytest.approx(np.sqrt(3) / 2, rel=1e-9)


def test_finer_samples_hold_the_lenslets_own(rng):
    calibration, raw = calibrated(LATTICES["square"]), rng.random((140, 160))
    plain, fine = decode(raw, calibration), decode(raw, calibration, samples=4)
    np.testing.assert_allclose(fine.data[:, :, ::4, ::4], plain.data, atol=1e-12)
    assert fine.lenslets.pitch[0] == pytest.approx(plain.lenslets.pitch[0] / 4)


@pytest.mark.filterwarnings("ignore:this looks like")
def test_band_limited_interpolation_is_the_most_exact_and_linear_the_least():
    calibration = calibrated(Lattice.square(20.5, 0.0, (70.3, 80.4)))
    y, x = np.mgrid[:140, :160]
    raw = np.cos(2 * np.pi * (0.17 * y + 0.11 * x))
    errors = []
    for interpolation in ("linear", "cubic", "band_limited"):
        views = decode(raw, calibration, interpolation=interpolation)
        v, u = (np.arange(20) - 10 for _ in range(2))
        centers = calibration.lattice.position(np.array([[0, 0], [1, 1]]))
        t, s = (
            int(np.argmin(np.abs(axis * 20.5 + middle - center)))
            for axis, middle, center in zip(
                (views.lenslets.y, views.lenslets.x), (70, 80), centers[1], strict=True
            )
        )
        truth = np.cos(
            2 * np.pi * (0.17 * (centers[1, 0] - v)[:, None] + 0.11 * (centers[1, 1] - u)[None, :])
        )
        errors.append(np.abs(views.data[:, :, t, s] - truth).max())
    assert errors[2] < 0.6 * errors[1] < 0.3 * errors[0]


def test_hot_pixels_are_found_and_real_details_are_not(rng):
    y, x = np.mgrid[:60, :70]
    raw = 100 + 60 * np.sin(y / 2) * np.cos(x / 3) + rng.normal(0, 2, (60, 70))
    hot = np.zeros(raw.shape, bool)
    hot[rng.integers(2, 58, 12), rng.integers(2, 68, 12)] = True
    shining = np.where(hot, 1500.0, raw)
    np.testing.assert_array_equal(hot_pixels(shining), hot)
    assert not hot_pixels(raw).any()
    dark = np.where(hot, 40.0, rng.normal(3, 1, raw.shape))
    found = hot_pixels(raw, dark=dark)
    assert found[hot].all()
    assert found.sum() <= hot.sum() + 1
    mosaic = np.where((np.add.outer(np.arange(60), np.arange(70)) % 2) == 0, raw, 0.1 * raw)
    assert not hot_pixels(RawImage(mosaic, bayer="GRBG")).any()


def test_bad_pixels_are_filled_and_marked(xp, rng):
    calibration = calibrated(Lattice.square(10.0, 0, (5, 5)), (60, 70))
    raw = np.full((60, 70, 3), 7.0, np.float32)
    bad = rng.random((60, 70)) < 0.02
    bad[21:30, 31:40] = True  # a dead micro-image
    spoilt = np.where(bad[..., None], np.float32(5000), raw)
    views = decode(xp.asarray(spoilt), calibration, bad=xp.asarray(bad))
    valid = to_numpy(views.valid)
    assert views.valid.shape == views.data.shape[:4]
    np.testing.assert_allclose(to_numpy(views.data)[valid], 7, rtol=1e-5)
    assert not valid[4:7, 4:7, 2, 3].any()
    assert valid.mean() > 0.9
    np.testing.assert_allclose(to_numpy(refocus(views, 1.02, oversample=1)), 7, rtol=1e-4)
    assert decode(raw, calibration).valid is None


def test_lenslets_that_the_calibration_misses_are_not_valid():
    lattice = Lattice.hex(9.6, 0.0, (70.2, 80.9))
    for turned in (lattice, Lattice.hex(9.6, np.pi / 6, (70.2, 80.9))):
        missing = np.array([[0, 0]])
        views = decode(np.ones((140, 160)), calibrated(turned, missing=missing))
        lost = np.argwhere(~views.valid[5, 5])
        places = np.stack([views.lenslets.y[lost[:, 0]], views.lenslets.x[lost[:, 1]]], -1) * 9.6
        assert 0 < len(lost) <= 3
        # Lenslet (0, 0) stands 0.2 px below and 0.9 px right of the middle pixel.
        assert np.abs(places - (0.2, 0.9)).max() < 9.6


@pytest.mark.parametrize(("pitch", "views"), [(14.99976, 15), (14.96, 15), (14.9, 14), (15.04, 15)])
def test_a_pitch_that_is_whole_but_for_its_error_gives_as_many_views(pitch, views):
    """A rectified picture of 15 px was measured as 14.99976 px and gave 14 x 14 views."""
    found = decode(np.ones((95, 95)), calibrated(Lattice.square(pitch, 0.0, (47, 47)), (95, 95)))
    assert found.data.shape[:2] == (views, views)


@pytest.mark.filterwarnings("ignore:the raw image repeats every")  # on the lattice that is not distorted
@pytest.mark.parametrize("name", LATTICES)
def test_a_distorted_lattice_is_decoded_on_its_own_centres(name):
    # 4 px at the corners, almost half a pitch.
    bent = calibrated(LATTICES[name], warp=Warp((70.0, 80.0), (1e-4, 0.0), 4e-6))
    y, x = np.mgrid[:140, :160].astype(float)
    spots = 1.0 * (np.hypot(*bent.offset(y, x)) < 3)
    middle = decode(spots, bent, directions=3).data[1, 1]
    assert middle.min() > 0.9
    assert decode(spots, calibrated(LATTICES[name]), directions=3).data[1, 1].min() < 0.6


def sharp_micro_images(ratio, pitch=30.0, shape=(240, 300)):
    """Raw image of a camera 2.0 that looks at a pattern of edges."""
    lattice = Lattice.square(pitch, 0.0, (120.3, 150.2))
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    dy, dx = lattice.offset(y, x)
    row, column = y - dy - dy / ratio, x - dx - dx / ratio
    edges = np.sign(np.sin(column / 21) + np.sin(row / 17 + column / 50))
    return 1 + 0.4 * edges, calibrated(lattice, shape)


@pytest.mark.parametrize("ratio", [0.4, -0.3])
def test_a_raw_image_of_a_camera_2_is_told_with_its_patch(ratio):
    raw, calibration = sharp_micro_images(ratio)
    assert focused_shift(raw, calibration) == pytest.approx(30 * ratio, abs=1.5)
    with pytest.warns(SamplingWarning, match=r"camera 2\.0.*\n?.*Use render with patch="):
        decode(raw, calibration, directions=3)


@pytest.mark.parametrize("alpha", [0.9, 0.95, 1.0, 1.08])
def test_a_raw_image_of_a_camera_1_is_not(alpha):
    pitch, ratio, shape = 30.0, 20.0, (240, 300)
    calibration = calibrated(Lattice.square(pitch, 0.0, (120.3, 150.2)), shape)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    dy, dx = calibration.lattice.offset(y, x)
    total, parts = 0.0, (np.arange(11) - 5) / 11 * pitch
    # Each lenslet gathers the light of its whole pitch: x - u (1 - α') over 11 x 11 places x of it.
    for part_y in parts:
        for part_x in parts:
            row = y - dy + part_y + dy * ratio * (1 - alpha)
            column = x - dx + part_x + dx * ratio * (1 - alpha)
            total = total + np.sign(np.sin(column / 21) + np.sin(row / 17 + column / 50)) / 121
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        decode(1 + 0.4 * total, calibration, directions=3)


def test_masks_and_images_of_other_sizes_are_refused():
    calibration, raw = calibrated(LATTICES["square"]), np.ones((140, 160))
    with pytest.raises(CalibrationError, match=r"bad has shape \(3, 3\) but the raw image has 140 x 160"):
        decode(raw, calibration, bad=np.zeros((3, 3), bool))
    with pytest.raises(CalibrationError, match="bad marks every pixel"):
        decode(raw, calibration, bad=np.ones((140, 160), bool))
    with pytest.raises(GeometryError, match="samples is 0 but must be a whole number of at least 1"):
        decode(raw, calibration, samples=0)
    with pytest.raises(CalibrationError, match="dark image has 3 x 3 pixels but the raw image 140 x 160"):
        hot_pixels(raw, dark=np.ones((3, 3)))
    with pytest.raises(CalibrationError, match="sigmas is 0 but must be above 0"):
        hot_pixels(raw, sigmas=0)


@pytest.mark.parametrize("tail", [(), (3,)])
def test_many_positions_take_the_values_of_single_ones(rng, tail):
    """They are taken in blocks, which is no business of theirs."""
    image = rng.random((40, 50, *tail)).astype(np.float32)
    y, x = rng.uniform(0, 39, (90, 1)), rng.uniform(0, 49, (1, 101))
    together = interpolate.sample(image, y, x)
    assert y.size * x.size > interpolate._BLOCK
    one_by_one = np.stack([interpolate.sample(image, row, x[0]) for row in y])
    np.testing.assert_array_equal(together, one_by_one)
    assert together.dtype == np.float32
