"""Derivatives by a camera's parts behind lenses that change over the field: of points, and of bounds."""

import numpy as np
import pytest
from tests.operators.test_part_images import off

import lumigraph as lg
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.part_leaning import points_before
from lumigraph.operators.lenslets.part_points import PartPoints, SteppedPoints
from lumigraph.operators.lenslets.points import points_image
from lumigraph.scene import Points
from lumigraph.units import mm, nm, um

FIELDS = [0.0, 0.05, 0.1, 0.15]
ROUND = {
    "field": [f"{angle} deg" for angle in FIELDS],
    "unit": "waves",
    "terms": {8: list(FIELDS), 4: [-6 * angle**2 for angle in FIELDS]},
}
START = {
    "object_distance": 120 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 60 * mm, "diameter": 3 * mm, "over_field": ROUND},
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": 5.2 * mm, "count": (9, 9), "magnification": 0.5,
        "fill_factor": 0.95,
    },
    "sensor": {"pixel_pitch": 6 * um, "shape": (240, 240), "fill_factor": 0.9},
}  # fmt: skip
HEX = START | {
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": (5.2 * mm, 5.0 * mm, 5.4 * mm), "count": (8, 7),
        "magnification": 0.5, "layout": "hex",
    },
}  # fmt: skip
POINTS = Points(np.array([[0.11, -0.13, -5], [0.1, 0.05, 2]]) * mm, np.array([1.0, 0.6]))
KEYS = (
    "object_distance", "wavelength", "main_lens.focal_length", "main_lens.diameter", "lenslets.pitch",
    "lenslets.focal_length", "sensor.pixel_pitch",
)  # fmt: skip
LIGHT = lg.information.Light(photons=5000, background=2)


def camera(given=START):
    return lg.FocusedPlenopticCamera(**given)


def ends(key, step, given=START):
    """Two cameras that differ by so much, relative, to either side: by a term of all fields, too."""
    if key == "coma":
        tables = (
            {**ROUND, "terms": {**ROUND["terms"], 8: [(1 + s) * c for c in FIELDS]}} for s in (-step, step)
        )
        low, high = (camera(given).replace(main_lens={"over_field": table}) for table in tables)
        return low, high
    part, _, name = key.rpartition(".")
    value = given[part][name] if part else given[name]
    low, high = (np.multiply(value, 1 + s).tolist() for s in (-step, step))
    low, high = (tuple(one) if isinstance(one, list) else one for one in (low, high))
    changes = ({part: {name: one}} if part else {name: one} for one in (low, high))
    low, high = (camera(given).replace(**change) for change in changes)
    return low, high


@pytest.mark.parametrize(
    ("key", "given"),
    [*((key, START) for key in (*KEYS, "coma")), *((key, HEX) for key in ("wavelength", "coma"))],
    ids=[*KEYS, "coma", "hexagons wavelength", "hexagons coma"],
)
def test_derivatives_are_central_differences_of_images(key, given):
    """Of cameras farther to either side, whose points are seen from other fields."""
    images = camera(given).part_images([ends(key, 1e-6, given)])
    low, high = (one.part_images([]).forward(POINTS) for one in ends(key, 2e-6, given))
    assert off(2 * images.derivative(POINTS, np.ones(1)), high - low) < 1e-4


@pytest.mark.parametrize("given", [START, HEX], ids=["squares", "hexagons"])
def test_images_are_those_of_points(given):
    """Each behind the lens of its own field: one lens for all is far off."""
    found = camera(given).part_images([], accuracy=2e-3).forward(POINTS)
    assert off(found, points_image(camera(given), POINTS, 1e-3)) < 2e-3
    axis = Points(POINTS.positions * (0, 0, 1), POINTS.intensities)
    assert off(camera(given).part_images([]).forward(axis), found) > 0.1


def test_the_gradient_is_the_derivatives_transpose(rng):
    images = camera().part_images([ends(key, 1e-6) for key in (*KEYS, "coma")])
    weights, change = rng.standard_normal(images.shape), rng.standard_normal(len(KEYS) + 1)
    derivative = images.derivative(POINTS, change)
    rounding = 1e-10 * np.linalg.norm(weights) * np.linalg.norm(derivative)  # most of the sum cancels
    assert images.gradient(POINTS, weights) @ change == pytest.approx(
        np.vdot(weights, derivative), abs=rounding
    )


def test_points_beside_others_say_how_images_change_with_their_place():
    """By differences of fields: as images of points a little aside do, whose lens is another."""
    images, step = camera().part_images([]), 1e-7
    one = Points(POINTS.positions[:1], np.ones(1))
    lit, _ = points_before(images, one, []).lit(0)
    assert off(lit[0], images.forward(one)) < 1e-9
    for k, move in enumerate(np.eye(3)[:2] * step):
        low, high = (images.forward(Points(one.positions + s * move, np.ones(1))) for s in (-1, 1))
        assert off(lit[k + 1], (high - low) / (2 * step)) < 1e-3


def test_fields_beside_each_other_say_what_turned_ones_do():
    """Behind one lens for all fields; no light is won or lost with depth."""
    images = camera().replace(main_lens={"over_field": None, "aberrations": {6: 0.3}}).part_images([])
    turned, beside = (of(images, POINTS, []).lit(1)[0] for of in (PartPoints, SteppedPoints))
    assert [off(found, known) < 1e-3 for found, known in zip(beside, turned, strict=True)] == [True] * 4


@pytest.mark.long
@pytest.mark.parametrize("key", ["coma", "lenslets.pitch"])
def test_slopes_are_central_differences_of_bounds(key):
    """Of the same bounds, and those are `bounds`: points that move are seen from other fields."""
    where = {"depths": [-3 * mm], "light": LIGHT, "places": range(1, 2)}
    found = lg.information.slopes(camera(), [ends(key, 1e-5)], **where)
    low, high = (lg.information.slopes(one, [], **where).bound for one in ends(key, 1e-5))
    assert found.changes[0] == pytest.approx(high - low, rel=1e-3, abs=0)
    assert found.bound == pytest.approx(lg.information.bounds(camera(), **where).depth, rel=3e-3, abs=0)


def test_lenses_of_two_kinds_are_not_compared():
    plain = camera().replace(main_lens={"over_field": None})
    with pytest.raises(GeometryError, match="lenses of one kind: give over_field or prescription to all"):
        camera().part_images([(camera(), plain)])
