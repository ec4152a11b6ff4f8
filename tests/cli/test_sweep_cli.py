import csv
import sys

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main

CAMERA = "thesis-plenoptic-2-m050"
FOCAL = "lenslets.focal_length=4 mm:6 mm:3"


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_each_row_is_what_the_camera_of_its_values_says(tmp_path):
    out, page = tmp_path / "t.csv", tmp_path / "t.html"
    said = ["sweep", CAMERA, "--vary", FOCAL, "--vary", "lenslets.magnification=0.3,0.5"]
    said += ["--measure", "patch", "-o", str(out), "--workers", "1", "--report", str(page)]
    assert main(said) == 0
    rows = table(out)
    assert [(row["lenslets.focal_length"], row["lenslets.magnification"]) for row in rows] == [
        (focal, part) for focal in ("4 mm", "5 mm", "6 mm") for part in ("0.3", "0.5")
    ]
    camera = lg.FocusedPlenopticCamera.from_catalogue(CAMERA)
    other = camera.replace(lenslets={"focal_length": "6 mm", "magnification": 0.3})
    assert float(rows[4]["patch [px]"]) == pytest.approx(other.patch, rel=1e-12)
    assert "<svg" in page.read_text() or "<img" in page.read_text()
    assert lg.cluster.status(out).is_whole


def asked(out):
    parts = "lenslets.magnification=0.3,0"  # the latter is none that a camera can have
    words = ["sweep", CAMERA, "--vary", FOCAL, "--vary", parts, "--measure", "patch,views per axis"]
    return [*words, "--workers", "1", "-o", str(out)]


def patches():
    """Of the cameras that there can be, by their focal lengths."""
    camera = lg.FocusedPlenopticCamera.from_catalogue(CAMERA)
    given = ({"focal_length": f"{focal} mm", "magnification": 0.3} for focal in (4, 5, 6))
    return [camera.replace(lenslets=lenslets).patch for lenslets in given]


def test_a_table_as_parquet_has_the_numbers(here, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is an extra")
    assert main(asked(tmp_path / "t.parquet")) == 0
    found = parquet.read_table(tmp_path / "t.parquet").to_pydict()
    assert found["patch [px]"][::2] == patches()
    assert found["patch [px]"][1] is None
    assert found["lenslets.magnification"] == [0.3, 0] * 3
    assert "lenslets.magnification is 0" in found["error"][1]


def test_without_pyarrow_a_line_says_what_to_install(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(asked(tmp_path / "t.parquet")) == 1
    assert "pip install 'lumigraph[tables]', or use .csv" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_netcdf_has_the_varied_keys_as_axes(here, tmp_path):
    xarray = pytest.importorskip("xarray", reason="xarray is an extra")
    assert main(asked(tmp_path / "t.nc")) == 0
    with xarray.open_dataset(tmp_path / "t.nc", engine="scipy") as found:
        assert found.patch.dims == ("lenslets.focal_length", "lenslets.magnification")
        np.testing.assert_allclose(found["lenslets.focal_length"], [4e-3, 5e-3, 6e-3])
        np.testing.assert_allclose(found.patch[:, 0], patches())
        assert np.isnan(found.patch[:, 1]).all()
        assert found.patch.attrs["units"] == "px"
        assert "lenslets.magnification is 0" in str(found.error.values[2, 1])


def test_what_no_camera_can_have_is_a_row_with_the_reason(here, tmp_path, capsys):
    out = tmp_path / "t.csv"
    said = ["sweep", CAMERA, "--vary", "lenslets.magnification=0.5,0", "--workers", "1", "-o", str(out)]
    assert main(said) == 0
    good, bad = table(out)
    assert not good["error"]
    assert "lenslets.magnification is 0" in bad["error"]
    assert "1 of them no camera can have" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--vary", "lenslets.focal=4 mm:6 mm:3"], "Did you mean 'lenslets.focal_length'"),
        (["--vary", "lenslets.focal_length=4,5"], "has no unit"),
        (["--vary", "lenslets.focal_length=4 mm:6 um:3"], "has two units"),
        (["--vary", "lenslets.focal_length=4 mm:6 mm"], "first:last:count"),
        (["--vary", "lenslets.focal_length=4 mm:6 mm:0"], "a count from 1"),
        (["--vary", "lenslets.focal_length"], "must be like"),
        (["--vary", "wavelength.a=1"], "which has no parts"),
        (["--vary", FOCAL, "--vary", FOCAL], "names a key twice"),
        (["--vary", FOCAL, "--measure", "view per axis"], "Did you mean 'views per axis'"),
        (["--vary", "a=0:1:1000", "--vary", "b=0:1:1000"], "1000000 combinations"),
        (["--vary", FOCAL, "--workers", "0"], "--workers is 0"),
        ([], "--vary"),
    ],
)
def test_what_is_wrong_is_told_before_any_work(tmp_path, capsys, words, told):
    assert main(["sweep", CAMERA, *words, "-o", str(tmp_path / "t.csv")]) in (1, 2)
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
