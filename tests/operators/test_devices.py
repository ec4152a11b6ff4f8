"""Operators on another device than the processor: array-api-strict has some, and mixes none."""

import array_api_strict as strict
import numpy as np
import pytest
from tests.cameras import focused, plenoptic
from tests.operators.test_microscope_operator import LAYOUT, LENSLET, SCOPE, microscope_operator
from tests.operators.test_single_lens import TWO_F

from lumigraph.core import arrays
from lumigraph.core.banded import banded
from lumigraph.core.grid import Grid
from lumigraph.operators.periodic.incoherent import periodic_operator
from lumigraph.units import um

ELSEWHERE, PROCESSOR = strict.Device("device1"), strict.Device("CPU_DEVICE")
GRID = Grid((21, 17), 14 * um)
OPERATORS = {
    "2.0": lambda: periodic_operator(focused(), GRID),
    "2.0, out of focus and large": lambda: periodic_operator(focused(), Grid((90, 80), 14 * um), 3e-3),
    "2.0, round, in hexagons": lambda: periodic_operator(focused(layout="hex", shape="round"), GRID),
    "2.0, turned": lambda: periodic_operator(focused(rotation=0.1), GRID),
    "1.0": lambda: periodic_operator(plenoptic(), GRID),
    "no lenslets": lambda: TWO_F.operator(),
    "microscope": lambda: microscope_operator([SCOPE], LENSLET, LAYOUT, (-8e-6, 15e-6), accuracy=1e-2),
}


def elsewhere(values):
    return strict.asarray(values, device=ELSEWHERE)


def fetched(array):
    assert arrays.device(array) == ELSEWHERE
    return arrays.to_numpy(array.to_device(PROCESSOR))


LONG = "2.0, round, in hexagons", "2.0, turned", "2.0, out of focus and large"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long) if name in LONG else name for name in OPERATORS]
)
def test_images_are_those_of_the_processor(name, rng):
    operator = OPERATORS[name]()
    for apply, shape in zip((operator.adjoint, operator.forward), operator.shape, strict=True):
        given = rng.random(shape)
        expected = apply(given)
        assert np.abs(fetched(apply(elsewhere(given))) - expected).max() < 1e-12 * np.abs(expected).max()


def test_what_stays_is_sent_once_and_goes_with_the_operator(rng):
    values, array = rng.random((3, 4)), elsewhere(np.zeros(1, np.float32))
    first = arrays.held(values, array)
    assert first.dtype == strict.float32
    before = len(arrays._HELD)
    assert np.array_equal(fetched(arrays.held(values, array, slice(1, 3))), values[1:3].astype(np.float32))
    assert len(arrays._HELD) == before
    del values
    assert len(arrays._HELD) == before - 1
    kept = rng.random(4)
    assert np.shares_memory(arrays.held(kept, kept), kept)  # nothing is copied where it is


def test_few_tall_blocks_are_the_same_matrix(rng):
    matrix = banded(np.arange(700.0), np.arange(0.0, 700, 0.7), lambda d: 1 - np.abs(d) / 9, 9)
    plane, image = rng.random((matrix.columns, 5)), rng.random((matrix.rows, 5))
    assert (len(matrix.blocks), len(matrix._tall)) == (11, 2)
    for apply, given in (
        (matrix.down, plane),
        (matrix.up, image),
        (matrix.right, plane.T),
        (matrix.left, image.T),
    ):
        assert fetched(apply(elsewhere(given))) == pytest.approx(apply(given), rel=1e-12)
