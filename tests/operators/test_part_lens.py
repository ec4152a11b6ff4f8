"""Derivatives by the parts of a camera without lenslets: of points, and of bounds."""

import numpy as np
import pytest
from tests.operators.test_part_images import off

import lumigraph as lg
from lumigraph.operators.single_lens import points_image
from lumigraph.scene import Points
from lumigraph.studies.optimisation.goals import Goal
from lumigraph.units import mm, nm, um

START = {
    "object_distance": 120 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 60 * mm, "diameter": 3 * mm, "aberrations": {6: 0.3, 8: 0.2}},
    "sensor": {"pixel_pitch": 6 * um, "shape": (120, 130), "fill_factor": 0.9},
}
FIELDS = [0.0, 0.05, 0.1, 0.15]
ROUND = {
    "field": [f"{angle} deg" for angle in FIELDS],
    "unit": "waves",
    "terms": {8: FIELDS, 4: [-f for f in FIELDS]},
}
VARYING = START | {"main_lens": {"focal_length": 60 * mm, "diameter": 3 * mm, "over_field": ROUND}}
POINTS = Points(np.array([[0.11, -0.13, -5], [0.1, 0.05, 2]]) * mm, np.array([1.0, 0.6]))
KEYS = (
    "object_distance", "wavelength", "main_lens.focal_length", "main_lens.diameter", "sensor.pixel_pitch",
    "sensor.fill_factor",
)  # fmt: skip


def camera(given=START):
    return lg.SingleLensCamera(**given)


def ends(key, step, given=START):
    """Two cameras that differ by so much, relative, to either side."""
    part, _, name = key.rpartition(".")
    value = given[part][name] if part else given[name]
    numbers = (value * (1 + s) for s in (-step, step))
    low, high = (camera(given).replace(**({part: {name: n}} if part else {name: n})) for n in numbers)
    return low, high


def masks(step):
    """The same of a term of the phase."""
    low, high = (
        camera().replace(main_lens={"aberrations": {6: 0.3 * (1 + s), 8: 0.2}}) for s in (-step, step)
    )
    return low, high


@pytest.mark.parametrize(
    ("key", "given"), [*((key, START) for key in KEYS), ("object_distance", VARYING)], ids=[*KEYS, "varying"]
)
def test_derivatives_are_central_differences_of_images(key, given):
    images = camera(given).part_images([ends(key, 1e-6, given)])
    low, high = (one.part_images([]).forward(POINTS) for one in ends(key, 2e-6, given))
    assert off(2 * images.derivative(POINTS, np.ones(1)), high - low) < 1e-4


@pytest.mark.parametrize("given", [START, VARYING], ids=["one lens", "varying"])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
def test_images_are_those_of_points(given, accuracy):
    """By convolutions with images of points: samples and tails are others."""
    found = camera(given).part_images([], accuracy=accuracy).forward(POINTS)
    assert off(found, points_image(camera(given), POINTS)[0]) < accuracy


def test_the_gradient_is_the_derivatives_transpose(rng):
    images = camera().part_images([*(ends(key, 1e-6) for key in KEYS), masks(1e-6)])
    weights, change = rng.standard_normal(images.shape), rng.standard_normal(len(KEYS) + 1)
    whole = np.vdot(weights, images.derivative(POINTS, change))
    assert images.gradient(POINTS, weights) @ change == pytest.approx(whole, rel=1e-9, abs=0)


@pytest.mark.parametrize("name", [pytest.param("depth", marks=pytest.mark.long), "lateral"])
def test_slopes_are_central_differences_of_bounds(name):
    """Of the same bounds, and of `bounds`, whose derivatives by place are differences of images."""
    where = {"depths": [-3 * mm, 2 * mm], "light": lg.information.Light(5000, 2), "places": 2}
    pairs = [ends("main_lens.focal_length", 1e-5), ends("wavelength", 1e-5), masks(1e-5)]
    found = lg.information.slopes(camera(), pairs, name=name, **where)
    for (low, high), change in zip(pairs, found.changes, strict=True):
        low, high = (lg.information.slopes(one, [], name=name, **where).bound for one in (low, high))
        assert change == pytest.approx(high - low, rel=1e-5, abs=0)
    assert found.bound == pytest.approx(
        getattr(lg.information.bounds(camera(), **where), name), rel=3e-3, abs=0
    )


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:the depth bound of the best")
def test_a_mask_for_depth_is_found_downhill_as_by_a_simplex():
    """Astigmatism tells on which side of focus a point is."""
    light = lg.information.Light(5000, 2)
    goal = Goal("depth", depths=(-3 * mm, 2 * mm), light=light, places=1)
    start = camera().replace(main_lens={"aberrations": {6: 0.05}})
    best = [
        lg.optimise(start, ["main_lens.aberrations.6=0.05:1:x1"], goal, search=search, evaluations=25).best
        for search in ("gradient", "local")
    ]
    assert best[0]["depth"] == pytest.approx(best[1]["depth"], rel=2e-3)
