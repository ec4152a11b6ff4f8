"""Every verb does what its help says, for people and for machines."""

import json
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.cli import app as cli_app
from lumigraph.core.calibration import Calibration
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Stage
from lumigraph.core.raw import RawImage
from lumigraph.errors import SamplingWarning
from lumigraph.instruments import load_camera

VERBS = (
    "process", "view", "calibrate", "decode", "render", "refocus", "depth", "deconvolve", "simulate",
    "design", "information", "optimise", "tolerance", "sweep", "wavefront",
    "measure", "board", "chart", "datasheet", "twin", "align",
    "batch", "dataset", "convert",
    "demo", "samples", "catalogue", "reproduce",
)  # fmt: skip
PROGRAM = [sys.executable, "-c", "import sys; from lumigraph.cli import main; sys.exit(main())"]


def test_help_lists_every_verb_and_says_what_it_does(lumigraph):
    result = lumigraph("--help")
    assert (result.code, result.err) == (0, "")
    for verb in VERBS:
        assert f"│ {verb} " in result.out
    assert lumigraph().out == result.out


def test_the_nine_everyday_verbs_come_first_and_the_others_in_groups(lumigraph):
    lines = lumigraph("--help").out.splitlines()
    titles = [line.strip("╭╮─ ") for line in lines if line.startswith("╭")]
    assert titles == [*cli_app.GROUPS, "The program"]
    words = [line.split()[1] for line in lines if line.startswith("│") and len(line.split()) > 1]
    assert [word for word in words if word in VERBS][:9] == list(VERBS[:9])


@pytest.mark.parametrize(
    ("verb", "titles"),
    [
        ("refocus", ["Raw image", "Focus", "Picture", "Output"]),
        ("simulate", ["Light", "Scene", "Output"]),
        ("deconvolve", ["Raw image", "Object", "Method", "Adaptive optics", "Several raw images", "Output"]),
    ],
)
def test_options_of_long_verbs_stand_in_sections(lumigraph, verb, titles):
    lines = lumigraph(verb, "--help").out.splitlines()
    found = [line.strip("╭╮─ ") for line in lines if line.startswith("╭")]
    assert found == ["Arguments", "Parameters", *titles]


def test_a_file_in_the_place_of_a_verb_is_shown(lumigraph, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("lumigraph.viewer.serve", lambda site, **options: opened.append(site))
    io.save(np.ones((30, 40), np.float32), tmp_path / "raw.tiff")
    assert lumigraph("raw.tiff", "--no-open").code == 0
    assert len(opened) == 1
    assert lumigraph("row.tiff").code == cli_app.USAGE
    (tmp_path / "depth").write_bytes((tmp_path / "raw.tiff").read_bytes())
    assert "depth needs --output" in lumigraph("depth", "raw.tiff").err  # a verb goes before a file


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(lumigraph, verb):
    result = lumigraph(verb, "--help")
    assert (result.code, result.err) == (0, "")
    assert f"Example: lumigraph {verb}" in result.out
    assert "--json" in result.out
    assert "--debug" in result.out


def test_help_is_quick_because_nothing_slow_is_imported():
    slow = "numpy|scipy|matplotlib|PIL|zarr|pydantic|tifffile|jinja2"
    code = (
        "import sys; from lumigraph.cli import main; main(['--help']); main(['simulate', '--help']);"
        f"print([m for m in '{slow}'.split('|') if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


def test_the_version_is_printed(lumigraph):
    assert lumigraph("--version").out.strip() == "0.2.0"


def test_design_prints_a_table_and_json(lumigraph, bench):
    result = lumigraph("design", "camera.toml")
    assert (result.code, result.err) == (0, "")
    assert "plenoptic camera at 550 nm" in result.out
    values = json.loads(lumigraph("design", "camera.toml", "--json").out)
    assert values["separation"] == pytest.approx(0.2)
    assert lumigraph("design", "thesis-plenoptic-1").code == 0


def test_design_draws_the_rays(lumigraph, bench):
    assert lumigraph("design", "camera.toml", "--plot", "rays.png").code == 0
    assert io.open("rays.png").data.ndim == 3
    assert lumigraph("design", "camera.toml", "--plot", "rays.svg").code == 0
    assert "<svg" in Path("rays.svg").read_text()


def test_simulate_writes_a_raw_image(lumigraph, bench):
    words = ("--scene", "pinhole", "--coherence", "coherent")
    result = lumigraph("simulate", "camera.toml", *words, "-o", "raw.zarr", "--json")
    assert (result.code, result.err) == (0, "")
    values = json.loads(result.out)
    raw = io.open("raw.zarr")
    assert (list(raw.shape), raw.pixel_pitch, raw.data.dtype) == (values["shape"], 8e-6, np.dtype("float32"))
    assert values["largest"] == raw.data.max()


def test_simulate_adds_noise_that_the_seed_repeats(lumigraph, bench):
    common = ("simulate", "camera.toml", "--scene", "siemens_star", "--coherence", "coherent", "--noise")
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert lumigraph(*common, "--depth", "-1 mm", "--seed", seed, "-o", f"{name}.tiff").code == 0
    a, b, c = (io.open(f"{name}.tiff") for name in "abc")
    assert (a.bit_depth, a.data.dtype) == (12, np.dtype("uint16"))
    np.testing.assert_array_equal(a.data, b.data)
    assert np.any(a.data != c.data)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--coherence", "coherent"), "Coherent()"),
        ((), "Incoherent(accuracy=0.001)"),
        (("--accuracy", "1e-4"), "Incoherent(accuracy=0.0001)"),
        (("--coherence", "snapshots"), "Snapshots(count=100, coherence_index=None, rng=7)"),
        (("--coherence", "tilted", "--na", "0.01", "--count", "5"), "TiltedWaves(count=5, na=0.01)"),
        (
            ("--coherence", "partial", "--na", "0.01", "--accuracy", "0.01"),
            "PartiallyCoherent(source=ExtendedSource(lamp=Disc(radius=0.01), distance=-0.2), accuracy=0.01)",
        ),
    ],
)
def test_simulate_passes_the_light_and_the_scene_on(lumigraph, bench, monkeypatch, words, expected):
    seen = {}

    def simulate(camera, scene, coherence, *, spectrum, progress, medium):
        assert spectrum is None
        assert medium is None
        seen.update(scene=scene, coherence=coherence)
        return io.open(bench / "raw.tiff")

    monkeypatch.setattr("lumigraph.simulation.simulate", simulate)
    scenes = ("--scene", "raw.tiff", "--depth", "-3 mm", "--scene", "white", "--depth", "1 mm")
    point = ("--point", "-1 mm, 0 mm, 5 mm")
    result = lumigraph("simulate", "camera.toml", *scenes, *point, *words, "--seed", 7, "-o", "out.tiff")
    assert (result.code, result.err) == (0, "")
    assert repr(seen["coherence"]) == expected
    photo, _, points = seen["scene"].parts
    assert photo.dz == pytest.approx(-3e-3)
    np.testing.assert_allclose(points.positions, [[-1e-3, 0, 5e-3]])


def test_simulate_tells_the_estimated_error(lumigraph, bench, monkeypatch):
    raw = replace(io.open(bench / "raw.tiff"), metadata={"estimated_error": 0.0523})
    monkeypatch.setattr("lumigraph.simulation.simulate", lambda *_, **__: raw)
    words = ("simulate", "camera.toml", "--scene", "white", "-o", "out.tiff")
    assert "estimated error 5.2 % rms" in lumigraph(*words).out
    assert json.loads(lumigraph(*words, "--json").out)["estimated_error"] == 0.0523


@pytest.mark.parametrize(
    "scene",
    [
        "white",
        "usaf1951",
        "siemens_star",
        "gratings",
        "slanted_edge",
        "edge",
        "pinhole",
        "chessboard",
        "photo",
    ],
)
def test_every_named_scene_fits_the_camera(lumigraph, bench, monkeypatch, scene):
    monkeypatch.setattr("lumigraph.simulation.simulate", lambda *_, **__: io.open(bench / "raw.tiff"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)  # three lenslets see little
        result = lumigraph("simulate", "camera.toml", "--scene", scene, "-o", "out.tiff")
    assert result.code == 0, result.err


def test_calibrate_writes_the_lattice_and_an_overlay(lumigraph, bench):
    known = ("--pixel-pitch", "6.45 um", "--separation", "400 mm", "--lenslet-distance", "18.6 mm")
    result = lumigraph("calibrate", "white.tiff", "-o", "c.toml", *known, "--overlay", "lattice.png")
    assert (result.code, result.err) == (0, "")
    assert "pitch       11.500 px" in result.out
    found = io.open("c.toml")
    assert isinstance(found, Calibration)
    assert found.lattice.pitch == pytest.approx(11.5, abs=0.01)
    assert (found.pixel_pitch, found.separation, found.lenslet_distance) == pytest.approx(
        (6.45e-6, 0.4, 18.6e-3)
    )
    assert io.open("lattice.png").data.ndim == 3


def test_calibrate_explains_what_to_turn(lumigraph, bench):
    camera = (bench / "camera.toml").read_text().replace("[3, 3]", "[12, 13]")
    (bench / "camera.toml").write_text(camera)
    y, x = np.mgrid[:153, :165] - np.array([69.7, 82])[:, None, None]
    cos, sin = np.cos(0.02), np.sin(0.02)  # the lenslets turned by 1.15 degrees
    spots = (np.cos(np.pi * (y * cos - x * sin) / 12.6) * np.cos(np.pi * (x * cos + y * sin) / 12.6)) ** 2
    white = np.rint(3000 * np.clip(1.6 * spots, 0, 1) + 100).astype(np.uint16)
    io.save(RawImage(white), bench / "turned.tiff")
    words = ("--camera", "camera.toml", "--explain", "--report", "page.html", "--rotation", "1")
    result = lumigraph("calibrate", "turned.tiff", "turned.tiff", "-o", "c.toml", *words)
    assert (result.code, result.err) == (0, "")
    assert "the lenslets are turned by +1.1" in result.out
    page = (bench / "page.html").read_text()
    assert page.count("<img") + page.count("<svg") >= 3
    assert "the lenslets are turned by +1.1" in page
    assert lumigraph("calibrate", "white.tiff", "-o", "c.toml", "--explain").code == 1
    none = lumigraph("calibrate", "-o", "c.toml")
    assert (none.code, "no white image is given" in none.err) == (1, True)


def test_calibrate_takes_the_geometry_of_a_camera(lumigraph, bench):
    words = ("--layout", "square", "--pitch", "11.4", "--camera", "camera.toml", "--separation", "201 mm")
    values = json.loads(lumigraph("calibrate", "white.tiff", "-o", "c.toml", *words, "--json").out)
    assert values["pitch_px"] == pytest.approx(11.5, abs=0.01)
    lengths = [values[name] for name in ("pixel_pitch", "separation", "lenslet_distance")]
    assert lengths == pytest.approx([8e-6, 0.201, 2e-3])


def test_decode_and_refocus(lumigraph, bench):
    assert lumigraph("calibrate", "white.tiff", "-o", "c.toml").code == 0
    result = lumigraph("decode", "raw.tiff", "--calibration", "c.toml", "-o", "plain.zarr", "--json")
    assert json.loads(result.out)["shape"][:2] == [11, 11]
    assert lumigraph("decode", "raw.tiff", "--white", "white.tiff", "-o", "views.zarr").code == 0
    plain, views = io.open("plain.zarr"), io.open("views.zarr")
    assert isinstance(views, LightField)
    outer, central = ([v.data[a, a].mean() for v in (plain, views)] for a in (1, 5))
    assert outer[0] < 0.5 * central[0]  # the lenslets' vignetting
    assert outer[1] > 0.7 * central[1]  # divided by the white image
    words = ("--calibration", "c.toml", "--white", "white.tiff", "--no-devignette")
    assert lumigraph("decode", "raw.tiff", *words, "-o", "other.zarr").code == 0
    np.testing.assert_array_equal(io.open("other.zarr").data, plain.data)

    assert lumigraph("refocus", "views.zarr", "--alpha", "1", "-o", "one.tiff").code == 0
    picture = io.open("one.tiff").data
    assert picture.shape == tuple(8 * (n - 1) + 1 for n in views.data.shape[2:])
    words = ("--white", "white.tiff", "--alpha", "1", "-o", "raw-one.tiff")
    result = lumigraph("refocus", "raw.tiff", *words)
    assert result.code == 0
    assert "left out: 0 of" not in result.out
    np.testing.assert_array_equal(io.open("raw-one.tiff").data, picture)


def test_refocus_writes_stacks_and_folders(lumigraph, bench):
    lumigraph("decode", "raw.tiff", "--white", "white.tiff", "-o", "views.zarr")
    result = lumigraph("refocus", "views.zarr", "--alphas", "0.9:1.1:x3", "-o", "stack.tiff", "--json")
    assert json.loads(result.out)["alphas"] == pytest.approx([0.9, 1.0, 1.1])
    pages = [io.open("stack.tiff", page=k).data for k in range(3)]
    assert lumigraph("refocus", "views.zarr", "--alpha", "0.9", "--alpha", "1.1", "-o", "folder").code == 0
    files = sorted(path.name for path in Path("folder").iterdir())
    assert files == ["refocused-000-alpha-0.9000.png", "refocused-001-alpha-1.1000.png"]
    top = max(pages[0].max(), pages[2].max())
    assert pages[0].max() != pages[2].max()
    for name, page in zip(files, (pages[0], pages[2]), strict=True):  # one white for all
        shown = io.open(Path("folder") / name).data / 65535 * top
        np.testing.assert_allclose(shown, np.clip(page, 0, None), atol=top * 1e-5)
    assert (
        lumigraph("refocus", "views.zarr", "--alpha", "0.9", "--oversample", "3", "-o", "three.png").code == 0
    )
    lenslets = io.open("views.zarr").data.shape[2:]
    assert io.open("three.png").shape == tuple(3 * (n - 1) + 1 for n in lenslets)
    fourier = ("--method", "fourier", "--aperture", "0.5")
    assert lumigraph("refocus", "views.zarr", "--alpha", "0.95", *fourier, "-o", "f.png").code == 0


def test_render_takes_the_patch_from_a_camera_or_by_itself(lumigraph, bench):
    result = lumigraph(
        "render", "raw.tiff", "--white", "white.tiff", "--patch", "5.2", "-o", "p.tiff", "--json"
    )
    assert (result.code, result.err) == (0, "")
    values = json.loads(result.out)
    assert values["patch_px"] == 5.2
    assert list(io.open("p.tiff").shape) == values["shape"]
    words = ("simulate", "focused.toml", "--coherence", "coherent", "--scene", "pinhole", "-o", "raw2.tiff")
    assert lumigraph(*words).code == 0
    result = lumigraph("render", "raw2.tiff", "--camera", "focused.toml", "-o", "q.png", "--json")
    assert json.loads(result.out)["patch_px"] == pytest.approx(9.653, abs=1e-3)
    near = lumigraph(
        "render", "raw2.tiff", "--camera", "focused.toml", "--depth", "-1 mm", "-o", "n.png", "--json"
    )
    camera = load_camera("focused.toml")
    assert json.loads(near.out)["patch_px"] == pytest.approx(camera.patch_at(-1e-3))
    words = ("render", "raw2.tiff", "--camera", "focused.toml", "--detail", "0.4 mm", "-o", "d.png", "--json")
    assert json.loads(lumigraph(*words).out)["patch_px"] == pytest.approx(camera.patch_at(0.0, 2500.0))
    refused = lumigraph(*words[:-3], "--patch", "5", "-o", "d.png")
    assert "--detail changes the patch" in refused.err


def test_demo_is_run_in_the_folder(lumigraph, monkeypatch):
    def run(output, progress, living):
        progress(Stage(0.5, "white image"))
        assert callable(living)
        return Path(output) / "report.html"

    monkeypatch.setattr("lumigraph.demo.run", run)
    assert lumigraph("demo", "-o", "here").out == f"Open {Path('here') / 'report.html'}\n"
    assert json.loads(lumigraph("demo", "--json").out)["report"] == str(Path("demo") / "report.html")


def test_verbs_are_listed_as_they_are_registered():
    assert tuple(verb.__name__ for verb in cli_app.VERBS) == VERBS
