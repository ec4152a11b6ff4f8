"""Images of points by an exact camera's parts: beside those of points, and derivatives by every length."""

from dataclasses import replace

import numpy as np
import pytest
from tests.operators.test_part_images import FREE, KEYS, ONE, START, camera, moved, off, pair, peak

import lumigraph as lg
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.cell_response import bent
from lumigraph.operators.lenslets.exact_camera import ExactSampledCamera
from lumigraph.operators.lenslets.exact_lenslets import Terms, products
from lumigraph.operators.lenslets.points import points_image
from lumigraph.scene import Points
from lumigraph.units import mm, um

ONE_POINT = Points(np.array([[0.11, -0.23, -1]]) * mm, np.ones(1))
POINTS = Points(np.array([[0.11, -0.23, -5], [0.3, 0.2, 2]]) * mm, np.array([1.0, 0.6]))
SMALL = START | {
    "model": "exact",
    "main_lens": START["main_lens"] | {"diameter": 2 * mm},
    "lenslets": START["lenslets"] | {"count": (5, 5)},
    "sensor": START["sensor"] | {"shape": (120, 120)},
}
STEEP = {
    "object_distance": 120 * mm,
    "wavelength": 633e-9,
    "main_lens": {"focal_length": 60 * mm, "diameter": 6 * mm},
    "lenslets": {
        "pitch": 0.1 * mm, "focal_length": 1 * mm, "count": (5, 5), "magnification": 0.5,
        "fill_factor": 0.95,
    },
    "sensor": {"pixel_pitch": 4 * um, "shape": (120, 120)},
    "model": "exact",
}  # fmt: skip
"""Before lenslets of f/10, whose paraxial images are 4.2e-3 off."""
ON_AXIS = Points(np.array([[0.0, 0.0, -0.2]]) * mm, np.ones(1))
GLASS = SMALL | {
    "lenslets": SMALL["lenslets"] | {"index": 1.5, "conic": -0.5, "thickness": 0.3 * mm, "abbe": 60.0}
}
ANGLES = SMALL | {"sensor": SMALL["sensor"] | {"angular_response": {"power": 40.0}}}
EXACT_ONE = ONE | {"model": "exact"}
WHOLE = START | {"model": "exact"}
MORE = [
    *(("2.0", SMALL, key) for key in KEYS[::2]),
    *(("2.0", FREE | {"model": "exact"}, f"built.{key}") for key in FREE["built"]),
    *(("1.0", EXACT_ONE, key) for key in ("wavelength", "lenslets.focal_length")),
    ("2.0", GLASS, "lenslets.pitch"),
    ("2.0", ANGLES, "lenslets.pitch"),
]


def named(given):
    """A description, by its name here."""
    return next((k for k, v in globals().items() if v is given), "FREE")


def difference(given, key, points, kind="2.0", step=1e-6):
    """Of images, from cameras two steps below to two above, sampled as each asks for."""
    low, high = (one.part_images([]).forward(points) for one in pair(given, key, kind, 2 * step))
    return (high - low) / 2


def test_gradients_are_central_differences_of_images(rng):
    images = camera(SMALL).part_images([pair(SMALL, key) for key in KEYS[1::2]])
    weights = rng.random(images.shape)
    expected = [np.sum(weights * difference(SMALL, key, ONE_POINT)) for key in KEYS[1::2]]
    assert images.camera.model == "exact"
    assert images.gradient(ONE_POINT, weights) == pytest.approx(np.array(expected), rel=1e-5, abs=0)


@pytest.mark.parametrize(("key", "step"), [("index", 1e-6), ("conic", 1e-6), ("thickness", 1e-4)])
def test_images_change_with_the_lenslets_glass(key, step):
    """By the thickness a thousandth of what they do by the index: smaller steps are lost in rounding."""
    images = camera(GLASS).part_images([pair(GLASS, f"lenslets.{key}", step=step)])
    expected = difference(GLASS, f"lenslets.{key}", ONE_POINT, step=step)
    assert off(images.derivative(ONE_POINT, np.ones(1)), expected) < 1e-4


@pytest.mark.long
@pytest.mark.parametrize(("kind", "given", "key"), MORE, ids=[f"{k} {named(g)} {key}" for k, g, key in MORE])
def test_derivatives_are_central_differences_of_images(kind, given, key):
    images = camera(given, kind).part_images([pair(given, key, kind)])
    expected = difference(given, key, POINTS, kind)
    assert off(images.derivative(POINTS, np.ones(1)), expected) < 1e-4


@pytest.mark.long
@pytest.mark.parametrize(("given", "accuracy"), [(SMALL, 1e-3), (GLASS, 1e-2)], ids=["ideal", "glass"])
def test_images_are_those_of_points(given, accuracy):
    found = camera(given).part_images([], accuracy=accuracy).forward(POINTS)
    assert off(found, points_image(camera(given), POINTS, 3e-4)) < accuracy


def test_images_are_exact_where_paraxial_ones_are_not():
    """On the axis of a lens without aberrations, whose light `points_image` has by Bessel functions.

    Without bends images are 2.4e-5 off.
    """
    expected = points_image(camera(STEEP), ON_AXIS, 4e-3)
    assert off(camera(STEEP).part_images([], accuracy=4e-3).forward(ON_AXIS), expected) < 1.8e-5
    paraxial = camera(STEEP | {"model": "paraxial"}).part_images([], accuracy=4e-3)
    assert off(paraxial.forward(ON_AXIS), expected) > 3.5e-3  # 3.8e-3: two hundred times as far off


@pytest.mark.long
@pytest.mark.parametrize("key", ["object_distance", "lenslets.focal_length"])
def test_images_change_as_simulations_do(key):
    """Over changes of 1e-4, which single precision resolves."""
    ends = (camera(moved(SMALL, key, by)) for by in (-5e-5, 5e-5))
    low, high = (points_image(end, ONE_POINT, 1e-3) for end in ends)
    images = camera(SMALL).part_images([pair(SMALL, key)], accuracy=2e-3)
    assert off(50 * images.derivative(ONE_POINT, np.ones(1)), high - low) < 0.01


def test_the_gradient_is_the_derivatives_transpose_behind_turned_lenslets(rng):
    turned = SMALL | {"lenslets": SMALL["lenslets"] | {"rotation": 0.03}}
    keys = ("object_distance", "wavelength", "lenslets.pitch", "lenslets.rotation", "sensor.fill_factor")
    images = camera(turned).part_images([pair(turned, key) for key in keys])
    weights, change = rng.standard_normal(images.shape), rng.standard_normal(len(keys))
    whole = np.sum(weights * images.derivative(POINTS, change))
    assert images.gradient(POINTS, weights) @ change == pytest.approx(whole, rel=1e-9, abs=0)


def test_a_gradient_takes_less_than_three_times_the_memory_of_an_image(rng):
    images = camera(SMALL).part_images([pair(SMALL, key) for key in KEYS[1:7:5]])
    weights = rng.random(images.shape)
    assert peak(lambda: images.gradient(ONE_POINT, weights)) < 3 * peak(lambda: images.forward(ONE_POINT))


def test_terms_go_over_into_those_of_others_whatever_singular_vectors_are():
    """Of a lenslet's path, and of a sum of two products that are equally strong: their vectors may be any."""

    def path(y, x):
        squares = y * y + x * x, y * y, x * x
        both, down, across = (bent(squared, 5 * mm, 8 * mm) for squared in squares)
        return np.exp(1e7j * (both - down - across))

    def twice(y, x):
        return y * x + (2 * y * y - 1) * (2 * x * x - 1)

    def turned(function, by):
        return lambda y, x: np.exp(1j) * function(y * (1 + by), x)

    for function, half in ((path, 0.6 * mm), (twice, 1.0)):
        own = products(function, (0.0, 0.0), (half, half), Terms(2.0, 1e-3))
        for by in (1e-6, -1e-6):
            like = products(turned(function, by), (0.0, 0.0), (half, half), Terms(2.0, 1e-3, own))
            for mine, theirs in zip(like.coefficients, own.coefficients, strict=True):
                assert off(mine, np.exp(0.5j) * theirs) < 1e-4  # the phase of 1 rad is shared
            at = np.linspace(-half, half, 9)
            y, x = like.along(0, at), like.along(1, at)
            assert off(np.einsum("ky, kx -> yx", y, x), np.exp(1j) * function(at[:, None], at)) < 2e-3


def test_lenslets_of_a_pair_are_as_many_terms():
    """Also where the accuracy would ask for more or fewer of them."""
    own = ExactSampledCamera.of(camera(SMALL).optics(), ONE_POINT, 0.5e-2)
    key = 0, 1, range(8), range(8)
    for by, terms in ((-0.3, 5), (0.5, 3)):
        end = own.alike(camera(moved(SMALL, "wavelength", by)).optics())
        alone = replace(end, like=None).lenslets
        assert [len(one.prepared([key])[key]) for one in (alone, end.lenslets, own.lenslets)] == [terms, 4, 4]


def test_other_models_of_one_camera_are_refused():
    exact, paraxial = camera(SMALL), camera(SMALL | {"model": "paraxial"})
    for own, other in ((exact, paraxial), (paraxial, exact)):
        with pytest.raises(GeometryError, match="model = 'paraxial'"):
            own.part_images([(own, other)])


@pytest.mark.long
@pytest.mark.parametrize("key", ["wavelength", "lenslets.focal_length"])
def test_slopes_are_central_differences_of_bounds(key):
    where = {"depths": [-3 * mm], "light": lg.information.Light(5000, 2), "places": range(1, 2)}

    def ends():
        return tuple(camera(moved(SMALL, key, step)) for step in (-1e-5, 1e-5))

    found = lg.information.slopes(camera(SMALL), [ends()], **where)
    low, high = (lg.information.slopes(one, [], **where).bound for one in ends())
    assert found.changes[0] == pytest.approx(high - low, rel=1e-3, abs=0)
    assert found.bound == pytest.approx(lg.information.bounds(camera(SMALL), **where).depth, rel=3e-3, abs=0)


def test_a_chosen_model_is_that_of_the_camera_itself():
    """Also where it would be another one for a camera of a pair."""
    one = camera(STEEP | {"model": "auto"})
    other = camera(moved(STEEP, "lenslets.focal_length", 2.0) | {"model": "auto"})
    assert one.part_images([(other, other)], accuracy=2e-3).camera.model == "exact"
    assert other.part_images([(one, one)], accuracy=1e-2).camera.model == "paraxial"
