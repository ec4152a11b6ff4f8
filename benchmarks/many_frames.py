"""Batches: what is said before beside what was used, memory over many frames, the ledger's part, kills.

    python -m benchmarks.many_frames estimates [--frames 24]   ten jobs, said and used
    python -m benchmarks.many_frames growth [--frames 2000]    the peak of a worker's memory
    python -m benchmarks.many_frames ledger                    its part of a frame's processor time
    python -m benchmarks.many_frames kills [--frames 500]      a data set killed five times, and one not
    python -m benchmarks.many_frames swept [--frames 200]      a sweep killed five times, and one not
    python -m benchmarks.many_frames warm [--frames 8]         a film's likelihood by warm starts
    python -m benchmarks.many_frames standard [--frames 8]     25 planes as fine as 1463 x 1273 pixels
    python -m benchmarks.many_frames scaling [--frames 60]     two workers with twice the frames beside one
    python -m benchmarks.many_frames cost                      by planes, samples and lenslets

Times are those of this machine as busy as it is; two workers.
"""

import argparse
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import tifffile

import lumigraph as lg
from benchmarks.periodic_operator import camera, plenoptic
from lumigraph import cluster
from lumigraph.cli import main as lumigraph
from lumigraph.cluster import run
from lumigraph.deconvolution.deconvolve import Deconvolver
from lumigraph.units import um

RAW = {"plenoptic": (31, 31), "focused": (21, 21)}
SCOPE = ["batch", "deconvolve", "guv.tif", "--camera", "guv.toml"]
DEEP = [*SCOPE, "--depth", "-10 um:10 um:5 um", "--samples", "3", "--iterations"]
JOBS: dict[str, list[str]] = {
    "decode": ["batch", "decode", "plenoptic.tif", "--camera", "plenoptic.toml"],
    "refocus": ["batch", "refocus", "plenoptic.tif", "--camera", "plenoptic.toml", "--alpha", "0.95"],
    "depth": ["batch", "depth", "plenoptic.tif", "--camera", "plenoptic.toml"],
    "render": ["batch", "render", "focused.tif", "--camera", "focused.toml"],
    "deconvolve, 5 planes, 3 samples": [*DEEP, "8"],
    "deconvolve, 3 planes, 5 samples": [
        *SCOPE, "--depth", "-4 um:4 um:4 um", "--samples", "5", "--iterations", "4",
    ],
    "deconvolve, 2.0": [
        "batch", "deconvolve", "focused.tif", "--camera", "focused.toml", "--iterations", "4",
    ],
    "deconvolve, warm": [*DEEP, "2", "--warm", "--run", "3"],
    "sweep": [
        "sweep", "focused.toml", "--measure", "mtf50_middle",
        "--vary", "lenslets.focal_length=5 mm:5.4 mm:{frames}",
    ],
    "dataset": ["dataset", "focused.toml", "-n", "{frames}", "--depth", "-6 mm:6 mm:6 mm"],
}  # fmt: skip
"""Words of the command line, but for the output."""


def inputs(folder: Path, frames: int) -> None:
    """Camera files and stacks of noisy raw images."""
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
    cameras: dict[str, Any] = {
        "plenoptic": plenoptic().replace(lenslets={"count": RAW["plenoptic"]}),
        "focused": camera(count=RAW["focused"]), "guv": scope,
    }  # fmt: skip
    rng = np.random.default_rng(0)
    for name, found in cameras.items():
        (folder / f"{name}.toml").write_text(found.to_toml())
        scene = lg.targets.white() if name == "guv" else lg.targets.slanted_edge(found.object_grid)
        light = lg.simulate(found, scene).data
        light = 2000 * np.clip(light / light.max(), 0, 1) + 20
        pages = np.stack([rng.poisson(light) for _ in range(frames)]).astype(np.uint16)
        tifffile.imwrite(folder / f"{name}.tif", pages, photometric="minisblack")


def estimate(name: str, frames: int, folder: Path) -> dict[str, float]:
    """Used over said, of time, processor time, memory and disk."""
    said: list[tuple[run.Estimate, float]] = []
    require = run.Estimate.require

    def noted(needed: run.Estimate, workers: int, output: Path) -> None:
        said.append((needed, time.time()))
        require(needed, workers, output)

    output = folder / f"out{list(JOBS).index(name)}.{'csv' if name == 'sweep' else 'zarr'}"
    words = [word.format(frames=frames) for word in JOBS[name]]
    with patch.object(run.Estimate, "require", noted):
        if lumigraph([*words, "-o", str(output), "--workers", "2"]):
            raise SystemExit(f"{name} failed")
    needed, began = said[-1]  # the first one is of memory alone
    entries = cluster.status(output).entries
    written = {int(p.stem): p.stat().st_mtime for p in (ledger(output) / "done").glob("*.json")}
    later = [entries[k] for k, when in written.items() if when > began]
    used = max(written.values()) - began
    return {
        "said [s]": needed.seconds, "used [s]": used, "time": used / needed.seconds,
        "processor time": sum(one.busy for one in later) / needed.busy,
        "memory": max(one.memory for one in entries.values()) / needed.memory,
        "disk": sum(one.size for one in later) / needed.size if needed.size else float("nan"),
    }  # fmt: skip


def ledger(output: Path) -> Path:
    """Folder of an output's ledger."""
    return output.with_name(output.name + ".ledger")


def estimates(frames: int, folder: Path) -> None:
    """Table of ten jobs."""
    inputs(folder, frames)
    print("| job | said, s | used, s | used over said: time | processor time | memory | disk |", flush=True)
    print("|---|---|---|---|---|---|---|")
    for name in JOBS:
        values = list(estimate(name, frames, folder).values())
        cells = " | ".join(f"{value:.3g}" for value in values[:2]) + " | "
        print(f"| {name} | {cells}{' | '.join(f'{value:.2f}' for value in values[2:])} |", flush=True)


def growth(frames: int, folder: Path) -> None:
    """Peak of one worker's memory after a twentieth of the frames, and in the end."""
    raw = lg.RawImage(np.zeros((75, 75), np.uint16), 6.5 * um)
    rng, path = np.random.default_rng(0), folder / "film.tif"
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
    scope = scope.replace(lenslets={"count": (5, 5)}, sensor={"shape": raw.data.shape})
    (folder / "small.toml").write_text(scope.to_toml())
    pages = (rng.poisson(200, (75, 75)).astype(np.uint16) for _ in range(frames))
    tifffile.imwrite(path, pages, shape=(frames, 75, 75), dtype=np.uint16, photometric="minisblack")
    words = ["batch", "deconvolve", str(path), "--camera", "small.toml", "--depth", "4 um", "--samples", "3"]
    output = folder / "volumes.zarr"
    lumigraph([*words, "--iterations", "2", "-o", str(output), "--workers", "1"])
    peaks = [entry.memory for _, entry in sorted(cluster.status(output).entries.items())]
    early = peaks[len(peaks) // 20]
    print(f"{len(peaks)} frames: {early / 2**20:.1f} MiB after {len(peaks) // 20}, "
          f"{peaks[-1] / 2**20:.1f} MiB in the end, {100 * (peaks[-1] / early - 1):.1f} % more")  # fmt: skip


class Timed:
    """Work whose processor time is added up."""

    def __init__(self, work: Any) -> None:
        self.work, self.side_by_side, self.busy = work, work.side_by_side, 0.0

    def __call__(self, item: Any) -> Any:
        """As the work has it."""
        return self.work(item)

    def several(self, items: Any) -> Any:
        """As the work has it."""
        results = self.work.several(items)
        while True:
            began = time.process_time()
            found = next(results, None)
            self.busy += time.process_time() - began
            if found is None:
                return
            yield found


class Here:
    """Works in this process, and tells its processor time and that of the work."""

    is_here, count = True, 1

    def group(self, task: Any) -> Any:
        """Itself, with a task."""
        self.work, self.frames, self.busy, self.inside = Timed(task.work), 0, 0.0, 0.0
        self.task = replace(task, work=self.work)
        return self

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def each(self, numbers: Any) -> Any:
        """How each frame ended; the first of all, which makes what is kept, does not count."""
        numbers, side = list(numbers), self.work.side_by_side
        for some in (numbers[k : k + side] for k in range(0, len(numbers), side)):
            self.work.busy, began = 0.0, time.process_time()
            yield from list(self.task.do(some))
            if 0 not in some:
                self.frames += len(some)
                self.busy, self.inside = self.busy + time.process_time() - began, self.inside + self.work.busy


def of_ledger(frames: int, folder: Path) -> None:
    """Part of the processor time of `Task.do` outside the work: claims, shards and entries."""
    inputs(folder, frames)
    from lumigraph.cli.frames import Frames

    words = JOBS["deconvolve, 5 planes, 3 samples"][3:]
    path = folder / "guv.tif"
    about = {"file": str(path), "size": path.stat().st_size, "modified": path.stat().st_mtime_ns}
    items, here = [{**about, "page": k} for k in range(frames)], Here()
    cluster.batch(Frames("deconvolve", tuple(words), str(folder)), items, folder / "v.zarr", workers=here)  # type: ignore[arg-type]
    outside = here.busy - here.inside
    print(f"{outside / here.frames * 1e3:.1f} ms of {here.busy / here.frames * 1e3:.0f} ms, "
          f"{100 * outside / here.busy:.2f} %")  # fmt: skip


def kills(frames: int, folder: Path) -> None:
    """Whether a data set that was killed five times has the bits of one that was not."""
    (folder / "focused.toml").write_text(camera(count=(4, 4)).to_toml())
    words = ["dataset", "focused.toml", "-n", str(frames), "--depth", "-6 mm:6 mm:6 mm"]
    _killed(words, frames, [folder / name for name in ("killed.zarr", "whole.zarr")])


def swept(frames: int, folder: Path) -> None:
    """Whether a sweep of simulated charts that was killed five times has the table of one that was not."""
    (folder / "focused.toml").write_text(camera(count=(8, 8)).to_toml())  # one operator: only noise changes
    words = ["sweep", "focused.toml", "--measure", "mtf50_middle, lateral resolution"]
    words += ["--vary", f"sensor.read_noise=1:20:{frames}"]
    _killed(words, frames, [folder / name for name in ("killed.csv", "whole.csv")])


def _killed(words: list[str], frames: int, outputs: list[Path]) -> None:
    """Run a command until it is done, killed five times on its way, and once undisturbed; compare."""
    words, first = [sys.executable, "-m", "lumigraph", *words, "--workers", "2", "-o"], outputs[0]
    rng, killed = random.Random(4), 0
    while killed < 5:
        started = subprocess.Popen([*words, first.name], start_new_session=True, stderr=subprocess.DEVNULL)
        time.sleep(1 if killed else 5)
        while not list((ledger(first) / "done").glob("*.json"))[killed * frames // 6 :]:
            time.sleep(0.1)
        time.sleep(rng.uniform(0, 2))
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
            killed += 1
            print(f"killed at {len(cluster.status(first).entries)} of {frames}", flush=True)
        started.wait()
        time.sleep(1)
    for output in outputs:
        subprocess.run(
            [*words, output.name], check=True, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
    sums = [list(contents(output).values()) for output in outputs]
    same = "the same bits" if sums[0] == sums[1] else "OTHER BITS"
    print(f"{len(sums[1])} files, {cluster.status(first).done} done: {same}")


def warm(frames: int, folder: Path) -> None:
    """Deviance a pixel of drifting beads, by cold starts, by half of the iterations, and by as many warm."""
    scope, rng = lg.LightFieldMicroscope.from_catalogue("lfm-guv"), np.random.default_rng(0)
    operator = scope.operator(tuple(np.arange(-10, 11, 5) * um), 3, accuracy=1e-2)
    places = rng.uniform(15, 72, (60, 2))
    film = []
    for _ in range(frames):
        volume = np.full(operator.shape[1], 0.02, np.float32)
        places += rng.normal(0, 0.2, places.shape)
        np.add.at(volume, (np.arange(60) % 5, *places.round().astype(int).T), 20.0)
        film.append(rng.poisson(200 * operator.forward(volume)).astype(np.uint16))
    (folder / "guv.toml").write_text(scope.to_toml())
    tifffile.imwrite(folder / "guv.tif", np.stack(film), photometric="minisblack")
    for iterations, more in (("8", []), ("4", []), ("4", ["--warm", "--run", str(frames)])):
        output = folder / f"{iterations}{len(more)}.ome.zarr"
        if lumigraph([*DEEP, iterations, *more, "-o", str(output), "--workers", "1"]):
            raise SystemExit("it failed")
        found = []
        for page, raw in enumerate(film[1:], 1):
            seen = operator.forward(np.asarray(lg.open(output, page=page).data, np.float32))
            seen = np.maximum(seen * raw.sum() / seen.sum(), 1e-6).astype(float)
            ratio = np.where(raw > 0, raw / seen, 1.0)
            found.append(2 * np.mean(raw * np.log(ratio) - raw + seen))
        print(f"{iterations} iterations{', warm' if more else ''}: {np.mean(found):.3f}", flush=True)


def contents(store: Path) -> dict[str, int]:
    """CRC-32 of each file, or of the one that it is."""
    files = (path for path in (store, *sorted(store.rglob("*"))) if path.is_file())
    return {str(path.relative_to(store)): zlib.crc32(path.read_bytes()) for path in files}


def standard(frames: int, folder: Path) -> None:
    """Seconds a frame of a batch of two workers, and peak memory of one."""
    scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv").replace(
        wavelength="525 nm",
        objective={
            "magnification": 20.0,
            "numerical_aperture": 0.5,
            "immersion_index": 1.0,
            "model": "scalar",
        },
        lenslets={"pitch": "125 um", "focal_length": "2.5 mm", "count": (77, 67)},
        sensor={"shape": (1463, 1273), "pixel_pitch": 125 * um / 19},
    )
    (folder / "standard.toml").write_text(scope.to_toml())
    film = np.random.default_rng(0).poisson(200, (frames, 1463, 1273)).astype(np.uint16)
    tifffile.imwrite(folder / "standard.tif", film, photometric="minisblack")
    words = ["batch", "deconvolve", "standard.tif", "--camera", "standard.toml", "--samples", "19"]
    words += ["--depth=-60 um:60 um:5 um", "--iterations", "4", "--workers", "2"]
    began = time.perf_counter()
    if lumigraph([*words, "-o", str(folder / "standard.zarr")]):
        raise SystemExit("it failed")
    entries = list(cluster.status(folder / "standard.zarr").entries.values())
    print(f"{(time.perf_counter() - began) / frames:.1f} s a frame by the clock, the operator included")
    print("clock", *(f"{one.seconds:.1f}" for one in entries), "s; processors",
          *(f"{one.busy:.1f}" for one in entries), "s")  # fmt: skip
    print(f"{max(one.memory for one in entries) / 2**30:.2f} GiB a worker")


def scaling(frames: int, folder: Path) -> None:
    """Frames a second of two workers over those of one, from the first frame of the last worker on.

    Each worker has as many frames. Before it, what the machine itself gives two processes.
    """
    inputs(folder, 2 * frames)
    print("| job | one worker, frames a second | two | times |", flush=True)
    print("|---|---|---|---|")
    one, two = (sum(applied(workers)) for workers in (1, 2))
    print(f"| no batch: an operator and its adjoint | {one:.3g} | {two:.3g} | {two / one:.2f} |", flush=True)
    for name in ("deconvolve, 5 planes, 3 samples", "deconvolve, 2.0", "depth", "dataset"):
        one, two = (pace(name, frames * workers, workers, folder) for workers in (1, 2))
        print(f"| {name} | {one:.3g} | {two:.3g} | {two / one:.2f} |", flush=True)


def applied(processes: int, seconds: float = 10.0) -> list[float]:
    """How often a second each of some processes applies `lfm-guv`, of 5 planes, and its adjoint."""
    context = multiprocessing.get_context("spawn")
    found, ready = context.Queue(), context.Barrier(processes)
    running = [context.Process(target=_apply, args=(seconds, ready, found)) for _ in range(processes)]
    for process in running:
        process.start()
    rates = [found.get() for _ in running]
    for process in running:
        process.join()
    return rates


def _apply(seconds: float, ready: Any, found: Any) -> None:
    operator = lg.LightFieldMicroscope.from_catalogue("lfm-guv").operator(
        [k * 5 * um for k in range(-2, 3)], 3
    )
    volume = operator.adjoint(np.ones(operator.shape[0], np.float32))
    ready.wait()
    began, count = time.perf_counter(), 0
    while time.perf_counter() - began < seconds:
        operator.adjoint(operator.forward(volume))
        count += 1
    found.put(count / (time.perf_counter() - began))


def pace(name: str, frames: int, workers: int, folder: Path) -> float:
    """Frames a second."""
    output = folder / f"{list(JOBS).index(name)}by{workers}.zarr"
    words = [word.format(frames=frames) for word in JOBS[name]]
    words += ["--page", f"0:{frames - 1}"] if words[0] == "batch" else []
    if lumigraph([*words, "-o", str(output), "--workers", str(workers)]):
        raise SystemExit(f"{name} failed")
    ends: dict[str, list[float]] = {}
    for number, entry in cluster.status(output).entries.items():
        when = (ledger(output) / "done" / f"{number:06}.json").stat().st_mtime
        ends.setdefault(entry.where, []).append(when)
    ready = max(min(times) for times in ends.values())
    later = [when for times in ends.values() for when in times if when > ready]
    return len(later) / (max(later) - ready)


SIZES = ((5, 3, 29), (11, 3, 29), (21, 3, 29), (5, 5, 29), (5, 9, 29), (5, 3, 15), (5, 3, 59))
"""Planes, samples per lenslet, lenslets along each side."""


def cost(frames: int, folder: Path) -> None:
    """Processor seconds of a microscope's operator and of a frame of 4 iterations, by the object's size."""
    print("| planes | samples per lenslet | lenslets | operator, s | a frame, s | operator, MiB |")
    print("|---|---|---|---|---|---|")
    for planes, samples, side in SIZES:
        scope = lg.LightFieldMicroscope.from_catalogue("lfm-guv")
        scope = scope.replace(lenslets={"count": (side, side)}, sensor={"shape": None})
        depths, began = tuple(np.linspace(-10e-6, 10e-6, planes)), time.process_time()
        operator = scope.operator(depths, samples, pixels=15, accuracy=1e-2)
        built, engine = time.process_time() - began, Deconvolver(operator, 4)
        raw = np.random.default_rng(0).poisson(200, operator.shape[0]).astype(np.float32)
        times = [time.process_time()]
        for _ in range(1 + frames):  # the first one makes what they share
            engine(raw)
            times.append(time.process_time())
        each, held = np.median(np.diff(times)[1:]), operator.memory_bytes / 2**20
        print(f"| {planes} | {samples} | {side}² | {built:.1f} | {each:.2f} | {held:.0f} |", flush=True)


WHAT: dict[str, tuple[Callable[[int, Path], None], int]] = {
    "estimates": (estimates, 24), "growth": (growth, 2000), "ledger": (of_ledger, 64),
    "kills": (kills, 500), "swept": (swept, 200), "warm": (warm, 8),
    "standard": (standard, 8), "scaling": (scaling, 60), "cost": (cost, 3),
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=WHAT)
    parser.add_argument("--frames", type=int)
    options = parser.parse_args()
    function, usual = WHAT[options.what]
    with tempfile.TemporaryDirectory(prefix="lumigraph-") as folder:
        os.chdir(folder)
        function(options.frames or usual, Path(folder))
        os.chdir("/")


if __name__ == "__main__":
    main()
