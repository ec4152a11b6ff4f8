"""Focal stacks: the sums that all planes share, what invalid samples do, and how long it takes."""

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.errors import GeometryError
from lumigraph.rendering import refocus_stack
from lumigraph.rendering.interpolate import INTERPOLATIONS, sample
from lumigraph.rendering.refocus import shifts


def field(data, valid=None):
    return LightField(data, Grid(data.shape[:2], 1.0), Grid(data.shape[2:4], 1.0), 10.0, valid)


def plainly(views, alpha, interpolation):
    """The same sum written out: every view sampled where the shear says, inside all views only."""
    down, right = shifts(views, alpha)
    t, s = np.arange(views.lenslets.shape[0])[:, None], np.arange(views.lenslets.shape[1])[None, :]
    parts = [
        sample(views.data[v, u], t + down[v], s + right[u], interpolation)
        for v in range(len(down))
        for u in range(len(right))
    ]
    return np.mean(parts, 0)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("shape", [(3, 4, 30, 34), (4, 3, 31, 200, 3)])
def test_a_stack_is_the_mean_of_moved_views(rng, interpolation, shape):
    views = field(rng.random(shape))
    alphas = [0.3, 1.0, 1.4, 2.1]
    for alpha, picture in zip(
        alphas, refocus_stack(views, alphas, interpolation=interpolation, oversample=1), strict=True
    ):
        inner = slice(6, -6)  # shifts of up to 2 x 1.1 lenslets, and three taps
        expected = plainly(views, alpha, interpolation)
        np.testing.assert_allclose(picture[inner, inner], expected[inner, inner], atol=1e-12)


REAL = ["?", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8", "g", ">u2", ">f4", ">f8"]


@pytest.mark.parametrize("dtype", REAL)
@pytest.mark.parametrize("masked", [False, True])
def test_every_type_of_number_refocuses_to_the_same_picture(rng, dtype, masked):
    data = rng.integers(0, 100, (3, 4, 12, 13)).astype(dtype)
    valid = rng.random(data.shape) < 0.9 if masked else None
    expected = refocus_stack(field(data.astype(float), valid), [0.8, 1.0], oversample=1)
    found = refocus_stack(field(data, valid), [0.8, 1.0], oversample=1)
    assert found.dtype == (np.float64 if dtype in ("f8", ">f8", "g") else np.float32)
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-4)


@pytest.mark.parametrize("dtype", ["F", "D", "G", ">c8"])
def test_complex_light_fields_refocus_part_by_part(rng, dtype):
    data = (rng.random((3, 4, 12, 13)) + 1j * rng.random((3, 4, 12, 13))).astype(dtype)
    found = refocus_stack(field(data), [0.8, 1.2], oversample=2)
    parts = [
        refocus_stack(field(part.astype(float)), [0.8, 1.2], oversample=2) for part in (data.real, data.imag)
    ]
    np.testing.assert_allclose(found, parts[0] + 1j * parts[1], atol=1e-12 if dtype in "DG" else 1e-5)


def test_complex_numbers_of_other_array_libraries_refocus_alike(xp, rng):
    data = rng.random((3, 3, 9, 8)) + 1j * rng.random((3, 3, 9, 8))
    found = to_numpy(refocus_stack(field(xp.asarray(data)), [0.8, 1.2], oversample=1))
    np.testing.assert_allclose(found, refocus_stack(field(data), [0.8, 1.2], oversample=1), atol=1e-12)


def test_invalid_samples_do_not_count(xp, rng):
    views = rng.random((3, 3, 12, 13, 3)).astype(np.float32)
    valid = rng.random(views.shape[:4]) < 0.9
    even = np.where(valid[..., None], np.float32(2.0), np.float32(1e3))
    stack = refocus_stack(field(xp.asarray(even), xp.asarray(valid)), [0.7, 1.0, 1.3], oversample=1)
    np.testing.assert_allclose(to_numpy(stack), 2.0, rtol=2e-5)
    everywhere = field(views, np.ones(views.shape[:4], bool))
    plain = refocus_stack(field(views), [1.3], oversample=1)
    np.testing.assert_allclose(refocus_stack(everywhere, [1.3], oversample=1), plain, rtol=1e-5)


def test_a_lenslet_without_any_valid_sample_takes_its_neighbours_light():
    data, valid = np.ones((3, 3, 11, 12)), np.ones((3, 3, 11, 12), bool)
    data[:, :, 5, 6], valid[:, :, 5, 6] = 100.0, False
    for oversample in (1, 3):
        stack = refocus_stack(field(data, valid), [1.0, 1.2], oversample=oversample)
        np.testing.assert_allclose(stack, 1, rtol=1e-9)


def test_a_mask_of_another_shape_is_refused(rng):
    with pytest.raises(GeometryError, match=r"valid has shape \(3, 3\) but the data has \(3, 3, 5, 5\)"):
        field(rng.random((3, 3, 5, 5)), np.ones((3, 3), bool))


def test_progress_counts_the_rows_of_views(rng):
    seen = []
    refocus_stack(field(rng.random((3, 2, 8, 8))), [1.1], progress=seen.append, oversample=1)
    assert seen == [1 / 3, 2 / 3, 1]
