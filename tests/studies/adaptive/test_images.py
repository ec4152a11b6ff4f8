"""Images of beads that are balls, against those of many points; and by how much they change."""

import math

import numpy as np
import pytest
from tests.studies.adaptive.test_estimate import SCOPE, UNIT

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.studies.adaptive import estimate
from lumigraph.studies.adaptive.images import BALL, SMALL, STEP, WEIGHTS, changes_of, diameter, image_of

PLACE, UM = np.array([-8.3e-6, -7.1e-6, 7.7e-6]), 1e-6


def solid(width):
    """Points (123, 3) of a lattice in a ball, with its variance along each axis."""
    at = np.stack(np.meshgrid(*[np.arange(-3, 4) / 6] * 3, indexing="ij"), -1).reshape(-1, 3)
    inside = at[np.linalg.norm(at, axis=1) <= 0.5]
    return inside * width / math.sqrt(20 * np.mean(inside**2))


def light(images, width, c):
    points = PLACE + solid(width)
    return images.forward(lg.Points(points, np.full(len(points), 1 / len(points))), c)


def spread_of(width):
    return width**2 / 20 / UM**2


@pytest.mark.parametrize(
    ("powers", "moment"),
    [
        ((0, 0, 0), 1), ((2, 0, 0), 1 / 5), ((4, 0, 0), 3 / 35), ((2, 2, 0), 1 / 35), ((6, 0, 0), 1 / 21),
        ((0, 4, 2), 1 / 105), ((2, 2, 2), 1 / 315), ((1, 0, 0), 0), ((1, 1, 2), 0),
    ],
)  # fmt: skip
def test_points_have_the_moments_of_a_ball(powers, moment):
    """Of radius 1: <r^n> is 3/(n + 3), times the mean over the sphere."""
    assert np.sum(WEIGHTS * np.prod(BALL**powers, 1)) == pytest.approx(moment, abs=1e-12)
    if sum(powers) < 4:
        assert np.mean(np.prod(SMALL**powers, 1)) == pytest.approx(moment, abs=1e-12)


@pytest.mark.parametrize(("width", "least"), [(0.4e-6, 0.01), (1.2e-6, 0.06)])
def test_a_balls_image_is_that_of_many_points(width, least):
    """A point's own image is farther off than `least`."""
    images, at = SCOPE.pupil_images((6,), farthest=12e-6, accuracy=2e-2), np.append(PLACE, 0.2)
    true = light(images, width, at[3:])
    assert diameter(spread_of(width), UM) == pytest.approx(width)
    off = []
    for spread in (spread_of(width), 0.0, -0.1):
        part, (own,) = image_of(images, np.append(at, spread), UM)
        found = np.zeros_like(true)
        found[part] = own
        off.append(np.linalg.norm(found - true) / np.linalg.norm(true))
    assert off[0] < 0.1 * off[1]
    assert off[1] == off[2] > least


@pytest.mark.parametrize("spread", [0.0, 0.1])
def test_changes_of_a_ball_are_differences_of_its_images(spread):
    images = SCOPE.pupil_images((6,), farthest=12e-6, accuracy=2e-2)
    at = np.concatenate([PLACE, [0.2, spread]])
    part, by = changes_of(images, at, UM)
    assert by.shape[0] == 6
    for k, unknown, step in ((0, 0, 2e-8), (1, 1, 2e-8), (2, 2, 2e-8), (4, 3, 2e-3), (5, 4, STEP / 1.5)):
        ahead = at + step * np.eye(5)[unknown]
        planes = []
        for one in (at, ahead):
            there, own = image_of(images, one, UM)
            whole = np.zeros(images.shape)
            whole[there] = own[0]
            planes.append(whole)
        slope = (planes[1] - planes[0]) / step
        own = np.zeros(images.shape)
        own[part] = by[k]
        assert np.linalg.norm(own - slope) < (0.25 if k == 5 else 0.1) * np.linalg.norm(slope)


def test_a_wide_bead_is_found_with_its_width_and_does_not_pull():
    """1.2 µm, 10⁵ photons: of a point, the second term is 5.5 deviations off."""
    true = np.array([0.2, -0.15])
    scope = SCOPE.replace(lenslets={"count": (5, 5)}, sensor={"shape": (97, 97)})
    images = scope.pupil_images((6, 8), farthest=8e-6, accuracy=2e-2)
    seen = light(images, 1.2e-6, true) * 1e5 / UNIT + 1
    raw = np.random.default_rng(0).poisson(seen).astype(np.float32)
    given = (4e-6, 8e-6), (6, 8)
    found = estimate(raw, scope, *given, exposure=Exposure(background=1.0, gain=1.0))
    assert len(found.beads.intensities) == 1
    assert found.covariance.shape == (2, 2)
    assert found.bead_width == pytest.approx(1.2e-6, rel=0.06)
    assert 0.05 * found.bead_width < found.bead_width_deviation < 0.1 * found.bead_width
    np.testing.assert_array_less(np.abs(found.values.ravel() - true), 3 * found.deviations.ravel())
    assert found.deviations.max() < 3e-3
    assert found.pearson < 1.05
