"""Drawings put samples where their grid says, in readable units, and open no window."""

import io

import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf

from lumigraph import plots
from lumigraph.core.calibration import Calibration
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError, LumigraphError
from lumigraph.plots.axes import length_unit
from lumigraph.plots.lattices import cell_outline


def png(figure):
    """The figure drawn by Agg; a label or a layout that fails shows here."""
    figure.savefig(buffer := io.BytesIO(), format="png", dpi=50)
    return buffer.getvalue()


def texts(figure):
    return [axes.get_ylabel() for axes in figure.axes] + [axes.get_title() for axes in figure.axes]


@pytest.mark.parametrize(
    ("size", "name"), [(2.0, "m"), (5e-3, "mm"), (150e-6, "µm"), (633e-9, "nm"), (1e-12, "nm"), (0.0, "mm")]
)
def test_lengths_are_drawn_in_a_unit_that_reads_well(size, name):
    assert length_unit(size)[1] == name


def test_an_image_on_a_grid_has_its_samples_at_their_places(xp):
    grid = Grid((4, 6), (1e-3, 2e-3), (1e-3, 0.0))
    figure = plots.show(xp.asarray(np.arange(24.0).reshape(4, 6)), grid=grid, label="counts", title="T")
    axes = figure.axes[0]
    left, right, bottom, top = axes.images[0].get_extent()
    # first column at x[0] = -6 mm, first row at y[0] = -1 mm and on top: y grows downwards as rows do
    assert (left, right, top, bottom) == pytest.approx((-7, 5, -1.5, 2.5))
    assert axes.get_ylim()[0] > axes.get_ylim()[1]
    assert (axes.get_xlabel(), figure.axes[1].get_ylabel(), axes.get_title()) == ("x [mm]", "counts", "T")
    assert png(figure)


def test_a_raw_image_is_drawn_in_pixels_or_in_millimetres():
    assert plots.show(RawImage(np.ones((4, 6)))).axes[0].get_xlabel() == "x [px]"
    raw = RawImage(np.ones((400, 600, 3)), pixel_pitch=6.45e-6)
    assert plots.show(raw).axes[0].get_xlabel() == "x [mm]"
    assert len(plots.show(raw).axes) == 1  # colour has no colour bar
    assert plots.show(RawImage(np.ones((4, 6, 1)))).axes[0].images[0].get_array().shape == (4, 6)


def test_a_field_shows_intensity_and_phase():
    figure = plots.show(Field(np.full((4, 4), 2j), Grid.square(4, 1e-6), 633e-9), title="wave")
    images = [axes.images[0].get_array() for axes in figure.axes[:2]]
    np.testing.assert_allclose(images[0], 4)
    np.testing.assert_allclose(images[1], np.pi / 2)
    assert "phase [rad]" in texts(figure)
    assert png(figure)


@pytest.mark.parametrize("channels", [(), (1,), (3,)])
def test_a_light_field_shows_views_and_epipolar_planes(rng, channels):
    data = rng.random((3, 7, 4, 5, *channels))
    figure = plots.show(LightField(data, Grid((3, 7), 1e-3), Grid((4, 5), 1e-4), 0.4))
    assert {"central view (1, 3) of 3 x 7", "3 x 5 views"} <= set(texts(figure))
    shapes = [axes.images[0].get_array().shape[:2] for axes in figure.axes[:4]]
    assert shapes == [(4, 5), (12, 25), (7, 5), (3, 4)]
    assert png(figure)


def test_planes_are_drawn_one_by_one_in_decibel_if_asked():
    grid = Grid.square(4, 1e-6)
    waves = [Field(np.full((4, 4), 10.0**-k), grid, 633e-9) for k in range(5)]
    waves[1].data[0, 0] = 1.0
    figure = plots.planes(iter(waves), names=list("abcde"), decibel=True)
    assert [axes.get_title() for axes in figure.axes][:5] == list("abcde")
    assert figure.axes[1].images[0].get_array()[1, 1] == pytest.approx(-20)
    assert "plane 4" in texts(plots.planes(waves))
    assert png(figure)


@pytest.mark.parametrize(
    ("lattice", "corners", "area"),
    [(Lattice.square(10.0, 0.02), 4, 100.0), (Lattice.hex(10.0, -0.1), 6, 100 * np.sqrt(3) / 2)],
)
def test_a_cell_is_the_region_nearest_to_its_lattice_point(lattice, corners, area):
    outline = cell_outline(lattice)
    y, x = outline.T
    # corners may come twice where four cells meet in a square lattice
    assert len(np.unique(outline.round(6), axis=0)) == corners
    assert abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2 == pytest.approx(area, rel=1e-9)
    j, i = lattice.index(0.99 * y, 0.99 * x)
    assert not np.any(i)
    assert not np.any(j)


@pytest.mark.parametrize("build", [Lattice.square, Lattice.hex])
def test_a_calibration_is_drawn_over_its_white_image(rng, build):
    lattice = build(14.3, 0.01, (3.0, 4.0))
    indices = lattice.indices((0, 99), (0, 139))
    centers = lattice.position(indices) + rng.normal(size=indices.shape) * 0.1
    figure = plots.lattice(np.ones((100, 140)), Calibration(lattice, (100, 140), indices, centers, 0.1))
    whole, part = figure.axes
    np.testing.assert_allclose(
        whole.collections[0].XY,
        lattice.position(indices)[:, ::-1],
    )
    assert "residuals x" in whole.get_title()
    assert part.get_xlim()[1] - part.get_xlim()[0] == pytest.approx(6 * 14.3)
    assert f"pitch {lattice.pitch:.3f} px" in figure.get_suptitle()
    assert png(figure)


def test_a_computed_calibration_has_no_arrows():
    lattice = Lattice.square(10.0)
    indices = lattice.indices((0, 39), (0, 39))
    calibration = Calibration(lattice, (40, 40), indices, lattice.position(indices), 0.0)
    assert not plots.lattice(RawImage(np.ones((40, 40))), calibration).axes[0].collections
    with pytest.raises(CalibrationError, match="40 x 41 pixels but its calibration is for 40 x 40"):
        plots.lattice(np.ones((40, 41)), calibration)
    with pytest.raises(CalibrationError, match="cells is 0"):
        plots.lattice(np.ones((40, 40)), calibration, cells=0)


def test_what_cannot_be_drawn_is_refused():
    grid = Grid.square(4, 1.0)
    with pytest.raises(LumigraphError, match=r"not \(2, 2, 2\)"):
        plots.show(np.ones((2, 2, 2)))
    with pytest.raises(LumigraphError, match="the image is complex"):
        plots.show(np.ones((2, 2), complex))
    batch = Field(np.ones((2, 4, 4)), grid, 1.0)
    with pytest.raises(LumigraphError, match="not a batch"):
        plots.show(batch)
    with pytest.raises(LumigraphError, match="not a batch"):
        plots.planes([batch])
    with pytest.raises(LumigraphError, match="no planes"):
        plots.planes([])
    with pytest.raises(LumigraphError, match="2 names for 1 planes"):
        plots.planes([Field(np.ones((4, 4)), grid, 1.0)], names=["a", "b"])


def test_large_images_are_drawn_at_no_more_than_can_be_seen():
    figure = plots.show(np.ones((10, 5000)))
    assert figure.axes[0].images[0].get_array().shape == (10, 1250)
    assert figure.axes[0].get_xlim() == (-0.5, 4999.5)


def test_no_window_and_no_global_figure():
    plots.show(np.ones((2, 2)))
    assert not Gcf.figs


def test_notebooks_show_every_drawing():
    indices = np.argwhere(np.ones((3, 3)))
    calibration = Calibration(Lattice.square(20.0), (60, 60), indices, 20.0 * indices, 0.0)
    views = LightField(np.ones((3, 3, 4, 4)), Grid.square(3, 1.0), Grid.square(4, 1.0), 1.0)
    drawings = (
        plots.show(np.eye(3)), plots.curves([0, 1], {"a": [0, 1]}), plots.images([(np.eye(3), "a")]),
        plots.lattice(np.eye(60), calibration), views.plot(),
    )  # fmt: skip
    for figure in drawings:
        assert figure._repr_png_().startswith(b"\x89PNG")
    assert not Gcf.figs


def test_curves_over_depth_have_units_that_suit_and_are_in_order():
    figure = plots.over_depth([2e-3, -1e-3, 0.0], {"a": [3e-6, 1e-6, np.inf], "b": [2e-6] * 3}, "error")
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_yscale()) == ("depth [mm]", "error [µm]", "linear")
    drawn = axes.lines[0].get_xydata()
    assert drawn[:, 0] == pytest.approx([-1, 0, 2])
    assert drawn[:, 1] == pytest.approx([1, np.nan, 3], nan_ok=True)
    far = plots.over_depth([0.0, 1e-3], {"a": [1e-6, 1e-6], "b": [3e-5, 4e-5]}, "error").axes[0]
    assert far.get_yscale() == "log"
    parts = plots.over_depth([0.0, 1e-3], {"a": [0.1, 0.2]}, "error", lengths=False).axes[0]
    assert parts.get_ylabel() == "error"
