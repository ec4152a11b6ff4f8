import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import zarr

import cluster_jobs as jobs
import lumigraph as lg
from lumigraph import cluster
from lumigraph.cluster.ledger import Ledger
from lumigraph.errors import FormatError, LumigraphError
from lumigraph.io import series


def items(count, **more):
    return [{"seed": seed, **more} for seed in range(count)]


def contents(output):
    return {p.relative_to(output): p.read_bytes() for p in sorted(output.rglob("*")) if p.is_file()}


def run(output, count=6, workers=None, what=None, **more):
    return cluster.batch(
        jobs.picture, items(count, **more), output, what=what or {"job": 1}, workers=workers or jobs.Here()
    )


def test_results_are_one_store_that_others_open(tmp_path):
    found = run(tmp_path / "out.zarr")
    assert found.is_whole
    group = zarr.open_group(tmp_path / "out.zarr", mode="r")
    assert group["a"].shape == (6, 3, 40, 50)
    assert group["a"].shards == (1, 3, 40, 50)
    np.testing.assert_array_equal(group["a"][4], jobs.picture({"seed": 4})["a"])


def test_frames_that_are_not_there_read_as_nan(tmp_path):
    run(tmp_path / "out.zarr")
    (tmp_path / "out.zarr" / "a/c/2/0/0/0").unlink()
    assert np.isnan(zarr.open_group(tmp_path / "out.zarr", mode="r")["a"][2]).all()


@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")
def test_workers_that_die_are_replaced_and_bits_do_not_depend_on_them(tmp_path):
    run(tmp_path / "one.zarr", deadly=str(tmp_path / "not-here"), workers=2)
    run(tmp_path / "other.zarr")
    assert contents(tmp_path / "one.zarr") == contents(tmp_path / "other.zarr")


def together(output, workers, **of_third):
    """Nine frames by work that takes three at a time; how many there were each time."""
    groups = output.with_suffix(".groups")
    whole = items(9, groups=str(groups))
    whole[2] |= of_third
    found = cluster.batch(jobs.Together(), whole, output, workers=workers)
    return found, list(map(int, groups.read_text().split()))


@pytest.mark.parametrize("workers", [jobs.Here(), 2])
def test_work_that_takes_some_frames_at_a_time_gives_the_same(workers, tmp_path):
    found, groups = together(tmp_path / "some.zarr", workers)
    assert found.is_whole
    assert sum(groups) == 9
    assert max(groups) == 3 if workers == 2 else 6
    run(tmp_path / "one.zarr", 9)
    assert contents(tmp_path / "some.zarr") == contents(tmp_path / "one.zarr")
    times = [entry.seconds for entry in found.entries.values()]
    assert sum(times) <= found.seconds * 2  # each has its part of the time, not the time of all


@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")
@pytest.mark.parametrize("how", ["bad", "always_deadly", "deadly"])
def test_of_frames_taken_together_only_those_fail_that_fail_alone(how, tmp_path):
    place = str(tmp_path / "not-here")
    found, groups = together(tmp_path / "some.zarr", 1, **{how: place if how == "deadly" else True})
    assert list(found.failures) == ([] if how == "deadly" else [2])
    assert found.done == (9 if how == "deadly" else 8)
    if how != "bad":
        assert groups.count(1) >= 2  # after a death each alone


def test_an_error_of_work_that_takes_some_frames_at_a_time_is_that_of_all_of_them(tmp_path):
    found, _ = together(tmp_path / "some.zarr", 2, spoils=True)
    assert 2 in found.failures
    assert set(found.failures.values()) == {"ValueError: all of it is bad"}
    assert found.done == 9 - len(found.failures)


@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")
def test_a_frame_that_kills_its_workers_fails_and_the_others_are_done(tmp_path):
    whole = [*items(2), {"seed": 2, "always_deadly": True}]
    found = cluster.batch(jobs.picture, whole, tmp_path / "out.zarr", workers=1)
    assert found.done == 2
    assert found.failures[2].startswith("its worker ended by signal 9, 3 times")


def test_what_is_done_is_not_done_again(tmp_path):
    log = tmp_path / "log"
    for _ in range(3):
        run(tmp_path / "out.zarr", log=str(log))
    assert sorted(map(int, log.read_text().split())) == list(range(6))


@pytest.mark.parametrize("harm", ["shard", "cut", "entry", "torn entry"])
def test_what_was_damaged_is_done_again(tmp_path, harm):
    output, log = tmp_path / "out.zarr", tmp_path / "log"
    run(output, log=str(log))
    before = contents(output)
    shard, entry = output / "a/c/3/0/0/0", tmp_path / "out.zarr.ledger/done/000003.json"
    match harm:
        case "shard":
            content = bytearray(shard.read_bytes())
            content[100] ^= 1
            shard.write_bytes(content)
        case "cut":
            shard.write_bytes(shard.read_bytes()[:-1])
        case "entry":
            entry.unlink()
        case "torn entry":
            entry.write_bytes(entry.read_bytes()[:40])
    log.unlink()
    run(output, log=str(log))
    assert log.read_text().split() == ["3"]
    assert contents(output) == before


@pytest.mark.parametrize("of", [series, Ledger])
def test_a_full_disk_ends_the_batch_and_no_frame_is_to_blame(of, tmp_path, monkeypatch):
    name = "write" if of is series else "fail"
    write = getattr(of, name)

    def full(where, number, *rest):
        if number == 3:
            raise FormatError("it was not written") from OSError(errno.ENOSPC, "No space left on device")
        return write(where, number, *rest)

    with monkeypatch.context() as patched:
        patched.setattr(of, name, full)
        whole = items(6)
        whole[3]["bad"] = of is Ledger
        with pytest.raises(LumigraphError, match=r"the disk of .*out.zarr is full"):
            cluster.batch(jobs.picture, whole, tmp_path / "out.zarr", workers=jobs.Here())
    found = cluster.status(tmp_path / "out.zarr")
    assert not found.failures
    assert 0 < found.done < 6
    again = cluster.batch(jobs.picture, whole, tmp_path / "out.zarr", workers=jobs.Here())
    assert again.done == (6 if of is series else 5)


def test_what_differs_from_the_first_start_is_told_by_its_name(tmp_path):
    film = {"file": "raws/film.tif", "size": 20, "modified": 1_700_000_000_123_000_000, "page": 0}
    ledger, what = Ledger(tmp_path / "out.ledger"), {"options": ["--iterations", "3"]}
    ledger.open(what, [film])
    with pytest.raises(FormatError, match=r"another job: its --iterations is 3, now 4\."):
        ledger.open({"options": ["--iterations", "4"]}, [film])
    with pytest.raises(FormatError, match=r"film\.tif had 20 bytes, now 30\."):
        ledger.open(what, [film | {"size": 30, "modified": 0}])
    with pytest.raises(FormatError, match=r"film\.tif was modified at 2023-11-1\d .*\.123, now at .*\.125\."):
        ledger.open(what, [film | {"modified": 1_700_000_000_125_000_000}])


def test_a_frame_that_fails_is_left_out_and_tried_again(tmp_path):
    whole = [*items(3), {"seed": 3, "bad": True}, {"seed": 4}]
    for _ in range(2):
        found = cluster.batch(jobs.picture, whole, tmp_path / "out.zarr", workers=jobs.Here())
        assert found.failures == {3: "ValueError: this one is bad"}
        assert found.done == 4
        assert not found.is_whole


def test_frames_of_other_shapes_fail(tmp_path):
    def work(item):
        return np.zeros((item, 4), np.float32)

    found = cluster.batch(work, [5, 6, 5], tmp_path / "out.zarr", workers=jobs.Here())
    assert found.done == 2
    assert found.failures == {1: "it gives data 6 x 4 float32 where the first frame gave data 5 x 4 float32."}


def test_another_job_does_not_go_on_here(tmp_path):
    run(tmp_path / "out.zarr")
    with pytest.raises(lg.FormatError, match="its job is 1, now 2"):
        run(tmp_path / "out.zarr", what={"job": 2})
    with pytest.raises(lg.FormatError, match="it has 6 items, now 7"):
        run(tmp_path / "out.zarr", 7)
    (tmp_path / "foreign.zarr").mkdir()
    with pytest.raises(lg.LumigraphError, match="exists and has no ledger"):
        run(tmp_path / "foreign.zarr")


def test_two_starts_at_once_do_not_both_work(tmp_path):
    run(tmp_path / "out.zarr", 2)
    script = (
        "from lumigraph.cluster.ledger import Ledger; from pathlib import Path; import sys, time\n"
        f"with Ledger(Path({str(tmp_path / 'out.zarr.ledger')!r})).started(0, 2):\n"
        "    print('ready', flush=True); sys.stdin.read()"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", script], **pipes) as other:
        assert other.stdout.readline() == "ready\n"
        with pytest.raises(lg.FormatError, match="is in use by another run"):
            run(tmp_path / "out.zarr", 2)
        other.kill()
    assert run(tmp_path / "out.zarr", 2).is_whole


def test_parts_together_are_the_whole(tmp_path):
    for part in (2, 1, 3):
        found = cluster.batch(
            jobs.picture, items(7), tmp_path / "out.zarr", workers=jobs.Here(), part=(part, 3)
        )
    assert found.is_whole
    with pytest.raises(lg.LumigraphError, match="part is 4 of 3"):
        cluster.batch(jobs.picture, items(7), tmp_path / "out.zarr", part=(4, 3))


def test_a_part_does_not_fail_for_another(tmp_path):
    whole = [{"seed": 0, "bad": True}, {"seed": 1}]
    out = tmp_path / "out.zarr"
    first, second = (
        cluster.batch(jobs.picture, whole, out, workers=jobs.Here(), part=(k, 2)) for k in (1, 2)
    )
    assert list(first.failures) == [0]
    assert second.failures == {}
    assert list(cluster.status(out).failures) == [0]


def test_a_start_says_how_far_it_has_checked(tmp_path):
    run(tmp_path / "out.zarr", count=20)
    told = []
    cluster.batch(
        jobs.picture, items(20), tmp_path / "out.zarr", what={"job": 1}, workers=jobs.Here(),
        progress=told.append,
    )  # fmt: skip
    assert told == [1 / 20, 17 / 20]
    assert told[1].what == "frame 16 of 20 is whole"


def test_the_pace_is_that_of_the_last_frames_without_pauses(tmp_path):
    run(tmp_path / "out.zarr", count=8)
    for k in range(8):
        when = 1000 + 2 * k + (5000 if k > 3 else 0)  # as if somebody had stopped it for a while
        os.utime(tmp_path / f"out.zarr.ledger/done/{k:06}.json", (when, when))
    assert cluster.status(tmp_path / "out.zarr").pace == pytest.approx(0.5)


def test_tables_stay_in_the_ledger(tmp_path):
    cluster.batch(jobs.row, items(4), tmp_path / "out.csv", workers=jobs.Here())
    with cluster.rows(tmp_path / "out.csv") as rows:
        assert rows == [{"seed": k, "square": k * k} for k in range(4)]
    assert cluster.status(tmp_path / "out.csv").is_whole


def test_volumes_become_a_series_over_time(tmp_path):
    volume = lg.Volume(np.ones((2, 3, 4), np.float32), lg.Grid((3, 4), 2e-6), (-1e-6, 1e-6))
    cluster.batch(lambda _: volume, [0, 1], tmp_path / "out.ome.zarr", workers=jobs.Here())
    about = json.loads((tmp_path / "out.ome.zarr" / "zarr.json").read_text())["attributes"]["ome"]
    (image,) = about["multiscales"]
    assert [axis["name"] for axis in image["axes"]] == ["t", "z", "y", "x"]
    assert image["datasets"][0]["coordinateTransformations"][0]["scale"] == [1.0, 2.0, 2.0, 2.0]


@pytest.mark.parametrize("thing", [np.zeros((2, 2), complex), "text", {"a": np.zeros((0, 3))}, 3])
def test_what_no_series_holds_is_refused(thing):
    with pytest.raises(lg.FormatError):
        series.SeriesFrame.of(thing)


def test_a_ledger_that_is_none_is_told(tmp_path):
    with pytest.raises(lg.FormatError, match="is not the ledger of a job"):
        cluster.status(tmp_path)
    with pytest.raises(lg.FormatError, match="is not the ledger of a job"), cluster.rows(tmp_path / "o.csv"):
        pass
    (tmp_path / "job.json").write_text("[]")
    with pytest.raises(lg.FormatError, match="is damaged"):
        Ledger(tmp_path).job()


KILLED = """
import sys; sys.path.insert(0, {tests!r})
import cluster_jobs as jobs
from lumigraph import cluster
if __name__ == "__main__":
    cluster.batch(jobs.picture, {items!r}, {output!r}, what={{"job": 1}}, workers=2)
"""


@pytest.mark.long  # 20 starts, each killed after a while
@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")
def test_killed_at_any_time_it_goes_on_to_the_same_bits(tmp_path):
    output, log, rng = tmp_path / "out.zarr", tmp_path / "log", random.Random(4)
    script = tmp_path / "job.py"
    here = str(Path(jobs.__file__).parent)
    script.write_text(KILLED.format(tests=here, items=items(200, log=str(log)), output=str(output)))
    for _ in range(20):
        started = subprocess.Popen([sys.executable, str(script)], start_new_session=True)
        try:
            started.wait(rng.uniform(1.0, 3.0))
        except subprocess.TimeoutExpired:
            os.killpg(started.pid, signal.SIGKILL)
        started.wait()
    time.sleep(1.0)
    last = subprocess.run([sys.executable, str(script)], check=False)
    assert last.returncode == 0
    found = cluster.status(output)
    assert found.is_whole
    cluster.batch(
        jobs.picture, items(200, log=str(log)), tmp_path / "other.zarr", what={"job": 1}, workers=jobs.Here()
    )
    assert contents(output) == contents(tmp_path / "other.zarr")


THINGS = {
    "volume": lg.Volume(np.arange(24.0).reshape(2, 3, 4), lg.Grid((3, 4), 2e-6), (-1e-6, 1e-6)),
    "views": lg.LightField(
        np.random.default_rng(0).random((2, 3, 4, 5)), lg.Grid((2, 3), 1.0), lg.Grid((4, 5), 1.0), 1.0
    ),
    "raw": lg.RawImage(np.arange(12, dtype=np.uint16).reshape(3, 4), 2e-6, 12, metadata={"a": 1}),
    "stack": lg.Stack(np.arange(24.0).reshape(2, 3, 4), (0.9, 1.1), "alpha"),
    "map": lg.DepthMap(np.ones((3, 4)), np.full((3, 4), 0.5), "disparity", np.full((3, 4), 0.1)),
}


@pytest.mark.parametrize("name", THINGS)
def test_frames_are_read_back_as_they_were(tmp_path, name):
    thing, output = THINGS[name], tmp_path / "o.zarr"
    cluster.batch(lambda _: thing, [0, 1], output, workers=jobs.Here())
    found = lg.open(output, page=1)
    assert type(found) is type(thing)
    for field in type(thing).__slots__:
        one, other = getattr(thing, field), getattr(found, field)
        np.testing.assert_array_equal(other, one) if hasattr(one, "dtype") else None
        assert hasattr(one, "dtype") or other == one
    with pytest.raises(lg.FormatError, match="it has 2 frames"):
        lg.open(output)
    with pytest.raises(lg.FormatError, match=r"Choose 0 \.\.\. 1"):
        lg.open(output, page=2)


def test_frames_that_are_missing_or_damaged_are_refused(tmp_path):
    output = tmp_path / "o.zarr"
    cluster.batch(lambda _: THINGS["raw"], [0, 1], output, workers=jobs.Here())
    shard = output / "data/c/1/0/0"
    whole = shard.read_bytes()
    for harmed in (whole[:-1], whole[:3], b"", whole + b"\0", b"\0" * len(whole), whole * 2000):
        shard.write_bytes(harmed)
        with pytest.raises(lg.FormatError):
            lg.open(output, page=1)
    shard.unlink()
    with pytest.raises(lg.FormatError, match=r"frame 1 of .* is not there yet"):
        lg.open(output, page=1)


def test_a_frame_that_is_asked_for_twice_is_done_once(tmp_path):
    log, here = tmp_path / "log", jobs.Here()
    cluster.batch(jobs.picture, items(2, log=str(log)), tmp_path / "o.zarr", workers=here)
    assert list(here.task.do([1])) == [(1, "done")]
    assert log.read_text().split() == ["0", "1"]
    with here.task.ledger.claimed(1):
        assert list(here.task.do([1])) == [(1, "busy")]


def test_frames_that_others_keep_are_no_success(tmp_path, monkeypatch):
    from lumigraph.cluster import run as module

    monkeypatch.setattr(module, "_ROUNDS", 2)
    monkeypatch.setattr(module, "_PATIENCE", 0.0)
    run(tmp_path / "o.zarr", 3)
    (tmp_path / "o.zarr.ledger/done/000001.json").unlink()
    with (
        Ledger.beside(tmp_path / "o.zarr").claimed(1),
        pytest.raises(lg.LumigraphError, match="1 frames are"),
    ):
        run(tmp_path / "o.zarr", 3)
