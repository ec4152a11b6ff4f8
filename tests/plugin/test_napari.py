"""napari's own tools accept the plugin; layers stand where things stand, widgets do what the verbs do."""

import time
from importlib.resources import files

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.stack import Stack
from lumigraph.errors import SamplingWarning
from viewer_pages import NEAR, two_planes


@pytest.fixture(scope="module")
def manifest():
    npe2 = pytest.importorskip("npe2", reason="napari is not installed: pip install lumigraph[napari]")
    return npe2.PluginManifest.from_file(str(files("lumigraph.napari").joinpath("napari.yaml")))


def until(condition, qtbot, seconds=300):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        qtbot.wait(20)


def layer(viewer, noun, name):
    from napari.layers import Layer

    from lumigraph.napari.shown import layer_of

    return viewer.add_layer(Layer.create(*layer_of(noun, name)))


def test_the_manifest_is_valid_and_its_commands_exist(manifest):
    manifest.validate_imports()
    assert {widget.display_name for widget in manifest.contributions.widgets} == {
        "Calibrate", "Decode", "Refocus", "Depth", "Deconvolve",
    }  # fmt: skip


def test_every_format_that_is_read_has_its_ending_in_the_manifest(manifest):
    from lumigraph.io.formats import ENDINGS

    patterns = manifest.contributions.readers[0].filename_patterns
    assert {f"*{end}" for end in ENDINGS if end.startswith(".")} == set(patterns)


def test_files_become_layers_with_scale_and_units(tmp_path, viewer, rng):
    from lumigraph.napari.readers import reader

    volume = lg.Volume(
        rng.random((3, 8, 9)).astype(np.float32), lg.Grid((8, 9), 2e-6), (-5e-6, 0.0, 5e-6)
    )  # fmt: skip
    lg.save(volume, tmp_path / "cell.ome.tif")
    lg.save(two_planes(), tmp_path / "views.zarr")
    for name in ("cell.ome.tif", "views.zarr"):
        for data, options, kind in reader(str(tmp_path / name))(str(tmp_path / name)):
            getattr(viewer, f"add_{kind}")(data, **options)
    cell, views = viewer.layers
    assert (cell.name, views.name) == ("cell", "views")
    np.testing.assert_allclose(cell.scale, (5, 2, 2))
    np.testing.assert_allclose(cell.translate, (-5, -8, -8))
    assert {str(unit) for unit in cell.units} == {"micrometer"}
    assert views.rgb
    assert views.data.shape == (5, 5, 40, 64, 3)
    assert views.axis_labels == ("v", "u", "t", "s")
    assert reader("notes.docx") is None


def test_axes_that_descend_are_turned_and_uneven_ones_warn(rng):
    data = rng.random((3, 4, 5))
    down = lg.Volume(data, lg.Grid((4, 5), 1e-6), (2e-6, 0.0, -2e-6)).to_napari()
    np.testing.assert_array_equal(down[0], data[::-1])
    assert down[1]["translate"][0] == pytest.approx(-2)
    with pytest.warns(SamplingWarning, match="steps of 1e-06 to 3e-06"):
        lg.Volume(data, lg.Grid((4, 5), 1e-6), (0.0, 1e-6, 4e-6)).to_napari()


def test_stacks_maps_and_calibrations_are_layers_too(viewer, rng):
    stack = layer(viewer, Stack(rng.random((3, 4, 5)), (0.9, 1.0, 1.1), "alpha"), "stack")
    np.testing.assert_allclose(stack.scale, (0.1, 1, 1))
    found = DepthMap(rng.random((4, 5)), np.ones((4, 5)), "disparity")
    assert layer(viewer, found, "depth").colormap.name == "turbo"
    camera = lg.load_camera("thesis-plenoptic-2-m050").replace(lenslets={"count": (3, 3)})
    points = layer(viewer, camera.calibration, "calibration")
    assert type(points).__name__ == "Points"


def test_the_focus_slider_gives_the_library_s_picture(viewer, qtbot):
    from lumigraph.napari.refocusing import Refocus

    views = two_planes()
    layer(viewer, views, "views")
    panel = Refocus(viewer)
    panel.alpha.value = NEAR
    until(lambda: "refocused" in viewer.layers and not panel.work.is_running, qtbot)
    np.testing.assert_allclose(
        viewer.layers["refocused"].data, lg.refocus(views, NEAR, oversample=1), atol=1e-3
    )
    np.testing.assert_allclose(viewer.layers["refocused"].scale, viewer.layers["views"].scale[2:])


def test_a_raw_image_goes_from_white_image_to_depth(viewer, qtbot, rng):
    from lumigraph.napari.verbs import Calibrate, Decode, Depth

    lattice = lg.Lattice.square(9.0, origin=(4.0, 4.0))
    y, x = np.mgrid[0:270, 0:360].astype(float)
    away = np.hypot(*(np.abs((a - 4.0 + 4.5) % 9.0 - 4.5) for a in (y, x)))
    white = lg.RawImage(1000 / (1 + np.exp(4 * (away - 4.0))) + 10, pixel_pitch=5e-6)
    raw = lg.RawImage(white.data * (0.6 + 0.4 * np.sin(x / 14) * np.sin(y / 17)), pixel_pitch=5e-6)
    layer(viewer, white, "white")
    layer(viewer, raw, "raw")
    calibrating, decoding, measuring = Calibrate(viewer), Decode(viewer), Depth(viewer)
    calibrating.white.value = viewer.layers["white"]
    calibrating.start()
    until(lambda: "calibration" in viewer.layers, qtbot)
    found = viewer.layers["calibration"].metadata["lumigraph"].lattice
    assert found.pitch == pytest.approx(lattice.pitch, abs=0.01)
    decoding.raw.value = viewer.layers["raw"]
    decoding.calibration.value = viewer.layers["calibration"]
    decoding.start()
    until(lambda: "views" in viewer.layers and not decoding.work.is_running, qtbot)
    assert viewer.layers["views"].data.shape[:2] == (9, 9)
    measuring.start()
    until(lambda: "depth" in viewer.layers, qtbot)
    assert measuring.said.value.startswith("disparity, px")


def test_wrong_choices_are_said_in_a_line(viewer):
    from lumigraph.napari.verbs import Decode

    panel = Decode(viewer)
    panel.start()
    assert "no layer holds a raw image" in panel.said.value
    assert panel.start_button.enabled


def test_a_stopped_deconvolution_shows_what_it_had_reached(viewer, qtbot, tmp_path):
    from lumigraph.napari.deconvolving import Deconvolve

    camera = lg.load_camera("thesis-plenoptic-2-m050").replace(lenslets={"count": (3, 3)})
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    operator = camera.operator(accuracy=1e-2)
    seen = operator.forward(np.ones(operator.object_grid.shape))
    layer(viewer, lg.RawImage(seen, pixel_pitch=camera.sensor.pixel_pitch), "raw")
    panel = Deconvolve(viewer)
    panel.camera.value = tmp_path / "camera.toml"
    panel.iterations.value = 1000
    panel.start()
    until(lambda: panel.said.value.startswith("iteration"), qtbot)
    assert panel.stop_button.enabled
    panel.stop_button.changed.emit(True)
    until(lambda: "reconstruction" in viewer.layers, qtbot)
    assert "stopped after" in panel.said.value


def test_napari_itself_opens_files_and_docks_the_widgets(window, manifest, tmp_path, qtbot):
    import npe2

    lg.save(two_planes(), tmp_path / "views.zarr")
    plugins = npe2.PluginManager.instance()
    if "lumigraph" not in {known.name for known in plugins.iter_manifests()}:  # its package is not installed
        plugins.register(manifest)
    window.open(tmp_path / "views.zarr", plugin="lumigraph")
    docked, panel = window.window.add_plugin_dock_widget("lumigraph", "Refocus")
    panel.alpha.value = NEAR
    until(lambda: "refocused" in window.layers and not panel.work.is_running, qtbot)
    assert window.screenshot(canvas_only=False, flash=False).std() > 10
    assert docked.isVisible()
