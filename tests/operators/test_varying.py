"""Main lenses whose aberrations change over the field, against sums over the stop that share no code."""

import numpy as np
import pytest

import lumigraph as lg
from cameras import focused
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.lenslets.points import points_image
from lumigraph.operators.sampling import field_lenses
from lumigraph.operators.sampling.resampling import averaged
from lumigraph.scene import Diffuser, Scene

COMA, BENT = 1.0, -6.0
"""Waves rms at a degree, of coma, as the field, and of defocus, as its square."""

FIELDS = [0.0, 0.05, 0.1, 0.15]

ROUND = {
    "field": [f"{angle} deg" for angle in FIELDS],
    "unit": "waves",
    "terms": {8: [COMA * angle for angle in FIELDS], 4: [BENT * angle**2 for angle in FIELDS]},
}
MILD = {**ROUND, "terms": {8: [0.4 * COMA * angle for angle in FIELDS], 4: [0.0] * 4}}
NOTHING = {**ROUND, "terms": {8: [0.0] * 4, 4: [0.0] * 4}}


def aberrated(table=None, **others):
    return focused().replace(main_lens={"over_field": ROUND if table is None else table}, **others)


def single(table=None):
    """Without lenslets."""
    return lg.SingleLensCamera(
        wavelength="550 nm", object_distance="200 mm",
        main_lens={"focal_length": "100 mm", "diameter": "4 mm", "over_field": table or ROUND},
        sensor={"pixel_pitch": "4 um", "shape": (401, 401)},
    )  # fmt: skip


def phase(y, x, diameter, field):
    """Of Seidel's coma and field curvature, in Noll's normalisation [rad], written out."""
    angle = np.degrees(np.hypot(*field))
    rho, theta = np.hypot(y, x) / (diameter / 2), np.arctan2(y, x) - np.arctan2(*field)
    coma = COMA * angle * np.sqrt(8) * (3 * rho**3 - 2 * rho) * np.cos(theta)
    return 2 * np.pi * (coma + BENT * angle**2 * np.sqrt(3) * (2 * rho**2 - 1))


def direct(camera, point):
    """Fresnel sums over stop, lenslet plane and image, on grids on which borders fall between samples."""
    (y, x), z = point, camera.object_distance
    stop, plane = np.arange(-200, 200) * 5e-6 + 2.5e-6, np.arange(-250, 250) * 1e-6 + 0.5e-6
    image = lg.Grid.square(480, 1.5e-6)

    def carried(light, source, goals, distance):
        k = np.pi / (camera.wavelength * distance)
        down, across = (np.exp(1j * k * np.subtract.outer(goal, source) ** 2) for goal in goals)
        return down @ light @ across.T

    k, (v, u) = np.pi / camera.wavelength, np.meshgrid(stop, stop, indexing="ij")
    path = ((v - y) ** 2 + (u - x) ** 2) / z - (v**2 + u**2) / camera.main_lens.focal_length
    far = (np.hypot(v, u) - camera.pupil_diameter / 2) / 5e-6
    light = np.clip(0.5 - far, 0, 1) * np.exp(1j * k * path)
    light = light * np.exp(1j * phase(v, u, camera.pupil_diameter, (y / z, x / z)))
    light = carried(light, stop, (plane, plane), camera.separation)
    pitch, f = camera.lenslets.pitch, camera.lenslets.focal_length[0]
    off = (plane + pitch * 2) % pitch - pitch / 2  # four of them: their edges lie on the axis
    lens, there = np.exp(-1j * k * off**2 / f), np.abs(plane) < 2 * pitch
    light = light * np.outer(lens * there, lens * there)
    seen = np.abs(carried(light, plane, (image.y, image.x), camera.lenslet_distance)) ** 2
    return averaged(image, camera.sensor.grid).forward(seen.astype(np.float32))


def off(found, expected):
    """Relative rms difference but for the brightness."""
    share = np.sum(found * expected) / np.sum(expected * expected)
    return np.linalg.norm(found - share * expected) / np.linalg.norm(found)


@pytest.mark.parametrize("point", [(20e-6, -60e-6), (-90e-6, 35e-6)])
def test_a_point_has_the_aberrations_of_its_field(point):
    camera, scene = aberrated(), lg.targets.points([point])
    expected = direct(camera, point)
    assert off(np.asarray(lg.simulate(camera, scene).data), expected) < 5e-4
    assert off(np.asarray(lg.simulate(focused(), scene).data), expected) > 0.02


def test_without_lenslets_a_point_is_a_transform_of_the_stop():
    """At a field between the nodes and between the axes; pixels by 3 x 3 places each."""
    camera, (y, x) = single(), (-0.21e-3, 0.33e-3)
    raw = np.asarray(lg.simulate(camera, lg.targets.points([(y, x)])).data)
    z, n = camera.object_distance, 240
    stop = (np.arange(n) - n / 2 + 0.5) * camera.pupil_diameter / n
    v, u = np.meshgrid(stop, stop, indexing="ij")
    grey = np.clip(0.5 - (np.hypot(v, u) - camera.pupil_diameter / 2) / (stop[1] - stop[0]), 0, 1)
    pupil = grey * np.exp(1j * phase(v, u, camera.pupil_diameter, (y / z, x / z)))
    k, grid = -2j * np.pi / (camera.wavelength * camera.separation), camera.sensor.grid
    parts = np.array([-1, 0, 1]) / 3 * camera.sensor.pixel_pitch
    rows, columns = (abs(axis - at).argmin() + np.arange(-45, 46) for axis, at in ((grid.y, y), (grid.x, x)))
    # A raw image is turned by 180 degrees: pixels at s show what arrives at -s.
    down = np.exp(k * np.outer((y - grid.y[rows, None] - parts).ravel(), stop))
    across = np.exp(k * np.outer((x - grid.x[columns, None] - parts).ravel(), stop))
    seen = np.abs(down @ pupil @ across.T) ** 2
    expected = seen.reshape(91, 3, 91, 3).mean((1, 3))
    found = raw[np.ix_(rows, columns)]
    assert off(found, expected) < 3e-3
    assert off(found[:, ::-1], expected) > 0.05


def test_a_field_that_is_turned_turns_its_image():
    """Of a round lens: a quarter of a turn about the axis, exactly."""
    camera, (y, x) = single(), (0.1e-3, 0.34e-3)
    one, other = (np.asarray(lg.simulate(camera, lg.targets.points([at])).data) for at in ((y, x), (x, -y)))
    assert np.abs(np.rot90(one, -1) - other).max() < 2e-5 * one.max()


def test_aberrations_take_no_light_away():
    camera, plain = aberrated(lenslets={"count": (8, 8)}), focused(count=(8, 8))
    scene = lg.targets.points([(60e-6, 80e-6)])
    one, other = (float(np.sum(lg.simulate(c, scene).data)) for c in (camera, plain))
    assert one == pytest.approx(other, rel=5e-3)  # light leaves the array


def test_nothing_over_the_field_is_the_ideal_lens():
    scene, picture = lg.targets.points([(50e-6, -70e-6)]), np.random.default_rng(2).random((24, 24))
    slices = Scene([lg.Slice(picture, lg.Grid.square(24, 12e-6))])
    for camera, plain in ((aberrated(NOTHING), focused()), (single(NOTHING), single_ideal())):
        for each in (scene, slices):
            one, other = (np.asarray(lg.simulate(c, each).data, float) for c in (camera, plain))
            assert np.linalg.norm(one - other) < 1e-6 * np.linalg.norm(other)


def single_ideal():
    return single().replace(main_lens={"over_field": None})


@pytest.fixture(scope="module")
def coarse():
    return aberrated(MILD).operator(accuracy=1e-2)


def test_an_operator_sees_points_between_its_lenses(coarse):
    """Each sample is a point of its own field, to the accuracy; the lens of the axis is not."""
    camera, grid = aberrated(MILD), coarse.object_grid
    shown, middle = [], []
    for index in ((1, 2), (8, 12), (13, 2)):
        place = np.array([[grid.y[index[0]], grid.x[index[1]], 0.0]])
        expected = points_image(camera, lg.Points(place, np.ones(1)), 1e-3)
        axis = points_image(field_lenses.at(camera.optics(), 0.0, 0.0), lg.Points(place, np.ones(1)), 1e-3)
        shown.append(off(coarse.psf(index), expected))
        middle.append(off(axis, expected))
    assert max(shown) < 1.5 * coarse.error
    assert max(middle) > 2 * max(shown)


def test_its_adjoint_is_its_transpose(coarse):
    rng = np.random.default_rng(3)
    picture, raw = (rng.random(shape) for shape in coarse.shape[::-1])
    assert np.vdot(coarse.forward(picture), raw) == pytest.approx(
        np.vdot(picture, coarse.adjoint(raw)), rel=1e-6
    )


def test_the_error_between_lenses_is_part_of_the_promise():
    picture = np.random.default_rng(2).random((16, 16))
    scene = Scene([lg.Slice(picture, lg.Grid.square(16, 12e-6))])
    raw = lg.simulate(aberrated(MILD), scene, lg.Incoherent(1e-2))
    assert "lenses over the field" in raw.metadata["error"]["source"]
    assert 1e-4 < raw.metadata["error"]["rms"] < 1e-2


@pytest.mark.long
def test_depths_have_their_own_fields():
    operator = aberrated(MILD).operator([-1e-3, 1e-3], 1, accuracy=1e-2)
    assert operator.shape[1][0] == 2
    rng = np.random.default_rng(4)
    volume, raw = (rng.random(shape) for shape in operator.shape[::-1])
    assert np.vdot(operator.forward(volume), raw) == pytest.approx(
        np.vdot(volume, operator.adjoint(raw)), rel=1e-6
    )


def test_white_images_do_not_see_phases():
    one, other = (np.asarray(lg.simulate(c, Scene([Diffuser()])).data) for c in (aberrated(), focused()))
    assert np.abs(one - other).max() < 1e-3 * other.max()


def test_what_no_field_of_the_table_holds_is_refused():
    with pytest.raises(GeometryError, match=r"light comes from 0\.2\d+ degrees .* given to 0\.15 degrees"):
        lg.simulate(aberrated(), lg.targets.points([(0.0, 0.5e-3)]))


def test_aberrations_that_change_too_fast_are_refused_with_numbers(monkeypatch):
    monkeypatch.setattr(field_lenses, "COUNTS", (3,))
    with pytest.raises(SamplingError, match=r"3 x 3 others are off by .* Ask for"):
        aberrated().operator()


@pytest.mark.parametrize(
    "light", [lg.Coherent(), lg.Snapshots(2, rng=1), lg.TiltedWaves(2)], ids=lambda each: type(each).__name__
)
def test_light_that_goes_through_one_lens_is_refused(light):
    slices = Scene([lg.Slice(np.ones((8, 8)), lg.Grid.square(8, 12e-6))])
    for camera in (aberrated(), single()):
        with pytest.raises(GeometryError, match="change over the field"):
            lg.simulate(camera, slices, light)


def test_opaque_slices_and_exact_lenslets_are_refused():
    grid = lg.Grid.square(8, 12e-6)
    opaque = Scene([lg.Slice(np.ones((8, 8)), grid, opacity=np.ones((8, 8)))])
    with pytest.raises(GeometryError, match="change over the field"):
        lg.simulate(aberrated(), opaque)
    with pytest.raises(GeometryError, match='model is "exact" but the main lens changes'):
        aberrated(model="exact").optics()
    assert aberrated(model="auto").optics().model == "auto"


def test_a_sketch_keeps_distances_of_images(rng):
    """Of smooth ones and of sharp ones: 8192 numbers for a million, to the few percent that lenses allow."""
    images = [rng.random(10**6) * np.linspace(0, 1, 10**6) ** power for power in (0, 5, 60)]
    images.append(np.eye(1, 10**6, 4321)[0])
    sketches = [field_lenses.sketch(image) for image in images]
    assert {len(one) for one in sketches} == {field_lenses.KEPT}
    for k, (one, mine) in enumerate(zip(images, sketches, strict=True)):
        for other, its in zip(images[:k], sketches[:k], strict=True):
            assert np.linalg.norm(mine - its) == pytest.approx(np.linalg.norm(one - other), rel=0.05)
    np.testing.assert_array_equal(field_lenses.sketch(images[0][:100]), images[0][:100])


def test_the_lens_of_the_axis_is_chosen_first():
    """Its light is the same in mirrors: blocks are computed for a quarter of a plane."""
    camera, fields = aberrated(MILD).optics(), np.linspace(-1.2e-3, 1.2e-3, 9)

    def image(one):
        waves = {j: rms for p in one.lens.elements for j, rms in dict(getattr(p, "coefficients", {})).items()}
        return np.array([1.0, waves.get(7, 0.0), waves.get(8, 0.0)])

    first = field_lenses.lenses(camera, (fields, fields), image, 1e-2).chosen[0]
    assert first.field == pytest.approx((0.0, 0.0), abs=1e-15)


def test_counts_of_nodes_that_would_not_do_are_left_out(monkeypatch):
    """Each leaves a part of what the one before it left: from 0.1 and 0.03 that is 5e-4 at 11."""
    camera, fields, asked = aberrated(MILD).optics(), np.linspace(-1.2e-3, 1.2e-3, 9), []

    def with_nodes(_, count):
        asked.append(count)
        return field_lenses.FieldLenses((), np.zeros((0, count, count)), (0.0, 0.0), (1.0, 1.0), left[count])

    monkeypatch.setattr(field_lenses._LensSearch, "with_nodes", with_nodes)
    left = dict(zip(field_lenses.COUNTS, (0.1, 0.03, 6e-3, 2e-3, 5e-4), strict=True))
    assert field_lenses.lenses(camera, (fields, fields), np.ravel, 1e-3).left == 5e-4
    left = dict(zip(field_lenses.COUNTS, (0.1, 0.2, 0.03, 5e-3, 5e-4), strict=True))
    assert field_lenses.lenses(camera, (fields, fields), np.ravel, 1e-2).left == 5e-3
    assert asked == [3, 5, 11, 3, 5, 7, 9]
