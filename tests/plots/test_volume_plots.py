"""Projections and slices stand where the samples stand."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.plots import projections, slices


def bead(depths):
    """One bright voxel at the second depth, low (y) and to the left (x)."""
    data = np.zeros((4, 20, 30))
    data[1, 15, 4] = 1.0
    return lg.Volume(data, lg.Grid((20, 30), 1e-6), depths)


def place(axes, panel_image):
    """Where the brightest pixel of a panel is drawn."""
    data, (left, right, bottom, top) = np.asarray(panel_image.get_array()), panel_image.get_extent()
    row, column = np.unravel_index(np.argmax(data), data.shape)
    x = left + (column + 0.5) * (right - left) / data.shape[1]
    y = top + (row + 0.5) * (bottom - top) / data.shape[0]
    return x, y


@pytest.mark.parametrize("draw", [projections, slices])
@pytest.mark.parametrize("depths", [(-9e-6, -3e-6, 3e-6, 9e-6), (9e-6, 3e-6, -3e-6, -9e-6)])
def test_a_bead_is_drawn_at_its_place_in_every_panel(draw, depths):
    volume = bead(depths)
    z, y, x = volume.depths[1] * 1e6, volume.grid.y[15] * 1e6, volume.grid.x[4] * 1e6
    figure = draw(volume)
    for axes, expected in zip(figure.axes[:3], ((x, y), (z, y), (x, z)), strict=True):
        assert place(axes, axes.images[0]) == pytest.approx(expected, abs=1e-6), axes.get_title()
        bottom, top = axes.get_ylim()
        if expected[1] == y:
            assert bottom > top  # rows go downwards, as in every picture


def test_slices_through_a_place_show_it():
    figure = slices(bead((-9e-6, -3e-6, 3e-6, 9e-6)), (3e-6, 0.0, 0.0))
    assert figure.axes[0].get_title() == "z = 3 µm"
    assert float(figure.axes[0].images[0].get_array().max()) == 0


def test_a_volume_in_colour_is_not_drawn():
    with pytest.raises(lg.LumigraphError, match=r"shape \(z, y, x\)"):
        projections(lg.Volume(np.ones((2, 3, 3, 3)), lg.Grid.square(3, 1e-6), (0.0, 1e-6)))
