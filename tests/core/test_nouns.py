"""Nouns among Python's own: NumPy, matplotlib, xarray and notebooks take them as they are."""

import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import lumigraph as lg
from lumigraph.core.prepared import PreparedImage

DATA = np.arange(2 * 3 * 4 * 5, dtype=np.float32).reshape(2, 3, 4, 5)
VIEWS = lg.LightField(DATA, lg.Grid((2, 3), 1e-3), lg.Grid((4, 5), 1e-4, (1e-3, 0)), 0.1, DATA > 3)
NOUNS = [
    lg.RawImage(DATA[0, 0], 5e-6, metadata={"wavelength": 5e-7}),
    lg.RawImage(DATA[0, 0].astype(np.uint16), bit_depth=12, bayer="RGGB"),
    lg.Stack(DATA[0], (0.9, 1.0, 1.1), "alpha"),
    lg.Stack(DATA.reshape(2, 4, 5, 3), pixel_pitch=1e-6),
    lg.Volume(DATA[0], lg.Grid((4, 5), 1e-6), (2e-6, 0.0, -3e-6)),
    lg.Volume(DATA[:1, 0], lg.Grid((4, 5), 1e-6), (0.0,)),
    lg.DepthMap(DATA[0, 0], DATA[0, 0] / 20, "depth"),
    VIEWS,
]  # fmt: skip


def kind(thing):
    return type(thing).__name__


def held(thing):
    return thing.values if isinstance(thing, lg.DepthMap) else thing.data


@pytest.mark.parametrize("noun", NOUNS, ids=kind)
def test_numpy_takes_a_noun_as_its_array(noun):
    assert np.shares_memory(np.asarray(noun), held(noun))
    assert np.asarray(noun, copy=False) is not None
    assert not np.shares_memory(np.array(noun, copy=True), held(noun))
    assert np.asarray(noun, np.float64).dtype == np.float64
    assert np.mean(noun) == np.mean(held(noun))
    if held(noun).dtype != np.float64:
        with pytest.raises(ValueError, match="copy"):
            np.asarray(noun, np.float64, copy=False)


def test_numpy_takes_arrays_of_other_libraries(xp):
    raw = lg.RawImage(xp.asarray(DATA[0, 0]))
    np.testing.assert_array_equal(np.asarray(raw), DATA[0, 0])


@pytest.mark.parametrize("noun", NOUNS, ids=kind)
def test_a_noun_comes_back_from_xarray(noun):
    array = noun.to_xarray()
    again = type(noun).from_xarray(array)
    np.testing.assert_array_equal(held(again), held(noun))
    for name in noun.__dataclass_fields__:
        if name not in ("data", "values", "confidence", "valid", "grid", "aperture", "lenslets"):
            assert getattr(again, name) == getattr(noun, name), name
    if isinstance(noun, lg.LightField):
        for name in ("aperture", "lenslets"):
            ours, theirs = getattr(noun, name), getattr(again, name)
            assert ours.shape == theirs.shape
            np.testing.assert_allclose(theirs.pitch + theirs.center, ours.pitch + ours.center, rtol=1e-12)
        np.testing.assert_array_equal(again.valid, noun.valid)
    if isinstance(noun, lg.DepthMap):
        np.testing.assert_array_equal(again.confidence, noun.confidence)


def test_the_expected_error_of_a_depth_map_comes_back_from_xarray():
    error = np.float32([[0.1, 0.2], [0.3, np.nan]])
    depth = lg.DepthMap(np.ones((2, 2)), np.ones((2, 2)), "disparity", error)
    np.testing.assert_array_equal(lg.DepthMap.from_xarray(depth.to_xarray()).error, error)


@pytest.mark.parametrize("wrong", [None, "abc", [1, 2], 10**400, np.zeros(3), {}, 1j, np.nan])
def test_xarray_with_what_is_no_number_is_refused_in_one_line(wrong):
    """They ended in TypeError, ValueError or OverflowError."""
    array = VIEWS.to_xarray()
    array.attrs["separation"] = wrong
    with pytest.raises(lg.GeometryError, match="attribute 'separation' is"):
        lg.LightField.from_xarray(array)
    array = VIEWS.to_xarray()
    array.coords["t"].attrs["pitch"] = wrong
    with pytest.raises(lg.GeometryError, match="'pitch' of the coordinate 't' is"):
        lg.LightField.from_xarray(array)


def test_xarray_with_coordinates_of_text_or_without_samples_is_refused():
    array = VIEWS.to_xarray()
    with pytest.raises(lg.GeometryError, match="coordinate 't' of the DataArray must hold finite numbers"):
        lg.LightField.from_xarray(array.assign_coords(t=[f"{k}" for k in range(array.sizes["t"])]))
    with pytest.raises(lg.GeometryError, match="coordinate 'v' of the DataArray must hold finite numbers"):
        lg.LightField.from_xarray(array.isel(v=slice(0, 0)))
    stack = lg.Stack(DATA[0], (1.0, 2.0, 3.0)[: len(DATA[0])], "alpha").to_xarray()
    with pytest.raises(lg.GeometryError, match="has no coordinate 'n'"):
        lg.Stack.from_xarray(stack.drop_vars("n"))


def test_a_selection_in_xarray_keeps_its_place():
    part = lg.LightField.from_xarray(VIEWS.to_xarray().isel(s=slice(1, None), v=slice(0, 1)))
    np.testing.assert_allclose(part.lenslets.x, VIEWS.lenslets.x[1:], rtol=0, atol=1e-15)
    assert part.aperture.pitch == VIEWS.aperture.pitch  # of one row of views, by the attribute


def test_xarray_without_what_a_noun_needs_is_refused():
    array = VIEWS.to_xarray()
    with pytest.raises(lg.GeometryError, match=r"axes \(u, v, t, s\) but a LightField has \(v, u, t, s\)"):
        lg.LightField.from_xarray(array.transpose("u", "v", "t", "s"))
    with pytest.raises(lg.GeometryError, match="must ascend evenly"):
        lg.LightField.from_xarray(array.isel(s=[0, 1, 3]))
    del array.attrs["separation"]
    with pytest.raises(lg.GeometryError, match="no attribute 'separation'"):
        lg.LightField.from_xarray(array)
    with pytest.raises(lg.GeometryError, match=r"takes an xarray\.DataArray, not a ndarray"):
        lg.Volume.from_xarray(DATA)
    ready = PreparedImage(DATA[0, 0], reasons=np.zeros((4, 5), np.uint8))
    with pytest.raises(lg.GeometryError, match="prepare it again"):
        PreparedImage.from_xarray(ready.to_xarray())


@pytest.mark.parametrize("noun", NOUNS, ids=kind)
def test_a_noun_draws_itself(noun):
    assert isinstance(noun.plot(), Figure)


def test_fields_cameras_and_calibrations_draw_themselves():
    camera = lg.load_camera("thesis-plenoptic-2-m050")
    white = np.ones(camera.sensor.shape, np.uint8)
    assert isinstance(camera.plot(), Figure)
    assert len(camera.calibration.plot(white).axes) == 2
    assert isinstance(lg.Field(DATA[0, 0], lg.Grid((4, 5), 1e-6), 5e-7).plot(), Figure)


def test_a_depth_map_is_drawn_between_percentiles_in_a_unit_that_suits_it():
    values = np.linspace(0, 2e-3, 10_000).reshape(100, 100)
    values[0, 0] = 1.0  # a wrong place
    image = lg.DepthMap(values, values * 0, "depth").plot().axes[0].images[0]
    assert image.colorbar.ax.get_ylabel() == "depth [mm]"
    assert image.get_clim() == pytest.approx((0.02, 1.98), rel=0.02)


def test_matplotlib_draws_a_raw_image_as_it_is():
    drawn = Figure().subplots().imshow(NOUNS[0])
    np.testing.assert_array_equal(drawn.get_array(), NOUNS[0].data)


def test_stacks_scenes_grids_and_tables_show_themselves_in_notebooks():
    camera = lg.load_camera("thesis-2f")
    points = lg.targets.points([(0, 0, 2e-3), (0, 1e-3)])
    scene = lg.Scene([lg.Slice(DATA[0, 0], lg.Grid((4, 5), 1e-4), 1e-2)]) + points
    expected = {
        "alpha 0.9 to alpha 1.1": NOUNS[2],
        "page 0 to page 1": NOUNS[3],
        "400 µm × 500 µm, 10 mm": scene,
        "2, depths 0 m to 2 mm": points,
        "1 mm, 1 mm": lg.Grid((4, 5), 1e-3),
        "f-number": camera.describe(),
        "float32 (4, 3)": lg.PointCloud(DATA[0, 0, :, :3]),
        "500 nm": lg.Field(DATA[0, 0], lg.Grid((4, 5), 1e-6), 5e-7),
    }
    for text, thing in expected.items():
        assert text in thing._repr_html_()


def test_without_xarray_one_line_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(lg.LumigraphError, match=r"pip install 'lumigraph\[xarray\]'"):
        VIEWS.to_xarray()
