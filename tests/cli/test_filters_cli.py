"""`lumigraph simulate --filters`: curves of light, filters and pixels."""

import lumigraph.io as io

CURVES = """wavelength [nm], light, red, green, blue
520, 1, 0, 0.1, 1
540, 1, 0.2, 1, 0.1
560, 0.5, 1, 0, 0
"""
PICTURE = ("simulate", "camera.toml", "--point", "0 mm, 0 mm", "--accuracy", "0.01", "-o", "out.tiff")


def test_filters_are_colours_and_a_pattern(lumigraph, bench):
    (bench / "curves.csv").write_text(CURVES)
    result = lumigraph(*PICTURE, "--filters", "curves.csv")
    assert (result.code, result.err) == (0, "")
    colours = io.open(bench / "out.tiff").data
    assert colours.shape[2] == 3
    assert lumigraph(*PICTURE, "--filters", "curves.csv", "--colours", "RGGB").code == 0
    raw = io.open(bench / "out.tiff")
    assert raw.bayer == "RGGB"
    assert abs(raw.data[1::2, 1::2] - colours[1::2, 1::2, 2]).max() < 1e-5


def test_wrong_filters_are_one_line(lumigraph, bench):
    (bench / "curves.csv").write_text(CURVES)
    both = lumigraph(*PICTURE, "--filters", "curves.csv", "--wavelength", "550 nm")
    assert both.code != 0
    assert "--filters and --wavelength both give wavelengths" in both.err
    (bench / "curves.csv").write_text("wavelength, red\n450, 1\n550, 1\n")
    wrong = lumigraph(*PICTURE, "--filters", "curves.csv")
    assert wrong.code != 0
    assert "Name them 'wavelength [nm]'" in wrong.err
    assert len(wrong.err.splitlines()) == 1
