import numpy as np
import pytest

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import CircularAperture, Element, ThinLens, Train
from lumigraph.errors import GeometryError

WAVE = Field(np.ones((8, 8), np.complex64), Grid.square(8, 1.0), 633e-9)


def double(field):
    return field * 2


def test_a_train_applies_its_elements_in_order():
    def add(field):
        return Field(field.data + 1, field.grid, field.wavelength)

    assert Train([double, add])(WAVE).data[0, 0] == 3
    assert Train([add, double])(WAVE).data[0, 0] == 4


def test_planes_yields_the_input_and_what_is_behind_each_element():
    planes = list(Train([double, double]).planes(WAVE))
    assert [float(abs(plane.data[0, 0])) for plane in planes] == [1.0, 2.0, 4.0]
    assert planes[0] is WAVE


def test_trains_within_trains_are_unpacked():
    train = Train([Train([double, Train([double])]), double])
    assert train.elements == (double, double, double)


def test_an_empty_train_passes_the_field():
    assert Train()(WAVE) is WAVE


def test_elements_and_trains_satisfy_the_protocol():
    for element in (double, Train(), ThinLens(1.0), CircularAperture(1.0)):
        assert isinstance(element, Element)


def test_what_cannot_be_called_is_refused():
    with pytest.raises(GeometryError, match=r"element 1 of a train is 0\.1, which is not callable"):
        Train([double, 0.1])
