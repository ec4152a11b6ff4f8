import numpy as np
import pytest

from lumigraph.core.arrays import to_numpy
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError

GRID = Grid((3, 5), (0.5, 0.25))


@pytest.mark.parametrize("name", ["complex64", "complex128"])
def test_a_field_keeps_its_library_and_precision(xp, name):
    data = xp.asarray((np.arange(15).reshape(3, 5) * (1 + 2j)).astype(name))
    field = Field(data, GRID, 633e-9) * 2
    assert isinstance(field.data, type(data))
    assert str(field.data.dtype).endswith(name)
    assert str(field.intensity.dtype).endswith("float32" if name == "complex64" else "float64")
    expected = 4 * 5 * np.arange(15.0).reshape(3, 5) ** 2
    np.testing.assert_allclose(to_numpy(field.intensity), expected, rtol=1e-6)
    assert float(field.power) == pytest.approx(expected.sum() * 0.5 * 0.25)


def test_real_data_becomes_complex_of_its_precision(xp):
    assert str(Field(xp.asarray(np.ones((3, 5), np.float32)), GRID, 1e-6).data.dtype).endswith("complex64")


def test_power_keeps_the_batch_axes():
    assert Field(np.ones((2, 4, 3, 5)), GRID, 1e-6).power.shape == (2, 4)


def test_multiplying_leaves_the_input_as_it_was():
    data = np.ones((3, 5), complex)
    _ = Field(data, GRID, 1e-6) * np.zeros((3, 5))
    assert (data == 1).all()


def test_a_field_refuses_data_of_another_shape_and_impossible_wavelengths():
    with pytest.raises(GeometryError, match=r"data has shape \(5, 3\) but the grid has \(3, 5\)"):
        Field(np.ones((5, 3)), GRID, 1e-6)
    with pytest.raises(GeometryError, match="wavelength is -1e-06 m but must be above 0 m"):
        Field(np.ones((3, 5)), GRID, -1e-6)
