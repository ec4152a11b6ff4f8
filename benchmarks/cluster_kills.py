"""A dask cluster of which parts and the whole are killed while it works, beside one undisturbed worker.

    python -m benchmarks.cluster_kills [--frames 500] [--namespaces]

Needs dask's distributed. With `--namespaces` two of the four workers have a network of their own each, joined
by a bridge: for Linux, with the right to make them (`ip netns`).
"""

import argparse
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.many_frames import contents
from benchmarks.periodic_operator import camera
from lumigraph import cluster

WORKERS, WORKERS_KILLED, SCHEDULERS_KILLED, ALL_KILLED = 4, 50, 5, 5
NETWORK = "10.213.77"
"""Of the bridge between namespaces."""


class Cluster:
    """Processes of a scheduler, its workers, and the command that uses them."""

    def __init__(self, words: list[str], host: str, prefixes: list[list[str]]) -> None:
        with socket.socket() as free:
            free.bind((host, 0))
            self.host, self.port = host, free.getsockname()[1]
        self.address, self.prefixes = f"tcp://{host}:{self.port}", prefixes
        self.words = [*words, "--scheduler", self.address]
        self.running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self) -> None:
        """Start what does not run."""
        self._start("scheduler", ["-m", "distributed.cli.dask_scheduler", "--host", self.host,
                                  "--port", str(self.port), "--no-dashboard"])  # fmt: skip
        for k, prefix in enumerate(self.prefixes):
            self._start(f"worker {k}", ["-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1",
                                        "--no-nanny", "--no-dashboard"], prefix)  # fmt: skip
        self._start("command", self.words)

    def kill(self, *names: str) -> None:
        """Kill some of them, and wait until they are gone."""
        for name in names:
            with_its_own = self.running.pop(name)
            if with_its_own.poll() is None:
                os.killpg(with_its_own.pid, signal.SIGKILL)
            with_its_own.wait()

    def _start(self, name: str, words: list[str], prefix: list[str] | None = None) -> None:
        if name not in self.running or self.running[name].poll() is not None:
            self.running[name] = subprocess.Popen(
                [*(prefix or []), sys.executable, *words], start_new_session=True,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip


def run(cluster_: Cluster, output: Path, frames: int) -> dict[str, int]:
    """Kill at random times all along until the whole is done; how often each kind was killed."""
    rng = random.Random(8)
    events = ["worker"] * WORKERS_KILLED + ["scheduler"] * SCHEDULERS_KILLED + ["all"] * ALL_KILLED
    rng.shuffle(events)
    for k, event in enumerate(events):
        while len(list(output.with_name(output.name + ".ledger").glob("done/*.json"))) < max(
            k * frames // 64, 1
        ):
            cluster_.start()
            time.sleep(0.1)
        time.sleep(rng.uniform(0, 0.5))
        cluster_.start()
        alive = list(cluster_.running)
        workers = [name for name in alive if name.startswith("worker")]
        cluster_.kill(*{"worker": [rng.choice(workers)], "scheduler": ["scheduler"], "all": alive}[event])
        print(f"{event} killed, {cluster.status(output).stand}", flush=True)
    while not (output.exists() and cluster.status(output).is_whole):
        cluster_.start()
        time.sleep(0.2)
    return {event: events.count(event) for event in ("worker", "scheduler", "all")}


@contextmanager
def networks(wanted: bool) -> Iterator[tuple[str, list[list[str]]]]:
    """Where the scheduler listens, and what each worker's command begins with."""
    if not wanted:
        yield "127.0.0.1", [[]] * WORKERS
        return
    ip = shutil.which("ip")
    if ip is None:
        raise SystemExit("--namespaces needs `ip` of iproute2. Install it.")

    def do(*words: str) -> None:
        subprocess.run([ip, *words], check=True)

    with ExitStack() as stack:
        do("link", "add", "lumigraph0", "type", "bridge")
        stack.callback(do, "link", "del", "lumigraph0")
        do("addr", "add", f"{NETWORK}.1/24", "dev", "lumigraph0")
        do("link", "set", "lumigraph0", "up")
        for k in (0, 1):
            space, inner, outer = f"lumigraph{k}", f"lgi{k}", f"lgo{k}"
            do("netns", "add", space)
            stack.callback(do, "netns", "del", space)
            do("link", "add", outer, "type", "veth", "peer", "name", inner, "netns", space)
            do("link", "set", outer, "master", "lumigraph0", "up")
            do("-n", space, "addr", "add", f"{NETWORK}.{k + 2}/24", "dev", inner)
            do("-n", space, "link", "set", inner, "up")
            do("-n", space, "link", "set", "lo", "up")
        spaces = [[ip, "netns", "exec", f"lumigraph{k}"] for k in (0, 1)]
        yield f"{NETWORK}.1", [*spaces, [], []]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--namespaces", action="store_true")
    options = parser.parse_args()
    with (
        tempfile.TemporaryDirectory(prefix="lumigraph-") as name,
        networks(options.namespaces) as (host, prefixes),
    ):
        folder = Path(name)
        (folder / "focused.toml").write_text(camera(count=(4, 4)).to_toml())
        words = ["-m", "lumigraph", "dataset", str(folder / "focused.toml"), "-n", str(options.frames)]
        words += ["--depth", "-6 mm:6 mm:6 mm", "-o"]
        disturbed = Cluster([*words, str(folder / "killed.zarr")], host, prefixes)
        try:
            killed = run(disturbed, folder / "killed.zarr", options.frames)
        finally:
            disturbed.kill(*list(disturbed.running))
        subprocess.run([sys.executable, *words, str(folder / "whole.zarr"), "--workers", "1"], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        sums = [contents(folder / one) for one in ("killed.zarr", "whole.zarr")]
        done = cluster.status(folder / "killed.zarr")
        places = len({one.where.partition(":")[2] for one in done.entries.values()})
        same = "the same bits" if sums[0] == sums[1] else "OTHER BITS"
        print(f"killed: {killed}; {done.stand} by {places} processes; {len(sums[1])} files: {same}")


if __name__ == "__main__":
    main()
