import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

import cluster_jobs as jobs
import lumigraph as lg
from lumigraph import cluster

WITH_DASK = importlib.util.find_spec("distributed") is not None
SCRIPT = """
import sys; sys.path.insert(0, {tests!r})
import cluster_jobs as jobs
from lumigraph import cluster
found = cluster.batch(
    jobs.picture, {items!r}, {output!r}, what={{"job": 1}}, workers=cluster.Dask({address!r})
)
raise SystemExit(not found.is_whole)
"""


@pytest.mark.skipif(WITH_DASK, reason="this is for those who have no dask")
def test_without_dask_the_extra_is_named(tmp_path):
    with pytest.raises(lg.LumigraphError, match=r"pip install 'lumigraph\[cluster\]'"):
        cluster.batch(
            jobs.picture, [{"seed": 0}], tmp_path / "o.zarr", workers=cluster.Dask("tcp://127.0.0.1:1")
        )


@pytest.mark.long  # a cluster is started, killed and started again: half a minute
@pytest.mark.skipif(not WITH_DASK, reason="dask's distributed is not installed (.ci/oracles.txt)")
@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")
def test_a_cluster_whose_parts_are_killed_gives_the_same_bits(tmp_path):
    tests = str(Path(jobs.__file__).parent)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, tests])}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    items = [{"seed": seed, "pause": 0.05} for seed in range(120)]
    script = tmp_path / "job.py"
    script.write_text(
        SCRIPT.format(
            tests=tests, items=items, output=str(tmp_path / "o.zarr"), address=f"tcp://127.0.0.1:{port}"
        )
    )
    running = []

    def start(*words):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
        running.append(subprocess.Popen([sys.executable, *words], env=environment, **quiet))
        return running[-1]

    def cluster_of_two():
        address = ("--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
        scheduler = start("-m", "distributed.cli.dask_scheduler", *address)
        return scheduler, [worker() for _ in range(2)]

    def worker():
        place = (f"tcp://127.0.0.1:{port}", "--nthreads", "1", "--no-nanny", "--no-dashboard")
        return start("-m", "distributed.cli.dask_worker", *place)

    def kill(process):
        process.send_signal(signal.SIGKILL)
        process.wait()

    def entries():
        return len(list(tmp_path.glob("o.zarr.ledger/done/*.json")))

    try:
        scheduler, workers = cluster_of_two()
        first = start(str(script))
        for wanted in (20, 40):
            end = time.monotonic() + 60
            while entries() < wanted and time.monotonic() < end:
                time.sleep(0.05)
            kill(workers.pop())
            workers.append(worker())
        kill(scheduler)
        for one in workers:
            kill(one)
        assert first.wait(60) != 0
        assert 40 <= entries() < 120
        cluster_of_two()
        assert start(str(script)).wait(120) == 0
    finally:
        for process in running:
            process.kill()
            process.wait()
    here = cluster.batch(jobs.picture, items, tmp_path / "p.zarr", what={"job": 1}, workers=jobs.Here())
    assert here.is_whole
    for one in sorted((tmp_path / "p.zarr").rglob("*")):
        if one.is_file():
            assert (
                tmp_path / "o.zarr" / one.relative_to(tmp_path / "p.zarr")
            ).read_bytes() == one.read_bytes()


CERTIFICATE = ["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]


@pytest.mark.skipif(not WITH_DASK, reason="dask's distributed is not installed (.ci/oracles.txt)")
@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl, which makes the certificates")
def test_a_cluster_behind_tls_works_with_its_certificates_and_refuses_who_has_none(tmp_path, monkeypatch):
    key, cert = tmp_path / "node.key", tmp_path / "node.pem"
    subprocess.run(["openssl", *CERTIFICATE, "-keyout", key, "-out", cert], check=True, capture_output=True)
    known = {"CA_FILE": cert}
    for who in ("SCHEDULER", "WORKER", "CLIENT"):
        known |= {f"{who}__CERT": cert, f"{who}__KEY": key}
    tls = {f"DASK_DISTRIBUTED__COMM__TLS__{name}": str(path) for name, path in known.items()}
    tls["DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION"] = "true"
    tests = str(Path(jobs.__file__).parent)
    environment = {**os.environ, **tls, "PYTHONPATH": os.pathsep.join([*sys.path, tests])}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address, output = f"tls://127.0.0.1:{port}", tmp_path / "o.zarr"
    script = SCRIPT.format(
        tests=tests, items=[{"seed": k} for k in range(3)], output=str(output), address=address
    )
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    host = ("--host", f"tls://127.0.0.1:{port}", "--no-dashboard")
    work = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    running = [
        subprocess.Popen([sys.executable, "-m", f"distributed.cli.dask_{what}", *given], **quiet)
        for what, given in (("scheduler", host), ("worker", work))
    ]  # fmt: skip
    try:
        assert subprocess.run([sys.executable, "-c", script], env=environment, timeout=200).returncode == 0
        assert cluster.status(output).is_whole
        bare = {name: value for name, value in environment.items() if name not in tls}
        stranger = subprocess.run(
            [sys.executable, "-c", script.replace("o.zarr", "p.zarr")],
            env=bare,
            capture_output=True,
            text=True,
            timeout=200,
        )
        assert stranger.returncode != 0
        assert "LumigraphError: no dask scheduler answers" in stranger.stderr
        assert not (tmp_path / "p.zarr").exists()
    finally:
        for process in running:
            process.kill()
            process.wait()
