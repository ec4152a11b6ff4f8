"""What each way in does with a raw image that has an offset, vignetting and a colour mosaic."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.calibration import calibrate
from lumigraph.cli.deconvolve import Seen
from lumigraph.cli.origin import Origin
from lumigraph.errors import CalibrationError

PITCH, OFFSET = 12.4, 50.0


@pytest.fixture
def bench(tmp_path):
    """raw, white, dark; the same behind an RGGB mosaic; a maker's lattice two pixels off."""
    y, x = np.mgrid[:200, :220].astype(float)
    dy, dx = lg.Lattice.square(PITCH, 0, (100, 110)).offset(y, x)
    even = 4000 * np.exp(-((np.hypot(dy, dx) / 5.3) ** 6)) * (1 - 0.3 * (y / 200 - 0.5) ** 2)
    scene = 0.5 + 0.3 * np.sin(y / 40) * np.sin(x / 30)
    for name, light in (("white", even), ("raw", even * scene), ("dark", 0 * even)):
        data = (light + OFFSET).astype(np.float32)
        lg.save(lg.RawImage(data), tmp_path / f"{name}.tiff")
        lg.save(lg.RawImage(data, bayer="RGGB"), tmp_path / f"{name}-bayer.zarr")
    return tmp_path


def test_verbs_subtract_the_dark_divide_by_the_white_and_demosaic(bench):
    origin = Origin(white=bench / "white.tiff", dark=bench / "dark.tiff")
    raw, calibration = origin.prepared(lg.open(bench / "raw.tiff"))
    centres = np.rint(calibration.centers_within((20, 180), (20, 200))).astype(int)
    y, x = centres.T
    seen = raw.data[y, x]
    np.testing.assert_allclose(seen / (0.5 + 0.3 * np.sin(y / 40) * np.sin(x / 30)), 4000, rtol=0.06)
    origin = Origin(white=bench / "white-bayer.zarr", dark=bench / "dark-bayer.zarr")
    raw, _ = origin.prepared(lg.open(bench / "raw-bayer.zarr"))
    assert raw.data.shape == (200, 220, 3)


def test_the_viewer_divides_grey_pictures_and_leaves_mosaics_alone(bench):
    origin = viewer.Origin(white=bench / "white.tiff")
    shown = viewer.open_exhibit(bench / "raw.tiff", origin)
    assert shown.views is not None
    shown = viewer.open_exhibit(bench / "raw-bayer.zarr", viewer.Origin(white=bench / "white-bayer.zarr"))
    assert shown.views is None, "a mosaic is shown as it is"
    assert shown.raw.bayer == "RGGB"
    assert shown.raw.data.max() == pytest.approx(3000 + OFFSET, rel=0.1), "and it keeps its offset"
    assert not hasattr(origin, "dark")


def test_deconvolution_takes_dark_and_white_into_its_model_and_leaves_the_raw_image(bench):
    raw = lg.open(bench / "raw.tiff")
    seen = Seen(white=bench / "white.tiff", dark=bench / "dark.tiff")
    calibration = seen.lenslets(raw)
    exposure = seen.exposure(raw, calibration)
    assert np.all(exposure.background == OFFSET)
    assert 0.6 < exposure.response.min() < exposure.response.max() == 1
    assert calibration.lattice.pitch == pytest.approx(PITCH, abs=0.01)


def test_all_refuse_a_calibration_that_does_not_fit_but_the_viewer(bench):
    raw = lg.open(bench / "raw.tiff")
    found = calibrate(lg.open(bench / "white.tiff"))
    lattice = replace(found.lattice, basis=tuple((1.1 * y, 1.1 * x) for y, x in found.lattice.basis))
    lg.save(replace(found, lattice=lattice, residual_px=0.0), bench / "wrong.toml")
    for prepare in (
        Origin(calibration=bench / "wrong.toml").prepared,
        Seen(calibration=bench / "wrong.toml").lenslets,
    ):
        with pytest.raises(CalibrationError, match="slip by"):
            prepare(raw)
