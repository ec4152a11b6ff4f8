"""Lengths are taken as text with a unit wherever Python takes a length."""

import tomllib

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.core import checks
from lumigraph.units import mm, nm


def test_constructors_take_lengths_as_text():
    assert lg.ThinLens("158 mm", "25 mm", ("1 mm", "0 mm")) == lg.ThinLens(158 * mm, 25 * mm, (1 * mm, 0.0))
    assert lg.Grid.square(4, "5 um") == lg.Grid.square(4, 5e-6)
    assert lg.Grid((4, 5), ("5 um", "2 um"), ("1 mm", 0)) == lg.Grid((4, 5), (5e-6, 2e-6), (1 * mm, 0.0))
    assert lg.Sensor(pixel_pitch="1.4 um", shape=(4, 4)) == lg.Sensor(pixel_pitch=1.4e-6, shape=(4, 4))
    assert lg.RawImage(np.ones((2, 2)), pixel_pitch="5 um").pixel_pitch == 5e-6
    assert lg.Lattice.square("150 um") == lg.Lattice.square(150e-6)
    assert lg.CircularAperture("2 mm") == lg.CircularAperture(2 * mm)
    assert lg.Propagate("10 mm") == lg.Propagate(10 * mm)
    assert lg.Slice(np.ones((4, 4)), lg.Grid.square(4, "5 um"), "10 mm").dz == 10 * mm


def test_a_field_goes_a_distance_as_text():
    field = lg.Field(np.ones((8, 8), np.complex64), lg.Grid.square(8, "5 um"), "550 nm")
    assert field.wavelength == pytest.approx(550 * nm, rel=1e-12)
    gone, same = (lg.propagate(field, way, grid=field.grid) for way in ("0.1 mm", 1e-4))
    np.testing.assert_array_equal(gone.data, same.data)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: lg.ThinLens("158"),
            r"focal_length is '158' but must be a finite number \[m\], or text with a unit",
        ),
        (lambda: lg.ThinLens("158 deg"), "focal_length is '158 deg' but must be"),
        (lambda: lg.Grid.square(4, "-5 um"), r"pitch \(y\) is -5e-06 m but must be above 0"),
        (lambda: checks.finite("share", "5 mm", "1"), "share is '5 mm' but must be a finite number"),
    ],
)
def test_other_text_is_refused(call, message):
    with pytest.raises(lg.GeometryError, match=message):
        call()


def test_a_lens_in_millimetres_without_a_unit_warns():
    with pytest.warns(UserWarning, match="focal length of 158 m and a diameter of 5 m.*write '158 mm'"):
        lg.ThinLens(158, 5)
    with pytest.warns(UserWarning, match="focal length of -50 m"):
        lg.ThinLens(-50)
    lg.ThinLens(158.3)  # computed lengths may be as long
    lg.ThinLens(2.0, 0.5)


def test_a_camera_with_a_pitch_of_millimetres_names_its_key():
    text = lg.load_camera("thesis-plenoptic-1").to_toml()
    table = tomllib.loads(text)
    table["lenslets"]["pitch"] = "150 mm"
    with pytest.raises(lg.GeometryError, match=r"pixels.*Check lenslets\.pitch \(150 mm\)"):
        lg.PlenopticCamera.from_table(table, "camera.toml").describe()


def test_points_and_planes_are_written_with_units():
    points = lg.targets.points([("0 mm", "1 mm", "5 mm"), (0, 2e-3)]).parts[0]
    np.testing.assert_allclose(points.positions, [[0, 1e-3, 5e-3], [0, 2e-3, 0]])
    volume = lg.Volume(np.ones((2, 4, 4)), lg.Grid((4, 4), "1 um"), ("0 um", "1 um"))
    assert volume.depths == (0.0, 1e-6)
    with pytest.raises(lg.GeometryError, match="point 0 is '1 parsec' but must be"):
        lg.targets.points([("0 mm", "1 parsec")])


def test_files_of_cameras_and_calibrations_stand_for_them(tmp_path):
    camera = lg.load_camera("thesis-plenoptic-1").replace(lenslets={"count": (5, 5)})
    (tmp_path / "camera.toml").write_text(camera.to_toml())
    lg.save(camera.calibration, tmp_path / "calibration.toml")
    raw = lg.RawImage(np.ones(camera.calibration.shape))
    for path in (tmp_path / "calibration.toml", str(tmp_path / "calibration.toml")):
        np.testing.assert_array_equal(lg.decode(raw, path).data, lg.decode(raw, camera.calibration).data)
    assert lg.plots.layout(tmp_path / "camera.toml").axes
    with pytest.raises(lg.FormatError, match="describes a 'plenoptic', not a calibration"):
        lg.decode(raw, tmp_path / "camera.toml")
    with pytest.raises(
        lg.GeometryError, match=r"must be a LightField\. Read the file first, with lumigraph\.open"
    ):
        lg.refocus("views.zarr", 1)
