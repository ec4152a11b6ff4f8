"""Faults on purpose: writers killed at every system call and every byte, bits flipped in every kept file.

    python tests/fuzz/faults.py kills --count 1000 [--writers a.png a.zarr] [--lines]
    python tests/fuzz/faults.py runs --count 200 [--runs cache-8 deconvolution]
    python tests/fuzz/faults.py flips --count 2000

A writer is killed at the n-th system call that changes a disk, for n = 1, 2, ... (by strace; where there is
none, before the n-th line of lumigraph), or when its file would pass so many bytes. Then the next start must
find the old content or the new, whole, and leave nothing else. Runs are killed anywhere, and started again:
they must end with the bits of a run that was not (`scenarios`).
"""

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import lumigraph as lg
from lumigraph import cluster, io, store
from lumigraph.store import atomic
from lumigraph.studies.thesis.registry import Context

CALLS = (
    "openat,write,pwrite64,writev,ftruncate,fsync,fdatasync,rename,renameat,renameat2,link,unlink,unlinkat,"
    "mkdir,mkdirat,rmdir,chmod,fchmod,fchmodat,chown,fchown,lchown,fchownat,flock,close"
)
PACKAGE = str(Path(lg.__file__).parent)
SHAPE = (64, 48)


@dataclass(frozen=True)
class Writer:
    """How one kind of file is written with a value in it, and how the value is found again."""

    write: Callable[[Path, int], object]
    value: Callable[[Path], int]


def _only(data: Any) -> int:
    """The one value that an array holds."""
    data = np.asarray(data)
    if data.min() != data.max():
        raise AssertionError("torn: two values in one file")
    return int(data.max())


def _field(value: int) -> lg.LightField:
    data = np.full((2, 2, 16, 12), value, np.uint8)
    return lg.LightField(data, lg.Grid((2, 2), 1e-3), lg.Grid((16, 12), 1e-4), 0.01)


def _lattice(value: int) -> lg.Calibration:
    lattice, indices = lg.Lattice.square(10.0), np.array([[0, 0], [1, 1]])
    return lg.Calibration(lattice, SHAPE, indices, lattice.position(indices), float(value))


def _picture(path: Path, value: int) -> None:
    lg.save(np.full(SHAPE, value, np.uint8), path)


def _cloud(path: Path, value: int) -> None:
    lg.save(lg.PointCloud(np.full((500, 3), value, np.float32)), path)


def _views(path: Path, value: int) -> None:
    lg.save(_field(value), path)


def _without_exchange(path: Path, value: int) -> None:
    """Where the system cannot swap folders."""
    exchanged, atomic._exchanged = atomic._exchanged, lambda *_: False
    try:
        _picture(path, value)
    finally:
        atomic._exchanged = exchanged


def _open(path: Path) -> int:
    found = lg.open(path)
    return _only(found.points if isinstance(found, lg.PointCloud) else found.data)


def _kept(path: Path, value: int) -> None:
    """As the cache does, where what is there is not written again."""
    path.unlink(missing_ok=True)
    store.kept(path.name.removesuffix(".kept.npz"), lambda: {"a": np.full(9000, value)}, path.parent)


def _found(path: Path) -> int:
    missing = {"a": np.array([1])}  # what the cache does not have, it builds
    return _only(store.kept(path.name.removesuffix(".kept.npz"), lambda: missing, path.parent)["a"])


PICTURES = ("a.png", "a.tiff", "a.zarr", "a.zarr.zip", "a.h5", "a.pfm")
WRITERS = {
    **{name: Writer(_picture, _open) for name in PICTURES},
    "a.ply": Writer(_cloud, _open),
    "views": Writer(_views, _open),
    "v.h5": Writer(_views, _open),
    "c.toml": Writer(
        lambda path, value: lg.save(_lattice(value), path), lambda path: int(lg.open(path).residual_px)
    ),
    "run.npz": Writer(
        lambda path, value: store.write(path, {"a": np.full(9000, value)}),
        lambda path: _only(store.read(path)["a"]),
    ),
    "key.kept.npz": Writer(_kept, _found),
    "two-step.zarr": Writer(_without_exchange, _open),
    "page.html": Writer(
        lambda path, value: store.write_bytes(path, bytes([value]) * 70_000),
        lambda path: _only(np.frombuffer(path.read_bytes(), np.uint8)),
    ),
}


Make = Callable[[Callable[[], object]], Callable[[], None]]
"""What makes a killed function of a function."""


def forked(function: Callable[[], object]) -> int:
    """Exit code of a function in a child: 0, 70 for an exception, below 0 for a signal."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        child = os.fork()
    if child == 0:
        code = 70
        try:
            function()
            code = 0
        except BaseException as error:
            os.write(2, f"{type(error).__name__}: {error}\n".encode())
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def dying(function: Callable[[], object], line: int) -> Callable[[], None]:
    """The function, killed before the n-th line of the package that it runs."""
    left = line

    def local(frame: Any, event: str, _: object) -> Any:
        nonlocal left
        if event == "line":
            left -= 1
            if left <= 0:
                os.kill(os.getpid(), signal.SIGKILL)
        return local

    def trace(frame: Any, event: str, _: object) -> Any:
        return local if frame.f_code.co_filename.startswith(PACKAGE) else None

    def run() -> None:
        sys.settrace(trace)
        function()
        sys.settrace(None)

    return run


def traced(function: Callable[[], object], log: Path, call: str = "", which: int = 0) -> Callable[[], None]:
    """The function watched by strace, which kills it at a system call, that one of its kind."""

    def run() -> None:
        inject = ["-e", f"inject={call}:signal=SIGKILL:when={which}"] if call else []
        watched = ["strace", "-f", "-q", "-o", str(log), "-e", f"trace={CALLS},chdir", *inject]
        subprocess.Popen([*watched, "-p", str(os.getpid())], stderr=subprocess.DEVNULL)
        while not log.exists() or log.stat().st_size == 0:  # from a call that it has seen on, it sees all
            os.chdir(".")
            time.sleep(0.001)
        function()

    return run


def calls_of(name: str, old: Path) -> list[tuple[str, int]]:
    """Every system call of a writer that changes something on a disk: its name, and which of its kind."""
    seen: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as place:
        folder, log = Path(place) / "f", Path(place) / "log"
        shutil.copytree(old, folder)
        assert forked(traced(lambda: WRITERS[name].write(folder / name, 2), log)) == 0
        late = time.monotonic() + 60
        while "+++ exited" not in log.read_text():  # on a busy machine strace is late with its last lines
            assert time.monotonic() < late
            time.sleep(0.01)
        found = re.findall(r"^\d+ +(\w+)\(", log.read_text(), re.MULTILINE)
    calls = []
    for call in found:
        if call != "chdir":
            seen[call] = seen.get(call, 0) + 1
            calls.append((call, seen[call]))
    return calls


def choking(function: Callable[[], object], size: int) -> Callable[[], None]:
    """The function, killed by the system when a file would pass so many bytes."""

    def run() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        function()

    return run


def killed(name: str, make: Make, old: Path) -> str:
    """What a kill did: "" where the next start finds all in order, "done" where the writer was not killed."""
    writer = WRITERS[name]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "f"
        shutil.copytree(old, folder)
        path = folder / name
        code = forked(make(lambda: writer.write(path, 2)))

        def next_start() -> None:
            atomic._SWEPT.clear()
            if (value := writer.value(path)) not in (1, 2):
                raise AssertionError(f"{name} holds {value}")
            writer.write(path, 3)
            if writer.value(path) != 3 or [path.name for path in folder.iterdir()] != [name]:
                raise AssertionError(f"{sorted(path.name for path in folder.iterdir())} after the next start")

        if forked(next_start) != 0:
            return "not in order after a kill"
        return "" if code < 0 else "done" if code == 0 else f"exit code {code}"


def kills(name: str, most: int, *, lines: bool = False) -> tuple[int, list[str]]:
    """Kills of one writer, at most so many, a quarter in the middle of a write; and what went wrong."""
    failures, count = [], 0
    with tempfile.TemporaryDirectory() as place, tempfile.TemporaryDirectory() as logs:
        old = Path(place)
        assert forked(lambda: WRITERS[name].write(old / name, 1)) == 0
        for make in [*_chokings(old, most // 4), *_deaths(name, old, Path(logs), most, lines=lines)]:
            if count >= most:
                break
            found = killed(name, make, old)
            count += found != "done"
            failures += [f"{name}: {found}"] if found not in ("", "done") else []
    return count, failures


def _chokings(old: Path, most: int) -> list[Make]:
    size = max(path.stat().st_size for path in old.rglob("*"))
    sizes = np.unique(np.linspace(0, size, max(2, most)).astype(int))
    return [lambda work, k=k: choking(work, int(k)) for k in sizes]


def _deaths(name: str, old: Path, logs: Path, most: int, *, lines: bool) -> list[Make]:
    """Kills at every system call, or at lines; evenly spaced where there are more than asked for."""
    if lines or shutil.which("strace") is None:
        return [lambda work, n=n: dying(work, n) for n in range(1, most + 1)]
    calls = calls_of(name, old)
    places = np.unique(np.linspace(0, len(calls) - 1, most).astype(int))
    return [lambda work, k=k: traced(work, logs / str(k), *calls[k]) for k in places]


def flips(files: dict[str, dict[str, np.ndarray]], count: int, seed: int = 0) -> tuple[int, int, int]:
    """(found, wrong, not healed) of bits flipped in kept files, given by name as the arrays they hold."""
    rng, found, wrong, sick = np.random.default_rng(seed), 0, 0, 0
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, arrays in files.items():
            store.kept(name, lambda arrays=arrays: arrays, folder)
        for k in range(count):
            name = list(files)[k % len(files)]
            path = folder / f"{name}.kept.npz"
            content = bytearray(path.read_bytes())
            bit = int(rng.integers(8 * len(content)))
            content[bit // 8] ^= 1 << bit % 8
            path.unlink()  # other maps of it stay whole
            path.write_bytes(content)
            built: list[int] = []
            expected = files[name]
            got = store.kept(name, lambda expected=expected, built=built: built.append(1) or expected, folder)
            found += bool(built)
            wrong += any(got[key].tobytes() != expected[key].tobytes() for key in expected)
            again: list[int] = []
            store.kept(name, lambda expected=expected, again=again: again.append(1) or expected, folder)
            sick += bool(again)
    return found, wrong, sick


def flipped_batches(name: str, count: int, seed: int = 0) -> tuple[int, list[str]]:
    """(found, what went wrong) of bits flipped in a batch's ledger, or in what describes its store.

    The next start must end with the bits of the first one, or refuse.
    """
    rng, found, wrong = np.random.default_rng(seed), 0, list[str]()
    with tempfile.TemporaryDirectory() as place:
        output = Path(place) / "o.zarr"
        begun = [cluster.batch(_noise, [0, 1], output, workers=_HERE)]
        first = {path: path.read_bytes() for path in sorted(Path(place).rglob("*")) if path.is_file()}
        path = (output if "zarr.json" in name else output.with_name("o.zarr.ledger")) / name
        for _ in range(count):
            content = bytearray(first[path])
            bit = int(rng.integers(8 * len(content)))
            content[bit // 8] ^= 1 << bit % 8
            path.write_bytes(content)
            try:
                begun = [cluster.batch(_noise, [0, 1], output, workers=_HERE)]
                found += 1
            except lg.FormatError:
                found += 1
                path.write_bytes(first[path])
            except Exception as error:
                wrong.append(f"bit {bit}: {type(error).__name__}")
            shards = [each for each in first if output in each.parents]
            if not begun[0].is_whole or any(each.read_bytes() != first[each] for each in shards):
                wrong.append(f"bit {bit}: other bits")
    return found, wrong


def _noise(item: int) -> dict[str, np.ndarray]:
    return {"a": np.random.default_rng(item).random((8, 9))}


class _Here:
    """Works in this process."""

    is_here, count = True, 1

    @contextmanager
    def group(self, task: Any) -> Iterator["_Here"]:
        self.task = task
        yield self

    def each(self, numbers: Any) -> Any:
        yield from self.task.do(numbers)


_HERE = _Here()


def kept_files() -> dict[str, dict[str, np.ndarray]]:
    """What a camera, a microscope, a deconvolution and an experiment really keep."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        os.environ["LUMIGRAPH_CACHE"] = str(folder)
        camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
        camera.replace(lenslets={"count": (3, 3)}).operator(accuracy=1e-2)
        microscope = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(lenslets={"count": (3, 3)})
        operator = microscope.operator([-10e-6, 0.0, 10e-6], 3, folder=folder)
        image = lg.RawImage(operator.forward(np.ones(operator.shape[1], np.float32)))
        lg.deconvolve(image, operator, 2, checkpoint=folder / "run.npz")
        Context(True, folder, lambda *_: None).cached("part", lambda: {"a": np.arange(99.0)})
        return {path.name.split(".")[0]: store.read(path) for path in folder.glob("*.npz")}


def main() -> int:
    """Print what the faults did."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("kills", "runs", "flips"))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--writers", nargs="*", default=list(WRITERS))
    parser.add_argument("--lines", action="store_true", help="kill at lines though there is strace")
    parser.add_argument("--runs", nargs="*", help="only these")
    given = parser.parse_args()
    if given.what == "flips":
        files = kept_files()
        found, wrong, sick = flips(files, given.count)
        print(f"{given.count} flips in {len(files)} files: {found} found, {wrong} wrong, {sick} not healed")
        names = ("done/000001.json", "job.json", "store.json", "zarr.json", "a/zarr.json")
        batches = {name: flipped_batches(name, given.count // 20) for name in names}
        for name, (of, bad) in batches.items():
            print(f"{name:17} {of} healed or refused, {len(bad)} wrong {bad[:3]}")
        return int(wrong > 0 or sick > 0 or any(bad for _, bad in batches.values()))
    if given.what == "runs":
        import scenarios

        return scenarios.main(given.count, given.runs)
    failed = 0
    for name in given.writers:
        count, failures = kills(name, given.count // len(given.writers), lines=given.lines)
        failed += len(failures)
        print(f"{name:14} {count} kills, {len(failures)} failures {failures[:3]}", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    for row in io.FORMATS:
        row.imported()
    sys.exit(main())
