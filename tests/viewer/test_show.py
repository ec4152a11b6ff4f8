"""`lg.show` opens the viewer for things in memory, files and cameras."""

import importlib

import numpy as np
import pytest

import lumigraph as lg

ADDRESS = "http://127.0.0.1:1234/token/"


@pytest.fixture
def opened(monkeypatch):
    """Sites that would be served, and addresses that a browser would open."""
    module, found = importlib.import_module("lumigraph.viewer.show"), {"sites": [], "addresses": []}

    def serve(site, *, port, ready):
        found["sites"].append((site, port))
        ready(ADDRESS)

    monkeypatch.setattr(module, "serve", serve)
    monkeypatch.setattr(module, "open_in_browser", found["addresses"].append)
    return found


def test_a_picture_and_a_file_are_shown(opened, tmp_path, capsys):
    raw = lg.RawImage(np.ones((8, 9), np.uint8))
    lg.save(raw, tmp_path / "raw.png")
    lg.show(raw)
    lg.show(tmp_path / "raw.png", port=8000, open_browser=False)
    assert [port for _, port in opened["sites"]] == [0, 8000]
    assert all("data/about" in site.resources for site, _ in opened["sites"])
    assert opened["addresses"] == [ADDRESS]
    assert capsys.readouterr().out == f"{ADDRESS}\n{ADDRESS}\n"


def test_what_has_no_picture_is_refused(opened, tmp_path):
    with pytest.raises(lg.FormatError, match="a int has no page"):
        lg.show(3)
    calibration = lg.load_camera("thesis-plenoptic-1").calibration
    with pytest.raises(lg.FormatError, match="Open the file first"):
        lg.show("raw.png", calibration)
    assert opened["sites"] == []
