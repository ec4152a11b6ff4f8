"""Lytro files: packed frames bit for bit, stacks, depth maps, calibrations, and what is damaged."""

import json

import numpy as np
import pytest

import lumigraph as lg
import lumigraph.io as io
from data_folder import real
from fuzz import seeds
from lumigraph.errors import FormatError
from lumigraph.io import bits


def packed_slowly(values: np.ndarray, bits: int) -> bytes:
    """The packings in plain Python, from their descriptions, apart from the reader's code."""
    result, flat = bytearray(), [int(value) for value in values.ravel()]
    if bits == 12:  # high bits first, without gaps
        for a, b in zip(flat[::2], flat[1::2], strict=True):
            result += (a << 12 | b).to_bytes(3, "big")
    elif bits == 10:  # four bytes of high bits, one of low bits
        for k in range(0, len(flat), 4):
            four = flat[k : k + 4]
            result += bytes(value >> 2 for value in four)
            result.append(sum((value & 3) << 2 * n for n, value in enumerate(four)))
    else:
        for value in flat:
            result += value.to_bytes(2, "little")
    return bytes(result)


CAMERAS = {
    "F01": (12, "big", "b", "BGGR", False),
    "Illum": (10, "little", "gr", "GRBG", True),
    "extracted": (16, "little", "r", "RGGB", False),
}


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("shape", [(16, 12), (35, 24)])
def test_a_raw_frame_is_read_back_bit_for_bit(tmp_path, rng, camera, shape):
    depth, order, first, bayer, illum = CAMERAS[camera]
    values = rng.integers(0, 2**depth, shape)
    values.flat[:4] = 0, 2**depth - 1, 1, 2 ** (depth - 1)
    metadata = seeds.frame_metadata(shape, depth, order, first, illum=illum)
    content = seeds.raw_container(packed_slowly(values, depth), metadata, illum=illum)
    (tmp_path / "a.lfp").write_bytes(content)
    raw = io.open(tmp_path / "a.lfp")
    assert (raw.bit_depth, raw.bayer, raw.pixel_pitch) == (depth, bayer, 1.4e-6)
    np.testing.assert_array_equal(raw.data, values)
    assert [part.name for part in io.contents(tmp_path / "a.lfp")] == ["raw", "calibration"]
    # The same without a container, its metadata beside it.
    (tmp_path / "b.raw").write_bytes(packed_slowly(values, depth))
    (tmp_path / "b.TXT").write_text(json.dumps(metadata))
    np.testing.assert_array_equal(io.open(tmp_path / "b.raw").data, values)


@pytest.mark.parametrize(("depth", "order"), bits.PACKINGS)
@pytest.mark.parametrize("count", [1, 2, 3, 7, 8])
def test_packing_and_unpacking_are_inverse(rng, depth, order, count):
    values = rng.integers(0, 2**depth, count)
    packed = bits.pack(values, depth, order)
    assert len(packed) == bits.packed_size(count, depth, order)
    np.testing.assert_array_equal(bits.unpack(packed, count, depth, order), values)


def test_a_bare_frame_of_known_size_needs_no_metadata(tmp_path):
    (tmp_path / "a.raw").write_bytes(bytes(3280 * 3280 * 3 // 2))
    raw = io.open(tmp_path / "a.raw")
    assert (raw.data.shape, raw.bit_depth, raw.bayer) == ((3280, 3280), 12, "BGGR")
    (tmp_path / "a.raw").write_bytes(bytes(1000))
    with pytest.raises(FormatError, match=r"its 1000 bytes are not a frame of a Lytro F01 \(16137600\)"):
        io.open(tmp_path / "a.raw")
    with pytest.raises(FormatError, match="bare raw frame: what='stack' is not in it"):
        io.open(tmp_path / "a.raw", what="stack")


@pytest.mark.parametrize("camera", ["F01", "Illum"])
def test_what_the_camera_recorded_makes_the_colours(tmp_path, camera):
    depth, order, first, bayer, illum = CAMERAS[camera]
    known = seeds.frame_metadata((24, 24), depth, order, first, illum=illum)
    matrix = np.array([[2.0, -0.75, -0.25], [-0.5, 1.75, -0.25], [0.125, -1.125, 2.0]])
    grey, gains = 0.25, {"R": 1.0, "G": 1.25, "B": 2.0}
    values = np.empty((24, 24), int)
    for k, colour in enumerate(bayer):
        values[k // 2 :: 2, k % 2 :: 2] = round(64 + grey / gains[colour] * (1023 - 64))
    (tmp_path / "a.lfr").write_bytes(seeds.raw_container(packed_slowly(values, depth), known, illum=illum))
    raw = io.open(tmp_path / "a.lfr")
    np.testing.assert_array_equal(raw.metadata["colour_matrix"], matrix)
    assert raw.metadata["gamma"] == 0.41666
    assert raw.metadata["lytro"]["devices"]["mla"]["lensPitch"] == 1.4e-5
    # Rows of the matrix sum to 1, so grey stays grey; a level is 1/959.
    np.testing.assert_allclose(lg.demosaic(raw).data, grey, atol=5e-3)


def test_the_calibration_follows_from_the_lenslets(tmp_path):
    known = seeds.frame_metadata((60, 60), 12, "big", "b", illum=False)
    (tmp_path / "a.json").write_text(json.dumps(known))
    found = io.open(tmp_path / "a.json")
    grown = 10 * (1 + 2.5e-5 / 0.05)  # lens pitch over pixel pitch, seen from the exit pupil
    assert found.lattice.pitches[1] == pytest.approx(grown, rel=1e-6)
    assert found.lattice.rotation == pytest.approx(0.001, rel=1e-3)
    assert found.lattice.origin == pytest.approx((29.5 - 1.7 / 1.4, 29.5 + 0.4 / 1.4))
    assert (found.separation, found.lenslet_distance, found.pixel_pitch) == (0.05, 2.5e-5, 1.4e-6)
    assert found.notes


def test_real_containers_open_in_all_their_parts():
    stack = io.open(real("lytro_lfp", "IMG_0001-stk.lfp"))
    assert (stack.data.shape, stack.quantity) == ((12, 1080, 1080, 3), "lambda")
    assert list(stack.positions) == sorted(stack.positions)
    assert stack.positions[0] == pytest.approx(-8.92293, abs=1e-5)
    assert io.open(real("lytro_lfp", "IMG_0001-stk.lfp"), what="lut").data.shape == (20, 20)
    assert len(io.open(real("lytro_lfp", "IMG_0007-stk.lfp"))) == 5
    # The newspaper is sharp where the camera focused it, blurred at the nearest lambda.
    contrast = [np.abs(np.diff(stack[k][300:600, :, 1].astype(float))).mean() for k in (0, 7)]
    assert contrast[1] > 1.5 * contrast[0]
    depth = io.open(real("lytro_lfp", "IMG_0009-dm.lfp"))
    assert (depth.data.shape, depth.data.dtype) == ((330, 330), np.float32)
    assert (depth.data.min(), depth.data.max()) == (-14.0, 7.0)
    confidence = io.open(real("lytro_lfp", "IMG_0009-dm.lfp"), what="confidence").data
    assert 0.69 < confidence.min() <= confidence.max() < 1.001


def test_the_real_metadata_is_an_f01():
    found = io.open(real("lytro_lfp", "IMG_0001_metadataRef0.json"))
    assert found.shape == (3280, 3280)
    assert found.lattice.pitches[1] == pytest.approx(13.8986 / 1.4, rel=1e-5)
    assert found.lattice.layout == "hex"


def test_thumbnails_and_stacks_of_another_kind(tmp_path):
    picture = np.full((4, 6, 3), 90, np.uint8)
    content = seeds.jpeg(picture)
    row = {"width": 6, "height": 4, "representation": "jpeg", "imageRef": seeds.reference(content)}
    (tmp_path / "a.lfx").write_bytes(seeds.container({"thumbnails": [row]}, [content]))
    np.testing.assert_allclose(io.open(tmp_path / "a.lfx").data, picture, atol=2)
    video = {"type": "com.lytro.acceleration.refocusStack", "vendorContent": {"blockOfImages": {}}}
    table = {"picture": {"accelerationArray": [video]}}
    (tmp_path / "b.lfp").write_bytes(seeds.container(table, []))
    with pytest.raises(FormatError, match=r"another way than as JPEG pictures \(H.264\)"):
        io.open(tmp_path / "b.lfp")


METADATA = seeds.frame_metadata((16, 12), 12, "big", "b", illum=False)


def _packing(bits, order):
    found = json.loads(json.dumps(METADATA))
    found["image"]["rawDetails"]["pixelPacking"] = {"endianness": order, "bitsPerPixel": bits}
    return found


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"hello, this is no container", "is not a Lytro file: it begins with b'hello, t'"),
        (seeds.raw_container(bytes(288), METADATA)[:-200], "cut short or damaged: a section at byte"),
        (seeds.raw_container(bytes(287), METADATA), "16 x 12 pixels needs 288 bytes but has 287"),
        (
            seeds.raw_container(bytes(288), _packing(14, "big")),
            "pixels of 14 bits, big-endian, cannot be unpacked",
        ),
        (
            seeds.raw_container(bytes(288), _packing(True, "big")),
            "bitsPerPixel = 'True' where a count above 0",
        ),
        (
            seeds.raw_container(bytes(288), {"image": {"height": 1, "width": 1}}),
            "does not say how the pixels",
        ),
        (
            seeds.raw_container(bytes(288), METADATA).replace(bytes(100), bytes(99) + b"1"),
            "does not fit its digest",
        ),
        (seeds.container({}, []), "holds nothing that is read here"),
        (b"\x89LFP\r\n\x1a\n" + bytes(88), "no table of contents"),
        (seeds.section(b"M", b"[1]"), "not a JSON object"),
        (seeds.section(b"M", b"{"), "is not JSON"),
    ],
)
def test_damage_is_named(tmp_path, content, message):
    (tmp_path / "a.lfp").write_bytes(content)
    with pytest.raises(FormatError, match=message):
        io.open(tmp_path / "a.lfp")


def test_parts_that_are_not_there_are_named(tmp_path):
    (tmp_path / "a.lfp").write_bytes(seeds.raw_container(bytes(288), METADATA))
    with pytest.raises(FormatError, match=r"has no part .stack.. It holds raw, calibration"):
        io.open(tmp_path / "a.lfp", what="stack")
    with pytest.raises(FormatError, match=r"declares 16 x 12 = 192 pixels but at most 100"):
        io.open(tmp_path / "a.lfp", max_pixels=100)
    with pytest.raises(FormatError, match="has the wrong extension for this result, a RawImage"):
        io.save(np.ones((4, 4)), tmp_path / "b.lfp")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tiling": "square"}, "tiled 'square', not hexUniformRowMajor"),
        ({"lensPitch": -1}, "lacks devices.mla.lensPitch"),
        ({"lensPitch": 1e-7}, "lenslets 0.07.* px wide"),
        ({"scaleFactor": {"x": 1e-6, "y": 1}}, "more than|px wide|no lattice"),
    ],
)
def test_lenslets_that_make_no_lattice_are_refused(tmp_path, change, message):
    known = json.loads(json.dumps(METADATA))
    known["devices"]["mla"] |= change
    (tmp_path / "a.json").write_text(json.dumps(known))
    with pytest.raises(FormatError, match=message):
        io.open(tmp_path / "a.json")


def test_a_long_narrow_frame_does_not_fill_the_memory(tmp_path):
    # Rows of a hexagonal lattice lean: 60 000 rows run through 60 000 x 30 000 indices, most of them outside.
    known = json.loads(json.dumps(METADATA))
    known["image"] |= {"height": 500_000, "width": 60}
    (tmp_path / "a.json").write_text(json.dumps(known))
    with pytest.raises(FormatError, match=r"lenslets 10.0.* px wide that are sheared beyond use"):
        io.open(tmp_path / "a.json")


def test_values_that_do_not_fit_are_not_packed():
    with pytest.raises(FormatError, match=r"pixels of 12 bits are whole numbers 0 ... 4095"):
        bits.pack(np.array([4096]), 12, "big")
    with pytest.raises(FormatError, match="4 pixels of 10 bits need 5 bytes but there are 4"):
        bits.unpack(bytes(4), 4, 10, "little")


def padded(metadata: dict, size: int) -> bytes:
    """Metadata as JSON of so many bytes: blanks mean nothing in it."""
    return json.dumps(metadata).encode().ljust(size)


@pytest.mark.parametrize("more", [0, 1])
def test_metadata_in_a_container_is_read_up_to_8_mib_and_no_byte_more(tmp_path, more):
    limit, path = 8 << 20, tmp_path / "a.lfp"
    metadata = seeds.frame_metadata((16, 12), 16, "little", "r", illum=False)
    known, packed = padded(metadata, limit + more), bytes(16 * 12 * 2)
    frame = {"frame": {"metadataRef": seeds.reference(known), "imageRef": seeds.reference(packed)}}
    path.write_bytes(seeds.container({"picture": {"frameArray": [frame]}}, [known, packed]))
    if more:
        with pytest.raises(
            FormatError, match=f"its metadata has {limit + 1} bytes, at most {limit} are read"
        ):
            io.open(path)
    else:
        assert io.open(path).data.shape == (16, 12)


@pytest.mark.parametrize("more", [0, 1])
def test_metadata_beside_a_frame_is_read_up_to_8_mib_and_no_byte_more(tmp_path, more):
    limit, path = 8 << 20, tmp_path / "b.json"
    path.write_bytes(padded(seeds.frame_metadata((16, 12), 16, "little", "r", illum=True), limit + more))
    if more:
        with pytest.raises(FormatError, match=f"has {limit + 1} bytes, too many for metadata"):
            io.open(path)
    else:
        assert isinstance(io.open(path), lg.Calibration)
