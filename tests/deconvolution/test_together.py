"""Several raw images of one object: stacks of operators, weights by their noise, what is refused."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse import eye_array

import lumigraph as lg
from deconvolution.models import Matrix, blur, blurred, disc, placed
from lumigraph.core.joint import Joint
from lumigraph.deconvolution import (
    Exposure,
    Interrupted,
    LeastSquares,
    RichardsonLucy,
    Stop,
    deconvolve_series,
)
from lumigraph.deconvolution.beyond import beyond, looks_beyond

SHAPE = (14, 13)
SHARP, SOFT = blurred(SHAPE, 1.0), blurred(SHAPE, 1.6)
EYE = Matrix(np.eye(6), (2, 3), (2, 3))


def test_the_adjoint_of_a_joint_operator_is_its_transpose(rng):
    other = Matrix(rng.random((20, 14 * 13)), (4, 5), SHAPE)
    operator = Joint((SHARP, other, SOFT))
    x, y = rng.random(SHAPE), rng.random(operator.shape[0])
    assert operator.shape == ((2 * 14 * 13 + 20,), SHAPE)
    assert np.vdot(operator.forward(x), y) == pytest.approx(np.vdot(x, operator.adjoint(y)), rel=1e-12)
    whole = np.concatenate([part.matrix for part in operator.maps])
    np.testing.assert_allclose(operator.forward(x), whole @ x.ravel(), rtol=1e-12)
    assert [part.shape for part in operator.parted(y)] == [SHAPE, (4, 5), SHAPE]


@pytest.mark.parametrize("method", [RichardsonLucy(), RichardsonLucy(accelerated=True), LeastSquares()])
def test_raw_images_that_were_not_moved_are_one_long_exposure(method, rng):
    raws = list(rng.poisson(SHARP.forward(disc(SHAPE)), (3, *SHAPE)).astype(float))
    found = lg.deconvolve(raws, [SHARP] * 3, 12, method=method)
    np.testing.assert_allclose(3 * found, lg.deconvolve(sum(raws), SHARP, 12, method=method), rtol=1e-9)


def test_each_raw_image_counts_by_its_electrons(rng):
    """Of even samples the likeliest object is all electrons over all that an intensity of 1 sends."""
    gains, lights = (2.0, 0.5, 8.0), (1.0, 0.25, 4.0)
    exposures = [Exposure(gain=g, light=t) for g, t in zip(gains, lights, strict=True)]
    sent = [gains[0] * t * 50.0 for t in lights]
    electrons = [rng.poisson(n, (2, 3)).astype(float) for n in sent]
    raws = [n / g for n, g in zip(electrons, gains, strict=True)]
    found = lg.deconvolve(raws, [EYE] * 3, 3, exposure=exposures)
    np.testing.assert_allclose(found, sum(electrons) / (gains[0] * sum(lights)), rtol=1e-5)


def test_the_noise_reaches_its_lower_bound_where_equal_weights_do_not(rng):
    """Two cameras, of which one counts each electron and the other reads them with a noise of 30."""
    n, truth = (100, 300), 40.0
    noises, backgrounds = (1.0, 30.0), (0.0, 20.0)
    exposures = [
        Exposure(gain=1.0, read_noise=s, background=b) for s, b in zip(noises, backgrounds, strict=True)
    ]
    read = [rng.poisson(truth + b, n) + rng.normal(0, s, n) for s, b in zip(noises, backgrounds, strict=True)]
    eye = Matrix(eye_array(30000, format="csr"), n, n)
    found = lg.deconvolve(read, [eye, eye], 200, exposure=exposures)
    variances = [truth + b + s**2 for s, b in zip(noises, backgrounds, strict=True)]
    bound = 1 / sum(1 / v for v in variances)
    assert np.var(found) == pytest.approx(bound, rel=0.03)
    assert found.mean() == pytest.approx(truth, abs=0.2)
    assert np.var((read[0] + read[1]) / 2) > 5 * bound


def test_a_background_of_one_raw_image_leaves_the_likeliest_object(rng):
    reads, dark, light = (37.0, 90.0), (0.0, 60.0), (1.0, 0.7)
    exposures = [Exposure(background=b, gain=1.0, light=t) for b, t in zip(dark, light, strict=True)]
    one = Matrix(np.ones((1, 1)), (1, 1), (1, 1))
    found = lg.deconvolve([np.full((1, 1), r) for r in reads], [one, one], 400, exposure=exposures)

    def slope(o):
        return sum(t * r / (t * o + b) - t for r, b, t in zip(reads, dark, light, strict=True))

    assert float(found[0, 0]) == pytest.approx(brentq(slope, 1, 200), rel=1e-5)


def test_exposures_of_a_camera_are_taken_as_recorded(rng):
    """Eight times as long with an eighth of the gain, and on a black level: one object explains both."""
    light = SHARP.forward(disc(SHAPE)) / 100
    short = lg.Sensor(SHAPE, 5e-6, 2000.0, 2.0, 16)
    long = lg.Sensor(SHAPE, 5e-6, 16000.0, 9.0, 12, black_level=100.0, dark_current=30, exposure_time=2.0)
    raws = [
        short.expose(light, photons=1000, rng=rng),
        long.expose(light, photons=8000, rng=rng),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = lg.deconvolve(raws, [SHARP, SHARP], Stop(200, deviance=1.0))
    values = disc(SHAPE) / 100 * 1000 / short.gain
    assert found.mean() == pytest.approx(values.mean(), rel=0.01)
    alone = lg.deconvolve(raws[0], SHARP, Stop(200, deviance=1.0))
    inside = np.s_[2:-2, 2:-2]
    errors = [float(np.std((o - values)[inside])) for o in (found, alone)]
    assert errors[0] < 0.8 * errors[1]


def test_a_raw_image_of_other_light_is_warned_of(rng):
    raws = list(rng.poisson(SHARP.forward(disc(SHAPE)), (3, *SHAPE)).astype(float))
    raws[2] = 1.5 * raws[2]
    with pytest.warns(lg.SamplingWarning, match=r"are 0\.8\d+, 0\.8\d+, 1\.\d+ times as bright"):
        lg.deconvolve(raws, [SHARP] * 3, 5)
    lights = [Exposure(light=t) for t in (1, 1, 1.5)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lg.deconvolve(raws, [SHARP] * 3, 5, exposure=lights)


def test_dead_pixels_of_one_raw_image_are_seen_by_the_others():
    raws = [SHARP.forward(disc(SHAPE))] * 2
    dead = np.zeros(SHAPE)
    dead[5:9, 4:9] = 1
    spoilt = np.where(dead > 0, np.nan, raws[0])
    exposures = [Exposure(weights=1 - dead), Exposure()]
    found = lg.deconvolve([spoilt, raws[1]], [SHARP] * 2, 200, exposure=exposures)
    blind, other = (
        lg.deconvolve(spoilt, SHARP, 200, exposure=exposures[0]),
        lg.deconvolve(raws[1], SHARP, 200),
    )
    errors = [float(np.std((o - other)[5:9, 4:9])) for o in (found, blind)]
    assert errors[0] < 0.2 * errors[1]


def test_a_killed_run_of_several_goes_on_and_series_of_them_begin_warm(rng, tmp_path):
    raws = [rng.poisson(part.forward(disc(SHAPE))).astype(np.float32) for part in (SHARP, SOFT)]
    whole = lg.deconvolve(raws, [SHARP, SOFT], 8)
    assert whole.dtype == np.float32

    def killed(step):
        if step.iteration == 3:
            raise KeyboardInterrupt

    path = tmp_path / "run.npz"
    with pytest.raises(Interrupted):
        lg.deconvolve(raws, [SHARP, SOFT], 8, progress=killed, checkpoint=path)
    np.testing.assert_array_equal(lg.deconvolve(raws, [SHARP, SOFT], 8, checkpoint=path), whole)
    first, second = deconvolve_series([raws, raws], Joint((SHARP, SOFT)), 8, warm=True)
    np.testing.assert_array_equal(first, whole)
    assert np.abs(second - whole).max() > 0


def test_a_picture_stands_where_the_object_does():
    grid = lg.Grid(SHAPE, 2e-6, (1e-6, 0.0))
    operator = placed(SHARP.matrix, SHAPE, SHAPE, grid)
    raws = [lg.RawImage(operator.forward(disc(SHAPE)), metadata={"wavelength": 5e-7})] * 2
    found = lg.deconvolve(raws, [operator, operator], 3)
    assert isinstance(found, lg.RawImage)
    assert found.pixel_pitch == 2e-6
    assert found.metadata["center"] == (1e-6, 0.0)


class Wide(Matrix):
    """A blur that sees one sample more on one side of each axis."""

    __slots__ = ()

    def widened(self, least):
        rows, columns = self.object_shape
        more = np.kron(blur(rows + 1, 1.0)[1:], blur(columns + 2, 1.0)[1:-1])
        whole = Matrix(more, self.raw_shape, (rows + 1, columns + 2))
        return whole, (slice(1, 1 + rows), slice(1, 1 + columns))


def test_objects_reach_as_far_as_any_of_the_raw_images_sees(rng):
    wide = Wide(SHARP.matrix, SHAPE, SHAPE)
    operator, inside = beyond(Joint((SOFT, wide)))
    assert looks_beyond(Joint((SOFT, wide)))
    assert not looks_beyond(Joint((SOFT, SHARP)))
    assert operator.shape[1] == (15, 15)
    assert inside == (slice(1, 15), slice(1, 14))
    x, y = rng.random((15, 15)), rng.random(operator.shape[0])
    np.testing.assert_allclose(operator.maps[0].forward(x), SOFT.forward(x[inside]), rtol=1e-12)
    assert np.vdot(operator.forward(x), y) == pytest.approx(np.vdot(x, operator.adjoint(y)), rel=1e-12)
    raws = [SOFT.forward(disc(SHAPE)), wide.forward(disc(SHAPE))]
    assert lg.deconvolve(raws, [SOFT, wide], 3).shape == SHAPE


HERE = replace(SHARP, object_grid=lg.Grid(SHAPE, 1e-6))
THERE = replace(SHARP, object_grid=lg.Grid(SHAPE, 1e-6, (3e-7, 0.0)))
DEEP = Matrix(np.ones((6, 12)), (2, 3), (2, 2, 3), depths=(0.0, 1.0))
DEEPER = replace(DEEP, depths=(0.0, 2.0))
RAW = np.ones(SHAPE)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (lambda: lg.deconvolve([RAW], [SHARP, SOFT]), "1 raw images but 2 operators"),
        (lambda: lg.deconvolve(RAW, [SHARP, SOFT]), "makes 2 raw images but one ndarray"),
        (lambda: lg.deconvolve([RAW, RAW], SHARP), "not a list of 2.*deconvolve_series"),
        (
            lambda: lg.deconvolve([RAW, RAW[1:]], [SHARP, SOFT]),
            r"\(13, 13\) but the operator makes \(14, 13\)",
        ),
        (lambda: lg.deconvolve([], []), "there are no maps"),
        (lambda: lg.deconvolve([RAW, RAW], [SHARP, EYE]), r"shape \(14, 13\) but operator 1 of \(2, 3\)"),
        (lambda: lg.deconvolve([RAW, RAW], [HERE, THERE]), "Bring them onto one grid"),
        (lambda: lg.deconvolve([RAW, RAW], [DEEP, DEEPER]), "Give one set of depths"),
        (lambda: lg.deconvolve([RAW, RAW], [SHARP, np.eye(3)]), "operator 1 is of type ndarray"),
        (
            lambda: lg.deconvolve([RAW, RAW], [SHARP, SOFT], exposure=[Exposure()]),
            "one Exposure, or 2 of them",
        ),
        (
            lambda: lg.deconvolve([RAW, RAW], [SHARP, SOFT], exposure=[Exposure(), 3.0]),
            "an exposure is of type float",
        ),
        (
            lambda: lg.deconvolve([RAW, RAW], [SHARP, SOFT], exposure=[Exposure(gain=2.0), Exposure()]),
            "the gain of raw image 1 is not known",
        ),
        (lambda: Exposure(light=0.0), "light is 0"),
        (lambda: Exposure(light=float("nan")), "light is nan"),
        (lambda: lg.deconvolve([RAW, RAW * np.nan], [SHARP, SOFT]), "NaN"),
    ],
)
def test_what_is_no_set_of_raw_images_is_refused_in_one_line(what, message):
    with pytest.raises(lg.LumigraphError, match=message):
        what()
