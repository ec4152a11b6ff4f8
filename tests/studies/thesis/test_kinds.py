"""What each row of the thesis' tables proves."""

from lumigraph.studies.thesis import ResultRow, find, pages, run
from lumigraph.studies.thesis.registry import Context, closed_forms


def test_a_row_without_an_expected_value_is_told():
    assert ResultRow("time", 3.0, "s").kind == "told"
    assert ResultRow("zero", 3.0, "µm", expected=3.0, tolerance=0.1).kind == "waves"


def test_formulas_are_counted_apart_from_waves():
    (one,) = find(["table-6.1"])
    result = run.StoredResult(one.id, one.run(Context()).rows, (), "", 0.0)
    # eight cells are compared with the wave behind a lenslet, the others with their own formula
    assert run.kinds([result]) == {"waves": 8, "closed form": 160, "told": 0}
    assert "8 proven by waves, 160 closed forms and 0 told" in pages.counted([result])


def test_marking_closed_forms_keeps_what_has_no_theory_told():
    marked = closed_forms([ResultRow("a", 1.0, expected=1.0), ResultRow("b", 1.0)])
    assert [row.kind for row in marked] == ["closed form", "told"]
