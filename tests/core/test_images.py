"""RawImage, LightField and Calibration."""

import numpy as np
import pytest

from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError, FormatError, GeometryError

VIEWS, LENSLETS = Grid((2, 3), 1e-3), Grid((4, 5), 1e-4)


def radiance(xp, colours=()):
    shape = (2, 3, 4, 5, *colours)
    return xp.asarray(np.arange(np.prod(shape), dtype=np.float32).reshape(shape))


def test_parts_of_a_light_field_are_its_slices(xp):
    data = radiance(xp)
    views = LightField(data, VIEWS, LENSLETS, 0.06)
    assert bool(xp.all(views.view(1, 2) == data[1, 2, ...]))
    assert bool(xp.all(views.micro_image(3, 4) == data[:, :, 3, 4]))
    assert bool(xp.all(views.epi(1, 2) == data[1, :, 2, :]))


def test_xarray_carries_names_and_coordinates_in_metres():
    array = LightField(radiance(np, (3,)), VIEWS, LENSLETS, 0.06).to_xarray()
    assert array.dims == ("v", "u", "t", "s", "c")
    np.testing.assert_allclose(array["u"], VIEWS.x)
    assert (array["t"].attrs["units"], array.attrs["separation"]) == ("m", 0.06)


def test_a_light_field_refuses_other_shapes_and_separations():
    with pytest.raises(
        GeometryError, match=r"data has shape \(2, 3, 4, 4\) but must be \(v, u, t, s\[, c\]\)"
    ):
        LightField(np.zeros((2, 3, 4, 4)), VIEWS, LENSLETS, 0.06)
    with pytest.raises(GeometryError, match="separation is 0 m but must be above 0 m"):
        LightField(radiance(np), VIEWS, LENSLETS, 0.0)


def test_a_raw_image_takes_grey_and_colour_and_refuses_the_rest():
    assert RawImage(np.zeros((4, 6, 3)), 5e-6, bayer=None).shape == (4, 6)
    with pytest.raises(GeometryError, match=r"has shape \(y, x\) or \(y, x, c\), not \(4,\)"):
        RawImage(np.zeros(4))
    with pytest.raises(GeometryError, match=r"not \(0, 4\)"):
        RawImage(np.zeros((0, 4)))
    with pytest.raises(GeometryError, match="pixel_pitch is -1 m but must be above 0 m"):
        RawImage(np.zeros((4, 4)), -1.0)
    with pytest.raises(FormatError, match="bayer is 'RGB' but must be one of RGGB"):
        RawImage(np.zeros((4, 4)), bayer="RGB")


def calibration(**changes):
    lattice = Lattice.square(10.0, origin=(5.0, 5.0))
    indices = lattice.indices((0, 40), (0, 60))
    known = {"lattice": lattice, "shape": (41, 61), "indices": indices, "residual_px": 0.5}
    known["centers"] = lattice.position(indices) + np.array([0.3, -0.4])
    return Calibration(**(known | changes))


def test_residuals_are_measured_centre_minus_lattice_point():
    np.testing.assert_allclose(calibration().residuals, np.tile([0.3, -0.4], (24, 1)))
    assert "0.500 px at worst" in calibration().report()
    assert "square, 24 lenslets on 41 x 61 px" in calibration().report()


def test_a_calibration_refuses_raw_images_of_another_size():
    calibration().check_fits((41, 61))
    with pytest.raises(CalibrationError, match="has 40 x 61 pixels but its calibration is for 41 x 61"):
        calibration().check_fits((40, 61))


def test_a_calibration_refuses_mismatched_tables_and_lengths():
    with pytest.raises(CalibrationError, match=r"both must be \(k, 2\)"):
        calibration(centers=np.zeros((3, 2)))
    with pytest.raises(CalibrationError, match="separation is -1 m but must be above 0 m"):
        calibration(separation=-1.0)
