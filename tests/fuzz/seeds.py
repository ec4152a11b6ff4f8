"""Small valid files of every format, from which mutants are made; some are built byte by byte.

A seed is a mapping of names to bytes: one file, or a folder of them. `repairs` mend what a checksum would
otherwise give away, so that mutants reach the decoders behind it.
"""

import hashlib
import io as streams
import json
import struct
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import scipy.io
import tifffile
import zarr
from PIL import Image
from zarr.abc.codec import BytesBytesCodec
from zarr.codecs import GzipCodec

import lumigraph as lg
import lumigraph.io as io
from lumigraph import store
from lumigraph.core.calibration import Calibration
from lumigraph.core.cloud import PointCloud
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.metrology.boards.noise import Noise

sys.path.insert(0, str(Path(__file__).parents[1]))
from fuzz.texts import ASCII_PLY, COMPOTE, PLENOPTOMOS, RAYTRIX

Tree = dict[str, bytes]
MAGIC = b"\r\n\x1a\n"


def section(kind: bytes, content: bytes, *, name: str | None = None) -> bytes:
    """One section of a Lytro container, as its public descriptions say."""
    digest = name or "sha1-" + hashlib.sha1(content).hexdigest()
    head = b"\x89LF" + kind + MAGIC + struct.pack(">II", 0, len(content)) + digest.encode().ljust(80, b"\0")
    return head + content + bytes(-len(content) % 16)


def container(table: dict, contents: list[bytes]) -> bytes:
    """A Lytro container with a table of contents and further sections."""
    start = b"\x89LFP" + MAGIC + struct.pack(">II", 1, 0)
    return start + section(b"M", json.dumps(table).encode()) + b"".join(section(b"C", c) for c in contents)


def reference(content: bytes) -> str:
    """What the table calls a section."""
    return "sha1-" + hashlib.sha1(content).hexdigest()


def frame_metadata(shape: tuple[int, int], bits: int, endianness: str, first: str, *, illum: bool) -> dict:
    """Metadata of a raw frame, with the fields of an F01 or of an Illum."""
    levels = {
        "black": dict.fromkeys(("r", "gr", "gb", "b"), 64),
        "white": dict.fromkeys(("r", "gr", "gb", "b"), 1023),
    }
    details = {
        "pixelFormat": {"rightShift": 0, **levels},
        "pixelPacking": {"endianness": endianness, "bitsPerPixel": bits},
        "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": first},
    }
    colour = {
        "ccm" if illum else "ccmRgbToSrgbArray": [2.0, -0.75, -0.25, -0.5, 1.75, -0.25, 0.125, -1.125, 2.0],
        "gamma": 0.41666,
        "whiteBalanceGain": {"r": 1.0, "gr": 1.25, "gb": 1.25, "b": 2.0},
    }
    image = {"width": shape[1], "height": shape[0], "color": colour}
    image |= details if illum else {"rawDetails": details}
    lenslets = {
        "tiling": "hexUniformRowMajor", "lensPitch": 1.4e-5, "rotation": 0.001,
        "scaleFactor": {"x": 1, "y": 1.0005}, "sensorOffset": {"x": 4e-7, "y": -1.7e-6, "z": 2.5e-5},
    }  # fmt: skip
    devices = {
        "sensor": {"pixelPitch": 1.4e-6},
        "lens": {"exitPupilOffset": {"z": 0.05}},
        "mla": lenslets,
    }
    return {"image": image, "devices": devices, "camera": {"make": "Lytro", "model": "test"}}


def raw_container(packed: bytes, metadata: dict, *, illum: bool = False) -> bytes:
    """A container of one raw frame."""
    known = json.dumps(metadata).encode()
    frame = {"frame": {"metadataRef": reference(known), "imageRef": reference(packed)}}
    table = {"frames": [frame]} if illum else {"picture": {"frameArray": [frame]}}
    return container(table, [known, packed])


def stack_container(
    pictures: list[tuple[float, bytes]], size: tuple[int, int], depth: bytes, lut: bytes
) -> bytes:
    """A container of a refocus stack, its coarse depths, and a depth map with confidence."""
    rows = [
        {
            "representation": "jpeg",
            "width": size[1],
            "height": size[0],
            "lambda": position,
            "imageRef": reference(p),
        }
        for position, p in pictures
    ]
    stack = {
        "type": "com.lytro.acceleration.refocusStack",
        "vendorContent": {
            "depthLut": {"width": 2, "height": 2, "representation": "raw", "imageRef": reference(lut)},
            "imageArray": rows,
        },
    }
    maps = {"representation": "raw", "imageRef": reference(depth)}
    depths = {
        "type": "com.lytro.acceleration.depthMap",
        "vendorContent": {"width": 3, "height": 4, "minLambda": -20, "depthMap": maps, "confidenceMap": maps},
    }
    table = {"picture": {"frameArray": [], "accelerationArray": [stack, depths]}}
    return container(table, [*(p for _, p in pictures), depth, lut])


def jpeg(picture: np.ndarray) -> bytes:
    """A picture (y, x, 3) of uint8 as JPEG."""
    buffer = streams.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=80)
    return buffer.getvalue()


def wide_png(data: np.ndarray, colour: int) -> bytes:
    """A PNG (y, x, c) of 16 bits, rows by the filter "Sub"; colour type 2, 4 or 6."""
    rows, columns, samples = data.shape
    values = np.ascontiguousarray(data, ">u2").reshape(rows, -1).view(np.uint8).astype(int)
    left = np.concatenate([np.zeros((rows, 2 * samples), int), values[:, : -2 * samples]], 1)
    lines = b"".join(b"\1" + row.astype(np.uint8).tobytes() for row in (values - left) % 256)
    return png_of(
        [
            (b"IHDR", struct.pack(">IIBBBBB", columns, rows, 16, colour, 0, 0, 0)),
            (b"IDAT", zlib.compress(lines)),
        ]
    )


def png_of(chunks: list[tuple[bytes, bytes]]) -> bytes:
    """A PNG of these chunks, with IEND and checksums."""
    packed = [(*chunk, struct.pack(">I", zlib.crc32(b"".join(chunk)))) for chunk in [*chunks, (b"IEND", b"")]]
    return b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(b)) + n + b + c for n, b, c in packed)


def seeds() -> dict[str, tuple[list[Tree], Callable[[Tree], Tree] | None]]:
    """For each reader: seeds, and what mends their checksums."""
    rng = np.random.default_rng(5)
    grey, wide = rng.integers(0, 255, (12, 17), np.uint8), rng.integers(0, 4095, (16, 12), np.uint16)
    colour = rng.integers(0, 255, (12, 17, 3), np.uint8)
    views = LightField(
        rng.integers(0, 255, (2, 3, 6, 8), np.uint8), Grid((2, 3), (1.0, 1.0)), Grid((6, 8), (0.1, 0.1)), 2.0
    )
    volume = Volume(rng.random((3, 5, 6)).astype(np.float32), Grid((5, 6), (1e-6, 1e-6)), (0.0, 1e-6, 2e-6))
    stack = Stack(rng.random((3, 5, 6)).astype(np.float32), (0.9, 1.0, 1.1), "alpha")
    lattice = Lattice.hex(6.0, 0.01, (3.0, 3.0))
    indices = lattice.indices((0, 19), (0, 19))
    calibration = Calibration(lattice, (20, 20), indices, lattice.position(indices), 0.05, 1e-6)
    cloud = PointCloud(rng.random((7, 3)), rng.integers(0, 255, (7, 3), np.uint8), rng.random(7))
    raw = RawImage(wide, 1e-6, 12, "GRBG", {"camera": "x", "list": [1, 2.5]})
    zarrs = [saved(thing, "a.zarr") for thing in (raw, views, volume)]
    zarrs.append(foreign_zarr(GzipCodec()))
    tiffs = [saved(thing, "a.tif") for thing in (raw, colour, stack, volume)]
    options = ({"compression": "zlib"}, {"tile": (16, 16)}, {"byteorder": ">"})
    tiffs += [{"a.tif": tiff(grey, **option)} for option in options]
    tiffs += [
        {"a.tif": tiff(np.stack([grey] * 3), photometric="minisblack")},
        {"a.tif": by_pillow(grey, "tiff_lzw")},
        {"a.tif": by_pillow(grey, "packbits")},
        {"a.tif": packed_tiff()},
    ]
    pngs = [saved(thing, "a.png") for thing in (grey, raw, colour)]
    pngs += [
        {"a.png": wide_png(rng.integers(0, 65535, (5, 6, n), np.uint16), c)}
        for n, c in ((3, 2), (4, 6), (2, 4))
    ]
    palette = streams.BytesIO()
    Image.fromarray(colour).quantize(7).save(palette, "PNG")
    pngs.append({"a.png": palette.getvalue()})
    pixels = bytes(rng.integers(0, 255, 16 * 12 * 3 // 2, np.uint8))
    tens = bytes(rng.integers(0, 255, 16 * 12 * 5 // 4, np.uint8))
    f01 = raw_container(pixels, frame_metadata((16, 12), 12, "big", "b", illum=False))
    illum = raw_container(tens, frame_metadata((16, 12), 10, "little", "gr", illum=True), illum=True)
    planes = [(float(k), jpeg(colour)) for k in (-2, 1)]
    stacked = stack_container(planes, (12, 17), rng.random(12).astype("<f4").tobytes(), bytes(16))
    folder = saved(views, "folder")
    hci = {f"input_Cam{k:03}.png": saved(colour, "a.png")["a.png"] for k in range(4)}
    hci["parameters.cfg"] = (
        b"[extrinsics]\nnum_cams_x = 2\nnum_cams_y = 2\n[meta]\ndisp_min = -1.5\ndisp_max = 2\n"
    )
    return {
        "tiff": (tiffs, None),
        "png": (pngs, mend_png),
        "jpeg": ([{"a.jpg": jpeg(colour)}, {"a.jpg": jpeg(colour[..., 0])}], None),
        "bmp": ([{"a.bmp": bmp(picture)} for picture in (grey, colour, grey > 99)], None),
        "pnm": ([{"a.ppm": pnm(grey)}, {"a.ppm": pnm(wide)}, {"a.ppm": pnm(colour)}], None),
        "mat": ([{"a.mat": content} for content in mats(views.data)], None),
        "npy": ([{"a.npy": npy(views.data)}, {"a.npy": npy(np.asfortranarray(wide))}], None),
        "npz": ([{"a.npz": npz(LF=views.data)}, {"a.npz": npz(a=wide)}], None),
        "zarr": (zarrs, None),
        "zarr.zip": ([{"a.zarr.zip": zipped(strip(tree, "a.zarr/"))} for tree in zarrs], None),
        "hdf5": (
            [*(saved(thing, "a.h5") for thing in (raw, views, volume)), {"a.h5": heidelberg(rng)}],
            None,
        ),
        "pfm": ([saved(grey / 7.0, "a.pfm"), saved(colour / 7.0, "a.pfm")], None),
        "ply": (
            [saved(cloud, "a.ply"), saved(PointCloud(cloud.points), "a.ply"), {"a.ply": ASCII_PLY}],
            None,
        ),
        "lytro": ([{"a.lfp": content} for content in (f01, illum, stacked)], mend_lytro),
        "lytro raw": (
            [
                {
                    "a.raw": pixels,
                    "a.txt": json.dumps(frame_metadata((16, 12), 12, "big", "b", illum=False)).encode(),
                }
            ],
            None,
        ),
        "lytro json": (
            [{"a.json": json.dumps(frame_metadata((60, 60), 12, "big", "b", illum=False)).encode()}],
            None,
        ),
        "camera": (
            [{"camera.toml": lg.load_camera(name).to_toml().encode()} for name in lg.catalogue()],
            None,
        ),
        "checkpoint": ([_sealed()], None),
        "toml": ([saved(calibration, "a.toml")], None),
        "xml": ([{"a.xml": RAYTRIX}], None),
        "ini": ([{"a.ini": PLENOPTOMOS}], None),
        "views": ([folder, hci], None),
        "metric": (_metric(rng), None),
        "eslf": ([{"a_eslf.png": saved(np.tile(grey[:6, :6], (5, 7)), "a.png")["a.png"]}], mend_png),
    }


def _metric(rng: np.random.Generator) -> list[Tree]:
    """A table of corners, a folder of COMPOTE's, and a measured camera."""
    corners = lg.metrology.Corners(
        np.repeat([0, 1], 4), np.arange(8) % 5, rng.random((8, 2)), rng.random((8, 2)), np.arange(8) % 3
    )
    pose = lg.metrology.Pose(0, np.zeros(3), np.ones(3), np.eye(6), 0.1, 0.1)
    camera = lg.metrology.MetricCamera(0.05, 0.06, 1e-3, 0.06, 5e-6, (10.0, 12.0))
    noise, board = Noise(np.ones(1), 0.1), lg.metrology.Board((3, 4), 0.01)
    measured = lg.metrology.Measured(camera, np.eye(14), noise, board, (pose,), 0.1, 1, ("a note",))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        lg.metrology.save_corners(corners, folder / "corners.csv")
        lg.metrology.save(measured, folder / "measured.json")
        found = read_tree(folder)
    return [*({name: content} for name, content in found.items()), COMPOTE]


def _sealed() -> Tree:
    """A file of a deconvolution, or of the cache."""
    with tempfile.TemporaryDirectory() as place:
        store.write(Path(place) / "run.npz", {"estimate": np.arange(12.0).reshape(3, 4), "done": np.array(3)})
        return read_tree(Path(place))


def saved(thing: object, name: str) -> Tree:
    """What `lumigraph.io.save` writes under a name."""
    with tempfile.TemporaryDirectory() as folder:
        io.save(thing, Path(folder) / name)
        return read_tree(Path(folder))


def foreign_zarr(codec: BytesBytesCodec) -> Tree:
    """An OME-Zarr volume as other programs write it."""
    place = [{"type": "scale", "scale": [3.0, 2.0, 1.0]}]
    axes = [{"name": name, "type": "space", "unit": "nanometer"} for name in "zyx"]
    image = {"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": place}]}
    with tempfile.TemporaryDirectory() as folder:
        attributes = {"ome": {"version": "0.5", "multiscales": [image]}}
        group = zarr.create_group(Path(folder) / "a.zarr", zarr_format=3, attributes=attributes)
        array = group.create_array("0", shape=(4, 9, 9), dtype="u2", chunks=(2, 9, 9), compressors=[codec])
        array[...] = np.arange(4 * 81).reshape(4, 9, 9) % 50
        return read_tree(Path(folder))


def read_tree(folder: Path) -> Tree:
    """Every file in a folder, by its path inside."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def strip(tree: Tree, prefix: str) -> Tree:
    return {name.removeprefix(prefix): content for name, content in tree.items()}


def zipped(tree: Tree) -> bytes:
    """A ZIP file, entries stored."""
    buffer = streams.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        for name, content in tree.items():
            file.writestr(name, content)
    return buffer.getvalue()


def tiff(data: np.ndarray, **options: object) -> bytes:
    buffer = streams.BytesIO()
    tifffile.imwrite(buffer, data, **options)
    return buffer.getvalue()


def by_pillow(data: np.ndarray, compression: str) -> bytes:
    buffer = streams.BytesIO()
    Image.fromarray(data).save(buffer, "TIFF", compression=compression)
    return buffer.getvalue()


def packed_tiff(bits: int = 12, rows: int = 3, columns: int = 5) -> bytes:
    """A TIFF of `bits` per pixel, counting up from 0, without gaps inside a row."""
    values = np.arange(rows * columns).reshape(rows, columns) * 3
    lines = []
    for row in values:
        text = "".join(format(value % 2**bits, f"0{bits}b") for value in row.tolist())
        text += "0" * (-len(text) % 8)
        lines.append(int(text, 2).to_bytes(len(text) // 8, "big"))
    pixels = b"".join(lines)
    tags = [
        (256, columns),
        (257, rows),
        (258, bits),
        (259, 1),
        (262, 1),
        (273, 8),
        (277, 1),
        (278, rows),
        (279, len(pixels)),
    ]
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    at = 8 + len(pixels) + len(pixels) % 2
    head = b"II*\0" + struct.pack("<I", at) + pixels.ljust(at - 8, b"\0")
    return head + struct.pack("<H", len(tags)) + entries + bytes(4)


def heidelberg(rng: np.random.Generator) -> bytes:
    """An HDF5 file as the HCI of Heidelberg published them."""
    with tempfile.TemporaryDirectory() as folder:
        with h5py.File(Path(folder) / "a.h5", "w") as file:
            file["LF"] = rng.integers(0, 255, (2, 2, 5, 6, 3), np.uint8)
            file["GT_DEPTH"] = rng.random((2, 2, 5, 6)).astype(np.float32)
            file.attrs["dH"] = 0.5
        return (Path(folder) / "a.h5").read_bytes()


def bmp(picture: np.ndarray) -> bytes:
    """A Windows bitmap."""
    buffer = streams.BytesIO()
    Image.fromarray(picture).save(buffer, "BMP")
    return buffer.getvalue()


def pnm(picture: np.ndarray) -> bytes:
    """A PGM or PPM of 8 or 16 bits."""
    kind, white = (6 if picture.ndim == 3 else 5), 255 if picture.dtype == np.uint8 else 65535
    head = f"P{kind}\n# a note\n{picture.shape[1]} {picture.shape[0]}\n{white}\n".encode()
    return head + picture.astype(">u2" if white > 255 else np.uint8).tobytes()


def mats(data: np.ndarray) -> list[bytes]:
    """MATLAB files of version 5, plain and packed, and of version 7.3."""
    found = []
    for packed in (False, True):
        buffer = streams.BytesIO()
        scipy.io.savemat(buffer, {"LF": data, "note": "text"}, do_compression=packed)
        found.append(buffer.getvalue())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            file["LF"] = data.T
            file["LF"].attrs["MATLAB_class"] = np.bytes_("uint8")
        content = path.read_bytes()
    return [*found, b"MATLAB 7.3 MAT-file".ljust(512) + content[512:]]


def npy(data: np.ndarray) -> bytes:
    """An array as NumPy saves it."""
    buffer = streams.BytesIO()
    np.save(buffer, data)
    return buffer.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    """Some arrays as NumPy packs them."""
    buffer = streams.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def mend_png(tree: Tree) -> Tree:
    """Checksums of all chunks that are still whole."""
    return {
        name: _mended_png(content) if name.endswith(".png") else content for name, content in tree.items()
    }


def _mended_png(content: bytes) -> bytes:
    result, at = bytearray(content), 8
    while at + 12 <= len(result):
        length = int.from_bytes(result[at : at + 4], "big")
        end = at + 8 + length
        if end + 4 > len(result):
            break
        result[end : end + 4] = struct.pack(">I", zlib.crc32(result[at + 4 : end]))
        at = end + 4
    return bytes(result)


def mend_lytro(tree: Tree) -> Tree:
    """Digests, in the headers and in the table, of all sections that are still whole."""
    return {name: _mended_lytro(content) for name, content in tree.items()}


def _mended_lytro(content: bytes) -> bytes:
    at, result = 16, content
    while at + 96 <= len(content) and content[at : at + 3] == b"\x89LF":
        length = int.from_bytes(content[at + 12 : at + 16], "big")
        if at + 96 + length > len(content):
            break
        old = content[at + 16 : at + 61]
        new = b"sha1-" + hashlib.sha1(content[at + 96 : at + 96 + length]).hexdigest().encode()
        if content[at + 3 : at + 4] == b"C" and old.startswith(b"sha1-"):
            result = result.replace(old, new)
        at += 96 + length + -length % 16
    return result
