"""What a terminal would obey instead of showing it."""

import json

import pytest

from lumigraph.core.printable import has_controls, printable, printable_json, printable_lines
from lumigraph.core.result import Quantity, Result

HOSTILE = [
    "\x1b[2J",
    "\x9b31m",
    "\r",
    "\n",
    "\x07",
    "\x7f",
    "\x00",
    "\u202e",
    "\u2066",
    "\u2028",
    "\x85",
    "\udc9b",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_control_characters_are_shown_and_not_obeyed(text):
    shown = printable(f"a{text}é")
    assert not has_controls(shown)
    assert shown.isprintable()
    assert shown.endswith("é")
    assert has_controls(text)


def test_lines_of_its_own_stay():
    assert printable_lines("a\nb\x1b") == "a\nb\\x1b"


@pytest.mark.parametrize("text", HOSTILE)
def test_json_holds_the_same_values(text):
    whole = json.dumps({text: [text]}, ensure_ascii=False)
    shown = printable_json(whole)
    assert json.loads(shown) == {text: [text]}
    assert not has_controls(shown)


def test_a_result_is_as_many_lines_as_it_has(tmp_path):
    found = Result(
        "T",
        "",
        None,
        ("a\nwritten b",),
        (Quantity("x", 1),),
        notes=("n\x1b[2J",),
        written=(tmp_path / "c\nd",),
    )
    lines = found.text().splitlines()
    assert lines[0] == "a\\nwritten b"
    assert lines[1] == "note: n\\x1b[2J"
    assert lines[2].endswith("c\\nd")
    assert len(lines) == 3
