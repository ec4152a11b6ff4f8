"""What is measured on simulated charts, against the optics' closed forms."""

import tomllib

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.errors import GeometryError
from lumigraph.samples.files import camera_file


@pytest.mark.long  # 5 s: a camera's operator
def test_contrast_is_that_of_a_lenslet_and_the_main_lens():
    """Light spilled into neighbours takes up to 0.032; without the main lens 0.065 and 0.08 would lack."""
    text = camera_file("plenoptic").replace("[71, 71]", "[41, 41]")
    camera = lg.PlenopticCamera.from_table(tomllib.loads(text)).replace(sensor={"pixel_pitch": "8 um"})
    names = ("mtf@3/mm", "mtf@5/mm", "mtf@60/mm", "mtf50_middle", "sample_on_chart")
    found = lg.metric.simulated(camera, names)
    f = np.array([3e3, 5e3])
    x = f * camera.wavelength * camera.separation / camera.pupil_diameter
    lens = 2 / np.pi * (np.arccos(x) - x * np.sqrt(1 - x**2))
    expected = np.sinc(f * 1e-4) * lens
    off = np.array([found[name].value for name in names[:2]]) - expected
    assert np.abs(off).max() < 0.04
    assert found["mtf@60/mm"].value is None  # beyond what the picture's samples hold
    assert found["mtf50_middle"].unit == "1/m"
    assert found["sample_on_chart"].value == pytest.approx(1e-4, rel=0.005)


def test_other_cameras_and_names_are_refused(tmp_path, capsys):
    with pytest.raises(GeometryError, match=r"'mtf@3' is not measured. Give mtf50_middle, .* or mtf@10/mm"):
        lg.metric.simulated(lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050"), ["mtf@3"])
    said = ["sweep", "lfm-guv", "--vary", "wavelength=500 nm,600 nm", "--measure", "mtf@10/mm"]
    assert main([*said, "-o", str(tmp_path / "t.csv")]) == 1
    assert "has no data sheet yet" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
