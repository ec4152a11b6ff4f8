"""Python, the command line and the viewer make the same pictures and maps of one raw image."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.cli import main
from lumigraph.rendering import detail
from lumigraph.viewer import opening
from lumigraph.viewer.exhibit import focal_stack, object_depths
from viewer_pages import served


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """raw, white and dark image of a plenoptic camera 1.0, and its file."""
    folder = tmp_path_factory.mktemp("bench")
    camera = lg.PlenopticCamera.from_catalogue("thesis-plenoptic-1")
    lenslets = {**camera.lenslets.model_dump(exclude_unset=True), "count": (13, 13)}
    camera = camera.replace(lenslets=lenslets, sensor={"pixel_pitch": camera.sensor.pixel_pitch})
    (folder / "camera.toml").write_text(camera.to_toml())
    grid, rng = camera.object_grid, np.random.default_rng(3)
    ky, kx = rng.uniform(-4e3, 4e3, (2, 40, 1, 1))
    waves = np.cos(ky * grid.y[:, None] + kx * grid.x + rng.uniform(0, 6, (40, 1, 1))).sum(0)
    scene = lg.Scene((lg.Slice(np.maximum(1 + 0.15 * waves, 0), grid, 0.02),))
    white = lg.simulate(camera, lg.targets.white())
    for name, raw in (("raw", lg.simulate(camera, scene)), ("white", white)):
        lg.save(lg.RawImage((1000 * np.asarray(raw.data) + 64).astype(np.float32)), folder / f"{name}.tiff")
    lg.save(lg.RawImage(np.full(white.shape, 64, np.float32)), folder / "dark.tiff")
    return folder


def test_refocused_pictures_and_depths_agree_to_a_grey_level(bench, monkeypatch):
    monkeypatch.chdir(bench)
    words = ["--calibration", "calibration.toml", "--white", "white.tiff", "--dark", "dark.tiff"]
    camera = lg.load_camera("camera.toml")
    lg.save(camera.calibration, "calibration.toml")
    known = {name: lg.open(f"{name}.tiff") for name in ("white", "dark")}
    ready = lg.prepare(lg.open("raw.tiff"), lg.open("calibration.toml"), **known)
    views = lg.decode(ready)
    files = {name: bench / f"{name}.tiff" for name in ("white", "dark")}
    shown = viewer.open_exhibit(
        bench / "raw.tiff", viewer.Origin(bench / "calibration.toml", files["white"], files["dark"])
    )
    level = float(views.data.max()) / 255
    stack = focal_stack(shown.views, 3)
    alphas = [str(alpha) for alpha in stack.positions]
    assert (
        main(
            [
                "refocus",
                "raw.tiff",
                *words,
                "--alpha",
                *alphas,
                "-o",
                "stack.tiff",
                "--oversample",
                str(detail(views)),
            ]
        )
        == 0
    )
    written = np.asarray(lg.open("stack.tiff").data)
    python = np.asarray(lg.refocus_stack(views, stack.positions, oversample=detail(views)))
    assert np.abs(written - python).max() < level
    assert np.abs(np.asarray(stack.data) - python).max() < level
    assert main(["depth", "raw.tiff", *words, "-o", "map.tiff"]) == 0
    found = lg.depth.epi(views)
    np.testing.assert_allclose(lg.open("map.tiff").data, found.values, atol=1e-6)
    np.testing.assert_allclose(
        np.asarray(shown.depth().values), np.asarray(lg.depth.alpha_of(found, views).values), atol=1e-6
    )


def test_depths_of_a_camera_2_agree_in_metres(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    camera = lg.FocusedPlenopticCamera(
        wavelength="633 nm", object_distance="120 mm", main_lens={"focal_length": "60 mm"},
        lenslets={"pitch": "150 um", "focal_length": "3 mm", "count": (5, 5), "magnification": 0.3},
        sensor={"pixel_pitch": "9 um"},
    )  # fmt: skip
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    y, x = np.meshgrid(*map(np.arange, camera.sensor.shape), indexing="ij")
    (dy, dx), step = camera.calibration.offset(y, x), camera.calibration.lattice.pitch / camera.patch
    y, x = y - dy - dy * step, x - dx - dx * step
    raw = 3 + np.sin(0.4 * y) + np.cos(0.5 * x) + np.sin(0.31 * y - 0.17 * x) + np.cos(0.13 * y + 0.27 * x)
    lg.save(lg.RawImage(raw.astype(np.float32)), "raw.tiff")
    assert main(["depth", "raw.tiff", "--camera", "camera.toml", "-o", "map.tiff"]) == 0
    patches = lg.depth.dense(lg.open("raw.tiff"), camera.calibration)
    found = lg.depth.metric(patches, camera.calibration, focal_length=0.06, object_distance=0.12)
    shown = viewer.open_exhibit(
        tmp_path / "raw.tiff", viewer.Origin(camera=lg.load_camera("camera.toml"), patch=camera.patch)
    )
    assert shown.measure == ("Depth", "m")
    assert np.abs(np.median(found.values)) < 1e-3
    for other in (lg.open("map.tiff").data, shown.depth().values):
        np.testing.assert_allclose(np.asarray(other), found.values, atol=1e-6)


def test_pictures_of_three_kinds_of_lenslets_agree_to_a_grey_level(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    camera = lg.FocusedPlenopticCamera.from_catalogue("multi-focus-hex")
    lenslets = {**camera.lenslets.model_dump(exclude_unset=True), "count": (6, 6)}
    camera = camera.replace(lenslets=lenslets, sensor={"pixel_pitch": 10e-6})
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    y, x = np.indices(camera.sensor.shape)
    raw = lg.RawImage((2 + np.sin(0.4 * y) * np.cos(0.5 * x)).astype(np.float32))
    lg.save(raw, "raw.tiff")
    shown = viewer.open_exhibit(
        tmp_path / "raw.tiff", viewer.Origin(camera=lg.load_camera("camera.toml"), patch=camera.patch)
    )
    sizes, seen = shown.planes.positions, np.asarray(shown.planes.data)
    patches = f"--patches={sizes[0]}:{sizes[-1]}:x{len(sizes)}"
    assert main(["render", "raw.tiff", "--camera", "camera.toml", patches, "-o", "stack.tiff"]) == 0
    python = lg.render_stack(raw, camera.calibration, sizes, focus=camera.patches_on_raw())
    level = float(np.max(python)) / 255
    assert np.abs(np.asarray(lg.open("stack.tiff").data) - python).max() < level
    assert np.abs(seen - python).max() < level


def test_depths_of_a_microscope_agree_in_metres(tmp_path, monkeypatch):
    """Lenslets show a texture that moves by 0.3 lenslets a view; the page counts in the same depths."""
    monkeypatch.chdir(tmp_path)
    camera = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        lenslets={"count": (17, 17)}, sensor={"shape": (260, 260)}
    )
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    y, x = np.meshgrid(*map(np.arange, camera.sensor.shape), indexing="ij")
    (dy, dx), pitch = camera.calibration.offset(y, x), camera.calibration.lattice.pitch
    y, x = (y - dy) / pitch - 0.3 * dy, (x - dx) / pitch - 0.3 * dx
    raw = 5 + np.sin(0.9 * y + 0.4 * x) + np.cos(1.1 * x) + np.sin(0.7 * y - 0.8 * x) + np.cos(1.3 * y)
    lg.save(lg.RawImage(raw.astype(np.float32)), "raw.tiff")
    assert main(["depth", "raw.tiff", "--camera", "camera.toml", "-o", "map.tiff"]) == 0
    written = np.asarray(lg.open("map.tiff").data)
    shown = viewer.open_exhibit(tmp_path / "raw.tiff", viewer.Origin(camera=camera))
    depths = shown.metres(np.asarray(lg.depth.disparity_of(shown.depth(), shown.views).values))
    np.testing.assert_allclose(depths, written, rtol=1e-4, atol=1e-9)
    assert 1e-6 < np.abs(np.median(written)) < 1e-3


def test_depths_of_a_camera_1_are_shown_in_metres_from_the_focused_plane(open_page):
    camera = lg.load_camera("thesis-plenoptic-1")
    focal_length = camera.main_lens.focal_length
    rng = np.random.default_rng(1)
    views = lg.LightField(
        rng.random((5, 5, 16, 20)), lg.Grid((5, 5), 1e-3), lg.Grid((16, 20), 1e-4), 2 * focal_length
    )
    alphas = np.linspace(0.9, 1.1, 320).reshape(16, 20)
    depth = lg.DepthMap(alphas, np.ones(alphas.shape), "alpha", error=np.full(alphas.shape, 1e-3))

    def metres(disparities):
        found = lg.DepthMap(disparities, np.ones(disparities.shape), "disparity")
        return lg.depth.metric(found, views, focal_length=focal_length).values

    shown = viewer.Exhibit("views", views=views, depth=lambda: depth, metres=metres)
    expected = lg.depth.metric(depth, views, focal_length=focal_length).values
    with served(shown) as address:
        page = open_page(f"{address}#mode=depth")
        page.wait("Boolean(lumigraph.app.main.model.arrays.error)")
        page.set(mode="depth")
        for y, x in ((0, 0), (7, 3), (15, 19)):
            page.page.mouse.move(*page.window_place(y, x))
            page.wait("lumigraph.app.main.readout.textContent.includes('depth ')")
            words = page.page.inner_text(".readout")
            found, unit = words.split("depth ")[1].split()[:2]
            assert float(found.replace("−", "-")) * {"mm": 1e-3, "µm": 1e-6}[unit] == pytest.approx(
                expected[y, x], abs=5e-5
            )
            assert "lenslets" in words
        ends = [page.page.inner_text(f"#legend-{end}") for end in ("low", "high")]
        assert [end[0] for end in ends] == (["−", "+"] if expected[0, 0] < 0 else ["+", "−"])
        assert page.page.inner_text("#legend-label") == "from focus"


@pytest.mark.parametrize("kind", ["camera whose range was widened", "microscope"])
def test_depths_in_metres_are_those_of_the_command_line_however_the_page_counts_lenslets(kind):
    if kind == "microscope":
        camera = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
            lenslets={"count": (9, 9)}, sensor={"shape": (140, 140)}
        )
    else:
        camera = lg.PlenopticCamera(
            wavelength=550e-9,
            object_distance=0.24,
            main_lens={"focal_length": 0.12},
            lenslets={"pitch": 150e-6, "focal_length": 20e-3, "count": (61, 61)},
            sensor={"pixel_pitch": 10e-6},
        )
    raw = lg.RawImage(np.random.default_rng(0).random(camera.sensor.shape).astype(np.float32))
    shown = opening.of_raw("raw", raw, camera.calibration, origin=viewer.Origin(camera=camera))
    assert shown.relative == (kind != "microscope")
    views = lg.decode(lg.prepare(raw, camera.calibration), camera.calibration)
    alphas, depths = object_depths(shown.views, shown.metres)
    found = lg.DepthMap(np.array([alphas]), np.ones((1, len(alphas))), "alpha")
    same = lg.depth.disparity_of(found, shown.views)  # in lenslets a view, which widening leaves as they are
    if kind == "microscope":
        expected = lg.depth.defocus(same, views, camera.depth_per_alpha)
    else:
        expected = lg.depth.metric(same, views, focal_length=0.12)
        assert np.ptp(lg.depth.alpha_of(same, views).values) > 1.5 * np.ptp(alphas)
    np.testing.assert_allclose(depths, expected.values[0], rtol=1e-6, atol=1e-12)
    assert min(depths) < 0 < max(depths)
