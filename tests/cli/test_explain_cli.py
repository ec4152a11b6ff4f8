"""`lumigraph calibrate --explain`: one simulated camera with one fault each, and one without."""

import json
import math
import re

import numpy as np
import pytest

import lumigraph.io as io
from lumigraph.studies.thesis.figures.white_images import laboratory_camera, tilted_white, white

TURN, TILT, MOVE, SHIFT = 1.5, 4.0, 0.4e-3, (12e-6, -30e-6)
CAMERA = """
kind = "focused-plenoptic"
wavelength = "633 nm"
object_distance = "120 mm"
[main_lens]
focal_length = "60 mm"
diameter = "{diameter} m"
[lenslets]
pitch = "150 um"
focal_length = "5.2 mm"
count = [13, 13]
magnification = 0.5
[sensor]
pixel_pitch = "3.3333 um"
shape = [{n}, {n}]
"""


@pytest.fixture(scope="module")
def intended():
    return laboratory_camera(13)


WHITES = {
    "healthy": lambda c: white(c),
    "turned": lambda c: white(c.replace(lenslets={"rotation": math.radians(TURN)})),
    "shifted": lambda c: white(c.replace(lenslets={"offset": SHIFT})),
    "tilted": lambda c: tilted_white(c, math.radians(TILT)),
    "far": lambda c: white(c.replace(sensor_shift=MOVE)),
    "open": lambda c: white(c.replace(main_lens={"diameter": 1.15 * c.main_lens.diameter})),
    "closed": lambda c: white(c.replace(main_lens={"diameter": 0.8 * c.main_lens.diameter})),
}
FAULTS = {
    "healthy": [], "turned": ["rotation"], "shifted": ["offset"], "tilted": ["tilt"],
    "far": ["distance", "overlap"],  # farther away, the same main lens is seen wider
    "open": ["overlap"], "closed": ["gap"],
}  # fmt: skip


@pytest.mark.parametrize("name", WHITES)
def test_each_cause_is_named_with_its_size(name, lumigraph, tmp_path, intended):
    (tmp_path / "camera.toml").write_text(
        CAMERA.format(diameter=intended.main_lens.diameter, n=intended.sensor.shape[0])
    )
    io.save(WHITES[name](intended), tmp_path / "white.tiff")
    words = ("calibrate", "white.tiff", "-o", "found.toml", "--camera", "camera.toml", "--explain", "--json")
    result = lumigraph(*words)
    assert (result.code, result.err) == (0, "")
    values = json.loads(result.out)
    assert values["faults"] == FAULTS[name]
    text, pitch = "\n".join(values["advice"]), intended.micro_image_pitch
    if name == "healthy":
        assert "the camera is as it was meant" in text
        assert not re.search("turned by|shifted by|stands|tilted by|open|close", text)
    if name == "turned":
        assert numbers(text, r"turned by (\S+) deg") == pytest.approx([TURN], abs=0.01)
    if name == "shifted":  # the raw image is turned by 180 degrees, and micro-images lie a little farther out
        spread = 1 + intended.lenslet_distance / intended.separation
        right = [-value * spread * 1e6 for value in SHIFT]
        assert numbers(text, r"shifted by \((\S+), (\S+)\) µm") == pytest.approx(right, abs=0.5)
    if name == "tilted":
        assert numbers(text, r"tilted by \((\S+), (\S+)\) deg") == pytest.approx([0, TILT], abs=0.2)
    if name == "far":
        assert numbers(text, r"lenslets, (\S+) mm from where") == pytest.approx([MOVE * 1e3], abs=0.03)
    if name in ("open", "closed"):
        factor = {"open": 1.15, "closed": 0.8}[name]
        verb, word = {"open": ("close", "overlaps of"), "closed": ("open", "gaps of")}[name]
        right = np.array([factor, 1]) * intended.main_lens.diameter * 1e3
        assert numbers(text, rf"{verb} the main lens from (\S+) to (\S+) mm") == pytest.approx(
            right, rel=0.03
        )
        assert numbers(text, rf"{word} (\S+) µm") == pytest.approx([abs(factor - 1) * pitch * 1e6], rel=0.2)


def numbers(text, pattern):
    """What the groups of a pattern hold in a text."""
    found = re.search(pattern, text)
    assert found, text
    return [float(word) for word in found.groups()]


@pytest.mark.filterwarnings("always")
@pytest.mark.parametrize(
    ("f_number", "asked", "warns"),
    [
        (8, (), False),
        (32, ("--accuracy", "1e-4"), True),
        (4, (), True),
    ],
)
def test_what_parabolic_lenses_miss_is_stated_and_warned_of_where_asked_or_large(
    lumigraph, bench, f_number, asked, warns
):
    text = (bench / "camera.toml").read_text()
    (bench / "lens.toml").write_text(text.replace('"2 mm"', f'"{0.1 * f_number} mm"'))
    result = lumigraph("simulate", "lens.toml", "--scene", "white", *asked, "-o", "image.tiff")
    assert result.code == 0
    assert "by parabolic lenses, which are off by some" in result.out
    assert ("parabolic lenses put the raw image off by some" in result.err) == warns
