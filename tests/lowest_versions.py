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
def samples(tmp_path_factory):
    """Written by the command line: cyclopts, pydantic, SciPy, tifffile, Pillow."""
    folder = tmp_path_factory.mktemp("samples")
    run("samples", "make", "-o", "S", where=folder)
    return folder


def test_a_camera_is_designed_with_a_report(samples):
    run("design", "S/bench-camera.toml", "--report", "design.html", where=samples)  # jinja2, matplotlib
    assert (samples / "design.html").stat().st_size > 10_000


def test_frames_are_refocused_into_a_store(samples):
    words = ("S/bench-raw.tiff", "--white", "S/bench-white.tiff", "--alpha", "0.95", "--workers", "1")
    run("batch", "refocus", *words, "-o", "o.zarr", where=samples)  # zarr, threadpoolctl
    assert np.isfinite(lg.open(samples / "o.zarr", page=0).data).all()


def test_tables_become_parquet_and_netcdf(samples):
    vary = "lenslets.focal_length=3.4 mm:3.8 mm:2"
    for output in ("t.parquet", "t.nc"):  # pyarrow, xarray with h5py or SciPy
        run(
            "sweep",
            "S/bench-camera.toml",
            "--vary",
            vary,
            "--measure",
            "views per axis",
            "-o",
            output,
            where=samples,
        )
        assert (samples / output).stat().st_size > 0


def test_views_are_written_as_hdf5_and_a_film(tmp_path):
    views = lg.LightField(
        np.random.default_rng(0).random((3, 3, 16, 16)), lg.Grid((3, 3), 1e-3), lg.Grid((16, 16), 1e-4), 0.01
    )
    lg.save(views, tmp_path / "v.h5")
    np.testing.assert_allclose(lg.open(tmp_path / "v.h5").data, views.data)
    views.to_xarray()


def test_the_server_answers(tmp_path):
    from uvicorn import Config

    from lumigraph.viewer import Resource, Site
    from lumigraph.viewer.connections import Connection
    from lumigraph.viewer.server import application

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
