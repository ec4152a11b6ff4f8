"""Coherent planes against sums over their samples by quadratures that share no code with them."""

from functools import partial

import numpy as np
import pytest
from benchmarks import references

import cameras
from lumigraph.core.grid import Grid
from lumigraph.instruments import SingleLensCamera
from lumigraph.operators.periodic import coherent
from lumigraph.operators.periodic.coherent import coherent_image
from lumigraph.scene import Scene, Slice
from lumigraph.simulation import Coherent, simulate
from lumigraph.units import mm, nm, um

focused = partial(cameras.focused, count=(3, 3))
FINENESS = references.Fineness(48, 4, 600, 48)
GRID = Grid((3, 4), (21 * um, 27 * um), (30 * um, -20 * um))
AMPLITUDE = np.random.default_rng(3).random(GRID.shape)


def relative(image, reference):
    return np.linalg.norm(image - reference) / np.linalg.norm(reference)


def samples():
    return (
        (y, x, float(a))
        for y, row in zip(GRID.y, AMPLITUDE, strict=True)
        for x, a in zip(GRID.x, row, strict=True)
    )


@pytest.mark.parametrize("lenslets", [{}, {"layout": "hex", "count": (4, 3), "shape": "round"}])
def test_a_plane_before_lenslets_is_as_exact_as_an_accuracy_asks(lenslets):
    """Out of focus; grids are off by 2 %, a sample left out or a conjugate phase by tens of percent."""
    camera, dz = focused(**lenslets), 3 * mm
    at = (((y, x), a) for y, x, a in samples())
    scale = (camera.separation / (camera.object_distance + dz)) ** 2
    truth = references.coherent(camera, dz, at, float(np.prod(GRID.pitch)), FINENESS) * scale
    for accuracy in (1e-2, 1e-3):
        assert relative(coherent_image(camera, AMPLITUDE, GRID, dz, accuracy), truth) < 0.3 * accuracy
    raw = simulate(camera, Scene([Slice((AMPLITUDE**2).astype(np.float32), GRID, dz)]), Coherent())
    assert relative(raw.data, truth) < 5e-5
    assert raw.metadata["error"]["rms"] < 2.1e-5


def single(**lens):
    return SingleLensCamera(
        wavelength=633 * nm, object_distance=120 * mm,
        main_lens={"focal_length": 60 * mm, "diameter": 3.75 * mm, **lens},
        sensor={"pixel_pitch": 6 * um, "shape": (41, 40)},
    )  # fmt: skip


def test_a_plane_before_a_single_lens_is_the_sum_of_its_samples():
    """Amplitudes of all samples by Hankel integrals, then their square; pixels by Gauss-Legendre."""
    camera, dz = single(), 2 * mm
    at = (((y, x), a) for y, x, a in samples())
    truth = references.coherent_focused(camera, dz, at, float(np.prod(GRID.pitch)), FINENESS)
    truth *= (camera.separation / (camera.object_distance + dz)) ** 2
    assert relative(coherent_image(camera, AMPLITUDE, GRID, dz, 1e-3), truth) < 1e-5


@pytest.mark.parametrize("aberrations", [{}, {6: 1.5, 8: 1.0, 11: 1.0}])
def test_there_are_enough_nodes_in_the_stop(aberrations, monkeypatch):
    """A wide object far out of focus, behind aberrations: twice as many nodes change nothing."""
    camera, grid = single(aberrations=aberrations), Grid((40, 40), 50 * um)
    amplitude = np.random.default_rng(1).random(grid.shape)
    image = coherent_image(camera, amplitude, grid, 20 * mm, 1e-3)
    disc = coherent.disc
    monkeypatch.setattr(coherent, "disc", lambda count: disc(2 * count))
    assert relative(coherent_image(camera, amplitude, grid, 20 * mm, 1e-3), image) < 2e-5


def test_lenslets_that_are_turned_are_left_to_grids_and_say_so():
    raw = simulate(
        focused(rotation=0.1),
        Scene([Slice(np.ones((4, 4), np.float32), Grid((4, 4), 20 * um), 0.0)]),
        Coherent(),
    )
    assert "grids" in raw.metadata["error"]["source"]
    assert raw.metadata["error"]["rms"] == pytest.approx(0.025)
