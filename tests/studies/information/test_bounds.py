"""Bounds of points' places beside closed forms, counted likelihoods, and errors of fits to drawn noise."""

import math

import numpy as np
import pytest
from scipy.stats import norm, poisson

import lumigraph as lg
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.studies.information import Light, bounds, trials
from lumigraph.studies.information.bounds import PointInformation, expected, fisher, reading
from lumigraph.studies.information.noise import pixel_information
from lumigraph.studies.information.points import source, spread

UM = 1e-6
PURE = {"read_noise": 0.0, "full_well": 6000, "bits": 16}


def plain(pixel=1.5, shape=(121, 121), **sensor):
    return lg.SingleLensCamera(
        wavelength="600 nm", object_distance="120 mm",
        main_lens={"focal_length": "60 mm", "diameter": "6 mm"},
        sensor={"pixel_pitch": pixel * UM, "shape": shape, **PURE, **sensor},
    )  # fmt: skip


def fourier(**changes):
    return lg.LightFieldMicroscope.from_catalogue("lfm-fourier").replace(**changes)


def test_an_airy_disc_is_placed_to_its_closed_form():
    """λ/(2π NA √N) by Ober, Ram & Ward; pixels of a 16th of the finest period and lost rings take 4 %."""
    found = bounds(plain(0.75, (481, 481)), [0.0], Light(20_000), places=1)
    least = 600e-9 / (2 * math.pi * (3 / 120) * math.sqrt(20_000))
    assert found.deviations[0, 0, :2] == pytest.approx([1.04 * least] * 2, rel=0.01)
    assert found.brightness == pytest.approx(1 / math.sqrt(20_000 * found.caught[0]), rel=1e-3)
    assert found.depth > 1e3 * found.lateral  # in focus nothing tells which side a point is on


def test_errors_fall_with_the_root_of_the_light():
    scope = fourier(sensor={**PURE, "pixel_pitch": 6.5 * UM})
    few, many = (bounds(scope, [4 * UM], Light(n), places=1).deviations for n in (1e2, 1e4))
    assert few / many == pytest.approx(np.full((1, 1, 4), 10.0), rel=1e-6)


def test_read_noise_and_background_cost_information():
    quiet, loud = (fourier(sensor={"pixel_pitch": 6.5 * UM, "read_noise": n}) for n in (0.5, 5.0))
    alone, around = Light(3000), Light(3000, 20.0)
    assert (
        bounds(loud, [4 * UM], alone, places=1).depth > 1.5 * bounds(quiet, [4 * UM], alone, places=1).depth
    )
    lit = bounds(quiet, [4 * UM], around, places=1)
    assert lit.deviations.shape == (1, 1, 5)
    assert lit.depth > 1.3 * bounds(quiet, [4 * UM], alone, places=1).depth


@pytest.mark.parametrize(("mean", "sigma"), [(0.02, 0.3), (0.7, 1.0), (3.0, 0.5), (30.0, 2.0), (150.0, 4.0)])
def test_a_pixels_information_is_that_of_its_counted_likelihood(mean, sigma):
    """Numerical derivative of the log-likelihood, summed by another rule."""
    z, k = np.linspace(-9 * sigma, mean + 14 * math.sqrt(mean) + 9 * sigma + 12, 60_001), np.arange(400)

    def p(mu):
        return sum(c * norm.pdf(z, n, sigma) for n, c in zip(k, poisson.pmf(k, mu), strict=True) if c > 1e-16)

    h = 1e-3 * mean
    slope = (p(mean + h) - p(mean - h)) / (2 * h)
    exact = np.trapezoid(slope**2 / np.maximum(p(mean), 1e-250), z)
    assert pixel_information(np.array([mean]), sigma)[0] == pytest.approx(exact, rel=2e-3)
    assert exact > 0.9999 / (mean + sigma**2)


def test_derivatives_before_a_fourier_microscope_are_those_of_its_images():
    own = {4: {"focal_change": 0.03}, 5: {"focal_change": -0.02, "offset_x": "-9 um"}}
    scope = fourier(
        objective={"aberrations": {6: 0.1, 7: 0.15}}, lenslets={"single": own, "fill_factor": 0.9}
    )
    points, at = source(scope, np.array([7 * UM]), 1e-2), np.array([1.3 * UM, -0.4 * UM, 7 * UM])
    lit, _ = points.lit(at, checked=False)
    for axis, h in enumerate((1e-9, 1e-9, 1e-8)):
        move = np.eye(3)[axis] * h
        slope = (points.image(at + move) - points.image(at - move)) / (2 * h)
        assert np.linalg.norm(slope - lit[1 + axis]) < 1e-4 * np.linalg.norm(slope)


def test_one_wide_lenslet_in_the_pupil_images_as_the_objective_does_aberrated():
    scope = fourier(
        lenslets={"pitch": "4.2 mm", "count": (1, 1)}, objective={"aberrations": {7: 0.15, 6: 0.1, 5: 0.07}},
        sensor={"pixel_pitch": "1 um", "shape": (201, 201)},
    )  # fmt: skip
    y, x, dz = 2 * UM, -1 * UM, 3 * UM
    image = source(scope, np.array([dz]), 1e-2).image(np.array([y, x, dz]))
    at = (np.arange(201) - 100) * 1e-6 / (20 / 3)  # M f_µ/f_F
    wanted = scope.objectives[0].intensity((at - y)[:, None], (at - x)[None, :], dz)
    assert np.linalg.norm(image / image.sum() - wanted / wanted.sum()) < 0.03 * np.linalg.norm(
        wanted / wanted.sum()
    )


def test_the_operator_of_a_fourier_microscope_sees_the_same_aberrations():
    scope = fourier(objective={"aberrations": {7: 0.2, 6: 0.3}})
    whole, own = scope.fourier_points().whole, scope.point_image(0.0, 0.0, 4 * UM)
    image = source(scope, np.zeros(1), 1e-2).image(np.array([0.0, 0.0, 4 * UM]))
    assert np.linalg.norm(own / whole - image) < 1e-5 * np.linalg.norm(image)
    plain = fourier().point_image(0.0, 0.0, 4 * UM)
    assert np.linalg.norm(own - plain) > 0.2 * np.linalg.norm(plain)


@pytest.mark.parametrize("name", ["thesis-plenoptic-1", "thesis-plenoptic-2-m050", "lfm-fourier"])
def test_nearly_all_light_is_caught_in_focus(name):
    camera = lg.load_camera(name)
    points = source(camera, np.zeros(1), 1e-2)
    assert 0.9 < points.image(np.zeros(3)).sum() < 1.01


def test_points_of_a_cell_repeat_from_lenslet_to_lenslet():
    camera = lg.load_camera("thesis-plenoptic-2-m050")
    points, at = source(camera, np.array([2e-3]), 1e-3), np.array([11 * UM, -40 * UM, 2e-3])
    cell = points.cell(2e-3)
    assert np.hypot(*cell[0]) == pytest.approx(150 * UM * 122 / (120 + 15.6), rel=1e-6)
    one, other = (points.image(at + np.append(move, 0)) for move in (np.zeros(2), cell[0]))
    shift = camera.micro_image_pitch / camera.sensor.pixel_pitch
    assert abs(one.sum() - other.sum()) < 5e-3
    assert abs(abs(_middle(one) - _middle(other)) - shift) < 0.05 * shift
    assert spread(cell, range(5)).shape == (5, 2)


def test_points_of_a_cell_fall_on_lenslets_of_each_kind_alike():
    camera = lg.FocusedPlenopticCamera(
        wavelength="600 nm", object_distance="120 mm", main_lens={"focal_length": "60 mm"},
        lenslets={
            "pitch": "150 um", "focal_length": ("5.2 mm", "5.0 mm", "5.4 mm"), "count": (9, 9),
            "magnification": 0.5, "layout": "hex",
        },
        sensor={"pixel_pitch": "2 um"},
    )  # fmt: skip
    cell = source(camera, np.zeros(1), 1e-2).cell(2e-3) * camera.separation / 0.122
    kinds = camera.lattice.kind(*camera.lattice.index(*spread(cell, range(3000)).T))
    assert np.bincount(kinds, minlength=3) == pytest.approx([1000] * 3, abs=15)


def _middle(image):
    return (image.sum(0) @ np.arange(image.shape[1])) / image.sum()


def test_fits_to_drawn_noise_reach_the_bound():
    found = trials(
        fourier(), (0.1 * UM, 0.2 * UM, 5 * UM), Light(5000), draws=120, rng=np.random.default_rng(1)
    )
    assert (np.abs(found.rms / found.bounds - 1) < 4 * found.rms_error / found.bounds).all()
    assert found.rms_error[2] < 0.08 * found.bounds[2]


def test_nonsense_is_refused_and_full_pixels_are_warned_of():
    scope = fourier()
    with pytest.raises(GeometryError, match="there are 0 depths"):
        bounds(scope, [])
    with pytest.raises(GeometryError, match="a depth is nan"):
        bounds(scope, [math.nan])
    with pytest.raises(GeometryError, match="photons"):
        Light(-1.0)
    with pytest.raises(GeometryError, match="background"):
        Light(10.0, -1.0)
    with pytest.raises(GeometryError, match="at most 1000"):
        bounds(scope, [0.0], places=10**6)
    with pytest.raises(GeometryError, match="inside"):
        bounds(plain(), [-0.07])
    with pytest.warns(SamplingWarning, match="full"):
        bounds(scope, [0.0], Light(1e9), places=1)


@pytest.mark.parametrize("background", [0.0, 3.0])
def test_pixels_that_a_points_light_does_not_reach_tell_the_background_alone(background):
    """All pixels one by one give the same information as those with light and the number of the others."""
    lit, sensor, light = np.zeros((4, 30, 30)), fourier().sensor, Light(1000, background)
    lit[:, 10:14, 9:13] = np.random.default_rng(1).random((4, 4, 4)) / 16
    each = fisher(*expected(sensor, light, lit), reading(sensor))
    np.testing.assert_allclose(PointInformation.of(sensor, light, lit).fisher, each, rtol=1e-12)
