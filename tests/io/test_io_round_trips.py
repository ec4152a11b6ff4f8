"""What is saved comes back the same: pixels, their type, and what is known beside them."""

import numpy as np
import pytest
import tifffile
import xarray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

import lumigraph.io as io
from data_folder import real
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.core.stack import Stack
from lumigraph.errors import FormatError

METADATA = {"camera": "bench µ", "exposure": 0.1, "list": [1, 2.5, None], "nested": {"yes": True}}
EVERY = ("raw.tiff", "raw.tif", "raw.zarr", "raw.zarr.zip", "raw.png")


def same(one: RawImage, other: RawImage) -> None:
    assert one.data.dtype == other.data.dtype
    np.testing.assert_array_equal(one.data, other.data)
    for name in ("pixel_pitch", "bit_depth", "bayer"):
        assert getattr(one, name) == getattr(other, name), name
    assert dict(one.metadata) == dict(other.metadata)


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_a_grey_raw_image_survives_with_all_its_fields(tmp_path, rng, name, dtype):
    data = rng.integers(0, np.iinfo(dtype).max, (13, 17), dtype=dtype, endpoint=True)
    raw = RawImage(data, 1 / 3 * 1e-6, 12 if dtype == "uint16" else 7, "GRBG", METADATA)
    io.save(raw, tmp_path / name)
    same(io.open(tmp_path / name), raw)


@pytest.mark.parametrize("name", EVERY)
def test_colour_survives(tmp_path, rng, name):
    raw = RawImage(rng.integers(0, 255, (5, 7, 3), dtype=np.uint8), bit_depth=8)
    io.save(raw, tmp_path / name)
    same(io.open(tmp_path / name), raw)


@pytest.mark.parametrize("name", EVERY[:4])
@pytest.mark.parametrize("dtype", ["float32", "float64", "int16", "uint32"])
@pytest.mark.parametrize(
    "shape", [(5, 7), (5, 7, 1), (5, 7, 2), (5, 7, 3), (5, 7, 4), (1, 1), (3, 1), (1, 3)]
)
def test_tiff_and_zarr_keep_any_number_and_shape(tmp_path, rng, name, dtype, shape):
    raw = RawImage((rng.normal(size=shape) * 100).astype(dtype), 6.45e-6, metadata=METADATA)
    raw = RawImage(np.abs(raw.data), 6.45e-6, None if "f" in dtype else 11, None, METADATA)
    io.save(raw, tmp_path / name)
    same(io.open(tmp_path / name), raw)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    ny=st.integers(1, 9),
    nx=st.integers(1, 9),
    pitch=st.one_of(st.none(), st.floats(1e-12, 1e3)),
    bits=st.one_of(st.none(), st.integers(1, 16)),
    name=st.sampled_from(EVERY),
    text=st.dictionaries(st.text(max_size=8), st.text(max_size=8), max_size=3),
)
def test_any_pitch_depth_and_text_survive(tmp_path, ny, nx, pitch, bits, name, text):
    raw = RawImage(np.arange(ny * nx, dtype=np.uint16).reshape(ny, nx), pitch, bits, None, text)
    io.save(raw, tmp_path / name)
    same(io.open(tmp_path / name), raw)


@pytest.mark.parametrize("name", ["views.zarr", "views.zarr.zip"])
@pytest.mark.parametrize("channels", [(), (3,)])
@pytest.mark.parametrize("dtype", ["float32", "float64", "uint16"])
def test_a_light_field_survives_exactly(tmp_path, rng, name, channels, dtype):
    data = (rng.normal(size=(3, 2, 4, 5, *channels)) * 50).astype("int32").astype(dtype)
    aperture, lenslets = Grid((3, 2), (0.1 / 3, 0.2), (1e-3, 0)), Grid((4, 5), (1e-4 / 3, 1e-4))
    io.save(LightField(data, aperture, lenslets, 0.4), tmp_path / name)
    back = io.open(tmp_path / name)
    assert isinstance(back, LightField)
    assert (back.aperture, back.lenslets, back.separation) == (aperture, lenslets, 0.4)
    assert back.data.dtype == data.dtype
    np.testing.assert_array_equal(back.data, data)


def test_other_programs_read_the_axes_and_units_of_a_light_field(tmp_path):
    views = LightField(np.zeros((3, 2, 4, 5), np.float32), Grid((3, 2), 0.1), Grid((4, 5), 1e-4), 0.4)
    io.save(views, tmp_path / "views.zarr")
    with xarray.open_zarr(tmp_path / "views.zarr") as found:
        assert found["data"].dims == ("v", "u", "t", "s")
        np.testing.assert_array_equal(found["s"], views.lenslets.x)
        assert found["v"].attrs["units"] == "m"


def test_other_programs_read_the_resolution_of_a_tiff_and_a_png(tmp_path):
    raw = RawImage(np.ones((4, 4), np.uint8), pixel_pitch=6.45e-6, bit_depth=8)
    io.save(raw, tmp_path / "raw.tiff")
    io.save(raw, tmp_path / "raw.png")
    with tifffile.TiffFile(tmp_path / "raw.tiff") as file:
        above, below = file.pages.first.tags["XResolution"].value
        assert file.pages.first.tags["ResolutionUnit"].value == 3  # centimetre
    assert above / below == pytest.approx(0.01 / 6.45e-6, rel=1e-6)
    with Image.open(tmp_path / "raw.png") as image:
        assert image.info["dpi"][0] == pytest.approx(25.4e-3 / 6.45e-6, rel=1e-4)  # whole pixels per metre


def test_a_file_by_another_program_has_no_pixel_pitch(tmp_path):
    tifffile.imwrite(tmp_path / "a.tiff", np.ones((4, 4), np.uint16), resolution=(72, 72))
    raw = io.open(tmp_path / "a.tiff")
    assert (raw.pixel_pitch, raw.bit_depth, dict(raw.metadata)) == (None, 16, {})


def test_big_endian_planar_and_white_is_zero_tiffs_are_read_as_they_look(tmp_path):
    image = np.arange(24, dtype=np.uint16).reshape(4, 6)
    tifffile.imwrite(tmp_path / "big.tif", image, byteorder=">")
    assert io.open(tmp_path / "big.tif").data.dtype == np.dtype("uint16")
    tifffile.imwrite(tmp_path / "inverse.tif", 65535 - image, photometric="miniswhite")
    np.testing.assert_array_equal(io.open(tmp_path / "inverse.tif").data, image)
    planes = np.stack([image, image + 1, image + 2])
    tifffile.imwrite(tmp_path / "planar.tif", planes, photometric="rgb", planarconfig="separate")
    np.testing.assert_array_equal(io.open(tmp_path / "planar.tif").data, np.moveaxis(planes, 0, -1))


def test_transparency_is_left_out_and_palettes_become_colour(tmp_path, rng):
    grey = rng.integers(0, 255, (4, 6), dtype=np.uint8)
    colour = np.stack([grey, grey, grey, np.full_like(grey, 255)], -1)
    Image.fromarray(colour).save(tmp_path / "rgba.png")
    Image.merge("LA", (Image.fromarray(grey),) * 2).save(tmp_path / "la.png")
    Image.fromarray(colour[..., :3]).quantize(4).save(tmp_path / "p.png")
    Image.fromarray(grey > 100).save(tmp_path / "one.png")
    tifffile.imwrite(tmp_path / "rgba.tif", colour, photometric="rgb", extrasamples=["unassalpha"])
    np.testing.assert_array_equal(io.open(tmp_path / "rgba.png").data, colour[..., :3])
    np.testing.assert_array_equal(io.open(tmp_path / "rgba.tif").data, colour[..., :3])
    np.testing.assert_array_equal(io.open(tmp_path / "la.png").data, grey)
    np.testing.assert_array_equal(io.open(tmp_path / "one.png").data, (grey > 100) * np.uint8(255))
    assert io.open(tmp_path / "p.png").data.shape == (4, 6, 3)


def test_floats_fill_the_range_of_a_png(tmp_path):
    io.save(np.array([[0.0, 1.0], [2.0, -1.0]]), tmp_path / "a.png")
    raw = io.open(tmp_path / "a.png")
    np.testing.assert_array_equal(raw.data, [[0, 32768], [65535, 0]])
    assert (raw.data.dtype, raw.bit_depth) == (np.dtype("uint16"), 16)
    io.save(np.array([[0.0, 1.0], [2.0, 8.0]]), tmp_path / "a.png", white=4.0)
    np.testing.assert_array_equal(io.open(tmp_path / "a.png").data, [[0, 16384], [32768, 65535]])
    io.save(np.full((2, 2, 3), 0.5), tmp_path / "a.png", white=1.0)
    np.testing.assert_array_equal(io.open(tmp_path / "a.png").data, np.full((2, 2, 3), 128))
    io.save(np.zeros((2, 2)), tmp_path / "a.png")
    np.testing.assert_array_equal(io.open(tmp_path / "a.png").data, np.zeros((2, 2)))
    io.save(-np.ones((2, 2)), tmp_path / "a.png")
    np.testing.assert_array_equal(io.open(tmp_path / "a.png").data, np.zeros((2, 2)))


def test_bare_arrays_of_any_library_are_pictures(tmp_path, xp):
    picture = xp.asarray([[0.0, 1.5], [2.0, 3.0]], dtype=xp.float64)
    io.save(picture, tmp_path / "a.tiff")
    raw = io.open(tmp_path / "a.tiff")
    assert raw.data.dtype == np.float32  # a picture needs no more, and viewers read no more
    np.testing.assert_array_equal(raw.data, [[0.0, 1.5], [2.0, 3.0]])
    io.save(picture, tmp_path / "a.zarr")
    assert io.open(tmp_path / "a.zarr").data.dtype == np.float64
    io.save(RawImage(picture > 1), tmp_path / "b.zarr")
    assert io.open(tmp_path / "b.zarr").data.dtype == bool


def test_a_list_of_pictures_becomes_a_stack_of_pages(tmp_path, rng):
    stack = [rng.normal(size=(4, 5)).astype(np.float32) for _ in range(3)]
    io.save(stack, tmp_path / "stack.tiff")
    for k, picture in enumerate(stack):
        np.testing.assert_array_equal(io.open(tmp_path / "stack.tiff", page=k).data, picture)
    found = io.open(tmp_path / "stack.tiff")
    assert isinstance(found, Stack)
    np.testing.assert_array_equal(found.data, np.stack(stack))
    with pytest.raises(FormatError, match=r"page is 3 but .* has 3"):
        io.open(tmp_path / "stack.tiff", page=3)


@pytest.mark.parametrize("hexagonal", [False, True])
def test_a_calibration_survives_exactly(tmp_path, rng, hexagonal):
    build = Lattice.hex if hexagonal else Lattice.square
    lattice = build(48.2 / 3, 0.00225, (30.1, 46.7))
    indices = lattice.indices((0, 99), (0, 119))
    centers = lattice.position(indices) + rng.normal(size=indices.shape) * 0.05
    known = {"pixel_pitch": 6.45e-6, "separation": 0.4, "lenslet_distance": 18.6e-3} if hexagonal else {}
    calibration = Calibration(lattice, (100, 120), indices, centers, 0.05 / 3, **known)
    io.save(calibration, tmp_path / "c.toml")
    back = io.open(tmp_path / "c.toml")
    assert back.lattice == lattice
    assert (back.shape, back.residual_px) == ((100, 120), 0.05 / 3)
    np.testing.assert_array_equal(back.indices, indices)
    np.testing.assert_array_equal(back.centers, centers)
    for name in ("pixel_pitch", "separation", "lenslet_distance"):
        assert getattr(back, name) == known.get(name)


def test_a_calibration_without_lenslets_survives(tmp_path):
    none = np.empty((0, 2))
    io.save(Calibration(Lattice.square(9.0), (4, 4), none.astype(int), none, 0.0), tmp_path / "c.toml")
    assert io.open(tmp_path / "c.toml").centers.shape == (0, 2)


def test_real_raw_images_are_read():
    letters = io.open(real("letters_plenoptic1", "letters_ULF_M1_white.png"))
    assert (letters.data.shape, letters.bit_depth) == ((960, 1280), 8)
    vesicle = io.open(real("lfm_guv", "Lightfield_GUVExperim1.tif"))
    assert (vesicle.data.shape, vesicle.data.dtype) == ((436, 436), np.dtype("uint16"))


def test_the_byte_order_of_an_array_does_not_matter_to_a_png(tmp_path):
    values = np.array([[1, 2], [300, 4]], ">u2")
    io.save(values, tmp_path / "a.png")
    assert np.array_equal(io.open(tmp_path / "a.png").data, values)
