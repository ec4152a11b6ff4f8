"""Array libraries for the array rule: NumPy, array-api-strict (always), PyTorch (where installed)."""

import importlib
import os
import shutil
import tempfile
import warnings

import numpy as np
import pytest


def pytest_addoption(parser):
    parser.addoption("--device", default="cpu", help="where PyTorch's arrays stand, such as cuda")


def pytest_configure(config):
    """What operators keep on disk goes to a folder of this run, which its workers share."""
    if config.getoption("--device") != "cpu":
        importlib.import_module("torch").set_default_device(config.getoption("--device"))
    if not hasattr(config, "workerinput"):
        config.kept = tempfile.mkdtemp(prefix="lumigraph-tests-")
        os.environ["LUMIGRAPH_CACHE"] = config.kept


def pytest_unconfigure(config):
    if hasattr(config, "kept"):
        shutil.rmtree(config.kept, ignore_errors=True)


@pytest.fixture(params=["numpy", "array_api_strict", "torch"])
def xp(request):
    """One array library; PyTorch is skipped where it is not installed (`make torch` adds it)."""
    if request.param == "torch":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return pytest.importorskip("torch", reason="PyTorch is not installed (make torch)")
    return importlib.import_module(request.param)


@pytest.fixture
def rng():
    """A seeded generator: every run sees the same numbers."""
    return np.random.default_rng(20240229)
