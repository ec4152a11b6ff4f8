"""The examples run as a reader would run them, and write what they say."""

import runpy
import warnings
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("new_camera", ("rays.png", "raw.tiff", "picture.png")),
        ("only_waves", ("planes.png",)),
        ("pictures", ("sharp.png", "alpha.tiff", "sweep.gif", "around.gif")),
        ("kinds_of_light", ("coherent.tiff", "partially_coherent.tiff", "incoherent.tiff")),
        ("deconvolve_focused", ("deconvolved.png", "deconvolved.tiff")),
    ],
)
def test_an_example_runs(name, written, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [name])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert capsys.readouterr().out
    for file in written:
        assert (tmp_path / file).stat().st_size > 1000


def test_the_example_with_gradients_finds_what_closed_forms_confirm(capsys):
    example = runpy.run_path(str(EXAMPLES / "optimise_lenslets.py"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("torch", reason="PyTorch is not installed (make torch)")
    example["main"]()
    told = capsys.readouterr().out
    found = [float(number) for number in told.strip().splitlines()[-1].split(":")[1].split(",")]
    assert found == pytest.approx(list(example["WANTED"].values()), abs=0.005)


def test_the_example_with_a_real_camera_refocuses(tmp_path, monkeypatch):
    folder = real("letters_plenoptic1")
    paths = [str(folder / f"letters_ULF_M1{end}.png") for end in ("_white", "")]
    monkeypatch.chdir(tmp_path)
    example = runpy.run_path(str(EXAMPLES / "real_camera.py"))
    example["main"](*paths)
    sharpest = max(
        tmp_path.glob("refocused_*.png"),
        key=lambda path: np.abs(np.diff(lg.open(path).data.astype(float), axis=1)).max(),
    )
    assert 0.9 < float(sharpest.stem.split("_")[1]) < 1.1
