"""Refusals of bad numbers: one clear error for whatever comes in."""

import numpy as np
import pytest

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError, GeometryError, LumigraphError

ODD = [None, "5", True, 2.5, float("nan"), np.float32(2), np.array(2.5), [], (1,), 1j, {}, 10**400]


@pytest.mark.parametrize("value", [*ODD, [1, 2.5], (3, "4"), -1, 0, 2**31])
def test_a_shape_is_two_whole_numbers_or_one_clear_error(value):
    with pytest.raises(GeometryError, match=r"^directions is .* but "):
        checks.shape("directions", value)


@pytest.mark.parametrize("value", [None, "5", True, float("nan"), [], (1,), 1j, {}, 10**400, [1, None]])
def test_a_pair_is_two_finite_numbers_or_one_clear_error(value):
    with pytest.raises(GeometryError, match=r"^pitch( \([yx]\))? (is|has) .* but must be"):
        checks.pair("pitch", value)


@pytest.mark.parametrize("value", [3, np.int64(3), (3, 3), [3, 3], np.array([3, 3])])
def test_one_whole_number_stands_for_both_axes(value):
    assert checks.shape("shape", value) == (3, 3)


@pytest.mark.parametrize("rotation", [None, "2 deg", float("inf"), True, [], 1j])
@pytest.mark.parametrize("kind", [Lattice.square, Lattice.hex])
def test_a_rotation_is_a_finite_number(kind, rotation):
    with pytest.raises(GeometryError, match=r"rotation is .* but must be a finite number \[rad\]"):
        kind(1.0, rotation)


@pytest.mark.parametrize("basis", [None, 2.5, [], (1,), {}, np.array(1.0), "ab"])
def test_a_basis_is_two_vectors(basis):
    with pytest.raises(GeometryError, match="basis"):
        Lattice(basis)


@pytest.mark.parametrize("kinds", [True, np.array([1, 3]), "3"])
def test_kinds_are_one_or_three(kinds):
    with pytest.raises(GeometryError, match=r"kinds is .* but must be 1, or 3"):
        Lattice.hex(1.0, kinds=kinds)


def test_a_lattice_is_moved_by_numbers():
    with pytest.raises(GeometryError, match="dx is None but must be a finite number"):
        Lattice.square(1.0).moved(0.0, None)


@pytest.mark.parametrize("data", [None, "x", 5, [[1, 2], [3, 4]]])
def test_nouns_hold_arrays(data):
    grid, told = Grid.square(2, 1.0), r"must be an array\. (Use numpy\.asarray|Read the file)"
    with pytest.raises(GeometryError, match=told):
        Field(data, grid, 5e-7)
    with pytest.raises(FormatError, match=told):
        RawImage(data)
    with pytest.raises(GeometryError, match=told):
        LightField(data, grid, grid, 1.0)


@pytest.mark.parametrize("dtype", ["U1", "M8[s]", object])
def test_arrays_hold_numbers(dtype):
    with pytest.raises(GeometryError, match=r"must hold numbers\. Use astype"):
        Field(np.ones((2, 2)).astype(dtype), Grid.square(2, 1.0), 5e-7)


def test_nouns_say_which_class_they_need():
    with pytest.raises(GeometryError, match="grid is of type float but must be a Grid"):
        Field(np.ones((2, 2)), 1e-6, 5e-7)
    with pytest.raises(LumigraphError, match="lattice is of type NoneType but must be a Lattice"):
        Calibration(None, (4, 4), np.zeros((0, 2)), np.zeros((0, 2)), 0.0)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"bit_depth": 2.5}, "bit_depth is 2.5 but must be a whole number"),
        ({"bit_depth": 0}, "bit_depth is 0 but must be a whole number of at least 1"),
        ({"bayer": np.ones(3)}, "bayer is .* but must be one of RGGB"),
        ({"metadata": 5}, "metadata is 5 but must be a mapping"),
    ],
)
def test_fields_of_a_raw_image_are_checked(fields, told):
    with pytest.raises(FormatError, match=told):
        RawImage(np.ones((2, 2)), **fields)
