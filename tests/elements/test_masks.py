import math

import numpy as np
import pytest

from lumigraph.core.grid import Grid
from lumigraph.elements import masks, random_phase_mask, white_phase
from lumigraph.errors import GeometryError

WAVELENGTH = 633e-9


def coherence(mask, lag):
    """Correlation of the mask with itself `lag` columns on; 1/sqrt(samples) is noise."""
    return abs(np.mean(mask[:, lag:] * mask[:, :-lag].conj()))


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_white_phases_are_uniform_and_independent(rng, dtype):
    mask = white_phase(Grid((200, 301), 1e-6), rng, dtype)
    assert mask.dtype == dtype
    np.testing.assert_allclose(np.abs(mask), 1.0, atol=1e-6)
    # 60,200 samples: means of independent phases lie within 4/sqrt(60200) = 0.016.
    for power in (1, 2, 3):
        assert abs(np.mean(mask**power)) < 0.016
    assert coherence(mask, 1) < 0.016


@pytest.mark.parametrize(("shape", "count"), [((24, 24), 24), ((46, 63), 23), ((21, 30), 5)])
def test_the_thesis_mask_is_the_phase_of_the_fresnel_integral(shape, count):
    grid = Grid(shape, (3e-6, 2e-6))
    draw = masks._displaced if count < 20 else masks._regular
    sources = draw(shape, count, np.random.default_rng(3))
    kernels = []
    for n, p, c in zip(shape, grid.pitch, (grid.y, grid.x), strict=True):
        distance = (n * p) ** 2 / (n * WAVELENGTH)
        kernels.append(np.exp(1j * math.pi * (c[:, None] - c) ** 2 / (WAVELENGTH * distance)))
    wave = kernels[0] @ sources @ kernels[1].T
    mask = random_phase_mask(grid, WAVELENGTH, count, np.random.default_rng(3), np.complex128)
    strong = abs(wave) > 1e-3 * abs(wave).max()
    np.testing.assert_allclose(mask[strong], (wave / abs(wave))[strong], atol=1e-5)


@pytest.mark.parametrize("count", [10, 40, 100])
def test_areas_of_the_thesis_mask_are_as_large_as_its_sources(rng, count):
    # Coherent well within N/C samples, incoherent beyond two of them (12 masks: noise below 0.03 at C = 40).
    drawn = [random_phase_mask(Grid.square(400, 1e-6), WAVELENGTH, count, rng) for _ in range(4)]
    size = 400 // count
    near, far = (np.mean([coherence(m, lag) for m in drawn]) for lag in (max(1, size // 4), 2 * size))
    assert near > 0.5
    assert far < (0.25 if count == 10 else 0.1)


def test_the_phases_of_the_thesis_mask_are_uniform(rng):
    mask = random_phase_mask(Grid.square(400, 1e-6), WAVELENGTH, 100, rng)
    assert mask.dtype == np.complex64
    np.testing.assert_allclose(np.abs(mask), 1.0, atol=1e-6)
    # About 100² independent areas: 4/100.
    assert abs(mask.mean()) < 0.04


def test_regular_sources_are_discs_that_touch():
    sources = np.abs(masks._regular((250, 250), 25, np.random.default_rng(0)))
    # Hard discs of 10 samples: π/4 of the area, to the roughness of their edges.
    assert sources.mean() == pytest.approx(math.pi / 4, abs=0.02)
    assert sources[5::10, :].max(axis=0).min() == pytest.approx(1.0)


def test_as_many_sources_as_samples_leave_none_dark():
    assert np.abs(masks._regular((30, 30), 30, np.random.default_rng(0))).min() == pytest.approx(1.0)


def test_few_sources_are_displaced_and_many_are_not():
    first, second = (np.abs(masks._displaced((200, 200), 5, np.random.default_rng(s))) for s in (1, 2))
    assert abs(first - second).max() > 0.5


def test_the_mask_does_not_depend_on_the_wavelength():
    red, blue = (
        random_phase_mask(Grid.square(64, 1e-6), w, 32, np.random.default_rng(5)) for w in (633e-9, 450e-9)
    )
    np.testing.assert_allclose(red, blue, atol=1e-4)


def test_impossible_masks_are_refused(rng):
    for count in (0, 65):
        with pytest.raises(GeometryError, match=f"coherence_index is {count} but must lie between 1 and 64"):
            random_phase_mask(Grid((64, 80), 1e-6), WAVELENGTH, count, rng)
    with pytest.raises(GeometryError, match="wavelength is 0 m"):
        random_phase_mask(Grid.square(64, 1e-6), 0.0, 8, rng)
