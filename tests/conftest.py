"""Array libraries for the array rule: NumPy, array-api-strict (always), PyTorch (where installed)."""

import importlib
import warnings

import numpy as np
import pytest


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
