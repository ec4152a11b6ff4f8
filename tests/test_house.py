"""The house itself: public names, import floors, nothing of a workplace in the text."""

import ast
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import pytest

import lumigraph

ROOT = Path(__file__).parents[1]
CONTRACT = """
LumigraphError SamplingError GeometryError CalibrationError FormatError
Grid Field Lattice RawImage LightField Train Propagate ThinLens CircularAperture LensletArray Sensor
propagate SingleLensCamera PlenopticCamera FocusedPlenopticCamera targets
simulate Incoherent Coherent PartiallyCoherent Snapshots TiltedWaves open save calibrate decode devignette
sub_aperture refocus refocus_stack reduce_aperture render plots
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


def test_cameras_wait_for_no_statistics():
    """`scipy.signal` imports `scipy.stats`: a quarter of a second of each first image."""
    code = "from lumigraph.instruments import *; from lumigraph.simulation import *"
    assert not {"scipy.stats", "matplotlib"} & _modules_after(code)


@pytest.mark.parametrize(
    ("camera", "home"),
    [
        ("thesis-2f", "single_lens"),
        ("thesis-plenoptic-1", "plenoptic1"),
        ("thesis-plenoptic-2-m050", "plenoptic2"),
        ("lfm-worm", "microscope"),
    ],
)
def test_loading_a_camera_imports_its_own_kind_and_nothing_that_computes(camera, home):
    loaded = _modules_after(f"import lumigraph as lg; lg.load_camera({camera!r})")
    assert sum(name.split(".")[0] == "lumigraph" for name in loaded) <= 140
    kinds = {
        f"lumigraph.instruments.{kind}" for kind in ("single_lens", "plenoptic1", "plenoptic2", "microscope")
    }
    assert loaded & kinds == {f"lumigraph.instruments.{home}"}
    rooms = (
        "simulation|deconvolution|depth|rendering|calibration|preparation|scene|operators.(periodic|lenslets)"
    )
    assert not [name for name in loaded if re.match(rf"lumigraph\.({rooms})", name)]
    # pydantic and NumPy, but none of SciPy's libraries, each as slow as all of lumigraph
    assert not {"scipy.fft", "scipy.special", "scipy.interpolate", "scipy.sparse", "scipy.ndimage"} & loaded


@pytest.mark.parametrize("package", ["instruments", "operators", "operators.microscope"])
def test_names_that_load_late_are_never_the_modules_they_come_from(package):
    """A module of the same name would take the name's place as soon as somebody else imports it."""
    late = import_module(f"lumigraph.{package}")
    for module in iter_modules(late.__path__, f"{late.__name__}."):
        import_module(module.name)
    assert late.__all__
    assert not [name for name in late.__all__ if isinstance(getattr(late, name), ModuleType)]


def _modules_after(code: str) -> set[str]:
    """Names of all modules that a fresh interpreter has loaded after some lines."""
    run = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return set(run.stdout.split())


def test_import_floors_hold():
    linter = Path(sys.executable).with_name("lint-imports")
    out = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert out.returncode == 0, out.stdout


@pytest.mark.parametrize(
    "name",
    [
        "requirements.lock",
        "requirements-dev.lock",
        "docs/requirements.lock",
        ".ci/oracles.txt",
        ".ci/napari.txt",
    ],
)
def test_the_locks_name_no_host(name):
    lines = (ROOT / name).read_text().splitlines()
    assert not [line for line in lines if re.search(r"https?:|--(extra-)?index|--find-links", line)]
    assert sum(line.lstrip().startswith("--hash=sha256:") for line in lines) > 100


@pytest.mark.parametrize(
    ("name", "wanted"), [(".ci/oracles.txt", {"hcipy", "poppy"}), (".ci/napari.txt", {"napari", "pytest-qt"})]
)
def test_what_only_ci_installs_leaves_the_packages_of_the_lock_alone(name, wanted):
    names = [
        set(re.findall(r"(?m)^([\w.-]+)==", (ROOT / n).read_text())) for n in ("requirements-dev.lock", name)
    ]
    assert wanted <= names[1]
    assert not names[0] & names[1]


@pytest.mark.parametrize(
    ("case", "told", "code"),
    [
        (
            'classname="tests.sensor" name="test_a"><skipped message="PyTorch is not installed"/>',
            "skipped 1: PyTorch",
            0,
        ),
        (
            'classname="" name="tests.crosscheck.test_poppy"><skipped message="collection skipped"/>',
            "poppy",
            1,
        ),
        (
            'classname="tests.viewer" name="test_b"><skipped message="no Chromium here: none"/>',
            "must not be",
            1,
        ),
        ('classname="tests.core" name="test_c">', "", 0),
    ],
)
def test_ci_fails_where_crosschecks_or_the_page_were_skipped(tmp_path, case, told, code):
    report = tmp_path / "report.xml"
    report.write_text(f"<testsuites><testsuite><testcase {case}</testcase></testsuite></testsuites>")
    run = subprocess.run(
        [sys.executable, ROOT / ".ci" / "skipped.py", report], capture_output=True, text=True, check=False
    )
    assert run.returncode == code
    assert told in run.stdout + run.stderr


def test_every_module_has_a_docstring_that_opens_it():
    for path in (ROOT / "src").rglob("*.py"):
        assert path.name == "__main__.py" or ast.get_docstring(ast.parse(path.read_text("utf-8"))), path


CAMERAS = r"(?:camera|scope|instrument|microscope|described|optics|bench)"
BY_NAME = {
    "a kind's name": r"\.KIND\b|\.noun (?:==|!=|in)\b",
    "hasattr of a camera": rf"(?:hasattr|getattr)\((?:self\.)?{CAMERAS},",
    "a camera of any type": rf"\b{CAMERAS}: Any\b(?!, receive)",
    "a kind of instrument": r"isinstance\([^()]*(?:SingleLensCamera|PlenopticCamera|LightFieldMicroscope)",
}


@pytest.mark.parametrize("what", BY_NAME)
def test_instruments_are_told_apart_by_what_they_can_do(what):
    """A new kind of instrument touches `instruments` and `describe` only; see `instruments.capabilities`."""
    sources = ROOT / "src" / "lumigraph"
    told = [
        f"{path.relative_to(sources)}: {line.strip()}"
        for path in sources.rglob("*.py")
        if not {"instruments", "describe", "scanning", "demo"} & set(path.parts)
        for line in path.read_text("utf-8").splitlines()
        if re.search(BY_NAME[what], line)
    ]
    assert not told


@pytest.mark.parametrize("mended", [True, False])
def test_a_module_whose_doctests_are_collected_is_the_one_that_its_package_imports(mended, tmp_path):
    """By src/conftest.py; without it pytest executes the module again, and its classes are there twice."""
    room, tests = tmp_path / "src" / "room", tmp_path / "tests"
    room.mkdir(parents=True)
    tests.mkdir()
    (room / "__init__.py").write_text("from room.inner import Thing\n")
    (room / "inner.py").write_text('class Thing:\n    """\n    >>> 1\n    1\n    """\n')
    (tests / "test_it.py").write_text(
        "import room, room.inner\ndef test_it(): assert room.Thing is room.inner.Thing\n"
    )
    if mended:
        (tmp_path / "src" / "conftest.py").write_text((ROOT / "src" / "conftest.py").read_text("utf-8"))
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "--doctest-modules",
        "--import-mode=importlib",
        "src/room/inner.py",
        "tests",
    ]
    run = subprocess.run(
        words,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": "src"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ("2 passed" in run.stdout, "1 failed, 1 passed" in run.stdout) == (mended, not mended), run.stdout
