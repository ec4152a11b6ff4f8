"""A short test of what lumigraph takes from each dependency; `.ci/lowest` runs it on the lowest versions."""

import importlib.metadata
import subprocess
import sys

import numpy as np
import pytest

import lumigraph as lg


def run(*words, where):
    done = subprocess.run(
        [sys.executable, "-m", "lumigraph", *words], cwd=where, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_lowest_versions_are_installed():
    assert importlib.metadata.version("numpy").startswith("2.0.")
    assert importlib.metadata.version("zarr") == "3.1.4"


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """A folder with a white image and a raw image of a lattice of 15 px."""
    folder = tmp_path_factory.mktemp("pictures")
    y, x = np.mgrid[:150, :180]
    light = 4000 * (np.cos(np.pi * (y - 74) / 15) * np.cos(np.pi * (x - 89) / 15)) ** 2
    lg.save(lg.RawImage(light.astype(np.uint16), bit_depth=12), folder / "white.tiff")
    lg.save(
        lg.RawImage((light * (0.6 + 0.3 * np.sin(x / 20))).astype(np.uint16), bit_depth=12),
        folder / "raw.tiff",
    )
    return folder


def test_a_camera_is_designed_with_a_report(pictures):
    run(
        "design", "thesis-plenoptic-1", "--report", "design.html", where=pictures
    )  # cyclopts, pydantic, jinja2, matplotlib
    assert (pictures / "design.html").stat().st_size > 10_000


def test_frames_are_refocused_into_a_store(pictures):
    words = ("raw.tiff", "--white", "white.tiff", "--alpha", "0.95", "--workers", "1")
    run("batch", "refocus", *words, "-o", "o.zarr", where=pictures)  # zarr, threadpoolctl
    assert np.isfinite(lg.open(pictures / "o.zarr", page=0).data).all()


def test_tables_become_parquet_and_netcdf(pictures):
    vary = "lenslets.focal_length=9 mm:11 mm:x2"
    for output in ("t.parquet", "t.nc"):  # pyarrow, xarray with h5py or SciPy
        run(
            "sweep",
            "thesis-plenoptic-1",
            "--vary",
            vary,
            "--measure",
            "views per axis",
            "-o",
            output,
            where=pictures,
        )
        assert (pictures / output).stat().st_size > 0


def test_views_are_written_as_hdf5_and_a_film(tmp_path):
    views = lg.LightField(
        np.random.default_rng(0).random((3, 3, 16, 16)), lg.Grid((3, 3), 1e-3), lg.Grid((16, 16), 1e-4), 0.01
    )
    lg.save(views, tmp_path / "v.h5")
    np.testing.assert_allclose(lg.open(tmp_path / "v.h5").data, views.data)
    views.to_xarray()


def test_the_server_answers(tmp_path):
    from uvicorn import Config

    from lumigraph.viewer import Site
    from lumigraph.viewer.connections import Connection
    from lumigraph.viewer.server import Resource, application

    app = application(Site({"": Resource("text/html", b"page")}), "token", frozenset())
    assert Config(app, http=Connection).load() is None


@pytest.mark.parametrize(
    "name",
    [
        "cv2",
        "av",
        "pyarrow",
        "skimage",
        "distributed",
        "colour_demosaicing",
        "pywt",
        "defusedxml",
        "array_api_compat",
        "lazy_loader",
        "rich",
        "hatchling.build",
        "editables",
    ],
)
def test_what_else_is_allowed_is_there(name):
    __import__(name)
