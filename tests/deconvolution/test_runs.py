"""Interruption, checkpoints, time series."""

import itertools

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import lumigraph as lg
from deconvolution.models import Matrix, blurred, disc
from lumigraph import store
from lumigraph.core.arrays import to_numpy
from lumigraph.deconvolution import (
    Deconvolver,
    Exposure,
    Interrupted,
    LeastSquares,
    LowPass,
    RichardsonLucy,
    Stop,
    TotalVariation,
    Wavelets,
)
from lumigraph.deconvolution.checkpoint import Checkpoint
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.problem import Problem, Scale
from lumigraph.store import atomic

SHAPE = (14, 13)
OPERATOR = blurred(SHAPE, 1.2)
BRIGHTER = Matrix(OPERATOR.matrix * 1.01, SHAPE, SHAPE)
METHODS = {
    "plain": RichardsonLucy(),
    "accelerated": RichardsonLucy(accelerated=True),
    "total variation": RichardsonLucy(TotalVariation(0.02), LowPass(1.2), accelerated=True),
    "wavelets": RichardsonLucy(Wavelets(0.02)),
    "least squares": LeastSquares(TotalVariation(0.02)),
}


@pytest.fixture
def raw(rng):
    return rng.poisson(OPERATOR.forward(disc(SHAPE))).astype(np.float32)


def killed_after(iterations):
    def progress(step):
        if step.iteration == iterations:
            raise KeyboardInterrupt

    return progress


def test_products_of_an_iteration_take_one_thread_each(raw):
    """Threads that wait for one another between small products tripled the work on a busy machine."""
    inside = []
    with threadpool_limits(2, "blas"):
        lg.deconvolve(raw, OPERATOR, 2, progress=lambda _: inside.append(_threads()))
        assert _threads() == {2}
    assert inside == [{1}, {1}, {1}]


def _threads():
    return {part["num_threads"] for part in threadpool_info() if part["user_api"] == "blas"}


@pytest.mark.parametrize("name", METHODS)
def test_a_killed_run_goes_on_to_the_same_bits(name, raw, tmp_path):
    method, path = METHODS[name], tmp_path / "state.npz"
    whole = lg.deconvolve(raw, OPERATOR, 12, method=method)
    with pytest.raises(Interrupted):
        lg.deconvolve(raw, OPERATOR, 12, method=method, progress=killed_after(5), checkpoint=path)
    steps = []
    found = lg.deconvolve(raw, OPERATOR, 12, method=method, progress=steps.append, checkpoint=path)
    assert [step.iteration for step in steps] == list(range(5, 13))
    np.testing.assert_array_equal(found, whole)
    assert found.dtype == np.float32
    again = lg.deconvolve(raw, OPERATOR, 12, method=method, progress=steps.append, checkpoint=path)
    np.testing.assert_array_equal(again, whole)
    assert len(steps) == 8
    assert list(tmp_path.iterdir()) == [path]


def test_a_run_killed_without_a_warning_goes_on_from_what_was_written(raw, tmp_path):
    """As by kill -9: the file of the last iteration that was written, here every one, is all there is."""

    class Killed(BaseException):
        pass

    def progress(step):
        if step.iteration == 7:
            raise Killed

    place = Checkpoint(tmp_path / "state.npz", every=0)
    with pytest.raises(Killed):
        lg.deconvolve(raw, OPERATOR, 12, progress=progress, checkpoint=place)
    steps = []
    found = lg.deconvolve(raw, OPERATOR, 12, progress=steps.append, checkpoint=place)
    assert steps[1].iteration == 8
    np.testing.assert_array_equal(found, lg.deconvolve(raw, OPERATOR, 12))


def test_an_interrupted_run_hands_back_what_it_had(raw):
    image = lg.RawImage(raw)
    with pytest.raises(Interrupted, match="after 3 iterations") as stopped:
        lg.deconvolve(image, OPERATOR, 12, progress=killed_after(3))
    assert stopped.value.iterations == 3
    np.testing.assert_array_equal(stopped.value.partial, lg.deconvolve(image, OPERATOR, 3))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda raw: (raw + 1, OPERATOR, METHODS["plain"], None), "raw image or settings"),
        (lambda raw: (raw, OPERATOR, METHODS["accelerated"], None), "raw image or settings"),
        (lambda raw: (raw, OPERATOR, RichardsonLucy(start=np.ones(SHAPE)), None), "raw image or settings"),
        (lambda raw: (raw, OPERATOR, METHODS["plain"], Exposure(1.0)), "raw image or settings"),
        (lambda raw: (raw, OPERATOR, RichardsonLucy(filter=LowPass(2)), None), "raw image or settings"),
        (lambda raw: (raw, BRIGHTER, METHODS["plain"], None), "camera or grid"),
    ],
)  # fmt: skip
def test_the_checkpoint_of_another_run_is_refused(change, what, raw, tmp_path):
    path = tmp_path / "state.npz"
    lg.deconvolve(raw, OPERATOR, 2, checkpoint=path)
    other, operator, method, exposure = change(raw)
    with pytest.raises(lg.FormatError, match=f"belongs to another {what}"):
        lg.deconvolve(other, operator, 2, method=method, exposure=exposure, checkpoint=path)


@pytest.mark.parametrize("content", [b"", b"no zip", None])
def test_a_damaged_checkpoint_is_refused(content, raw, tmp_path):
    path = tmp_path / "state.npz"
    if content is None:
        np.savez(path, other=np.ones(3))
    else:
        path.write_bytes(content)
    with pytest.raises(lg.FormatError, match=r"is damaged|not a checkpoint"):
        lg.deconvolve(raw, OPERATOR, 2, checkpoint=path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("done", np.arange(3)), ("done", np.array("x")), ("done", np.array(-5)), ("done", np.array(np.nan)),
        ("estimate", np.full(SHAPE, "a")), ("estimate", np.zeros(SHAPE, "M8[s]")),
        ("sensitivity", np.array(["a"])), ("memory.pace", np.array("x")),
    ],
)  # fmt: skip
def test_a_checkpoint_of_the_wrong_types_is_refused(name, value, raw, tmp_path):
    """A seal proves that a file is whole, not who wrote it."""
    path = tmp_path / "state.npz"
    lg.deconvolve(raw, OPERATOR, 2, checkpoint=path)
    store.write(path, {**store.read(path), name: value})
    with pytest.raises(lg.FormatError, match="not a checkpoint of a deconvolution"):
        lg.deconvolve(raw, OPERATOR, 2, checkpoint=path)


def test_a_damaged_checkpoint_is_told_and_the_run_starts_anew(raw, tmp_path):
    """2 of 500 damaged ones ended in exceptions of their own."""
    path = tmp_path / "state.npz"
    expected = lg.deconvolve(raw, OPERATOR, 2, checkpoint=path)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 16
    for damaged in (whole[: len(whole) // 3], whole[:-1], bytes(flipped)):
        path.write_bytes(damaged)
        with pytest.warns(RuntimeWarning, match="is damaged: the run starts from the beginning"):
            found = lg.deconvolve(raw, OPERATOR, 2, checkpoint=path)
        np.testing.assert_array_equal(found, expected)
        assert path.read_bytes() == whole


def test_a_disk_that_is_full_costs_the_checkpoint_and_not_the_run(raw, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic, "_take_place", full)
    with pytest.warns(RuntimeWarning, match=r"state.npz was not written: the disk of .* is full"):
        found = lg.deconvolve(raw, OPERATOR, 2, checkpoint=tmp_path / "state.npz")
    np.testing.assert_array_equal(found, lg.deconvolve(raw, OPERATOR, 2))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda path: Checkpoint(path / "x.tif"), r"must end in \.npz"),
        (lambda path: Checkpoint(path / "x.npz", every=-1), "every is -1 s"),
    ],
)
def test_a_checkpoint_that_could_not_be_written_is_refused(call, message, tmp_path):
    with pytest.raises(lg.FormatError, match=message):
        call(tmp_path)


def test_checkpoints_take_any_array_library(xp, raw, tmp_path):
    path = tmp_path / "state.npz"
    given = xp.asarray(raw)
    method = METHODS["total variation"]
    lg.deconvolve(given, OPERATOR, 3, method=method, checkpoint=path)
    found = lg.deconvolve(given, OPERATOR, 6, method=method, checkpoint=path)
    whole = lg.deconvolve(given, OPERATOR, 6, method=method)
    assert type(found) is type(given)
    np.testing.assert_array_equal(to_numpy(found), to_numpy(whole))


def test_a_series_needs_one_sensitivity_and_one_frame_at_a_time(rng):
    """A hundred frames: Aᵀ1 once, each frame read only when its turn has come, results as of one by one."""
    grid, calls, alive = lg.Grid.square(6, 1e-6), [], []

    class Counting(Matrix):
        def adjoint(self, raw):
            calls.append(1)
            return super().adjoint(raw)

    matrix = np.abs(rng.normal(size=(36, 72)))
    operator = Counting(matrix, (6, 6), (2, 6, 6), object_grid=grid, depths=(0.0, 1e-6))
    pictures = [lg.RawImage(rng.uniform(1, 2, (6, 6))) for _ in range(100)]

    def frames():
        for picture in pictures:
            alive.append(1)
            yield picture

    volumes = lg.deconvolve_series(frames(), operator, 2)
    first = list(itertools.islice(volumes, 3))
    assert len(alive) == 3
    assert len(calls) == 3 * 2 + 1
    assert len(list(volumes)) == 97
    assert len(calls) == 100 * 2 + 1
    np.testing.assert_array_equal(first[2].data, lg.deconvolve(pictures[2], operator, 2).data)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_frames_begin_with_an_image_that_they_share(raw, method, monkeypatch):
    """With an uneven response: the first model is that of the even object."""
    asked = []
    forward = Matrix._forward
    monkeypatch.setattr(Matrix, "_forward", lambda self, o: asked.append(o) or forward(self, o))
    camera = Exposure(response=np.linspace(0.5, 1.5, raw.size).reshape(SHAPE), background=3.0)
    deconvolver = Deconvolver(OPERATOR, 1, method=method)
    deconvolver(raw, camera)
    first = len(asked)
    again = deconvolver(2 * raw, camera)
    assert len(asked) == 2 * first - 1
    problem = Problem.of(2 * raw, camera, Scale.of(OPERATOR, camera, raw))
    state = method.step(problem, State.at(problem, problem.flat()))
    np.testing.assert_allclose(again, state.estimate, rtol=2e-5, atol=1e-5 * float(again.max()))


def drifting(rng, count=5):
    """Raw images of a disc that drifts by a quarter of a sample a frame."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    for k in range(count):
        light = OPERATOR.forward(0.01 + 1.0 * (np.hypot(y - 6, x - 4 - 0.25 * k) < 3.2))
        yield rng.poisson(500 * light).astype(np.float32)


def test_a_warm_start_is_as_likely_in_half_of_the_iterations(rng):
    frames, told = list(drifting(rng)), {}
    for name, warm, iterations in (("cold", False, 12), ("half", False, 6), ("warm", True, 6)):
        steps = []
        found = lg.deconvolve_series(frames, OPERATOR, iterations, progress=steps.append, warm=warm)
        first = next(found)
        list(found)
        told[name] = [step.deviance for step in steps if step.iteration == iterations]
    np.testing.assert_array_equal(first, lg.deconvolve(frames[0], OPERATOR, 6))  # begins as it does alone
    assert np.mean(told["warm"][1:]) < np.mean(told["cold"][1:])
    assert np.mean(told["half"][1:]) > 1.2 * np.mean(told["cold"][1:])


def test_a_warm_start_finds_what_appears_in_the_dark():
    """Richardson-Lucy keeps what is 0: some of an even object goes into each start."""
    dark, lit = np.zeros(SHAPE), np.zeros(SHAPE)
    dark[2:5, 2:5], lit[9:12, 8:11] = 1, 1
    frames = [1000 * OPERATOR.forward(one) for one in (dark, lit)]
    engine = Deconvolver(OPERATOR, 3000, warm=True)
    assert engine(frames[0])[9:12, 8:11].max() < 1e-9
    engine.limits = Stop(20)
    second = engine(frames[1])
    assert second[8:13, 7:12].sum() == pytest.approx(9000, rel=0.01)
    assert second[1:6, 1:6].sum() < 90
