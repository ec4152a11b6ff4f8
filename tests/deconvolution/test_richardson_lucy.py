"""Richardson-Lucy: what can be proved of it."""

import time

import numpy as np
import pytest

import lumigraph as lg
from deconvolution.models import Matrix, blur, blurred, disc, placed
from lumigraph.core.arrays import to_numpy
from lumigraph.core.linear import Linear
from lumigraph.deconvolution import Exposure, LeastSquares, RichardsonLucy, Stop
from lumigraph.deconvolution.problem import Problem, Scale

SHAPE = (15, 16)


def noisy(operator, scene, rng, background=0.0):
    return rng.poisson(operator.forward(scene) + background).astype(float)


def deviances(raw, operator, iterations, **options):
    steps = []
    lg.deconvolve(raw, operator, iterations, progress=steps.append, **options)
    return np.array([step.deviance for step in steps])


@pytest.mark.parametrize("shape", [SHAPE, (3, 11, 10)])
def test_the_likelihood_never_falls(shape, rng):
    operator = blurred(shape, 1.3)
    scene = rng.uniform(0, 50, shape)
    raw = noisy(operator, scene, rng, background=4.0)
    weights = rng.uniform(0, 1, operator.shape[0])
    response = rng.uniform(0.2, 1.5, operator.shape[0])
    for exposure in (
        Exposure(4.0),
        Exposure(4.0, response, weights),
        Exposure(weights=weights, gain=1, read_noise=3),
    ):
        for accelerated in (False, True):
            method = RichardsonLucy(accelerated=accelerated)
            found = deviances(raw, operator, 60, exposure=exposure, method=method)
            assert np.all(np.diff(found) <= 1e-12 * found[0])


def test_momentum_never_lowers_the_likelihood_where_it_would_overshoot():
    """A few equations of many unknowns, seen to overshoot 76 times in 400 steps without the plain step."""
    rng = np.random.default_rng(0)
    operator = Matrix(np.abs(rng.normal(size=(40, 30))) ** 3, (5, 8), (5, 6))
    raw = noisy(operator, rng.uniform(0, 1, (5, 6)), rng)
    found = deviances(raw, operator, 400, method=RichardsonLucy(accelerated=True))
    assert np.all(np.diff(found) <= 1e-12 * found[0])


def test_the_light_is_kept(rng):
    """Each step maps Σ Aᵀw·o to Σ w·r, where there is no background: an unnormalised RL is off by 1 - w."""
    operator = blurred(SHAPE, 1.0)
    raw, weights = noisy(operator, disc(SHAPE), rng), rng.uniform(0.2, 1, SHAPE)
    found = lg.deconvolve(raw, operator, 3, exposure=Exposure(weights=weights))
    light = (operator.adjoint(weights) * found).sum()
    assert light == pytest.approx((weights * raw).sum(), rel=3e-6)  # the model's floor


def test_a_known_object_comes_back_where_nothing_forbids_it(rng):
    """A well-conditioned matrix with more pixels than samples, no noise."""
    matrix = np.abs(rng.normal(size=(80, 24))) ** 3
    operator, scene = Matrix(matrix, (8, 10), (4, 6)), rng.uniform(1, 5, (4, 6))
    found = lg.deconvolve(operator.forward(scene), operator, 3000, method=RichardsonLucy(accelerated=True))
    assert np.max(np.abs(found - scene)) < 2e-3


def test_background_response_and_dead_pixels_are_told_from_light(rng):
    """The same object, seen through all of them; ignoring any one is off by more than 10 %."""
    matrix = np.abs(rng.normal(size=(80, 12))) ** 2
    operator, scene = Matrix(matrix, (8, 10), (3, 4)), rng.uniform(1, 5, (3, 4))
    background, response = rng.uniform(2, 8, (8, 10)), rng.uniform(0.3, 1, (8, 10))
    raw = response * operator.forward(scene) + background
    weights = np.ones((8, 10))
    weights[2, 3], raw[2, 3] = 0, np.nan
    weights[5, 5], raw[5, 5] = 0, 1e6
    exposure = Exposure(background, response, weights)
    found = lg.deconvolve(raw, operator, 3000, exposure=exposure, method=RichardsonLucy(accelerated=True))
    assert np.max(np.abs(found - scene)) < 0.02


def test_samples_that_nothing_sees_stay_dark(rng):
    matrix = np.abs(rng.normal(size=(30, 6)))
    matrix[:, 2] = 0
    found = lg.deconvolve(np.ones((5, 6)), Matrix(matrix, (5, 6), (2, 3)), 5)
    assert found[0, 2] == 0
    assert found.sum() > 0


def test_the_deviance_of_the_truth_is_one_in_electrons(rng):
    """Photon and read noise together, whatever the unit of the raw image; without the σ²/g it is 1.7."""
    operator, gain, noise = blurred((30, 30), 1.0), 2.5, 6.0
    scene = disc((30, 30), 60, 30)
    electrons = rng.poisson(gain * (operator.forward(scene) + 5)) + rng.normal(0, noise, (30, 30))
    exposure = Exposure(5.0, gain=gain, read_noise=noise)
    steps = []
    method = RichardsonLucy(start=scene)
    lg.deconvolve(electrons / gain, operator, 1, method=method, exposure=exposure, progress=steps.append)
    assert steps[0].deviance == pytest.approx(1, abs=0.15)  # 3 standard deviations of 900 pixels


def test_one_step_is_written_down_with_background_and_read_noise():
    """o A'((r + c)/(A o + b + c)) / A'1 with c = σ²/g; without c in the model the step is a third larger."""
    matrix, start = np.array([[2.0, 1.0], [1.0, 3.0], [0.5, 0.5]]), np.array([4.0, 6.0])
    raw, b, c = np.array([20.0, 30.0, 9.0]), 3.0, 6.0**2 / 4.0
    found = lg.deconvolve(
        raw[:, None], Matrix(matrix, (3, 1), (2, 1)), 1,
        method=RichardsonLucy(start=start[:, None]), exposure=Exposure(b, gain=4.0, read_noise=6.0),
    )  # fmt: skip
    expected = start * (matrix.T @ ((raw + c) / (matrix @ start + b + c))) / matrix.sum(0)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-4)


@pytest.mark.parametrize(("part", "seen"), [(2e-3, True), (5e-4, False)])
def test_samples_of_a_thousandth_of_the_light_are_the_faintest_that_count(part, seen):
    """What sends less is left dark: its few photons would be amplified without end."""
    matrix = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 2 * part]])
    found = lg.deconvolve(np.array([[5.0], [5.0], [5.0]]), Matrix(matrix, (3, 1), (2, 1)), 3)
    assert (found[1, 0] > 0) == seen


def test_it_stops_where_noise_would_be_fitted(rng):
    """The stopped estimate is nearer to the truth than one of ten times as many iterations."""
    operator = blurred((24, 24), 1.6)
    scene = operator.forward(disc((24, 24), 200, 20))  # without edges that it could not find anyway
    raw, steps = noisy(operator, scene, rng), []
    exposure = Exposure(gain=1.0)
    stopped = lg.deconvolve(raw, operator, Stop(500, deviance=1.0), exposure=exposure, progress=steps.append)
    assert steps[-1].deviance <= 1 < steps[-2].deviance
    assert "deviance" in steps[-1].stopped
    assert steps[-1].remaining == 0
    longer = lg.deconvolve(raw, operator, 10 * len(steps), exposure=exposure)
    assert np.sum((stopped - scene) ** 2) < 0.4 * np.sum((longer - scene) ** 2)


def test_it_stops_where_little_changes(rng):
    operator, steps = blurred(SHAPE, 1.0), []
    lg.deconvolve(noisy(operator, disc(SHAPE), rng), operator, Stop(500, change=0.01), progress=steps.append)
    assert steps[-1].change < 0.01 <= steps[-2].change
    assert "change" in steps[-1].stopped
    assert len(steps) < 100


def test_time_and_memory_are_said_before_the_first_iteration(rng):
    """A product takes 0.02 s here, so that 50 iterations are foreseen to take two seconds."""
    steps = []

    class Slow(Matrix):
        def forward(self, x):
            time.sleep(0.02)
            return super().forward(x)

    operator = Slow(np.kron(blur(SHAPE[0], 1.0), blur(SHAPE[1], 1.0)), SHAPE, SHAPE)
    lg.deconvolve(noisy(operator, disc(SHAPE), rng), operator, Stop(50, change=0.9), progress=steps.append)
    first, second = steps[:2]
    assert first.announces
    assert not second.announces
    assert (first.iteration, first.iterations, first.elapsed) == (0, 50, 0.0)
    assert 2.0 <= first.remaining < 5.0
    assert first.memory >= operator.memory_bytes + 4 * 8 * np.prod(SHAPE)


def test_progress_counts_and_tells_the_time_left(rng):
    operator, steps = blurred(SHAPE, 1.0), []
    lg.deconvolve(noisy(operator, disc(SHAPE), rng), operator, 4, progress=steps.append)
    assert [step.iteration for step in steps] == [0, 1, 2, 3, 4]
    assert steps[2].remaining == pytest.approx(steps[2].elapsed)
    assert steps[-1].stopped == "4 iterations"


def test_momentum_saves_two_thirds_of_the_steps(rng):
    operator = blurred((24, 24), 1.8)
    raw = noisy(operator, disc((24, 24), 1000, 50), rng)
    plain = deviances(raw, operator, 150)
    quick = deviances(raw, operator, 50, method=RichardsonLucy(accelerated=True))
    assert quick[-1] < plain[-1]


def test_any_array_library_and_precision(xp, rng):
    operator = blurred(SHAPE, 1.0)
    raw = noisy(operator, disc(SHAPE), rng)
    weights = rng.uniform(0.5, 1, SHAPE)
    exposure, method = Exposure(1.0, weights=weights), RichardsonLucy(accelerated=True)
    expected = lg.deconvolve(raw, operator, 8, exposure=exposure, method=method)
    for dtype, tolerance in ((xp.float64, 1e-9), (xp.float32, 1e-3)):
        given = xp.asarray(raw, dtype=dtype)
        found = lg.deconvolve(given, operator, 8, exposure=exposure, method=method)
        assert type(found) is type(given)
        assert found.dtype == dtype
        np.testing.assert_allclose(to_numpy(found), expected, rtol=tolerance)
        np.testing.assert_array_equal(to_numpy(given), to_numpy(xp.asarray(raw, dtype=dtype)))


def test_whole_numbers_are_taken_as_they_were_read(rng):
    operator = blurred(SHAPE, 1.0)
    raw = rng.poisson(operator.forward(disc(SHAPE))).astype(np.uint16)
    found = lg.deconvolve(raw, operator, 3)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, lg.deconvolve(raw.astype(float), operator, 3), rtol=1e-4)


def test_a_raw_image_gives_a_picture_or_a_volume_with_its_place(rng):
    grid = lg.Grid((6, 7), 2e-6, (1e-6, 0.0))
    flat = placed(np.kron(blur(6, 1), blur(7, 1)), (6, 7), (6, 7), grid)
    picture = lg.deconvolve(lg.RawImage(np.ones((6, 7))), flat, 2)
    assert isinstance(picture, lg.RawImage)
    assert picture.pixel_pitch == pytest.approx(2e-6)
    assert picture.metadata["center"] == (1e-6, 0.0)
    deep = placed(np.abs(rng.normal(size=(42, 84))), (6, 7), (2, 6, 7), grid, (-1e-6, 3e-6))
    volume = lg.deconvolve(lg.RawImage(np.ones((6, 7))), deep, 2)
    assert isinstance(volume, lg.Volume)
    assert volume.depths == (-1e-6, 3e-6)
    assert isinstance(lg.deconvolve(np.ones((6, 7)), deep, 2), np.ndarray)


def test_an_exposed_sensor_tells_its_noise():
    raw = lg.Sensor((4, 5), 5e-6, full_well=8000, read_noise=3, bits=10).expose(np.ones((4, 5)))
    exposure = Exposure.of(raw, background=2.0)
    assert exposure.gain == pytest.approx(8000 / 1023)
    assert exposure.offset == pytest.approx(9 / (8000 / 1023))
    assert exposure.background == 2.0


def test_a_black_level_has_no_noise_of_its_own(rng):
    """In a dim picture on 100 counts; counted as light they would leave a deviance of .3."""
    sensor = lg.Sensor(
        (30, 30),
        5e-6,
        full_well=8000,
        read_noise=6,
        bits=12,
        black_level=100,
        dark_current=40,
        exposure_time=1,
    )
    operator, scene = blurred((30, 30), 1.0), disc((30, 30), 60, 30)
    raw, steps = sensor.expose(operator.forward(scene), reference=1.0, fill=2 / 8000, rng=rng), []
    exposure = Exposure.of(raw)
    assert exposure.background == pytest.approx(100 + 40 / sensor.gain)
    method = RichardsonLucy(start=scene * 2 / sensor.gain)
    lg.deconvolve(raw, operator, 1, method=method, exposure=exposure, progress=steps.append)
    assert steps[0].deviance == pytest.approx(1, abs=0.15)  # 3 standard deviations of 900 pixels


def test_the_light_of_a_raw_image_is_what_its_counted_pixels_tell_above_the_background(rng):
    light, response = rng.uniform(1, 9, (4, 5)), rng.uniform(0.5, 1, (4, 5))
    weights = np.ones((4, 5))
    weights[1, 2], response[3, 3] = 0, 0
    raw = response * light + 120.0
    raw[1, 2], raw[0, 0] = np.nan, 90.0
    known = {"background": 120.0, "black_level": 100.0, "gain": 2.0, "read_noise": 3.0}
    exposure = Exposure(**known, response=response, weights=weights)
    operator = Matrix(np.eye(20), (4, 5), (4, 5))
    problem = Problem.of(raw, exposure, Scale.of(operator, exposure, raw))
    light[1, 2] = light[3, 3] = light[0, 0] = 0
    np.testing.assert_allclose(problem.light, light, atol=1e-9)


ONES = Matrix(np.ones((6, 4)), (2, 3), (2, 2))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: lg.deconvolve(np.ones((3, 3)), ONES), r"shape \(3, 3\) but the operator makes \(2, 3\)"),
        (lambda: lg.deconvolve(np.ones((2, 3, 3)), ONES), "one colour at a time"),
        (lambda: lg.deconvolve(lg.RawImage(np.ones((2, 3)), bayer="RGGB"), ONES), "RGGB mosaic"),
        (lambda: lg.deconvolve(np.full((2, 3), np.nan), ONES), "6 NaN or infinite"),
        (lambda: lg.deconvolve(np.zeros((2, 3)), ONES), "the raw image is dark"),
        (lambda: lg.deconvolve(np.ones((2, 3)) * 1j, ONES), "complex"),
        (lambda: lg.deconvolve([[1.0]], ONES), "must be an array"),
        (lambda: lg.deconvolve(np.ones((2, 3)), ONES, 0), "iterations is 0"),
        (lambda: lg.deconvolve(np.ones((2, 3)), Matrix(np.zeros((6, 4)), (2, 3), (2, 2))), "no light"),
        (
            lambda: lg.deconvolve(np.ones((2, 3)), ONES, method=RichardsonLucy(start=np.ones((3, 2)))),
            r"start has shape \(3, 2\) but the object has \(2, 2\)",
        ),
        (lambda: RichardsonLucy(start=-np.ones((3, 2))), "start goes down to -1"),
        (lambda: RichardsonLucy(start=np.full(3, np.inf)), "3 NaN or infinite"),
        (lambda: Stop(deviance=0), "deviance is 0 but"),
        (lambda: Stop(change=-1), "change is -1 but"),
        (lambda: Exposure(-1.0), "background goes from -1"),
        (lambda: Exposure(np.nan), "background is nan"),
        (lambda: Exposure(weights=np.full((2, 2), 2.0)), "weights goes from 2 to 2 but must be from 0 to 1"),
        (lambda: Exposure(gain=0), "gain is 0"),
        (lambda: Exposure(read_noise=1), "needs the gain"),
        (lambda: Exposure(2.0, black_level=3.0), "black_level is 3 but must lie between 0 and"),
        (lambda: lg.deconvolve(np.ones((2, 3)), object()), "operator is of type object but must be a Linear"),
        (lambda: lg.deconvolve(np.ones((2, 3)), ONES, method="rl"), "method is of type str but must"),
        (lambda: lg.deconvolve(np.ones((2, 3)), ONES, exposure=3), "exposure is of type int"),
        (lambda: lg.deconvolve(np.ones((2, 3)), ONES, checkpoint=3), "checkpoint is of type int"),
        (lambda: list(lg.deconvolve_series([], object())), "operator is of type object"),
        (lambda: RichardsonLucy(3), "prior is of type int but must have shrink"),
        (lambda: RichardsonLucy(filter=3), "filter is of type int"),
        (lambda: LeastSquares(3), "prior is of type int but must be a TotalVariation"),
        (
            lambda: lg.deconvolve(np.ones((2, 3)), ONES, exposure=Exposure(weights=np.ones((3, 3)))),
            r"weights has shape \(3, 3\) but the raw image \(2, 3\)",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_deconvolved_is_refused_in_one_line(call, message):
    with pytest.raises(lg.LumigraphError, match=message) as caught:
        call()
    assert str(caught.value).count("\n") <= 1


def test_an_object_that_cannot_fit_is_refused_before_it_is_made():
    class Huge(Linear):
        shape = ((2, 3), (10**6, 10**6))
        _forward = _adjoint = None

    with pytest.raises(lg.SamplingError, match="1000000 x 1000000 samples needs"):
        lg.deconvolve(np.ones((2, 3)), Huge())


@pytest.mark.parametrize("accelerated", [False, True])
def test_a_filter_that_would_make_the_fit_far_worse_is_left_out_of_the_step(rng, accelerated):
    """One that moves the factor aside: voxels grow that their own light speaks against, without end."""
    operator = blurred((14, 13), 1.2)
    raw = rng.poisson(operator.forward(disc((14, 13)))).astype(np.float32)
    method = RichardsonLucy(filter=lambda factor: np.roll(factor, 3, -1), accelerated=accelerated)
    found = np.array(deviances(raw, operator, 60, method=method))
    assert (found[1:] <= 1.02 * found[:-1]).all()
    assert found[-1] < found[0]
