"""Commands of pages and gallery exist; `.ci/wheel` runs those of the pages, in six processor minutes."""

import importlib.util
import re
from pathlib import Path

import pytest

_SPEC = importlib.util.spec_from_file_location("commands", Path(__file__).with_name("commands.py"))
assert _SPEC is not None
assert _SPEC.loader is not None
pages = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(pages)
GALLERY = sorted((pages.ROOT / "examples/gallery").glob("plot_*.py"))


@pytest.mark.parametrize("page", pages.PAGES)
def test_every_verb_and_option_of_a_page_exists(page):
    from lumigraph.cli.app import app

    ours = [c.removeprefix("lumigraph ") for c in pages.commands(page) if c.startswith("lumigraph ")]
    assert len(ours) > 5
    for command in ours:
        app.parse_args(command, print_error=False, exit_on_error=False)


def test_every_excuse_is_needed():
    every = [command for page in pages.PAGES for command in pages.commands(page)]
    for pattern in pages.EXCUSED:
        assert any(re.search(pattern, command) for command in every), pattern


@pytest.mark.parametrize("script", GALLERY, ids=lambda script: script.stem)
def test_a_page_of_the_gallery_has_a_picture_and_something_to_play_with(script):
    from lumigraph.cli.app import app

    text = script.read_text("utf-8")
    assert re.search(r"^\w+ = lg\.plots\.", text, re.M)
    commands = re.findall(r"^#    lumigraph (.*)$", re.sub(r"\\\n# *", "", text), re.M)
    assert commands or "lg.view_inline(" in text
    for command in commands:
        app.parse_args(command, print_error=False, exit_on_error=False)


def test_the_gallery_has_25_pictures_or_more():
    assert len(GALLERY) >= 25
