"""Operators of several raw images of one object: where it stands in each, and what comes of them."""

import numpy as np
import pytest
from benchmarks import scanned

import lumigraph as lg
from lumigraph.core.grid import Grid
from lumigraph.metrology.scanning.joint import common_grid
from lumigraph.units import mm, nm, um

CAMERA = lg.PlenopticCamera(
    wavelength=550 * nm,
    object_distance=200 * mm,
    main_lens={"focal_length": 100 * mm},
    lenslets={"pitch": 100 * um, "focal_length": 2.5 * mm, "count": (5, 5)},
    sensor={"pixel_pitch": 10 * um, "full_well": 1e5, "bits": 16, "read_noise": 2},
)
SIZE = 100 * um  # of a lenslet in the object: magnification 1
BLOB = Grid((9, 9), (4 * um, 4 * um))
SOFT = np.exp(-((BLOB.y[:, None] ** 2 + BLOB.x**2) / (2 * (7 * um) ** 2)))


def blob_on(grid, y, x):
    """The same light as `SOFT`, in the middle of (y, x), on other samples."""
    picture = np.exp(-(((grid.y[:, None] - y) ** 2 + (grid.x - x) ** 2) / (2 * (7 * um) ** 2)))
    return picture.astype(np.float32)


def relative(found, truth):
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


def test_an_object_that_was_moved_is_simulated_where_it_then_stands():
    shifts, small = [(0.0, 0.0), (31 * um, -17 * um)], CAMERA.replace(lenslets={"count": (3, 3)})
    operator = lg.joint_operator(small, shifts=shifts, accuracy=1e-2)
    assert operator.object_grid.size[0] > 3 * SIZE
    parts = operator.parted(operator.forward(blob_on(operator.object_grid, 20 * um, 35 * um)))
    for found, (dy, dx) in zip(parts, shifts, strict=True):
        there = Grid((31, 31), (3.5 * um, 3.5 * um), (20 * um + dy, 35 * um + dx))
        picture = blob_on(there, 20 * um + dy, 35 * um + dx)
        truth = lg.simulate(small, lg.Scene([lg.Slice(picture, there)]), lg.Incoherent(1e-2)).data
        assert relative(found, truth) < 2e-2  # the wrong sign of a shift: 1.4


def test_arrays_that_were_moved_see_one_object():
    small = CAMERA.replace(lenslets={"count": (3, 3)})
    cameras = [small.replace(lenslets={"offset": (dy, 25 * um)}) for dy in (-25 * um, 0.0)]
    operator = lg.joint_operator(cameras, accuracy=1e-2)
    x = blob_on(operator.object_grid, 20 * um, 35 * um)
    there = Grid((31, 31), (3.5 * um, 3.5 * um), (20 * um, 35 * um))
    scene = lg.Scene([lg.Slice(blob_on(there, 20 * um, 35 * um), there)])
    for found, camera in zip(operator.parted(operator.forward(x)), cameras, strict=True):
        assert relative(found, lg.simulate(camera, scene, lg.Incoherent(1e-2)).data) < 2e-2  # unmoved: 0.5


def test_a_plain_picture_stands_beside_a_light_field():
    """Focused elsewhere, too: depths count from the first camera's focused plane."""
    plain = lg.SingleLensCamera(
        wavelength=550 * nm,
        object_distance=201 * mm,
        main_lens={"focal_length": 100 * mm, "diameter": 8 * mm},
        sensor={"pixel_pitch": 5 * um, "shape": (101, 101)},
    )
    depths, small = (-1 * mm, 1 * mm), CAMERA.replace(lenslets={"count": (3, 3)})
    operator = lg.joint_operator([small, plain], depths, accuracy=1e-2)
    assert operator.depths == depths
    grid = operator.object_grid
    assert grid.pitch[0] == pytest.approx(min(small.operator_grid().pitch[0], plain.object_grid.pitch[0]))
    volume = np.zeros(operator.shape[1], np.float32)
    volume[1] = blob_on(grid, 20 * um, 35 * um)
    seen, picture = operator.parted(operator.forward(volume))
    there = Grid((31, 31), (3.5 * um, 3.5 * um), (20 * um, 35 * um))
    light = blob_on(there, 20 * um, 35 * um)
    for found, camera, dz in ((seen, small, 1 * mm), (picture, plain, 0.0)):
        truth = lg.simulate(camera, lg.Scene([lg.Slice(light, there, dz)]), lg.Incoherent(1e-2)).data
        assert relative(found, truth) < 2e-2
    with pytest.raises(lg.GeometryError, match=r"focused at 0\.2 to 0\.201 m. Give depths"):
        lg.joint_operator([small, plain])


def test_a_microscope_sees_an_object_that_was_moved():
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-worm").replace(lenslets={"count": (5, 5)})
    step = scope.lenslet_size / 6
    shifts = [(0.0, 0.0), (2 * step, -step), (0.5 * step, 0.0)]
    operator = lg.joint_operator(scope, (2e-6, 5e-6), 6, shifts=shifts, accuracy=1e-2)
    own = scope.operator((2e-6, 5e-6), 6, accuracy=1e-2)
    grid, mine = operator.object_grid, own.object_grid
    x = np.zeros(operator.shape[1], np.float32)
    row, column = (int(np.argmin(np.abs(axis))) for axis in (grid.y, grid.x))
    x[1, row, column] = 1
    place = Grid((1, 1), grid.pitch, (grid.y[row], grid.x[column]))
    first, second, third = operator.parted(operator.forward(x))
    iy, ix = place.samples_to(mine)
    # 6e-3: what few patterns leave out. A sample farther it is another picture by 0.1.
    assert relative(first, own.psf((1, iy, ix))) < 6e-3
    assert relative(second, own.psf((1, iy + 2, ix - 1))) < 6e-3
    assert relative(second, own.psf((1, iy + 2, ix))) > 0.1
    assert third.sum() == pytest.approx(first.sum(), rel=0.01)
    assert relative(third, first) > 0.05


def test_the_adjoint_of_a_moved_microscope_is_its_transpose(rng):
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-worm").replace(lenslets={"count": (3, 3)})
    size = scope.lenslet_size
    shifts = [(size / 3, -2 * size / 3), (0.3 * size, -0.21 * size)]
    operator = lg.joint_operator(scope, (5e-6,), 3, shifts=shifts, accuracy=1e-2)
    for one in (operator, *(part.widened(0.05)[0] for part in operator.maps)):
        x, y = rng.random(one.shape[1]), rng.random(one.shape[0])
        assert np.vdot(one.forward(x), y) == pytest.approx(np.vdot(x, one.adjoint(y)), rel=1e-5)
    wide, (rows, columns) = operator.maps[0].widened(0.05)
    assert operator.maps[0].placed.samples_to(wide.placed) == (rows.start, columns.start) > (0, 0)
    base, inside = scope.operator((5e-6,), 3, accuracy=1e-2).widened(0.05)
    inner, moved = np.zeros(wide.shape[1]), np.zeros(base.shape[1])
    inner[:, rows.start + 5, columns.start + 5] = 1
    dy, dx = wide.placed.samples_to(base.object_grid)
    dy, dx = dy + rows.start, dx + columns.start
    moved[:, dy + 5, dx + 5] = 1
    assert (inside[0].start, inside[1].start) != (dy, dx)
    np.testing.assert_allclose(wide.forward(inner), base.forward(moved), rtol=1e-4, atol=1e-6)


def test_several_raw_images_of_a_microscope_are_deconvolved_wherever_the_object_was_moved(rng):
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-worm").replace(lenslets={"count": (3, 3)})
    size = scope.lenslet_size
    shifts = [(-size / 4, -size / 4), (0.3 * size, -0.21 * size)]
    operator = lg.joint_operator(scope, None, 3, shifts=shifts, accuracy=1e-2)
    for part in operator.maps:
        wide = part.widened(0.05)[0].object_grid
        assert wide.center == pytest.approx(operator.object_grid.center, abs=1e-12)
    raws = operator.parted(operator.forward(rng.random(operator.shape[1]).astype(np.float32)))
    found = lg.deconvolve([lg.RawImage(raw, 1e-5) for raw in raws], operator, 2)
    assert found.data.shape == operator.shape[1]


def test_the_common_grid_holds_what_each_sees_on_the_finest_samples():
    one, fine = Grid((4, 5), (2.0, 2.0)), Grid((7, 3), (1.0, 1.0), (0.25, 0.0))
    grid = common_grid([one, fine], [(0.0, 0.0), (1.0, 0.0)])
    assert grid.pitch == (1.0, 1.0)
    assert fine.samples_to(Grid(grid.shape, grid.pitch, (grid.center[0] + 1.0, grid.center[1]))) >= (0, 0)
    assert grid.y[0] - 0.5 <= one.y[0] - 1 < grid.y[1] - 0.5
    assert grid.y[-2] + 0.5 < one.y[-1] + 1 <= grid.y[-1] + 0.5
    assert grid.x[0] - 0.5 <= one.x[0] - 1 < grid.x[1] - 0.5
    assert common_grid([one, one], [(0.0, 0.0)] * 2) == one


@pytest.mark.long
def test_nine_frames_double_the_resolved_frequency_at_equal_photons():
    """Charts and operators differ in samples and accuracy; one frame has nine times the light of each."""
    one, nine = (scanned.contrasts(steps, (0.4, 0.9), 40) for steps in (1, 3))
    assert min(nine) > 0.92
    assert one[0] < 0.88
    assert one[1] < 0.6


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (lambda: lg.joint_operator(CAMERA), "one camera and no shifts"),
        (lambda: lg.joint_operator([]), "one camera and no shifts"),
        (lambda: lg.joint_operator(CAMERA, shifts=[]), "must be finite pairs"),
        (lambda: lg.joint_operator(CAMERA, shifts=[(0.0, float("nan"))]), "must be finite pairs"),
        (lambda: lg.joint_operator(CAMERA, shifts=[0.0, 1.0]), "must be finite pairs"),
        (lambda: lg.joint_operator([CAMERA], shifts=[(0.0, 0.0)] * 2), "2 shifts for 1 cameras"),
        (lambda: lg.joint_operator(["camera"]), "a camera"),
        (
            lambda: lg.joint_operator([CAMERA, lg.LightFieldMicroscope.from_catalogue("lfm-worm")]),
            "some cameras have a main lens",
        ),
        (lambda: lg.scan(0, 1e-4), "steps is 0"),
        (lambda: lg.scan(3, -1.0), "period"),
    ],
)
def test_what_is_no_scan_is_refused_in_one_line(what, message):
    with pytest.raises(lg.LumigraphError, match=message):
        what()
