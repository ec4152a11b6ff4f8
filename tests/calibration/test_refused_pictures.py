"""White images without one lattice, or with another one than was asked for, are refused."""

import math

import numpy as np
import pytest

from calibration_drawing import sampled
from lumigraph.calibration import calibrate
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError


def test_a_rotation_that_is_not_there_is_refused():
    white = sampled(Lattice.square(16.0, 0.05), (150, 160))
    assert calibrate(white, rotation=0.06).lattice.rotation == pytest.approx(0.05, abs=1e-3)
    with pytest.raises(CalibrationError, match=r"no lattice of rotation 20\.00 deg"):
        calibrate(white, rotation=math.radians(20))


def two_lattices():
    return sampled(Lattice.square(14.2), (200, 200), fill=0.5) + sampled(
        Lattice.square(20.1, 0.3), (200, 200), fill=0.4
    )


def with_nan():
    white = sampled(Lattice.square(10.0), (60, 60))
    white[3, 4] = np.nan
    return white


@pytest.mark.parametrize(
    ("white", "options", "match"),
    [
        (with_nan, {}, r"1 NaN or infinite values of 3600, the first at index \(3, 4\)"),
        (lambda: np.ones((1, 1)), {}, r"1 x 1 pixels but 3 x 3 lenslets need at least 12 x 12"),
        (lambda: np.full((50, 50), 7.0), {}, r"flat: all its values lie between 7 and 7"),
        (
            lambda: np.random.default_rng(1).random((120, 120)),
            {},
            r"shows no lattice(: its autocorrelation returns to 0\.\d+| for certain: the likeliest)",
        ),
        (
            lambda: sampled(Lattice.square(40.0, 0, (20, 20)), (90, 300)),
            {},
            r"2\.\d x 7\.\d lenslets of pitch 4\d",
        ),
        (two_lattices, {}, r"pitches|rectangular|one direction|no lattice|micro-images"),
        (
            lambda: np.tile(np.sin(np.arange(120) / 3), (120, 1)),
            {},
            r"one-dimensional \(cylindrical\) lens array: it repeats every 18\.\d+ px in one direction",
        ),
        (
            lambda: sampled(Lattice.square(20.1), (200, 200)),
            {"pitch": 30},
            r"no lattice of pitch 30 px: it has a square lattice of pitch 20\.\d+ px.*pass pitch=20",
        ),
        (
            lambda: sampled(Lattice.square(20.1), (200, 200)),
            {"pitch": 40},
            r"no lattice of pitch 40 px: it has a square lattice of pitch 20\.\d+ px",
        ),
        (lambda: sampled(Lattice.square(20.1), (200, 200)), {"pitch": 2}, r"pitch is 2 px but .* below 4 px"),
        (
            lambda: sampled(Lattice.square(20.1), (200, 200)),
            {"pitch": -2},
            r"pitch is -2 px but must be above 0",
        ),
        (
            lambda: sampled(Lattice.square(20.1), (200, 200)),
            {"layout": "round"},
            r"layout is 'round' but must be",
        ),
        (
            lambda: sampled(Lattice.square(20.1), (200, 200)),
            {"layout": "hex"},
            r"no lattice of layout 'hex': it has a square lattice",
        ),
    ],
)
def test_pictures_without_one_lattice_are_refused(white, options, match):
    with pytest.raises(CalibrationError, match=match):
        calibrate(white(), **options)
