"""What a batch says before it starts."""

import pytest

import cluster_jobs as jobs
import lumigraph as lg
from lumigraph import cluster
from lumigraph.cluster.ledger import Entry


def frames(count):
    return [{"seed": seed} for seed in range(count)]


def test_the_estimate_is_told_and_what_cannot_fit_is_refused(tmp_path):
    told = []
    cluster.batch(
        jobs.picture,
        frames(5),
        tmp_path / "out.zarr",
        workers=jobs.Here(),
        estimated=told.append,
    )
    assert told[0].frames == 3
    entries = cluster.status(tmp_path / "out.zarr").entries
    assert told[0].size == round(
        3 * (entries[0].size + entries[3].size) / 2
    )  # the first and one of the others
    huge = cluster.Estimate.of([Entry(0, 2.0, 2**50, 2**20)], 100, 4)
    assert huge.seconds == 50
    with pytest.raises(lg.SamplingError, match=r"4 workers need .* GiB .* Use at most 1"):
        huge.require(4, tmp_path / "out.zarr")
    with pytest.raises(lg.SamplingError, match="the disk of"):
        cluster.Estimate.of([Entry(0, 2.0, 1, 2**50)], 100, 4).require(4, tmp_path / "out.zarr")


def test_more_frames_are_tried_where_they_are_short(tmp_path, monkeypatch):
    """Of 100: the first, one more by the one worker, and what it does in 5 s, at most 16; or in no time."""
    told = []
    for seconds in (5.0, 0.0):
        monkeypatch.setattr("lumigraph.cluster.run._TRIAL", seconds)
        output = tmp_path / f"{seconds}.csv"
        cluster.batch(
            jobs.row,
            frames(100),
            output,
            workers=jobs.Here(),
            estimated=told.append,
        )
    assert [needed.frames for needed in told] == [100 - 2 - 16, 100 - 2]


def test_the_estimate_counts_what_other_workers_make_first_and_shared_processors():
    """Frames of 2 s after a first one of 12 s; a second worker starts in 1 s and makes the same first."""
    first = [Entry(0, 12.0, 1, 1, busy=15.0), Entry(1, 2.0, 1, 1, busy=3.0)]
    assert cluster.Estimate.of(first, 4, 1).seconds == 8
    two = cluster.Estimate.of(first, 20, 2, starting=1.0)
    assert two.seconds == 26  # 13 frames by the one, 7 after 11 s by the other: 25 s
    assert cluster.Estimate.of(first, 100, 1000).seconds == 12  # those who start late do one each
    shared = cluster.Estimate.of(first, 20, 2, processors=2)
    assert shared.busy == 20 * 3 + 12
    assert shared.seconds == 36  # each frame alone takes one and a half processors


def test_the_estimate_knows_which_workers_are_ready_and_takes_the_mean_of_what_varies():
    """Two workers have made what they keep in 10 s; their further frames took 1 s and 3 s."""
    known = [
        Entry(0, 12.0, 1, 10, "a", busy=12.0), Entry(2, 1.0, 1, 20, "a", busy=1.0),
        Entry(5, 12.0, 1, 30, "b", busy=12.0), Entry(7, 3.0, 1, 40, "b", busy=3.0),
    ]  # fmt: skip
    needed = cluster.Estimate.of(known, 10, 2, starting=5.0)
    assert (needed.seconds, needed.busy, needed.size) == (10, 20, 250)
    third = cluster.Estimate.of(known, 10, 3, starting=5.0)
    assert (third.seconds, third.busy) == (17, 30)  # the third one begins late: 5 + 10 + 2 s


def test_an_entry_holds_the_processor_time_of_its_frame(tmp_path):
    cluster.batch(jobs.spinning, [{"busy": 0.2}], tmp_path / "out.csv", workers=jobs.Here())
    (entry,) = cluster.status(tmp_path / "out.csv").entries.values()
    assert 0.2 <= entry.busy <= entry.seconds + 0.1
