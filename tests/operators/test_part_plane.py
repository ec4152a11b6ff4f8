"""Raw images of planes by a camera's parts: against the camera's operator, and their derivatives."""

import numpy as np
import pytest
from tests.operators.test_part_images import HEX, KEYS, START, camera, off, pair, peak

import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.units import mm, um

DZ = -3 * mm


def slow(given, diameter=0.8 * mm):
    """With a small stop, few lenslets and few pixels: few points stand in a cell."""
    return given | {
        "main_lens": given["main_lens"] | {"diameter": diameter},
        "lenslets": given["lenslets"] | {"count": (4, 3)},
        "sensor": given["sensor"] | {"pixel_pitch": 10 * um, "shape": (80, 70)},
    }


ONE = {
    "object_distance": 240 * mm,
    "wavelength": 633e-9,
    "main_lens": {"focal_length": 120 * mm, "diameter": 2 * mm},
    "lenslets": {"pitch": 0.2 * mm, "focal_length": 8 * mm, "count": (4, 3)},
    "sensor": {"pixel_pitch": 20 * um, "shape": (40, 30)},
}
DISCS = slow(
    HEX
    | {
        "lenslets": HEX["lenslets"]
        | {"shape": "round", "fill_factor": 0.95, "focal_length": HEX["lenslets"]["focal_length"][0]}
    },
    0.4 * mm,
)
SMALL = slow(START | {"lenslets": START["lenslets"] | {"pitch": 0.08 * mm, "focal_length": 3.2 * mm}})
"""A sixth of the points of a cell."""
GRID = Grid((9, 8), (60 * um, 60 * um))


def plane(one, pairs=()):
    return one.part_plane(list(pairs), GRID, DZ)


@pytest.fixture
def scene(rng):
    return rng.random(GRID.shape)


@pytest.mark.parametrize(
    ("kind", "given", "keys"),
    [
        ("2.0", SMALL, ("object_distance", "wavelength", "lenslets.pitch")),
        ("1.0", ONE, ("main_lens.focal_length",)),
        pytest.param("2.0", DISCS, ("lenslets.focal_length",), marks=pytest.mark.long),
    ],
    ids=["2.0", "1.0", "discs"],
)
def test_slopes_are_central_differences_of_raw_images(kind, given, keys, scene, rng):
    """Of cameras farther to either side than the pair is, and each with its own cells.

    Ten times as far: the kernel that spreads samples ends where it is 1e-9, on one side or the other of them.
    """
    seen = plane(camera(given, kind), [pair(given, key, kind) for key in keys])
    weights = rng.standard_normal(seen.shape[0])
    for key, slope in zip(keys, seen.gradient(scene, weights), strict=True):
        low, high = (plane(one).forward(scene) for one in pair(given, key, kind, 1e-5))
        assert 10 * slope == pytest.approx(np.vdot(weights, high - low), rel=1e-4), key


def test_the_gradient_is_the_derivatives_transpose_and_adds_up_objects(rng):
    seen = plane(camera(SMALL), [pair(SMALL, key) for key in KEYS])
    objects, weights = rng.random((2, *GRID.shape)), rng.standard_normal((2, *seen.shape[0]))
    change = rng.standard_normal(len(KEYS))
    moved = np.stack([seen.derivative(one, change) for one in objects])
    assert seen.gradient(objects, weights) @ change == pytest.approx(np.vdot(weights, moved), rel=1e-9)
    assert np.allclose(seen.forward(objects)[1], seen.forward(objects[1]), rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "count", "most"),
    [
        pytest.param(slow(START), (6, 6), 1e-2, marks=pytest.mark.long),
        (slow(START), (4, 3), 3e-2),
        (ONE, (8, 7), 1e-2),
    ],
    ids=["2.0", "2.0, with the array's border", "1.0"],
)
def test_raw_images_are_those_of_the_operator(given, count, most):
    """To the accuracy; light of lenslets that are not there is missed by those at the border."""
    one = camera(given | {"lenslets": given["lenslets"] | {"count": count}}, "1.0" if given is ONE else "2.0")
    wide = one.operator_grid(4)
    x = np.random.default_rng(0).random(wide.shape)
    true = one.operator_on(wide, [DZ], accuracy=most / 5).forward(x[None])
    assert off(one.part_plane([], wide, DZ).forward(x), true) < most


def test_a_gradient_takes_less_than_three_times_the_memory_of_an_image(scene, rng):
    seen = plane(camera(SMALL), [pair(SMALL, key) for key in KEYS[1:6:2]])
    weights = rng.random(seen.shape[0])
    assert peak(lambda: seen.gradient(scene, weights)) < 3 * peak(lambda: seen.forward(scene))


def test_other_objects_weights_and_changes_are_refused(scene):
    given = slow(START)
    seen = plane(camera(given), [pair(given, "lenslets.pitch")])
    with pytest.raises(GeometryError, match=r"object has shape \(2, 2\) but the grid \(9, 8\)"):
        seen.forward(np.ones((2, 2)))
    with pytest.raises(GeometryError, match=r"weights have shape \(2, 2\)"):
        seen.gradient(scene, np.ones((2, 2)))
    with pytest.raises(GeometryError, match=r"change has shape \(2,\) but must be \(1,\)"):
        seen.derivative(scene, np.ones(2))
    with pytest.raises(lg.LumigraphError, match="inside its focal length"):
        camera(given).part_plane([], GRID, -0.2)
