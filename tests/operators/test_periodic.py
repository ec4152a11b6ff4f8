"""The lenslet-periodic operator against sums of full propagations, and its own symmetries."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import j1

import cameras
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError, SamplingWarning
from lumigraph.instruments import FocusedPlenopticCamera, PlenopticCamera
from lumigraph.operators import periodic_operator
from lumigraph.operators.lenslets.cell_images import SquareLensletImages
from lumigraph.operators.lenslets.wave_image import WaveImage
from lumigraph.operators.periodic import kernels, white
from lumigraph.operators.periodic.sizes import stream_operations
from lumigraph.operators.periodic.streamed import stream_bytes, streamed
from lumigraph.operators.periodic.white import endless, white_image
from lumigraph.operators.sampling import band, cells
from lumigraph.operators.sampling.optics import Optics
from lumigraph.scene import targets
from lumigraph.simulation import Snapshots, simulate
from lumigraph.units import mm, nm, um

focused, plenoptic = partial(cameras.focused, count=(9, 9)), cameras.plenoptic
CAMERAS = {
    "2.0": focused(),
    "2.0, even count, moved": focused(count=(10, 8), offset=(20 * um, -30 * um)),
    "2.0, round lenslets": focused(shape="round", fill_factor=0.9),
    "2.0, Galilean": focused(magnification=-0.4, focal_length=8 * mm),
    "2.0, hexagonal": focused(layout="hex", count=(6, 5)),
    "2.0, turned": focused(rotation=0.1, count=(7, 7)),
    "2.0, turned behind an aberrated lens": focused(rotation=0.6, count=(5, 5)).replace(
        main_lens={"focal_length": 60 * mm, "aberrations": {6: 0.15, 8: 0.1}}
    ),
    "2.0, three kinds": focused(
        layout="hex", count=(6, 6), focal_length=(5.2 * mm, 5.0 * mm, 5.4 * mm), shape="round", rotation=-0.02
    ),
    "1.0": plenoptic(),
}
PATCH = np.array([[1.0, 0, 3, 0], [0, 2, 0, 0], [4, 0, 0, 1], [0, 0, 2, 5]])


def relative(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)


@pytest.mark.parametrize(
    ("name", "dz"),
    [(name, dz) for name in CAMERAS for dz in (0.0, 3 * mm) if dz or name in ("2.0", "1.0")],
)
def test_an_object_is_the_sum_of_its_points(name, dz, monkeypatch):
    """Against exact spherical waves through the whole train, sampled twice as finely as usual.

    A point in the wrong class, an image turned or moved by a pixel (6 um of a lobe of 80 um) gives more
    than 10 %; what remains is the window's 1 % of the light and the sampling.
    """
    from lumigraph.instruments import grids

    monkeypatch.setattr(grids, "MARGIN", 4.0)
    camera = CAMERAS[name].replace()
    grid = Grid((4, 4), (31 * um, 27 * um), (70 * um, -110 * um))
    points = [(y, x, dz) for y in grid.y for x in grid.x]
    share = np.prod(grid.pitch) / np.prod(camera.object_grid.pitch)
    reference = simulate(camera, targets.points(points, PATCH.ravel()), Snapshots(1)).data * share
    image = periodic_operator(camera, grid, dz, accuracy=1e-2).forward(PATCH)
    assert relative(image, reference) < 0.03
    assert image.sum() == pytest.approx(reference.sum(), rel=0.02)


def test_the_operator_is_what_incoherent_light_uses():
    camera = CAMERAS["2.0"]
    star = targets.siemens_star(camera.object_grid)
    raw = simulate(camera, star + star.at(4 * mm)).data
    parts = [
        periodic_operator(camera, part.grid, part.dz).forward(part.intensity)
        for part in (scene.parts[0].trimmed() for scene in (star, star.at(4 * mm)))
    ]
    np.testing.assert_allclose(raw, np.maximum(sum(parts), 0), atol=2e-5)


def test_it_is_where_many_snapshots_go():
    camera = CAMERAS["2.0"]
    star = targets.siemens_star(camera.object_grid, 8)
    exact = simulate(camera, star).data
    errors = [relative(simulate(camera, star, Snapshots(n, rng=1)).data, exact) for n in (20, 180)]
    assert errors[1] < 0.12
    assert errors[0] / errors[1] == pytest.approx(3, rel=0.25)


@pytest.mark.parametrize("name", ["2.0", "1.0", pytest.param("2.0, hexagonal", marks=pytest.mark.long)])
def test_an_even_scene_of_intensity_one_has_the_mean_of_the_magnification(name):
    """1 on the lenslets, and (1 + b/L)² times the area on the sensor; away from the array's border."""
    camera = CAMERAS[name]
    n = camera.object_grid.shape
    grid = Grid((2 * n[0], 2 * n[1]), camera.object_grid.pitch)
    image = periodic_operator(camera, grid).forward(np.ones(grid.shape, np.float32))
    pitch = camera.calibration.lattice.pitch
    hexagonal = camera.lenslets.layout == "hex"  # a small array: one period of it
    across, along = (
        round(pitch * (3**0.5 if hexagonal else 3) / 2),
        round(pitch * (1 if hexagonal else 3) / 2),
    )
    middle = [k // 2 for k in image.shape]
    cells = image[middle[0] - across : middle[0] + across, middle[1] - along : middle[1] + along]
    expected = (1 + camera.lenslet_distance / camera.separation) ** -2
    assert cells.mean() == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    "name",
    ["2.0", pytest.param("2.0, round lenslets", marks=pytest.mark.long)],  # 4 s: matrices at 1e-3
)
def test_a_wide_even_slice_has_the_light_of_the_white_image(name):
    """Out of focus, in the middle, where the white image is exact; beyond 60 lenslets there are 1.7e-3 more.

    Of the light 8e-3 comes from beside the array, and 1e-2 goes far aside between discs.
    """
    camera, lost = CAMERAS[name], 5.66 * 0.0323 * 0.558 / 60
    scale = (camera.object_distance + 3 * mm) / camera.separation
    n = round(2 * 60 * 100 * um * scale / (20 * um))
    grid = Grid((n, n), 20 * um)
    image = periodic_operator(camera, grid, 3 * mm).forward(np.ones((n, n), np.float32))
    white = white_image(camera, 1e-3)
    middle = tuple(slice(k // 3, -k // 3) for k in image.shape)
    assert image[middle].sum() / white[middle].sum() == pytest.approx(1 - lost, abs=1e-3)
    assert relative(image[middle] / (1 - lost), white[middle]) < 1.5e-3


def test_endless_light_is_followed_no_farther_than_memory_reaches(monkeypatch):
    """At 1e-4, opaque rims asked for the image of one lenslet on 117 GiB."""
    camera = focused(count=(5, 5), fill_factor=0.9, shape="round")
    optics = Optics.of(camera, camera.object_distance, 1e-3).bricks
    sizes = []
    _one = WaveImage._one
    monkeypatch.setattr(white, "LARGEST", 1e5)
    monkeypatch.setattr(WaveImage, "_one", lambda wave, f: sizes.append(_one(wave, f).size) or _one(wave, f))
    endless(optics)
    assert 5e4 < max(sizes) < 1e5


def test_pictures_of_endless_light_are_in_the_order_of_the_kinds():
    """Other focal lengths on the same lattice: each picture goes where its kind has gone."""
    camera, focal = CAMERAS["2.0, three kinds"], (5.2 * mm, 5.0 * mm, 5.4 * mm)
    optics = Optics.of(camera, camera.object_distance, 1e-2).bricks
    arrays = (replace(optics.array, focal_length=f) for f in (focal, (*focal[1:], focal[0])))
    found, moved = (endless(replace(optics, array=array))[0] for array in arrays)
    assert relative(found[1], found[2]) > 0.02
    np.testing.assert_allclose(moved, np.roll(found, -1, 0), rtol=1e-4)


def test_moving_the_object_by_one_lenslet_moves_the_image_by_one_micro_image():
    camera = focused(count=(11, 11)).replace(sensor={"pixel_pitch": 100 * um * (1 + 7.8 / 135.6) / 17})
    grid = Grid((4, 4), (31 * um, 27 * um), (40 * um, 10 * um))
    step = camera.lenslets.pitch * camera.object_distance / camera.separation
    moved = Grid(grid.shape, grid.pitch, (grid.center[0], grid.center[1] + step))
    here, there = (periodic_operator(camera, g).forward(PATCH) for g in (grid, moved))
    assert relative(here[:, 17:-34], there[:, 34:-17]) < 5e-4  # the border is elsewhere


def test_the_adjoint_is_the_transpose(xp, rng):
    camera = CAMERAS["2.0"]
    operator = periodic_operator(camera, Grid((21, 17), 14 * um))
    x = rng.random(operator.object_grid.shape).astype(np.float32)
    y = rng.random(camera.sensor.shape).astype(np.float32)
    forward, adjoint = operator.forward(xp.asarray(x)), operator.adjoint(xp.asarray(y))
    assert str(forward.dtype).endswith("float32")
    assert operator.shape == (tuple(forward.shape), tuple(adjoint.shape))
    left = (to_numpy(forward).astype(float) * y).sum()
    assert left == pytest.approx((x * to_numpy(adjoint).astype(float)).sum(), rel=1e-6)


def test_the_kernel_interpolates_what_the_main_lens_passes():
    """A cosine at the lens' cut-off, sampled at the points, comes back between them to 1e-5."""
    points = np.arange(-40, 41)
    for frequency in (0.1, 0.5 / cells.OVERSAMPLING):
        for place in (0.0, 0.3, 0.5):
            weights = band.kernel(place - points, cells.HALF_WIDTH)
            value = (weights * np.cos(2 * np.pi * frequency * points)).sum()
            assert value == pytest.approx(np.cos(2 * np.pi * frequency * place), abs=2e-5)


def airy_through_square_lenslets(camera, point, nodes=128, fine=8):
    """Image of an object point in focus: the Airy amplitude over Gauss-Legendre nodes of every lenslet."""
    pitch, b, L = camera.lenslets.pitch, camera.lenslet_distance, camera.separation
    unit, weight = np.polynomial.legendre.leggauss(nodes)
    n = camera.lenslets.count[0]
    centers = (np.arange(n) - n // 2) * pitch
    at = (centers[:, None] + pitch / 2 * unit).ravel()
    lens = np.tile(weight * np.exp(-1j * np.pi * (pitch / 2 * unit) ** 2 / (camera.wavelength * b)), n)
    step = camera.sensor.pixel_pitch / fine
    sensor = (np.arange(camera.sensor.shape[0] * fine) + 0.5) * step
    sensor = sensor - sensor.mean()
    way = np.exp(1j * np.pi * (sensor[:, None] - at) ** 2 / (camera.wavelength * b)) * lens
    way = way * np.exp(1j * np.pi * at**2 / (camera.wavelength * L))
    y, x = (at + c * L / camera.object_distance for c in point)
    turns = np.pi * camera.pupil_diameter / (camera.wavelength * L) * np.hypot(y[:, None], x)
    intensity = np.abs(way @ (2 * j1(turns) / turns) @ way.T) ** 2
    pixels = camera.sensor.shape[0]
    return intensity.reshape(pixels, fine, pixels, fine).mean((1, 3))[::-1, ::-1]


def test_a_sharp_point_on_the_edge_between_fast_lenslets_lights_those_around():
    """f/2 lenslets of 8 um: the edge spreads the point over micro-images; 3 % of it would be missed."""
    camera = PlenopticCamera(
        wavelength=550 * nm,
        object_distance=240 * mm,
        main_lens={"focal_length": 30 * mm},
        lenslets={"pitch": 8 * um, "focal_length": 16 * um, "count": (5, 5)},
        sensor={"pixel_pitch": 0.8 * um},
    )
    step = camera.lenslets.pitch * camera.object_distance / camera.separation
    point = (0.45 * step, 0.5 * step)
    expected = airy_through_square_lenslets(camera, point)
    image = periodic_operator(camera, Grid((1, 1), 1 * um, point), accuracy=1e-2).forward(np.ones((1, 1)))
    assert relative(image * (expected.sum() / image.sum()), expected) < 5e-3


@pytest.mark.parametrize("name", ["2.0, even count, moved", "1.0"])
def test_what_is_too_large_to_hold_is_streamed_and_gives_the_same(name, monkeypatch, rng):
    """All blocks, borders and corners among them; the factors leave out a sixth of 1e-2."""
    camera = CAMERAS[name].replace(lenslets={"count": (6, 7)})
    held = periodic_operator(camera, camera.object_grid, 1.1 * mm, accuracy=1e-2)
    seen: list[float] = []
    monkeypatch.setattr(kernels, "HELD", 0.0)
    monkeypatch.setattr(kernels, "_MATRICES", type(kernels._MATRICES)())
    through = periodic_operator(camera, camera.object_grid, 1.1 * mm, accuracy=1e-2, progress=seen.append)
    x, y = (rng.random(shape).astype(np.float32) for shape in reversed(held.shape))
    seen.clear()
    image = through.forward(x)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1)
    assert relative(held.forward(x), image) < 3e-3
    assert relative(held.adjoint(y), through.adjoint(y)) < 3e-3
    left = (image.astype(float) * y).sum()
    assert left == pytest.approx((x * through.adjoint(y).astype(float)).sum(), rel=1e-6)


def test_what_takes_too_long_to_build_is_refused_at_once(monkeypatch):
    from lumigraph.core import memory

    monkeypatch.setattr(memory, "available", lambda: 2**40)
    camera = FocusedPlenopticCamera.from_catalogue("multi-focus-hex")
    refusal = r"2e\+15 operations to build, .* An accuracy of 0\.0001 fits \(\S+ GiB, some \S+ min"
    with pytest.raises(SamplingError, match=refusal):
        periodic_operator(camera, Grid((4, 4), 30 * um), accuracy=1e-5)


def photographic():
    """1.0, f/5.5: main lens and lenslets resolve a hundredth of a lenslet, and blocks are large."""
    return PlenopticCamera(
        wavelength=550 * nm, object_distance=500 * mm,
        main_lens={"focal_length": 50 * mm, "diameter": 10 * mm},
        lenslets={"pitch": 100 * um, "focal_length": 0.55 * mm, "count": (5, 5)},
        sensor={"pixel_pitch": 5 * um},
    )  # fmt: skip


def test_images_that_take_too_long_are_refused_and_those_of_minutes_are_said_beforehand(monkeypatch):
    from lumigraph.core import memory

    monkeypatch.setattr(memory, "available", lambda: 2**40)
    monkeypatch.setattr(kernels, "streamed", lambda *_: "begun")
    refusal = r"2e\+15 operations for each image, .* An accuracy of 0\.001 fits .* 20 min .* for each image"
    camera, grid = photographic(), Grid((4, 4), 30 * um)
    with pytest.raises(SamplingError, match=refusal):
        periodic_operator(camera, grid, accuracy=1e-4)
    optics = Optics.of(camera, camera.object_distance, 1e-3).bricks
    with pytest.warns(SamplingWarning, match=r"each image .* takes some 20 min of a processor"):
        assert kernels.matrix(optics) == "begun"


@pytest.mark.parametrize("aberrations", [{}, {7: 0.05, 8: 0.1}], ids=["round", "coma"])
def test_operations_are_counted_truly(aberrations, monkeypatch):
    """Blocks that are computed for an image, and points of light that each is a product with."""
    camera = CAMERAS["1.0"].replace(lenslets={"count": (6, 6)}, main_lens={"aberrations": aberrations})
    optics, done = Optics.of(camera, camera.object_distance, 1e-2).bricks, []
    plain = SquareLensletImages._block

    def counted(self, dy, dx):
        done.append(8.0 * self.down.size * math.prod(optics.cells.points) * optics.cells.samples[1])
        return plain(self, dy, dx)

    monkeypatch.setattr(SquareLensletImages, "_block", counted)
    sum(1 for _ in streamed(optics).parts)
    offsets = [2 * n + 1 for n in optics.reach]
    applied = 2.0 * math.prod((*optics.cells.points, *optics.cells.samples, 36, *offsets))
    assert stream_operations(optics) - applied == pytest.approx(sum(done), rel=0.1)


def test_an_operator_that_cannot_fit_is_refused(monkeypatch):
    from lumigraph.core import memory

    camera, grid = CAMERAS["2.0"], Grid((4, 4), 30 * um)
    monkeypatch.setattr(memory, "available", lambda: 1000)
    with pytest.raises(SamplingError, match=r"the periodic operator needs .* Use slower lenslets"):
        periodic_operator(camera, grid, 1.234 * mm)
    optics = [Optics.of(camera, camera.object_distance + 1.234 * mm, accuracy) for accuracy in (1e-4, 1e-5)]
    between = np.mean([stream_bytes(o) for o in optics])
    monkeypatch.setattr(memory, "available", lambda: between)
    with pytest.raises(SamplingError, match=r"An accuracy of 0\.001 fits \(\S+ GiB\): ask for that"):
        periodic_operator(camera, grid, 1.234 * mm, accuracy=1e-5)
