"""Derivatives behind lenslets that differ by chance: by every length and by how much they differ."""

import numpy as np
import pytest
from tests.operators.test_part_images import off, peak

import lumigraph as lg
from cameras import focused
from lumigraph.errors import GeometryError
from lumigraph.operators.lenslets.part_leaning import TiltedImages
from lumigraph.operators.lenslets.part_plane import PartPlane
from lumigraph.operators.lenslets.plane_of_points import PlaneOfPoints
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.sampling.resampling import averaged
from lumigraph.scene import Points
from lumigraph.studies.information.points import small
from lumigraph.units import mm, nm, um

POINTS = Points(np.array([[0.11, -0.23, -3], [0.3, 0.2, 2]]) * mm, np.array([1.0, 0.6]))
POINT = Points(POINTS.positions[:1], POINTS.intensities[:1])
DIFFER = {
    "focal_length_scatter": 0.02, "decentre_scatter": 2 * um, "tilt_scatter": 1e-3, "form_scatter": 30 * nm,
    "missing": 0.05, "seed": 3,
}  # fmt: skip
START = {
    "object_distance": 120 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 60 * mm, "diameter": 2 * mm, "aberrations": {6: 0.3, 8: 0.2}},
    "lenslets": {
        "pitch": 0.2 * mm, "focal_length": 5.2 * mm, "count": (6, 7), "magnification": 0.5,
        "fill_factor": 0.95, "index": 1.5,
    },
    "sensor": {"pixel_pitch": 6 * um, "shape": (200, 220), "fill_factor": 0.9},
    "built": DIFFER,
}  # fmt: skip
FREE = START | {"built": DIFFER | {"separation": 121 * mm, "lenslet_distance": 8 * mm}}
BENT = START | {"built": {"focal_length_scatter": 0.02, "decentre_scatter": 2 * um}}
"""Without tilt and form."""
ANGLES = START | {"sensor": START["sensor"] | {"angular_response": {"power": 40.0}}}
ONE = {
    "object_distance": 240 * mm,
    "wavelength": 633 * nm,
    "main_lens": {"focal_length": 120 * mm, "diameter": 6 * mm},
    "lenslets": {"pitch": 0.3 * mm, "focal_length": 8 * mm, "count": (5, 5), "index": 1.5},
    "sensor": {"pixel_pitch": 20 * um, "shape": (80, 80)},
    "built": DIFFER,
}
SIZES = tuple(f"built.{key}" for key in DIFFER if key.endswith("scatter"))
KEYS = (
    "object_distance", "wavelength", "main_lens.focal_length", "main_lens.diameter",
    "main_lens.aberrations.6", "lenslets.pitch", "lenslets.focal_length", "lenslets.magnification",
    "lenslets.fill_factor", "lenslets.index", "sensor.pixel_pitch", "sensor.fill_factor", *SIZES,
)  # fmt: skip
ALL = [
    *(("2.0", START, key) for key in KEYS),
    *(("2.0", FREE, f"built.{key}") for key in ("separation", "lenslet_distance")),
    *(("2.0", BENT, key) for key in ("lenslets.focal_length", SIZES[0])),
    ("2.0", ANGLES, "lenslets.pitch"),
    *(("1.0", ONE, key) for key in ("wavelength", "lenslets.pitch", "lenslets.focal_length", SIZES[1])),
]
QUICK = (*SIZES, "object_distance", "wavelength", "lenslets.pitch", "lenslets.fill_factor")
"""Keys before `START` that tell whether each step is differentiated; the others are long tests."""


def camera(given, kind="2.0"):
    return (lg.FocusedPlenopticCamera if kind == "2.0" else lg.PlenopticCamera)(**given)


def named(given):
    """A description, by what it has."""
    return next(name for name, value in globals().items() if value is given)


def moved(given, key, by):
    """The description with one number that is so much larger, relative."""
    first, _, rest = key.partition(".")
    first = int(first) if first.isdigit() else first
    return given | {first: moved(given[first], rest, by) if rest else given[first] * (1 + by)}


def pair(given, key, kind="2.0", step=1e-6):
    return camera(moved(given, key, -step), kind), camera(moved(given, key, step), kind)


def cases():
    for kind, given, key in ALL:
        marks = () if given is START and key in QUICK else pytest.mark.long
        yield pytest.param(kind, given, key, marks=marks, id=f"{kind} {named(given)} {key}")


@pytest.mark.parametrize(("kind", "given", "key"), list(cases()))
def test_derivatives_are_central_differences_of_images(kind, given, key):
    """Of cameras farther to either side than the pair is, sampled as each asks for."""
    images = camera(given, kind).part_images([pair(given, key, kind)])
    low, high = (one.part_images([]).forward(POINT) for one in pair(given, key, kind, 2e-6))
    assert off(2 * images.derivative(POINT, np.ones(1)), high - low) < 1e-6


def test_cameras_of_a_pair_are_sampled_alike_however_many_nodes_they_ask_for_themselves():
    """Phases are linear in the forms' size, by which nodes are more."""
    near, far = (
        camera(START).part_images([pair(START, "built.form_scatter", step=step)]) for step in (1e-3, 0.5)
    )
    assert off(far.derivative(POINT, np.ones(1)), 500 * near.derivative(POINT, np.ones(1))) < 1e-9


def test_the_gradient_is_the_derivatives_transpose(rng):
    images = camera(START).part_images([pair(START, key) for key in KEYS])
    weights, change = rng.standard_normal(images.shape), rng.standard_normal(len(KEYS))
    whole = np.sum(weights * images.derivative(POINTS, change))
    assert images.gradient(POINTS, weights) @ change == pytest.approx(whole, rel=1e-11)


@pytest.mark.parametrize(("kind", "given"), [("2.0", START), ("1.0", ONE)])
def test_images_are_those_of_points(kind, given):
    one = camera(given, kind)
    assert off(one.part_images([]).forward(POINTS), points_image(one, POINTS, 1e-3)) < 0.5e-2


def direct(one, points):
    """Fresnel sums over stop, lenslets and image, on grids on which borders fall between samples."""
    ((y, x, dz),) = points.positions
    stop, plane = lg.Grid.square(200, 10 * um), lg.Grid((250, 250), (2 * um, 2 * um), (1 * um, 1 * um))
    image = lg.Grid.square(240, 3 * um)

    def carried(light, source, goal, distance):
        k = np.pi / (one.wavelength * distance)
        down, across = (
            np.exp(1j * k * np.subtract.outer(b, a) ** 2) for a, b in ((source.y, goal.y), (source.x, goal.x))
        )
        return down @ light @ across.T / (one.wavelength * distance) * source.pitch[0] ** 2

    k = np.pi / (one.wavelength * (one.object_distance + dz))
    light = lg.Field(np.exp(1j * k * ((stop.y[:, None] - y) ** 2 + (stop.x - x) ** 2)), stop, one.wavelength)
    light = carried(one.lens_train()(light).data, stop, plane, one.separation)
    light = light * one.lenslet_array().transmission(plane, one.wavelength)
    seen = np.abs(carried(light, plane, image, one.lenslet_distance)) ** 2
    return averaged(image, one.sensor.grid).forward(seen)


def test_images_change_with_how_much_lenslets_differ_as_direct_sums_do():
    """By a twentieth of each size to either side; the pair is a hundredth of that apart."""
    one = focused(index=1.5).replace(built=DIFFER)
    point = Points(np.array([[20 * um, -30 * um, 1 * mm]]), np.ones(1))

    def other(key, by):
        return one.replace(built={key: DIFFER[key] * (1 + by)})

    keys = [size.partition(".")[2] for size in SIZES]
    images = one.part_images([(other(key, -5e-4), other(key, 5e-4)) for key in keys], accuracy=2e-3)
    scale = direct(one, point).sum() / images.forward(point).sum()
    for key, change in zip(keys, np.eye(len(keys)), strict=True):
        low, high = (direct(other(key, by), point) for by in (-0.05, 0.05))
        assert off(100 * scale * images.derivative(point, change), high - low) < 0.02, key


def test_lenslets_that_are_alike_begin_to_differ():
    """From none on, where all are taken one by one as if they differed."""
    alike, *ends = (
        camera(START | {"built": {"seed": 3, "decentre_scatter": size * nm}}) for size in (0.0, 1.0, 2.0)
    )
    images = alike.part_images([(alike, ends[0])])
    low, high = (one.part_images([]).forward(POINT) for one in ends)
    assert off(images.derivative(POINT, np.ones(1)), high - low) < 1e-2  # of what is linear
    assert off(images.forward(POINT), alike.part_images([]).forward(POINT)) < 1e-3


def test_a_gradient_takes_less_than_six_times_the_memory_of_an_image(rng):
    images = camera(START).part_images([pair(START, key) for key in KEYS[1::2]])
    weights = rng.random(images.shape)
    assert peak(lambda: images.gradient(POINTS, weights)) < 6 * peak(lambda: images.forward(POINTS))


@pytest.mark.parametrize("change", [{"missing": 0.06}, {"seed": 4}])
def test_cameras_with_other_lenslets_are_refused(change):
    one = camera(START)
    with pytest.raises(GeometryError, match=r"Give built\.seed and built\.missing alike"):
        one.part_images([(one, one.replace(built=change))])


def test_hexagons_are_refused():
    hexagons = {"layout": "hex", "focal_length": 5.2 * mm, "count": (6, 5)}
    with pytest.raises(GeometryError, match="simulated for square ones of one focal length"):
        camera(START | {"lenslets": START["lenslets"] | hexagons}).part_images([])


def test_planes_are_points_where_lenslets_begin_to_differ():
    alike = camera(START).replace(built={key: 0.0 for key in DIFFER if key != "seed"})
    pair = alike, alike.replace(built={"form_scatter": 1 * nm})
    kinds = (type(alike.part_plane(some, lg.Grid.square(8, 50 * um))) for some in ([], [pair]))
    assert [*kinds] == [PartPlane, PlaneOfPoints]


@pytest.mark.parametrize("count", [(14, 14), (15, 15)])
def test_a_camera_that_is_cut_to_the_lit_lenslets_keeps_each_ones_chance(count):
    whole = START | {"lenslets": START["lenslets"] | {"count": count}, "sensor": {"pixel_pitch": 6 * um}}
    point = Points(np.array([[30 * um, -40 * um, 3 * mm]]), np.ones(1))
    cut = small(camera(whole), np.array([3 * mm]))
    assert cut.lenslets.count < count
    seen, wide = (one.part_images([]).forward(point) for one in (cut, camera(whole)))
    y, x = ((b - a) // 2 for a, b in zip(seen.shape, wide.shape, strict=True))
    inside = wide[y : y + seen.shape[0], x : x + seen.shape[1]]
    assert off(seen, inside) < 1e-2
    other = small(camera(whole).replace(built={"seed": 4}), np.array([3 * mm]))
    assert off(other.part_images([]).forward(point), inside) > 0.1


def test_lenslets_that_differ_in_an_array_that_leans_have_derivatives():
    given = {"focal_length": 1.4e-3, "count": (3, 3), "pixel_pitch": 3e-6}
    point = Points(np.array([[90e-6, -60e-6, 0.0]]), np.ones(1))

    def one(by=0.0):
        scatter = {"focal_length_scatter": 0.03, "decentre_scatter": 2e-6 * (1 + by), "seed": 2}
        return focused(**given).replace(built={"sensor_tilt": (0.02, 0.0), **scatter})

    images = one().part_images([(one(-1e-3), one(1e-3))])
    assert isinstance(images, TiltedImages)
    low, high = (one(by).part_images([]).forward(point) for by in (-2e-3, 2e-3))
    assert off(2 * images.derivative(point, np.ones(1)), high - low) < 1e-4
