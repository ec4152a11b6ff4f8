"""Transmissions are built once for each element, grid, wavelength and placement."""

import numpy as np

from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.elements import transmission


class Counting:
    """An element that counts how often its factor is computed."""

    def __init__(self):
        self.calls = 0

    def transmission(self, grid, wavelength):
        self.calls += 1
        return np.full(grid.shape, 2.0)


def test_a_transmission_is_computed_again_only_for_another_grid_wavelength_or_precision():
    element, grid = Counting(), Grid.square(4, 1.0)
    wave = Field(np.ones((4, 4)), grid, 1e-6)
    for _ in range(3):
        result = transmission.transmit(element, wave)
    assert element.calls == 1
    assert (result.data == 2).all()
    transmission.transmit(element, Field(np.ones((4, 4), np.complex64), grid, 1e-6))
    transmission.transmit(element, Field(np.ones((4, 4)), grid, 2e-6))
    transmission.transmit(element, Field(np.ones((5, 5)), Grid.square(5, 1.0), 1e-6))
    assert element.calls == 4
