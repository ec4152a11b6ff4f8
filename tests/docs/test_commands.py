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


EVERY_PAGE = ["README.md", *sorted(str(p.relative_to(pages.ROOT)) for p in pages.ROOT.glob("docs/**/*.md"))]


def parsed(command):
    """Refuse verbs and options that do not exist, and options that miss what they need."""
    from lumigraph.cli.app import app

    app.parse_args(command, print_error=False, exit_on_error=False)


@pytest.mark.parametrize("page", EVERY_PAGE)
def test_every_verb_and_option_of_a_page_exists(page):
    ours = [c.removeprefix("lumigraph ") for c in pages.commands(page) if c.startswith("lumigraph ")]
    assert page not in pages.PAGES or len(ours) > 5
    for command in ours:
        parsed(command)


@pytest.mark.parametrize("page", EVERY_PAGE)
def test_every_command_within_a_sentence_exists(page):
    """Words after a verb that are no whole command are at least a verb of lumigraph and its options."""
    from lumigraph.cli.app import app

    text = (pages.ROOT / page).read_text("utf-8")
    for words in re.findall(r"`lumigraph ([a-z][^`]*)`", text):
        verb, *rest = words.replace("...", "").split()
        assert verb in app, words
        known = {option for each in app[verb].assemble_argument_collection() for option in each.names}
        known |= {option for name in app[verb] for option in [name]}
        for option in (word.partition("=")[0] for word in rest if word.startswith("--")):
            assert option in known, words


def test_every_excuse_is_needed():
    every = [command for page in pages.PAGES for command in pages.commands(page)]
    for pattern in pages.EXCUSED:
        assert any(re.search(pattern, command) for command in every), pattern


@pytest.mark.parametrize("script", GALLERY, ids=lambda script: script.stem)
def test_a_page_of_the_gallery_has_a_picture_and_something_to_play_with(script):
    text = script.read_text("utf-8")
    assert re.search(r"^\w+ = lg\.plots\.", text, re.M)
    commands = re.findall(r"^#    lumigraph (.*)$", re.sub(r"\\\n# *", "", text), re.M)
    assert commands or "lg.view_inline(" in text
    for command in commands:
        parsed(command)


def test_the_gallery_has_25_pictures_or_more():
    assert len(GALLERY) >= 25
