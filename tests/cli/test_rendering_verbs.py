"""`decode`, `refocus` and `render` on the command line: what they take, write and refuse."""

import json

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack


@pytest.fixture
def known(bench):
    """The words that give the bench's calibration and its white image."""
    lattice = Lattice.square(11.5, origin=(69.0, 75.0))
    indices = lattice.indices((0, 138), (0, 150))
    io.save(Calibration(lattice, (139, 151), indices, lattice.position(indices), 0.0), bench / "good.toml")
    return "--calibration", "good.toml", "--white", "white.tiff"


@pytest.fixture
def views(bench):
    """Views of two planes in views.zarr; returns the light field."""
    aperture, lenslets = Grid((5, 5), 1.0), Grid((30, 36), 1.0)
    v, u, t, s = np.meshgrid(aperture.y, aperture.x, lenslets.y, lenslets.x, indexing="ij")
    move = np.where(s < 0, 0.2, -0.3)
    data = 2 + np.sin(0.9 * (t - v * move)) + np.cos(0.8 * (s - u * move) + 0.2 * (t - v * move))
    field = LightField(data.astype(np.float32), aperture, lenslets, 10.0)
    io.save(field, bench / "views.zarr")
    return field


@pytest.fixture
def focused(bench):
    """A raw image of the camera 2.0 in focused.toml: seamless with patches of 9.65 px, at 0 mm."""
    from lumigraph.instruments import load_camera

    camera = load_camera(bench / "focused.toml")
    lattice, shape = camera.calibration.lattice, camera.calibration.shape
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    dy, dx = lattice.offset(y, x)
    size = camera.patch / lattice.pitch
    row, column = y - dy - dy / size, x - dx - dx / size
    raw = 100 + 30 * np.sin(row / 5) * np.cos(column / 7) + 20 * np.sin(column / 3.1 + row / 9)
    raw += 20 * np.sin(row / 3.7 - column / 5.3) + 20 * np.cos(row / 4.3 + column / 11)
    io.save(RawImage(raw.astype(np.float32)), bench / "focused.tiff")
    return camera


def test_decode_finer_and_with_hot_pixels(lumigraph, bench, known):
    raw = io.open("raw.tiff").data.copy()
    raw[[30, 62, 100], [40, 77, 90]] = 4095
    dark = np.zeros_like(raw)
    dark[[30, 62, 100], [40, 77, 90]] = 4000
    io.save(RawImage(raw, bit_depth=12), bench / "hot.tiff")
    io.save(RawImage(dark, bit_depth=12), bench / "dark.tiff")
    words = (*known, "--dark", "dark.tiff", "--hot-pixels", "--samples", "2", "--json")
    result = lumigraph("decode", "hot.tiff", *words, "--interpolation", "linear", "-o", "fine.zarr")
    values = json.loads(result.out)
    assert values["hot_pixels"] == 3
    assert 0 < values["invalid"] < 0.01
    plain = lumigraph("decode", "raw.tiff", *known, "-o", "plain.zarr", "--json")
    shape = json.loads(plain.out)["shape"]
    assert values["shape"] == [*shape[:2], 2 * shape[2] - 1, 2 * shape[3] - 1]
    few = lumigraph("decode", "raw.tiff", *known, "--directions", "3", "-o", "few", "--json")
    assert json.loads(few.out)["shape"][:2] == [3, 3]
    assert io.open("few").data.shape[:2] == (3, 3)


def test_decode_demosaics(lumigraph, bench, known):
    raw = io.open("raw.tiff")
    io.save(RawImage(raw.data, bit_depth=12, bayer="RGGB"), bench / "bayer.tiff")
    result = lumigraph("decode", "bayer.tiff", *known, "-o", "colour.zarr", "--json")
    if io.open("bayer.tiff").bayer is None:
        pytest.skip("the file does not keep the pattern")
    assert json.loads(result.out)["shape"][4:] == [3]


def test_refocus_by_depth_and_as_a_film(lumigraph, views):
    from lumigraph.instruments import load_camera

    words = ("--camera", "camera.toml", "--depth", "-5 mm", "--depth", "5 mm", "--json")
    result = lumigraph("refocus", "views.zarr", *words, "-o", "two.tiff")
    camera = load_camera("camera.toml")
    assert json.loads(result.out)["alphas"] == pytest.approx([camera.alpha(-5e-3), camera.alpha(5e-3)])
    stack = io.open("two.tiff")
    assert isinstance(stack, Stack)
    assert stack.positions == pytest.approx([camera.alpha(-5e-3), camera.alpha(5e-3)])
    words = ("--alphas", "0.8:1.2:x5", "--aperture-shape", "ring", "--interpolation", "band_limited")
    assert lumigraph("refocus", "views.zarr", *words, "-o", "sweep.gif").code == 0
    from PIL import Image

    with Image.open("sweep.gif") as film:
        assert film.n_frames == 5


def test_render_views_sharp_all_over(lumigraph, views):
    words = ("--all-in-focus", "--alphas", "0.7:1.4:x15", "--map", "alpha.tiff", "--json")
    result = lumigraph("render", "views.zarr", *words, "-o", "sharp.tiff")
    values = json.loads(result.out)
    assert values["alpha"][0] < 0.85 < 1.25 < values["alpha"][1]
    alpha, picture = io.open("alpha.tiff").data, io.open("sharp.tiff").data
    times = (picture.shape[0] - 1) // (alpha.shape[0] - 1)
    assert times == 8
    picture = picture[::times, ::times]
    assert np.median(alpha[:, :14]) == pytest.approx(0.8, abs=0.02)
    assert np.median(alpha[:, 22:]) == pytest.approx(1.3, abs=0.02)
    np.testing.assert_allclose(picture[4:-4, 4:14], views.data[2, 2, 4:-4, 4:14], atol=0.1)
    result = lumigraph("render", "views.zarr", "--all-in-focus", "-o", "epi.png", "--json")
    low, high = json.loads(result.out)["alpha"]
    assert low < 0.9 < 1.2 < high


def test_render_moves_the_point_of_view(lumigraph, views):
    words = ("--path", "eight", "--frames", "6", "--radius", "1", "--pivot", "0.8", "--json")
    result = lumigraph("render", "views.zarr", *words, "-o", "look.tiff")
    assert json.loads(result.out)["frames"] == 6
    assert len(io.open("look.tiff")) == 6
    assert lumigraph("render", "views.zarr", "--path", "circle", "--frames", "4", "-o", "c.gif").code == 0


def test_render_finds_the_patches(lumigraph, focused):
    words = ("--camera", "focused.toml", "--depth", "auto", "--map", "patches.tiff", "--json")
    result = lumigraph("render", "focused.tiff", *words, "-o", "sharp.tiff")
    low, high = json.loads(result.out)["patch_px"]
    assert low < focused.patch < high + 0.6
    assert np.median(io.open("patches.tiff").data) == pytest.approx(focused.patch, abs=0.5)
    again = lumigraph("render", "focused.tiff", "--camera", "focused.toml", "--all-in-focus", "-o", "b.tiff")
    assert again.code == 0
    np.testing.assert_array_equal(io.open("b.tiff").data, io.open("sharp.tiff").data)


def test_render_planes_and_finer(lumigraph, focused):
    words = ("--camera", "focused.toml", "--patches", "8:11:x4", "--samples", "6")
    assert lumigraph("render", "focused.tiff", *words, "-o", "planes.tiff").code == 0
    stack = io.open("planes.tiff")
    assert stack.positions == (8, 9, 10, 11)
    words = ("--camera", "focused.toml", "--finer", "2", "--patch", "9.3")
    plain = lumigraph("render", "focused.tiff", *words[:2], "--patch", "9.3", "-o", "a.tiff", "--json")
    fine = lumigraph("render", "focused.tiff", *words, "-o", "b.tiff", "--json")
    ratio = np.divide(json.loads(fine.out)["shape"], json.loads(plain.out)["shape"])
    np.testing.assert_allclose(ratio, 19 / 9, rtol=0.05)
    assert lumigraph("render", "focused.tiff", *words, "--smooth", "1", "-o", "c.tiff").code == 0
    rough, smooth = (np.abs(np.diff(io.open(name).data, axis=1)).mean() for name in ("b.tiff", "c.tiff"))
    assert smooth < 0.8 * rough


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("decode", "raw.tiff", "--camera", "focused.toml", "-o", "v.zarr"), ["focused-plenoptic", "render"]),
        (
            ("decode", "raw.tiff", "--white", "white.tiff", "--samples", "0", "-o", "v.zarr"),
            ["--samples is 0"],
        ),
        (
            ("decode", "raw.tiff", "--white", "white.tiff", "--directions", "0", "-o", "v.zarr"),
            ["--directions is 0"],
        ),
        (("refocus", "views.zarr", "--depth", "5 mm", "-o", "o.png"), ["--depth", "--camera"]),
        (("refocus", "views.zarr", "--dark", "raw.tiff", "--alpha", "1", "-o", "o.png"), ["holds views"]),
        (("render", "views.zarr", "--patch", "5", "-o", "o.png"), ["--all-in-focus", "--path"]),
        (("render", "views.zarr", "--path", "circle", "-o", "o.png"), ["o.png", ".gif"]),
        (("render", "views.zarr", "--path", "line", "--frames", "0", "-o", "o.gif"), ["--frames is 0"]),
        (("render", "views.zarr", "--path", "line", "--radius", "2", "-o", "o.gif"), ["--radius is 2"]),
        (("render", "raw.tiff", "--path", "circle", "-o", "o.gif"), ["raw image", "decode"]),
        (("render", "raw.tiff", "--patch", "5", "--map", "m.tiff", "-o", "o.png"), ["--map", "auto"]),
        (("render", "raw.tiff", "--patch", "5", "--patches", "4:6:x3", "-o", "o.tiff"), ["--patch", "one"]),
        (("render", "raw.tiff", "--patch", "5", "--finer", "9", "-o", "o.png"), ["--finer is 9"]),
        (
            ("render", "raw.tiff", "--patch", "5", "--smooth", "0.1", "-o", "o.png"),
            ["--smooth is 0.1", "--finer"],
        ),
        (
            ("render", "raw.tiff", "--patch", "5", "--finer", "2", "--blend", "-o", "o.png"),
            ["--finer", "--blend"],
        ),
        (("render", "raw.tiff", "--patch", "5", "--focus", "1,x", "-o", "o.tiff"), ["--focus is '1,x'"]),
        (("render", "raw.tiff", "--patches", "4:x:3", "-o", "o.tiff"), ["--patches", "first:last:xN"]),
    ],
)
def test_contradictions_are_refused_in_one_line(lumigraph, views, words, parts):
    result = lumigraph(*words)
    assert result.code == 1
    assert result.err.count("\n") == 1
    assert result.err.startswith("lumigraph: error: ")
    for part in parts:
        assert part in result.err, result.err
