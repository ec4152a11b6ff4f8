"""`simulate` against geometry, closed forms, and one way of computing against another."""

import math
from multiprocessing.pool import ThreadPool

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import cameras
from lumigraph.calibration import calibrate
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError, SamplingError
from lumigraph.instruments import PlenopticCamera, SingleLensCamera
from lumigraph.scene import Scene, Slice, sources, targets
from lumigraph.simulation import Coherent, Incoherent, Interrupted, Snapshots, TiltedWaves, simulate
from lumigraph.units import mm, nm, um


@pytest.fixture(scope="module")
def two_f():
    return SingleLensCamera(
        wavelength=633 * nm,
        object_distance=316 * mm,
        main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
        sensor={"pixel_pitch": 4 * um, "shape": (160, 200)},
    )


@pytest.fixture(scope="module")
def focused():
    return cameras.focused(count=(9, 9), pixel_pitch=5 * um, pitch=150 * um)


@pytest.fixture(scope="module")
def plenoptic():
    return PlenopticCamera(
        wavelength=633 * nm,
        object_distance=240 * mm,
        main_lens={"focal_length": 120 * mm},
        lenslets={"pitch": 150 * um, "focal_length": 10 * mm, "count": (7, 7)},
        sensor={"pixel_pitch": 7 * um},
    )


def even(grid: Grid) -> Scene:
    return Scene([Slice(np.ones(grid.shape), grid)])


def centroid(image: np.ndarray) -> np.ndarray:
    rows, columns = np.indices(image.shape)
    return np.array([(image * rows).sum(), (image * columns).sum()]) / image.sum()


def test_a_point_shows_upright_at_its_place_times_the_magnification(two_f):
    raw = simulate(two_f, targets.points([(60 * um, -140 * um)]))
    peak = np.unravel_index(raw.data.argmax(), raw.data.shape)
    assert peak == (80 + 15, 100 - 35)  # magnification 1, pixels of 4 um, the axis on pixel n // 2
    assert raw.data.dtype == np.float32
    assert raw.pixel_pitch == 4 * um


def test_the_first_dark_ring_of_the_two_f_system_is_at_48_8_um(two_f):
    """1.22 λz/D; the thesis printed 67 um."""
    fine = two_f.replace(sensor={"pixel_pitch": 1 * um, "shape": (11, 141)})
    row, x = simulate(fine, targets.points([(0, 0)])).data[5].astype(float), fine.sensor.grid.x
    between = np.linspace(40 * um, 58 * um, 1801)
    dark = between[CubicSpline(x, row)(between).argmin()]
    assert dark == pytest.approx(48.8 * um, abs=0.3 * um)


def test_one_sample_of_a_slice_is_a_point(two_f):
    """The Fresnel integral and the normalisation of slices against exact spherical waves."""
    point = simulate(two_f, targets.points([(60 * um, -140 * um)]), Snapshots(1))
    grid = Grid((1, 1), two_f.object_grid.pitch, (60 * um, -140 * um))
    sample = simulate(two_f, even(grid), Snapshots(1, rng=3))
    assert np.linalg.norm(sample.data - point.data) < 1e-3 * np.linalg.norm(point.data)


@pytest.mark.parametrize("depth", [-20 * mm, 0.0, 30 * mm])
def test_an_even_scene_of_intensity_one_has_mean_one_whatever_its_depth(two_f, depth):
    wide = Grid(tuple(2 * n for n in two_f.object_grid.shape), two_f.object_grid.pitch)
    raw = simulate(two_f, even(wide).at(depth), Snapshots(40, rng=1))
    assert raw.data[40:120, 50:150].mean() == pytest.approx(1, abs=0.06)  # speckle of 40 snapshots


@pytest.mark.parametrize("coherence", [Coherent(), TiltedWaves(80), TiltedWaves(20, na=0.004)])
def test_an_even_scene_of_intensity_one_has_mean_one_whatever_its_coherence(two_f, coherence):
    middle = simulate(two_f, even(two_f.object_grid), coherence).data[50:110, 60:140]
    assert middle.mean() == pytest.approx(1, abs=0.05)


def test_a_slice_of_finer_samples_gives_the_same_brightness(two_f):
    coarse = simulate(two_f, even(two_f.object_grid), Snapshots(40, rng=1)).data.mean()
    n, pitch = two_f.object_grid.shape, two_f.object_grid.pitch[0]
    fine = simulate(two_f, even(Grid((2 * n[0], 2 * n[1]), pitch / 2)), Snapshots(40, rng=1)).data.mean()
    assert fine == pytest.approx(coarse, rel=0.03)


def test_an_edge_is_a_quarter_under_coherent_and_a_half_under_incoherent_light(two_f):
    """0.255 and 0.503 of the bright side (Goodman, section 6.5.3)."""
    at_edge = []
    for coherence, pitch in ((Coherent(), 3 * um), (TiltedWaves(120), 15 * um)):
        grid = Grid((2 * round(420 * um / pitch),) * 2, pitch)
        bright = Scene([Slice(np.broadcast_to((grid.x >= 0) * 1.0, grid.shape), grid)])
        row = simulate(two_f, bright, coherence).data[60:100].mean(0)
        # The edge lies half a sample before the first bright one.
        at_edge.append(np.interp(-pitch / 2, two_f.sensor.grid.x, row) / row[140:165].mean())
    assert at_edge[0] == pytest.approx(0.255, abs=0.02)
    assert at_edge[1] == pytest.approx(0.503, abs=0.02)


def test_snapshots_approach_the_incoherent_image_as_one_over_the_root(two_f):
    """Every sample of a small object as a point is the exact image; a modulus added would stay 25 % off."""
    grid = Grid((9, 9), two_f.object_grid.pitch)
    picture = np.arange(81.0).reshape(9, 9) % 7
    places = [(y, x) for y in grid.y for x in grid.x]
    exact = simulate(two_f, targets.points(places, picture.ravel())).data
    errors = []
    for count in (16, 144):
        rough = simulate(two_f, Scene([Slice(picture, grid)]), Snapshots(count, rng=2)).data
        errors.append(np.linalg.norm(rough - exact) / np.linalg.norm(exact))
    assert errors[1] < 0.11
    assert errors[0] / errors[1] == pytest.approx(3, rel=0.3)


def test_the_thesis_mask_keeps_a_bias_that_white_phases_do_not_have(two_f):
    grid = two_f.object_grid
    exact = simulate(two_f, targets.siemens_star(grid), TiltedWaves(60)).data
    errors = []
    for index in (None, max(grid.shape) // 8):
        rough = simulate(two_f, targets.siemens_star(grid), Snapshots(40, index, rng=2)).data
        errors.append(np.linalg.norm(rough - exact) / np.linalg.norm(exact))
    assert errors[1] > 1.2 * errors[0]


def test_depths_and_parts_add_up(two_f):
    near, far = targets.points([(0, 0, -5 * mm)], [2.0]), targets.points([(50 * um, 0, 8 * mm)])
    both = simulate(two_f, near + far).data
    apart = simulate(two_f, near).data + simulate(two_f, far).data
    np.testing.assert_allclose(both, apart, rtol=1e-5, atol=1e-7)


def test_every_map_gives_the_same_raw_image(focused):
    scene = targets.siemens_star(focused.object_grid)
    serial = simulate(focused, scene, Snapshots(6, rng=7)).data
    with ThreadPool(2) as pool:
        parallel = simulate(focused, scene, Snapshots(6, rng=7), map=pool.imap).data
    np.testing.assert_array_equal(serial, parallel)
    again = simulate(focused, scene, Snapshots(6, rng=7)).data
    np.testing.assert_array_equal(serial, again)


@pytest.mark.parametrize("name", ["focused", "plenoptic"])
def test_the_lattice_is_recovered_from_the_simulated_white_image(name, request):
    """Within 0.02 px in pitch and 0.1 px in centres; a lattice of pitch p instead of p(1 + b/L) fails."""
    camera = request.getfixturevalue(name).replace(lenslets={"count": (15, 15)})
    found, true = calibrate(simulate(camera, targets.white())), camera.calibration
    assert found.lattice.pitch == pytest.approx(true.lattice.pitch, abs=0.02)
    near = true.lattice.position(np.stack(true.lattice.index(*found.centers.T), axis=-1))
    assert np.abs(found.centers - near).max() < 0.1
    assert np.abs(found.lattice.position(found.indices) - near).max() < 0.1


def test_the_white_image_is_what_an_even_wide_scene_gives(plenoptic):
    """The pupil's own points against random phases on a wide object; the speckle averages out over blocks."""
    white = simulate(plenoptic, targets.white()).data
    grid = plenoptic.object_grid
    wide = Grid(tuple(n * 2 for n in grid.shape), grid.pitch)
    scene = simulate(plenoptic, even(wide), Snapshots(60, rng=1)).data
    n = 6 * (white.shape[0] // 6)
    blocks = [image[:n, :n].reshape(n // 6, 6, n // 6, 6).mean((1, 3)) for image in (white, scene)]
    inner = (slice(4, -4), slice(4, -4))
    difference = np.linalg.norm(blocks[0][inner] - blocks[1][inner]) / np.linalg.norm(blocks[0][inner])
    assert difference < 0.1
    assert blocks[0][inner].sum() == pytest.approx(blocks[1][inner].sum(), rel=0.03)


def test_an_accuracy_asked_for_is_in_the_raw_images_error(focused):
    """Points and white image together: each part counts as much as its light."""
    scene = targets.points([(0, 0)]) + targets.white()
    known = simulate(focused, scene, Incoherent(accuracy=1e-2)).metadata["error"]
    assert 0 < known["rms"] < 1e-2
    assert "points at accuracy 0.01" in known["source"]
    assert "white image at accuracy 0.01" in known["source"]


def test_a_white_image_without_lenslets_is_even(two_f):
    white = simulate(two_f, targets.white(0.5)).data
    np.testing.assert_allclose(white, 0.5, rtol=1e-3)


def test_in_focus_a_point_of_a_1_0_camera_stays_in_its_lenslet(plenoptic):
    """0.904 of the energy that passes the main lens (thesis 4.6 corrected)."""
    wave = sources.point_source(plenoptic.pupil_grid, plenoptic.wavelength, plenoptic.object_distance)
    lens, to_lenslets = plenoptic.image_train().elements[:2]
    behind = lens(wave)
    arriving = to_lenslets(behind)
    own = [np.abs(c) < 75 * um for c in (arriving.grid.y, arriving.grid.x)]
    inside = arriving.intensity[np.ix_(*own)].sum() * math.prod(arriving.grid.pitch)
    assert inside / behind.power == pytest.approx(0.904, abs=0.01)


def test_a_point_in_the_raw_2_0_image_stands_where_geometry_puts_it(focused):
    """s = c(1 + m) - mX behind each lenslet that sees it, in upright coordinates."""
    y, x = 130 * um, -260 * um
    raw = simulate(focused, targets.points([(y, x)])).data.astype(float)
    scale, m = focused.image_distance / focused.object_distance, focused.lenslets.magnification
    image = np.array([y, x]) * scale
    for center in focused.lattice.centers((-0.5 * mm, 0.5 * mm), (-0.5 * mm, 0.5 * mm)):
        expected = center * (1 + m) - m * image
        if np.hypot(*(expected - center * (1 + focused.lenslet_distance / focused.separation))) > 45 * um:
            continue  # outside this lenslet's micro-image
        row, column = np.round(expected / focused.sensor.pixel_pitch).astype(int) + np.array(raw.shape) // 2
        spot = raw[row - 5 : row + 6, column - 5 : column + 6]
        found = np.array([row, column]) - np.array(raw.shape) // 2 + centroid(spot) - 5
        assert np.abs(found * focused.sensor.pixel_pitch - expected).max() < 4 * um


def test_progress_counts_every_propagation(two_f):
    calls = []
    scene = targets.points([(0, 0), (10 * um, 0)]) + targets.pinhole(two_f.object_grid, 50 * um)
    simulate(two_f, scene, Snapshots(2), progress=calls.append)
    assert calls == [1 / 3, 2 / 3, 1]


def test_an_interrupt_keeps_what_is_finished(two_f):
    def stop(fraction):
        if fraction == 2 / 3:
            raise KeyboardInterrupt

    first = targets.points([(0, 0)]) + targets.points([(10 * um, 0)])
    with pytest.raises(Interrupted) as caught:
        simulate(two_f, first + targets.points([(20 * um, 0)]), progress=stop)
    expected = simulate(two_f, first)
    np.testing.assert_allclose(caught.value.partial.data, expected.data)
    assert caught.value.partial.metadata["shots"] == 2


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (Scene([]), "scene is empty"),
        (targets.points([(0, 0, -0.4)]), "in front of the main lens"),
        (Scene([Slice(np.ones((4, 4, 3)), Grid.square(4, 1e-5))]), r"shape \(4, 4, 3\) but one wavelength"),
    ],
)
def test_impossible_scenes_are_refused(two_f, scene, message):
    with pytest.raises(GeometryError, match=message):
        simulate(two_f, scene)


def test_snapshots_of_incoherent_light_are_refused():
    with pytest.raises(LumigraphError, match=r"takes no snapshots and no rng: .* use Snapshots\(count"):
        Incoherent(snapshots=40, rng=1)
    with pytest.raises(SamplingError, match=r"accuracy is 40 but must lie between 1e-05 and 0\.01"):
        Incoherent(40)


def test_impossible_coherences_are_refused(two_f):
    with pytest.raises(GeometryError, match="coherence is of type int but must be Incoherent"):
        simulate(two_f, targets.white(), coherence=5)
    with pytest.raises(GeometryError, match="camera is of type int"):
        simulate(5, targets.white())
    with pytest.raises(LumigraphError, match="count is 0"):
        Snapshots(0)
    with pytest.raises(LumigraphError, match="coherence_index is 0"):
        Snapshots(3, coherence_index=0)
    with pytest.raises(LumigraphError, match="na is 2"):
        TiltedWaves(3, na=2)
    with pytest.raises(SamplingError, match="resolves directions up to"):
        simulate(two_f, even(two_f.object_grid), TiltedWaves(3, na=0.5))


def test_a_simulation_that_cannot_fit_in_memory_is_refused_before_it_starts(two_f, monkeypatch):
    from lumigraph.core import memory

    monkeypatch.setattr(memory, "available", lambda: 1000)
    with pytest.raises(SamplingError, match="the simulation needs"):
        simulate(two_f, targets.points([(0, 0)]))
