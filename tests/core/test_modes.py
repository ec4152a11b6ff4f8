import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.errors import GeometryError

GRID = Grid((4, 5), 2.0)


def waves(count, wavelength=500e-9, grid=GRID):
    data = np.random.default_rng(count).normal(size=(2, count, *grid.shape))
    return Field(data[0] + 1j * data[1], grid, wavelength)


def test_intensities_and_powers_of_modes_and_wavelengths_add():
    light = CoherentModes([waves(3), waves(2, 600e-9)], 0.1)
    expected = (np.abs(waves(3).data) ** 2).sum(0) + (np.abs(waves(2).data) ** 2).sum(0)
    np.testing.assert_allclose(light.intensity, expected)
    assert float(light.power) == pytest.approx(expected.sum() * 4)
    assert (light.count, light.wavelengths, light.error) == (5, (500e-9, 600e-9), 0.1)


def test_each_mode_goes_through_an_element_and_the_error_stays():
    light = CoherentModes(waves(3), 0.2).through(lambda field: field * 2j)
    np.testing.assert_allclose(light.fields[0].data, 2j * waves(3).data)
    assert light.error == 0.2


def test_one_field_is_one_mode():
    assert CoherentModes(Field(np.ones(GRID.shape), GRID, 500e-9)).fields[0].data.shape == (1, 4, 5)


def test_what_are_no_modes_is_refused():
    with pytest.raises(GeometryError, match="no fields"):
        CoherentModes([])
    with pytest.raises(GeometryError, match="must be a Field"):
        CoherentModes([np.ones((2, 2))])  # type: ignore[list-item]  # it is refused
    with pytest.raises(GeometryError, match="error is -1 but"):
        CoherentModes(waves(1), -1)
    with pytest.raises(GeometryError, match=r"\(1, 2, 4, 5\) but must be \(modes, y, x\)"):
        CoherentModes(Field(np.ones((1, 2, 4, 5)), GRID, 500e-9))


def test_wavelengths_on_different_grids_have_no_intensity_together():
    light = CoherentModes([waves(1), waves(1, 600e-9, Grid((4, 5), 3.0))])
    with pytest.raises(GeometryError, match="Propagate with grid="):
        _ = light.intensity
