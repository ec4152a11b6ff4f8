"""Images of points by a camera's parts: against those of points, and their derivatives by every length."""

import tracemalloc

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.illuminated import share
from lumigraph.operators.lenslets.point_changes import place_changes
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.lenslets.relay import RelaySet
from lumigraph.operators.sampling.optics import Optics
from lumigraph.scene import Points
from lumigraph.units import mm, nm, um

POINTS = Points(np.array([[0.11, -0.23, -5], [0.3, 0.2, 2]]) * mm, np.array([1.0, 0.6]))
START = {
    "object_distance": 120 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 60 * mm, "diameter": 3 * mm, "aberrations": {6: 0.3, 8: 0.2}},
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": 5.2 * mm, "count": (9, 9), "magnification": 0.5,
        "fill_factor": 0.95,
    },
    "sensor": {"pixel_pitch": 6 * um, "shape": (240, 240), "fill_factor": 0.9},
}  # fmt: skip
FREE = START | {"built": {"separation": 121 * mm, "lenslet_distance": 8 * mm}}
ONE = {
    "object_distance": 240 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 120 * mm, "diameter": 8 * mm},
    "lenslets": {"pitch": 0.3 * mm, "focal_length": 8 * mm, "count": (9, 9)},
    "sensor": {"pixel_pitch": 20 * um, "shape": (110, 110)},
}
HEX = START | {
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": (5.2 * mm, 5.0 * mm, 5.4 * mm), "count": (8, 7),
        "magnification": 0.5, "layout": "hex",
    },
}  # fmt: skip
ROUNDED = START | {"lenslets": START["lenslets"] | {"pitch": 0.3 * mm}}
"""Whose windows end at whole numbers of samples: 78, or 79 by rounding."""
ANGLES = HEX | {"sensor": HEX["sensor"] | {"angular_response": {"power": 40.0}}}
WIDE = START | {"main_lens": {"focal_length": 60 * mm, "diameter": 6 * mm}}
WIDE_HEX = HEX | {"main_lens": WIDE["main_lens"]}
"""Whose micro-images reach over the edges of lenslets."""
FREE_HEX = HEX | {"built": FREE["built"]}
DISCS = HEX | {"lenslets": HEX["lenslets"] | {"shape": "round", "fill_factor": 0.95}}
KEYS = (
    "object_distance", "wavelength", "main_lens.focal_length", "main_lens.diameter",
    "main_lens.aberrations.6", "lenslets.pitch", "lenslets.focal_length", "lenslets.magnification",
    "lenslets.fill_factor", "sensor.pixel_pitch", "sensor.fill_factor",
)  # fmt: skip
ALL = [
    *(("2.0", START, key) for key in KEYS),
    *(("2.0", FREE, key) for key in ("object_distance", "built.separation", "built.lenslet_distance")),
    *(
        ("1.0", ONE, key)
        for key in (*KEYS[:4], "lenslets.pitch", "lenslets.focal_length", "sensor.pixel_pitch")
    ),
    *(
        ("2.0", HEX, key)
        for key in (
            *KEYS[:6], "lenslets.focal_length.0", "lenslets.focal_length.1", "lenslets.magnification",
            "sensor.pixel_pitch",
        )
    ),
    *(("2.0", given, "lenslets.pitch") for given in (ROUNDED, ANGLES)),
    *(("2.0", given, "main_lens.diameter") for given in (WIDE, WIDE_HEX)),
    *(("2.0", FREE_HEX, f"built.{key}") for key in FREE["built"]),
    *(("2.0", DISCS, f"lenslets.{key}") for key in ("focal_length.2", "fill_factor")),
]  # fmt: skip


BEHIND_HEX = ("wavelength", "lenslets.pitch", "lenslets.focal_length.0")
"""Keys by which the light before hexagons, their edges and one of their kinds change."""


def camera(given, kind="2.0"):
    of = lg.FocusedPlenopticCamera if kind == "2.0" else lg.PlenopticCamera
    return of(**given)


def named(given):
    """A description, by its lenslets and what it has."""
    return " ".join(k for k, v in globals().items() if v is given)


def moved(given, key, by):
    """The description with one number that is so much larger, relative."""
    first, _, rest = key.partition(".")
    first = int(first) if first.isdigit() else first
    if isinstance(given, tuple):
        return (*given[:first], given[first] * (1 + by), *given[first + 1 :])
    return given | {first: moved(given[first], rest, by) if rest else given[first] * (1 + by)}


def pair(given, key, kind="2.0", step=1e-6):
    return camera(moved(given, key, -step), kind), camera(moved(given, key, step), kind)


def off(found, true):
    return np.linalg.norm(found - true) / np.linalg.norm(true)


@pytest.mark.parametrize(
    ("kind", "given", "key"),
    [
        pytest.param(
            *one,
            id=f"{one[0]} {named(one[1])} {one[2]}",
            marks=pytest.mark.long if one[1] is HEX and one[2] not in BEHIND_HEX else (),
        )
        for one in ALL
    ],
)
def test_derivatives_are_central_differences_of_images(kind, given, key):
    """Of cameras farther to either side than the pair is, sampled as each asks for."""
    images = camera(given, kind).part_images([pair(given, key, kind)])
    low, high = (one.part_images([]).forward(POINTS) for one in pair(given, key, kind, 2e-6))
    assert off(2 * images.derivative(POINTS, np.ones(1)), high - low) < 1e-4


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
@pytest.mark.parametrize("mask", [{6: 0.3, 8: 0.2}, {}], ids=["mask", "none"])
def test_images_are_those_of_points(mask, accuracy):
    """Without a mask, these follow from a Hankel transform: nothing of the stop's edge is sampled."""
    one = camera(START | {"main_lens": START["main_lens"] | {"aberrations": mask}})
    found = one.part_images([], accuracy=accuracy).forward(POINTS)
    assert off(found, points_image(one, POINTS, 1e-4)) < accuracy


@pytest.mark.parametrize("given", [HEX, DISCS], ids=["hexagons", "discs"])
def test_images_behind_lenslets_of_three_kinds_are_those_of_points(given):
    found = camera(given).part_images([]).forward(POINTS)
    assert off(found, points_image(camera(given), POINTS, 1e-3)) < 0.5e-2


@pytest.mark.parametrize(
    "given", [START, pytest.param(HEX, marks=pytest.mark.long)], ids=["squares", "hexagons"]
)
def test_images_behind_turned_lenslets_are_those_of_points_and_have_derivatives(given):
    turned = given | {"lenslets": given["lenslets"] | {"rotation": 0.03}}
    images = camera(turned).part_images([pair(turned, "lenslets.rotation")])
    assert off(images.forward(POINTS), points_image(camera(turned), POINTS, 1e-3)) < 1e-2
    low, high = (one.part_images([]).forward(POINTS) for one in pair(turned, "lenslets.rotation", step=2e-6))
    assert off(2 * images.derivative(POINTS, np.ones(1)), high - low) < 1e-4


@pytest.mark.parametrize(
    ("given", "keys"),
    [
        (START, KEYS),
        pytest.param(
            HEX, (*KEYS[:6], "lenslets.focal_length.1", "sensor.pixel_pitch"), marks=pytest.mark.long
        ),
    ],
    ids=["squares", "hexagons"],
)
def test_the_gradient_is_the_derivatives_transpose(given, keys, rng):
    images = camera(given).part_images([pair(given, key) for key in keys])
    weights, change = rng.standard_normal(images.shape), rng.standard_normal(len(keys))
    whole = np.sum(weights * images.derivative(POINTS, change))
    assert images.gradient(POINTS, weights) @ change == pytest.approx(whole, rel=1e-9)


def peak(run):
    """Memory that a run takes the second time [bytes]."""
    run()
    tracemalloc.start()
    run()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


@pytest.mark.parametrize(
    ("given", "most"), [(START, 3), pytest.param(HEX, 6, marks=pytest.mark.long)], ids=["squares", "hexagons"]
)
def test_a_gradient_takes_few_times_the_memory_of_an_image(given, most, rng):
    images = camera(given).part_images([pair(given, key) for key in KEYS[1:6:2]])
    weights = rng.random(images.shape)
    assert peak(lambda: images.gradient(POINTS, weights)) < most * peak(lambda: images.forward(POINTS))


@pytest.mark.parametrize("change", [{"sensor": {"shape": (239, 240)}}, {"lenslets": {"count": (9, 8)}}])
def test_cameras_with_other_numbers_of_parts_are_refused(change):
    with pytest.raises(GeometryError, match="derivatives need as many"):
        camera(START).part_images([(camera(START), camera(START).replace(**change))])


def test_other_numbers_of_changes_and_of_pixels_and_finer_accuracies_are_refused():
    images = camera(START).part_images([])
    with pytest.raises(GeometryError, match=r"change has shape \(1,\) but must be \(0,\)"):
        images.derivative(POINTS, np.ones(1))
    with pytest.raises(GeometryError, match=r"weights have shape \(2, 2\)"):
        images.gradient(POINTS, np.ones((2, 2)))
    with pytest.raises(SamplingError, match=r"accuracy is 0\.0001 but must lie between 0\.001"):
        camera(START).part_images([], accuracy=1e-4)


def test_a_camera_that_moves_sees_what_points_show_that_move():
    """Before lenslets that stay: as deeper points by `place_changes`, but for how bright samples are."""
    place, step = np.array([0.11, -0.23, -5]) * mm, 1e-6 * START["object_distance"]
    images, one = camera(FREE).part_images([pair(FREE, "object_distance")]), Points(place[None], np.ones(1))
    deeper = place_changes(camera(FREE).optics(), place, 1e-2, RelaySet())
    light = np.log([share(Optics.of(end, end.object_distance + place[2], 1e-2)) for end in images.pairs[0]])
    expected = deeper[3] * 2 * step + deeper[0] * (light[1] - light[0])
    assert off(images.derivative(one, np.ones(1)), expected) < 2e-3


def test_cameras_of_a_pair_are_sampled_alike_where_an_accuracy_begins_to_ask_for_more():
    """Of one more lenslet on each side, by bisection."""
    key = "lenslets.focal_length"

    def followed(by):
        one = camera(moved(START, key, by))
        return round(Optics.of(one, 115 * mm, 5e-3).axes[0].neighbourhood / one.lenslets.pitch)

    low, high = 0.0, 0.5
    assert followed(low) < followed(high)
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if followed(middle) == followed(0.0) else (low, middle)
    assert followed(low - 1e-6) < followed(low + 1e-6)
    before, there = (moved(START, key, by) for by in (low - 1e-4, low))
    one, other = (
        camera(given).part_images([pair(given, key)]).derivative(POINTS, np.ones(1))
        for given in (before, there)
    )
    assert off(other, one) < 0.02
