"""Damaged files by the thousand: every reader must answer with a thing or with a LumigraphError.

    python tests/fuzz/run.py --count 20000 [--readers tiff png] [--seed 0] [--keep folder]

Mutants are read in forked children that may take 1 GiB of memory in all and 20 s for each; a child that dies,
hangs or raises anything else is a failure, and its mutant is kept. In every eighth child the lines that are
run are watched: a mutant that reaches a new one becomes a seed. The same seed makes the same mutants.
"""

import argparse
import mmap
import os
import pickle
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import lumigraph as lg
import lumigraph.io as io
from lumigraph import store
from lumigraph.errors import LumigraphError
from lumigraph.io.formats import format_of

sys.path.insert(0, str(Path(__file__).parents[1]))
from fuzz.damage import DAMAGES
from fuzz.structure import Link, Pipe, structural

SECONDS, MEMORY, BATCH, STRUCTURAL = 20, 1 << 30, 250, 0.3
WATCHED, GUIDED = 8, 0.4  # one child of so many is watched; share of mutants made of those that it found
MOST_SEEDS, LARGEST_SEED = 300, 100_000  # of new seeds: their number, and the bytes of one
METRIC = {
    "corners.csv": lg.metrology.load_corners,
    "compote": lg.metrology.load_compote,
    "measured.json": lambda path: [*(found := lg.metrology.load(path)).quantities(), *found.tied()],
}
PACKAGE = str(Path(lg.__file__).parent)
Tree = dict[str, bytes]


@dataclass
class Score:
    """What became of the mutants of one reader."""

    opened: int = 0
    refused: int = 0
    out_of_memory: int = 0
    slowest: float = 0.0
    spent: float = 0.0
    most_memory: int = 0
    failures: list[tuple[int, str]] = field(default_factory=list)
    damaged: list[Tree] = field(default_factory=list)
    lines: set[str] = field(default_factory=set)
    corpus: list[Tree] = field(default_factory=list)


class Watch:
    """Context that collects the lines of the package that are run, by file and number."""

    def __init__(self, known: set[str]) -> None:
        self.known, self._run = known, set()

    def __enter__(self) -> "Watch":
        self._run.clear()
        sys.settrace(self._call)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def new(self) -> set[str]:
        """Those that were not known; from now on they are."""
        found = {f"{Path(code.co_filename).relative_to(PACKAGE)}:{line}" for code, line in self._run}
        found -= self.known
        self.known |= found
        return found

    def _call(self, frame: Any, event: str, _: object) -> Any:
        return self._line if frame.f_code.co_filename.startswith(PACKAGE) else None

    def _line(self, frame: Any, event: str, _: object) -> Any:
        self._run.add((frame.f_code, frame.f_lineno))
        return self._line


def mutant(trees: list[Tree], mend: Callable[[Tree], Tree] | None, rng: np.random.Generator) -> Tree:
    """One of the trees with one of its files damaged in one to four places, or of the wrong structure."""
    tree = dict(trees[rng.integers(len(trees))])
    if rng.random() < STRUCTURAL:
        tree = structural(tree, rng)
        return mend(tree) if mend is not None else tree
    name = sorted(tree)[rng.integers(len(tree))]
    content = bytearray(tree[name])
    for _ in range(1 + int(rng.integers(4))):
        content = DAMAGES[rng.integers(len(DAMAGES))](content, rng)
    tree[name] = bytes(content)
    return mend(tree) if mend is not None and rng.random() < 0.6 else tree


def read(tree: Tree, folder: Path) -> None:
    """Write a tree into a folder and open it in every way that its format has."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, content in tree.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Link):
            (folder / name).symlink_to(content.decode())
        elif isinstance(content, Pipe):
            os.mkfifo(folder / name)
        else:
            (folder / name).write_bytes(content)
    path, first = folder, sorted(tree)[0]
    if not first.startswith(("folder", "input_Cam")):
        path = folder / first.split("/")[0]
    elif first.startswith("folder"):
        path = folder / "folder"
    if (load := METRIC.get(path.name)) is not None:
        load(path)
        return
    if path.name == "camera.toml":
        lg.load_camera(path).describe()
        return
    if path.name == "run.npz":
        store.read(path)
        return
    options = {"shape": (60, 70)} if path.suffix in (".xml", ".ini") else {}
    error = None
    acts = [lambda: io.open(path, **options)]
    if hasattr(format_of(path).imported(), "contents"):  # else it opens the file once more
        acts.append(lambda: io.contents(path))
    for act in acts:
        try:
            act()
        except LumigraphError as refusal:
            error = refusal
    if path.suffix == ".lfp" and error is None:
        for part in io.contents(path):
            try:
                io.open(path, what=part.name)
            except LumigraphError as refusal:
                error = refusal
    if error is not None:
        raise error


def memory() -> tuple[int, int]:
    """Of this process: all addresses, and what is resident [bytes]."""
    size, resident = (int(word) for word in Path("/proc/self/statm").read_text().split()[:2])
    return size * resource.getpagesize(), resident * resource.getpagesize()


def _limit() -> None:
    """Bound the memory: all of it in a process of its own, what is added in a large one that forked."""
    size, resident = memory()
    resource.setrlimit(resource.RLIMIT_AS, (size + max(MEMORY - resident, MEMORY // 2),) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _child(
    numbers: range,
    make: Callable[[int], Tree],
    board: mmap.mmap,
    folder: Path,
    log: Path,
    known: set[str] | None,
) -> None:
    """Read mutants; the board tells the parent: index, opened, refused, out of memory, slowest."""
    _limit()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what libraries print
    warnings.simplefilter("ignore")
    watch = nullcontext() if known is None else Watch(known)
    opened = refused = starved = 0
    slowest = 0.0
    for k in numbers:
        board[:40] = struct.pack("=qqqqd", k, opened, refused, starved, slowest)
        tree, told = make(k), []
        signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of the processor: others may be at work
        signal.alarm(30 * SECONDS)
        start = time.process_time()
        try:
            with watch:
                read(tree, folder)
            opened += 1
        except LumigraphError as error:
            refused += 1
            starved += "does not fit into memory" in str(error)
            if len(str(error)) > 400 or "\n" in str(error):
                told.append(f"!a line of {len(str(error))} characters: {str(error)[:100]!r}")
        except BaseException as error:
            told.append(f"!{type(error).__name__}: {' '.join(str(error).split())[:300]}")
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)
        slowest = max(slowest, time.process_time() - start)
        told += sorted(watch.new()) if isinstance(watch, Watch) else []
        if told:
            with log.open("a") as file:
                file.writelines(f"{k}\t{each}\n" for each in told)
    board[:40] = struct.pack("=qqqqd", numbers.stop, opened, refused, starved, slowest)


def run(trees: list[Tree], mend: Callable[[Tree], Tree] | None, count: int, *, seed: int = 0) -> Score:
    """Read `count` mutants."""

    def make(k: int) -> Tree:
        rng = np.random.default_rng((seed, k))
        return mutant(score.corpus if score.corpus and rng.random() < GUIDED else trees, mend, rng)

    score, board = Score(), mmap.mmap(-1, 64)
    with tempfile.TemporaryDirectory() as place:
        folder, log, start = Path(place) / "mutant", Path(place) / "log", 0
        while start < count:
            numbers = range(start, min(count, start // BATCH * BATCH + BATCH))
            watched = start // BATCH % WATCHED == 0 and sys.gettrace() is None
            board[:40] = struct.pack("=qqqqd", start, 0, 0, 0, 0.0)
            child = _fork()
            if child == 0:
                code = 70
                try:
                    _child(numbers, make, board, folder, log, score.lines if watched else None)
                    code = 0
                finally:
                    os._exit(code)
            _, status, usage = os.wait4(child, 0)
            at = _add(score, board, usage)
            failures = [(k, line[1:]) for k, line in _lines(log) if line.startswith("!")]
            if status != 0:
                code = os.waitstatus_to_exitcode(status)
                hung = code in (-signal.SIGALRM, -signal.SIGPROF)
                failures.append((at, f"hung for {SECONDS} s" if hung else f"died with {code}"))
            score.failures += failures
            score.damaged += [make(k) for k, _ in failures]
            _grow(score, make, log)
            start = numbers.stop if status == 0 else at + 1
    return score


def _add(score: Score, board: mmap.mmap, usage: resource.struct_rusage) -> int:
    """Count what a child did; the mutant where it ended."""
    at, opened, refused, starved, slowest = struct.unpack("=qqqqd", board[:40])
    score.opened, score.refused = score.opened + opened, score.refused + refused
    score.out_of_memory += starved
    score.slowest = max(score.slowest, slowest)
    score.spent += usage.ru_utime + usage.ru_stime
    score.most_memory = max(score.most_memory, usage.ru_maxrss * 1024)
    return at


def _lines(log: Path) -> Iterator[tuple[int, str]]:
    for line in log.read_text().splitlines() if log.exists() else []:
        index, _, message = line.partition("\t")
        yield int(index), message


def _grow(score: Score, make: Callable[[int], Tree], log: Path) -> None:
    """Make seeds of the mutants that reached new lines of the package, as they were made."""
    reached = [(k, line) for k, line in _lines(log) if not line.startswith("!")]
    log.unlink(missing_ok=True)
    score.lines |= {line for _, line in reached}
    trees = [make(k) for k in dict.fromkeys(k for k, _ in reached)]
    small = [tree for tree in trees if sum(map(len, tree.values())) <= LARGEST_SEED]
    score.corpus += small[: MOST_SEEDS - len(score.corpus)]


def _fork() -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 on: threads there may be
        return os.fork()


def in_child(function: Callable[[], object]) -> object:
    """What a function returns, run in a child: what it starts (threads) is not inherited by later forks."""
    reader, writer = os.pipe()
    child = _fork()
    if child == 0:
        code = 70
        try:
            os.close(reader)
            with os.fdopen(writer, "wb") as file:
                pickle.dump(function(), file)
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as file:
        content = file.read()
    if os.waitpid(child, 0)[1] != 0:
        raise RuntimeError("the seeds could not be built")
    return pickle.loads(content)


def preload() -> None:
    """Import every reader now, so that children do not."""
    for row in io.FORMATS:
        row.imported()
    for name in lg.catalogue():
        lg.load_camera(name).describe()


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, help="mutants for each reader")
    parser.add_argument("--readers", nargs="*", help="only these")
    parser.add_argument("--seed", type=int, default=0, help="the same seed makes the same mutants")
    parser.add_argument("--keep", type=Path, help="folder for the mutants that failed")
    given = parser.parse_args(words)
    sys.path.insert(0, str(Path(__file__).parent))
    preload()
    import seeds

    found = in_child(seeds.seeds)
    assert isinstance(found, dict)
    failed = 0
    for name, (trees, mend) in found.items():
        if given.readers and name not in given.readers:
            continue
        start = time.monotonic()
        score = run(trees, mend, given.count, seed=given.seed)
        failed += len(score.failures)
        print(
            f"{name:12} {given.count} mutants: {score.opened} opened, {score.refused} refused "
            f"({score.out_of_memory} for memory), {len(score.failures)} failed; "
            f"{len(score.lines)} lines reached, {len(score.corpus)} seeds more; "
            f"{1e3 * score.spent / given.count:.2f} ms CPU each, slowest {score.slowest:.2f} s, "
            f"memory up to {score.most_memory / 2**20:.0f} MiB; {time.monotonic() - start:.0f} s",
            flush=True,
        )
        for (index, message), tree in list(zip(score.failures, score.damaged, strict=True))[:20]:
            print(f"    mutant {index}: {message}", flush=True)
            if given.keep:
                for file, content in tree.items():
                    path = given.keep / f"{name}-{index}" / file
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(content)  # a link as the text of where it leads
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
