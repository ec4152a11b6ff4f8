"""`lumigraph information` prints what `lg.information.bounds` finds, and refuses nonsense in one line."""

import json

import pytest

import lumigraph as lg
from lumigraph.cli import main


def test_a_table_of_bounds_is_printed_and_a_report_written(tmp_path, capsys):
    words = [
        "information",
        "lfm-fourier",
        "--depth",
        "-10 um:10 um:10 um",
        "--photons",
        "5000",
        "--places",
        "2",
    ]
    assert main([*words, "--report", str(tmp_path / "r.html")]) == 0
    said = capsys.readouterr().out
    assert "light caught" in said
    assert "over the volume: lateral bound" in said
    assert "Least standard deviations over depth" in (tmp_path / "r.html").read_text()
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    found = lg.information.bounds(
        lg.load_camera("lfm-fourier"), [-10e-6, 0.0, 10e-6], lg.information.Light(5000), places=2
    )
    assert told["depth_bound"] == pytest.approx(found.depth, rel=1e-9)
    assert [row["depth [m]"] for row in told["depths"]] == pytest.approx([-10e-6, 0, 10e-6])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--depth", "nan um"], "'nan um' is not a quantity"),
        (["--depth", "1 um", "--photons", "-3"], "photons"),
        (["--depth", "1 um", "--background", "nan"], "background"),
        (["--depth", "1 um", "--places", "0"], "places"),
    ],
)
def test_nonsense_is_refused(capsys, words, said):
    assert main(["information", "lfm-fourier", *words]) == 1
    error = capsys.readouterr().err
    assert error.startswith("lumigraph: error: ")
    assert said in error
    assert error.count("\n") == 1
