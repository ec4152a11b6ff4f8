import numpy as np
import pytest

from lumigraph.core import arrays, checks
from lumigraph.errors import LumigraphError


def test_like_takes_library_and_precision_from_the_array(xp):
    single = xp.asarray(np.ones(2, np.complex64))
    double = xp.asarray(np.ones(2, np.float64))
    phase = np.exp(1j * np.arange(3.0))
    for like, real, kind in ((single, "float32", "complex64"), (double, "float64", "complex128")):
        assert str(arrays.like(np.arange(3.0), like).dtype).endswith(real)
        assert str(arrays.like(phase, like).dtype).endswith(kind)
        assert isinstance(arrays.like(phase, like), type(like))


def test_intensity_is_the_squared_modulus(xp):
    values = arrays.intensity(xp.asarray(np.array([3 + 4j, 1j])))
    np.testing.assert_allclose(arrays.to_numpy(values), [25, 1])


@pytest.mark.parametrize(("forward", "back"), [(arrays.fft, arrays.ifft), (arrays.fft2, arrays.ifft2)])
def test_transforms_agree_with_numpy_and_leave_their_input(xp, forward, back, rng):
    data = rng.normal(size=(6, 10)) + 1j * rng.normal(size=(6, 10))
    array = xp.asarray(data.copy())
    result = forward(array)
    expected = np.fft.fft(data) if forward is arrays.fft else np.fft.fft2(data)
    np.testing.assert_allclose(arrays.to_numpy(result), expected, atol=1e-12)
    np.testing.assert_array_equal(arrays.to_numpy(array), data)
    np.testing.assert_allclose(arrays.to_numpy(back(result)), data, atol=1e-12)


@pytest.mark.parametrize("shape", [(5, 4), (3, 5, 4)])
def test_planes_one_at_a_time_give_what_all_at_once_give(xp, rng, shape):
    one, other = (xp.asarray(rng.random(shape)) for _ in range(2))
    found = arrays.by_part(lambda a, b: xp.where(a > b, a - b, 0 * a), one, other)
    expected = np.maximum(arrays.to_numpy(one) - arrays.to_numpy(other), 0)
    np.testing.assert_array_equal(arrays.to_numpy(found), expected)
    assert found.dtype == one.dtype
    total = arrays.sum_by_part(lambda a, b: a * b, one, other)
    assert total == pytest.approx(np.vdot(arrays.to_numpy(one), arrays.to_numpy(other)), rel=1e-12)


def test_nan_and_infinity_are_counted_and_located(xp):
    values = np.ones((3, 4))
    values[1, 2], values[2, 0] = np.nan, np.inf
    with pytest.raises(LumigraphError, match=r"the raw image has 2 NaN or infinite values of 12, .*\(1, 2\)"):
        checks.finite_array("the raw image", xp.asarray(values))
    checks.finite_array("counts", xp.asarray(np.ones(3, np.int32)))
