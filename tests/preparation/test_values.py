"""Raw images whose values no light leaves: each is refused or doubted in one line, with numbers."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.errors import CalibrationError, SamplingWarning

PITCH, SHAPE = 12.0, (120, 132)


def lit():
    """A white image, its values about 1000."""
    y, x = np.indices(SHAPE)
    dy, dx = lg.Lattice.square(PITCH, 0, (60, 66)).offset(y, x)
    return (1000 * np.exp(-((np.hypot(dy, dx) / 5.2) ** 6))).astype(np.float32)


@pytest.fixture(scope="module")
def place():
    return lg.calibrate(lit())


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (1e30, r"1 of 15840 values beyond ±1e\+15, such as 1e\+30 at index \(7, 9\)"),
        (-3e18, r"1 of 15840 values beyond ±1e\+15, such as -3e\+18 at index \(7, 9\)"),
        (np.inf, r"1 NaN or infinite values of 15840, the first at index \(7, 9\)"),
    ],
)
@pytest.mark.parametrize("which", ["raw", "white", "dark"])
def test_values_that_cannot_be_computed_with_are_refused_in_each_picture(which, value, message, place):
    pictures = {"raw": lit(), "white": lit(), "dark": np.zeros(SHAPE, np.float32)}
    pictures[which][7, 9] = value
    with pytest.raises(CalibrationError, match=f"the {which} image has {message}"):
        lg.prepare(pictures.pop("raw"), place, **pictures)


def test_a_white_image_is_not_calibrated_on_such_values():
    with pytest.raises(CalibrationError, match=r"15840 of 15840 values beyond ±1e\+15"):
        lg.calibrate(1e30 * (lit() + 1))


def test_whole_numbers_are_judged_as_well(place):
    with pytest.raises(CalibrationError, match="such as 4e"):
        lg.prepare(np.where(lit() > 1, 4 * 10**15, 0), place)


@pytest.mark.filterwarnings("error:.*overflow:RuntimeWarning")
def test_an_inverted_raw_image_is_doubted_and_decoded_without_overflow(place):
    mean = float(lit().mean())
    with pytest.warns(SamplingWarning, match=f"the raw image is -{mean:g} on average, below 0"):
        ready = lg.prepare(-lit(), place)
    assert any("below 0" in note for note in ready.notes)
    assert np.asarray(lg.decode(ready).data).max() <= 0


@pytest.mark.filterwarnings("always")
def test_the_command_line_says_it_too(tmp_path, monkeypatch, capsys, place):
    monkeypatch.chdir(tmp_path)
    lg.save(lg.RawImage(-lit()), "raw.tiff")
    lg.save(place, "lattice.toml")
    assert main(["decode", "raw.tiff", "--calibration", "lattice.toml", "-o", "views.zarr"]) == 0
    assert "on average, below 0" in "".join(capsys.readouterr())


def test_a_raw_image_below_its_dark_image_is_doubted(place):
    with pytest.warns(SamplingWarning, match="less than its dark level, 5000"):
        lg.prepare(lit(), place, dark=np.full(SHAPE, 5000, np.float32))


def test_one_value_all_over_is_noted(place):
    notes = lg.prepare(np.full(SHAPE, 7, np.uint16), place).notes
    assert "all pixels of the raw image are 7: there is nothing to see on it" in notes
    assert not any("nothing to see" in note for note in lg.prepare(lit(), place).notes)


def test_noise_about_nothing_is_not_doubted(place):
    dark = np.random.default_rng(0).normal(100, 5, (2, *SHAPE))
    ready = lg.prepare(dark[0], place, dark=dark[1])
    assert not any("on average" in note for note in ready.notes)
