"""Far light of several depths by few patterns that they share."""

import dataclasses
import tracemalloc

import numpy as np
import pytest

from lumigraph.elements.objective import Objective
from lumigraph.operators.microscope.building import SampledLenslets, microscope_operator
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.far_light import FarCells, FarLight, far_numbers, shared
from lumigraph.operators.microscope.kernels import SHARES
from lumigraph.operators.microscope.volume_operator import _norms

DEPTHS = (-8e-6, 0.0, 15e-6)


@pytest.fixture(scope="module")
def operator():
    lenslet = Lenslet(125e-6, 2.5e-3, 2.5e-3, 20.0, 125e-6)
    layout = SampledLenslets((9, 8), CellSampling(3, 9, 1 / 9))
    return microscope_operator([Objective(525e-9, 0.5)], lenslet, layout, DEPTHS, accuracy=1e-2)


@pytest.mark.parametrize("allowed", [1e-3, 1e-4])
def test_points_and_even_planes_of_each_depth_lose_no_more_than_is_said(operator, allowed):
    fars, light, own = [one.far for one in operator.kernels], [_norms(one) for one in operator.kernels], []
    found, lost = shared(fars, light, allowed)
    for far, one, (point, plane) in zip(fars, found, light, strict=True):
        whole, kept = far.weights.astype(float) @ far.images, one.weights @ (one.parts @ one.images)
        own.append(np.linalg.norm(whole - kept) / point)
        halves = far.offsets[:, 0] >= 0, far.offsets[:, 1] < 0, np.full(len(whole), True)
        own += [np.linalg.norm((whole - kept)[half].sum(0)) / plane for half in halves]
    assert max(own) <= lost * 1.01 <= allowed * 1.01
    assert max(own) > 0.1 * allowed
    assert all(one.images is found[0].images for one in found)
    assert len(found[0].images) < 0.7 * sum(len(far.images) for far in fars)


def test_where_points_miss_the_accuracy_anyway_few_patterns_are_shared(operator):
    """With as many as 1e-6 asks for, 25 planes held 3 GiB of them."""
    spent = max(one.error for one in operator.kernels)
    asked = dataclasses.replace(operator, left_out=SHARES["patterns"] * 0.9 * spent, _spectra={})
    found, lost = asked._shared
    assert 1e-4 * spent < lost <= 0.1 * spent
    assert len(found[0].images) < 0.7 * sum(len(far.images) for far in operator._own_fars)


def test_norms_of_images(operator):
    kernel = operator.kernels[1]
    faintest = np.sqrt(np.square(kernel.blocks.astype(float)).sum((1, 2)).min())
    assert _norms(kernel) == pytest.approx((faintest, np.linalg.norm(kernel.white())))


def test_far_light_by_shared_patterns_is_that_of_each_depths_own(operator, rng):
    fars, found = (
        operator._own_fars,
        shared(operator._own_fars, [_norms(one) for one in operator.kernels], 1e-3)[0],
    )
    for dtype, exact in ((np.float32, 1e-3), (np.float64, 1e-3)):
        own, few = (FarLight.of(one, operator.cells, 1, None, np.zeros(1, dtype)) for one in (fars, found))
        volume = rng.random((3, 33, 30)).astype(dtype)
        near = operator.forward(np.ones(operator.shape[1]))
        expected, light = own.forward(volume, 3), few.forward(volume, 3)
        assert 0 < np.linalg.norm(light - expected) < exact * np.linalg.norm(near)
        for one in (own, few):
            raw = rng.random(expected.shape).astype(dtype)
            seen = np.repeat(np.repeat(one.adjoint(raw), 3, 1), 3, 2)
            assert np.vdot(one.forward(volume, 3), raw) == pytest.approx(np.vdot(volume, seen), rel=1e-4)


def test_what_each_point_hardly_shows_counts_where_it_adds_up_in_even_planes(rng):
    """A thousand cells that each send a thousandth: of a point 0.03 of what the plane has."""
    first, second = np.linalg.qr(rng.standard_normal((40, 2)))[0].T
    offsets = np.stack(np.divmod(np.arange(1000), 40), 1) - (12, 20)
    weights = np.full((1000, 2), 1e-3, np.float32)
    far = FarCells(offsets, weights, np.stack([first, first + 0.1 * second]).astype(np.float32))
    found, lost = shared([far], [(1.0, 1.0)], 1e-2)
    assert len(found[0].images) == 2
    assert lost < 1e-12
    weights[:, 1] *= 0.1
    found, lost = shared([far], [(1.0, 1.0)], 1.5e-2)  # 0.1 of 0.1 of the plane, in one direction of two
    off = weights.sum(0) @ (far.images - found[0].parts @ found[0].images)
    assert np.linalg.norm(off) <= lost
    assert lost == pytest.approx(np.sqrt(2) * 1e-2, rel=0.02)


def test_numbers_that_far_light_takes(operator):
    found, _ = shared(operator._own_fars, [_norms(one) for one in operator.kernels], 1e-4)
    cells, margin, like = (40, 36), 2, np.zeros(1, np.float32)
    volume, basis = np.ones((3, 3 * 44, 3 * 40), np.float32), np.eye(81, dtype=np.float32)
    tracemalloc.start()
    far = FarLight.of(found, cells, margin, basis, like)
    tracemalloc.reset_peak()
    far.adjoint(far.forward(volume, 3))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    light = 4 * 40 * 36 * 81  # of `forward`, which is the operator's
    assert 4 * far_numbers(found, cells, margin, 81) == pytest.approx(peak - light, rel=0.25)
