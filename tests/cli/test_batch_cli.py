import csv
import os
import stat
from pathlib import Path

import numpy as np
import pytest
import zarr

import lumigraph as lg
from cluster_jobs import Here, picture
from lumigraph.cli import main
from lumigraph.cli.batch import _failures
from lumigraph.cli.standing import StatusPage


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """Three light fields of one size, in files."""
    folder = tmp_path_factory.mktemp("views")
    grids = lg.Grid((3, 3), 1e-3), lg.Grid((12, 14), 1e-4)
    for k in range(3):
        data = np.random.default_rng(k).random((3, 3, 12, 14), np.float32)
        lg.save(lg.LightField(data, *grids, 0.02), folder / f"v{k}.zarr")
    return folder


def words(views, output, *more):
    return ["batch", "refocus", f"{views}/v*.zarr", "--alpha", "0.95", "-o", str(output), *more]


def test_each_frame_is_what_the_verb_alone_gives(views, tmp_path, capsys):
    assert main(words(views, tmp_path / "out.zarr", "--workers", "1")) == 0
    told = capsys.readouterr()
    assert "3 of 3 frames are done" in told.out
    assert "1 frame to do: about" in told.err
    assert main(["refocus", str(views / "v1.zarr"), "--alpha", "0.95", "-o", str(tmp_path / "one.tiff")]) == 0
    group = zarr.open_group(tmp_path / "out.zarr", mode="r")
    np.testing.assert_array_equal(group["data"][1], lg.open(tmp_path / "one.tiff").data)
    assert main(["batch", "status", str(tmp_path / "out.zarr"), "--json"]) == 0
    page = lg.cluster.page(tmp_path / "out.zarr").read_text()
    assert "out.zarr: 3 of 3 frames" in page
    assert "ended" in page
    assert 'http-equiv="refresh"' not in page


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (["--camera", "none.toml"], "no camera file 'none.toml'"),
        (["--camera", "lfm-none"], "'lfm-none' is neither a camera file nor in the catalogue"),
        (["--calibration", "none.toml"], "none.toml does not exist"),
        (["--white", "none.png"], "none.png does not exist"),
        (["--white", "{here}", "--dark", "none.png"], "none.png does not exist"),
    ],
)
def test_files_that_are_not_there_are_told_before_any_worker_starts(said, why, views, tmp_path, capsys):
    said = [word.format(here=views / "v0.zarr") for word in said]
    assert main(words(views, tmp_path / "out.zarr", *said)) == 1
    assert why in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.fixture
def sbatch(tmp_path, monkeypatch):
    """A function of a shell's line: a stand-in for sbatch that does it, as no SLURM is here."""
    if os.name == "nt":
        pytest.skip("a shell script stands in for sbatch")
    stand_in = tmp_path / "bin" / "sbatch"
    stand_in.parent.mkdir()
    monkeypatch.setenv("PATH", f"{stand_in.parent}{os.pathsep}{os.environ['PATH']}")

    def written(line):
        stand_in.write_text(f"#!/bin/sh\n{line}\necho 47")
        stand_in.chmod(stand_in.stat().st_mode | stat.S_IXUSR)

    return written


QUEUED = ("--workers", "1", "--slurm", "2", "--sbatch", "--time=1:00 --mem=2G")


def test_a_queue_is_asked_for_a_part_for_each_job(sbatch, views, tmp_path, capsys):
    sbatch(f'cp "$2" "{tmp_path}/job.sh"')
    output = tmp_path / "out.zarr"
    assert main(words(views, output, *QUEUED)) == 0
    assert "job 47 of SLURM: 2 parts" in capsys.readouterr().out
    script = (tmp_path / "job.sh").read_text()
    assert "#SBATCH --array=1-2\n" in script
    assert "#SBATCH --time=1:00\n" in script
    assert "#SBATCH --mem=2G\n" in script
    (line,) = (line for line in script.splitlines() if " batch " in line)
    assert " refocus " in line
    assert " --workers 1" in line
    assert '--part "$SLURM_ARRAY_TASK_ID/2"' in line
    assert "--slurm" not in line
    assert not output.exists()


@pytest.mark.long  # starts four interpreters
def test_the_jobs_of_a_queue_do_it_together(sbatch, views, tmp_path):
    sbatch('for k in 1 2; do SLURM_ARRAY_TASK_ID=$k sh "$2" > /dev/null || exit 1; done')
    assert main(words(views, tmp_path / "out.zarr", *QUEUED)) == 0
    assert lg.cluster.status(tmp_path / "out.zarr").is_whole


def test_no_queue_is_given_an_output_of_somebody_else(sbatch, views, tmp_path, capsys):
    sbatch("")
    lg.save(lg.open(views / "v0.zarr"), tmp_path / "mine.zarr")
    assert main(words(views, tmp_path / "mine.zarr", "--slurm", "2")) == 1
    assert "mine.zarr exists and has no ledger" in capsys.readouterr().err
    assert not (tmp_path / "mine.zarr.ledger").exists()
    assert main(words(views, tmp_path / "no" / "out.zarr", "--slurm", "2")) == 1
    assert "does not exist. Make it first" in capsys.readouterr().err
    assert not (tmp_path / "no").exists()
    (tmp_path / "made.zarr.ledger").mkdir()  # as sbatch leaves it before its first job begins
    (tmp_path / "made.zarr").mkdir()
    with pytest.raises(lg.LumigraphError, match="has no ledger"):
        lg.cluster.batch(picture, [{"seed": 1}], tmp_path / "made.zarr", workers=Here())


def test_names_with_spaces_and_signs_reach_the_queue_as_they_are(tmp_path):
    text = lg.cluster.slurm.script(["lumigraph", "--part"], tmp_path / "5 % of it.zarr", 2, ["--comment=a b"])
    assert "#SBATCH '--job-name=lumigraph-5 % of it.zarr'\n" in text
    assert "/5 %% of it.zarr.ledger/job-%A-%a.log'\n" in text
    assert "#SBATCH '--comment=a b'\n" in text


def test_numbers_become_a_table(here, views, tmp_path):
    for k in range(2):
        lg.save(np.random.default_rng(k).normal(100, 5, (20, 20)).astype(np.float32), tmp_path / f"{k}.tiff")
    assert main(["batch", "measure", "noise", f"{tmp_path}/*.tiff", "-o", str(tmp_path / "out.csv")]) == 0
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [Path(row["file"]).name for row in rows] == ["0.tiff", "1.tiff"]
    assert float(rows[0]["mean"]) == pytest.approx(lg.open(tmp_path / "0.tiff").data.mean(), rel=1e-6)


def test_the_page_of_what_goes_on_is_read_again_and_says_what_failed(tmp_path):
    out = tmp_path / "out.zarr"
    lg.cluster.batch(picture, [{"seed": 1}, {"seed": 2, "bad": True}, {"seed": 3}], out, workers=Here())
    (tmp_path / "out.zarr.ledger/dashboard.txt").write_text("http://10.0.0.1:8787/status")
    told = []
    page = StatusPage(out, told.append)
    page(0.5)
    text = lg.cluster.page(out).read_text()
    assert told == [0.5]
    assert '<meta http-equiv="refresh" content="3">' in text
    assert "2 of 3, 66.7 %" in text
    assert "ValueError: this one is bad" in text
    assert "http://10.0.0.1:8787/status" in text
    lg.cluster.page(out).unlink()
    page(0.6)  # not yet time for another one
    assert not lg.cluster.page(out).exists()


def test_a_frame_that_fails_ends_it_with_an_error(here, views, tmp_path, capsys):
    (tmp_path / "a.zarr").symlink_to(views / "v0.zarr")
    (tmp_path / "b.zarr").mkdir()
    line = ["batch", "refocus", str(tmp_path / "a.zarr"), str(tmp_path / "b.zarr"), "--alpha", "1"]
    assert main([*line, "-o", str(tmp_path / "out.zarr"), "--workers", "1"]) == 1
    said = capsys.readouterr().err
    assert "1 of 2 frames failed. frame 1:" in said
    assert "without zarr.json" in said


def test_frames_that_fail_alike_are_told_of_together():
    found = lg.cluster.Report(9, {}, {4: "it is empty.", 1: "it is dark.", 2: "it is empty."})
    assert _failures(found) == "3 of 9 frames failed. frame 1: it is dark; frames 2, 4: it is empty."


def test_ctrl_c_says_what_is_done(views, tmp_path, capsys, monkeypatch):
    def interrupted(*_, **options):
        real(lambda item: np.ones((4, 5)), [0, 1, 2], tmp_path / "o.zarr", workers=Here(), part=(1, 3))
        raise KeyboardInterrupt

    real = lg.cluster.batch
    monkeypatch.setattr(lg.cluster, "batch", interrupted)
    assert main(words(views, tmp_path / "o.zarr")) == 130
    assert "interrupted; 1 of 3 frames are in" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("batch refocs v.zarr -o o.zarr", "batch takes simulate"),
        ("batch refocus --alpha 1 -o o.zarr", "no frames are given"),
        ("batch refocus nothing*.zarr --alpha 1 -o o.zarr", "no file matches it"),
        ("batch refocus {v} --alpha 1", "no output is given"),
        ("batch refocus {v} --alpha 1 -o o.csv", "Use one of .zarr"),
        ("batch refocus {v} --alpa 1 -o {o}", "--alpa"),
        ("batch refocus {v} --alpha 1 -o {o} --workers 0", "--workers is 0"),
        ("batch refocus {v} --alpha 1 -o {o} --part 3", "--part is '3'"),
        ("batch refocus {v} --alpha 1 -o {o} --part 3/2", "part is 3 of 2"),
        ("batch refocus {v} --alpha 1 -o {o} --workers 1 --scheduler tcp://a:1", "Give one of them"),
        ("batch refocus {v} --alpha 1 -o {o} --sbatch x", "--sbatch is for"),
        ("batch deconvolve {v} --warm --run 1 --camera lfm-guv -o {o}", "--run is 1 but must be at least 2"),
        ("batch status", "status takes the output"),
        ("batch status {v}", "is not the ledger"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_before_any_work(views, tmp_path, capsys, line, told):
    filled = line.format(v=views / "v0.zarr", o=tmp_path / "o.zarr")
    assert main(filled.split()) in (1, 2)
    assert told in capsys.readouterr().err
