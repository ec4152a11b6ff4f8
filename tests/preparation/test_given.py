"""Files that come with a raw image are read once, however many frames share them."""

import os

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.preparation import given

SHAPE = (120, 132)


def white(pitch):
    y, x = np.indices(SHAPE)
    dy, dx = lg.Lattice.square(pitch, 0, (60, 66)).offset(y, x)
    return (1000 * np.exp(-((np.hypot(dy, dx) / (0.43 * pitch)) ** 6))).astype(np.float32)


@pytest.fixture
def counted(monkeypatch):
    """Pitches of the lattices that were found."""
    found = []
    monkeypatch.setattr(given, "calibrate", lambda image: found.append(lg.calibrate(image)) or found[-1])
    return found


def test_the_lattice_is_found_once_for_all_frames_and_again_on_another_white_image(tmp_path, counted):
    file = tmp_path / "white.tiff"
    lg.save(lg.RawImage(white(12.0)), file)
    frames = [lg.RawImage(white(12.0) * part) for part in (0.3, 0.5, 0.9)]
    ready = [given.Given(white=file).prepared(frame) for frame in frames]
    assert len(counted) == 1
    for one in ready:
        assert one.calibration.lattice.pitch == pytest.approx(12, abs=0.01)
        assert one.notes[0] == "the lattice was found on the white image"
    lg.save(lg.RawImage(white(11.0)), file)  # the same name and size, another time
    os.utime(file, ns=(1, 1))
    other = given.Given(white=file).prepared(lg.RawImage(white(11.0)))
    assert other.calibration.lattice.pitch == pytest.approx(11, abs=0.01)
    assert len(counted) == 2


def test_a_given_calibration_is_taken_and_no_lattice_is_found(tmp_path, counted):
    lg.save(lg.RawImage(white(12.0)), tmp_path / "white.tiff")
    lg.save(lg.calibrate(white(12.0)), tmp_path / "found.toml")
    files = given.Given(tmp_path / "found.toml", tmp_path / "white.tiff")
    ready = files.prepared(lg.RawImage(0.5 * white(12.0)))
    assert not counted
    assert "the lattice was found on the white image" not in ready.notes
