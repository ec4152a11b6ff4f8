"""Tilted waves that follow the light, and the error that snapshots and tilted waves estimate."""

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.instruments import SingleLensCamera
from lumigraph.scene import Scene, Slice, targets
from lumigraph.simulation import Coherent, Incoherent, Snapshots, TiltedWaves, directions, simulate
from lumigraph.units import mm, nm, um

CAMERA = SingleLensCamera(
    wavelength=633 * nm,
    object_distance=316 * mm,
    main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
    sensor={"pixel_pitch": 12 * um, "shape": (110, 120)},
)


def chart():
    """Bars of 8 to 2 samples, clear of the border."""
    picture = np.zeros(CAMERA.object_grid.shape, np.float32)
    row = 12
    for width in (8, 5, 3, 2):
        for k in range(3):
            picture[row : row + 3 * width, 12 + 2 * k * width : 12 + (2 * k + 1) * width] = 1
            picture[row + 2 * k * width // 2 : row + 2 * k * width // 2 + width // 2 + 1, 60:90] = 1
        row += 3 * width + 4
    return Scene([Slice(picture, CAMERA.object_grid)])


@pytest.fixture(scope="module")
def exact():
    return simulate(CAMERA, chart()).data


def error(image, exact):
    return np.linalg.norm(image - exact) / np.linalg.norm(exact)


@pytest.mark.parametrize(
    ("count", "limit"), [(30, 0.05), (75, 0.03), pytest.param(260, 0.011, marks=pytest.mark.long)]
)
def test_few_waves_reach_what_random_phases_need_many_for(exact, count, limit):
    """5, 3 and 1 % rms (260 waves: 1.04 %); even directions, or random ones, miss all three."""
    raw = simulate(CAMERA, chart(), TiltedWaves(count))
    assert error(raw.data, exact) < limit
    assert (
        0.75 < raw.metadata["estimated_error"] / error(raw.data, exact) < 1.35
    )  # every other wave: 1.5 to 3


def test_snapshots_estimate_their_error(exact):
    """Blocks that share snapshots, or a spread not divided by a root, are 1.4 times off or more."""
    for count, seed in ((20, 3), (45, 3), (12, 4), (12, 5)):
        raw = simulate(CAMERA, chart(), Snapshots(count, rng=seed))
        assert raw.metadata["estimated_error"] == pytest.approx(error(raw.data, exact), rel=0.15)


def test_a_dark_slice_has_no_error():
    dark = Scene([Slice(np.zeros((4, 4)), Grid((4, 4), 20 * um))])
    for light in (Snapshots(3, rng=0), TiltedWaves(3)):
        assert simulate(CAMERA, dark, light).metadata["error"]["rms"] == 0


def test_what_is_exact_estimates_no_error():
    for light in (Incoherent(), Coherent(), Snapshots(1), TiltedWaves(1)):
        assert "estimated_error" not in simulate(CAMERA, chart(), light).metadata


def test_exact_parts_of_a_scene_lower_the_relative_error():
    both = chart() + targets.white(3.0)
    alone = simulate(CAMERA, chart(), Snapshots(8, rng=1)).metadata["estimated_error"]
    assert 0 < simulate(CAMERA, both, Snapshots(8, rng=1)).metadata["estimated_error"] < alone / 3


def test_waves_of_a_small_source_stay_within_it():
    waves = TiltedWaves(200, na=0.004)
    from lumigraph.simulation.coherence import ScenePlane

    part = chart().parts[0]
    plane = ScenePlane(np.sqrt(part.intensity), part.grid, CAMERA.object_distance, CAMERA.pupil_diameter)
    sines, weights = waves.directions(plane, CAMERA.wavelength)
    assert np.hypot(*sines.T).max() <= 0.004
    assert weights.mean() == pytest.approx(1, abs=0.1)  # the weights make up for the density


def test_the_share_of_light_is_the_power_in_the_shifted_pupil():
    """Against a sum over the frequencies that the pupil takes, for one direction."""
    grid, radius = Grid((24, 30), (2.0, 1.5)), 0.12
    amplitude = np.random.default_rng(1).random(grid.shape)
    share, table = directions.share_of_light(amplitude, grid, radius)
    row, column = table.shape[0] // 2 + 5, table.shape[1] // 2 - 3
    s = np.array([table.y[row], table.x[column]])
    f = np.linspace(-radius, radius, 121)
    y, x = np.meshgrid(f, f, indexing="ij")
    inside = np.hypot(y, x) < radius
    waves = [
        np.exp(-2j * np.pi * np.outer(f - shift, c)) for shift, c in zip(s, (grid.y, grid.x), strict=True)
    ]
    spectrum = np.abs(waves[0] @ amplitude @ waves[1].T) ** 2
    expected = spectrum[inside].mean() * np.pi * radius**2 / np.prod(table.pitch)
    assert share[row, column] == pytest.approx(expected, rel=0.15)  # four cells to the radius


def test_followed_points_have_the_density_asked_for():
    density = np.array([[1.0, 3.0], [0.0, 4.0], [2.0, 2.0]])
    places, relative = directions.follow(density, directions.quasi_random(4000))
    rows, columns = (places * density.shape).astype(int).T
    counts = np.zeros(density.shape)
    np.add.at(counts, (rows, columns), 1)
    np.testing.assert_allclose(counts / 4000, density / density.sum(), atol=0.005)
    assert (1 / relative).mean() == pytest.approx(5 / 6, abs=0.01)  # the dark cell is never visited
    even, flat = directions.follow(np.zeros((2, 2)), directions.quasi_random(5))
    np.testing.assert_allclose(even, directions.quasi_random(5))
    assert flat.tolist() == [1.0] * 5
