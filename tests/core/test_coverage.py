"""Area fractions: exact where they say so."""

import math

import numpy as np
import pytest

from lumigraph.core import coverage
from lumigraph.core.grid import Grid


@pytest.mark.parametrize("radius", [0.3, 1.0, 7.3, 200.5])
@pytest.mark.parametrize("center", [(0.0, 0.0), (0.25, -0.4)])
def test_the_area_of_a_disc_is_exact(radius, center):
    # A circle hard on sample centres is off by 1e-2 to 1e-4 here.
    n = 2 * math.ceil(radius) + 4
    grid = Grid((n, n + n // 4), (1.0, 0.9))
    grey = coverage.disc((grid.y - center[0])[:, None], grid.x - center[1], radius, grid.pitch)
    assert grey.sum() * 0.9 == pytest.approx(math.pi * radius**2, rel=1e-10)
    assert grey.min() == 0.0
    assert grey.max() <= 1.0


def test_samples_of_a_disc_agree_with_fine_subsampling(rng):
    y, x = rng.uniform(-4, 4, (2, 50))
    step = (np.arange(400) + 0.5) / 400 - 0.5
    fine = [np.mean((b + step[:, None]) ** 2 + (a + 0.7 * step) ** 2 <= 9) for b, a in zip(y, x, strict=True)]
    # 400 × 400 points resolve an edge to about 1e-4 of a sample.
    np.testing.assert_allclose(coverage.disc(y, x, 3.0, (1.0, 0.7)), fine, atol=3e-4)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.1, math.pi / 4, 1.2, math.pi / 2, 3.0])
def test_half_planes_agree_with_fine_subsampling(angle):
    normal, pitch = coverage.sides(angle), (1.0, 0.7)
    distance = np.linspace(-1, 1, 41)
    step = (np.arange(300) + 0.5) / 300 - 0.5
    shadow = pitch[0] * normal[0] * step[:, None] + pitch[1] * normal[1] * step
    fine = [(d + shadow > 0).mean() for d in distance]
    np.testing.assert_allclose(coverage.half_plane(distance, normal, pitch), fine, atol=2e-3)


@pytest.mark.parametrize("angle", [0.0, 1e-5, 0.3])
def test_both_sides_of_a_line_add_up_to_a_whole_sample(angle):
    distance, (ny, nx) = np.linspace(-3, 3, 601), coverage.sides(angle)
    both = coverage.half_plane(distance, (ny, nx), (1.0, 0.7)) + coverage.half_plane(
        -distance, (-ny, -nx), (1.0, 0.7)
    )
    np.testing.assert_allclose(both, 1.0, atol=1e-10)
    assert coverage.half_plane(np.array([-3.0]), (ny, nx), (1.0, 0.7))[0] == 0.0


def test_a_strip_covers_its_width():
    grid = Grid((1, 40), 1.0)
    assert coverage.strip(grid.x, 3.3, (0.0, 1.0), (1.0, 1.0)).sum() == pytest.approx(6.6, rel=1e-12)


def test_an_interval_covers_its_length():
    assert coverage.interval(np.arange(10.0), 1.0, 2.3, 6.1).sum() == pytest.approx(3.8, rel=1e-12)
