"""Small inputs for the command line, and a way to run it in this process."""

from dataclasses import dataclass

import numpy as np
import pytest

import lumigraph.io as io
from cluster_jobs import Here
from lumigraph import cluster
from lumigraph.cli import console, main
from lumigraph.core.raw import RawImage

CAMERA = """
kind = "plenoptic"
wavelength = "550 nm"
object_distance = "200 mm"
[main_lens]
focal_length = "100 mm"
[lenslets]
pitch = "100 um"
focal_length = "2 mm"
count = [3, 3]
[sensor]
pixel_pitch = "8 um"
"""
FOCUSED = """
kind = "focused-plenoptic"
wavelength = "550 nm"
object_distance = "100 mm"
[main_lens]
focal_length = "50 mm"
[lenslets]
pitch = "100 um"
focal_length = "1.2 mm"
count = [7, 7]
magnification = 0.5
[sensor]
pixel_pitch = "5 um"
"""
PITCH = 11.5


@dataclass
class Result:
    """Exit code and both outputs of one command."""

    code: int
    out: str
    err: str


@pytest.fixture
def lumigraph(capsys, tmp_path, monkeypatch):
    """Run the command line in `tmp_path`: lumigraph("design", "camera.toml")."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(console, "FIRST_LINE", float("inf"))  # a busy machine would write progress

    def run(*arguments):
        code = main([str(argument) for argument in arguments])
        return Result(code, *capsys.readouterr())

    return run


@pytest.fixture
def bench(tmp_path):
    """A folder with camera.toml, focused.toml, white.tiff, raw.tiff; 12 x 12 micro-images of 11.5 px."""
    y, x = np.mgrid[:139, :151]
    spots = (np.cos(np.pi * (y - 69) / PITCH) * np.cos(np.pi * (x - 75) / PITCH)) ** 2
    white = np.rint(3000 * np.clip(1.6 * spots, 0, 1) + 100).astype(np.uint16)
    io.save(RawImage(white, bit_depth=12), tmp_path / "white.tiff")
    raw = np.rint(white * (0.5 + 0.4 * np.sin(x / 20)))
    io.save(RawImage(raw.astype(np.uint16), bit_depth=12), tmp_path / "raw.tiff")
    (tmp_path / "camera.toml").write_text(CAMERA)
    (tmp_path / "focused.toml").write_text(FOCUSED)
    return tmp_path


@pytest.fixture
def here(monkeypatch):
    """Batches do their frames in this process: other tests start a worker for each verb."""
    monkeypatch.setattr(cluster, "Local", lambda count: Here())
