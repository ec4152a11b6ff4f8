"""Raytrix XML and plenoptomos INI: the lattice where the maker says it is, and what is wrong with a file."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
import lumigraph.io as io
from data_folder import real
from fuzz import seeds
from lumigraph.core.warp import Warp
from lumigraph.errors import FormatError
from lumigraph.io import raytrix


def test_a_raytrix_lattice_stands_where_the_file_says(tmp_path):
    (tmp_path / "a.xml").write_bytes(seeds.RAYTRIX)
    found = io.open(tmp_path / "a.xml", shape=(60, 71))
    lattice = found.lattice
    assert (lattice.layout, lattice.kinds, found.shape) == ("hex", 3, (60, 71))
    assert lattice.origin == pytest.approx((29.5 + 2.25, 35 + 1.5))  # y up in the file
    assert lattice.pitches == pytest.approx((9.5, 9.5), rel=1e-6)
    assert lattice.rotation == pytest.approx(-0.01)  # y up: a positive angle there leads up
    assert lattice.basis[1][0] > 0
    assert len(found.notes) == 1
    assert raytrix.lens_types(tmp_path / "a.xml") == ((1.0, 3.0), (2.8, 4.0), (3.8, 100.0))
    assert io.contents(tmp_path / "a.xml")[0].about == "hexagonal, 3 lens types; open it with shape="
    with pytest.raises(FormatError, match=r"does not say how large the raw image is. Call .*shape=raw.shape"):
        io.open(tmp_path / "a.xml")


def test_the_lens_types_of_the_real_camera_differ_in_sharpness():
    # Fine detail of the picture by the kind of the lenslet. With the right lattice the three kinds differ
    # by 1.28 here, type 1 the sharpest; with kinds that do not follow the file's they would be alike.
    raw = io.open(real("raytrix_r42_multifocus", "sc2_klein.png"))
    found = io.open(real("raytrix_r42_multifocus", "sc2_klein.xml"), shape=raw.shape)
    assert found.lattice.pitch == pytest.approx(34.8647, abs=1e-3)
    grey = raw.data.astype(float).mean(-1)
    detail = np.abs(np.diff(np.log(grey + 5), axis=1))[:, :-1]
    kinds = found.lattice.kind(*found.lattice.index(*np.mgrid[: grey.shape[0], : grey.shape[1] - 2]))
    y, x = found.lattice.offset(*np.mgrid[: grey.shape[0], : grey.shape[1] - 2])
    inside = np.hypot(y, x) < 10
    sharp = [detail[inside & (kinds == kind)].mean() for kind in range(3)]
    assert sharp[1] == max(sharp)
    assert max(sharp) > 1.2 * min(sharp)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"<diameter units=\"pix\">9.5", b"<diameter>nine", "has no number diameter: 'nine'"),
        (b">9.5<", b">-9.5<", "diameter is -9.5 px but must be above 0"),
        (b">9.5<", b">900<", "lenslets 900 px wide on 60 x 70 px"),
        (b"<y>-0.8660254</y>", b"<y>0.0</y>", "parallel"),
        (b"</RayCalibData>", b"", "damaged XML"),
        (b"RayCalibData", b"Other", "not a Raytrix calibration: it begins with <Other>"),
        (b"<RayCalib", b"<!DOCTYPE x [<!ENTITY a 'b'>]><RayCalib", "damaged XML"),
    ],
)  # fmt: skip
def test_damaged_raytrix_files_are_named(tmp_path, old, new, message):
    (tmp_path / "a.xml").write_bytes(seeds.RAYTRIX.replace(old, new))
    with pytest.raises(FormatError, match=message):
        io.open(tmp_path / "a.xml", shape=(60, 70))


def test_the_real_geometry_of_plenoptomos():
    found = io.open(real("letters_plenoptic1", "letters_ULF_M1.ini"))
    assert found.shape == (1038, 1388)
    lengths = (found.pixel_pitch, found.separation, found.lenslet_distance)
    assert lengths == pytest.approx((6.45e-6, 0.4, 0.0186))
    assert found.lattice.pitch == pytest.approx(300 / 6.45 * (1 + 18.6 / 400))
    assert io.open(real("letters_plenoptic1", "letters_ULF_M1.ini"), shape=(960, 1280)).shape == (960, 1280)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"f2=18.6", b"f2=18.6\nf2", "is not an INI file|no physical"),
        (b"pixel_size_x=6.45e-3", b"", r"has no pixel_size_x above 0 in \[sensor\]"),
        (b"z=400.0", b"z=-1", r"has no z above 0 in \[micro_lenses_array\]"),
        (b"[sensor]", b"\xff\xfe", "is not an INI file"),
        (b"physical_size_s=300e-3", b"physical_size_s=1e-9", "px wide on 103 x 138 px"),
    ],
)
def test_damaged_geometries_are_named(tmp_path, old, new, message):
    (tmp_path / "a.ini").write_bytes(seeds.PLENOPTOMOS.replace(old, new))
    with pytest.raises(FormatError, match=message):
        io.open(tmp_path / "a.ini")


@pytest.mark.parametrize("kinds", [1, 3])
def test_a_lattice_comes_back_from_a_raytrix_file(tmp_path, kinds):
    # Turned, with two pitches and some shear, its origin far from the middle.
    lattice = lg.Lattice(((0.21, 9.5), (8.3, 4.6)), (3.25, -40.5), "hex", kinds)
    indices = lattice.indices((0, 99), (0, 140))
    given = lg.Calibration(lattice, (100, 141), indices, lattice.position(indices), 0.0)
    io.save(given, tmp_path / "a.xml")
    found = io.open(tmp_path / "a.xml", shape=(100, 141)).lattice
    assert np.allclose(found.basis, lattice.basis, rtol=1e-13)
    centers = lattice.centers((0, 99), (0, 140))
    assert np.allclose(found.centers((0, 99), (0, 140)), centers, atol=1e-10)
    assert np.array_equal(found.kind(*found.index(*centers.T)), lattice.kind(*lattice.index(*centers.T)))
    twice = io.open(tmp_path / "a.xml", shape=(100, 141))
    io.save(twice, tmp_path / "b.xml")
    assert np.allclose(
        io.open(tmp_path / "b.xml", shape=(100, 141)).lattice.origin, twice.lattice.origin, atol=1e-10
    )


def test_raytrix_files_keep_depths_of_lens_types_and_refuse_what_they_cannot_hold(tmp_path):
    (tmp_path / "a.xml").write_bytes(seeds.RAYTRIX)
    given = io.open(tmp_path / "a.xml", shape=(60, 71))
    types = raytrix.lens_types(tmp_path / "a.xml")
    raytrix.save(given, tmp_path / "b.xml", lens_types=types)
    assert raytrix.lens_types(tmp_path / "b.xml") == types
    with pytest.raises(FormatError, match="lens_types has 2 pairs but the array has 3 kinds"):
        raytrix.save(given, tmp_path / "b.xml", lens_types=types[:2])
    square = lg.Lattice.square(10.0)
    flat = replace(given, lattice=square, centers=square.position(given.indices))
    with pytest.raises(
        FormatError, match=r"the lattice is square, which a Raytrix file cannot hold. Save it as .toml"
    ):
        io.save(flat, tmp_path / "b.xml")
    with pytest.raises(FormatError, match="the lattice is warped"):
        io.save(replace(given, warp=Warp((30.0, 30.0), (1e-6, 0.0), 0.0)), tmp_path / "b.xml")
