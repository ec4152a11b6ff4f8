"""The house itself: public names, import floors, nothing of a workplace in the text."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import lumigraph

ROOT = Path(__file__).parents[1]
CONTRACT = """
LumigraphError SamplingError GeometryError CalibrationError FormatError
Grid Field Lattice RawImage LightField Train Propagate ThinLens CircularAperture LensletArray Sensor
propagate SingleLensCamera PlenopticCamera FocusedPlenopticCamera targets
simulate Incoherent Coherent Snapshots TiltedWaves open save calibrate decode devignette
view refocus refocus_stack reduce_aperture render plots
"""


def test_every_name_of_the_contract_is_there():
    for name in CONTRACT.split():
        assert getattr(lumigraph, name) is not None
        assert name in dir(lumigraph) or name.endswith("Error")


def test_listed_names_all_import():
    for name in lumigraph.__all__:
        assert getattr(lumigraph, name) is not None


def test_importing_lumigraph_imports_nothing_heavy():
    code = "import sys, lumigraph; print({'numpy', 'scipy', 'matplotlib', 'zarr'} & set(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "set()"


def test_import_floors_hold():
    linter = Path(sys.executable).with_name("lint-imports")
    out = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert out.returncode == 0, out.stdout


def test_the_lock_names_no_host():
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    assert not [line for line in lines if re.search(r"https?:|--(extra-)?index|--find-links", line)]
    assert sum(line.lstrip().startswith("--hash=sha256:") for line in lines) > 100


def test_every_module_has_a_docstring_that_opens_it():
    for path in (ROOT / "src").rglob("*.py"):
        name = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts).removesuffix(".__init__")
        if not name.endswith("__main__"):
            assert importlib.import_module(name).__doc__, name
