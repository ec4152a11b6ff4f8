"""Docstrings read as plain English: the first line names what comes back or what the thing is."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import lumigraph

ROOT = Path(lumigraph.__file__).parent

WITHOUT_SUBJECT = re.compile(
    "(Of|That|Those|By|As|At|To|From|With|In|On|For|What|Its|Their|Where|Which|How|Whether)"
    r"(?![\w-])"
)
"""First words of a line without a subject: "Of lenslets [m]." instead of "Pitch of the lenslets [m]."."""

NOT_YET: tuple[str, ...] = ()
"""Rooms whose docstrings are still to be rewritten. A room that is done leaves this list."""

MOST_LINES = 10
"""Lines of a module's docstring; derivations stand in docs/theory. An `__init__` is a map of its files."""


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Path within the package and syntax tree of each module that is done."""
    for path in sorted(ROOT.rglob("*.py")):
        name = path.relative_to(ROOT)
        if name.parts[0] not in NOT_YET:
            yield name.as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def first_lines(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line number and first line of each docstring of a module, its classes and functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield node.body[0].lineno, text.splitlines()[0]


def faults(tree: ast.AST) -> list[str]:
    return [f"{line}: {text}" for line, text in first_lines(tree) if WITHOUT_SUBJECT.match(text)]


@pytest.mark.parametrize("word", ["Of the window", "Whether it is lit.", "What a point sends", "As `modes`."])
def test_a_first_line_without_a_subject_is_found(word: str) -> None:
    tree = ast.parse(f'class Window:\n    def width(self):\n        """{word}"""\n')
    assert faults(tree) == [f"3: {word}"]


@pytest.mark.parametrize(
    "word", ["Offset of the window.", "In-place sum.", "Forward model.", "Toroidal lens."]
)
def test_a_first_line_with_a_subject_passes(word: str) -> None:
    assert not faults(ast.parse(f'"""{word}"""'))


def test_docstrings_have_a_subject_in_their_first_line() -> None:
    found = [f"{name}:{fault}" for name, tree in modules() for fault in faults(tree)]
    assert not found, "say what comes back or what the thing is:\n" + "\n".join(found)


def test_docstrings_of_modules_are_short() -> None:
    found = {
        name: len((ast.get_docstring(tree) or "").splitlines())
        for name, tree in modules()
        if not name.endswith("__init__.py")
    }
    long = {name: lines for name, lines in found.items() if lines > MOST_LINES}
    assert not long, f"move derivations to docs/theory; these have more than {MOST_LINES} lines: {long}"


def test_rooms_that_are_not_done_exist() -> None:
    assert [room for room in NOT_YET if not (ROOT / room).is_dir()] == []
