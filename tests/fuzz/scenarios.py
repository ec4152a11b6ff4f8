"""Long runs that are killed anywhere and started again: they must end with the bits of a run that was not.

Processes are killed after a time of the processor's, drawn at random. The first start finds an empty cache.
"""

import hashlib
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import lumigraph as lg
from lumigraph import demo, store
from lumigraph.deconvolution.checkpoint import Checkpoint
from lumigraph.store import atomic
from lumigraph.studies import thesis
from lumigraph.studies.thesis import run as reproduce

sys.path.insert(0, str(Path(__file__).parents[1]))
from fuzz.faults import forked

KEYS = 5


def deconvolution(folder: Path) -> bytes:
    """An estimate whose operator and checkpoints are written on the way."""
    camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050").replace(
        lenslets={"count": (3, 3)}
    )
    operator = camera.operator(accuracy=1e-2)
    image = np.random.default_rng(1).random(operator.shape[0]).astype(np.float32)
    found = lg.deconvolve(lg.RawImage(image), operator, 5, checkpoint=Checkpoint(folder / "run.npz", 0.0))
    return np.asarray(found.data).tobytes()


def _experiment(name: str) -> Callable[[Path], bytes]:
    def run(folder: Path) -> bytes:
        (one,) = thesis.find([name])
        found = reproduce.run([one], folder, quick=True)
        return repr([(row.quantity, row.got) for result in found for row in result.rows]).encode()

    return run


def _demo(folder: Path) -> bytes:
    demo.run(folder / "demo")
    digest = hashlib.sha256()
    for path in sorted((folder / "demo").rglob("*")):
        if path.is_file() and path.suffix != ".html":  # the page says how long it took
            digest.update(f"{path.name} ".encode() + path.read_bytes())
    return digest.digest()


RUNS: dict[str, Callable[[Path], bytes]] = {
    "deconvolution": deconvolution,
    "reproduce": _experiment("figure-1.12"),
    "demo": _demo,
}


def _started(run: Callable[[Path], bytes], folder: Path, seconds: float | None) -> int:
    """Exit code of a start in a folder, killed after a time of the processor [s] if one is given."""

    def child() -> None:
        os.environ["LUMIGRAPH_CACHE"] = str(folder / "cache")
        os.environ.pop("LUMIGRAPH_MEMORY", None)
        atomic._SWEPT.clear()
        if seconds is not None:
            signal.signal(signal.SIGPROF, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_PROF, seconds)
        digest = hashlib.sha256(run(folder)).hexdigest()
        signal.setitimer(signal.ITIMER_PROF, 0)
        (folder / "digest").write_text(digest)

    return forked(child)


def killed(run: Callable[[Path], bytes], count: int, *, seed: int = 0) -> tuple[int, list[str]]:
    """(kills, what went wrong) of a run; up to three kills one after another, then it runs to its end."""
    rng, kills, failures = random.Random(seed), 0, list[str]()
    with tempfile.TemporaryDirectory() as place:
        whole = Path(place) / "whole"
        whole.mkdir()
        start = os.times()
        assert _started(run, whole, None) == 0
        spent = sum(os.times()[2:4]) - sum(start[2:4])
        while kills < count:
            folder = Path(tempfile.mkdtemp(dir=place))
            for _ in range(rng.randint(1, 3)):
                code = _started(run, folder, max(1e-3, rng.random() * spent))
                kills += code == -signal.SIGPROF
                failures += [f"exit code {code}"] if code not in (0, -signal.SIGPROF) else []
            if _started(run, folder, None) != 0:
                failures.append("the last start failed")
            elif (folder / "digest").read_text() != (whole / "digest").read_text():
                failures.append("other bits")
            failures += [f"left {path.name}" for path in folder.rglob(f"{atomic.PREFIX}*")]
    return kills, failures


def cache(processes: int, count: int, *, seed: int = 0) -> tuple[int, list[str]]:
    """(kills, what went wrong) of processes that keep, find, damage and remove the same keys."""
    rng, failures = random.Random(seed), list[str]()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        living = [_user(folder, rng.random()) for _ in range(processes)]
        for _ in range(count):
            time.sleep(rng.random() * 0.05)
            victim = living.pop(rng.randrange(len(living)))
            os.kill(victim, signal.SIGKILL)
            failures += _ended(victim)
            living.append(_user(folder, rng.random()))
        for pid in living:
            os.kill(pid, signal.SIGKILL)
            failures += _ended(pid)

        def next_start() -> None:
            os.environ["LUMIGRAPH_CACHE"] = place
            atomic._SWEPT.clear()
            for key in range(KEYS):
                _look(key)

        failures += ["the last start failed"] if forked(next_start) != 0 else []
        expected = {f"{key}.kept.npz" for key in range(KEYS)}
        failures += [f"left {path.name}" for path in folder.iterdir() if path.name not in expected]
    return count, failures


def _look(key: int) -> None:
    found = store.kept(str(key), lambda: {"a": np.full(30_000, key), "b": np.arange(key + 9.0)})
    if not ((found["a"] == key).all() and (found["b"] == np.arange(key + 9.0)).all()):
        raise AssertionError(f"wrong numbers under {key}")


def _user(folder: Path, seed: float) -> int:
    """A process that uses the cache until it is killed."""
    time.sleep(0.05)  # threads that SciPy's FFTs begin after a fork can miss that the next fork ends them
    if pid := os.fork():
        return pid
    code = 70
    try:
        os.environ["LUMIGRAPH_CACHE"] = str(folder)
        atomic._SWEPT.clear()
        rng = random.Random(seed)
        while True:
            key = rng.randrange(KEYS)
            _look(key)
            path = folder / f"{key}.kept.npz"
            if rng.random() < 0.3:
                path.unlink(missing_ok=True)
            elif rng.random() < 0.1:
                with store.replacing(path) as temporary:
                    temporary.write_bytes(b"damaged")
    except BaseException as error:
        os.write(2, f"{type(error).__name__}: {error}\n".encode())
    finally:
        os._exit(code)


def _ended(pid: int) -> list[str]:
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return [] if code == -signal.SIGKILL else [f"a process ended with {code}"]


def main(count: int, names: list[str] | None) -> int:
    """Print what kills did to each run: shares of the count by what a start costs."""
    failed = 0
    shares = {"cache-2": 4, "cache-8": 4, "deconvolution": 10, "reproduce": 20, "demo": 100}
    for name in names or shares:
        some = max(1, count // shares[name])
        found = cache(int(name[6:]), some) if name.startswith("cache") else killed(RUNS[name], some)
        failed += len(found[1])
        print(f"{name:14} {found[0]} kills, {len(found[1])} failures {found[1][:3]}", flush=True)
    return int(failed > 0)
