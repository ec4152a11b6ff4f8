"""A raw image that does not fit its calibration, on the command line: one line with both numbers."""

from dataclasses import replace

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage

VERBS = {
    "decode": ("decode", "drawn.tiff", "--white", "even.tiff", "-o", "views.zarr"),
    "refocus": ("refocus", "drawn.tiff", "--alpha", "1", "-o", "picture.png"),
    "render": ("render", "drawn.tiff", "--patch", "4", "-o", "picture.png"),
    "depth": ("depth", "drawn.tiff", "-o", "depth.tiff"),
}


@pytest.fixture
def drawn(bench):
    """A raw image of pitch 12.40 px, calibrations of 12.40, 12.60 and 13.40 px, and one that is shifted."""
    y, x = np.mgrid[:240, :240].astype(float)
    dy, dx = Lattice.square(12.4, 0, (120, 120)).offset(y, x)
    picture = (np.hypot(dy, dx) < 5.3) * (200 + 50 * np.sin(y / 40) * np.sin(x / 30))
    io.save(RawImage(picture.astype(np.float32)), bench / "drawn.tiff")
    even = 1 + 199 * np.exp(-((np.hypot(dy, dx) / 5.3) ** 6))
    io.save(RawImage(even.astype(np.float32)), bench / "even.tiff")
    none = np.zeros((0, 2))
    for name, pitch, origin in (
        ("fits", 12.4, 120), ("slips", 12.6, 120), ("drifted", 13.4, 120), ("shifted", 12.4, 124.5),
    ):  # fmt: skip
        lattice = Lattice.square(pitch, 0, (origin, 120))
        io.save(Calibration(lattice, (240, 240), none, none, 0.0), bench / f"{name}.toml")


@pytest.mark.filterwarnings("always")
@pytest.mark.parametrize("verb", VERBS)
def test_a_raw_image_off_its_calibration_is_told_so(verb, lumigraph, drawn):
    words = VERBS[verb]
    refused = lumigraph(*words, "--calibration", "drifted.toml")
    assert refused.code != 0
    assert "repeats every 12.400 px" in refused.err
    assert "has a pitch of 13.400 px" in refused.err
    assert refused.err.count("\n") == 1
    for name, told in (("slips", "12.600 px"), ("shifted", "stand (-4.5,")):
        warned = lumigraph(*words, "--calibration", f"{name}.toml", "--overwrite")
        assert warned.code == 0, warned.err
        assert "warning" in warned.err
        assert told in warned.err
        assert warned.err.count("12.4") == 1, "told once"
    assert "12.4" not in lumigraph(*words, "--calibration", "fits.toml", "--overwrite").err


@pytest.mark.usefixtures("drawn")
def test_deconvolve_refuses_a_calibration_that_drifted(lumigraph, tmp_path):
    (tmp_path / "scope.toml").write_text(
        'kind = "light-field-microscope"\nwavelength = "550 nm"\n'
        "[objective]\nmagnification = 20\nnumerical_aperture = 0.4\n"
        '[lenslets]\npitch = "100 um"\nfocal_length = "2 mm"\ncount = [19, 19]\n'
        '[sensor]\npixel_pitch = "8.0645 um"\n'
    )
    words = ("deconvolve", "drawn.tiff", "--camera", "scope.toml", "-o", "volume.tiff", "--iterations", 1)
    refused = lumigraph(*words, "--calibration", "drifted.toml")
    assert (refused.code, refused.err.count("\n")) == (1, 1)
    assert "repeats every 12.400 px" in refused.err
    assert "has a pitch of 13.400 px" in refused.err
    assert "12.4" not in lumigraph(*words, "--calibration", "fits.toml", "--overwrite").err


@pytest.mark.usefixtures("drawn")
def test_views_without_the_cameras_lengths_say_what_their_refocus_factors_mean(lumigraph):
    words = ("decode", "drawn.tiff", "-o", "views.zarr", "--calibration")
    assert (
        "the camera's lengths are not known: refocus factors are those" in lumigraph(*words, "fits.toml").out
    )
    known = io.open("fits.toml", Calibration)
    io.save(replace(known, separation=0.2, lenslet_distance=0.004), "known.toml")
    assert "not known" not in lumigraph(*words, "known.toml").out
