"""Tables and cameras that no program should have written: refused in one line."""

import json

import numpy as np
import pytest

import lumigraph as lg
from fuzz import seeds, texts


@pytest.fixture
def files(tmp_path):
    for tree in seeds._metric(np.random.default_rng(0)):
        for name, content in tree.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_bytes(content)
    return tmp_path


@pytest.mark.parametrize(
    ("place", "wrong", "match"),
    [
        (["camera"], [], "AttributeError|TypeError"),
        (["camera", "axis"], [1.0, 2.0, 3.0], r"axis has shape \(3,\) but must be 2 numbers"),
        (["camera", "gains"], [], r"gains has shape \(0,\) but must be 1 or 2 or 3 numbers"),
        (["noise", "own"], 5, r"own has shape \(\) but must be \(1,\)"),
        (["noise", "shared"], float("nan"), "shared is nan but must be a finite number"),
        (["poses", 0, "turn"], [0, 0, float("inf")], r"turn has shape \(3,\) but must be \(3,\), finite"),
        (["residual_px"], "0.1", "residual_px is '0.1' but must be a finite number"),
    ],
)
def test_a_measured_camera_of_the_wrong_structure_is_refused(files, place, wrong, match):
    found = json.loads((files / "measured.json").read_text())
    inside = found
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = wrong
    (files / "measured.json").write_text(json.dumps(found))
    with pytest.raises(lg.FormatError, match=match):
        lg.metrology.load(files / "measured.json")


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("frame,corner,y", "frame,corner,corner", "has the columns"),
        (",kind", ",kind,kind", "has the columns"),
        (",2\n", ",0.5\n", "column kind must hold whole numbers"),
        (",2\n", ",nan\n", "column kind must hold whole numbers"),
    ],
)
def test_a_table_of_corners_that_would_be_read_wrongly_is_refused(files, old, new, match):
    """Half a kind was kind 0, and of two columns of one name the second counted."""
    text = (files / "corners.csv").read_text().replace(old, new)
    if new == ",kind,kind":
        text = "\n".join(line + ",0" if k else line for k, line in enumerate(text.splitlines())) + "\n"
    (files / "corners.csv").write_text(text)
    with pytest.raises(lg.FormatError, match=match):
        lg.metrology.load_corners(files / "corners.csv")


@pytest.mark.parametrize("name", [path.removeprefix("compote/") for path in texts.COMPOTE])
def test_a_link_in_a_folder_of_compotes_is_not_followed(files, name):
    assert len(lg.metrology.load_compote(files / "compote")[0]) == 3
    (files / "compote" / name).rename(files / "elsewhere")
    (files / "compote" / name).symlink_to(files / "elsewhere")
    with pytest.raises(lg.FormatError, match="is a link, which is not followed"):
        lg.metrology.load_compote(files / "compote")


@pytest.mark.parametrize("wrong", ["1e308", "nan", "-1e7"])
def test_centres_beyond_every_picture_are_refused_and_nothing_is_printed(files, wrong, capfd):
    path = files / "compote" / "centers.csv"
    path.write_text(path.read_text().replace("1,0,30,10", f"1,0,{wrong},10"))
    with pytest.raises(lg.FormatError, match=r"centres beyond 1e\+06 px"):
        lg.metrology.load_compote(files / "compote")
    assert capfd.readouterr() == ("", "")
