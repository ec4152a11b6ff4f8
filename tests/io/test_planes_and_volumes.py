"""TIFF of any depth and several pages, OME-TIFF, OME-Zarr, HDF5: what is saved comes back, sizes too."""

import functools
import gzip
import json
import struct
import zlib

import h5py
import numpy as np
import pytest
import tifffile
import zarr
from PIL import Image
from zarr.codecs import BloscCodec

import lumigraph as lg
import lumigraph.io as io
from data_folder import real
from fuzz import seeds
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.core.volume import Volume
from lumigraph.errors import FormatError, SamplingWarning
from lumigraph.io import ngff, ome, source

GRID = Grid((5, 6), (2e-6 / 3, 0.5e-6), (1e-6, -2e-6))
VOLUMES = ("v.ome.tiff", "v.tif", "v.zarr", "v.ome.zarr", "v.zarr.zip", "v.h5")


@pytest.mark.parametrize("name", VOLUMES)
@pytest.mark.parametrize("channels", [(), (3,), (2,)])
@pytest.mark.parametrize("depths", [(-3e-6, 0.0, 3e-6), (0.0, 1e-6, 5e-6), (2e-6, 1e-6, 0.0), (1e-6,)])
def test_a_volume_survives_exactly(tmp_path, rng, name, channels, depths):
    volume = Volume(rng.random((len(depths), 5, 6, *channels)).astype(np.float32), GRID, depths)
    lg.save(volume, tmp_path / name)
    back = lg.open(tmp_path / name)
    assert isinstance(back, Volume)
    assert (back.grid, back.depths) == (GRID, depths)
    np.testing.assert_array_equal(back.data, volume.data)
    assert io.contents(tmp_path / name)[0].noun == "Volume" or "tif" in name


def test_other_programs_read_the_sizes_of_an_ome_tiff(tmp_path, rng):
    volume = Volume(rng.random((3, 5, 6)).astype(np.float32), GRID, (-3e-6, 0.0, 3e-6))
    io.save(volume, tmp_path / "v.ome.tiff")
    with tifffile.TiffFile(tmp_path / "v.ome.tiff") as file:
        assert file.is_ome
        series = file.series[0]
        assert (series.axes, series.shape) == ("ZYX", (3, 5, 6))
        np.testing.assert_array_equal(series.asarray(), volume.data)
        pixels = tifffile.xml2dict(file.ome_metadata)["OME"]["Image"]["Pixels"]
    assert pixels["PhysicalSizeZ"] == pytest.approx(3.0)
    assert pixels["PhysicalSizeY"] == pytest.approx(2 / 3)
    assert (pixels["PhysicalSizeX"], pixels["PhysicalSizeXUnit"]) == (pytest.approx(0.5), "µm")
    assert [plane["PositionZ"] for plane in pixels["Plane"]] == pytest.approx([-3.0, 0.0, 3.0])


def test_an_ome_tiff_by_another_program_is_a_volume(tmp_path, rng):
    data = rng.integers(0, 99, (4, 5, 6), np.uint16)
    sizes = {"PhysicalSizeX": 0.5, "PhysicalSizeY": 0.25, "PhysicalSizeZ": 2000, "PhysicalSizeZUnit": "nm"}
    tifffile.imwrite(tmp_path / "a.ome.tif", data, ome=True, metadata={"axes": "ZYX", **sizes})
    volume = io.open(tmp_path / "a.ome.tif")
    assert isinstance(volume, Volume)
    assert volume.spacing == pytest.approx((2e-6, 0.25e-6, 0.5e-6))
    assert volume.depths == pytest.approx((-4e-6, -2e-6, 0, 2e-6))
    np.testing.assert_array_equal(volume.data, data)
    tifffile.imwrite(tmp_path / "t.ome.tif", data, ome=True, metadata={"axes": "TYX", **sizes})
    assert isinstance(io.open(tmp_path / "t.ome.tif"), Stack)


def test_a_refocus_stack_keeps_its_positions(tmp_path, rng):
    stack = Stack(rng.random((3, 5, 6, 3)), (0.9, 1.0, 1.1), "alpha", 6.5e-6, None, {"camera": "µ"})
    io.save(stack, tmp_path / "s.tiff")
    back = io.open(tmp_path / "s.tiff")
    assert (back.positions, back.quantity, back.pixel_pitch) == ((0.9, 1.0, 1.1), "alpha", 6.5e-6)
    assert back.metadata == {"camera": "µ"}
    np.testing.assert_array_equal(back.data, stack.data)
    with tifffile.TiffFile(tmp_path / "s.tiff") as file:
        pixels = tifffile.xml2dict(file.ome_metadata)["OME"]["Image"]["Pixels"]
    assert pixels["PhysicalSizeX"] == pytest.approx(6.5)
    assert io.open(tmp_path / "s.tiff", page=1).data.shape == (5, 6, 3)
    assert "page=0 ... 2 opens one" in io.contents(tmp_path / "s.tiff")[0].about


def test_real_stacks_open_without_a_page():
    stack = io.open(real("lfm_guv", "output_stack-10.tif"))
    assert (type(stack).__name__, stack.data.shape) == ("Stack", (10, 108, 112))
    assert io.open(real("lfm_guv_simulated", "GUVSimul1_VolumeGroundTruth.tif")).data.shape == (47, 47, 47)


@pytest.mark.parametrize("bits", [2, 3, 4, 6, 10, 11, 12, 14, 15])
def test_packed_tiffs_of_any_depth_are_read(tmp_path, bits):
    (tmp_path / "a.tif").write_bytes(seeds.packed_tiff(bits, 4, 7))
    raw = io.open(tmp_path / "a.tif")
    assert (raw.bit_depth, raw.data.dtype.itemsize) == (bits, 1 if bits <= 8 else 2)
    np.testing.assert_array_equal(raw.data, (3 * np.arange(28) % 2**bits).reshape(4, 7))


@pytest.mark.parametrize("compression", ["tiff_lzw", "packbits", "tiff_adobe_deflate"])
def test_compressed_tiffs_are_read(tmp_path, rng, compression):
    data = rng.integers(0, 65535, (9, 7), np.uint16)
    Image.fromarray(data).save(tmp_path / "a.tif", compression=compression)
    np.testing.assert_array_equal(io.open(tmp_path / "a.tif").data, data)


def test_palettes_and_one_bit_in_a_tiff(tmp_path, rng):
    colour = np.repeat(rng.integers(0, 255, (6, 7, 1), np.uint8), 3, -1)
    Image.fromarray(colour).quantize(5).save(tmp_path / "p.tif")
    assert io.open(tmp_path / "p.tif").data.shape == (6, 7, 3)
    Image.fromarray(colour[..., 0] > 99).save(tmp_path / "b.tif")
    np.testing.assert_array_equal(io.open(tmp_path / "b.tif").data, (colour[..., 0] > 99) * np.uint8(255))


@pytest.mark.parametrize(("samples", "colour"), [(3, 2), (4, 6), (2, 4)])
def test_pngs_of_16_bit_colour_keep_every_bit(tmp_path, rng, samples, colour):
    data = rng.integers(0, 65535, (9, 11, samples), np.uint16)
    (tmp_path / "a.png").write_bytes(seeds.wide_png(data, colour))
    raw = io.open(tmp_path / "a.png")
    assert raw.bit_depth == 16
    np.testing.assert_array_equal(raw.data, data[..., 0] if samples == 2 else data[..., :3])


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_pngs_of_few_bits_are_read(tmp_path, bits):
    values = np.arange(2**bits, dtype=np.uint8)
    row = np.unpackbits(values[:, None], axis=1)[:, 8 - bits :].ravel()
    lines = b"\0" + np.packbits(row).tobytes()
    head = struct.pack(">IIBBBBB", len(values), 1, bits, 0, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(seeds.png_of([(b"IHDR", head), (b"IDAT", zlib.compress(lines))]))
    np.testing.assert_array_equal(io.open(tmp_path / "a.png").data[0], values * (255 // (2**bits - 1)))


def test_jpegs_are_read_as_the_sensor_lies(tmp_path):
    picture = np.zeros((24, 40, 3), np.uint8)
    picture[:12, :20] = 200, 100, 50
    exif = Image.Exif()
    exif[274] = 6  # turn by 90 degrees to show
    Image.fromarray(picture).save(tmp_path / "a.jpg", quality=95, subsampling=0, exif=exif)
    np.testing.assert_allclose(io.open(tmp_path / "a.jpg").data.astype(float), picture, atol=40)
    assert np.abs(io.open(tmp_path / "a.jpg").data.astype(float) - picture).mean() < 2
    Image.fromarray(picture[..., 0]).save(tmp_path / "g.jpeg")
    assert io.open(tmp_path / "g.jpeg").data.shape == (24, 40)
    Image.fromarray(picture).convert("CMYK").save(tmp_path / "c.jpg")
    with pytest.raises(FormatError, match="has the colours CMYK"):
        io.open(tmp_path / "c.jpg")
    content = bytearray((tmp_path / "g.jpeg").read_bytes())
    at = content.index(b"\xff\xc0")
    content[at + 5 : at + 9] = struct.pack(">HH", 12_000, 12_000)
    (tmp_path / "g.jpeg").write_bytes(content)
    with pytest.raises(FormatError, match="declares 144000000 bytes of pixels"):
        io.open(tmp_path / "g.jpeg")
    io.save(picture, tmp_path / "b.jpg", white=255)
    assert np.abs(io.open(tmp_path / "b.jpg").data.astype(float) - picture).mean() < 2


def test_a_volume_is_an_ome_zarr_for_others(tmp_path, rng):
    volume = Volume(rng.random((3, 5, 6, 2)), GRID, (-3e-6, 0.0, 3e-6))
    io.save(volume, tmp_path / "v.ome.zarr")
    group = zarr.open_group(tmp_path / "v.ome.zarr", mode="r")
    image = group.attrs["ome"]["multiscales"][0]
    assert group.attrs["ome"]["version"] == "0.5"
    assert [(a["name"], a["type"], a.get("unit")) for a in image["axes"]] == [
        ("c", "channel", None), ("z", "space", "micrometer"), ("y", "space", "micrometer"),
        ("x", "space", "micrometer"),
    ]  # fmt: skip
    scale, shift = (step for step in image["datasets"][0]["coordinateTransformations"])
    assert scale["scale"] == pytest.approx([1, 3, 2 / 3, 0.5])
    assert shift["translation"] == pytest.approx([0, -3, GRID.y[0] * 1e6, GRID.x[0] * 1e6])
    array = group["0"]
    assert array.metadata.dimension_names == ("c", "z", "y", "x")
    np.testing.assert_array_equal(array[...], np.moveaxis(volume.data, -1, 0))
    # What it tells others is what we would read of it, were it theirs.
    name, axes, lengths = ngff.levels(group.attrs["ome"])[0]
    other = ngff.volume(np.asarray(array), axes, lengths)
    assert (name, other.depths) == ("0", pytest.approx(volume.depths))
    np.testing.assert_allclose(other.grid.y, GRID.y)
    np.testing.assert_allclose(other.grid.x, GRID.x)


def test_a_large_volume_is_a_pyramid(tmp_path, rng):
    """Each level shows the same light in the same place: its mean, its middle, its centre of mass."""
    grid = Grid((301, 520), (0.5e-6, 0.4e-6), (1e-6, 0))
    volume = Volume(rng.random((3, 301, 520)).astype(np.float32), grid, (-3e-6, 0.0, 5e-6))
    volume.data[1, 100:104, 200:204] = 500
    io.save(volume, tmp_path / "v.ome.zarr")
    group = zarr.open_group(tmp_path / "v.ome.zarr", mode="r")
    levels = ngff.levels(group.attrs["ome"])
    shapes = [group[name].shape for name, *_ in levels]
    assert shapes == [(3, 301, 520), (3, 151, 260), (3, 76, 130)]
    assert sorted(group.array_keys()) == ["0", "1", "2"]
    for name, axes, lengths in levels:
        one = ngff.volume(np.asarray(group[name]), axes, lengths)
        assert one.data.mean() == pytest.approx(volume.data.mean(), rel=0.02)  # odd ends count twice
        bright = np.where(one.data[1] > 99, one.data[1], 0)
        middle = (bright.sum(1) @ one.grid.y / bright.sum(), bright.sum(0) @ one.grid.x / bright.sum())
        assert middle == pytest.approx((grid.y[100:104].mean(), grid.x[200:204].mean()), abs=1e-9)
    np.testing.assert_array_equal(io.open(tmp_path / "v.ome.zarr").data, volume.data)


def test_the_finest_level_that_may_be_read_is_opened(tmp_path, rng):
    volume = Volume(rng.integers(0, 255, (2, 300, 300), np.uint8), Grid((300, 300), 1e-6), (0.0, 5e-6))
    io.save(volume, tmp_path / "v.zarr")
    with pytest.warns(SamplingWarning, match="level 1 of 2 is opened, 2 x 150 x 150"):
        coarse = io.open(tmp_path / "v.zarr", max_pixels=30_000)
    assert coarse.data.dtype == np.uint8
    assert coarse.depths == volume.depths
    assert coarse.grid.pitch == pytest.approx((2e-6, 2e-6))
    assert coarse.grid.y[0] == pytest.approx(volume.grid.y[:2].mean())
    with pytest.raises(FormatError, match="at most 1e\\+03 are read"):
        io.open(tmp_path / "v.zarr", max_pixels=1000)


def foreign(folder, axes, shape, scale, **level):
    group = zarr.create_group(folder, zarr_format=3)
    group.create_array("s0", shape=shape, dtype="u2", chunks=shape)[...] = 7
    place = [{"type": "scale", "scale": scale}]
    image = {"axes": axes, "datasets": [{"path": "s0", "coordinateTransformations": place, **level}]}
    group.attrs["ome"] = {"version": "0.5", "multiscales": [image]}


AXES = [{"name": n, "type": "space", "unit": "nanometer"} for n in "zyx"]


def test_an_ome_zarr_by_another_program_is_a_volume(tmp_path):
    more = [{"name": "t", "type": "time"}, {"name": "c", "type": "channel"}]
    foreign(tmp_path / "a.zarr", more + AXES, (1, 2, 3, 4, 5), [1, 1, 300, 200, 100])
    volume = io.open(tmp_path / "a.zarr")
    assert volume.data.shape == (3, 4, 5, 2)
    assert volume.spacing == pytest.approx((3e-7, 2e-7, 1e-7))
    assert (volume.grid.y[0], volume.grid.x[0], volume.depths[0]) == pytest.approx((0, 0, 0), abs=1e-18)
    foreign(tmp_path / "t.zarr", more + AXES, (2, 1, 3, 4, 5), [1, 1, 1, 1, 1])
    with pytest.raises(FormatError, match="holds 2 times where one volume is needed"):
        io.open(tmp_path / "t.zarr")
    foreign(tmp_path / "x.zarr", AXES[::-1], (3, 4, 5), [1, 1, 1])
    with pytest.raises(FormatError, match=r"axes are \('x', 'y', 'z'\)"):
        io.open(tmp_path / "x.zarr")
    foreign(tmp_path / "p.zarr", AXES, (3, 4, 5), [1, 1, 1], path="../a.zarr/s0")
    with pytest.raises(FormatError, match=r"at '../a.zarr/s0'; only"):
        io.open(tmp_path / "p.zarr")
    foreign(tmp_path / "n.zarr", AXES, (3, 4, 5), [1, 1, 0])
    with pytest.raises(FormatError, match=r"x is 0 m but must be above 0|not a multiscales image"):
        io.open(tmp_path / "n.zarr")


@pytest.mark.parametrize("name", ["a.zarr", "a.h5"])
def test_a_light_field_names_its_axes_and_keeps_its_mask(tmp_path, rng, name):
    data = rng.random((2, 3, 4, 5, 3)).astype(np.float32)
    views = LightField(data, Grid((2, 3), (0.1, 0.1)), Grid((4, 5), (1e-4, 1e-4)), 0.4, data[..., 0] > 0.3)
    io.save(views, tmp_path / name)
    back = io.open(tmp_path / name)
    np.testing.assert_array_equal(back.valid, views.valid)
    np.testing.assert_array_equal(back.data, data)
    if name == "a.h5":
        with h5py.File(tmp_path / name) as file:
            assert [axis.label for axis in file["data"].dims] == list("vutsc")
            np.testing.assert_array_equal(file["data"].dims[0]["v"][...], views.aperture.y)
            assert file["s"].attrs["units"] == b"m"
    else:
        array = zarr.open_group(tmp_path / name, mode="r")["data"]
        assert array.metadata.dimension_names == ("v", "u", "t", "s", "c")
        assert array.attrs["axes"][0] == {"name": "v", "type": "space", "unit": "meter"}


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32", "float64", "int32"])
def test_a_raw_image_survives_hdf5(tmp_path, rng, dtype):
    raw = RawImage(
        (rng.random((13, 17)) * 99).astype(dtype), 1e-6, 12 if "u" in dtype else None, "GRBG", {"a": [1]}
    )
    io.save(raw, tmp_path / "a.hdf5")
    back = io.open(tmp_path / "a.hdf5")
    assert (back.pixel_pitch, back.bit_depth, back.bayer, back.metadata) == (
        1e-6,
        raw.bit_depth,
        "GRBG",
        {"a": [1]},
    )
    np.testing.assert_array_equal(back.data, raw.data)


def test_heidelberg_light_fields_and_their_depth(tmp_path, rng):
    (tmp_path / "a.h5").write_bytes(seeds.heidelberg(rng))
    views = io.open(tmp_path / "a.h5")
    assert (views.data.shape, views.aperture.pitch) == ((2, 2, 5, 6, 3), (1.0, 0.5))
    depth = io.open(tmp_path / "a.h5", what="GT_DEPTH")
    assert depth.data.shape == (2, 2, 5, 6)
    assert [part.name for part in io.contents(tmp_path / "a.h5")] == ["GT_DEPTH", "LF"]
    with pytest.raises(FormatError, match=r"has no dataset 'X'\. It holds GT_DEPTH, LF"):
        io.open(tmp_path / "a.h5", what="X")


def test_several_arrays_and_links_out_of_an_hdf5_file(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["one"], file["g/two"] = np.ones((3, 4)), np.ones((2, 3, 5))
        file["out"] = h5py.ExternalLink("/etc/passwd", "/")
        file["text"] = np.array([[b"x"]])
    with pytest.raises(FormatError, match=r"holds one, g/two\. Choose one by what="):
        io.open(tmp_path / "a.h5")
    assert isinstance(io.open(tmp_path / "a.h5", what="g/two"), Stack)
    for name in ("out", "text", "g"):
        with pytest.raises(FormatError, match=r"has no dataset 'out'|is not an array of numbers"):
            io.open(tmp_path / "a.h5", what=name)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("a", (4, 4), "u1", external=[("/etc/hostname", 0, 16)])
    with pytest.raises(FormatError, match="keeps its pixels in other files"):
        io.open(tmp_path / "b.h5")


# Files made to fill the memory: a few kilobytes that inflate to 64 MiB or more where little is declared.


@functools.cache
def bomb(size=80 << 20):
    return zlib.compress(bytes(size), 9)


def test_a_bomb_in_a_tiff_is_refused(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((64, 64), np.uint8), compression="zlib", rowsperstrip=64)
    packed = bomb()
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        places = [file.pages.first.tags[tag].valueoffset for tag in ("StripOffsets", "StripByteCounts")]
    content = bytearray((tmp_path / "a.tif").read_bytes())
    for place, value in zip(places, (len(content), len(packed)), strict=True):
        content[place : place + 4] = struct.pack("<I", value)
    (tmp_path / "a.tif").write_bytes(bytes(content) + packed)
    with pytest.raises(FormatError, match="made to fill the memory"):
        io.open(tmp_path / "a.tif")


def test_a_bomb_in_an_hdf5_chunk_is_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", (64, 64), "u1", chunks=(64, 64), compression="gzip")
        data.id.write_direct_chunk((0, 0), bomb())
    with pytest.raises(FormatError, match="made to fill the memory"):
        io.open(tmp_path / "a.h5")


def test_bombs_in_a_zarr_store_are_refused(tmp_path):
    io.save(np.zeros((64, 64), np.uint8), tmp_path / "a.zarr")
    chunk = tmp_path / "a.zarr" / "data" / "c" / "0" / "0"
    whole = bytearray(chunk.read_bytes())
    # A frame header that declares 1 GiB: single segment, 4 bytes of content size, a checksum.
    chunk.write_bytes(b"\x28\xb5\x2f\xfd" + bytes([0b10100100]) + struct.pack("<I", 1 << 30) + whole[7:])
    with pytest.raises(FormatError, match=r"a chunk becomes 1073741824 bytes where 4096 are declared"):
        io.open(tmp_path / "a.zarr")
    chunk.write_bytes(b"\x28\xb5\x2f\xfd" + bytes([0, 0]) + whole[6:])
    with pytest.raises(FormatError, match="an unknown number of bytes where 4096"):
        io.open(tmp_path / "a.zarr")
    metadata = tmp_path / "a.zarr" / "data" / "zarr.json"
    fields = json.loads(metadata.read_text())
    fields["codecs"][1] = {"name": "gzip", "configuration": {"level": 5}}
    metadata.write_text(json.dumps(fields))
    chunk.write_bytes(bomb(4 << 20))
    with pytest.raises(FormatError, match="made to fill the memory"):
        io.open(tmp_path / "a.zarr")
    fields["codecs"].append({"name": "zstd", "configuration": {"level": 0, "checksum": False}})
    metadata.write_text(json.dumps(fields))
    with pytest.raises(FormatError, match="packed by bytes, gzip, zstd; only"):
        io.open(tmp_path / "a.zarr")


def test_blosc_is_refused_as_its_decoder_can_die(tmp_path):
    for name, content in seeds.foreign_zarr(BloscCodec()).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match="packed by bytes, blosc; only zstd or gzip is read"):
        io.open(tmp_path / "a.zarr")


def test_what_a_file_cannot_hold_is_refused_before_it_is_allocated(tmp_path):
    head = struct.pack(">IIBBBBB", 10_000, 10_000, 8, 0, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(seeds.png_of([(b"IHDR", head), (b"IDAT", zlib.compress(bytes(100)))]))
    with pytest.raises(
        FormatError, match=r"declares 100000000 bytes of pixels but its .* bytes cannot hold them"
    ):
        io.open(tmp_path / "a.png")
    source.check_inflated(tmp_path, zlib.compress(bytes(5000)), 5000)
    two = gzip.compress(bytes(100)) + bytes(3) + gzip.compress(bytes(4900))  # as one file of gzip
    source.check_inflated(tmp_path, two, 5000)
    with pytest.raises(FormatError, match="become more than the 4999"):
        source.check_inflated(tmp_path, two, 4999)
    with pytest.raises(FormatError, match="become more than the 4999"):
        source.check_inflated(tmp_path, zlib.compress(bytes(5000)), 4999)


def test_ome_xml_with_entities_is_refused():
    text = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa">]><OME><Pixels SizeX="&a;"/></OME>'
    with pytest.raises(FormatError, match="its OME-XML is damaged"):
        ome.parse(text)
    assert ome.parse("no XML") is None
    with pytest.raises(FormatError, match="gives a size of '-1'"):
        ome.parse('<OME><Pixels SizeZ="-1"/></OME>')


def test_options_of_other_formats_are_refused(tmp_path):
    io.save(np.ones((4, 4), np.uint8), tmp_path / "a.png")
    with pytest.raises(FormatError, match=r"page= means nothing for .*a.png, a PNG file"):
        io.open(tmp_path / "a.png", page=0)
    with pytest.raises(FormatError, match=r"fps= means nothing for .*a.png"):
        io.save(np.ones((4, 4), np.uint8), tmp_path / "a.png", fps=3)


def test_a_table_row_is_what_its_module_does():
    for row in io.FORMATS:
        module = row.imported()
        assert hasattr(module, "load") == bool(row.reads), row
        assert hasattr(module, "save") or not row.writes, row


@pytest.mark.parametrize(
    ("positions", "shape", "message"),
    [
        ((1.0,), (2, 3, 4), "1 positions are given for 2 pictures"),
        ((), (3, 4), r"a stack has shape \(n, y, x\)"),
        ((np.nan, 1.0), (2, 3, 4), "positions is nan"),
    ],
)
def test_stacks_that_cannot_be(positions, shape, message):
    with pytest.raises(lg.GeometryError, match=message):
        Stack(np.ones(shape), positions)
