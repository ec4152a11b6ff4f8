"""Folders of views, ESLF mosaics, PFM, PLY and films: the right way round, and exactly what was saved."""

import sys

import av
import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import map_coordinates

import lumigraph as lg
import lumigraph.io as io
from data_folder import real
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError, GeometryError, SamplingWarning
from lumigraph.io import cameras as cameras_module
from lumigraph.io import eslf, movie, views
from lumigraph.io.cameras import from_cameras


def light_field(rng, dtype="uint8", channels=(3,), shape=(3, 4, 6, 8)):
    data = (rng.random((*shape, *channels)) * 200).astype(dtype)
    return LightField(data, Grid(shape[:2], (0.1 / 3, 0.2)), Grid(shape[2:], (1e-4, 2e-4)), 0.4)


@pytest.mark.parametrize(
    ("dtype", "channels"),
    [
        ("uint8", (3,)),
        ("uint8", ()),
        ("uint16", ()),
        ("uint16", (3,)),
        ("float32", ()),
        ("float64", (3,)),
        ("uint8", (2,)),
    ],
)
def test_a_folder_of_views_survives_exactly(tmp_path, rng, dtype, channels):
    saved = light_field(rng, dtype, channels)
    lg.save(saved, tmp_path / "views")
    back = lg.open(tmp_path / "views")
    assert (back.aperture, back.lenslets, back.separation) == (saved.aperture, saved.lenslets, 0.4)
    assert back.data.dtype == saved.data.dtype
    np.testing.assert_array_equal(back.data, saved.data)
    assert len(list((tmp_path / "views").glob("view_*"))) == 12


def test_the_first_view_of_a_folder_is_seen_from_the_top_left(tmp_path):
    # Near things move with u and v, and against the camera: the camera on the right sees them farther left.
    # A near point at disparity 2 px per view, in views of 3 x 3 cameras.
    cameras = np.zeros((3, 3, 21, 21), np.uint8)
    for row in range(3):
        for column in range(3):
            cameras[row, column, 10 - 2 * (row - 1), 10 - 2 * (column - 1)] = 255
    found = from_cameras(cameras)
    sharp = lg.refocus(found, 1 - 2 / cameras_module.PIXELS, oversample=1)
    assert np.asarray(sharp).max() > 0.7 * 255  # magnified by 2 %, hence a little spread
    assert np.asarray(lg.refocus(found, 1 + 2 / cameras_module.PIXELS, oversample=1)).max() < 0.4 * 255
    lg.save(found, tmp_path / "views")
    np.testing.assert_array_equal(lg.open(tmp_path / "views" / "view_00_02.png").data, cameras[0, 2])


def test_real_hci_views_are_the_right_way_round():
    # A point of disparity d moves by +d pixels per view along u and v; the other sign differs 4-fold.
    found = lg.open(real("hci_antinous"))
    disparity = lg.open(real("hci_antinous", "gt_disp_lowres.pfm")).data
    assert found.data.shape == (9, 9, 512, 512, 3)
    assert disparity.min() == pytest.approx(-3.1308, abs=1e-4)
    green = found.data[..., 1]
    y, x = np.mgrid[100:400:2, 100:400:2].astype(float)
    d = disparity[100:400:2, 100:400:2]
    for v, u in ((0, 1), (1, 0)):
        errors = [
            np.abs(map_coordinates(green[4 + v, 4 + u].astype(float), [y + s * d * v, x + s * d * u], order=1)
                   - green[4, 4, 100:400:2, 100:400:2]).mean()
            for s in (1, -1)
        ]  # fmt: skip
        assert errors[0] < errors[1] / 3


def test_hci_names_and_parameters(tmp_path, rng):
    for k in range(6):
        io.save(np.full((4, 5), k, np.uint8), tmp_path / f"input_Cam{k:03}.png")
    with pytest.raises(
        FormatError, match=r"holds 6 views up to input_Cam005\.png, and how many stand in a row"
    ):
        io.open(tmp_path)
    (tmp_path / "parameters.cfg").write_text(
        "[extrinsics]\nnum_cams_x = 3\n[meta]\ndisp_min = -1\ndisp_max = 2.5\n"
    )
    found = io.open(tmp_path)
    np.testing.assert_array_equal(found.data[..., 0, 0], [[5, 4, 3], [2, 1, 0]])
    assert views.parameters(tmp_path)["disp_max"] == 2.5
    assert io.contents(tmp_path)[0].about == "2 x 3 views, disparity -1 to 2.5 px"
    (tmp_path / "parameters.cfg").write_text("no section")
    with pytest.raises(FormatError, match="is not an INI file"):
        io.open(tmp_path)


def test_a_star_of_hci_views_stands_where_its_numbers_say(tmp_path):
    for k in (0, 2, 4, 6, 7, 8, 12, 16, 20, 24):
        io.save(np.full((4, 5), k + 1, np.uint8), tmp_path / f"input_Cam{k:03}.png")
    with pytest.warns(
        SamplingWarning, match="holds 10 of 5 x 5 views; row/column 0/1, 0/3, 1/0 ... are left"
    ):
        found = io.open(tmp_path)
    assert found.data[2, 2, 0, 0] == 13  # the middle
    assert found.data[4, 4, 0, 0] == 1
    assert found.valid.sum() == 10 * 4 * 5


def test_stanford_names_tell_the_spacing_of_the_cameras(tmp_path):
    for row in range(3):
        for column in range(2):
            name = f"out_{row:02}_{column:02}_{-776.88 + 30 * row:.6f}_{533.057 - 40 * column:.6f}_.png"
            io.save(np.full((4, 5, 3), 10 * row + column, np.uint8), tmp_path / name)
    found = io.open(tmp_path)
    assert found.aperture.pitch == pytest.approx((30, 40))
    # y grows with the rows, x falls with the columns: column 0 stands farthest right.
    np.testing.assert_array_equal(found.data[..., 0, 0, 0], [[20, 21], [10, 11], [0, 1]])


def test_a_view_that_is_missing_or_different_is_named(tmp_path):
    for name in ("view_01_01", "view_01_02", "view_02_02"):
        io.save(np.ones((4, 5), np.uint8), tmp_path / f"{name}.png")
    with pytest.warns(SamplingWarning, match="holds 3 of 2 x 2 views; row/column 1/0 are left out"):
        found = io.open(tmp_path)
    np.testing.assert_array_equal(found.valid[..., 0, 0], [[True, False], [True, True]])
    assert not found.data[0, 1].any()
    io.save(found, tmp_path / "kept.zarr")
    np.testing.assert_array_equal(io.open(tmp_path / "kept.zarr").valid, found.valid)
    assert io.contents(tmp_path)[0].about == "3 of 2 x 2 views"
    io.save(np.ones((4, 6), np.uint8), tmp_path / "view_02_01.png")
    with pytest.raises(FormatError, match="all views must be alike"):
        io.open(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(FormatError, match="holds no views: names such as"):
        io.open(tmp_path / "empty")
    io.save(light_field(np.random.default_rng(1), shape=(2, 2, 4, 5)), tmp_path / "colour")
    with pytest.raises(FormatError, match=r"declares 2 x 2 x 4 x 5 x 3 = 60 pixels but at most 20"):
        io.open(tmp_path / "colour", max_pixels=20)


def test_a_folder_that_holds_other_things_is_not_replaced(tmp_path, rng):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "precious.txt").write_text("mine")
    with pytest.raises(FormatError, match="is a folder that holds other things"):
        io.save(light_field(rng), tmp_path / "mine")
    io.save(light_field(rng), tmp_path / "views")
    io.save(light_field(rng, shape=(2, 2, 4, 4)), tmp_path / "views")
    assert len(list((tmp_path / "views").iterdir())) == 5
    (tmp_path / "views" / "views.json").write_text("{}")
    with pytest.raises(FormatError, match=r"was not written by lumigraph\. Remove it"):
        io.open(tmp_path / "views")


def test_views_scaled_by_a_white_become_png(tmp_path, rng):
    io.save(light_field(rng, "float32"), tmp_path / "views", white=200.0)
    assert (tmp_path / "views" / "view_00_00.png").is_file()


@pytest.mark.parametrize("channels", [(), (3,)])
def test_an_eslf_mosaic_survives(tmp_path, rng, channels):
    saved = light_field(rng, channels=channels)
    io.save(saved, tmp_path / "a_eslf.png")
    back = io.open(tmp_path / "a_eslf.png", views=(3, 4))
    np.testing.assert_array_equal(back.data, saved.data)
    mosaic = Image.open(tmp_path / "a_eslf.png")
    assert mosaic.size == (8 * 4, 6 * 3)
    np.testing.assert_array_equal(np.asarray(mosaic)[3, 4], saved.data[-1, -1, 1, 1])
    (tmp_path / "a.png").write_bytes((tmp_path / "a_eslf.png").read_bytes())
    np.testing.assert_array_equal(io.open(tmp_path / "a.png", views=(3, 4)).data, saved.data)
    with pytest.raises(FormatError, match="has 18 x 32 pixels, no multiple of 7 x 7 views"):
        io.open(tmp_path / "a_eslf.png", views=7)


@pytest.mark.parametrize("side", [5, 9, 14])
def test_the_views_of_a_mosaic_are_guessed_and_told(tmp_path, rng, side):
    # Vignetted blocks on a picture that changes slowly.
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    block = np.clip(1.4 - np.hypot(y, x) / (side / 2), 0, 1)
    picture = np.kron(0.5 + 0.5 * rng.random((12, 20)), np.ones((side, side))) * np.tile(block, (12, 20))
    io.save((picture * 255).astype(np.uint8), tmp_path / "m.png")
    (tmp_path / "m.png").rename(tmp_path / "m_eslf.png")
    with pytest.warns(UserWarning, match=rf"is read as {side} x {side} views, a guess"):
        found = io.open(tmp_path / "m_eslf.png")
    assert found.data.shape == (side, side, 12, 20)


def test_no_guess_is_made_where_nothing_repeats(rng):
    with pytest.raises(FormatError, match="nothing repeats in 11 x 13 pixels"):
        eslf.guess(rng.random((11, 13)))
    assert eslf.guess(np.zeros((376 * 14, 541 * 14), np.uint8)) == 14


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (1, 1)])
def test_a_pfm_survives_and_stands_bottom_up_in_the_file(tmp_path, rng, shape):
    data = rng.normal(size=shape).astype(np.float32)
    data.flat[0] = np.inf
    io.save(data, tmp_path / "a.pfm")
    np.testing.assert_array_equal(io.open(tmp_path / "a.pfm").data, data)
    content = (tmp_path / "a.pfm").read_bytes()
    assert content.startswith(b"PF\n7 5\n-1.0\n" if len(shape) == 3 else b"Pf\n%d %d\n-1.0\n" % shape[::-1])
    assert content.endswith(data[0].tobytes())
    big = b"Pf\n2 1\n2.5\n" + np.array([1.5, -2], ">f4").tobytes()
    (tmp_path / "b.pfm").write_bytes(big)
    found = io.open(tmp_path / "b.pfm")
    assert (found.data.tolist(), found.metadata) == ([[1.5, -2.0]], {"scale": 2.5})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"Pf\n2 2\n-1\n" + bytes(15), "cut short: its pixels need 16 bytes"),
        (b"Pf\n2 x\n-1\n" + bytes(16), "damaged PFM: its header is"),
        (b"Pf\n2 2\n0\n" + bytes(16), "damaged PFM: its scale is '0'"),
        (b"Pf\n99999999 99999999\n-1\n" + bytes(16), "declares 99999999 x 99999999"),
        (b"P5\n2 2\n255\n" + bytes(4), "is a PNM file, not PFM"),
    ],
)
def test_damaged_pfms_are_named(tmp_path, content, message):
    (tmp_path / "a.pfm").write_bytes(content)
    with pytest.raises(FormatError, match=message):
        io.open(tmp_path / "a.pfm")
    with pytest.raises(FormatError, match="a PFM holds real numbers"):
        io.save(np.ones((2, 2), complex), tmp_path / "b.pfm")


@pytest.mark.parametrize("colours", [None, "uint8", "float"])
@pytest.mark.parametrize("confident", [False, True])
def test_a_cloud_survives(tmp_path, rng, colours, confident):
    points = rng.normal(size=(9, 3)).astype(np.float32)
    chosen = {"uint8": rng.integers(0, 255, (9, 3), np.uint8), "float": rng.random((9, 3))}.get(colours or "")
    cloud = lg.PointCloud(points, chosen, rng.random(9).astype(np.float32) if confident else None)
    lg.save(cloud, tmp_path / "a.ply")
    back = lg.open(tmp_path / "a.ply")
    np.testing.assert_array_equal(back.points, points)
    if chosen is None:
        assert back.colours is None
    else:
        wanted = chosen if colours == "uint8" else np.rint(chosen * 255)
        np.testing.assert_array_equal(back.colours, wanted)
    assert (back.confidence is None) != confident
    # In the file x comes first.
    body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")[2]
    np.testing.assert_array_equal(np.frombuffer(body[:12], "<f4"), points[0, ::-1])


XYZ = b"property float x\nproperty float y\nproperty float z\n"
VERTEX = b"ply\nformat ascii 1.0\nelement vertex "


def test_plys_by_others_are_read(tmp_path):
    head = b"ply\nformat %s 1.0\nelement vertex 1\n" + XYZ + b"%send_header\n"
    (tmp_path / "b.ply").write_bytes(
        head % (b"binary_big_endian", b"element face 0\n") + np.array([1, 2, 3], ">f4").tobytes()
    )
    assert io.open(tmp_path / "b.ply").points.tolist() == [[3, 2, 1]]
    (tmp_path / "a.ply").write_bytes(head % (b"ascii", b"") + b"1 2 3.5\n")
    assert io.open(tmp_path / "a.ply").points.tolist() == [[3.5, 2, 1]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"hello", "is not a PLY file"),
        (b"ply\nformat ascii 1.0\n", "header has no end"),
        (VERTEX + b"1\nproperty float x\nend_header\n1\n", "holds no points x, y, z"),
        (VERTEX + b"1\nproperty list int int x\nend_header\n", "'property list int int x'"),
        (b"ply\nformat ascii 1.0\nelement face 1\nend_header\n", "has 'face' before its points"),
        (VERTEX + b"9999999\n" + XYZ + b"end_header\n1 2 3", "cut short: 9999999 points"),
    ],
)
def test_damaged_plys_are_named(tmp_path, content, message):
    (tmp_path / "a.ply").write_bytes(content)
    with pytest.raises(FormatError, match=message):
        io.open(tmp_path / "a.ply")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.ones((3, 2)),), r"points have shape \(3, 2\) but must be \(n, 3\)"),
        ((np.full((1, 3), np.nan),), "points has 3 NaN"),
        ((np.ones((2, 3)), np.ones((1, 3))), r"colours have shape \(1, 3\) but must have \(2, 3\)"),
        ((np.ones((2, 3)), np.full((2, 3), 200.0)), "colours reach from 200 to 200"),
        ((np.ones((2, 3)), np.ones((2, 3), np.int16)), "colours are int16 but must be uint8"),
        ((np.ones((2, 3)), None, np.ones(3)), "confidence have shape"),
    ],
)
def test_clouds_that_cannot_be(arguments, message):
    with pytest.raises(GeometryError, match=message):
        lg.PointCloud(*arguments)


def frames(n=6, shape=(33, 40, 3)):
    """A bright square that moves right on a dark ground, with a green top."""
    pictures = np.zeros((n, *shape))
    for k in range(n):
        pictures[k, 10:20, 5 * k : 5 * k + 8] = 1.0
    if len(shape) == 3:
        pictures[:, :5] = (0.0, 0.8, 0.0)
    return pictures


def decoded(path):
    if path.suffix == ".gif":
        with Image.open(path) as file:
            pictures = []
            for k in range(file.n_frames):
                file.seek(k)
                pictures.append(np.asarray(file.convert("RGB")))
            return np.stack(pictures), file.info["duration"] / 1000
    with av.open(str(path)) as file:
        rate = float(file.streams.video[0].average_rate)
        return np.stack([f.to_ndarray(format="rgb24") for f in file.decode(video=0)]), 1 / rate


@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
@pytest.mark.parametrize("shape", [(33, 40, 3), (32, 40)])
def test_a_film_shows_the_frames_in_order_upright_and_in_colour(tmp_path, name, shape):
    lg.save(Stack(frames(shape=shape)), tmp_path / name, fps=20, white=1.0)
    found, step = decoded(tmp_path / name)
    assert step == pytest.approx(0.05)
    assert len(found) == 6
    wanted = frames(shape=shape)[..., None] if len(shape) == 2 else frames()
    error = found[:, : shape[0], : shape[1]].astype(float) / 255 - wanted
    assert np.abs(error).mean() < 0.02  # codecs blur edges; a mirrored or shifted film would be 0.05 off
    if len(shape) == 3:
        assert found[3, 2, 20].tolist() == pytest.approx([0, 204, 0], abs=25)


def test_lists_and_16_bits_become_films_too(tmp_path):
    pictures = [(frame * 65535).astype(np.uint16) for frame in frames()]
    lg.save(pictures, tmp_path / "a.gif")
    assert np.abs(decoded(tmp_path / "a.gif")[0].astype(float) / 255 - frames()).mean() < 0.01


@pytest.mark.parametrize(
    ("pictures", "options", "message"),
    [
        (np.ones((2, 3)), {}, r"a film needs frames \(n, y, x\)"),
        (np.ones((2, 3, 4)), {"fps": 0}, "fps is 0 per second but must be above 0"),
        (np.ones((2, 3, 4)), {"fps": 2000}, "fps is 2000 but must be at most 1000"),
        (np.full((2, 3, 4), np.nan), {}, "frames has 24 NaN"),
    ],
)
def test_films_that_cannot_be(tmp_path, pictures, options, message):
    with pytest.raises(FormatError, match=message):
        movie.save_movie(pictures, tmp_path / "a.gif", **options)
    assert not list(tmp_path.iterdir())


def test_films_are_written_not_read_and_mp4_needs_a_package(tmp_path, monkeypatch):
    io.save(Stack(frames()), tmp_path / "a.gif")
    with pytest.raises(FormatError, match="GIF, MP4 files are written, not read"):
        io.open(tmp_path / "a.gif")
    with pytest.raises(FormatError, match="wrong extension"):
        movie.save_movie(frames(), tmp_path / "a.avi")
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(FormatError, match=r"MP4 films need the package av: pip install 'lumigraph\[video\]'"):
        io.save(Stack(frames()), tmp_path / "a.mp4")


@pytest.mark.parametrize("name", ["map.zarr", "map.zarr.zip"])
@pytest.mark.parametrize("quantity", ["disparity", "depth"])
def test_zarr_keeps_the_confidence_the_error_and_the_unit_of_a_depth_map(tmp_path, rng, name, quantity):
    values = rng.random((5, 7), np.float32)
    values[0, 0] = np.nan
    whole = lg.DepthMap(values, rng.random((5, 7)), quantity, rng.random((5, 7)))
    for found in (whole, lg.DepthMap(values, rng.random((5, 7)), quantity)):
        lg.save(found, tmp_path / name)
        back = lg.open(tmp_path / name, lg.DepthMap)
        assert (back.quantity, back.unit, back.values.dtype) == (quantity, found.unit, np.float32)
        np.testing.assert_array_equal(back.values, values)
        np.testing.assert_array_equal(back.confidence, found.confidence)
        assert (back.error is None) == (found.error is None)
        if found.error is not None:
            np.testing.assert_array_equal(back.error, found.error)


def test_a_store_of_a_damaged_depth_map_is_refused(tmp_path):
    lg.save(lg.DepthMap(np.eye(3), np.ones((3, 3)), "disparity"), tmp_path / "d.zarr")
    about = tmp_path / "d.zarr" / "zarr.json"
    about.write_text(about.read_text().replace('"disparity"', '"width"'))
    with pytest.raises(FormatError, match="quantity"):
        lg.open(tmp_path / "d.zarr")


def test_a_depth_map_is_saved_by_its_values(tmp_path):
    lg.save(lg.DepthMap(np.eye(3), np.ones((3, 3)), "disparity"), tmp_path / "d.tiff")
    back = lg.open(tmp_path / "d.tiff")
    assert isinstance(back, RawImage)
    assert (back.data.tolist(), back.metadata) == (
        np.eye(3).tolist(),
        {"quantity": "disparity", "unit": "px"},
    )
