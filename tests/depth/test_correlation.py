"""Patches of raw images in closed form, of a simulated camera, of a real one, and what is refused."""

import numpy as np
import pytest
from scenes import focused_raw, texture

import lumigraph.io as io
from data_folder import real
from lumigraph.calibration import devignette
from lumigraph.core.arrays import namespace, to_numpy
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.depth import correlation, metric, virtual_depth
from lumigraph.errors import CalibrationError, GeometryError, SamplingWarning
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.preparation import prepare
from lumigraph.rendering import render
from lumigraph.rendering.patches import lenslet_indices
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import Incoherent, simulate

LATTICES = {
    "square": Lattice.square(17.3, 0.01, (7, 7)),
    "hex": Lattice.hex(19.4, 0.02, (9, 9)),
    "three kinds": Lattice.hex(19.4, 0.0, (9, 9), kinds=3),
}


def scene(name="square", patch=5.3, shape=(180, 220), seed=1):
    lattice = LATTICES[name]
    blur = (lambda kind: np.array([1, 0.5, 0.2])[kind]) if lattice.kinds == 3 else None
    size = patch if callable(patch) else (lambda y, x: patch + 0 * y)
    return focused_raw(lattice, shape, texture(np.random.default_rng(seed), longest=0.35), size, blur)


@pytest.mark.parametrize("name", LATTICES)
@pytest.mark.parametrize("patch", [5.3, -4.2, 9.1, -8.2])
def test_patches_of_both_signs_are_found_to_a_fraction_of_a_pixel(name, patch):
    raw, calibration = scene(name, patch)
    found = correlation(raw, calibration)
    assert found.shape == lenslet_indices(calibration).shape[:2]
    assert (found.quantity, found.unit) == ("patch", "px")
    # Steps are 0.5 px apart: without the parabola half of the lenslets would be 0.1 px off or more.
    assert np.median(np.abs(found.values - patch)) < 0.02
    assert np.median(found.confidence) > 0.8


def test_noise_of_five_percent_does_no_harm(rng):
    raw, calibration = scene("three kinds", -8.2)
    found = correlation(raw + 0.05 * rng.standard_normal(raw.shape), calibration)
    assert np.median(np.abs(found.values + 8.2)) < 0.04


@pytest.mark.parametrize("name", ["square", "hex"])
def test_two_depths_stay_apart_where_they_are(name):
    raw, calibration = scene(name, lambda y, x: np.where(x < 110, 4.5, 7.5), shape=(180, 260))
    found = correlation(raw, calibration)
    x = calibration.position(lenslet_indices(calibration))[..., 1]
    pitch = calibration.lattice.pitch
    near, far = x < 110 - 1.5 * pitch, x > 110 + 1.5 * pitch
    assert np.abs(found.values - 4.5)[near].max() < 0.15
    assert np.abs(found.values - 7.5)[far].max() < 0.15


@pytest.mark.parametrize(("patch", "patches"), [(4.2, (6, 9)), (9.1, (3, 6)), (-4.2, (-9, -6))])
def test_a_size_beyond_those_tried_is_not_trusted(patch, patches):
    raw, calibration = scene("square", patch)
    found = correlation(raw, calibration, patches)
    inner = (slice(2, -2), slice(2, -2))
    assert np.quantile(found.confidence[inner], 0.9) < 0.1  # it was 0.8: agreement grows towards the end
    inside = correlation(
        raw, calibration, (patch / 2, patch * 1.6) if patch > 0 else (patch * 1.6, patch / 2)
    )
    assert np.median(inside.confidence[inner]) > 0.5


def test_the_map_renders_what_one_size_does():
    raw, calibration = scene("hex", 5.3)
    found = correlation(raw, calibration)
    one, each = render(raw, calibration, 5.3), render(raw, calibration, found.values, samples=5)
    inner = (slice(10, 30), slice(10, 30))
    np.testing.assert_allclose(each[inner], one[inner], atol=0.15)
    assert np.abs(each[inner] - one[inner]).mean() < 0.02


def test_libraries_colours_and_precision_come_back(xp):
    raw, calibration = scene(patch=5.3, shape=(110, 120))
    colour = xp.asarray(np.stack([raw, 0.5 * raw, 0.2 * raw], -1).astype(np.float32))
    found = correlation(colour, calibration, (4, 7))
    assert namespace(found.values) is namespace(colour)
    assert found.values.dtype == colour.dtype
    assert np.median(np.abs(to_numpy(found.values) - 5.3)) < 0.03


def test_even_pictures_have_no_confidence_and_finite_patches():
    _, calibration = scene()
    found = correlation(np.ones(calibration.shape), calibration)
    assert np.asarray(found.confidence).max() < 0.05
    # Nothing is known: the middle of the sizes tried, 0.08 to 0.6 of the pitch of either sign, not their end.
    np.testing.assert_allclose(np.abs(found.values), 0.34 * calibration.lattice.pitch, atol=0.5)


@pytest.mark.parametrize("patch", [5.3, -6.0])
def test_a_texture_that_repeats_does_not_show_the_sign_and_that_is_told(patch):
    """Of waves of 6 px the wrong sign scores 0.83 to 1.2 times the right one; of others, 0.61 at most."""

    def waves(y, x):
        return 1 + 0.4 * np.cos(2 * np.pi / 6 * y + 1) + 0.4 * np.cos(2 * np.pi / 6 * x + 2)

    raw, calibration = focused_raw(LATTICES["square"], (110, 120), waves, lambda y, x: patch + 0 * y)
    with pytest.warns(SamplingWarning, match=r"px explain the picture about as well as those from"):
        correlation(raw, calibration)
    correlation(raw, calibration, (3, 9) if patch > 0 else (-9, -3))


def test_progress_reaches_the_total():
    raw, calibration = scene(shape=(110, 120))
    seen = []
    correlation(raw, calibration, progress=seen.append)
    assert len(seen) > 10
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1)


def test_what_cannot_be_compared_is_refused(monkeypatch):
    raw, calibration = scene()
    for patches in ((5, 4), (-2, 3), (0, 3), (5, 30)):
        with pytest.raises(
            GeometryError, match="must ascend, have one sign, and be no larger than the pitch"
        ):
            correlation(raw, calibration, patches)
    with pytest.raises(CalibrationError, match="pixels but its calibration is for"):
        correlation(raw[:-1], calibration)
    small = focused_raw(Lattice.square(5.0), (40, 40), lambda y, x: 1 + 0 * y, lambda y, x: 2 + 0 * y)
    with pytest.raises(CalibrationError, match="5 px wide but correlation needs 6 px"):
        correlation(*small)
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: 1000)
    with pytest.raises(ValueError, match="comparing 9 x 11 micro-images of 17 px needs"):
        correlation(raw, calibration)


@pytest.fixture(scope="module")
def camera():
    return FocusedPlenopticCamera(
        wavelength="633 nm", object_distance="120 mm", main_lens={"focal_length": "60 mm"},
        lenslets={"pitch": "150 um", "focal_length": "3 mm", "count": (7, 7), "magnification": 0.3},
        sensor={"pixel_pitch": "6 um"},
    )  # fmt: skip


@pytest.mark.long  # half a minute of wave optics
@pytest.mark.parametrize(("dz", "divided"), [(0.0, True), (8e-3, False)])
def test_a_simulated_camera_tells_patch_and_distance(camera, dz, divided):
    """The shading of micro-images stands still and pulls patches to 0: in focus by 4 to 15 % undivided."""
    grid = camera.object_grid
    rng = np.random.default_rng(3)
    paint = texture(rng, longest=1.0)
    unit = 40e-6
    image = np.maximum(paint(grid.y[:, None] / unit, grid.x / unit), 0)
    raw = simulate(camera, Scene((Slice(image, grid, dz),)))
    if divided:
        raw = devignette(raw, simulate(camera, targets.white()))
    found = correlation(raw, camera.calibration)
    inner = (slice(2, -2), slice(2, -2))
    truth = camera.patch_at(dz)
    assert np.median(found.values[inner]) == pytest.approx(truth, rel=0.02)
    depth = metric(found, camera.calibration, focal_length=0.06, object_distance=0.12)
    assert np.median(np.asarray(depth.values)[inner]) == pytest.approx(dz, abs=6e-4)


@pytest.mark.long  # minutes of wave optics: a point far out of focus lights many lenslets
@pytest.mark.filterwarnings("ignore:.*min of a processor")
@pytest.mark.parametrize("dz", [-20e-3, 60e-3, -40e-3])
def test_far_out_of_focus_it_is_right_or_says_that_it_is_not(camera, dz):
    """20 mm nearer than the focus the image lies behind the sensor, and the patch changes its sign."""
    grid = camera.object_grid
    paint = texture(np.random.default_rng(3), longest=1.0)
    image = np.maximum(paint(grid.y[:, None] / 40e-6, grid.x / 40e-6), 0)
    raw = simulate(
        camera, Scene((Slice(image, grid, dz),)), Incoherent(1e-2)
    )  # far out of focus 1e-3 takes minutes
    found = correlation(raw, camera.calibration)
    inner, truth = (slice(2, -2), slice(2, -2)), camera.patch_at(dz)
    if abs(truth) < 0.08 * camera.calibration.lattice.pitch:  # smaller than any size that is tried
        assert np.asarray(found.confidence)[inner].max() < 0.1
    else:
        assert np.median(np.asarray(found.values)[inner]) == pytest.approx(truth, rel=0.1)


def test_the_real_multi_focus_camera_has_smooth_depth_without_its_lattice():
    folder = real("raytrix_r42_multifocus")
    raw = io.open(folder / "sc2_klein.png")
    assert isinstance(raw, RawImage)
    calibration = io.open(folder / "sc2_klein.xml", shape=raw.shape)
    with pytest.warns(SamplingWarning, match="maker's lattice was moved"):
        ready = prepare(raw, calibration)
    calibration = ready.calibration
    found = correlation(ready, calibration, (-12, -3))
    values, trust = np.asarray(found.values), np.asarray(found.confidence)
    assert np.median(trust) > 0.6
    depth = np.asarray(virtual_depth(found, calibration).values)
    assert 4.5 < depth.min() < depth.max() < 9
    # A lattice pattern would make lenslets of three kinds differ from each other.
    kinds = calibration.lattice.kind(*np.moveaxis(lenslet_indices(calibration), -1, 0))
    smooth = sum(np.roll(values, k, 1) for k in (-1, 0, 1))[:, 2:-2] / 3
    off = [np.mean((values[:, 2:-2] - smooth)[kinds[:, 2:-2] == kind]) for kind in range(3)]
    assert np.ptp(off) < 0.12  # patches span 2.4 px
