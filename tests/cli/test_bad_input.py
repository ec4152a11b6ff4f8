"""Bad input: one clear line that names what is wrong, no traceback, an exit code, and little memory."""

import json
import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
import tifffile

import lumigraph.io as io
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage

CALIBRATE = ("calibrate", "white.tiff", "-o", "c.toml")
DECODE = ("decode", "raw.tiff", "--white", "white.tiff", "-o", "views.zarr")
SIMULATE = ("simulate", "camera.toml", "--scene", "pinhole", "-o", "out.tiff")
REFOCUS = ("refocus", "raw.tiff", "--white", "white.tiff", "-o", "out.png")
RENDER = ("render", "raw.tiff", "--white", "white.tiff", "-o", "out.png")


def refused(result, *parts, code=1):
    """One line on standard error, nothing on standard output."""
    assert result.code == code, result
    assert result.out == ""
    assert result.err.count("\n") == 1
    assert result.err.startswith("lumigraph: error: ")
    assert "Traceback" not in result.err
    assert "unexpected" not in result.err
    for part in parts:
        assert part in result.err, result.err


# Camera files: what is replaced in camera.toml by what, and what the line must say.
CAMERAS = {
    "unknown key": ("[sensor]", "[sensor]\nspeed = 3", ["speed"]),
    "misspelt key": ("focal_length", "focal_lenght", ["focal_lenght", "focal_length"]),
    "wrong unit": ('pitch = "100 um"', 'pitch = "100 Hz"', ["lenslets.pitch", "100 Hz", "not a length"]),
    "unknown unit": ('pitch = "100 um"', 'pitch = "100 parsnips"', ["lenslets.pitch", "parsnips"]),
    "bare number": ('object_distance = "200 mm"', "object_distance = 200", ["object_distance", "200"]),
    "negative pitch": ('pitch = "100 um"', 'pitch = "-100 um"', ["lenslets.pitch", "-100 um"]),
    "zero pixel": ('"8 um"', '"0 um"', ["sensor.pixel_pitch", "0 um"]),
    "missing key": ('pitch = "100 um"', "", ["lenslets", "pitch"]),
    "unknown kind": ('"plenoptic"', '"plenoptik"', ["kind", "plenoptik"]),
    "wrong type": ("count = [3, 3]", 'count = "many"', ["lenslets.count"]),
    "object inside the focus": ('"200 mm"', '"90 mm"', ["object_distance", "90 mm", "100 mm"]),
    "damaged TOML": ("[lenslets]", "[lenslets", ["damaged TOML"]),
    "gigantic sensor": ('pixel_pitch = "8 um"', 'pixel_pitch = "8 um"\nshape = [100000, 100000]', ["sensor"]),
    "gigantic array": ("count = [3, 3]", "count = [100000, 100000]", ["lenslets"]),
}


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("verb", [("design",), ("simulate", "--scene", "white", "-o", "out.tiff")])
def test_a_bad_camera_file(lumigraph, bench, kind, verb):
    old, new, parts = CAMERAS[kind]
    path = bench / "camera.toml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    tracemalloc.start()
    result = lumigraph(verb[0], "camera.toml", *verb[1:])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    refused(result, "camera.toml", *parts)
    assert peak < 100e6
    assert not (bench / "out.tiff").exists()


def huge_png(path):
    body = struct.pack(">IIBBBBB", 25_000, 40_000, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", body), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b"")]
    packed = [struct.pack(">I", len(b)) + n + b + struct.pack(">I", zlib.crc32(n + b)) for n, b in chunks]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(packed))


def huge_tiff(path):
    tags = [(256, 4, 25_000), (257, 4, 40_000), (258, 3, 8), (259, 3, 8), (262, 3, 1), (273, 4, 8)]
    tags += [(277, 3, 1), (278, 4, 40_000), (279, 4, 8)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    path.write_bytes(
        b"II*\0" + struct.pack("<I", 16) + bytes(8) + struct.pack("<H", len(tags)) + entries + bytes(4)
    )


def huge_zarr(path):
    io.save(np.zeros((4, 4)), path)
    metadata = json.loads((path / "data" / "zarr.json").read_text())
    metadata["shape"] = [40_000, 25_000]
    (path / "data" / "zarr.json").write_text(json.dumps(metadata))


def garbage_zarr(path):
    io.save(np.ones((4, 4)), path)
    chunk = path / "data" / "c" / "0" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-5] + b"hello")


def truncated_tiff(path):
    tifffile.imwrite(path, np.ones((64, 64), np.uint8))
    path.write_bytes(path.read_bytes()[:-1000])


def truncated_png(path):
    io.save(np.random.default_rng(1).integers(0, 255, (64, 64), np.uint8), path)
    path.write_bytes(path.read_bytes()[:-1000])


def nan_tiff(path):
    data = np.ones((64, 64), np.float32)
    data[3, 4] = np.nan
    tifffile.imwrite(path, data)


def stack(path):
    io.save([np.ones((8, 8))] * 3, path)


def views(path):
    io.save(LightField(np.ones((2, 2, 2, 2)), Grid.square(2, 1.0), Grid.square(2, 1.0), 1.0), path)


# White images: the file's name, how it is written, and what the line must say.
FILES = {
    "text named .png": ("w.png", lambda p: p.write_text("hello"), ["w.png is not a PNG", "hello"]),
    "PNG named .tiff": ("w.tiff", huge_png, ["w.tiff is a PNG file"]),
    "truncated TIFF": ("w.tiff", truncated_tiff, ["w.tiff", "cut short"]),
    "truncated PNG": ("w.png", truncated_png, ["w.png", "cut short"]),
    "1e9 pixels in a PNG": ("w.png", huge_png, ["w.png declares 40000 x 25000 = 1e+09 pixels", "1.79e+08"]),
    "1e9 pixels in a TIFF": ("w.tiff", huge_tiff, ["w.tiff declares 40000 x 25000 = 1e+09 pixels"]),
    "1e9 pixels in a Zarr": ("w.zarr", huge_zarr, ["w.zarr declares 40000 x 25000 = 1e+09 pixels"]),
    "empty file": ("w.tiff", lambda p: p.touch(), ["w.tiff is empty"]),
    "folder": ("w.png", lambda p: p.mkdir(), ["w.png is a folder"]),
    "folder named .zarr": ("w.zarr", lambda p: p.mkdir(), ["w.zarr is a folder without zarr.json"]),
    "missing file": ("w.png", lambda p: None, ["w.png does not exist"]),
    "misspelt file": ("whte.tiff", lambda p: None, ["whte.tiff does not exist", "Did you mean white.tiff"]),
    "unknown extension": ("w.bmp", lambda p: p.touch(), ["w.bmp", ".png", ".tiff", ".zarr"]),
    "garbage in a Zarr": ("w.zarr", garbage_zarr, ["w.zarr is damaged"]),
    "NaN": ("w.tiff", nan_tiff, ["w.tiff has 1 NaN", "(3, 4)"]),
    "one pixel": ("w.png", lambda p: io.save(np.ones((1, 1), np.uint8), p), ["1 x 1"]),
    "flat white image": ("w.png", lambda p: io.save(np.full((99, 99), 9, np.uint8), p), ["white image"]),
    "black white image": ("w.png", lambda p: io.save(np.zeros((99, 99), np.uint8), p), ["white image"]),
    "noise": (
        "w.png",
        lambda p: io.save(np.random.default_rng(1).integers(0, 255, (99, 99), np.uint8), p),
        ["white image"],
    ),
    "stack": ("w.tiff", stack, ["the white image has 8 x 8 pixels"]),
    "views": ("w.zarr", views, ["w.zarr holds a light field where a raw image is needed"]),
    "TOML": ("camera.toml", lambda p: None, ["camera.toml describes a 'plenoptic', not a calibration"]),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_bad_white_image(lumigraph, bench, kind):
    name, write, parts = FILES[kind]
    write(bench / name)
    result = lumigraph("calibrate", name, "-o", "c.toml")
    refused(result, *parts)
    assert not (bench / "c.toml").exists()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read from /proc")
@pytest.mark.parametrize("name", ["w.png", "w.tiff", "w.zarr"])
def test_1e9_pixels_are_refused_within_little_memory(bench, name):
    {".png": huge_png, ".tiff": huge_tiff, ".zarr": huge_zarr}[name[1:]](bench / name)
    code = (
        "import sys; from lumigraph.cli import main; code = main(sys.argv[1:]);"
        "print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0]); sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "calibrate", name, "-o", "c.toml"],
        cwd=bench,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert (
        int(done.stdout) < 400_000
    )  # kB: Python with NumPy, SciPy and the decoder; the picture would add 1e6


# Options: the command, and what the line must say.
OPTIONS = {
    "length without unit": ((*CALIBRATE, "--pixel-pitch", "6.45"), ["--pixel-pitch", "6.45", "no unit"]),
    "length in kilograms": ((*CALIBRATE, "--separation", "4 kg"), ["--separation", "not a length"]),
    "negative length": ((*CALIBRATE, "--separation=-4 mm",), ["--separation", "above 0"]),
    "NaN pitch": ((*CALIBRATE, "--pitch", "nan"), ["--pitch is nan"]),
    "negative micro-image pitch": ((*CALIBRATE, "--pitch", "-3"), ["--pitch is -3 px"]),
    "pitch that is not there": ((*CALIBRATE, "--pitch", "40"), ["40"]),
    "output below a file": (
        ("calibrate", "white.tiff", "-o", "camera.toml/c.toml"), ["camera.toml is a file"],
    ),
    "unknown output": (("calibrate", "white.tiff", "-o", "c.json"), ["c.json", ".toml"]),
    "unknown overlay": ((*CALIBRATE, "--overlay", "o.gif"), ["o.gif", ".png, .svg, .pdf"]),
    "output is a folder": (("simulate", "camera.toml", "--scene", "white", "-o", "folder.png"), ["folder"]),
    "demo into a file": (("demo", "-o", "camera.toml"), ["--output camera.toml is a file"]),
    "demo below a file": (("demo", "-o", "camera.toml/demo"), ["camera.toml is a file"]),
    "unknown scene": (("simulate", "camera.toml", "--scene", "moon", "-o", "o.tiff"), ["'moon'", "usaf1951"]),
    "missing scene": (("simulate", "camera.toml", "--scene", "moon.png", "-o", "o.tiff"), ["moon.png"]),
    "no scene": (("simulate", "camera.toml", "-o", "o.tiff"), ["--scene", "--point"]),
    "depth without unit": ((*SIMULATE, "--depth", "3"), ["--depth", "no unit"]),
    "depth behind the lens": ((*SIMULATE, "--depth", "-300 mm"), ["-300 mm"]),
    "depths without scenes": ((*SIMULATE, "--depth", "1 mm", "--depth", "2 mm"), ["2 --depth for 1 --scene"]),
    "one coordinate": ((*SIMULATE, "--point", "1 mm"), ["--point", "1 mm"]),
    "zero snapshots": ((*SIMULATE, "--coherence", "snapshots", "--count", "0"), ["--count is 0"]),
    "accuracy out of range": ((*SIMULATE, "--accuracy", "0.5"), ["accuracy is 0.5", "0.01"]),
    "accuracy of coherent light": (
        (*SIMULATE, "--coherence", "coherent", "--accuracy", "0.01"),
        ["--accuracy"],
    ),
    "negative seed": ((*SIMULATE, "--seed", "-1"), ["--seed is -1"]),
    "na of another light": ((*SIMULATE, "--na", "0.1"), ["--na", "tilted"]),
    "na too large": ((*SIMULATE, "--coherence", "tilted", "--na", "3"), ["na is 3"]),
    "partial without na": ((*SIMULATE, "--coherence", "partial"), ["--na"]),
    "count of partial": (
        (*SIMULATE, "--coherence", "partial", "--na", "0.01", "--count", "3"),
        ["--count has no meaning"],
    ),
    "count of coherent light": ((*SIMULATE, "--coherence", "coherent", "--count", "3"), ["--count"]),
    "no calibration": (("decode", "raw.tiff", "-o", "v.zarr"), ["--calibration", "--white"]),
    "devignette without white": (
        ("decode", "raw.tiff", "--calibration", "c.toml", "--devignette", "-o", "v.zarr"), ["--white"],
    ),
    "white image of another size": (
        ("decode", "raw.tiff", "--white", "small.tiff", "-o", "v.zarr"), ["(139, 151)", "(100, 100)"],
    ),
    "calibration of another size": (
        ("decode", "small.tiff", "--calibration", "good.toml", "-o", "v.zarr"), ["100 x 100", "139 x 151"],
    ),
    "calibration damaged": (
        ("decode", "raw.tiff", "--calibration", "bad.toml", "-o", "v.zarr"), ["bad.toml", "basis"],
    ),
    "camera as calibration": (
        ("decode", "raw.tiff", "--calibration", "camera.toml", "-o", "v.zarr"), ["not a calibration"],
    ),
    "views as PNG": (("decode", "raw.tiff", "--white", "white.tiff", "-o", "v.png"), ["v.png", ".zarr"]),
    "zero alpha": ((*REFOCUS, "--alpha", "0"), ["--alpha is 0"]),
    "NaN alpha": ((*REFOCUS, "--alpha", "nan"), ["--alpha is nan"]),
    "negative alpha": ((*REFOCUS, "--alpha", "-1"), ["--alpha is -1"]),
    "no alpha": (REFOCUS, ["--alpha"]),
    "damaged range": ((*REFOCUS, "--alphas", "1:2"), ["'1:2'", "first:last:xN"]),
    "endless range": ((*REFOCUS, "--alphas", "1:2:x1000000000"), ["1000"]),
    "several pictures in one PNG": ((*REFOCUS, "--alpha", "0.9", "1.1"), ["out.png", ".tiff"]),
    "aperture above 1": ((*REFOCUS, "--alpha", "1", "--aperture", "2"), ["--aperture is 2"]),
    "no oversampling": ((*REFOCUS, "--alpha", "1", "--oversample", "0"), ["--oversample is 0"]),
    "oversampled spectrum": (
        (*REFOCUS, "--alpha", "1", "--oversample", "2", "--method", "fourier"), ["--oversample", "fourier"],
    ),
    "views with a calibration": (
        ("refocus", "views.zarr", "--alpha", "1", "--white", "white.tiff", "-o", "o.png"), ["holds views"],
    ),
    "calibration instead of views": (
        ("refocus", "good.toml", "--alpha", "1", "-o", "o.png"), ["good.toml holds a calibration"],
    ),
    "zero patch": ((*RENDER, "--patch", "0"), ["--patch is 0"]),
    "NaN patch": ((*RENDER, "--patch", "nan"), ["--patch is nan"]),
    "no patch": (RENDER, ["--patch", "--camera"]),
    "depth without a camera": ((*RENDER, "--patch", "5", "--depth", "1 mm"), ["--depth", "--camera"]),
    "depth without a unit": ((*RENDER, "--camera", "focused.toml", "--depth", "1"), ["--depth", "unit"]),
    "gigantic patch": ((*RENDER, "--patch", "1e9"), ["patch"]),
    "camera without patches": ((*RENDER, "--camera", "camera.toml"), ["camera.toml", "decode"]),
    "camera of another size": (
        ("render", "raw.tiff", "--camera", "focused.toml", "-o", "o.png"), ["139 x 151"],
    ),
}  # fmt: skip

# Commands that are written wrongly: exit code 2.
USAGE = {
    "unknown verb": (("simulat",), ["simulat"]),
    "unknown option": (("design", "camera.toml", "--jsn"), ["--jsn", "--json"]),
    "unknown coherence": ((*SIMULATE, "--coherence", "half"), ["half", "tilted"]),
    "unknown method": ((*REFOCUS, "--method", "magic"), ["magic", "fourier"]),
    "unknown layout": (("calibrate", "white.tiff", "-o", "c.toml", "--layout", "cubic"), ["cubic", "hex"]),
    "no number": ((*REFOCUS, "--alpha", "zero"), ["--alpha", "zero"]),
    "no output": (("calibrate", "white.tiff"), ["--output"]),
    "no input": (("design",), ["CAMERA"]),
}


@pytest.fixture
def prepared(bench):
    """The bench with a calibration, a damaged one, views, and pictures of another size."""
    lattice = Lattice.square(11.5, origin=(69.0, 75.0))
    indices = lattice.indices((0, 138), (0, 150))
    io.save(Calibration(lattice, (139, 151), indices, lattice.position(indices), 0.0), bench / "good.toml")
    (bench / "bad.toml").write_text((bench / "good.toml").read_text().replace("basis =", "bases ="))
    white = io.open(bench / "white.tiff").data
    io.save(RawImage(white[:100, :100]), bench / "small.tiff")
    (bench / "folder.png").mkdir()
    views(bench / "views.zarr")
    return bench


@pytest.mark.parametrize("kind", OPTIONS)
def test_a_bad_option(lumigraph, prepared, kind):
    before = sorted(prepared.rglob("*"))
    words, parts = OPTIONS[kind]
    tracemalloc.start()
    result = lumigraph(*words)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    refused(result, *parts)
    assert peak < 200e6
    assert sorted(prepared.rglob("*")) == before  # nothing was written


@pytest.mark.parametrize("kind", USAGE)
def test_a_command_written_wrongly(lumigraph, bench, kind):
    words, parts = USAGE[kind]
    refused(lumigraph(*words), *parts, "--help", code=2)
