"""Damaged files by the thousand: every reader must answer with a thing or with a LumigraphError.

    python tests/fuzz/run.py --count 20000 [--readers tiff png] [--seed 0] [--keep folder]

Mutants are read in forked children that may take 1 GiB of memory in all and 10 s for each; a child that dies,
hangs or raises anything else is a failure, and its mutant is kept. The same seed makes the same mutants.
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
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import lumigraph as lg
import lumigraph.io as io
from lumigraph import store
from lumigraph.errors import LumigraphError

sys.path.insert(0, str(Path(__file__).parents[1]))
from fuzz.structure import Link, Pipe, structural

SECONDS, MEMORY, BATCH, STRUCTURAL = 10, 1 << 30, 250, 0.3
# Whole numbers that lengths, counts and offsets are replaced by, and texts that numbers are.
NUMBERS = (
    0,
    1,
    2,
    7,
    0x7F,
    0x80,
    0xFF,
    0x100,
    0x7FFF,
    0xFFFF,
    0x10000,
    1 << 20,
    1 << 24,
    10**9,
    2**31 - 1,
    2**31,
    2**32 - 1,
)
TEXTS = (
    b"0",
    b"-1",
    b"1e9",
    b"999999999",
    b"1e308",
    b"nan",
    b"null",
    b"[]",
    b"{}",
    b'""',
    b"65536",
    b"0.5",
    b"true",
    b"[[",
    b"&x;",
)
Tree = dict[str, bytes]


@dataclass
class Score:
    """What became of the mutants of one reader."""

    opened: int = 0
    refused: int = 0
    out_of_memory: int = 0
    slowest: float = 0.0
    most_memory: int = 0
    failures: list[tuple[int, str]] = field(default_factory=list)


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


def _place(content: bytearray, rng: np.random.Generator) -> int:
    """Half of the places lie in the first 300 bytes, where headers stand."""
    near = min(len(content), 300) if rng.random() < 0.5 else len(content)
    return int(rng.integers(max(near, 1)))


def flip(content: bytearray, rng: np.random.Generator) -> bytearray:
    if content:
        content[_place(content, rng)] ^= 1 << int(rng.integers(8))
    return content


def number(content: bytearray, rng: np.random.Generator) -> bytearray:
    size, order = int(rng.choice((1, 2, 4, 8))), ("little", "big")[rng.integers(2)]
    value = NUMBERS[rng.integers(len(NUMBERS))] % 256**size
    at = _place(content, rng)
    content[at : at + size] = value.to_bytes(size, order)
    return content


def text(content: bytearray, rng: np.random.Generator) -> bytearray:
    """A run of digits, as in JSON, XML and headers of text, becomes something else."""
    at = _place(content, rng)
    start = next((k for k in range(at, min(len(content), at + 200)) if 48 <= content[k] < 58), at)
    stop = start
    while stop < len(content) and (48 <= content[stop] < 58 or content[stop] in b".-+e"):
        stop += 1
    content[start:stop] = TEXTS[rng.integers(len(TEXTS))]
    return content


def noise(content: bytearray, rng: np.random.Generator) -> bytearray:
    at, size = _place(content, rng), int(rng.integers(1, 16))
    content[at : at + size] = rng.bytes(size)
    return content


def cut(content: bytearray, rng: np.random.Generator) -> bytearray:
    return content[: int(rng.integers(len(content) + 1))]


def remove(content: bytearray, rng: np.random.Generator) -> bytearray:
    at = _place(content, rng)
    del content[at : at + int(rng.integers(1, 64))]
    return content


def repeat(content: bytearray, rng: np.random.Generator) -> bytearray:
    at, size = _place(content, rng), int(rng.integers(1, 64))
    content[at:at] = content[at : at + size] * int(rng.choice((1, 2, 50)))
    return content


def move(content: bytearray, rng: np.random.Generator) -> bytearray:
    here, there, size = _place(content, rng), _place(content, rng), int(rng.integers(1, 32))
    content[here : here + size] = content[there : there + size]
    return content


DAMAGES = (flip, flip, number, number, number, text, text, noise, cut, remove, repeat, move)


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
    if path.name == "camera.toml":
        lg.load_camera(path).describe()
        return
    if path.name == "run.npz":
        store.read(path)
        return
    options = {"shape": (60, 70)} if path.suffix in (".xml", ".ini") else {}
    error = None
    for act in (lambda: io.open(path, **options), lambda: io.contents(path)):
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


def _child(numbers: range, make: Callable[[int], Tree], board: mmap.mmap, folder: Path, log: Path) -> None:
    """Read mutants; the board tells the parent: index, opened, refused, out of memory, slowest."""
    _limit()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # libtiff tells of damage there
    warnings.simplefilter("ignore")
    opened = refused = starved = 0
    slowest = 0.0
    for k in numbers:
        board[:40] = struct.pack("=qqqqd", k, opened, refused, starved, slowest)
        tree = make(k)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of the processor: others may be at work
        signal.alarm(4 * SECONDS)
        start = time.process_time()
        try:
            read(tree, folder)
            opened += 1
        except LumigraphError as error:
            refused += 1
            starved += "does not fit into memory" in str(error)
        except BaseException as error:
            with log.open("a") as file:
                file.write(f"{k}\t{type(error).__name__}: {' '.join(str(error).split())[:300]}\n")
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)
        slowest = max(slowest, time.process_time() - start)
    board[:40] = struct.pack("=qqqqd", numbers.stop, opened, refused, starved, slowest)


def run(trees: list[Tree], mend: Callable[[Tree], Tree] | None, count: int, *, seed: int = 0) -> Score:
    """Read `count` mutants."""

    def make(k: int) -> Tree:
        return mutant(trees, mend, np.random.default_rng((seed, k)))

    score, board = Score(), mmap.mmap(-1, 64)
    with tempfile.TemporaryDirectory() as place:
        folder, log, start = Path(place) / "mutant", Path(place) / "log", 0
        while start < count:
            numbers = range(start, min(count, start + BATCH))
            board[:40] = struct.pack("=qqqqd", start, 0, 0, 0, 0.0)
            child = _fork()
            if child == 0:
                code = 70
                try:
                    _child(numbers, make, board, folder, log)
                    code = 0
                finally:
                    os._exit(code)
            _, status, usage = os.wait4(child, 0)
            at, opened, refused, starved, slowest = struct.unpack("=qqqqd", board[:40])
            score.opened, score.refused = score.opened + opened, score.refused + refused
            score.out_of_memory += starved
            score.slowest = max(score.slowest, slowest)
            score.most_memory = max(score.most_memory, usage.ru_maxrss * 1024)
            if status == 0:
                start = numbers.stop
            else:
                code = os.waitstatus_to_exitcode(status)
                hung = code in (-signal.SIGALRM, -signal.SIGPROF)
                score.failures.append((at, f"hung for {SECONDS} s" if hung else f"died with {code}"))
                start = at + 1
        score.failures += _logged(log)
    return score


def _fork() -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 on: threads there may be
        return os.fork()


def _logged(log: Path) -> Iterator[tuple[int, str]]:
    for line in log.read_text().splitlines() if log.exists() else []:
        index, _, message = line.partition("\t")
        yield int(index), message


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
            f"slowest {score.slowest:.2f} s CPU, memory up to {score.most_memory / 2**20:.0f} MiB; "
            f"{time.monotonic() - start:.0f} s",
            flush=True,
        )
        for index, message in score.failures[:20]:
            print(f"    mutant {index}: {message}", flush=True)
            if given.keep:
                tree = mutant(trees, mend, np.random.default_rng((given.seed, index)))
                for file, content in tree.items():
                    path = given.keep / f"{name}-{index}" / file
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(content)  # a link as the text of where it leads
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
