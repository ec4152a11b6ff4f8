"""Registry, runner, report and the verb `reproduce`."""

import json
import math

import numpy as np
import pytest

from lumigraph.cli import main
from lumigraph.errors import LumigraphError
from lumigraph.studies.thesis import (
    Context,
    Experiment,
    ExperimentOutcome,
    ResultRow,
    experiment,
    experiments,
    find,
    pages,
    run,
    side_by_side,
)

KEYS = {"experiment", "quantity", "unit", "thesis", "expected", "got", "tolerance", "passed", "kind"}


def made(function, name="table-9.1"):
    return Experiment(name, "A title", "A question?", "Table 9.1", function)


def one_row(got=1.0, **more):
    return lambda context: ExperimentOutcome(
        (ResultRow("length", got, "mm", **more),), ((np.eye(3), "a figure"),), "Because."
    )


@pytest.mark.parametrize(
    ("got", "tolerance", "passed"),
    [(1.1, 0.2, True), (1.3, 0.2, False), (0.9, (0.0, 1.0), False), (5.0, (0.0, math.inf), True),
     (1.0, None, True), (math.nan, 1.0, False)],
)  # fmt: skip
def test_a_row_passes_within_its_tolerance(got, tolerance, passed):
    assert ResultRow("length", got, expected=1.0, tolerance=tolerance).passed is passed


def test_a_row_without_an_expected_value_is_only_shown():
    assert ResultRow("time", 3.0, "s").passed is None


def test_experiments_are_sorted_by_chapter_and_number():
    ids = [one.id for one in experiments()]
    assert (
        ids.index("figure-2.4") < ids.index("figure-2.11") < ids.index("table-3.1") < ids.index("figure-3.11")
    )
    assert len(set(ids)) == len(ids)


def test_every_experiment_says_what_it_asks_and_where_it_stands():
    for one in experiments():
        assert one.question.endswith("?"), one.id
        assert one.title, one.id
        assert one.thesis, one.id


def test_every_experiment_says_in_one_sentence_what_the_thesis_shows():
    for one in experiments():
        assert one.shows.endswith("."), one.id
        assert ". " not in one.shows, one.id
        assert 40 < len(one.shows) < 180, one.id


def test_an_id_is_found_by_its_ending_but_not_within_a_number():
    assert [one.id for one in find(["3.12"])] == ["figure-3.12"]
    assert [one.id for one in find(["3.2"])] == ["figure-3.2", "table-3.2"]
    assert [one.id for one in find(["table-3.1", "2.34"])] == ["2.34", "table-3.1"]
    assert find([]) == experiments()
    with pytest.raises(LumigraphError, match="no experiment '34'"):
        find(["34"])  # not 2.34


def test_an_unknown_id_names_near_ones():
    with pytest.raises(LumigraphError, match=r"no experiment 'table-3\.9'\. Near ones: .*table-3\."):
        find(["table-3.9"])


def test_two_modules_cannot_share_an_id():
    with pytest.raises(
        LumigraphError, match=r"'table-3\.1' is defined in .*table_3_1 and in .*test_registry"
    ):
        experiment("table-3.1", "x", question="x?", thesis="x")(lambda context: ExperimentOutcome(()))


@pytest.mark.parametrize("value", [np.arange(3.0), {"a": np.float64(0.1), "b": np.arange(2)}])
def test_a_part_is_computed_once_and_reads_back_the_same(tmp_path, value):
    calls = []

    def compute():
        calls.append(1)
        return value

    first, second = (Context(folder=tmp_path / "parts").cached("part-1", compute) for _ in range(2))
    assert len(calls) == 1
    for key in value if isinstance(value, dict) else [...]:
        assert np.array_equal(first[key], second[key])
    assert type(first) is type(second)


def test_without_a_folder_nothing_is_kept():
    assert Context().cached("part", lambda: np.ones(2)).tolist() == [1.0, 1.0]


def test_a_part_needs_a_file_name(tmp_path):
    with pytest.raises(LumigraphError, match=r"name of a part is '\.\./x' but must consist of"):
        Context(folder=tmp_path).cached("../x", lambda: np.ones(2))


def test_progress_reaches_who_asked_and_stays_within_the_whole():
    seen = []
    Context(tell=seen.append).progress(1.5, "almost")
    Context().progress(0.5)
    assert [(float(told), told.what) for told in seen] == [(1.0, "almost")]


def test_killed_twice_and_resumed_gives_the_same_numbers(tmp_path):
    done, stop_at = [], [1, 3]

    def function(context):
        numbers = []
        for part in range(5):
            if stop_at and part == stop_at[0]:
                stop_at.pop(0)
                raise KeyboardInterrupt
            numbers.append(context.cached(f"part-{part}", lambda part=part: computed(part)))
        return ExperimentOutcome((ResultRow("sum", float(np.sum(numbers))),))

    def computed(part):
        done.append(part)
        return np.random.default_rng(part).random(4)

    chosen = [made(function)]
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            run.run(chosen, tmp_path)
    (resumed,) = run.run(chosen, tmp_path)
    assert done == [0, 1, 2, 3, 4]
    (fresh,) = run.run(chosen, tmp_path / "other")
    assert resumed.rows == fresh.rows
    (again,) = run.run(chosen, tmp_path)
    assert again.stored
    assert (again.rows, again.pictures, again.why) == (resumed.rows, resumed.pictures, resumed.why)
    assert len(done) == 10


def test_quick_and_full_are_kept_apart_and_fresh_forgets(tmp_path):
    function = one_row()
    assert not run.run([made(function)], tmp_path, quick=True)[0].stored
    assert not run.run([made(function)], tmp_path)[0].stored
    assert run.run([made(function)], tmp_path)[0].stored
    assert not run.run([made(function)], tmp_path, fresh=True)[0].stored


def test_results_belong_to_the_sources_they_came_from(tmp_path, monkeypatch):
    run.run([made(one_row())], tmp_path)
    monkeypatch.setattr(run, "_files", lambda: (("lumigraph.changed", b"other"),))
    assert not run.run([made(one_row())], tmp_path)[0].stored


def test_a_stored_row_keeps_every_digit_and_an_infinite_tolerance(tmp_path):
    row = ResultRow("x", 0.1 + 0.2, "mm", thesis="limit", expected=1 / 3, tolerance=(np.float64(0.1), np.inf))
    for _ in range(2):
        (result,) = run.run([made(lambda context: ExperimentOutcome((row,)))], tmp_path)
    assert result.stored
    assert result.rows == (row,)


def test_an_experiment_that_breaks_fails_and_lets_the_others_run(tmp_path):
    def broken(context):
        raise ValueError("no light")

    chosen = [made(broken), made(one_row(), "table-9.2")]
    first, second = run.run(chosen, tmp_path)
    assert [row.note for row in first.failed] == ["ValueError: no light"]
    assert "Traceback" in first.error
    assert not second.failed
    assert not run.run(chosen, tmp_path)[0].stored


def test_records_have_exactly_the_agreed_keys_and_are_plain_json(tmp_path):
    rows = (
        ResultRow("a", np.nan, expected=1.0, tolerance=(0.5, math.inf)),
        ResultRow("b", np.float32(2), thesis="limit"),
    )
    results = run.run([made(lambda context: ExperimentOutcome(rows))], tmp_path)
    first, second = run.records(results)
    assert set(first) == KEYS
    assert (first["got"], first["tolerance"], first["passed"]) == (None, [0.5, None], False)
    assert (second["got"], second["thesis"], second["passed"]) == (2.0, "limit", None)
    json.dumps([first, second], allow_nan=False)


def test_the_report_shows_question_set_up_table_figure_and_why(tmp_path):
    function = one_row(2.0, thesis=5.0, expected=1.0, tolerance=0.5, note="too long")
    chosen = [
        Experiment(
            "table-9.1", "A title", "A question?", "Table 9.1", function, "thesis-2f", "A curve falls."
        )
    ]
    pages.write_report(chosen, run.run(chosen, tmp_path), tmp_path / "report.html", quick=True)
    text = (tmp_path / "report.html").read_text()
    for part in ("A question?", "camera thesis-2f", "a figure", "FAILS", "too long", "Because.", "1 fail",
                 "Reduced sizes"):  # fmt: skip
        assert part in text
    beside = text[text.index('<div class="beside">') :]
    assert beside.index("a figure") < beside.index("In the thesis (Table 9.1): A curve falls.")
    assert text.count("In the thesis") == 1
    assert "http" not in text.replace("http-equiv", "")


def test_reproduce_lists_and_runs_one_experiment(tmp_path, capsys):
    assert main(["reproduce", "--list"]) == 0
    assert "figure-3.12" in capsys.readouterr().out
    assert main(["reproduce", "3.12", "--quick", "--json", "-o", str(tmp_path / "out")]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {row["experiment"] for row in rows} == {"figure-3.12"}
    assert all(set(row) == KEYS and row["passed"] for row in rows)
    assert (tmp_path / "out" / "report.html").exists()
    assert json.loads((tmp_path / "out" / "results.json").read_text()) == rows


def test_reproduce_lists_as_json(capsys):
    assert main(["reproduce", "3.12", "--list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["id"] == "figure-3.12"


def test_reproduce_ends_with_1_when_a_row_fails(tmp_path, capsys, monkeypatch):
    from lumigraph.studies.thesis.figures import figure_3_12

    monkeypatch.setattr(figure_3_12, "coherence_time", lambda frequency, spectrum: 6.6e-17)
    assert main(["reproduce", "3.12", "--quick", "-o", str(tmp_path)]) == 1
    shown = capsys.readouterr()
    assert "FAILS" in shown.out
    assert "3 rows out of tolerance in figure-3.12. See" in shown.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["9.99"], "no experiment '9.99'. Near ones"), (["3.12", "-o", "{file}"], "is a file. Give a folder"),
     (["3.12", "-o", "{file}/x/y"], "is a file, not a folder for y")],
)  # fmt: skip
def test_reproduce_refuses_in_one_line(tmp_path, capsys, arguments, message):
    file = tmp_path / "file"
    file.write_text("x")
    assert main(["reproduce", *(text.format(file=file) for text in arguments)]) == 1
    assert message in capsys.readouterr().err


def test_experiments_run_without_the_extras(monkeypatch):
    def version(name):
        raise run.PackageNotFoundError(name)

    monkeypatch.setattr(run, "version", version)
    assert run._files.__wrapped__()[-1] == ("", b"numpy  scipy  scikit-image ")


def test_the_bar_of_some_experiments_goes_from_one_to_the_next_and_never_back(tmp_path):
    def halves(context):
        context.progress(0.5, "half")
        context.progress(1.0)
        return ExperimentOutcome((ResultRow("x", 1.0),))

    seen = []
    chosen = [made(halves, f"table-9.{number}") for number in (1, 2, 3)]
    run.run(chosen, tmp_path, progress=seen.append)
    assert [float(told) for told in seen] == pytest.approx(np.array([0, 1, 2, 2, 3, 4, 4, 5, 6]) / 6)
    assert seen[4].what == "table-9.2: half"


def test_two_processes_give_what_one_gives_in_the_order_asked(tmp_path):
    chosen = find(["2.34", "figure-5.7", "table-5.2"])
    assert side_by_side.groups(chosen) == [("table-5.2", "figure-5.7"), ("2.34",)]
    told = []
    *_, both = side_by_side.run_side_by_side(chosen, tmp_path, 2, quick=True, finished=told.append)
    assert [one.id for one in both] == [one.id for one in chosen]
    assert sorted(one.id for one in told) == sorted(one.id for one in chosen)
    alone = run.run(chosen, tmp_path / "alone", quick=True)
    assert [one.rows for one in both] == [one.rows for one in alone]
