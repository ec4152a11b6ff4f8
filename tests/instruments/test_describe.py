"""The table of a camera: values, equations, warnings."""

import json

import pytest

from lumigraph.instruments import Row, catalogue, load_camera


@pytest.mark.parametrize("name", catalogue())
def test_every_row_of_every_camera_can_be_read_and_stored(name):
    described = load_camera(name).describe()
    text = str(described)
    names = [row.name for row in described.rows]
    assert len(set(names)) == len(names)
    assert all(row.text in text and row.name in text for row in described.rows)
    assert json.loads(json.dumps(described.as_dict()))["warnings"] == list(described.warnings)
    assert max(map(len, text.splitlines())) < 120


def test_the_table_of_the_focused_camera():
    table = load_camera("thesis-plenoptic-2-m050").describe().as_dict()
    expected = {
        "relay distance": 15.6e-3,
        "lenslet distance": 7.8e-3,
        "diameter": 2.3077e-3,
        "f-number": 52.0,
        "numerical aperture": 9.615e-3,
        "cut-off": 30380,
        "rendered cut-off": 15190,
        "rendered lobe": 160.6e-6,
        "views per axis": 2.0,
        "patch": 39.82,
        "micro-image pitch": 158.63e-6,
    }
    assert table["lenslets"] == (39, 39)
    assert {key: table[key] for key in expected} == pytest.approx(expected, rel=5e-4)


def test_values_come_in_units_of_their_size():
    assert Row("", 0.12, "m").text == "120 mm"
    assert Row("", 1.6667e-6, "m").text == "1.6667 µm"
    assert Row("", 30380.4, "1/m").text == "30.38 /mm"
    assert Row("", (3, 4)).text == "3 x 4"
    assert Row("", -10.5e-3, "m").text == "-10.5 mm"


def test_the_cameras_of_the_catalogue_have_no_warnings_that_matter():
    for name in catalogue():
        for warning in load_camera(name).describe().warnings:
            assert "pixels of" in warning, (name, warning)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        (
            "thesis-plenoptic-1",
            {"main_lens": {"diameter": "5 mm"}},
            "micro-images overlap: 208.3 µm wide, 156.2",
        ),
        (
            "thesis-plenoptic-1",
            {"main_lens": {"diameter": "5 mm"}},
            "Reduce the main lens' diameter from 5 to 3.75 mm",
        ),
        (
            "thesis-plenoptic-1",
            {"main_lens": {"diameter": "2 mm"}},
            "2 mm wide, less than any of matched 3.6 mm, full 3.6 mm, touching 3.75 mm",
        ),
        ("thesis-plenoptic-1", {"lenslets": {"focal_length": "100 mm"}}, "cross-talk by diffraction"),
        ("thesis-plenoptic-1", {"sensor": {"pixel_pitch": "90 um"}}, "less than two per micro-image"),
        ("thesis-plenoptic-1", {"sensor": {"pixel_pitch": "25 um"}}, "coarser than the lenslets' detail"),
        ("thesis-plenoptic-1", {"sensor": {"shape": [500, 500]}}, "micro-image centres of 10201"),
        ("thesis-plenoptic-1", {"lenslets": {"focal_length": "0.4 mm"}}, "works at f/2.67: below f/4"),
        (
            "thesis-plenoptic-1",
            {"lenslets": {"count": [301, 301], "focal_length": "2 mm"}},
            "cannot be simulated: ",
        ),
        (
            "thesis-plenoptic-1",
            {"lenslets": {"count": [801, 801]}, "sensor": {"pixel_pitch": "25 um"}},
            "wide for its distance",
        ),
        ("thesis-2f", {"sensor": {"pixel_pitch": "50 um"}}, "too coarsely: 20 µm would keep all detail"),
    ],
)
def test_suspicious_cameras_are_warned_of(name, changes, message):
    warnings = load_camera(name).replace(**changes).describe().warnings
    assert any(message in warning for warning in warnings), warnings
