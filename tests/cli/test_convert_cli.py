"""`lumigraph convert`."""

import json

import numpy as np
import pytest

import lumigraph as lg
from metrology.scenes import BOARD, NOMINAL, corners

SHAPE = (600, 800)


@pytest.fixture(scope="module")
def measured():
    return lg.metrology.board(corners(np.random.default_rng(2), frames=4), BOARD, NOMINAL)


@pytest.fixture
def files(tmp_path, measured):
    """camera.json, and calibrations of a square and of a hexagonal array."""
    lg.metrology.save(measured, tmp_path / "camera.json")
    lattices = {
        "square": lg.Lattice.square(23.3, 0.002, (5.0, 6.0)),
        "hex": lg.Lattice.hex(23.3, 0.0, (5.0, 6.0)),
    }
    for name, lattice in lattices.items():
        indices = lattice.indices((0, SHAPE[0] - 1), (0, SHAPE[1] - 1))
        lg.save(
            lg.Calibration(lattice, SHAPE, indices, lattice.position(indices), 0.0), tmp_path / f"{name}.toml"
        )
    return tmp_path


@pytest.mark.parametrize(("form", "array"), [("compote", "hex"), ("lftoolbox", "square")])
def test_a_measured_camera_goes_to_another_program_and_comes_back(lumigraph, files, measured, form, array):
    words = ["--calibration", f"{array}.toml", "--to", form, "--directions", 9, "--distance", "0.3 m"]
    result = lumigraph("convert", "camera.json", *words, "-o", "theirs.json", "--json")
    assert result.code == 0, result.err
    told = " ".join(json.loads(result.out)["notes"])
    assert "uncertainties" in told
    assert ("the array's tilt" in told) == (form == "lftoolbox")
    result = lumigraph("convert", "theirs.json", "-o", "ours.toml", "--json")
    assert result.code == 0, result.err
    for name in ("focal_length", "separation", "lenslet_distance"):
        assert json.loads(result.out)[name] == pytest.approx(getattr(measured.camera, name), rel=1e-9)
    ours = lg.open("ours.toml")
    assert ours.separation == pytest.approx(measured.camera.separation, rel=1e-9)
    assert ours.lattice.pitch == pytest.approx(23.3, rel=1e-9)
    assert ours.shape == SHAPE


def test_a_calibration_goes_to_raytrix(lumigraph, files):
    assert lumigraph("convert", "hex.toml", "-o", "array.xml").code == 0
    assert lumigraph("convert", "array.xml", "--shape", *SHAPE, "-o", "again.toml").code == 0
    assert lg.open("again.toml").lattice.pitch == pytest.approx(23.3)
    assert "the lattice is square" in lumigraph("convert", "square.toml", "-o", "square.xml").err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["camera.json", "--to", "compote", "-o", "a.json"],
            "has no lattice of micro-images. Give --calibration",
        ),
        (["hex.toml", "--to", "compote", "-o", "a.json"], "holds no lengths of a camera"),
        (["hex.toml", "-o", "a.json"], "has the wrong extension"),
        (
            ["camera.json", "--calibration", "hex.toml", "--to", "lftoolbox", "-o", "a.json"],
            "Give --directions 9",
        ),
    ],
)
def test_what_is_missing_is_named(lumigraph, files, words, said):
    result = lumigraph("convert", *words)
    assert result.code == 1
    assert said in result.err
