"""Every file that a line of `batch` reads is watched, and what it prints cannot be obeyed by a terminal."""

import typing
from dataclasses import fields, is_dataclass
from importlib import import_module
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.cli import main
from lumigraph.cli.frames import _WRITTEN, KINDS, Frames, _flat, _paths
from lumigraph.simulation import Spectrum


def path_parameters(verb):
    """Names of the verb's parameters that are paths, in groups of options too."""
    function = getattr(import_module(f"lumigraph.cli.{verb}"), verb)
    found = {}
    for name, hint in typing.get_type_hints(function).items():
        each = {field.name: field.type for field in fields(hint)} if is_dataclass(hint) else {name: hint}
        found |= {key: value for key, value in each.items() if "Path" in str(value)}
    frame = next(iter(signature(function).parameters))
    return {name for name in found if name not in (frame, "return", "pictures")}


@pytest.mark.parametrize("verb", KINDS)
def test_every_path_of_a_verb_is_written_or_watched(verb, tmp_path):
    file = tmp_path / "side"
    file.write_text("x")
    for name in path_parameters(verb) - _WRITTEN:
        assert str(file) in list(_paths(_flat({name: file})[name])), name
        assert str(file) in list(_paths([file])), name


def test_the_inputs_of_a_line_are_those_beside_the_frame(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.tiff", "w.tiff", "d.tiff", "c.toml", "camera.toml", "out.html"):
        (tmp_path / name).write_text("x")
    words = ("--white", "w.tiff", "--dark", "d.tiff", "--calibration", "c.toml", "--camera", "camera.toml",
             "--report", "out.html", "--alpha", "0.9")  # fmt: skip
    found = Frames("refocus", words, str(tmp_path)).inputs({"file": str(tmp_path / "a.tiff"), "page": None})
    assert found == ["c.toml", "camera.toml", "d.tiff", "w.tiff"]


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for k in range(2):
        lg.save(np.random.default_rng(k).integers(0, 4000, (64, 64)).astype(np.uint16), f"r{k}.tiff")
    lg.save(np.full((64, 64), 7, np.uint16), "dark.tiff")
    return tmp_path


def test_a_dark_image_that_has_changed_is_refused_by_its_name(bench, capsys):
    line = [
        "batch",
        "measure",
        "noise",
        "r0.tiff",
        "r1.tiff",
        "--dark",
        "dark.tiff",
        "-o",
        "t.csv",
        "--workers",
        "1",
    ]
    first = main(line)
    said = capsys.readouterr().err
    lg.save(np.full((64, 64), 8, np.uint16), "dark.tiff")
    assert main(line) == 1
    again = capsys.readouterr().err
    assert "belongs to another job: dark.tiff" in again, (first, said)


def test_what_a_ledger_says_is_shown_and_not_obeyed(tmp_path, capsys):
    from lumigraph import cluster, store

    output = tmp_path / "a\x1b[31mb.csv"
    cluster.batch(_failing, [0, 1], output, workers=1)
    ledger = tmp_path / f"{output.name}.ledger"
    store.write_note(ledger / "failed" / "000000.json", {"error": "\x1b[2J\x9b31m\nlumigraph: all is well"})
    for words in ([], ["--json"]):
        main(["batch", "status", str(output), *words])
        said = capsys.readouterr()
        for text in (said.out, said.err):
            assert not any(one in text for one in "\x1b\x9b\r\x07")
        assert "\nlumigraph: all is well" not in said.out


def _failing(item):
    raise ValueError("this fails")


@pytest.mark.parametrize("name", ["a\x1b[2J.tiff", "a\x9b31m.tiff", "a\u202e.tiff", "[red].tiff"])
@pytest.mark.parametrize("verb", ["decode", "measure", "refocus", "view", "calibrate", "depth"])
def test_names_are_shown_and_not_obeyed(verb, name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(b"no picture")
    words = [
        verb,
        *(["noise"] if verb == "measure" else []),
        name,
        *(["-o", "o.zarr"] if verb == "decode" else []),
    ]
    assert main(words) != 0
    said = capsys.readouterr()
    assert not any(one in said.out + said.err for one in "\x1b\x9b\u202e")


@pytest.mark.parametrize(
    "response", [[1e-300, 1e308, 1e308, 1e-300], [1e-310, 1e-300, 0, 1e-305], [1e308] * 4]
)
def test_filters_of_any_scale_are_those_of_their_shape(response):
    at, low = np.linspace(450e-9, 600e-9, 4), np.array(response)
    found = Spectrum.curves(at, response, 3e-6, light=[1e300, 1e300, 1e300, 1e300])
    np.testing.assert_array_equal(found.weights, Spectrum.curves(at, low / low.max(), 3e-6).weights)


@pytest.mark.parametrize("at", [[1e-300, 1e-200], [1.0, 1e308], [5e-10, 1.0]])
def test_wavelengths_that_no_light_has_are_refused(at):
    with pytest.raises(lg.GeometryError, match=r"must lie from 1e-10 to 0\.01 m. Check the unit"):
        Spectrum.curves(at, [1.0, 1.0], 1e-6)
