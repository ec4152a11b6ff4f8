"""Everything that a calibration knows survives its file."""

import dataclasses
import re
import tomllib

import numpy as np
import pytest

from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.warp import Warp
from lumigraph.errors import FormatError
from lumigraph.io import calibration
from lumigraph.io.calibration import load_calibration, save_calibration
from lumigraph.io.numerals import listed


def full(rng):
    lattice = Lattice.hex(17.3, 0.02, (200, 300), kinds=3)
    indices = lattice.indices((0, 99), (0, 120))
    return Calibration(
        lattice, (100, 121), indices, lattice.position(indices) + rng.normal(size=indices.shape), 0.123,
        1e-6 / 3, 0.1, 0.02, Warp((50, 60), (1e-5 / 3, 2e-5), -1e-9 / 3), rng.random(len(indices)), 2 / 3,
        np.array([[1, 2], [-3, 4]]), (1.1, 1.0, 0.9), ('a "quoted" note\nof µ two lines', "another"),
    )  # fmt: skip


def same(one, other):
    for field in dataclasses.fields(Calibration):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        else:
            assert a == b, field.name


def test_every_field_survives_its_file(tmp_path, rng):
    for found in (full(rng), dataclasses.replace(full(rng), warp=None, light=None, notes=(), sharpness=())):
        save_calibration(found, tmp_path / "c.toml")
        same(load_calibration(tmp_path / "c.toml"), found)


@pytest.mark.parametrize(
    ("pattern", "other", "left"),
    [
        (r"$^", "", set()),
        (r"indices = \[\n  \[", "indices = [\n  [ ", {"indices"}),
        (r"centers = \[\n  \[[^,]*", "centers = [\n  [1_0.5", {"centers"}),
        (r"light = \[[^,]*", "light = [1_0.5", {"light"}),
        (r"\],\n\]", "]\n]", {"indices", "centers"}),
        (r"kind = ", 'x = """\n"""\nkind = ', {"indices", "centers", "light"}),
    ],
)
def test_many_lenslets_are_read_by_numpy_as_tomllib_reads_them(
    tmp_path, rng, monkeypatch, pattern, other, left
):
    """Rows that are written in another way are left to tomllib."""
    path = tmp_path / "c.toml"
    save_calibration(full(rng), path)
    path.write_text(re.sub(pattern, other, path.read_text()))
    found, names = load_calibration(path), {"indices", "centers", "light"}
    assert set(calibration._taken(path.read_text())[1]) == names - left
    monkeypatch.setattr(calibration, "_taken", lambda text: (text, {}))
    same(found, load_calibration(path))


@pytest.mark.parametrize(
    "values",
    [
        [0.0, 1e-6, -1e-6, 999999999.999999, -10.0], [1 / 3, 2.0], [1e12, 1e-300], [3.0], [-12345.678901],
        [[1, -20], [-300, 4]], [[0.5, -123.25], [1e-6, 99999.0]], [[1 / 3, 2.0]], [],
    ],
)  # fmt: skip
def test_numbers_written_fast_are_read_as_they_were(values):
    """Those of at most six decimals are written without Python, others by it."""
    text = listed(np.array(values))
    assert tomllib.loads(f"numbers = {text}")["numbers"] == values
    assert text.count("\n") == (len(values) + 1 if np.ndim(values) == 2 else 0)


@pytest.mark.parametrize("number", ["1..2", "1 2", "1, 2, 3", "one", "0_"])
def test_what_is_no_number_is_refused(tmp_path, rng, number):
    path = tmp_path / "c.toml"
    save_calibration(full(rng), path)
    for name in ("centers = [\n  [", "light = ["):
        text = path.read_text()
        path.write_text(text.replace(name, f"{name}{number}, ", 1))
        with pytest.raises(FormatError):
            load_calibration(path)
        path.write_text(text)


@pytest.mark.parametrize(
    ("line", "other", "match"),
    [
        ("tilt = ", "tilt = [1]\n#", r"warp\.tilt must be 2 finite numbers"),
        ("radial = ", "radial = nan\n#", r"warp\.radial must be a finite number"),
        ("notes = ", "notes = 3\n#", "notes must be a list of texts"),
        ("light = ", "light = [1, 2]\n#", r"light has shape \(2,\) but there are"),
        ("fill = ", "fill = -1\n#", "fill is -1"),
        ("missing = ", "missing = [1]\n#", r"lenslets\.missing must be k x 2 finite numbers"),
    ],
)
def test_a_wrong_field_is_named(tmp_path, rng, line, other, match):
    path = tmp_path / "c.toml"
    save_calibration(full(rng), path)
    text = path.read_text()
    assert line in text
    path.write_text(text.replace(line, other, 1))
    with pytest.raises(FormatError, match=match):
        load_calibration(path)
