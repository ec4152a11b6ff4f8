"""The pages about microscopes and their example run as a reader would run them."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg

ROOT = Path(__file__).parents[2]
PAGES = ("how-to/microscope", "explanations/derivatives", "how-to/adaptive", "how-to/wavefront-sensor")


def text(name):
    return (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.long  # 20 s of deconvolution
def test_the_page_finds_its_beads():
    names: dict = {}
    for name in PAGES:
        for code in re.findall(r"```python\n(.*?)```", text(name), re.S):
            exec(compile(code, name, "exec"), names)
    volume = names["volume"]
    for z, y, x in ((1, 10, 8), (3, 13, 16)):
        assert volume[z, y, x] == volume[z].max()
        assert volume[z, y, x] > 20 * volume[2].max()


def test_the_microscope_file_of_the_page_is_read(tmp_path):
    (whole,) = re.findall(r"```toml\n(.*?)```", text(PAGES[0]), re.S)
    (part,) = re.findall(r"```toml\n(.*?)```", text("explanations/microscope"), re.S)
    (tmp_path / "scope.toml").write_text(whole)
    assert lg.load_camera(tmp_path / "scope.toml").magnification == pytest.approx(60.0)
    regular = lg.LightFieldMicroscope.from_catalogue("lfm-fourier")
    (tmp_path / "fourier.toml").write_text(regular.to_toml() + part)
    found = lg.load_camera(tmp_path / "fourier.toml")
    assert isinstance(found, lg.LightFieldMicroscope)
    (places, focal_lengths), (moved, changed) = regular.lenslets.each(), found.lenslets.each()
    places[1, 0] -= 20e-6
    focal_lengths[1] *= 1.03
    np.testing.assert_allclose(moved, places, rtol=1e-12)
    np.testing.assert_allclose(changed, focal_lengths, rtol=1e-12)


@pytest.mark.long  # half a minute of deconvolution
def test_the_example_finds_its_vesicle(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "microscope.py"), run_name="__main__")
    assert float(capsys.readouterr().out.split()[-1]) > 0.7
    assert (tmp_path / "vesicle.png").stat().st_size > 1000
