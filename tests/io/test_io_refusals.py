"""Files that are damaged, disguised or too large, and things that no format holds: one clear error each."""

import json
import os
import re
import struct
import tracemalloc
import zipfile
import zlib
from contextlib import suppress

import numpy as np
import pytest
import tifffile
from PIL import Image

import lumigraph.io as io
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import FormatError


def huge_png(path, rows=40_000, columns=25_000):
    """A PNG whose header declares 1e9 pixels."""

    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    body = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    pixels = zlib.compress(bytes(1000))
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", body) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")
    )
    return path


def huge_tiff(path, rows=40_000, columns=25_000):
    """A TIFF of a few bytes whose header declares 1e9 pixels."""
    tags = [
        (256, 4, columns),
        (257, 4, rows),
        (258, 3, 8),
        (259, 3, 8),
        (262, 3, 1),
        (273, 4, 8),
        (277, 3, 1),
    ]
    tags += [(278, 4, rows), (279, 4, 8)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    path.write_bytes(
        b"II*\0" + struct.pack("<I", 16) + bytes(8) + struct.pack("<H", len(tags)) + entries + bytes(4)
    )
    return path


def huge_zarr(path, rows=40_000, columns=25_000):
    """A Zarr store whose array declares 1e9 pixels and has no chunk."""
    io.save(np.zeros((4, 4)), path)
    metadata = json.loads((path / "data" / "zarr.json").read_text())
    metadata["shape"] = [rows, columns]
    (path / "data" / "zarr.json").write_text(json.dumps(metadata))
    return path


@pytest.mark.parametrize(
    ("write", "name"), [(huge_png, "a.png"), (huge_tiff, "a.tiff"), (huge_zarr, "a.zarr")]
)
def test_1e9_pixels_are_refused_before_anything_is_allocated(tmp_path, write, name):
    path = write(tmp_path / name)
    tracemalloc.start()
    with pytest.raises(FormatError, match=r"declares 40000 x 25000 = 1e\+09 pixels but at most 1.79e\+08"):
        io.open(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6  # modules imported on the way; the picture would be 1e9 bytes


@pytest.mark.parametrize("name", ["a.png", "a.tiff", "a.zarr"])
def test_the_limit_can_be_moved(tmp_path, name):
    io.save(np.ones((10, 10), np.uint8), tmp_path / name)
    with pytest.raises(FormatError, match=r"10 x 10 = 100 pixels .* max_pixels=100"):
        io.open(tmp_path / name, max_pixels=99)
    assert io.open(tmp_path / name, max_pixels=100).shape == (10, 10)


def test_a_large_picture_opens_without_the_warning_of_pillow(tmp_path, monkeypatch):
    io.save(np.ones((10, 10), np.uint8), tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 4)  # Image.open would warn, then raise
    assert io.open(tmp_path / "a.png").shape == (10, 10)


@pytest.mark.parametrize("name", ["a.png", "a.tiff", "a.toml", "a.zarr.zip"])
def test_an_empty_file_is_named(tmp_path, name):
    (tmp_path / name).touch()
    with pytest.raises(FormatError, match=r"is empty \(0 bytes\)"):
        io.open(tmp_path / name)


@pytest.mark.parametrize(("name", "kind"), [("a.png", "PNG"), ("a.tiff", "TIFF"), ("a.zarr.zip", "ZIP")])
def test_a_text_file_with_another_name_is_named(tmp_path, name, kind):
    (tmp_path / name).write_text("hello, this is text")
    with pytest.raises(FormatError, match=rf"is not a {kind} file: it begins with b'hello"):
        io.open(tmp_path / name)


def test_a_png_called_tiff_is_told_its_right_name(tmp_path):
    io.save(np.ones((4, 4), np.uint8), tmp_path / "a.png")
    (tmp_path / "a.png").rename(tmp_path / "a.tiff")
    with pytest.raises(FormatError, match=r"is a PNG file, not TIFF. Rename it to end in .png"):
        io.open(tmp_path / "a.tiff")


@pytest.mark.parametrize("name", ["a.png", "a.tiff", "a.zarr.zip"])
@pytest.mark.parametrize("part", [0.02, 0.3, 0.6, 0.9, 0.99])
def test_a_file_cut_short_is_an_error_whatever_is_missing(tmp_path, rng, name, part):
    io.save(rng.integers(0, 255, (64, 64), dtype=np.uint8), tmp_path / name)
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: int(len(content) * part)])
    with pytest.raises(FormatError, match=r"cut short|damaged|is not a|no picture"):
        io.open(tmp_path / name)


@pytest.mark.parametrize("name", ["a.png", "a.tiff", "a.zarr.zip"])
def test_damaged_bytes_give_an_error_or_a_picture_but_nothing_else(tmp_path, rng, name):
    io.save(rng.integers(0, 255, (16, 16), dtype=np.uint8), tmp_path / name)
    content = np.frombuffer((tmp_path / name).read_bytes(), np.uint8)
    for _ in range(60):
        damaged = content.copy()
        where = rng.integers(0, len(content), 4)
        damaged[where] = rng.integers(0, 255, 4)
        (tmp_path / name).write_bytes(damaged.tobytes())
        with suppress(FormatError):
            assert isinstance(io.open(tmp_path / name, max_pixels=10_000), RawImage)


def test_a_compressed_tiff_that_needs_a_codec_says_which(tmp_path):
    tifffile.imwrite(tmp_path / "a.tiff", np.ones((8, 8), np.uint8), compression="zlib")
    content = bytearray((tmp_path / "a.tiff").read_bytes())
    with tifffile.TiffFile(tmp_path / "a.tiff") as file:
        at = file.pages.first.tags["Compression"].valueoffset
    content[at : at + 2] = struct.pack("<H", 34887)  # LERC
    (tmp_path / "a.tiff").write_bytes(content)
    with pytest.raises(FormatError, match=r"compression LERC cannot be read|damaged"):
        io.open(tmp_path / "a.tiff")


def test_a_missing_file_suggests_near_names(tmp_path):
    (tmp_path / "letters_white.png").touch()
    with pytest.raises(FormatError, match=r"does not exist. Did you mean letters_white.png\?"):
        io.open(tmp_path / "leters_white.png")
    with pytest.raises(FormatError, match=r"does not exist. Check the name"):
        io.open(tmp_path / "qqq.png")
    with pytest.raises(FormatError, match=r"there is no folder .*nowhere"):
        io.open(tmp_path / "nowhere" / "a.png")


def test_a_folder_and_a_pipe_are_not_files(tmp_path):
    (tmp_path / "a.png").mkdir()
    with pytest.raises(FormatError, match=r"a.png is a folder, not a file"):
        io.open(tmp_path / "a.png")
    os.mkfifo(tmp_path / "b.png")
    with pytest.raises(FormatError, match=r"not a plain file"):
        io.open(tmp_path / "b.png")
    (tmp_path / "c.zarr").mkdir()
    with pytest.raises(FormatError, match=r"folder without zarr.json"):
        io.open(tmp_path / "c.zarr")


def test_an_unknown_extension_lists_the_known_ones(tmp_path):
    (tmp_path / "a.cr2").write_bytes(b"BM")
    for act in (io.open, lambda path: io.save(np.ones((2, 2)), path)):
        with pytest.raises(
            FormatError,
            match=r"Known extensions are .bmp, .eslf.jpeg, .eslf.jpg, .eslf.png, .gif, .h5, .hdf5",
        ):
            act(tmp_path / "a.cr2")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("basis", "bases"), "lattice.basis is missing"),
        (
            lambda t: t.replace("residual_px = 0.05", 'residual_px = "small"'),
            "residual_px must be a finite number",
        ),
        (lambda t: t.replace("basis = [[0.0", "basis = [[nan"), "lattice.basis must be 2 x 2 finite numbers"),
        (lambda t: re.sub(r"basis = .*", "basis = [[0.0, 10.0], [0.0, 20.0]]", t), "parallel"),
        (lambda t: t.replace('"square"', '"cubic"'), "layout is 'cubic'"),
        (lambda t: t.replace('"1e-06 m"', '"1e-06"'), "pixel_pitch: '1e-06' has no unit"),
        (lambda t: t.replace('"1e-06 m"', '"-1e-06 m"'), "pixel_pitch is -1e-06 m but must be above 0"),
        (lambda t: t.replace("[lenslets]", "[lenslet]"), r"the table \[lenslets\] is missing"),
        (lambda t: t[: len(t) // 2], "damaged TOML|is not TOML"),
        (lambda t: t.replace('kind = "calibration"', 'kind = "plenoptic"'), "describes a 'plenoptic'"),
        (lambda t: t.replace('kind = "calibration"', ""), "is not a calibration"),
        (lambda t: t.replace("shape = [20, 20]", "shape = [20.5, 20]"), "whole numbers"),
    ],
)
def test_a_damaged_calibration_names_the_field(tmp_path, change, message):
    lattice = Lattice.square(10.0)
    indices = lattice.indices((0, 19), (0, 19))
    calibration = Calibration(lattice, (20, 20), indices, lattice.position(indices), 0.05, 1e-6)
    path = tmp_path / "c.toml"
    io.save(calibration, path)
    text = path.read_text()
    assert change(text) != text
    path.write_text(change(text))
    with pytest.raises(FormatError, match=message):
        io.open(path)


def test_binary_and_oversized_toml_are_refused(tmp_path, monkeypatch):
    (tmp_path / "c.toml").write_bytes(b"\xff\xfe\x00garbage")
    with pytest.raises(FormatError, match="is not TOML"):
        io.open(tmp_path / "c.toml")
    (tmp_path / "d.toml").write_text("a = 1\nb = 2\nkind = 'calibration'\n")
    monkeypatch.setattr("lumigraph.io.calibration._LARGEST_TEXT", 4)
    with pytest.raises(FormatError, match="characters beside its lenslets, too many"):
        io.open(tmp_path / "d.toml")
    monkeypatch.setattr("lumigraph.io.calibration._LARGEST", 4)
    with pytest.raises(FormatError, match="too many for a calibration"):
        io.open(tmp_path / "c.toml")


def test_garbage_in_a_zarr_store_is_an_error(tmp_path):
    views = LightField(np.ones((2, 2, 4, 5), np.float32), Grid.square(2, 0.1), Grid((4, 5), 1e-4), 0.4)
    io.save(views, tmp_path / "a.zarr")
    chunk = tmp_path / "a.zarr" / "data" / "c" / "1" / "0" / "0" / "0"
    content = chunk.read_bytes()
    chunk.write_bytes(content[:-6] + b"garbag")
    with pytest.raises(FormatError, match="damaged"):
        io.open(tmp_path / "a.zarr")
    chunk.unlink()
    with pytest.raises(FormatError, match="incomplete: 1 of 2 chunks"):
        io.open(tmp_path / "a.zarr")
    chunk.write_bytes(content)
    group = tmp_path / "a.zarr" / "zarr.json"
    good = group.read_text()
    group.write_text(good.replace('"separation": 0.4', '"separation": -1'))
    with pytest.raises(FormatError, match=r"separation is -1 m but must be above 0|damaged"):
        io.open(tmp_path / "a.zarr")
    group.write_text(good.replace('"lumigraph"', '"other"'))
    with pytest.raises(FormatError, match="was not written by lumigraph"):
        io.open(tmp_path / "a.zarr")
    group.write_text(good.replace('"LightField"', '"Hologram"'))
    with pytest.raises(FormatError, match="holds a 'Hologram'"):
        io.open(tmp_path / "a.zarr")
    group.write_text("{ garbage")
    with pytest.raises(FormatError, match="damaged"):
        io.open(tmp_path / "a.zarr")


def test_one_flipped_bit_in_a_zarr_store_is_an_error(tmp_path, rng):
    # incompressible, so that the pixels stand in the chunk as they are and decode with any value
    io.save(rng.integers(0, 255, (64, 64), dtype=np.uint8), tmp_path / "a.zarr")
    chunk = tmp_path / "a.zarr" / "data" / "c" / "0" / "0"
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    with pytest.raises(FormatError, match="damaged"):
        io.open(tmp_path / "a.zarr")


def test_an_ordinary_zip_is_no_zarr_store(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zarr.zip", "w") as file:
        file.writestr("hello.txt", "hello")
    with pytest.raises(FormatError, match="damaged or is not a Zarr v3 store"):
        io.open(tmp_path / "a.zarr.zip")


def test_a_header_of_a_later_format_is_refused(tmp_path):
    io.save(RawImage(np.ones((2, 2), np.uint8)), tmp_path / "a.zarr")
    group = tmp_path / "a.zarr" / "zarr.json"
    group.write_text(group.read_text().replace('"lumigraph": 1', '"lumigraph": 2'))
    with pytest.raises(FormatError, match="format 2 but this lumigraph reads 1"):
        io.open(tmp_path / "a.zarr")
    group.write_text(group.read_text().replace('"lumigraph": 2', '"lumigraph": 1, "bayer": "XYZW"'))
    with pytest.raises(FormatError, match="header is damaged: bayer is 'XYZW'"):
        io.open(tmp_path / "a.zarr")


LIGHT = LightField(np.ones((2, 2, 2, 2)), Grid.square(2, 1.0), Grid.square(2, 1.0), 1.0)


@pytest.mark.parametrize(
    ("thing", "name", "message"),
    [
        (
            LIGHT,
            "a.png",
            "wrong extension for this result, a LightField. Use one of _eslf.png, .eslf.png, .zarr",
        ),
        (np.ones((2, 2)), "a.toml", "Use one of .tif, .tiff, .png, .zarr, .zarr.zip"),
        ([np.ones((2, 2))], "a.png", "Use one of .tif, .tiff"),
        ([], "a.tiff", "no pictures"),
        ([np.ones((2, 2)), np.ones((2, 3))], "a.tiff", "have shapes .* but must have one"),
        (np.ones((2, 2), complex), "a.tiff", "TIFF cannot hold complex128"),
        (np.ones((2, 2), np.int32), "a.png", "uint8, or uint16 if grey, but the picture is int32"),
        (np.ones((2, 2, 2), np.uint8), "a.png", r"has shape \(2, 2, 2\)"),
        (np.full((2, 2), np.nan), "a.png", "has 4 NaN or infinite values"),
        (np.ones((2, 2, 2, 2)), "a.tiff", r"shape \(2, 2, 2, 2\) is not a picture"),
        (np.array([["a", "b"]]), "a.zarr", "holds <U1 but must hold numbers"),
        ("hello", "a.png", "a str cannot be written"),
        (RawImage(np.ones((2, 2)), metadata={"f": open}), "a.tiff", r"metadata\['f'\] is a builtin"),
        (RawImage(np.ones((2, 2)), metadata={"f": [np.inf]}), "a.zarr", r"metadata\['f'\]\[0\] is inf"),
        (np.ones((2, 2)), "nowhere/a.png", "the folder .*nowhere for a.png does not exist"),
    ],
)
def test_what_no_format_holds_is_refused_and_leaves_nothing_behind(tmp_path, thing, name, message):
    with pytest.raises(FormatError, match=message):
        io.save(thing, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", [None, 5, [], b"a.tiff"])
def test_a_path_is_text(path):
    with pytest.raises(FormatError, match=r"the path is .* but must be text"):
        io.open(path)
    with pytest.raises(FormatError, match=r"the path is .* but must be text"):
        io.save(np.ones((2, 2)), path)


def test_a_file_that_holds_another_noun_than_asked_for_is_refused(tmp_path):
    io.save(np.zeros((3, 4), np.uint8), tmp_path / "raw.tiff")
    assert io.open(tmp_path / "raw.tiff", RawImage).shape == (3, 4)
    with pytest.raises(FormatError, match=r"raw\.tiff holds a raw image but must hold a light field\."):
        io.open(tmp_path / "raw.tiff", LightField)
