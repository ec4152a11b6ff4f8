"""Files made to mislead, to fill the memory, to hang, or to break the reader: each was once taken."""

import contextlib
import io as streams
import json
import os
import resource
import struct
import subprocess
import sys
import time
import zlib
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest
import tifffile
import zarr
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import lumigraph as lg
from fuzz import seeds
from lumigraph.errors import FormatError
from lumigraph.io import source

PICTURE = np.arange(60 * 50, dtype=np.uint16).reshape(60, 50)


def views(seed=0):
    data = np.random.default_rng(seed).integers(0, 255, (2, 2, 6, 7), np.uint8)
    return lg.LightField(data, lg.Grid((2, 2), 1e-3), lg.Grid((6, 7), 1e-4), 0.01)


def test_every_flipped_bit_of_a_png_is_found_or_changes_nothing(tmp_path, rng):
    """23 of 500 were read silently wrong: the checksums of chunks were not looked at."""
    lg.save(lg.RawImage(PICTURE, 1e-6, 12), tmp_path / "a.png")
    whole, refused = (tmp_path / "a.png").read_bytes(), 0
    for bit in rng.choice(8 * len(whole), 500, replace=False):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        (tmp_path / "b.png").write_bytes(damaged)
        with pytest.raises(FormatError):
            lg.open(tmp_path / "b.png")
        refused += 1
    assert refused == 500


@pytest.mark.parametrize(("tag", "value"), [(273, 0), (273, 4), (279, 0)])
def test_a_tiff_whose_pixels_have_no_place_is_refused(tmp_path, tag, value):
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.tiff")
    content = bytearray((tmp_path / "a.tiff").read_bytes())
    start = struct.unpack("<I", content[4:8])[0]
    for k in range(struct.unpack("<H", content[start : start + 2])[0]):
        at = start + 2 + 12 * k
        if struct.unpack("<H", content[at : at + 2])[0] == tag:
            content[at + 8 : at + 12] = struct.pack("<I", value)
    (tmp_path / "a.tiff").write_bytes(content)
    with pytest.raises(FormatError, match=r"has no place in it|cut short"):
        lg.open(tmp_path / "a.tiff")


def test_libtiff_prints_no_lines_of_its_own_and_standard_error_stays(tmp_path, capfd):
    """Two threads put back what the other had kept: nothing was printed any more."""
    whole = bytearray(
        seeds.by_pillow(np.random.default_rng(0).integers(0, 255, (120, 170), np.uint8), "tiff_lzw")
    )
    for k in range(24):
        whole[900 * k + 500 : 900 * k + 508] = b"\xff" * 8
        (tmp_path / f"{k}.tif").write_bytes(whole)

    def refused(k):
        with pytest.raises(FormatError):
            lg.open(tmp_path / f"{k}.tif")

    before = os.fstat(2)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(refused, range(24)))
    assert os.path.samestat(os.fstat(2), before)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", ["link", "folder link", "pipe"])
def test_links_and_pipes_inside_a_zarr_folder_are_refused(tmp_path, kind):
    """A chunk that led to a file of the system opened as pixels; a pipe hangs."""
    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr")
    chunk = next(path for path in (tmp_path / "a.zarr" / "data" / "c").rglob("*") if path.is_file())
    if kind == "folder link":
        (tmp_path / "a.zarr" / "data" / "c").rename(tmp_path / "elsewhere")
        (tmp_path / "a.zarr" / "data" / "c").symlink_to(tmp_path / "elsewhere")
    else:
        chunk.rename(tmp_path / "elsewhere")
        chunk.symlink_to(tmp_path / "elsewhere") if kind == "link" else os.mkfifo(chunk)
    with pytest.raises(FormatError, match="is not followed"):
        lg.open(tmp_path / "a.zarr")


@pytest.mark.parametrize("name", ["view_01_00.png", "views.json"])
def test_links_inside_a_folder_of_views_are_refused(tmp_path, name):
    lg.save(views(), tmp_path / "v")
    (tmp_path / "v" / name).rename(tmp_path / "elsewhere.png")
    (tmp_path / "v" / name).symlink_to(tmp_path / "elsewhere.png")
    with pytest.raises(FormatError, match="a link, which is not followed"):
        lg.open(tmp_path / "v")


@pytest.mark.parametrize("name", ["out_9999_9999_0_0_.png", "view_9999_0000.png", "input_Cam999999.png"])
def test_names_that_promise_a_hundred_million_views_are_refused_at_once(tmp_path, name):
    """The list of what is missing took 5.6 GB and was still growing."""
    for each in (name, "view_0000_9999.png"):
        lg.save(np.zeros((2, 2), np.uint8), tmp_path / each)
    start = time.process_time()
    with pytest.raises(FormatError, match=r"is missing|no square"):
        lg.open(tmp_path)
    assert time.process_time() - start < 1


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.ini", "[s]\na = a" + " " * 10**6 + "b\n"),
        ("a.ini", "[s]\n" + "a" + " " * 10**6 + "b\n"),
        ("a.ini", "[DEFAULT]\n" + "".join(f"k{k}=1\n" for k in range(40000)) + "[x]\n" * 100000),
        ("a.toml", "a." * 200000 + "b = 1"),
        ("a.toml", "[" + "a." * 200000 + "b]"),
        ("a.toml", 'kind = "calibration"\nx = ' + "[" * 100000),
        ("a.toml", 'kind = "calibration"\n[lattice]\npitch = "1' + " " * 10**6 + '!"'),
    ],
)
def test_text_is_parsed_in_a_time_that_grows_with_its_length(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    start = time.process_time()
    with pytest.raises(FormatError):
        lg.open(tmp_path / name)
    assert time.process_time() - start < 3


def test_quantities_are_parsed_in_a_time_that_grows_with_their_length():
    start = time.process_time()
    for text in ("1" * 10**6 + "!", "1" + " " * 10**6 + "!", 10**400):
        with pytest.raises(FormatError, match="is not a"):
            lg.units.parse(text)
    assert time.process_time() - start < 1


def test_a_parameters_file_beside_views_reads_as_before(tmp_path):
    from lumigraph.io.views import parameters

    text = (
        "# of a benchmark\n[intrinsics]\nfocal_length_mm = 100.0\nNAME: x\n   more\n[meta]\ndisp_min=-3.5\n"
    )
    (tmp_path / "parameters.cfg").write_text(text)
    assert parameters(tmp_path) == {
        "focal_length_mm": 100.0, "intrinsics.focal_length_mm": 100.0,
        "disp_min": -3.5, "meta.disp_min": -3.5,
    }  # fmt: skip


def test_what_a_thousand_times_smaller_file_declares_is_refused_unless_asked_for(tmp_path):
    """331 kB of Zarr declared 10.8 GB."""
    dark = np.zeros((4500, 4500), np.float32)
    lg.save(lg.RawImage(dark), tmp_path / "a.zarr.zip")
    with pytest.raises(FormatError, match="over 1000 times as many") as refused:
        lg.open(tmp_path / "a.zarr.zip")
    assert f"max_pixels={source.MAX_PIXELS + 1}" in str(refused.value)
    assert lg.io.open(tmp_path / "a.zarr.zip", max_pixels=source.MAX_PIXELS + 1).shape == dark.shape
    lg.save(lg.RawImage(dark[:1000]), tmp_path / "small.zarr.zip")
    assert lg.open(tmp_path / "small.zarr.zip").shape == (1000, 4500)


def test_ascii_points_take_no_more_memory_than_their_numbers(tmp_path):
    """18 MB took 1.1 GB: words of all lines were held at once."""
    import tracemalloc

    count = 40_000
    text = f"ply\nformat ascii 1.0\nelement vertex {count}\n"
    text += "".join(f"property float {name}\n" for name in ("x", "y", "z")) + "end_header\n"
    (tmp_path / "a.ply").write_text(text + "1 2 3\n" * count)
    tracemalloc.start()
    assert lg.open(tmp_path / "a.ply").points.shape == (count, 3)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 120 * count


def test_a_jpeg_of_two_thousand_scans_is_refused(tmp_path):
    buffer = streams.BytesIO()
    Image.fromarray(np.zeros((64, 64), np.uint8)).save(buffer, "JPEG", progressive=True)
    content = buffer.getvalue()
    (tmp_path / "few.jpg").write_bytes(content)
    assert lg.open(tmp_path / "few.jpg").shape == (64, 64)
    at = content.rindex(b"\xff\xda")
    (tmp_path / "many.jpg").write_bytes(content[:at] + content[at:-2] * 2000 + content[-2:])
    with pytest.raises(FormatError, match="scans; up to 100 are read"):
        lg.open(tmp_path / "many.jpg")


def test_a_png_whose_header_is_of_the_wrong_type_is_refused(tmp_path):
    for fields in ({"metadata": "text"}, {"metadata": [1]}, {"bit_depth": 10**400}, {"pixel_pitch": 10**400}):
        info = PngInfo()
        info.add_text("lumigraph", json.dumps({"lumigraph": 1, **fields}))
        Image.fromarray(PICTURE.astype(np.uint8)).save(tmp_path / "a.png", pnginfo=info)
        with pytest.raises(FormatError, match=r"header is damaged"):
            lg.open(tmp_path / "a.png")


@pytest.mark.parametrize("digits", [400, 5000])
@pytest.mark.parametrize("field", ["origin = [0.0", "residual_px = 0", "shape = [6"])
def test_whole_numbers_without_end_in_calibrations_are_refused(tmp_path, digits, field):
    lattice = lg.Lattice.square(10.0)
    indices = np.array([[0, 0], [1, 1]])
    lg.save(lg.Calibration(lattice, (60, 50), indices, lattice.position(indices), 0.0), tmp_path / "a.toml")
    text = (tmp_path / "a.toml").read_text()
    assert field in text
    (tmp_path / "a.toml").write_text(text.replace(field, field.rstrip("0.6") + "9" * digits, 1))
    with pytest.raises(FormatError) as refused:
        lg.open(tmp_path / "a.toml")
    assert len(str(refused.value)) <= 400


def test_a_pixel_smaller_than_any_number_is_refused(tmp_path):
    (tmp_path / "a.ini").write_text(
        "[sensor]\npixel_size_x=5e-324\nsize_x=1\nsize_y=1\nz=2\n"
        "[micro_lenses_array]\nz=1\n[micro_lens]\nphysical_size_s=0.1\n"
    )
    with pytest.raises(FormatError, match="no pixel_size_x above 0"):
        lg.open(tmp_path / "a.ini")


def test_what_no_reader_has_foreseen_is_one_line_all_the_same(tmp_path, monkeypatch):
    from lumigraph.io import pfm

    def surprised(*_, **__):
        raise KeyError("x" * 1000)

    lg.save(np.zeros((2, 2), np.float32), tmp_path / "a.pfm")
    monkeypatch.setattr(pfm, "load", surprised)
    with pytest.raises(FormatError, match="is damaged or is not PFM") as refused:
        lg.open(tmp_path / "a.pfm")
    assert len(str(refused.value)) <= 400


def test_messages_keep_their_beginning_and_their_end():
    error = FormatError(f"begin {'x' * 100_000} end")
    assert len(str(error)) == 400
    assert str(error).startswith("begin x")
    assert str(error).endswith("x end")


FULL = """
import resource, sys
import numpy as np, lumigraph as lg
from lumigraph.errors import FormatError
name, size = sys.argv[1], int(sys.argv[2])
rng = np.random.default_rng(1)
def thing(scale):
    data = rng.integers(0, 255, (3, 3, 40 * scale, 50), np.uint8)
    if name.endswith((".png", ".tiff", ".pfm")) and "eslf" not in name:
        return data[0, 0]
    if name.endswith(".gif"):
        return list(data[0])
    if name == "volume.zarr":
        return lg.Volume(np.float32(data[0]), lg.Grid(data.shape[2:], 1e-6), (0.0, 1e-6, 2e-6))
    if name.endswith(".ply"):
        return lg.PointCloud(rng.random((500 * scale, 3)))
    return lg.LightField(data, lg.Grid((3, 3), 1e-3), lg.Grid(data.shape[2:], 1e-4), 0.01)
lg.save(thing(1), name)
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
try:
    lg.save(thing(40), name)
except FormatError as error:
    print(error)
"""


@pytest.mark.parametrize("size", [1, 3000, 20000])
@pytest.mark.parametrize(
    "name",
    [
        "a.png",
        "a.tiff",
        "a.zarr",
        "volume.zarr",
        "a.zarr.zip",
        "a.h5",
        "a.pfm",
        "a.ply",
        "a.gif",
        "v",
        "a_eslf.png",
    ],
)
def test_where_no_more_fits_the_old_file_stays_and_one_line_says_so(tmp_path, name, size):
    """libhdf5 died of it; TIFF said "120000 requested and 73436 written"."""
    (tmp_path / "place").mkdir()
    said = subprocess.run(
        [sys.executable, "-c", FULL, name, str(size)], cwd=tmp_path / "place", capture_output=True, text=True
    )
    assert said.returncode == 0, said.stderr
    assert said.stderr == ""
    assert f"{name} was not written: the system takes no file as large as that." in said.stdout
    assert len(said.stdout.splitlines()) == 1
    assert [path.name for path in (tmp_path / "place").iterdir()] == [name]
    if not name.endswith(".gif"):
        assert lg.open(tmp_path / "place" / name, **({"views": 3} if "eslf" in name else {})) is not None


@pytest.mark.parametrize("name", ["a.tiff", "a.zarr", "a.h5", "v.zarr"])
def test_what_is_read_lazily_may_be_written_onto_its_own_file(tmp_path, name):
    path, views = tmp_path / name, np.random.default_rng(0).random((2, 3, 12, 13))
    grids = lg.Grid((2, 3), 1e-3), lg.Grid((12, 13), 1e-4)
    lg.save(PICTURE if name.startswith("a") else lg.LightField(views, *grids, 0.01), path)
    opened = contextlib.ExitStack()
    with opened:
        if name.endswith(".tiff"):
            held = tifffile.memmap(path)
        elif name.endswith(".h5"):
            held = opened.enter_context(h5py.File(path))["data"]
        else:
            held = zarr.open_group(path, mode="r")["data"]
        lg.save(lg.RawImage(held) if name.startswith("a") else lg.LightField(held, *grids, 0.01), path)
    np.testing.assert_array_equal(lg.open(path).data, PICTURE if name.startswith("a") else views)


def test_bytes_that_lose_their_checksum_in_a_chunk_of_text_are_found(tmp_path):
    lg.save(lg.RawImage(PICTURE, 1e-6), tmp_path / "a.png")
    content = (tmp_path / "a.png").read_bytes()
    at = content.index(b"tEXt")
    length = struct.unpack(">I", content[at - 4 : at])[0]
    changed = content[at : at + 4 + length].replace(b"1e-06", b"9e-06")
    right = struct.pack(">I", zlib.crc32(changed))
    for checksum, opens in ((content[at + 4 + length : at + 8 + length], False), (right, True)):
        (tmp_path / "b.png").write_bytes(content[:at] + changed + checksum + content[at + 8 + length :])
        if opens:
            assert lg.open(tmp_path / "b.png").pixel_pitch == 9e-6
        else:
            with pytest.raises(FormatError, match="differs from its checksum"):
                lg.open(tmp_path / "b.png")


def test_memory_is_asked_before_pixels_are_allocated(tmp_path, monkeypatch):
    from lumigraph.core import memory

    lg.save(lg.RawImage(PICTURE), tmp_path / "a.zarr")
    monkeypatch.setattr(memory, "available", lambda: 1000)
    with pytest.raises(FormatError, match="Crop it, or use a larger machine"):
        lg.open(tmp_path / "a.zarr")


assert resource  # the programs above use it; without it (Windows) they cannot run
