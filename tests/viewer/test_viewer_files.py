"""What files become on the page, how arrays travel, and the page as one file."""

import base64
import hashlib
import json
import re
import zlib
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import io, viewer
from lumigraph.cli import main
from lumigraph.core.stack import Stack
from lumigraph.errors import CalibrationError, FormatError, LumigraphError
from lumigraph.io.webp import encode
from lumigraph.rendering.detail import detail
from lumigraph.rendering.refocus import shifts
from lumigraph.viewer import single_file
from lumigraph.viewer.encoding import Coded, white_level
from lumigraph.viewer.exhibit import Exhibit, Planes, comfortable, focal_stack, focus_range
from lumigraph.viewer.opening import is_camera, of_raw, of_stack, of_views, of_volume, open_exhibit, rendered
from lumigraph.viewer.page import MODULES, static
from lumigraph.viewer.parts import Parts
from viewer_pages import two_planes


def field(shape=(3, 3, 8, 10), dtype=np.float32, pitch=1.0, step=1.0):
    data = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    return lg.LightField(data, lg.Grid(shape[:2], step), lg.Grid(shape[2:4], pitch), 20.0)


def unblobbed(blob):
    """Header and numbers of a blob, read as the page reads it."""
    length = int.from_bytes(blob[:4], "little")
    header, content = json.loads(blob[4 : 4 + length]), blob[4 + length :]
    assert (4 + length) % 8 == 0
    kind = np.uint8 if header["bits"] == 8 else np.dtype("<u2")
    if header["coding"] == "plain":
        return header, np.frombuffer(content, kind).reshape(header["shape"])
    planes = np.frombuffer(zlib.decompress(content), np.uint8).reshape(header["bits"] // 8, -1)
    steps = sum(plane.astype(kind) << (8 * k) for k, plane in enumerate(planes)).astype(kind)
    rows = steps.reshape(-1, header["width"] // header["step"], header["step"])
    return header, np.cumsum(rows, axis=1, dtype=kind).reshape(header["shape"])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int64, ">u2", bool])
def test_whole_numbers_travel_unchanged(rng, dtype):
    data = rng.integers(0, 2 if dtype is bool else 200, (3, 4, 5, 3)).astype(dtype)
    coded = Coded.of(data)
    assert (coded.scale, coded.offset) == (1, 0)
    for blob in (coded.as_bytes(), coded.deflated()):
        assert np.array_equal(unblobbed(blob)[1], data)


@pytest.mark.parametrize("shape", [(3, 4, 5), (2, 3), (2, 3, 4, 3), (4, 3, 3), (2, 2, 3, 1)])
def test_deflated_numbers_come_back_whatever_their_shape(rng, shape):
    data = rng.integers(0, 65536, shape, dtype=np.uint16)
    assert np.array_equal(unblobbed(Coded.of(data).deflated())[1], data)


def test_floats_fill_sixteen_bits(rng):
    data = rng.normal(3, 2, (4, 5, 6))
    coded = Coded.of(data)
    assert coded.bits == 16
    assert np.abs(coded.values() - data).max() <= 0.51 * np.ptp(data) / 65535
    assert np.abs(Coded.of(np.array([[0.0, 1e-9]])).values() - [[0, 1e-9]]).max() < 1e-13


def test_values_that_are_not_finite_become_the_least():
    data = np.array([[np.nan, 1.0, -2.0], [np.inf, 0.0, -np.inf]])
    assert Coded.of(data).values()[0].tolist() == pytest.approx([-2, 1, -2])


def test_complex_numbers_are_refused():
    with pytest.raises(FormatError, match="shows real numbers, not complex128"):
        Coded.of(np.ones((2, 2), complex))


def test_white_is_the_top_of_known_bits_else_what_one_in_a_thousand_exceeds():
    assert white_level(np.zeros((2, 2), np.uint16), 12) == 4095
    assert white_level(np.zeros((2, 2), np.uint8)) == 255
    assert white_level(np.array([[1, 900]], np.uint16)) == 900
    assert white_level(np.linspace(0, 1, 10001)) == pytest.approx(0.999)
    assert white_level(np.zeros((3, 3))) == 1


@pytest.mark.parametrize(
    "bad", [np.zeros((2, 2), np.uint16), np.zeros((2, 2, 4), np.uint8), np.zeros(3, np.uint8)]
)
def test_webp_takes_eight_bits_of_grey_or_colour(bad):
    with pytest.raises(FormatError, match="a WebP holds uint8"):
        encode(bad)


def test_webp_has_a_quality_from_1_to_100():
    with pytest.raises(FormatError, match="quality is 0"):
        encode(np.zeros((2, 2), np.uint8), 0)
    assert encode(np.zeros((9, 9, 3), np.uint8), 100)[:4] == b"RIFF"


def test_the_outermost_view_moves_by_fourteen_lenslets_at_most():
    views = field((9, 9, 300, 200), step=10.0)
    low, high = focus_range(views)
    assert np.abs(shifts(views, high)[0]).max() == pytest.approx(14)
    assert (low + high) / 2 == pytest.approx(1)


def test_camera_grids_get_comfortable_factors_and_the_same_pictures(rng):
    views = lg.LightField(rng.random((5, 5, 60, 60)), lg.Grid((5, 5), 1.0), lg.Grid((60, 60), 1.0), 20.0)
    assert focus_range(views)[0] == 0.02  # 3 px per view would be α' = -2
    better, changed = comfortable(views)
    assert changed
    low, high = focus_range(better)
    assert (low, high) == pytest.approx((0.5, 1.5))
    alpha = 1 - (1 - 0.7) * (high - 1) / (6 / 2)  # the same shift per view as 0.7 had
    assert np.abs(lg.refocus(better, alpha, oversample=1) - lg.refocus(views, 0.7, oversample=1)).max() < 1e-9
    assert not comfortable(field(step=10.0))[1]


def test_small_pictures_are_shown_with_more_samples():
    assert [detail(field((2, 2, n, n))) for n in (300, 100, 60, 8)] == [1, 2, 4, 8]


def test_views_are_sent_the_middle_one_first_and_all_once():
    parts = Parts.of(of_views("x", field((3, 5, 8, 10))))
    chunks = parts.about["views"]["chunks"]
    assert chunks[0] == [1 * 5 + 2, 1]
    assert sorted(k for first, count in chunks[1:] for k in range(first, first + count)) == list(range(15))
    site = viewer.site([of_views("x", field((3, 5, 8, 10)))])
    _, numbers = unblobbed(site.resources["data/0/views/0"].future().result(5))
    assert np.array_equal(numbers[0], Coded.of(field((3, 5, 8, 10)).data).numbers[1, 2])


def test_the_table_has_the_page_its_modules_and_nothing_else():
    names = set(viewer.site([of_views("x", field())]).resources)
    arrays = {
        f"data/0/{name}" for name in ("views/0", "views/1", "stack", "depth", "confidence", "error", "sharp")
    }
    assert names == {"", "app/style.css", "data/about", *arrays, *(f"app/{name}" for name in MODULES)}


def test_every_module_is_in_the_table_after_those_that_it_imports():
    from importlib.resources import files

    there = {
        path.name
        for path in files("lumigraph.viewer").joinpath("static").iterdir()
        if path.name.endswith(".js")
    }
    assert set(MODULES) <= there  # other pages keep their modules beside them
    for k, name in enumerate(MODULES):
        assert set(re.findall(r'from "\./([^"]+)"', static(name))) <= set(MODULES[:k])


def test_the_exported_page_allows_its_own_script_alone_and_names_no_other_place(tmp_path):
    name = '</script><img src=x onerror="alert(1)">'
    exhibit = Exhibit(name, views=field(), facts=((name, name),))
    written = viewer.export([exhibit], tmp_path / "page.html")
    text = written.path.read_text()
    assert written.arrays["0/views"] > 0
    script = re.search(r'<script type="module">(.*?)</script>', text, re.DOTALL)[1]
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)[1]
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', text)[1]
    for content, rule in ((script, "script-src"), (style, "style-src")):
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert f"{rule} 'sha256-{digest}'" in policy
    assert "unsafe" not in policy
    assert "connect-src" not in policy  # default-src 'none' holds
    assert not re.findall(r"https?://[a-z]", text)
    assert "<img" not in text
    assert text.count("</script>") == len(re.findall(r"<script[ >]", text))


def test_quality_makes_the_page_smaller(tmp_path):
    views = two_planes()
    sizes = [
        viewer.export([of_views("x", views)], tmp_path / f"{q}.html", quality=q).arrays["0/views"]
        for q in (30, 90, 100)
    ]
    assert sizes == sorted(sizes)
    assert sizes[2] > 2 * sizes[0]


def test_a_page_too_large_for_a_browser_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(single_file, "LARGEST", 1000)
    with pytest.raises(LumigraphError, match="which browsers do not open"):
        viewer.export([of_views("x", field())], tmp_path / "page.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("quality", "name", "match"), [(0, "a.html", "quality is 0"), (90, "a.png", "wrong extension")]
)
def test_exports_that_cannot_be_are_refused(tmp_path, quality, name, match):
    with pytest.raises(LumigraphError, match=match):
        viewer.export([of_views("x", field())], tmp_path / name, quality=quality)


def test_light_fields_stacks_and_raw_images_are_opened(tmp_path, rng):
    lg.save(field(step=10.0), tmp_path / "views.zarr")
    assert open_exhibit(tmp_path / "views.zarr").views is not None
    raw = lg.RawImage(rng.integers(0, 255, (50, 60), dtype=np.uint8))
    lg.save(raw, tmp_path / "raw.png")
    shown = open_exhibit(tmp_path / "raw.png")
    assert shown.raw is not None
    assert shown.views is None
    exhibit = of_stack("s", Stack(rng.random((3, 4, 5)), (1.2, 0.8, 1.0), "alpha"))
    assert exhibit.planes.positions == (0.8, 1.0, 1.2)
    volume = of_volume("v", lg.Volume(rng.random((3, 4, 5)), lg.Grid((4, 5), 1e-6), (-1e-6, 0, 1e-6)))
    assert dict(volume.facts)["Steps"] == "1 µm, 1 µm, 1 µm"


def test_a_raw_image_with_a_calibration_is_decoded(tmp_path, rng):
    lattice, none = lg.Lattice.square(8.0, origin=(4, 4)), np.zeros((0, 2))
    lg.save(lg.RawImage(rng.integers(1, 255, (64, 80), dtype=np.uint8)), tmp_path / "raw.png")
    lg.save(lg.Calibration(lattice, (64, 80), none, none, 0.0), tmp_path / "calibration.toml")
    exhibit = open_exhibit(tmp_path / "raw.png", viewer.Origin(calibration=tmp_path / "calibration.toml"))
    assert exhibit.views.data.shape[:2] == (8, 8)
    assert Parts.of(exhibit).about["raw"]["lattice"]["pitch"] == pytest.approx(8)
    focused = open_exhibit(tmp_path / "raw.png", viewer.Origin(tmp_path / "calibration.toml", patch=3.0))
    assert focused.planes.label == "Patch"
    assert focused.planes.positions[0] == pytest.approx(3 / 1.8)
    lg.save(lg.Calibration(lattice, (64, 81), none, none, 0.0), tmp_path / "other.toml")
    with pytest.raises(CalibrationError, match="64 x 80 pixels but its calibration"):
        open_exhibit(tmp_path / "raw.png", viewer.Origin(calibration=tmp_path / "other.toml"))
    with pytest.raises(FormatError, match="where a white image is needed"):
        open_exhibit(tmp_path / "raw.png", viewer.Origin(white=tmp_path / "other.toml"))
    with pytest.raises(FormatError, match="where a calibration is needed"):
        open_exhibit(tmp_path / "raw.png", viewer.Origin(calibration=tmp_path / "raw.png"))
    with pytest.raises(FormatError, match="holds a calibration, of which there is no picture"):
        open_exhibit(tmp_path / "other.toml")


@pytest.mark.parametrize("name", ["thesis-plenoptic-1", "galilean", "lfm-fourier"])
def test_a_camera_is_shown_things_at_several_depths(tmp_path, name):
    camera = lg.load_camera(name)
    if name != "lfm-fourier":
        camera = camera.replace(lenslets={"count": (9, 9)}, sensor={"shape": None})
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    seen = []
    shown = open_exhibit(tmp_path / "camera.toml", progress=seen.append)
    assert "Simulated" in dict(shown.facts)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(0.4)
    if shown.planes is not None:
        assert len(shown.planes.positions) == 13
        first, last = np.asarray(shown.planes.data)[[0, -1]]
        assert np.abs(first - last).mean() > 0.02 * first.mean()
    else:
        views = np.asarray(shown.views.data)
        assert views.shape[0] == (3 if name == "lfm-fourier" else 31)
        first, last = views[views.shape[0] // 2, [views.shape[1] // 4, -1 - views.shape[1] // 4]]
        assert np.abs(first - last).mean() > 0.01 * views.mean()  # things have moved


def test_galilean_patches_ascend_too(rng):
    none = np.zeros((0, 2))
    calibration = lg.Calibration(lg.Lattice.square(8.0, origin=(4, 4)), (64, 80), none, none, 0.0)
    planes = rendered(lg.RawImage(rng.random((64, 80))), calibration, -3.0)
    assert list(planes.positions) == sorted(planes.positions)
    assert max(planes.positions) < 0


def test_views_need_no_calibration(tmp_path):
    lg.save(field(), tmp_path / "views.zarr")
    with pytest.raises(FormatError, match="holds no raw image"):
        open_exhibit(tmp_path / "views.zarr", viewer.Origin(patch=3.0))


def test_an_exhibit_without_anything_is_refused():
    with pytest.raises(LumigraphError, match="nothing to show"):
        Exhibit("empty")
    with pytest.raises(LumigraphError, match="4 channels"):
        of_raw("rgba", lg.RawImage(np.zeros((3, 3, 4), np.uint8)))
    with pytest.raises(LumigraphError, match="must be \\(n, y, x"):
        Planes(np.zeros((3, 4)), (1.0,))
    with pytest.raises(FormatError, match="NaN"):
        of_views(
            "nan",
            field((2, 2, 3, 3)).__class__(
                np.full((2, 2, 3, 3), np.nan), lg.Grid((2, 2), 1.0), lg.Grid((3, 3), 1.0), 1.0
            ),
        )


def test_the_fallback_stack_is_the_librarys(rng):
    views = field((3, 3, 12, 14), step=10.0)
    planes = focal_stack(views, 3)
    assert np.array_equal(planes.data, lg.refocus_stack(views, planes.positions, oversample=detail(views)))


def test_camera_files_are_told_from_calibrations(tmp_path):
    (tmp_path / "camera.toml").write_text('kind = "plenoptic"\n')
    (tmp_path / "other.toml").write_text("[lattice]\n")
    (tmp_path / "broken.toml").write_text("= 3")
    found = [is_camera(tmp_path / name) for name in ("camera.toml", "other.toml", "broken.toml", "none.toml")]
    assert found == [True, False, False, False]


def test_the_command_exports_and_tells_the_size(tmp_path, capsys):
    io.save(field(step=10.0), tmp_path / "views.zarr")
    page = tmp_path / "page.html"
    assert main(["view", str(tmp_path / "views.zarr"), "--export", str(page)]) == 0
    assert re.search(r"[\d.]+ k?M?B \(views [\d.]+ kB, poster [\d.]+ kB, stack", capsys.readouterr().out)
    assert main(["view", str(tmp_path / "views.zarr"), "--export", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["bytes"] == page.stat().st_size


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["--port", "70000"], "--port is 70000"),
        (["--quality", "0"], "--quality is 0"),
        (["--export", "page.png"], "wrong extension"),
        (["--calibration", "c.toml"], "holds no raw image"),
    ],
)
def test_wrong_options_are_told_in_one_line(tmp_path, capsys, words, match):
    io.save(field(), tmp_path / "views.zarr")
    assert main(["view", str(tmp_path / "views.zarr"), "--no-open", *words]) == 1
    error = capsys.readouterr().err
    assert match in error
    assert error.count("\n") == 1


def test_the_address_is_printed_on_one_line(tmp_path, capsys, monkeypatch):
    io.save(field(step=10.0), tmp_path / "views.zarr")
    monkeypatch.setattr("uvicorn.Server.run", lambda self, sockets: None)
    assert main(["view", str(tmp_path / "views.zarr"), "--no-open"]) == 0
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/\n", capsys.readouterr().out)


def test_the_program_in_the_docs_runs(tmp_path, monkeypatch, capsys):
    text = (Path(__file__).parents[2] / "docs" / "how-to" / "viewer.md").read_text()
    monkeypatch.chdir(tmp_path)
    for code in re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        exec(code, {})
    assert "MB" in capsys.readouterr().out
