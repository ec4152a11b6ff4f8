"""`simulate` with a light-field microscope: points where they are, slices of any sampling, volumes, white."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.errors import GeometryError
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.units import um

LIGHT = lg.Incoherent(accuracy=1e-2)


@pytest.fixture(scope="module")
def scope():
    return LightFieldMicroscope(
        wavelength="525 nm",
        objective={"magnification": 20.0, "numerical_aperture": 0.5},
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": (5, 6)},
        sensor={"pixel_pitch": "12.5 um"},
    )


@pytest.mark.parametrize("dz", [0.0, 15e-6])
def test_a_point_on_a_sample_is_the_operators_image_of_it(scope, dz):
    operator = scope.operator((dz,), 5, accuracy=1e-2)
    grid, index = operator.object_grid, (0, 11, 17)
    raw = lg.simulate(scope, lg.targets.points([(grid.y[11], grid.x[17], dz)], [2.0]), LIGHT)
    expected = 2 * operator.psf(index)
    # Both are right to 1e-2, the operator with patterns for cells far from the point's own.
    assert np.linalg.norm(raw.data - expected) < 8e-3 * np.linalg.norm(expected)
    assert raw.data.sum() == pytest.approx(expected.sum(), rel=0.01)
    assert raw.metadata["error"]["rms"] < 1e-2
    assert raw.pixel_pitch == pytest.approx(12.5e-6)


def test_a_white_image_does_not_change_with_finer_points(scope):
    small = scope.replace(lenslets={"count": (5, 5)}, sensor={"shape": (50, 50)})
    raw = lg.simulate(small, lg.targets.white(), LIGHT)
    fine = small.operator((0.0,), 17, accuracy=1e-2)
    plane = fine.forward(np.ones(fine.shape[1], np.float32))
    found, expected = (one[20:30, 20:30] / one[20:30, 20:30].mean() for one in (raw.data, plane))
    assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)  # 0.1 by five points a lenslet


def test_a_point_between_samples_is_between_their_images(scope):
    grid = scope.object_grid
    at = [scope.point_image(grid.y[12], grid.x[k], 10 * um, accuracy=1e-2) for k in (15, 16)]
    between = scope.point_image(grid.y[12], (grid.x[15] + grid.x[16]) / 2, 10 * um, accuracy=1e-2)
    x = np.arange(between.shape[1])
    places = [image.sum(0) @ x / image.sum() for image in (*at, between)]
    assert places[2] == pytest.approx((places[0] + places[1]) / 2, abs=0.05)
    assert places[1] - places[0] == pytest.approx(
        grid.pitch[1] * 20 / 12.5e-6, rel=0.15
    )  # lenslets invert what they see
    assert np.abs(between - at[0]).sum() > 0.05 * between.sum()


def test_a_point_beyond_the_lenslets_is_dark_and_one_at_the_border_is_cut(scope):
    assert scope.point_image(0.0, 200 * um, 0.0, accuracy=1e-2).sum() == 0
    border = scope.point_image(0.0, scope.object_grid.x[-1], 20 * um, accuracy=1e-2)
    middle = scope.point_image(0.0, 0.0, 20 * um, accuracy=1e-2)
    assert 0.3 * middle.sum() < border.sum() < 0.8 * middle.sum()


def test_a_slice_on_the_object_grid_is_the_operators_image(scope, rng):
    grid = scope.object_grid
    picture = rng.random(grid.shape)
    raw = lg.simulate(scope, lg.scene.Scene([lg.scene.Slice(picture, grid, 8 * um)]), LIGHT)
    operator = scope.operator((8 * um,), 5, accuracy=1e-2)
    assert operator.error <= 1e-2  # or finer samples would be taken
    expected = operator.forward(picture[None].astype(np.float32))
    np.testing.assert_allclose(raw.data, expected, rtol=1e-4, atol=1e-5)


def test_a_finer_slice_is_as_bright_and_stands_where_it_stands(scope):
    # A square of 10 um about (5, -7.5) um, drawn on samples of 0.7 um that match no lenslet.
    fine = lg.Grid((60, 70), 0.7 * um)
    inside = (abs(fine.y - 5 * um)[:, None] < 5 * um) & (abs(fine.x + 7.5 * um) < 5 * um)
    raw = lg.simulate(scope, lg.scene.Scene([lg.scene.Slice(inside * 1.0, fine)]), LIGHT).data
    y, x = (np.arange(n) - n // 2 for n in raw.shape)
    scale = 20 / 12.5e-6
    lit = np.nonzero(inside)
    expected = (fine.y[lit[0]].mean() * scale, fine.x[lit[1]].mean() * scale)
    assert (raw.sum(1) @ y / raw.sum(), raw.sum(0) @ x / raw.sum()) == pytest.approx(expected, abs=1.0)
    assert raw.sum() == pytest.approx(inside.sum() * (0.7 * um * scale) ** 2, rel=0.02)


def test_a_volume_is_its_planes(scope, rng):
    grid, depths = scope.object_grid, (-6 * um, 6 * um)
    data = rng.random((2, *grid.shape)).astype(np.float32)
    raw = lg.simulate(scope, lg.Volume(data, grid, depths), LIGHT)
    # Each plane for itself has other samples behind a lenslet than both together: both are right to 1e-2.
    expected = scope.operator(depths, 5, accuracy=1e-2).forward(data)
    assert np.linalg.norm(raw.data - expected) < 1e-3 * np.linalg.norm(expected)


def test_a_white_image_is_even_up_to_the_border_and_says_where_the_lenslets_are(scope):
    wide = scope.replace(lenslets={"count": (13, 13)})
    white = lg.simulate(wide, lg.targets.white(3.0), LIGHT).data
    assert white.mean() == pytest.approx(3.0, rel=0.02)
    assert lg.calibrate(white).lattice.pitches == pytest.approx((10.0, 10.0), abs=0.02)


def test_a_fourier_microscope_takes_scenes_too():
    scope = LightFieldMicroscope.from_catalogue("lfm-fourier")
    grid = scope.object_grid
    operator = scope.operator((5 * um,))
    assert operator.object_grid == grid
    middle = tuple(n // 2 for n in grid.shape)
    raw = lg.simulate(scope, lg.targets.points([(0.0, 0.0, 5 * um)]))
    np.testing.assert_allclose(raw.data, operator.psf((0, *middle)), atol=1e-6 * raw.data.max())
    picture = np.zeros(grid.shape)
    picture[middle] = 1
    slices = lg.simulate(scope, lg.scene.Scene([lg.scene.Slice(picture, grid, 5 * um)]))
    np.testing.assert_allclose(slices.data, raw.data, atol=1e-5 * raw.data.max())


def test_what_a_microscope_cannot_see_is_refused(scope):
    point = lg.targets.points([(0, 0)])
    with pytest.raises(GeometryError, match=r"coherence is Coherent\(.*fluorescence.* Leave coherence out"):
        lg.simulate(scope, point, lg.Coherent())
    with pytest.raises(GeometryError, match="the scene is empty"):
        lg.simulate(scope, lg.scene.Scene())
    with pytest.raises(GeometryError, match="dz is nan"):
        scope.point_image(0.0, 0.0, float("nan"))
    colours = lg.scene.Slice(np.ones((4, 4, 3)), lg.Grid.square(4, 1 * um))
    with pytest.raises(GeometryError, match=r"a slice has shape \(4, 4, 3\) .* spectrum=Spectrum.rgb"):
        lg.simulate(scope, lg.scene.Scene([colours]))
