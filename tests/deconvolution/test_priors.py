"""Priors, filters and least squares."""

import numpy as np
import pytest
from scipy.optimize import minimize

import lumigraph as lg
from deconvolution.models import Matrix, blur, blurred, disc, placed
from lumigraph.core.arrays import to_numpy
from lumigraph.deconvolution import (
    Exposure,
    LeastSquares,
    LowPass,
    RichardsonLucy,
    Stop,
    TotalVariation,
    Wavelets,
)
from lumigraph.deconvolution.filters import lanczos
from lumigraph.deconvolution.least_squares import largest_eigenvalue
from lumigraph.deconvolution.problem import Problem, Scale
from lumigraph.deconvolution.total_variation import gradient, gradient_adjoint

WEIGHTS = (0.3, 1.0, 0.8)


def noisy(operator, scene, rng):
    return rng.poisson(operator.forward(scene)).astype(float)


def objective(raw, operator, prior, estimate):
    exposure = Exposure()
    scale = Scale.of(operator, exposure, raw)
    problem = Problem.of(raw, exposure, scale)
    model = problem.model(estimate)
    return problem.deviance(model) * raw.size / 2 + prior.penalty(problem, estimate)


def test_the_gradient_and_its_adjoint_belong_together(xp, rng):
    image, slopes = rng.normal(size=(4, 5, 6)), rng.normal(size=(3, 4, 5, 6))
    one = xp.sum(gradient(xp.asarray(image), WEIGHTS) * xp.asarray(slopes))
    other = xp.sum(xp.asarray(image) * gradient_adjoint(xp.asarray(slopes), WEIGHTS))
    assert float(one) == pytest.approx(float(other), rel=1e-12)


def test_total_variation_lowers_its_objective_at_every_step(rng):
    operator, prior = blurred((20, 20), 1.5), TotalVariation(0.03, steps=30)
    raw, found = noisy(operator, disc((20, 20)), rng), []
    for iterations in (1, 2, 4, 8, 16, 32, 64):
        estimate = lg.deconvolve(raw, operator, iterations, method=RichardsonLucy(prior))
        found.append(objective(raw, operator, prior, estimate))
    assert np.all(np.diff(found) < 0)


def test_the_inner_iteration_goes_on_where_it_was(rng):
    """With one inner step each time, as good as with 30: what the last one reached is not forgotten."""
    operator = blurred((20, 20), 1.5)
    raw, found = noisy(operator, disc((20, 20)), rng), []
    for steps in (1, 30):
        prior = TotalVariation(0.05, steps=steps)
        estimate = lg.deconvolve(raw, operator, 80, method=RichardsonLucy(prior))
        found.append(objective(raw, operator, prior, estimate))
    assert found[0] - found[1] < 0.01 * found[1]


def test_total_variation_finds_the_minimum_that_a_general_optimiser_finds(rng):
    """In one dimension along y, where |∇o| is smooth but at 0; L-BFGS on a slightly rounded |.|."""
    operator = Matrix(blur(14, 0.7), (14, 1), (14, 1))
    scene = np.where(np.arange(14) < 7, 40.0, 10.0)[:, None]
    raw, prior = noisy(operator, scene, rng), TotalVariation(0.08, spacing=(1, 1), steps=30)
    found = lg.deconvolve(raw, operator, 150, method=RichardsonLucy(prior))[:, 0]
    problem = Problem.of(raw, Exposure(), Scale.of(operator, Exposure(), raw))
    weight = 0.08 * problem.scale.mean_sensitivity

    def cost(values):
        model, steps = problem.model(values[:, None]), np.diff(values)
        return np.sum(model - raw * np.log(model)) + weight * np.sum(np.sqrt(steps**2 + 1e-6))

    limits = {"maxiter": 500, "maxfun": 20000}
    best = minimize(cost, found + rng.normal(size=14), bounds=[(1e-6, None)] * 14, options=limits)
    assert cost(found) <= best.fun + 1e-3
    assert cost(found) < cost(scene[:, 0]) - 1


@pytest.mark.parametrize("accelerated", [False, True])
def test_total_variation_removes_noise_and_keeps_edges(rng, accelerated):
    """Half the error of the best plain estimate, and the disc's edge still steeper than the blurred one's."""
    operator, scene = blurred((32, 32), 1.3), disc((32, 32), 100, 20)
    raw = noisy(operator, scene, rng)
    plain = min(np.mean((lg.deconvolve(raw, operator, n) - scene) ** 2) for n in (5, 10, 20, 40))
    method = RichardsonLucy(TotalVariation(0.05), accelerated=accelerated)
    found = lg.deconvolve(raw, operator, 100, method=method)
    assert np.mean((found - scene) ** 2) < 0.5 * plain
    inside, outside = scene == 100, scene == 20
    assert np.std(found[12:20, 12:20]) < 2
    assert abs(np.median(found[inside]) - 100) < 5
    assert abs(np.median(found[outside]) - 20) < 3
    rise = np.abs(np.diff(found[16])).max() / np.abs(np.diff(operator.forward(scene)[16])).max()
    assert rise > 1.8


def test_voxels_that_are_far_apart_are_smoothed_less_along_that_axis(rng):
    """The same stack, whose planes stand 1 or 20 pitches apart: the jump between planes is spared."""
    shape, grid = (3, 8, 8), lg.Grid.square(8, 1e-6)
    stack = np.ones(shape) * np.array([10.0, 20.0, 10.0])[:, None, None]
    jumps = []
    for step in (1e-6, 20e-6):
        model = placed(np.eye(192), (8, 24), shape, grid, (-step, 0.0, step))
        found = lg.deconvolve(stack.reshape(8, 24), model, 40, method=RichardsonLucy(TotalVariation(0.4)))
        jumps.append(float((found[1] - found[0]).mean()))
    assert jumps[0] < 3
    assert jumps[1] > 9


@pytest.mark.parametrize(
    ("shape", "edges", "left"), [((32, 30), 1, 0.6), ((3, 16, 18), 0, 0.3), ((5, 6), 0, 0.5)]
)
def test_wavelets_remove_noise_and_stay_positive(rng, shape, edges, left):
    """Of a disc and, where it would have too few samples, of an even object."""
    operator = blurred(shape, 1.2)
    scene = disc(shape[-2:], 20 + 40 * edges, 20) * np.ones(shape)
    raw = noisy(operator, scene, rng)
    plain = lg.deconvolve(raw, operator, 60)
    found = lg.deconvolve(raw, operator, 60, method=RichardsonLucy(Wavelets(0.03)))
    assert found.shape == shape
    assert found.min() >= 0
    assert np.mean((found - scene) ** 2) < left * np.mean((plain - scene) ** 2)


def test_wavelets_leave_alone_what_is_above_no_threshold(rng):
    values = rng.normal(size=(13, 22))
    for turn in range(4):
        np.testing.assert_allclose(Wavelets().denoised(values, 0.0, turn), values, atol=1e-12)
    even = Wavelets().denoised(np.full((9, 12), 3.0), 10.0)
    np.testing.assert_allclose(even, 3.0, rtol=1e-12)


@pytest.mark.parametrize("prior", [TotalVariation(0.02), Wavelets(0.02)])
def test_priors_take_any_array_library(xp, rng, prior):
    operator = blurred((12, 13), 1.0)
    raw = noisy(operator, disc((12, 13)), rng)
    expected = lg.deconvolve(raw, operator, 5, method=RichardsonLucy(prior, LowPass(1.5)))
    given = xp.asarray(raw, dtype=xp.float32)
    found = lg.deconvolve(given, operator, 5, method=RichardsonLucy(prior, LowPass(1.5)))
    assert found.dtype == xp.float32
    np.testing.assert_allclose(to_numpy(found), expected, rtol=2e-3, atol=1e-2)


def test_least_squares_finds_what_nnls_finds(rng):
    from scipy.optimize import nnls

    matrix = np.abs(rng.normal(size=(60, 20)))
    operator, weights = Matrix(matrix, (6, 10), (4, 5)), rng.uniform(0.2, 1, (6, 10))
    raw = np.maximum(rng.normal(5, 5, (6, 10)), 0)
    found = lg.deconvolve(raw, operator, 3000, method=LeastSquares(), exposure=Exposure(weights=weights))
    root = np.sqrt(weights.ravel())
    best, _ = nnls(matrix * root[:, None], raw.ravel() * root)
    np.testing.assert_allclose(found.ravel(), best, atol=1e-3)
    assert (best == 0).any()


def test_the_step_is_bounded_by_the_largest_eigenvalue(rng):
    """Not below it, where FISTA would diverge, and at most 2 % above, where it would be slow."""
    operator = Matrix(np.abs(rng.normal(size=(60, 20))), (6, 10), (4, 5))
    exposure = Exposure(0.0, rng.uniform(0.5, 1, (6, 10)), rng.uniform(0, 1, (6, 10)))
    raw = np.ones((6, 10))
    problem = Problem.of(raw, exposure, Scale.of(operator, exposure, raw))
    factor = (exposure.response**2 * exposure.weights).ravel()[:, None]
    true = np.linalg.eigvalsh(operator.matrix.T @ (factor * operator.matrix))[-1]
    assert true <= largest_eigenvalue(problem, problem.flat()) < 1.02 * true


def test_least_squares_with_total_variation_removes_noise(xp, rng):
    operator, scene = blurred((24, 24), 1.3), disc((24, 24), 100, 20)
    raw = operator.forward(scene) + rng.normal(0, 8, scene.shape)
    plain = lg.deconvolve(raw, operator, 20, method=LeastSquares())
    found = lg.deconvolve(xp.asarray(raw), operator, 20, method=LeastSquares(TotalVariation(0.02)))
    assert np.mean((to_numpy(found) - scene) ** 2) < 0.5 * np.mean((plain - scene) ** 2)


def test_the_low_pass_keeps_even_objects_and_removes_what_is_finer(xp):
    """Width 3: a period of 8 samples passes, one of 4 does not; width 1 and below changes nothing."""
    x = np.arange(96)
    waves = {period: 1 + np.cos(2 * np.pi * x / period) * np.ones((96, 1)) for period in (16, 4)}
    for period, kept in ((16, 1.0), (4, 0.0)):
        found = to_numpy(LowPass(3.0)(xp.asarray(waves[period])))[30:60, 30:62]
        assert np.std(found) / np.std(waves[period]) == pytest.approx(kept, abs=0.08)
    stack = xp.asarray(np.stack([waves[4], waves[4]]))
    found = to_numpy(LowPass((3.0, 0.5))(stack))
    np.testing.assert_array_equal(found[1], waves[4])
    np.testing.assert_allclose(to_numpy(LowPass(7.0)(xp.asarray(np.ones((9, 40))))), 1, rtol=1e-12)


@pytest.mark.parametrize(("n", "width"), [(9, 7.0), (50, 2.5), (300, 19.0)])
def test_the_low_pass_is_lanczos_kernel_at_all_places(n, width):
    off = (np.arange(n)[:, None] - np.arange(n)) / width
    expected = np.where(np.abs(off) < 4, np.sinc(off) * np.sinc(off / 4), 0.0)
    expected /= expected.sum(1, keepdims=True)
    np.testing.assert_allclose(lanczos(n, width).down(np.eye(n)), expected, atol=1e-12)


def test_the_low_pass_keeps_the_lattice_out_of_the_estimate(rng):
    """Pixels that see the sum of 4 samples each: what is finer is not measured, and not made up either."""
    pixels = np.kron(np.eye(8), np.ones((1, 4))) / 4
    operator = Matrix(np.kron(pixels, pixels), (8, 8), (32, 32))
    y = np.cos(2 * np.pi * np.arange(32) / 32) * np.ones((32, 1))
    scene = 50 + 30 * y
    raw = operator.forward(scene)
    blocky = lg.deconvolve(raw, operator, 30)
    smooth = lg.deconvolve(raw, operator, 30, method=RichardsonLucy(filter=LowPass(4.0)))
    inner = (slice(8, 24), slice(8, 24))
    assert np.std(smooth[inner] - scene[inner]) < 0.4 * np.std(blocky[inner] - scene[inner])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TotalVariation(0), "strength is 0"),
        (lambda: TotalVariation(spacing=(1, -1)), "spacing is -1"),
        (lambda: TotalVariation(steps=0), "steps is 0"),
        (lambda: Wavelets(-1), "strength is -1"),
        (lambda: Wavelets(name="bior2.2"), "orthogonal wavelet"),
        (lambda: Wavelets(name="haarr"), "name is 'haarr'"),
        (lambda: Wavelets(levels=0), "levels is 0"),
        (lambda: LowPass(-1), "at least 0 samples"),
        (lambda: LowPass((1.0, np.nan)), "widths is nan"),
        (lambda: LowPass((1.0, 2.0, 3.0))(np.ones((2, 4, 4))), "3 widths for 2 planes"),
        (lambda: LeastSquares(start=-np.ones((2, 2))), "start goes down to -1"),
        (lambda: Stop(1.5), "iterations is 1.5"),
    ],
)
def test_impossible_settings_are_refused(call, message):
    with pytest.raises(lg.LumigraphError, match=message):
        call()


def test_spacing_must_fit_the_object():
    method = RichardsonLucy(TotalVariation(spacing=(1, 1, 1)))
    with pytest.raises(lg.GeometryError, match="spacing has 3 numbers but the object has 2 axes"):
        lg.deconvolve(np.ones((2, 2)), blurred((2, 2), 1), 1, method=method)
