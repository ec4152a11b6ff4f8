"""The exact incoherent image of a single lens: against sums over points, closed forms, its own adjoint."""

import math

import numpy as np
import pytest
from benchmarks import references
from scipy.special import j1

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.elements import CircularAperture, ZernikePlate
from lumigraph.errors import SamplingError, SamplingWarning
from lumigraph.instruments import FocusedPlenopticCamera, SingleLensCamera
from lumigraph.operators import single_lens, single_lens_operator
from lumigraph.operators.sampling import band
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import Snapshots, simulate
from lumigraph.units import mm, nm, um

TWO_F = SingleLensCamera(
    wavelength=633 * nm,
    object_distance=316 * mm,
    main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
    sensor={"pixel_pitch": 6 * um, "shape": (41, 50)},
)
CAMERAS = {
    "2f": TWO_F,
    "pixels wider than a spot": TWO_F.replace(sensor={"pixel_pitch": 31 * um, "shape": (11, 8)}),
    "aberrated": TWO_F.replace(main_lens={"aberrations": {7: 0.15, 6: 0.1, 11: 0.1}}),
    "f/8, four times smaller": TWO_F.replace(
        object_distance=500 * mm, main_lens={"focal_length": 100 * mm, "diameter": 12 * mm},
        sensor={"pixel_pitch": 2 * um, "shape": (40, 31)},
    ),
}  # fmt: skip
PICTURE = np.random.default_rng(1).random((3, 2))


def relative(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)


def pupil(camera, samples):
    """Grid across the stop and the pupil's amplitude, without the lens' phase."""
    grid = Grid.square(samples + 2, camera.pupil_diameter / samples)
    inside = CircularAperture(camera.pupil_diameter).transmission(grid, camera.wavelength).astype(complex)
    if waves := camera.main_lens.aberrations:
        plate = ZernikePlate({j: 2 * math.pi * rms for j, rms in waves.items()}, camera.pupil_diameter)
        inside = plate(Field(np.ones(grid.shape, complex), grid, camera.wavelength)).data
    return grid, inside


def sum_of_points(camera, grid, picture, dz, samples=420, places=5):
    """Every object point's Fresnel field, by plain sums over the pupil, at Gauss points of every pixel."""
    node, weight = np.polynomial.legendre.leggauss(places)
    d, L, wavelength = camera.object_distance + dz, camera.separation, camera.wavelength
    lens, amplitude = pupil(camera, samples)
    at = [
        (-c[:, None] + node * camera.sensor.pixel_pitch / 2).ravel()
        for c in (camera.sensor.grid.y, camera.sensor.grid.x)
    ]
    bend = 1 / d + 1 / L - 1 / camera.main_lens.focal_length
    total = np.zeros(camera.sensor.shape)
    for i, y in enumerate(grid.y):
        for j, x in enumerate(grid.x):
            sides = []
            for u, s, centre in zip((lens.y, lens.x), at, (y, x), strict=True):
                phase = u**2 * bend / 2 - np.outer(s, u) / L - u * centre / d
                sides.append(np.exp(2j * np.pi / wavelength * phase))
            field = sides[0] @ amplitude @ sides[1].T * lens.pitch[0] ** 2 / (wavelength * L * d)
            ny, nx = camera.sensor.shape
            fine = (np.abs(field) ** 2).reshape(ny, places, nx, places)
            total += picture[i, j] * np.einsum("aibj,i,j->ab", fine, weight / 2, weight / 2)
    return total * math.prod(grid.pitch) * L**2 / (math.pi * camera.pupil_diameter**2 / 4)


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("dz", [0.0, 9 * mm])
def test_the_image_is_the_sum_over_all_object_points(name, dz):
    """To 1e-4, which is the sum's own: 420 samples with grey edges across the pupil. A bare sinc has 1e-2."""
    camera = CAMERAS[name]
    grid = Grid((3, 2), (43 * um, 57 * um), (30 * um, -50 * um))
    image = simulate(camera, Scene([Slice(PICTURE, grid, dz)])).data
    assert relative(image, sum_of_points(camera, grid, PICTURE, dz)) < 2e-4


def out_of_focus(camera, blur):
    """Depth of a plane whose points have images of a radius [λL/D]."""
    spots = blur * camera.wavelength / camera.pupil_diameter**2
    return 1 / (1 / camera.object_distance - 2 * spots) - camera.object_distance


@pytest.mark.parametrize("blur", [0.5, 3.0, 10.0])
def test_blurred_images_are_off_by_what_they_state(blur):
    """Within a factor 2. A pupil of 512 samples is off by 5e-4 at ten λL/D; 1.3e-5 was stated of any."""
    dz, grid = out_of_focus(TWO_F, blur), Grid((1, 1), 1 * um, (30 * um, -50 * um))
    raw = simulate(TWO_F, Scene([Slice(np.ones((1, 1)), grid, dz)]))
    point = targets.points([(30 * um, -50 * um, dz)])
    share = 1e-12 * (TWO_F.separation / (TWO_F.object_distance + dz)) ** 2
    truth = references.focused(TWO_F, dz, [(30 * um, -50 * um)])[0] * share
    off, stated = relative(raw.data, truth), raw.metadata["error"]["rms"]
    assert stated / 2 < off < 2 * stated
    assert stated < 7e-5
    # A point counts as one sample of the camera's own object grid.
    raw = simulate(TWO_F, point)
    off = relative(raw.data, truth / 1e-12 * math.prod(TWO_F.object_grid.pitch))
    assert off < 2 * raw.metadata["error"]["rms"]


def test_planes_far_out_of_focus_warn_where_they_are_less_exact_than_asked():
    with pytest.warns(SamplingWarning, match=r"accuracy of 0\.0001 .* off by some 0\.000[1-9]"):
        TWO_F.operator(depths=(0.0, out_of_focus(TWO_F, 35.0)), accuracy=1e-4)


def test_it_agrees_with_full_propagations_of_points():
    """Exact spherical waves and the angular spectrum; the sensor is wide, so that little light leaves it."""
    camera = TWO_F.replace(sensor={"shape": (160, 160)})
    grid = Grid((3, 2), (43 * um, 57 * um), (30 * um, -50 * um))
    exact = simulate(camera, Scene([Slice(PICTURE, grid)])).data
    places = [(y, x) for y in grid.y for x in grid.x]
    share = math.prod(grid.pitch) / math.prod(camera.object_grid.pitch)
    full = simulate(camera, targets.points(places, PICTURE.ravel()), Snapshots(1)).data * share
    assert relative(exact, full) < 1e-3


def test_points_anywhere_are_samples_of_a_plane_through_them():
    grid = Grid((3, 2), (43 * um, 57 * um), (30 * um, -50 * um))
    share = math.prod(grid.pitch) / math.prod(TWO_F.object_grid.pitch)
    two = []
    for dz in (0.0, 9 * mm):
        points = targets.points([(y, x, dz) for y in grid.y for x in grid.x], PICTURE.ravel())
        plane = simulate(TWO_F, Scene([Slice(PICTURE, grid, dz)])).data
        assert relative(simulate(TWO_F, points).data * share, plane) < 1e-6
        two.append((points, plane))
    both = simulate(TWO_F, two[0][0] + two[1][0]).data * share
    assert relative(both, two[0][1] + two[1][1]) < 1e-6


def test_a_point_is_the_airy_pattern():
    """(2 J1(v)/v)², normalised to the light of one object sample, at pixels far smaller than it."""
    fine = TWO_F.replace(sensor={"pixel_pitch": 0.5 * um, "shape": (1, 301)})
    row = simulate(fine, targets.points([(0, 0)])).data[0]
    v = np.pi * fine.sensor.grid.x * fine.pupil_diameter / (fine.wavelength * fine.separation)
    v = np.where(v == 0, 1e-9, v)
    peak = math.pi * fine.pupil_diameter**2 / 4 * math.prod(fine.object_grid.pitch)
    peak /= (fine.wavelength * fine.object_distance) ** 2
    assert np.abs(row - peak * (2 * j1(v) / v) ** 2).max() < 2e-4 * peak


def test_the_transfer_is_the_overlap_of_two_discs():
    """Goodman's equation 6-31; beyond D/(λL) there is nothing."""
    camera = TWO_F.replace(sensor={"shape": (240, 240)})
    _, operator, _ = single_lens_operator(camera, Grid.square(121, 10 * um)).maps
    transfer = np.abs(operator.transfer[0]) / np.abs(operator.transfer[0, 0])
    pitch = single_lens.image_pitch(camera)
    cutoff = camera.pupil_diameter / (camera.wavelength * camera.separation)
    f = np.arange(len(transfer)) / (operator.window[1] * pitch) / cutoff
    inside = np.minimum(f, 1)
    overlap = 2 / np.pi * (np.arccos(inside) - inside * np.sqrt(1 - inside**2))
    assert np.abs(transfer - overlap)[f > 0.1].max() < 5e-3  # the window ends where a point still has 1 %
    assert transfer[f > 1.1].max() < 1e-3


def test_a_wide_even_scene_has_mean_one():
    """A point has 2/π² (λL/D)/r of its light outside of r, 0.00182 outside of a square of 8 mm."""
    wide = Grid.square(1600, 5 * um)
    assert simulate(TWO_F, Scene([Slice(np.ones(wide.shape), wide)])).data == pytest.approx(0.99818, abs=1e-4)


def test_an_even_scene_gives_one_and_nothing_wraps_round():
    """A bright strip beyond the sensor adds only its own faint light, none of it from the other side."""
    n, pitch = 256, 5 * um
    wide = Grid.square(2 * n, pitch)
    image = simulate(TWO_F, Scene([Slice(np.ones(wide.shape), wide)])).data
    assert image == pytest.approx(1, abs=0.02)  # a point has 1 % of its light farther than 0.9 mm
    strip = Grid((n, 1), (pitch, pitch), (0.0, 0.4 * mm))
    row = simulate(TWO_F, Scene([Slice(np.ones(strip.shape), strip)])).data.mean(0)
    assert row[-8:].mean() > 3 * row[:8].mean()  # nearest pixels are brightest, the farthest darkest


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_adjoint_is_the_transpose(dtype, xp):
    grid = Grid((9, 7), (31 * um, 43 * um), (20 * um, 0))
    operator = single_lens_operator(TWO_F, grid, 5 * mm)
    assert isinstance(operator, Linear)
    rng = np.random.default_rng(2)
    o, r = (rng.random(shape).astype(dtype) for shape in reversed(operator.shape))
    image, back = operator.forward(xp.asarray(o)), operator.adjoint(xp.asarray(r))
    assert str(image.dtype).endswith(np.dtype(dtype).name)
    ahead = (to_numpy(image).astype(np.float64) * r).sum()
    behind = (to_numpy(back).astype(np.float64) * o).sum()
    assert ahead == pytest.approx(behind, rel=2e-6)
    np.testing.assert_allclose(to_numpy(image), operator.forward(o), rtol=1e-4, atol=1e-6)


def test_psf_is_the_image_of_one_sample():
    operator = single_lens_operator(TWO_F, Grid((9, 7), 31 * um))
    one = np.zeros((9, 7))
    one[2, 5] = 1
    np.testing.assert_allclose(operator.psf((2, 5)), operator.forward(one), atol=1e-6)


def test_light_that_is_not_followed_is_put_back(monkeypatch):
    """A coarse pupil follows it to 2 mm of the 2.7 mm asked for; an even scene stays as bright."""
    monkeypatch.setattr(single_lens, "COARSEST_PUPIL", 24)
    monkeypatch.setattr(single_lens, "FINEST_PUPIL", 24)
    single_lens._TRANSFERS.clear()
    wide = Grid.square(1024, 5 * um)
    image = simulate(TWO_F, Scene([Slice(np.ones(wide.shape), wide)])).data
    single_lens._TRANSFERS.clear()
    assert image == pytest.approx(1, abs=1e-3)


def test_the_kernel_brings_a_band_limited_wave_anywhere():
    """A cosine at the band's edge, from random places: 1e-5, where a bare sinc of that length has 3e-2."""
    rng = np.random.default_rng(3)
    span = band.Span.around(-40.0, 40.0, 1.0)
    places, k = rng.uniform(-38, 38, 50), span.first + np.arange(span.count)
    edge = 1 / (2 * band.OVERSAMPLING)
    brought = band.placed(places, span).T @ np.cos(2 * np.pi * edge * k)
    assert np.abs(brought - np.cos(2 * np.pi * edge * places)).max() < 3e-5


def test_what_it_does_not_take_is_refused(monkeypatch):
    camera = FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    with pytest.raises(SamplingError, match="the camera has lenslets: use periodic_operator"):
        single_lens_operator(camera, Grid.square(4, 1 * um))
    from lumigraph.core import memory

    monkeypatch.setattr(memory, "available", lambda: 1000)
    with pytest.raises(SamplingError, match=r"the image's \d+ x \d+ samples needs"):
        single_lens_operator(TWO_F, Grid.square(4, 1 * um))
