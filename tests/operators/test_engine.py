"""The image of a point: the stop's smooth edge, and the two array libraries that compute it."""

import math

import numpy as np
import pytest

import cameras
from lumigraph.core.banded import banded
from lumigraph.elements import ThinLens, Train, ZernikePlate
from lumigraph.operators.lenslets import main_lens
from lumigraph.operators.lenslets.array_libraries import NUMPY, differentiable, slopes, tangent
from lumigraph.operators.lenslets.illuminated import amplitude
from lumigraph.operators.lenslets.point_light import paraxial_light
from lumigraph.operators.sampling import cells
from lumigraph.units import mm, um

CAMERA = cameras.focused().optics()


def off(found, true):
    return np.linalg.norm(found - true) / np.linalg.norm(true)


@pytest.mark.parametrize("dz", [-4 * mm, 0.0, 6 * mm])
def test_light_of_few_samples_with_a_smooth_edge_is_that_of_a_hankel_transform(dz):
    """Grey samples, as many, are off by 0.5 to 1 %."""
    distance, at = CAMERA.object_distance + dz, np.linspace(-0.2 * mm, 0.2 * mm, 61)
    widest = 0.2 * mm * math.sqrt(2)
    expected = paraxial_light(CAMERA, distance, widest).at(at, at)
    assert off(amplitude(CAMERA, CAMERA.lens, distance, widest, (at, at)), expected) < 3e-5


def test_the_smooth_edge_of_an_ellipse_holds_its_area_and_its_middle():
    plate = ZernikePlate(
        {}, CAMERA.pupil_diameter, center=(0.1 * mm, -0.2 * mm), axes=(0.9, 0.7), direction=0.4
    )
    opening = main_lens.opening_of(Train((plate, ThinLens(60 * mm))))
    grid = main_lens.pupil_grid(CAMERA, 80, 1.4)
    through = opening.through(grid) * np.prod(grid.pitch)
    assert through.sum() == pytest.approx(opening.area, rel=1e-5)
    middle = (through * grid.y[:, None]).sum(), (through * grid.x).sum()
    assert np.divide(middle, opening.area) == pytest.approx(plate.center, abs=1e-4 * mm)


def test_a_ray_of_a_defocused_point_arrives_at_the_blur_s_edge():
    distance = CAMERA.object_distance + 5 * mm
    expected = cells.blur(CAMERA, distance)
    assert main_lens.widest_ray(CAMERA, CAMERA.lens, distance) == pytest.approx(expected, rel=0.01)


def test_lenses_of_two_stops_are_refused():
    lens = Train((ThinLens(60 * mm, 3 * mm), ZernikePlate({}, 3 * mm)))
    with pytest.raises(ValueError, match="has 2 stops but images of points are of lenses with one"):
        main_lens.opening_of(lens)


def steps(xp, numbers):
    """Numbers through all that has its transpose by hand, at the ends of an array too."""
    x = numbers["x"]
    parts = xp.windows(x, [-2, 1, 5], 4, -1)
    whole = xp.overlap_add(parts * xp.exp(1j * parts), [3, -1, 4], 6, -1)
    return xp.real(xp.part(whole, 1, 5, -1)) + xp.imag(whole)[..., :4]


def test_slopes_and_tangents_are_central_differences(rng):
    x, change, weights = rng.random((3, 7)), rng.random((3, 7)), rng.random((3, 4))
    low, high = (steps(NUMPY, {"x": x + side * 1e-6 * change}) for side in (-1, 1))
    (value,), (moved,) = tangent(lambda n: [steps(differentiable(), n)], {"x": x}, {"x": change})
    assert np.array_equal(value, steps(NUMPY, {"x": x}))
    assert off(moved, (high - low) / 2e-6) < 1e-8
    found = slopes(lambda n: (steps(differentiable(), n) * weights).sum(), {"x": x})["x"]
    assert np.vdot(found, change) == pytest.approx(np.vdot(weights, moved), rel=1e-12)


def test_a_banded_matrix_times_slopes_is_summed(rng):
    matrix = banded(
        np.arange(100) * 1.3 * um, np.arange(150) * um, lambda d: 1 - np.abs(d) / (4 * um), 4 * um
    )
    dense, by = matrix.down(np.eye(150)), rng.random((100, 150))
    assert matrix.inner(by) == pytest.approx(np.sum(dense * by), rel=1e-12)
