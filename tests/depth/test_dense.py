"""Depth of each pixel of a 2.0 picture: scenes by rays and by wave optics, and what is refused."""

import numpy as np
import pytest
from benchmarks.pixel_depth import CAMERAS, EVEN, SHAPE, grating, plain
from scenes import texture, traced_raw
from scipy.ndimage import distance_transform_edt

from lumigraph import targets
from lumigraph.core.arrays import namespace
from lumigraph.core.grid import Grid
from lumigraph.depth import cloud, correlation, dense, metric
from lumigraph.depth.micro_images import MicroImages
from lumigraph.depth.repeats import of_micro_images
from lumigraph.errors import CalibrationError, GeometryError, SamplingWarning
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.preparation import prepare
from lumigraph.rendering import render, sight_grid
from lumigraph.rendering.patches import Patches, PatchLayout
from lumigraph.scene import Scene, Slice
from lumigraph.simulation import Incoherent, simulate


def measured(name, surfaces, truth, noise=0.01):
    """The map, the truth on its grid (y, x), and how many samples the map is off in each place."""
    lattice, focus = CAMERAS[name]
    raw, calibration = traced_raw(lattice, SHAPE, surfaces, focus)
    raw = raw + noise * np.random.default_rng(5).standard_normal(raw.shape)
    lenslets = correlation(raw, calibration)
    found = dense(raw, calibration, lenslets, focus=focus if len(focus) > 1 else None)
    layout = PatchLayout.of(calibration, Patches.of(lenslets.values, calibration), None)
    assert found.shape == render(raw, calibration, lenslets.values).shape
    return found, truth(layout.y[:, None], layout.x)


@pytest.mark.parametrize("name", CAMERAS)
def test_a_disc_before_a_plane_has_its_outline_to_two_samples(name):
    """A map of lenslets, 5 to 7 samples wide, would be 3 off."""
    near, far = (-5.0, -7.0) if name == "Galilean" else (7.0, 5.0)
    rng = np.random.default_rng(1)
    paints = texture(rng, waves=12, longest=0.6), texture(rng, waves=12, longest=0.6)

    def disc(y, x):
        return np.hypot(y - 75, x - 85) < 42

    surfaces = (paints[0], lambda y, x: near, disc), (paints[1], lambda y, x: far, None)
    found, truth = measured(name, surfaces, lambda y, x: np.where(disc(y, x), near, far))
    assert np.median(np.abs(found.values - truth)) < 0.03
    inside, seen = truth == near, np.abs(found.values - near) < 1
    beyond = np.where(inside, distance_transform_edt(inside), distance_transform_edt(~inside))
    assert beyond[inside != seen].max(initial=0) <= 2
    # Ten places at the outline are off by 2 px: one that is wrong is wrong
    error = np.minimum(np.abs(found.values - truth), 0.3)
    assert np.corrcoef(found.confidence.ravel(), error.ravel())[0, 1] < -0.25


@pytest.mark.parametrize("name", CAMERAS)
def test_a_slanted_plane_is_smooth_and_right(name):
    sign = -1 if name == "Galilean" else 1

    def slant(y, x):
        return sign * (6.0 + (x - 85) * 0.012 + (y - 75) * 0.004)

    found, truth = measured(
        name, ((texture(np.random.default_rng(1), waves=12, longest=0.6), slant, None),), slant
    )
    error = np.abs(found.values - truth)
    assert np.median(error) < 0.015
    assert np.quantile(error, 0.98) < 0.15
    assert found.error is not None
    assert 0.5 < np.mean(found.error) / np.mean(error) < 2.6


@pytest.mark.parametrize("name", CAMERAS)
def test_a_bent_surface_is_not_flattened_and_its_error_is_told(name):
    """With fine texture taken for noise the surface is so stiff that it is off by 0.1 px; told is a fifth."""
    sign = -1 if name == "Galilean" else 1

    def bent(y, x):
        return sign * (6.0 + 0.8 * np.sin(x / 18) * np.cos(y / 25))

    paint = texture(np.random.default_rng(1), waves=12, longest=0.6)
    found, truth = measured(name, ((paint, bent, None),), bent)
    error = np.abs(found.values - truth)
    assert np.mean(error) < 0.035
    assert 0.5 < np.mean(found.error) / np.mean(error) < 2.6


def test_a_texture_that_repeats_is_not_trusted():
    """Waves of 6 px are as well explained by patches 28 % larger or smaller: off by 3.3 px, told as 0.08."""

    def waves(y, x):
        return 1 + 0.4 * np.cos(2 * np.pi / 6 * y + 1) + 0.4 * np.cos(2 * np.pi / 6 * x + 2)

    surfaces = ((waves, lambda y, x: 5.08, None),)
    with pytest.warns(SamplingWarning, match="about as well as those from"):
        found, truth = measured("three kinds", surfaces, lambda y, x: 5.08 + 0 * y * x)
    error = np.abs(found.values - truth)
    assert np.median(error) > 1
    assert np.median(found.confidence) < 0.1
    assert found.error.mean() > 0.5


@pytest.mark.parametrize("name", ["square", "three kinds"])
def test_noise_matches_by_chance(name):
    lattice, focus = CAMERAS[name]
    raw, calibration = traced_raw(lattice, SHAPE, EVEN, focus)
    raw = np.maximum(raw + 0.3 * np.random.default_rng(5).standard_normal(raw.shape), 0)
    lenslets = correlation(raw, calibration, (4, 9))
    with pytest.warns(
        SamplingWarning, match="100% of the places match no better than by chance: .* lenslets="
    ):
        found = dense(raw, calibration, lenslets, focus=focus if len(focus) > 1 else None)
    assert np.asarray(found.confidence).max() < 0.1
    assert (found.error / np.abs(found.values)).min() > 0.8


def test_a_grating_may_be_off_by_its_period_in_the_micro_images():
    """Of 12 px, shown 6/21.3 as large: patches of 6 - 3.38 and 6 + 3.38 px would show it as well."""
    lattice, focus = CAMERAS["square"]
    raw, calibration = traced_raw(lattice, SHAPE, grating(12, 6.0), focus)
    raw = raw + 0.01 * np.random.default_rng(5).standard_normal(raw.shape)
    found = dense(raw, calibration, correlation(raw, calibration, (5, 7)))
    assert np.median(np.abs(found.values - 6)) < 0.05
    assert np.median(found.error) == pytest.approx(12 * 6 / 21.3, rel=0.05)
    assert np.median(found.confidence) < 0.01


def test_of_a_texture_that_does_not_repeat_no_micro_image_looks_like_itself_elsewhere():
    lattice, focus = CAMERAS["three kinds"]
    raw, calibration = traced_raw(lattice, SHAPE, plain(6.0), focus)
    assert not of_micro_images(MicroImages.read(np.sqrt(raw), calibration, 9.0), 10.0, 0.01).any()
    raw, calibration = traced_raw(lattice, SHAPE, [(stripes, lambda y, x: 6.0 + 0 * y * x, None)], [6.0] * 3)
    found = of_micro_images(MicroImages.read(np.sqrt(raw), calibration, 9.0), 10.0, 0.01)
    # Along x the neighbours stand 1 and 1/2 pitches away: two periods look alike to both.
    assert np.median(found) == pytest.approx(2 * 12 * 6 / 21.3, rel=0.05)


def stripes(y, x):
    return 1 + 0.4 * np.cos(2 * np.pi / 12 * x) + 0 * y


def test_libraries_progress_and_grid(xp):
    lattice, focus = CAMERAS["square"]
    surfaces = ((texture(np.random.default_rng(1), waves=12, longest=0.6), lambda y, x: 6.0, None),)
    raw, calibration = traced_raw(lattice, (110, 120), surfaces, focus)
    seen = []
    found = dense(xp.asarray(raw.astype(np.float32)), calibration, samples=4, progress=seen.append)
    assert namespace(found.values) is namespace(xp.asarray(raw))
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1)
    assert sight_grid(calibration, 6.0, 4).shape == found.shape


def test_an_even_picture_has_no_confidence():
    lattice, _ = CAMERAS["square"]
    raw, calibration = traced_raw(
        lattice, (110, 120), ((lambda y, x: 1 + 0 * y, lambda y, x: 6.0, None),), [6]
    )
    found = dense(raw, calibration)
    assert np.asarray(found.confidence).max() < 0.05
    assert np.isfinite(found.values).all()


def test_patches_at_the_end_of_those_tried_are_told():
    lattice, _ = CAMERAS["square"]
    paint = texture(np.random.default_rng(1), waves=12, longest=0.6)
    planes = (paint, lambda y, x: 9.5, lambda y, x: x > 80), (paint, lambda y, x: 4.5, None)
    raw, calibration = traced_raw(lattice, SHAPE, planes, [6])
    with pytest.warns(SamplingWarning, match=r"of the places have patches at the end of those tried"):
        dense(raw, calibration, correlation(raw, calibration, (4, 6)))
    found = dense(raw, calibration, correlation(raw, calibration))
    right = np.asarray(found.values)[:, -8:]
    assert np.median(right) == pytest.approx(9.5, rel=0.01)


def test_what_does_not_fit_is_refused(monkeypatch):
    lattice, _ = CAMERAS["square"]
    raw, calibration = traced_raw(
        lattice, (110, 120), ((lambda y, x: 1 + 0 * y, lambda y, x: 6.0, None),), [6]
    )
    with pytest.raises(GeometryError, match="focus is"):
        dense(raw, calibration, focus=[5, 6, 7])
    with pytest.raises(CalibrationError, match="1 whole lenslets across but"):
        dense(*traced_raw(lattice, (26, 60), ((lambda y, x: 1 + 0 * y, lambda y, x: 6.0, None),), [6]))
    lenslets = correlation(raw, calibration)
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: 400_000)
    with pytest.raises(ValueError, match=r"sizes for .* samples needs"):
        dense(raw, calibration, lenslets)


def stepped(camera, near, far, count=8):
    """Two textured planes above, a slanted one below; and its depth at (y, x) of the focused plane [m]."""
    own = camera.object_grid
    grid = Grid(tuple(int(1.2 * n) // 2 * 2 + 1 for n in own.shape), own.pitch, own.center)
    paints = [texture(np.random.default_rng(seed), longest=1.0) for seed in (3, 4)]
    width, unit = 0.75 * float(own.x.max()), 14e-6

    def depth(y, x):
        slant = near + (far - near) * np.clip((x / width + 1) / 2, 0, 1)
        return np.where(y < 0, np.where(x < 0, near, far), slant + 0 * y)

    planes = np.linspace(near, far, count)
    parts = []
    for dz in planes:  # the slanted plane as thin ones that share its light
        y, x = (a / (1 + dz / camera.object_distance) for a in (grid.y[:, None], grid.x))
        share = np.clip(1 - np.abs(depth(y, x) - dz) / (planes[1] - planes[0]), 0, 1)
        paint = np.where((y < 0) & (x >= 0), paints[1](y / unit, x / unit), paints[0](y / unit, x / unit))
        parts.append(Slice(np.maximum(paint, 0) * share, grid, float(dz)))
    return Scene(tuple(parts)), depth


@pytest.mark.long  # 20 and 80 s of wave optics
@pytest.mark.parametrize(
    ("lenslets", "planes", "divide"),
    [
        ({"focal_length": "3 mm", "count": (11, 11)}, 8, False),
        ({"focal_length": "3 mm", "count": (11, 11)}, 8, True),
        ({"focal_length": ["3 mm", "3.1 mm", "2.9 mm"], "count": (9, 9), "layout": "hex"}, 5, False),
    ],
    ids=["one kind", "divided by white", "three kinds"],
)
def test_wave_optics_of_two_planes_and_a_slanted_one(lenslets, planes, divide):
    """Within 5 % of the depth of field of the whole aperture, 1.7 mm, and edges within two samples."""
    camera = FocusedPlenopticCamera(
        wavelength="633 nm", object_distance="120 mm", main_lens={"focal_length": "60 mm"},
        lenslets={"pitch": "150 um", "magnification": 0.3, **lenslets}, sensor={"pixel_pitch": "6 um"},
    )  # fmt: skip
    scene, truth = stepped(camera, -1.5e-3, 3e-3, planes)
    raw, calibration = simulate(camera, scene, Incoherent(1e-2)), camera.calibration
    if divide:  # what was divided out still tells where lenslets are lit in part: without it 0.21 mm
        raw = prepare(raw, calibration, white=simulate(camera, targets.white(), Incoherent(1e-2)))
    focus = camera.patches_on_raw() if calibration.lattice.kinds > 1 else None
    lenslets = correlation(raw, calibration)
    found = dense(raw, calibration, lenslets, focus=focus)
    found = metric(found, calibration, focal_length=0.06, object_distance=0.12)
    grid = sight_grid(calibration, lenslets.values)
    scale = camera.object_distance / camera.separation
    y, x = grid.y[:, None] * scale, grid.x * scale
    error = np.abs(found.values - truth(y, x))
    field = next(row.value for row in camera.trade_offs() if row.name == "depth of field")
    assert np.median(error) < 0.05 * field
    assert np.mean(found.error) / np.mean(error) == pytest.approx(1, abs=0.4 if divide else 0.3)
    above = y[:, 0] < -0.1e-3
    wrong = (np.asarray(found.values)[above] > 0.75e-3) != (x > 0)
    assert wrong.sum(1).max() <= 2
    points = cloud(found, calibration, object_distance=0.12, min_confidence=0.0, grid=grid)
    assert np.ptp(points.points[:, 2]) == pytest.approx(np.ptp(x), rel=0.05)
