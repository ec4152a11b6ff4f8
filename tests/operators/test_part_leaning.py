"""Cameras whose array or sensor leans, with derivatives: beside simulations of other tilts; transposed."""

import numpy as np
import pytest

import lumigraph as lg
from cameras import focused
from lumigraph.operators.lenslets.part_leaning import TiltedImages, TiltedPoints
from lumigraph.operators.lenslets.part_plane import PartPlane
from lumigraph.operators.lenslets.part_points import PartPoints
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.lenslets.tilted_planes import flat

POINTS = lg.Points(np.array([[90e-6, -60e-6, 0.0], [-150e-6, 40e-6, 0.4e-3]]), np.array([1.0, 0.6]))
STILL = {"sensor_tilt": (0.02, 0.0), "array_tilt": (0.0, 0.015), "array_bow": 4e-6}
MOVES = {
    "sensor_tilt": ((0.02, 0.0), (1.0, 0.0)),
    "array_tilt": ((0.0, 0.015), (0.0, 1.0)),
    "array_bow": (4e-6, 1e-3),
}


def camera(built=None, **changes):
    """Lenslets of f/21 before a lens of f/21."""
    given = {"focal_length": 1.4e-3, "count": (3, 3), "pixel_pitch": 3e-6} | changes
    return focused(**given).replace(built=built or {})


def moved(still, key, step):
    """As built, with one number changed by a step."""
    at, way = MOVES[key]
    at = still.get(key, np.zeros_like(at) if np.ndim(at) else 0.0)
    new = np.add(at, np.multiply(step, way))
    return still | {key: tuple(new.tolist()) if np.ndim(new) else float(new)}


def off(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


def seen(built):
    """Before the camera as built, by distances of its own."""
    optics = camera(built).optics()
    if optics.lean is None:
        return points_image(optics, POINTS, 1e-3).astype(float)
    return flat(optics, 1e-3).image(lambda one: points_image(one, POINTS, 1e-3))


@pytest.mark.parametrize(
    ("key", "still"),
    [
        pytest.param(
            key, still, id=f"{key}-{'leaning' if still else 'upright'}",
            marks=pytest.mark.long if still and key != "sensor_tilt" else (),
        )
        for key in MOVES for still in ({}, STILL)
    ],
)  # fmt: skip
def test_images_change_with_a_tilt_as_simulations_do(key, still):
    """From -4 to 4 mrad; the simulations' distances are others, each camera's own."""
    pair = tuple(camera(moved(still, key, step)) for step in (-1e-5, 1e-5))
    images = camera(still).part_images([pair], accuracy=2e-3)
    assert isinstance(images, TiltedImages)
    assert off(images.forward(POINTS), seen(still)) < 5e-3
    low, high = (seen(moved(still, key, step)) for step in (-4e-3, 4e-3))
    assert off(400 * images.derivative(POINTS, np.ones(1)), high - low) < 0.05


def pairs():
    """By a tilt, by the lenslets' focal length, and by the wavelength."""
    tilts = (camera(moved(STILL, "array_tilt", step)) for step in (-1e-4, 1e-4))
    lengths = (camera(STILL, focal_length=1.4e-3 + step) for step in (-1e-7, 1e-7))
    colours = (camera(STILL).replace(wavelength=w) for w in (632.9e-9, 633.1e-9))
    return [tuple(tilts), tuple(lengths), tuple(colours)]


def test_the_gradient_is_the_derivatives_transpose(rng):
    images = camera(STILL).part_images(pairs())
    change, weights = rng.standard_normal(3), rng.standard_normal(images.shape)
    there = np.vdot(weights, images.derivative(POINTS, change))
    assert images.gradient(POINTS, weights) @ change == pytest.approx(there, rel=1e-9, abs=0)


def test_points_one_by_one_go_back_to_what_their_images_change_by(rng):
    images, one = camera(STILL).part_images(pairs()), lg.Points(POINTS.positions[1:], np.ones(1))
    points = TiltedPoints(
        [PartPoints(part, one, [(one, one)] * 3) for part in images.parts], images.weights, images.moved
    )
    lit, back = points.lit(0)
    given = np.zeros_like(lit)
    given[0] = rng.standard_normal(images.shape)
    back(given)
    changes = [np.vdot(given[0], images.derivative(one, way)) for way in np.eye(3)]
    assert off(lit[0], images.forward(one)) < 1e-12
    assert points.along() == pytest.approx(np.array(changes), rel=1e-9, abs=0)


def test_planes_and_volumes_are_those_of_the_same_flat_cameras():
    """Whose weights go with them, as before points."""
    one, grid, both = camera(STILL), lg.Grid.square(6, 60e-6), pairs()
    images, plane = one.part_images(both), one.part_plane(both, grid, 0.2e-3)
    assert [part.images.camera for part in plane.parts] == [part.camera for part in images.parts]
    assert {type(part) for part in plane.parts} == {PartPlane}
    assert np.array_equal(plane.weights, images.weights)
    assert np.array_equal(plane.moved, images.moved)
    volume = one.part_volume(both, grid, (0.0, 0.2e-3))
    assert [type(part) for part in volume.planes] == [TiltedImages, TiltedImages]
    assert volume.shape == (one.sensor.shape, (2, 6, 6))


@pytest.mark.long
def test_planes_change_with_the_tilt_as_the_operator_has_it():
    """From upright to tilts that change them by 5e-3, of images to 1e-2; the border's error goes out."""
    grid, changes = lg.Grid.square(8, 25e-6), []
    x = np.random.default_rng(0).random(grid.shape)
    for of in (
        lambda one: one.part_plane([], grid, 0.2e-3).forward(x),
        lambda one: one.operator_on(grid, [0.2e-3], accuracy=3e-3).forward(x[None]),
    ):
        tilted, upright = (
            of(camera(built)) for built in ({"array_tilt": (0.04, 0.0), "sensor_tilt": (0.0, 0.05)}, {})
        )
        changes.append(tilted - upright)
    assert off(*changes) < 0.25


def test_the_bound_before_a_camera_that_leans_is_that_of_bounds():
    one, light = camera(STILL), lg.information.Light(5000)
    pair = tuple(camera(moved(STILL, "sensor_tilt", step)) for step in (-1e-4, 1e-4))
    found = lg.information.slopes(one, [pair], [0.3e-3], light, places=1)
    known = lg.information.bounds(one, [0.3e-3], light, places=1)
    assert found.bound == pytest.approx(known.depth, rel=3e-3, abs=0)
    assert (known.errors == 0).all()


def test_bounds_of_a_bowed_array_are_of_its_bow_not_of_its_cut_ones():
    """They are computed of few lenslets amid the array; in all of them the bow would be larger."""
    bowed = camera({"array_bow": 60e-6}, count=(41, 41))
    cut = lg.information.points.small(bowed, np.array([0.3e-3]))
    assert cut.lenslets.count[0] < 20
    assert cut.lean.bow == pytest.approx(bowed.lean.bow, rel=1e-9, abs=0)
