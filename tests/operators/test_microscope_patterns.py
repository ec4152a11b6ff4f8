"""Few patterns of a cell's points hold all of their images but for what is allowed."""

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.volume import Volume
from lumigraph.deconvolution import deconvolve
from lumigraph.elements.objective import Objective
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.operators.microscope.building import SampledLenslets, microscope_operator
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.kernels import SHARES, KernelAccuracy, slice_kernel
from lumigraph.operators.microscope.patterns import (
    all_patterns,
    few_of_pixels,
    few_patterns,
    parted,
    whole,
)
from lumigraph.operators.microscope.volume_operator import _MATRICES

SCOPE = Objective(525e-9, 0.5)
LENSLET = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6)
SAMPLING = CellSampling(9, 8, 1 / 8)
DEPTHS = (-50e-6, 0.0, 40e-6)


@pytest.fixture(scope="module")
def kernel():
    """Of a depth at which neighbouring samples look alike."""
    return slice_kernel([SCOPE], LENSLET, SAMPLING, -50e-6, KernelAccuracy(2e-2, 20))


@pytest.fixture(scope="module")
def operator():
    """Of three depths, by frequency."""
    one = microscope_operator([SCOPE], LENSLET, SampledLenslets((7, 8), SAMPLING), DEPTHS, accuracy=2e-2)
    return dataclasses.replace(one, by_frequency=True, _spectra={})


def images_of(kernel):
    """(s², cells N²), point by point."""
    s, N, n = kernel.sampling.points, kernel.sampling.pixels, len(kernel.offsets)
    return kernel.matrix().reshape(n, s * s, N * N).transpose(1, 0, 2).reshape(s * s, -1).astype(float)


@pytest.mark.parametrize("allowed", [3e-2, 1e-2, 3e-3])
def test_no_point_loses_more_than_is_allowed_and_the_loss_is_what_is_said(kernel, allowed):
    found, images = few_patterns(kernel, allowed), images_of(kernel)
    kept = found.basis @ (found.basis.T @ images)
    lost = np.linalg.norm(images - kept, axis=1) / np.linalg.norm(images, axis=1)
    assert lost.max() <= allowed
    assert found.left_out == pytest.approx(lost.max(), rel=1e-3)
    assert found.count < 0.8 * SAMPLING.classes


def test_patterns_are_as_few_as_singular_values_allow(kernel):
    """Of Eckart and Young: no smaller rank leaves so little of all points' images together."""
    found, images = few_patterns(kernel, 1e-2), images_of(kernel)
    light = np.square(np.linalg.svd(images, compute_uv=False))
    rest = np.square(images - found.basis @ (found.basis.T @ images)).sum()
    assert rest == pytest.approx(light[found.count :].sum(), rel=1e-3)
    weaker = found.basis[:, np.argsort(np.square(found.basis.T @ images).sum(1))[1:]]
    lost = np.linalg.norm(images - weaker @ (weaker.T @ images), axis=1) / np.linalg.norm(images, axis=1)
    assert lost.max() > 1e-2  # one fewer is one too few


@pytest.fixture(scope="module")
def fine():
    """Kernels of two depths, sampled more finely than their light asks for."""
    return [
        slice_kernel([SCOPE], LENSLET, CellSampling(3, 31, 1 / 31), z, KernelAccuracy(2e-2, 20))
        for z in DEPTHS[:2]
    ]


@pytest.mark.parametrize("allowed", [3e-2, 3e-3])
def test_no_points_image_loses_more_by_patterns_of_its_pixels_than_is_said(fine, allowed):
    found, lost = few_of_pixels(fine, allowed), []
    for kernel in fine:
        s, N, n = kernel.sampling.points, kernel.sampling.pixels, len(kernel.offsets)
        cells = kernel.matrix().reshape(n, s * s, N * N).transpose(1, 0, 2).astype(float)
        rest = cells - cells @ found.basis @ found.basis.T
        lost.append(np.linalg.norm(rest, axis=(1, 2)) / np.linalg.norm(cells, axis=(1, 2)))
    assert found.left_out == pytest.approx(np.max(lost), rel=1e-3)
    assert found.left_out <= allowed
    assert found.count < 0.7 * 31**2
    np.testing.assert_allclose(found.basis.T @ found.basis, np.eye(found.count), atol=1e-12)


def test_patterns_of_pixels_are_taken_from_a_plane_as_their_values_say(fine, xp, rng):
    """And put back: by even and odd sums along the axes, and by all values of each pattern."""
    found, plane = few_of_pixels(fine, 1e-2), rng.random((2 * 31, 3 * 31))
    cells = plane.reshape(2, 31, 3, 31).transpose(0, 2, 1, 3).reshape(2, 3, -1)
    parts = to_numpy(parted(xp.asarray(plane), found))
    np.testing.assert_allclose(parts, cells @ found.basis, atol=1e-12)
    back = to_numpy(whole(xp.asarray(parts), found)).reshape(2, 31, 3, 31).transpose(0, 2, 1, 3)
    np.testing.assert_allclose(back.reshape(2, 3, -1), parts @ found.basis.T, atol=1e-12)


def test_images_by_few_patterns_of_pixels_differ_by_what_the_operator_says():
    """All s² patterns of points are followed there: what is lost the pixels' lose."""
    layout = SampledLenslets((7, 8), CellSampling(3, 31, 1 / 31))
    one = microscope_operator([SCOPE], LENSLET, layout, DEPTHS, accuracy=2e-2)
    one = dataclasses.replace(one, by_frequency=True, _spectra={})
    exact, lost = dataclasses.replace(one, by_frequency=False, _spectra={}), []
    for place in ((0, 10, 11), (1, 10, 12), (2, 11, 10)):
        point = np.zeros(one.shape[1])
        point[place] = 1
        expected = exact.psf(place)
        lost.append(np.linalg.norm(one.forward(point) - expected) / np.linalg.norm(expected))
    assert 0.3 < max(lost) / one._pixels.left_out < 1.05
    assert math.hypot(exact.error, max(lost)) < 1.05 * one.error
    assert one.memory_bytes < dataclasses.replace(one, left_out=0.0, _spectra={}).memory_bytes


def test_patterns_of_pixels_leave_out_what_pixels_hardly_see():
    """Pixels of any place average over samples: what they lose is what is said, by fewer patterns."""
    scope = LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        lenslets={"count": (7, 7)}, sensor={"shape": (106, 106)}
    )
    one = scope.operator((-8e-6,), 3, accuracy=1e-2)
    exact, lost = dataclasses.replace(one, by_frequency=False, _spectra={}), []
    assert one.by_frequency
    for place in ((0, 9, 10), (0, 10, 10), (0, 8, 10)):
        point = np.zeros(one.shape[1])
        point[place] = 1
        expected = exact.psf(place)
        lost.append(np.linalg.norm(one.forward(point) - expected) / np.linalg.norm(expected))
    found, sampling = one._pixels, one.kernels[0].sampling
    assert sampling.degree == 3
    assert 0.5 < max(lost) / found.left_out < 1.1
    assert one.error <= 1e-2
    samples = [replace_sampling(kernel, dataclasses.replace(sampling, degree=0)) for kernel in one.kernels]
    assert found.count < 0.85 * few_of_pixels(samples, found.left_out).count


def replace_sampling(kernel, sampling):
    """The same numbers, as pixels' own where the degree is 0."""
    return dataclasses.replace(kernel, sampling=sampling)


def test_patterns_are_orthonormal_and_even_or_odd_as_they_say(kernel):
    found, s = few_patterns(kernel, 1e-2), SAMPLING.points
    np.testing.assert_allclose(found.basis.T @ found.basis, np.eye(found.count), atol=1e-12)
    for pattern, (odd_y, odd_x) in zip(found.basis.T.reshape(-1, s, s), found.odd.T, strict=True):
        np.testing.assert_allclose(pattern[::-1], (-1) ** odd_y * pattern, atol=1e-12)
        np.testing.assert_allclose(pattern[:, ::-1], (-1) ** odd_x * pattern, atol=1e-12)


def test_where_nearly_all_are_wanted_all_are_followed_and_nothing_is_left_out(kernel):
    found = few_patterns(kernel, 1e-9)
    assert found is all_patterns(SAMPLING.points)
    assert found.left_out == 0


def test_images_by_few_patterns_differ_by_what_the_operator_says(operator):
    """`psf` goes over all offsets, without patterns."""
    exact = dataclasses.replace(operator, by_frequency=False, _spectra={})
    assert 0 < operator.left_out == SHARES["patterns"] * 2e-2
    assert operator.error > exact.error
    for place in ((0, 30, 31), (1, 31, 35), (2, 33, 30)):
        point = np.zeros(operator.shape[1])
        point[place] = 1
        expected = exact.psf(place)
        lost = np.linalg.norm(operator.forward(point) - expected) / np.linalg.norm(expected)
        assert lost < 1.05 * operator.left_out  # the array's border cuts off some of the image
        assert math.hypot(exact.kernels[place[0]].error, lost) < 1.05 * operator.error


def test_forward_and_adjoint_by_few_patterns_are_transposes(operator, xp, rng):
    volume, raw = xp.asarray(rng.random(operator.shape[1])), xp.asarray(rng.random(operator.shape[0]))
    left = float(xp.sum(operator.forward(volume) * raw))
    assert left == pytest.approx(float(xp.sum(volume * operator.adjoint(raw))), rel=1e-10)


def test_they_take_fewer_operations_and_less_memory(operator):
    whole = dataclasses.replace(operator, left_out=0.0, _spectra={})
    assert operator.multiply_adds < 0.7 * whole.multiply_adds
    assert operator.memory_bytes < whole.memory_bytes
    assert whole.error == pytest.approx(max(kernel.error for kernel in operator.kernels))


def test_rays_have_no_accuracy_of_which_to_leave_out():
    by_rays = Objective(525e-9, 0.5, model="rays")
    one = microscope_operator(
        [by_rays], LENSLET, SampledLenslets((5, 5), CellSampling(3, 8, 1 / 8)), (-20e-6,)
    )
    assert one.left_out == 0


def test_beads_in_the_dark_come_out_the_same(operator, rng, monkeypatch):
    """Negative parts of images would ruin dark pixels, of which Richardson-Lucy takes quotients."""
    monkeypatch.setattr("lumigraph.operators.microscope.volume_operator.suits_frequencies", lambda *_: True)
    beads = np.zeros(operator.shape[1], np.float32)
    beads[0, 20, 33] = beads[1, 41, 40] = beads[2, 35, 18] = 20000
    raw = rng.poisson(np.maximum(operator.forward(beads), 0)).astype(np.float32)
    volumes = [
        deconvolve(raw, dataclasses.replace(operator, left_out=allowed, _spectra={}), 12)
        for allowed in (0.0, operator.left_out)
    ]
    assert not isinstance(volumes[0], Volume)
    lost = np.linalg.norm(volumes[1] - volumes[0]) / np.linalg.norm(volumes[0])
    assert 1e-7 < lost < operator.left_out


@pytest.mark.parametrize("by_frequency", [True, False])
@pytest.mark.parametrize(("s", "N", "cells"), [(9, 8, (15, 14)), (3, 27, (21, 21))])
def test_the_memory_that_is_said_is_that_which_is_held(s, N, cells, by_frequency):
    """By Python's own count of what NumPy allocates; matrices are made by the first application."""
    layout = SampledLenslets(cells, CellSampling(s, N, 1 / N))
    one = microscope_operator([SCOPE], LENSLET, layout, DEPTHS, accuracy=2e-2)
    one = dataclasses.replace(one, by_frequency=by_frequency, _spectra={})
    volume, said = np.ones(one.shape[1], np.float32), one.memory_bytes - one.nbytes
    _MATRICES.clear()
    tracemalloc.start()
    try:
        raw = one.forward(volume)
        tracemalloc.reset_peak()
        one.adjoint(raw)
        one.forward(volume)
        used = tracemalloc.get_traced_memory()[1] + volume.nbytes
    finally:
        tracemalloc.stop()
    assert 0.8 < said / used < 1.7
