"""Against HCIPy, as a black box: a focal-plane image, and a free-space propagation. Skipped without it."""

import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.instruments import SingleLensCamera
from lumigraph.propagation import propagate
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.units import mm, nm, um

hcipy = pytest.importorskip("hcipy")
pytestmark = pytest.mark.filterwarnings("ignore")

WAVELENGTH = 633 * nm


def test_a_points_image_is_that_of_the_fraunhofer_propagator():
    """Far object: the image in the focal plane, at pixel centres, normalised to its peak; to 5e-4."""
    camera = SingleLensCamera(
        wavelength=WAVELENGTH,
        object_distance=316 * mm,
        main_lens={"focal_length": 158 * mm, "diameter": 5 * mm},
        sensor={"pixel_pitch": 2 * um, "shape": (61, 61)},
    )
    ours = simulate(camera, targets.points([(0, 0)])).data
    pupil = hcipy.make_pupil_grid(512, 5 * mm)
    stop = hcipy.evaluate_supersampled(hcipy.make_circular_aperture(5 * mm), pupil, 8)
    pixels = hcipy.make_uniform_grid([61 * 4, 61 * 4], [61 * 2 * um, 61 * 2 * um])
    lens = hcipy.FraunhoferPropagator(pupil, pixels, focal_length=camera.separation)
    fine = lens(hcipy.Wavefront(stop, WAVELENGTH)).power.shaped
    theirs = np.asarray(fine).reshape(61, 4, 61, 4).mean((1, 3))
    assert np.abs(ours / ours.max() - theirs / theirs.max()).max() < 5e-4


def test_free_space_is_their_angular_spectrum():
    """A Gaussian beam that stays in the window, over a way short enough for their transfer function."""
    n, pitch, distance = 256, 10 * um, 20 * mm
    theirs = hcipy.make_uniform_grid([n, n], [n * pitch, n * pitch])
    y, x = np.asarray(theirs.y).reshape(n, n), np.asarray(theirs.x).reshape(n, n)
    beam = np.exp(-((y / (0.2 * mm)) ** 2) - ((x - 0.1 * mm) / (0.15 * mm)) ** 2).astype(complex)
    step = hcipy.AngularSpectrumPropagator(theirs, distance)
    reference = np.asarray(
        step(hcipy.Wavefront(hcipy.Field(beam.ravel(), theirs), WAVELENGTH)).electric_field
    ).reshape(n, n)
    grid = Grid((n, n), pitch, (float(y[n // 2, 0]), float(x[0, n // 2])))
    ours = propagate(Field(beam, grid, WAVELENGTH), distance).data
    intensity = np.linalg.norm(np.abs(ours) ** 2 - np.abs(reference) ** 2) / np.linalg.norm(abs(ours) ** 2)
    overlap = abs(np.vdot(ours, reference)) / np.linalg.norm(ours) / np.linalg.norm(reference)
    assert intensity < 1e-4  # theirs takes every frequency, ours those of the band: measured 4e-5
    assert 1 - overlap < 1e-9
