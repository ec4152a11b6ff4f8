"""What is measured on simulated charts, against the optics' closed forms."""

import tomllib

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.core.result import Quantity
from lumigraph.errors import GeometryError
from lumigraph.metrology.datasheet.simulated import _worst
from lumigraph.samples.files import camera_file


@pytest.mark.long  # 5 s: a camera's operator
def test_contrast_is_that_of_a_lenslet_and_the_main_lens():
    """Light spilled into neighbours takes up to 0.032; without the main lens 0.065 and 0.08 would lack."""
    text = camera_file("plenoptic").replace("[71, 71]", "[41, 41]")
    camera = lg.PlenopticCamera.from_table(tomllib.loads(text)).replace(sensor={"pixel_pitch": "8 um"})
    names = ("mtf@3/mm", "mtf@5/mm", "mtf@60/mm", "mtf50_middle", "sample_on_chart")
    found = lg.metrology.simulated(camera, names)
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
        lg.metrology.simulated(lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050"), ["mtf@3"])
    said = ["sweep", "lfm-guv", "--vary", "wavelength=500 nm,600 nm", "--measure", "mtf@10/mm"]
    assert main([*said, "-o", str(tmp_path / "t.csv")]) == 1
    assert "has no data sheet yet" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.long  # 20 s: operators at two depths
def test_pictures_at_a_depth_are_refocused_there_and_the_worst_counts():
    text = camera_file("plenoptic").replace("[71, 71]", "[41, 41]")
    camera = lg.PlenopticCamera.from_table(tomllib.loads(text)).replace(sensor={"pixel_pitch": "8 um"})
    names = ["mtf@3/mm", "sample_on_chart"]
    near, far, both = (
        lg.metrology.simulated(camera, names, depths=depths) for depths in ([0.0], [20e-3], [0.0, 20e-3])
    )
    assert 0.35 < far["mtf@3/mm"].value < near["mtf@3/mm"].value  # 0.12 where it is not refocused
    assert both["mtf@3/mm"].value == pytest.approx(far["mtf@3/mm"].value, abs=0.03)
    assert far["sample_on_chart"].value == pytest.approx(1.1 * near["sample_on_chart"].value, rel=0.01)


def test_the_worst_is_the_least_contrast_and_the_largest_distortion():
    few, many, none = (Quantity("mtf@3/mm", value) for value in (0.1, 0.4, None))
    assert _worst([many, few]) is few
    assert _worst([many, none, few]) is none
    low, high = Quantity("distortion", -3.0, "%"), Quantity("distortion", 1.0, "%")
    assert _worst([high, low]) is low


def test_a_depth_inside_the_focal_length_and_no_depths_are_refused():
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    with pytest.raises(GeometryError, match="there are no depths"):
        lg.metrology.simulated(camera, ["mtf@3/mm"], depths=[])
    with pytest.raises(GeometryError, match="inside its focal length"):
        lg.metrology.simulated(camera, ["mtf@3/mm"], depths=[-80e-3])
    goal = lg.Goal("mtf@3/mm", True, depths=(0.0, -80e-3))
    with pytest.raises(GeometryError, match="inside its focal length"):
        goal.check(camera)


def test_a_goal_of_contrast_is_over_its_depths(monkeypatch):
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    asked = []

    def simulated(camera, names, *, depths, rng):
        asked.append(depths)
        return {names[0]: Quantity(names[0], 0.25)}

    monkeypatch.setattr(lg.metrology, "simulated", simulated)
    assert lg.Goal("mtf@3/mm", True, depths=(-1e-3, 2e-3)).values(camera, 1.0) == {"mtf@3/mm": 0.25}
    assert lg.Goal("mtf@3/mm", True).values(camera, 1.0) == {"mtf@3/mm": 0.25}
    assert asked == [(-1e-3, 2e-3), (0.0,)]
