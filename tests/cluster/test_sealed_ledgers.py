"""Ledgers whose bits flip, whose notes are of other types, and jobs whose inputs change."""

import json
import os
import zlib

import numpy as np
import pytest

import cluster_jobs as jobs
import lumigraph as lg
from lumigraph import cluster, store
from lumigraph.cluster import inputs
from lumigraph.cluster.ledger import Ledger
from lumigraph.cluster.slurm import script
from lumigraph.errors import FormatError, LumigraphError

VALUES = (None, True, -1, 1e308, 10**400, "", "x", [], {}, [[]], {"a": 1}, "../../etc/passwd", "\x1b[2J")


def table(output, **more):
    items = [{"seed": k} for k in range(4)]
    cluster.batch(jobs.row, items, output, workers=jobs.Here(), **more)
    with cluster.rows(output) as rows:
        return rows


def noted(path, value):
    """Write a note with a right checksum, as somebody could on purpose."""
    content = json.dumps(value).encode() if not isinstance(value, bytes) else value
    path.write_bytes(b'{"sealed": "%08x", "note": %b}\n' % (zlib.crc32(content), content))


@pytest.mark.parametrize("name", ["done/000002.json", "job.json"])
def test_every_flipped_bit_of_a_ledger_is_healed_or_refused(tmp_path, name):
    output = tmp_path / "t.csv"
    before, path = table(output), tmp_path / "t.csv.ledger" / name
    whole = path.read_bytes()
    for k in range(0, 8 * len(whole), 7):
        content = bytearray(whole)
        content[k // 8] ^= 1 << k % 8
        path.write_bytes(content)
        if name == "job.json":
            with pytest.raises(FormatError, match=r"job\.json is damaged"):
                table(output)
        else:
            assert 2 not in cluster.status(output).entries
    path.write_bytes(content if name != "job.json" else whole)
    if name != "job.json":
        with (
            pytest.raises(FormatError, match=r"000002\.json is damaged. Start the same again"),
            cluster.rows(output),
        ):
            pass
    assert table(output) == before


def test_an_entry_of_another_frame_does_not_count(tmp_path):
    before, done = table(tmp_path / "t.csv"), tmp_path / "t.csv.ledger" / "done"
    (done / "000001.json").write_bytes((done / "000003.json").read_bytes())
    assert table(tmp_path / "t.csv") == before


@pytest.mark.parametrize("value", VALUES, ids=repr)
@pytest.mark.parametrize("kind", ["done/000002.json", "failed/000002.json", "job.json", "store.json"])
def test_notes_of_other_types_are_refused_or_left_out(tmp_path, kind, value):
    output = tmp_path / "o.zarr"
    cluster.batch(jobs.picture, [{"seed": k} for k in range(3)], output, workers=jobs.Here())
    path = tmp_path / "o.zarr.ledger" / kind
    given = store.read_note(path) if path.exists() else {"error": "x"}
    every = [value, *({**given, name: value} for name in given), {**given, "more": value}]
    for one in every:
        noted(path, one)
        try:
            assert all(isinstance(why, str) for why in cluster.status(output).failures.values())
            cluster.batch(jobs.picture, [{"seed": k} for k in range(3)], output, workers=jobs.Here())
        except FormatError:
            assert kind in ("job.json", "store.json")
    assert np.isfinite(lg.cluster.status(output).done if kind[0] in "df" else 0)


@pytest.mark.parametrize(
    "content", [b"[" * 100_000 + b"]" * 100_000, b"\xff", b"", b"NaN", b'"' + b"9" * 5000 + b'"']
)
@pytest.mark.parametrize("kind", ["done/000002.json", "failed/000002.json", "job.json"])
def test_deep_or_broken_notes_end_in_one_line(tmp_path, kind, content):
    table(tmp_path / "t.csv")
    path = tmp_path / "t.csv.ledger" / kind
    for seal in (True, False):
        noted(path, content) if seal else path.write_bytes(content)
        try:
            cluster.status(tmp_path / "t.csv")
        except FormatError:
            assert kind == "job.json"


@pytest.mark.skipif(os.name == "nt", reason="pipes are files elsewhere")
@pytest.mark.parametrize("kind", ["done/000002.json", "job.json"])
def test_a_pipe_in_the_place_of_a_note_keeps_nobody_waiting(tmp_path, kind):
    table(tmp_path / "t.csv")
    path = tmp_path / "t.csv.ledger" / kind
    path.unlink()
    os.mkfifo(path)
    try:
        assert 2 not in cluster.status(tmp_path / "t.csv").entries
    except FormatError:
        assert kind == "job.json"


@pytest.mark.parametrize("name", ["zarr.json", "a/zarr.json"])
@pytest.mark.parametrize("harm", ["flip", "cut", "gone"])
def test_what_describes_a_store_is_put_back(tmp_path, name, harm):
    output, whole = tmp_path / "o.zarr", [{"seed": k} for k in range(3)]
    cluster.batch(jobs.picture, whole, output, workers=jobs.Here())
    path = output / name
    before = path.read_bytes()
    if harm == "flip":
        path.write_bytes(before.replace(b"3", b"7", 1))
    elif harm == "cut":
        path.write_bytes(before[:-9])
    else:
        path.unlink()
    found = cluster.batch(jobs.picture, whole, output, workers=jobs.Here())
    assert found.is_whole
    assert path.read_bytes() == before
    np.testing.assert_array_equal(
        lg.io.series.zarr.open_group(output, mode="r")["a"][1], jobs.picture({"seed": 1})["a"]
    )


def test_a_store_that_nobody_can_check_is_refused(tmp_path):
    output, whole = tmp_path / "o.zarr", [{"seed": 0}]
    cluster.batch(jobs.picture, whole, output, workers=jobs.Here())
    note = tmp_path / "o.zarr.ledger" / "store.json"
    content = bytearray(note.read_bytes())
    content[60] ^= 1
    note.write_bytes(content)
    for _ in range(2):
        with pytest.raises(FormatError, match=r"store\.json is (damaged|missing).*nobody knows whether"):
            cluster.batch(jobs.picture, whole, output, workers=jobs.Here())
        note.unlink(missing_ok=True)


def test_names_that_lead_out_of_a_store_are_not_written(tmp_path):
    output, whole = tmp_path / "o.zarr", [{"seed": 0}]
    cluster.batch(jobs.picture, whole, output, workers=jobs.Here())
    for name in ("../out.txt", str(tmp_path / "out.txt"), "a/../../out.txt", ""):
        noted(tmp_path / "o.zarr.ledger" / "store.json", {name: "mine"})
        with pytest.raises(FormatError, match="is damaged"):
            cluster.batch(jobs.picture, whole, output, workers=jobs.Here())
    assert not (tmp_path / "out.txt").exists()


def changed_content(path):
    """Other content of the same size and time."""
    about = path.stat()
    path.write_bytes(path.read_bytes()[::-1])
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))


def changed_size(path):
    path.write_bytes(path.read_bytes() + b"0")


def changed_time(path):
    os.utime(path, ns=(1, 1))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (changed_content, "has another content"),
        (changed_size, "had 3 bytes, now 4"),
        (changed_time, "was modified"),
    ],
)
@pytest.mark.parametrize("folder", [False, True])
def test_an_input_that_has_changed_is_refused_by_its_name(tmp_path, change, said, folder):
    side = tmp_path / "side"
    file = side / "white.bin" if folder else side
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(b"abc")
    table(tmp_path / "t.csv", inputs=[side])
    assert table(tmp_path / "t.csv", inputs=[side])
    change(file)
    with pytest.raises(FormatError, match=rf"another job: side {said}"):
        table(tmp_path / "t.csv", inputs=[side])


def test_an_input_that_changes_while_frames_are_made_fails_them(tmp_path):
    side = tmp_path / "white.bin"
    side.write_bytes(b"abc")

    def work(item):
        if item == 2:
            side.write_bytes(b"abcd")
        return cluster.Values({"a": item})

    found = cluster.batch(work, [0, 1, 2, 3], tmp_path / "t.csv", inputs=[side], workers=jobs.Here())
    assert sorted([*found.entries, *found.failures]) == [0, 1, 2, 3]
    assert 0 in found.entries  # made before
    assert 2 in found.failures
    assert all("white.bin has changed since the batch began" in why for why in found.failures.values())


def test_another_version_of_lumigraph_does_not_go_on(tmp_path, monkeypatch):
    table(tmp_path / "t.csv")
    monkeypatch.setattr(lg, "__version__", "999.0")
    with pytest.raises(FormatError, match=r"another job: its version is .*, now 999\.0"):
        table(tmp_path / "t.csv")


def test_files_that_a_camera_file_names_are_its_inputs(tmp_path):
    (tmp_path / "lens.json").write_text("{}")
    camera = tmp_path / "camera.toml"
    camera.write_text('kind = "x"\n[main_lens]\nprescription = "lens.json"\n[deep.deeper]\nb = [["none"]]\n')
    assert [one["file"] for one in inputs.all_known([camera])] == [str(camera), str(tmp_path / "lens.json")]
    camera.write_text("[" * 5000)
    assert len(inputs.all_known([camera])) == 1


def test_a_folder_with_a_link_to_itself_has_an_end(tmp_path):
    (tmp_path / "a").write_text("x")
    (tmp_path / "again").symlink_to(tmp_path)
    assert inputs.known(tmp_path)["size"] == 1


@pytest.mark.parametrize("control", ["\n", "\r", "\x1b", "\x00", "\x7f", "\x85", "\u2028", "\udc80"])
@pytest.mark.parametrize("where", ["output", "folder", "command", "option"])
def test_control_characters_are_no_part_of_a_script(tmp_path, control, where):
    text = {
        name: f"a{control}touch x" if name == where else "a"
        for name in ("output", "folder", "command", "option")
    }
    with pytest.raises(LumigraphError, match=r"has a control character, which no script of SLURM takes"):
        script([text["command"]], tmp_path / text["output"], 2, [text["option"]], tmp_path / text["folder"])


def test_the_ledger_reads_back_what_it_wrote(tmp_path):
    table(tmp_path / "t.csv")
    ledger = Ledger(tmp_path / "t.csv.ledger")
    assert ledger.job()["version"] == lg.__version__
    assert ledger.all_entries() == ledger.entries()
