"""The table of docs/validation/operator.md: running part of it keeps the rest."""

from benchmarks import accuracy
from benchmarks.accuracy import DEPTHS, DOCUMENT, MARKS, Cell, merged, table

OLDER = """\
| camera | path | 0.01 | 0.001 | 0.0001 |
|---|---|---|---|---|
| 2.0, m = 0.5 | slices | 0.76 / 0.68 | 0.59 / 0.54 | 0.25 / 0.20 |
| 2.0, hexagonal | colours | 0.78 | 0.54 | 1.49 |"""


def rows(*cells):
    return {cell.key: {"middle": f"{k}.50", "border": "0.10"} for k, cell in enumerate(cells)}


def test_cells_that_were_not_run_keep_what_the_table_says():
    """New rows stand where the benchmark has them, the worst of three depths in a cell."""
    points = [Cell("points", "2.0, m = 0.5", dz, 1e-2) for dz in DEPTHS]
    fresh = rows(*points, Cell("slices", "2.0, m = 0.5", 0.0, 1e-4))
    head, rule, slices, colours = OLDER.splitlines()
    slices = slices.replace("0.25 / 0.20", "3.50 / 0.10")
    lines = [head, rule, "| 2.0, m = 0.5 | points | 2.50 / 0.10 | – | – |", slices, colours]
    assert merged(table(fresh), OLDER).splitlines() == lines


def test_a_cell_that_was_run_at_some_depths_only_is_not_new():
    """The worst of two depths could be less than that of all three."""
    some = rows(*(Cell("slices", "2.0, m = 0.5", dz, 1e-3) for dz in DEPTHS[:2]))
    assert merged(table(some), OLDER) == OLDER


def test_nothing_run_leaves_the_document_as_it_is():
    there = DOCUMENT.read_text().split(MARKS[0])[1].split(MARKS[1])[0].strip()
    assert merged(table({}), there) == there
    assert len(there.splitlines()) - 2 == len({(c.camera, c.path) for c in accuracy.cells()})
