"""Raw images of planes whose samples are points, or blurred alike: beside operators, and derivatives."""

from functools import partial

import numpy as np
import pytest
from tests.operators import test_part_each as each
from tests.operators import test_part_exact as exact
from tests.operators import test_part_field as varying
from tests.operators import test_part_lens as lens
from tests.operators.test_part_images import camera, off, pair, peak

import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError, SamplingWarning
from lumigraph.operators import single_lens
from lumigraph.operators.lenslets import plane_of_points
from lumigraph.operators.lenslets import point_images as part_images
from lumigraph.operators.lenslets.film_plane import FilmPlane
from lumigraph.operators.lenslets.part_leaning import TiltedImages
from lumigraph.operators.lenslets.part_plane import PartPlane
from lumigraph.operators.lenslets.plane_of_points import PlaneOfPoints
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.lenslets.sample_images import sample_images
from lumigraph.scene import Points
from lumigraph.studies.information import Light
from lumigraph.studies.information.points import collected
from lumigraph.units import mm, um

DZ, GRID = -2 * mm, Grid((3, 2), (60 * um, 50 * um), (30 * um, -20 * um))


def few(given):
    """With few lenslets and pixels."""
    return given | {
        "main_lens": given["main_lens"] | {"diameter": 1 * mm},
        "lenslets": given["lenslets"] | {"count": (3, 3)},
        "sensor": given["sensor"] | {"pixel_pitch": 12 * um, "shape": (60, 56)},
    }


FIELD, DIFFER, EXACT = few(varying.START), few(each.START), few(exact.SMALL)
KINDS = {
    "over_field": (varying.camera, lambda key, step: varying.ends(key, step, FIELD), FIELD),
    "differ": (each.camera, lambda key, step: each.pair(DIFFER, key, step=step), DIFFER),
    "exact": (camera, lambda key, step: pair(EXACT, key, step=step), EXACT),
    "no lenslets": (lens.camera, lens.ends, lens.START),
    "no lenslets, over_field": (
        lens.camera, lambda key, step: lens.ends(key, step, lens.VARYING), lens.VARYING
    ),
}  # fmt: skip
SLOW = [kind if kind == "no lenslets" else pytest.param(kind, marks=pytest.mark.long) for kind in KINDS]
LENS = ("object_distance", "wavelength", "main_lens.focal_length", "main_lens.diameter", "sensor.pixel_pitch")
KEYS = {
    "over_field": ("object_distance", "wavelength", "lenslets.pitch", "coma", "sensor.pixel_pitch"),
    "differ": ("object_distance", "lenslets.pitch", "lenslets.focal_length", "built.tilt_scatter"),
    "exact": ("object_distance", "lenslets.pitch", "sensor.pixel_pitch"),
    "no lenslets": LENS,
    "no lenslets, over_field": LENS[:4],
}


def plane(kind, pairs=(), grid=GRID, **changes):
    of, _, given = KINDS[kind]
    return of(given).replace(**changes).part_plane(list(pairs), grid, DZ)


def pairs(kind, step=1e-6):
    return [KINDS[kind][1](key, step) for key in KEYS[kind]]


@pytest.mark.parametrize("kind", SLOW)
def test_slopes_are_central_differences_of_raw_images(kind, rng):
    """Of cameras farther to either side than the pair is; those of dark samples' points are none."""
    seen, x = plane(kind, pairs(kind)), rng.random((2, *GRID.shape))
    x[:, 0, 0] = 0
    weights, (_, ends, _) = rng.standard_normal((2, *seen.shape[0])), KINDS[kind]
    for key, slope in zip(KEYS[kind], seen.gradient(x, weights), strict=True):
        low, high = (one.part_plane([], GRID, DZ).forward(x) for one in ends(key, 1e-5))
        assert 10 * slope == pytest.approx(np.vdot(weights, high - low), rel=1e-4, abs=0), key


@pytest.mark.parametrize("kind", SLOW)
def test_the_gradient_is_the_derivatives_transpose_and_adds_up_objects(kind, rng):
    seen, x = plane(kind, pairs(kind)), rng.standard_normal((2, *GRID.shape))
    weights, change = rng.standard_normal((2, *seen.shape[0])), rng.standard_normal(len(KEYS[kind]))
    moved = np.stack([seen.derivative(one, change) for one in x])
    rounding = 1e-10 * np.linalg.norm(weights) * np.linalg.norm(moved)  # most of the sum cancels
    assert seen.gradient(x, weights) @ change == pytest.approx(np.vdot(weights, moved), abs=rounding)
    assert seen.forward(x)[1] == pytest.approx(seen.forward(x[1]), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("kind", "of", "most"),
    [
        pytest.param("exact", PartPlane, 1e-2, marks=pytest.mark.long),
        ("no lenslets", FilmPlane, 2e-3),
        pytest.param("no lenslets, over_field", PlaneOfPoints, 1e-2, marks=pytest.mark.long),
    ],
)
@pytest.mark.filterwarnings("ignore:the periodic operator takes")
def test_raw_images_are_those_of_the_operator(kind, of, most, rng):
    """To the accuracy; few lenslets are all at the border of the array, so that more are seen here."""
    grid = Grid((9, 7), (40 * um, 50 * um), (30 * um, -20 * um))
    wide = {"lenslets": {"count": (7, 7)}, "sensor": {"shape": (140, 130)}} if kind == "exact" else {}
    x, seen = rng.random(grid.shape), plane(kind, grid=grid, **wide)
    one = KINDS[kind][0](KINDS[kind][2]).replace(**wide)
    assert isinstance(seen, of)
    assert off(seen.forward(x), one.operator_on(grid, [DZ], accuracy=3e-3).forward(x[None])) < most


@pytest.mark.parametrize("kind", ["differ", "over_field", "no lenslets"])
def test_samples_are_points_as_bright_as_their_area(kind, rng):
    x, one = rng.random(GRID.shape), KINDS[kind][0](KINDS[kind][2])
    y, across = np.meshgrid(GRID.y, GRID.x, indexing="ij")
    bright = x.ravel() * np.prod(GRID.pitch) / one.optics().object_pitch ** 2
    points = Points(np.stack([y.ravel(), across.ravel(), np.full(6, DZ)], 1), bright)
    known = (
        single_lens.points_image(one, points)[0] if kind == "no lenslets" else points_image(one, points, 1e-3)
    )
    assert off(plane(kind).forward(x), known) < 5e-3


@pytest.mark.long
def test_more_samples_take_no_more_memory_and_their_order_is_none(monkeypatch):
    """Beyond those that are seen together."""
    monkeypatch.setattr(part_images, "TOGETHER", 8)
    monkeypatch.setattr(plane_of_points, "SQUARE", 2)
    images = lens.camera(lens.VARYING).part_images(pairs("no lenslets, over_field")[:1])
    grids = [Grid((4, n), (20 * um, 20 * um)) for n in (2, 7)]
    few, many = (PlaneOfPoints(images, grid, DZ) for grid in grids)
    weights = np.ones(images.shape)
    small, large = (peak(lambda p=p: p.gradient(np.ones(p.grid.shape), weights)) for p in (few, many))
    assert large < small + 100e3  # 20 more that are kept have 450 kB
    x = np.zeros(grids[1].shape)
    x[2, 5] = 1
    alone = Points(np.array([[grids[1].y[2], grids[1].x[5], DZ]]), np.ones(1))
    scale = 20 * um / images.camera.object_pitch
    assert off(many.forward(x), scale**2 * images.forward(alone)) < 1e-9
    parts = many.forward(x + 1)
    monkeypatch.setattr(part_images, "TOGETHER", 1000)
    assert off(many.forward(x + 1), parts) < 1e-9


def test_planes_that_take_too_long_are_refused_and_minutes_are_told(monkeypatch):
    seen = plane("differ")
    monkeypatch.setattr(plane_of_points, "LONGEST", 1e5)
    with pytest.raises(SamplingError, match=r"6 samples are as many points.*Use a smaller grid"):
        seen.forward(np.ones(GRID.shape))
    monkeypatch.setattr(plane_of_points, "LONGEST", 1e15)
    monkeypatch.setattr("lumigraph.operators.sampling.time_limits.A_MINUTE", 1e5)
    with pytest.warns(SamplingWarning, match="an image of 6 samples, as many points, takes some"):
        seen.forward(np.ones(GRID.shape))


def test_light_that_does_not_fit_in_memory_is_refused(monkeypatch):
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: 1000)
    for kind, what in (("differ", "light of 1 objects"), ("no lenslets", "the image's")):
        with pytest.raises(SamplingError, match=what):
            plane(kind).forward(np.ones(GRID.shape))


def test_exact_cells_over_a_wide_field_are_points(monkeypatch):
    assert isinstance(plane("exact"), PartPlane)
    monkeypatch.setattr(plane_of_points, "field_matters", lambda *_: True)
    assert isinstance(plane("exact"), PlaneOfPoints)


def test_images_of_samples_are_an_operator(rng, monkeypatch):
    monkeypatch.setattr("lumigraph.operators.lenslets.sample_images.TOGETHER", 4)
    volume = each.camera(DIFFER).part_volume([], GRID, (DZ, 1 * mm))
    operator = sample_images(volume, (DZ, 1 * mm))
    x, raw = rng.random(volume.shape[1]), rng.random(volume.shape[0])
    assert operator.shape == volume.shape
    assert off(operator.forward(x), volume.forward(x)) < 1e-6
    assert np.vdot(operator.forward(x), raw) == pytest.approx(np.vdot(x, operator.adjoint(raw)), rel=1e-9)


def test_lenslets_that_differ_lean_as_well():
    one = each.camera(few(each.START | {"built": each.DIFFER | {"sensor_tilt": (0.01, 0.0)}}))
    seen = one.part_plane([], GRID, DZ)
    assert isinstance(seen, TiltedImages)
    assert {type(part) for part in seen.parts} == {PlaneOfPoints}


@pytest.mark.parametrize(
    "kind", ["no lenslets", *(pytest.param(one, marks=pytest.mark.long) for one in ("over_field", "differ"))]
)
def test_the_error_of_scenes_has_slopes(kind):
    """Beside differences of errors, which end at 1e-3 of themselves, with light by the aperture."""
    scenes, where = lg.information.Scenes(45 * um, 8), [DZ]
    of, ends, given = KINDS[kind]
    if kind == "no lenslets":  # with pixels around what the scene lights
        given = given | {"sensor": given["sensor"] | {"shape": (240, 250)}}
        ends = partial(lens.ends, given=given)
    one, key = of(given), "main_lens.diameter"
    found = lg.information.reconstruction_slopes(one, [ends(key, 1e-6)], where, scenes, Light(5000))
    known = lg.information.reconstruction_error(one, where, scenes, Light(5000))
    assert found.bound == pytest.approx(known.value, rel=1e-6, abs=0)
    low, high = (
        lg.information.reconstruction_error(end, where, scenes, light).value
        for end in ends(key, 1e-2)
        for light in [Light(5000 * collected(end) / collected(one))]
    )
    assert 1e4 * found.changes[0] == pytest.approx(high - low, rel=0.05, abs=0)
