"""The page that leads from the thesis to functions: each name imports, each experiment exists."""

import importlib
from pathlib import Path

import pytest

from lumigraph.studies.thesis import find

PAGE = (Path(__file__).parents[2] / "docs/reference/thesis-index.md").read_text("utf-8")
ROWS = [
    tuple(cell.strip() for cell in line.strip("|").split("|"))
    for line in PAGE.splitlines()
    if line.startswith("| ") and "`" in line
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_row_leads_to_a_function_and_an_experiment(row):
    place, function, experiment, _ = row
    parts = function.strip("`").split(".")
    thing = importlib.import_module(parts[0])
    for number, name in enumerate(parts[1:], 2):
        if not hasattr(thing, name):
            importlib.import_module(".".join(parts[:number]))
        thing = getattr(thing, name)
    assert thing.__doc__, place
    assert [one.id for one in find([experiment])] == [experiment]


def test_every_experiment_on_the_thesis_has_a_row():
    named = {row[2] for row in ROWS}
    missing = {one.id for one in find([]) if "not" not in one.thesis} - named
    assert not missing
