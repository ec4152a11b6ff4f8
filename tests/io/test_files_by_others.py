"""Files of other programs that declare more, or other orders, than their bare pixels say."""

import h5py
import numpy as np
import pytest
import scipy.io
import tifffile
from PIL import Image

import lumigraph as lg
from fuzz import seeds
from lumigraph.errors import FormatError, SamplingWarning

VIEWS = np.random.default_rng(3).integers(1, 255, (2, 3, 8, 9, 3), np.uint8)
PLANES = np.arange(2 * 3 * 4 * 6 * 7, dtype=np.uint16).reshape(2, 3, 4, 6, 7)


def ome_xml(names):
    parts = "".join(
        f'<TiffData FirstT="{k}" IFD="{page}"><UUID FileName="{name}">urn:{name}</UUID></TiffData>'
        for k, (name, page) in enumerate(names)
    )
    return (
        '<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06"><Image ID="Image:0"><Pixels ID="P" '
        'DimensionOrder="XYZCT" Type="uint16" SizeX="7" SizeY="6" SizeC="1" SizeZ="1" SizeT="4" '
        f'SignificantBits="12" PhysicalSizeX="2" PhysicalSizeY="2">{parts}</Pixels></Image></OME>'
    )


def write_pages(path, planes, text):
    with tifffile.TiffWriter(path, ome=False) as file:
        for k, plane in enumerate(planes):
            file.write(plane, description=text if k == 0 else None, metadata=None, contiguous=False)


@pytest.mark.parametrize("sign_y", [1, -1])
@pytest.mark.parametrize("sign_x", [1, -1])
def test_positions_in_names_say_at_which_end_the_numbers_begin(tmp_path, sign_y, sign_x):
    for row in range(2):
        for column in range(3):
            name = f"out_{row:02}_{column:02}_{sign_y * 5.5 * row:.6f}_{sign_x * 4.0 * column:.6f}.png"
            lg.save(np.full((4, 5), 10 * row + column, np.uint8), tmp_path / name)
    found = lg.open(tmp_path)
    expected = np.array([[0, 1, 2], [10, 11, 12]])[::-sign_y, ::-sign_x]
    np.testing.assert_array_equal(found.data[..., 0, 0], expected)
    assert found.aperture.pitch == pytest.approx((5.5, 4.0))


def test_positions_whose_y_counts_up_are_read_as_the_pictures_show(tmp_path):
    """Three rows of cameras above each other, whose pictures move up from one to the next."""
    texture = np.random.default_rng(0).integers(0, 255, (60, 60), np.uint8)
    for row in range(3):
        for column in range(3):
            name = f"out_{row:02}_{column:02}_{-5.0 * row:.6f}_{5.0 * column:.6f}.png"
            lg.save(texture[2 * row : 2 * row + 50, 2 * column : 2 * column + 50], tmp_path / name)
    with pytest.warns(SamplingWarning, match="the y in its names counts up"):
        found = lg.open(tmp_path)
    np.testing.assert_array_equal(found.data[0, 0], texture[4:54, 4:54])


def test_views_counted_through_are_doubted_as_one_row(tmp_path):
    for k in range(9):
        lg.save(np.full((4, 5), k, np.uint8), tmp_path / f"bench2_{k:03}.png")
    with pytest.warns(SamplingWarning, match="names 9 views of one row, 2. If they are 3 rows of as many"):
        assert lg.open(tmp_path).data.shape[:2] == (1, 9)


def test_two_pictures_of_one_view_are_refused(tmp_path):
    for name in ("view_00_00.png", "depth_00_00.png"):
        lg.save(np.ones((4, 5), np.uint8), tmp_path / name)
    with pytest.raises(FormatError, match="two pictures of row 0, column 0"):
        lg.open(tmp_path)


@pytest.mark.parametrize(
    ("name", "write"), [("{:03}_{:03}.ppm", seeds.pnm), ("view_{:02}_{:02}.bmp", seeds.bmp)]
)
def test_folders_of_other_pictures_open(tmp_path, name, write):
    for row in range(2):
        for column in range(3):
            (tmp_path / name.format(row, column)).write_bytes(write(VIEWS[row, column]))
    np.testing.assert_array_equal(lg.open(tmp_path).data, VIEWS[::-1, ::-1])


def test_an_imagej_stack_of_one_directory_is_read_whole(tmp_path):
    plane = PLANES[0, 0]
    data = b"".join(one.astype(">u2").tobytes() for one in plane)
    tifffile.imwrite(
        tmp_path / "a.tif",
        plane[0],
        byteorder=">",
        description="ImageJ=1.54\nimages=4\nframes=4\n",
        metadata=None,
    )
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        at = file.pages.first.dataoffsets[0]
    content = (tmp_path / "a.tif").read_bytes()
    (tmp_path / "a.tif").write_bytes(content[:at] + data)
    np.testing.assert_array_equal(lg.open(tmp_path / "a.tif").data, plane)
    np.testing.assert_array_equal(lg.open(tmp_path / "a.tif", page=2).data, plane[2])
    (tmp_path / "a.tif").write_bytes(content[:at] + data[:-1])
    with pytest.raises(FormatError, match="cut short: ImageJ's header says 4 images"):
        lg.open(tmp_path / "a.tif")


def test_a_hyperstack_keeps_its_axes(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", PLANES, imagej=True, metadata={"axes": "TZCYX"})
    found = lg.open(tmp_path / "a.tif")
    assert (found.metadata["axes"], found.metadata["axes_sizes"]) == ("TZCYX", [2, 3, 4])
    np.testing.assert_array_equal(found.data.reshape(PLANES.shape), PLANES)


def test_planes_of_other_shapes_are_read_as_they_are_meant_or_refused(tmp_path):
    path, colour = tmp_path / "a.tif", VIEWS[0, 0]
    tifffile.imwrite(path, colour, photometric="minisblack")  # eight pages, each three pixels wide
    np.testing.assert_array_equal(lg.open(path).data, colour)
    tifffile.imwrite(path, PLANES[0, 0], photometric="minisblack", volumetric=True, tile=(16, 16, 16))
    with pytest.raises(FormatError, match="holds 4 planes in one page"):
        lg.open(path)
    with tifffile.TiffWriter(path) as file:  # a thumbnail before the picture
        file.write(PLANES[0, 0, 0, ::2, ::2], subfiletype=1)
        file.write(PLANES[0, 0, 0])
    with pytest.raises(FormatError, match="page 1 has another size"):
        lg.open(path)
    np.testing.assert_array_equal(lg.open(path, page=1).data, PLANES[0, 0, 0])


def test_arrays_whose_last_axis_counts_pictures_are_asked_for(tmp_path):
    stack = np.arange(50 * 60 * 5).reshape(50, 60, 5)  # (y, x, n)
    scipy.io.savemat(tmp_path / "a.mat", {"stack": stack})
    with pytest.raises(
        FormatError, match=r"axes='nyx' \(50 of 60 x 5 px\) or axes='yxn' \(5 of 50 x 60 px\)"
    ):
        lg.open(tmp_path / "a.mat")
    assert [part.noun for part in lg.contents(tmp_path / "a.mat")] == ["array"]
    np.testing.assert_array_equal(lg.open(tmp_path / "a.mat", axes="yxn").data[1], stack[..., 1])


def test_planes_in_files_beside_are_read_or_named(tmp_path):
    path, plane = tmp_path / "a.ome.tif", PLANES[0, 0]
    write_pages(
        path, plane[:2], ome_xml([("a.ome.tif", 0), ("a.ome.tif", 1), ("b.ome.tif", 0), ("b.ome.tif", 1)])
    )
    with pytest.raises(FormatError, match=r"2 of them in files that are not beside it: b.ome.tif"):
        lg.open(path)
    np.testing.assert_array_equal(lg.open(path, page=1).data, plane[1])
    write_pages(
        tmp_path / "b.ome.tif", plane[2:], '<OME xmlns="x"><BinaryOnly MetadataFile="a.ome.tif"/></OME>'
    )
    found = lg.open(path)
    np.testing.assert_array_equal(found.data, plane)
    assert (found.bit_depth, found.pixel_pitch) == (12, pytest.approx(2e-6))
    with pytest.raises(FormatError, match=r"planes are named in 'a.ome.tif'"):
        lg.open(tmp_path / "b.ome.tif")


def test_arrays_in_the_order_of_matlab_are_read_or_asked_for(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["LF"] = VIEWS.T
    np.testing.assert_array_equal(lg.open(tmp_path / "a.h5").data, VIEWS[::-1, ::-1])
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["LF"] = VIEWS[..., 0].T
    with pytest.raises(FormatError, match=r"axes='vuyx' \(9 x 8 views of 3 x 2 px\) or axes='xyuv'"):
        lg.open(tmp_path / "b.h5")
    np.testing.assert_array_equal(lg.open(tmp_path / "b.h5", axes="xyuv").data, VIEWS[::-1, ::-1, ..., 0])


@pytest.mark.parametrize("which", [0, 1, 2])
def test_matlab_files_of_every_version_open_alike(tmp_path, which):
    (tmp_path / "a.mat").write_bytes(seeds.mats(VIEWS)[which])
    np.testing.assert_array_equal(lg.open(tmp_path / "a.mat").data, VIEWS[::-1, ::-1])


def test_the_weight_of_samples_says_which_are_valid(tmp_path):
    weight = np.arange(2 * 3 * 8 * 9).reshape(2, 3, 8, 9, 1) % 2
    scipy.io.savemat(tmp_path / "a.mat", {"LF": np.concatenate([VIEWS, weight.astype(np.uint8)], -1)})
    found = lg.open(tmp_path / "a.mat")
    assert found.data.shape == VIEWS.shape
    np.testing.assert_array_equal(found.valid, weight[::-1, ::-1, ..., 0] > 0)


def test_numpy_arrays_open_and_pickles_do_not(tmp_path):
    np.save(tmp_path / "a.npy", np.asfortranarray(VIEWS.astype(">u2")))
    np.testing.assert_array_equal(lg.open(tmp_path / "a.npy").data, VIEWS[::-1, ::-1])
    np.savez_compressed(tmp_path / "a.npz", one=VIEWS, two=VIEWS[0, 0])
    np.testing.assert_array_equal(lg.open(tmp_path / "a.npz", what="two").data, VIEWS[0, 0])
    np.save(tmp_path / "b.npy", np.array([[{}]]), allow_pickle=True)
    with pytest.raises(FormatError, match="pickled objects, which are never read"):
        lg.open(tmp_path / "b.npy")


def test_a_mosaic_with_odd_sides_loses_its_rest_with_a_warning(tmp_path):
    Image.fromarray(VIEWS[0, 0].repeat(4, 0).repeat(4, 1)).save(tmp_path / "a.eslf.png")
    with pytest.warns(SamplingWarning, match="the last 2 rows and 1 columns are left out"):
        assert lg.open(tmp_path / "a.eslf.png", views=5).data.shape == (5, 5, 6, 7, 3)
