"""The microscope's operator: against direct propagation, symmetry, adjoint, light, real pixels, files."""

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.linear import Linear
from lumigraph.core.matrix import Matrix
from lumigraph.elements.objective import Objective
from lumigraph.errors import FormatError, GeometryError, SamplingError
from lumigraph.operators.microscope import building as building
from lumigraph.operators.microscope import volume_operator as module
from lumigraph.operators.microscope.building import SampledLenslets, microscope_operator
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.kernels import KernelAccuracy, octant, slice_kernel
from lumigraph.operators.microscope.pixels import FRAME, placement
from lumigraph.operators.sampling.resampling import Resampling

SCOPE = Objective(525e-9, 0.5)
LENSLET = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6)
SAMPLING = CellSampling(3, 8, 1 / 8)
LAYOUT = SampledLenslets((5, 6), SAMPLING)
DEPTHS = (-8e-6, 0.0, 15e-6)


@pytest.fixture(scope="module")
def operator():
    return microscope_operator([SCOPE], LENSLET, LAYOUT, DEPTHS, accuracy=1e-2)


def lattice_calibration(shape, pitch, rotation=0.0, origin=(30.0, 31.0)):
    lattice = Lattice.square(pitch, rotation, origin)
    indices = lattice.indices((0, shape[0] - 1), (0, shape[1] - 1))
    return Calibration(lattice, shape, indices, lattice.position(indices), 0.0)


def test_a_points_image_is_that_of_one_direct_propagation():
    # Field, lenslet phases on the whole plane, Fresnel by a dense DFT along each axis: no cells, no symmetry.
    kernel = slice_kernel([SCOPE], LENSLET, SAMPLING, 6e-6, KernelAccuracy(1e-2, 9))
    p, n, T, M = LENSLET.pitch, 48, 9, LENSLET.magnification
    at = (np.arange(T * n) - (T * n - 1) / 2) * p / n
    for ky, kx in ((0, 1), (2, 0)):
        y, x = ((at - (k - 1) / 3 * p) / M for k in (ky, kx))
        own = (at + p / 2) % p - p / 2
        lens = np.exp(-1j * np.pi * own**2 / (SCOPE.wavelength * LENSLET.focal_length))
        field = SCOPE.fields(y[:, None], x[None, :], 6e-6)[0] * lens[:, None] * lens
        away = at[:, None] - at
        fresnel = np.exp(1j * np.pi * away**2 / (SCOPE.wavelength * LENSLET.distance))
        fresnel *= np.abs(away) < 1.9 * p  # light goes no farther, and beyond 2 p samples would alias
        image = np.abs(fresnel @ field @ fresnel.T) ** 2
        cells = image.reshape(T, 8, 6, T, 8, 6).mean((2, 5)).transpose(0, 2, 1, 3)
        cells *= 64 / 9 / cells.sum()
        found = kernel.matrix().reshape(len(kernel.offsets), 9, 8, 8)[:, ky * 3 + kx]
        expected = np.stack([cells[dy + T // 2, dx + T // 2] for dy, dx in kernel.offsets])
        # 2 % of the light may be dropped; the field's tails differ by the window.
        assert np.abs(found - expected).sum() < 0.04 * expected.sum()


def test_the_points_of_an_eighth_make_all_points():
    symmetric = slice_kernel([SCOPE], LENSLET, CellSampling(4, 6, 1 / 6), 10e-6)
    tilted = Objective(525e-9, 0.5, aberrations={2: 1e-9})  # the same, but known to be unsymmetric
    whole = slice_kernel([tilted], LENSLET, CellSampling(4, 6, 1 / 6), 10e-6)
    assert symmetric.symmetric
    assert len(symmetric.blocks) == len(octant(4)) == 3
    assert not whole.symmetric
    assert len(whole.blocks) == 16
    places = {tuple(o): k for k, o in enumerate(whole.offsets)}
    rows = [places[tuple(o)] for o in symmetric.offsets if tuple(o) in places]
    common = [k for k, o in enumerate(symmetric.offsets) if tuple(o) in places]
    ours = symmetric.matrix().reshape(-1, 16, 36)[common]
    theirs = whole.matrix().reshape(-1, 16, 36)[rows]
    np.testing.assert_allclose(ours, theirs, atol=0.01 * theirs.max())


def test_the_adjoint_is_the_transpose(operator, xp, rng):
    raw_shape, shape = operator.shape
    volume, raw = xp.asarray(rng.random(shape)), xp.asarray(rng.random(raw_shape))
    left = float(xp.sum(operator.forward(volume) * raw))
    right = float(xp.sum(volume * operator.adjoint(raw)))
    assert left == pytest.approx(right, rel=1e-10)


def test_single_precision_stays_and_equals_double(operator, xp, rng):
    volume = rng.random(operator.shape[1])
    single = operator.forward(xp.asarray(volume.astype(np.float32)))
    assert single.dtype == xp.float32
    assert operator.adjoint(single).dtype == xp.float32
    np.testing.assert_allclose(to_numpy(single), operator.forward(volume), rtol=1e-4)


def test_it_is_what_a_deconvolution_asks_for(operator):
    assert isinstance(operator, Linear)
    assert operator.shape == ((40, 48), (3, 15, 18))
    index = (1, 7, 4)
    one = np.zeros(operator.shape[1], np.float32)
    one[index] = 1
    np.testing.assert_allclose(operator.psf(index), operator.forward(one), atol=1e-7)
    assert operator.psf(index).min() >= 0


def test_an_even_plane_of_one_makes_an_even_image_of_one(operator):
    for k in range(3):
        volume = np.zeros(operator.shape[1])
        volume[k] = 1
        cells = operator.forward(volume).reshape(5, 8, 6, 8).mean((1, 3))
        # The middle lenslets see all that reaches them; 1 % is dropped and scaled up.
        assert cells[2, 2:4] == pytest.approx(1.0, abs=0.02)


def test_moving_a_point_by_a_lenslet_moves_its_image_by_a_lenslet(operator):
    first, second = operator.psf((2, 7, 7)), operator.psf((2, 7, 10))
    np.testing.assert_allclose(second[:, 8:], first[:, :-8], atol=1e-6 * first.max())


def test_a_point_in_focus_lights_its_own_lenslet_and_grid_and_image_agree(operator):
    image = operator.psf((1, 7, 10))  # the middle point of cell (2, 3)
    cells = image.reshape(5, 8, 6, 8).sum((1, 3))
    assert np.unravel_index(cells.argmax(), cells.shape) == (2, 3)
    assert cells[2, 3] > 0.85 * cells.sum()
    grid = operator.object_grid
    assert grid.y[7] == pytest.approx(0.0, abs=1e-12)  # five rows of cells: the third is on the axis
    assert grid.x[10] == pytest.approx(0.5 * 125e-6 / 20)  # six columns straddle it


def test_a_defocused_point_lights_lenslets_on_the_side_of_its_rays():
    # Farther than the focus: light spreads after its image, and lenslets to the right see it from the left,
    # which their micro-images, inverted, show to the right; nearer points the other way round.
    operator = microscope_operator(
        [SCOPE], LENSLET, SampledLenslets((7, 7), SAMPLING), (-20e-6, 20e-6), accuracy=2e-2
    )
    at = np.arange(8) - 3.5
    for k, side in ((0, -1), (1, 1)):
        image = operator.psf((k, 10, 10)).reshape(7, 8, 7, 8)
        right = image[3, :, 5, :].sum(0)
        assert np.sign((right @ at) / right.sum()) == side


def test_two_wavelengths_are_averaged():
    other = Objective(600e-9, 0.5)
    both = slice_kernel([SCOPE, other], LENSLET, SAMPLING, 0.0)
    single = [slice_kernel([one], LENSLET, SAMPLING, 0.0) for one in (SCOPE, other)]
    middle = [
        k.matrix().reshape(-1, 9, 64)[list(map(tuple, k.offsets)).index((0, 0)), 4] for k in (both, *single)
    ]
    np.testing.assert_allclose(middle[0], (middle[1] + middle[2]) / 2, rtol=0.02, atol=0.01 * middle[0].max())


def test_what_a_narrow_lenslet_blocks_is_lost():
    narrow = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 100e-6)
    operator = microscope_operator([SCOPE], narrow, LAYOUT, (15e-6,), accuracy=1e-2)
    light = operator.forward(np.ones(operator.shape[1])).reshape(5, 8, 6, 8).mean((1, 3))[2, 2]
    assert light == pytest.approx(0.8**2, abs=0.03)


def test_pixels_on_the_samples_read_the_samples():
    calibration = lattice_calibration((40, 48), 8.0, origin=(3.5, 3.5))
    placed, cells, middle = placement(calibration, 8, 1)
    assert cells == (5, 6)
    assert middle == pytest.approx((19.5, 23.5))
    frame = 8 * FRAME
    plane = np.arange(56 * 64.0).reshape(56, 64)
    np.testing.assert_allclose(placed.forward(plane), plane[frame:-frame, frame:-frame], rtol=1e-6, atol=1e-9)


def test_turned_pixels_see_a_turned_picture(xp):
    # A smooth function of lattice coordinates, sampled by the cells, must be read at each pixel's own place.
    calibration = lattice_calibration((60, 64), 9.3, rotation=0.05)
    placed, cells, _ = placement(calibration, 16, 3)
    v, u = np.meshgrid(*(np.arange(-16 * FRAME, (n + FRAME) * 16) / 16 for n in cells), indexing="ij")
    place = calibration.lattice.index(np.arange(60.0)[:, None], np.arange(64.0)[None, :])
    first = (place[0].min(), place[1].min())
    inverse = np.linalg.inv(calibration.lattice.matrix)
    y, x = np.meshgrid(np.arange(60.0), np.arange(64.0), indexing="ij")
    exact = np.stack([y - 30.0, x - 31.0], -1) @ inverse.T - np.array(first) + 0.5 - 0.5 / 16
    smooth = lambda a, b: 2 + np.sin(2.1 * a) * np.cos(1.7 * b)  # noqa: E731
    # B-splines of samples average over two more of them: 1/3 of the second derivatives of 2.1² and 1.7².
    plane = xp.asarray(smooth(v, u))
    found = to_numpy(placed.forward(plane))[6:-6, 6:-6]
    np.testing.assert_allclose(found, smooth(exact[..., 0], exact[..., 1])[6:-6, 6:-6], atol=6e-3)
    assert placed.matrix.data.min() >= 0
    raw = xp.asarray(np.random.default_rng(1).random((60, 64)))
    left = float(xp.sum(placed.forward(plane) * raw))
    assert left == pytest.approx(float(xp.sum(plane * placed.adjoint(raw))), rel=1e-10)


def test_kernels_in_a_folder_are_mapped_and_found_again(tmp_path, operator, monkeypatch):
    stored = microscope_operator([SCOPE], LENSLET, LAYOUT, DEPTHS, accuracy=1e-2, folder=tmp_path)
    assert all(isinstance(kernel.blocks, np.memmap) for kernel in stored.kernels)
    monkeypatch.setattr(building, "slice_kernel", None)  # a second run computes nothing
    again = microscope_operator([SCOPE], LENSLET, LAYOUT, DEPTHS[::-1], accuracy=1e-2, folder=tmp_path)
    volume = np.random.default_rng(2).random(operator.shape[1], np.float32)
    np.testing.assert_array_equal(stored.forward(volume), operator.forward(volume))
    assert again.forward(volume[::-1]) == pytest.approx(operator.forward(volume), rel=1e-5)


def test_products_in_small_groups_give_the_same(operator, monkeypatch, rng):
    volume = rng.random(operator.shape[1])
    whole = operator.forward(volume)
    monkeypatch.setattr(module, "GATHERED", 9 * 30 * 7)
    np.testing.assert_allclose(operator.forward(volume), whole, rtol=1e-12)
    raw = rng.random(operator.shape[0])
    assert (operator.forward(volume) * raw).sum() == pytest.approx((volume * operator.adjoint(raw)).sum())


def test_progress_is_told_slice_by_slice():
    told = []
    microscope_operator([SCOPE], LENSLET, LAYOUT, (0.0, 1e-6), accuracy=1e-2, progress=told.append)
    assert told == [0.5, 1.0]


def test_what_cannot_be_is_refused(operator, monkeypatch):
    with pytest.raises(GeometryError, match="there are no depths"):
        microscope_operator([SCOPE], LENSLET, LAYOUT, ())
    with pytest.raises(GeometryError, match="depths must ascend or descend, and differ"):
        microscope_operator([SCOPE], LENSLET, LAYOUT, (0.0, 1e-6, 0.0))
    with pytest.raises(
        SamplingError, match=r"image of a point at 1e\+06 µm, which lights 184757 lenslets .* nearer"
    ):
        microscope_operator([SCOPE], LENSLET, LAYOUT, (1.0,))
    with pytest.raises(FormatError, match=r"folder /dev/null/x cannot be made"):
        microscope_operator([SCOPE], LENSLET, LAYOUT, (0.0,), folder="/dev/null/x")
    with pytest.raises(GeometryError, match=r"index is \(9, 9, 99\) but the object has shape \(3, 15, 18\)"):
        operator.psf((9, 9, 99))
    with pytest.raises(GeometryError, match="a depth is nan"):
        microscope_operator([SCOPE], LENSLET, LAYOUT, (float("nan"),))
    with pytest.raises(GeometryError, match=r"accuracy is 0\.7 but must be from 1e-5 to 0\.1"):
        microscope_operator([SCOPE], LENSLET, LAYOUT, (0.0,), accuracy=0.7)
    with pytest.raises(
        GeometryError, match=r"an object has shape \(2, 2\) but the operator takes \(3, 15, 18\)"
    ):
        operator.forward(np.ones((2, 2)))
    with pytest.raises(
        GeometryError, match=r"a raw image has shape \(4,\) but the operator takes \(40, 48\)"
    ):
        operator.adjoint(np.ones(4))
    many = SampledLenslets((5, 6), CellSampling(60, 8, 1 / 8))
    monkeypatch.setattr("lumigraph.core.memory.available", lambda: 4 * 10**8)
    with pytest.raises(SamplingError, match=r"images of points at 1 depths needs .* or folder= to keep them"):
        microscope_operator([SCOPE], LENSLET, many, (0.0,))


def test_what_is_left_out_is_the_same_in_every_direction(operator):
    # Mirrored and transposed points have mirrored and transposed images, to rounding.
    square = microscope_operator([SCOPE], LENSLET, SampledLenslets((7, 7), SAMPLING), (12e-6,), accuracy=0.03)
    image = square.psf((0, 14, 16))
    for mirrored, index in (
        (image[::-1], (6, 16)), (image[:, ::-1], (14, 4)), (image.T, (16, 14)), (image[::-1, ::-1].T, (4, 6)),
    ):  # fmt: skip
        np.testing.assert_allclose(square.psf((0, *index)), mirrored, atol=1e-5 * image.max())


def test_a_disk_without_room_is_refused_before_anything_is_computed(tmp_path, monkeypatch):
    import shutil
    from types import SimpleNamespace

    def full(_):
        return SimpleNamespace(total=10**9, used=10**9, free=1000)

    monkeypatch.setattr(shutil, "disk_usage", full)
    monkeypatch.setattr(building, "slice_kernel", None)
    with pytest.raises(
        SamplingError, match=r"images of points need up to .* KiB but the disk of .* has 0.977 KiB free"
    ):
        microscope_operator([SCOPE], LENSLET, LAYOUT, DEPTHS, folder=tmp_path / "new")


def test_straight_pixels_are_read_along_y_and_then_along_x():
    # Turned by 2e-8 rad they wind by 1e-6 px, too much for two matrices, and see the same to rounding.
    straight, turned = (
        placement(lattice_calibration((60, 64), 9.3, rotation=angle), 16, 3)[0] for angle in (0.0, 2e-8)
    )
    assert isinstance(straight, Resampling)
    assert isinstance(turned, Matrix)
    plane = np.random.default_rng(0).random(straight.shape[1])
    np.testing.assert_allclose(straight.forward(plane), turned.forward(plane), rtol=2e-6)
    raw = np.random.default_rng(1).random((60, 64))
    np.testing.assert_allclose(straight.adjoint(raw), turned.adjoint(raw), rtol=2e-6, atol=1e-6)
