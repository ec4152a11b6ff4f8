"""Memory that a cold operator says it takes to build, beside the peak of a process that builds it.

    python -m benchmarks.memory [--count] [--only NAME ...]

Said is `sizes.build_bytes` of as many threads as work, or `stream_bytes` and the raw image's where blocks are
streamed; used is the process' peak over what it had before. Nothing is kept on disk. `--count` counts the
factors of blocks inside the array, to an offset, and at each place of its border, beside what `sizes.Factors`
says: its constants were read off there.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks.periodic_operator import camera, plenoptic
from lumigraph.core.arrays import WORKERS
from lumigraph.operators import periodic_operator
from lumigraph.operators.periodic import kernels
from lumigraph.operators.periodic.blocks import BlockBuilder
from lumigraph.operators.periodic.sizes import Factors, build_bytes, wanted
from lumigraph.operators.periodic.streamed import stream_bytes
from lumigraph.operators.sampling.optics import Optics
from lumigraph.units import mm, um

KINDS = (5.2 * mm, 5 * mm, 5.4 * mm)
CAMERAS: dict[str, tuple[Callable[[], Any], float]] = {
    "2.0, square, 1e-3": (lambda: camera(count=(31, 31)), 1e-3),
    "2.0, square, 1e-4": (lambda: camera(count=(31, 31)), 1e-4),
    "2.0, square, gaps, 1e-3": (lambda: camera(count=(31, 31), fill_factor=0.9), 1e-3),
    "2.0, Galilean, 1e-3": (lambda: camera(count=(21, 21), magnification=-0.4, focal_length=8 * mm), 1e-3),
    "1.0, 1e-3": (lambda: plenoptic().replace(lenslets={"count": (31, 31)}), 1e-3),
    "2.0, round, 1e-2": (lambda: camera(count=(21, 21), shape="round"), 1e-2),
    "2.0, round, 1e-3": (lambda: camera(count=(21, 21), shape="round"), 1e-3),
    "2.0, round, 1e-4": (lambda: camera(count=(7, 7), shape="round"), 1e-4),
    "2.0, hexagonal, 1e-2": (lambda: camera(count=(24, 21), layout="hex"), 1e-2),
    "2.0, hexagonal, 1e-3": (lambda: camera(count=(24, 21), layout="hex"), 1e-3),
    "2.0, three kinds, 1e-2": (
        lambda: camera(count=(24, 21), layout="hex", focal_length=KINDS, shape="round"),
        1e-2,
    ),
    "2.0, hexagonal, Galilean, 1e-2": (
        lambda: camera(count=(24, 21), layout="hex", magnification=-0.4, focal_length=8 * mm),
        1e-2,
    ),
    "2.0, square, m = 0.25, 1e-3": (lambda: camera(count=(31, 31), magnification=0.25), 1e-3),
    "2.0, square, 1e-2": (lambda: camera(count=(31, 31)), 1e-2),
    "2.0, streamed, 1e-3": (lambda: camera(count=(9, 9), magnification=-0.4, focal_length=8 * mm), 1e-3),
}


def measured(name: str) -> dict[str, float]:
    """Bytes said and used, in this process, which has built nothing yet."""
    build, accuracy = CAMERAS[name]
    found = build()
    optics = Optics.of(found.optics(), found.object_distance, accuracy).bricks
    if streams := name == "2.0, streamed, 1e-3":
        kernels.HELD = 0.0
    before = _peak()
    grid = lg.Grid((4, 4), 30 * um)
    operator = periodic_operator(found, grid, accuracy=accuracy)
    if streams:
        operator.forward(np.ones(grid.shape, np.float32))
        said = operator.memory_bytes - operator.planes[0].matrix.nbytes + stream_bytes(optics)
    else:
        said = build_bytes(optics, WORKERS)
    return {"said": said, "used": _peak() - before, "kept": operator.planes[0].matrix.nbytes}


def counted(name: str) -> str:
    """Factors to a block inside the array and at its border, counted over said, and those found at first."""
    build, accuracy = CAMERAS[name]
    found = build()
    optics = Optics.of(found.optics(), found.object_distance, accuracy).bricks
    builder, said = BlockBuilder(optics, lambda _: None, WORKERS), Factors.of(optics)
    inside = sum(left.shape[1] for blocks in builder.periodic()[0] for left, _ in blocks.values())
    first: list[int] = []
    whole = builder._border_blocks

    def pieces(wanted: Any) -> Any:
        for place, blocks in whole_pieces(wanted):
            first.append(sum(len(f.strength) for f in blocks.values()))
            yield place, blocks

    which = "_row_by_row" if optics.straight else "_kind_by_kind"
    whole_pieces = getattr(builder, which)
    setattr(builder, which, pieces)
    border = sum(left.shape[1] for blocks in whole(wanted(optics)).values() for left, _ in blocks.values())
    return (
        f"| {name} | {inside} | {inside / said.inside / optics.cells.kinds:.2f} | {border} "
        f"| {border / said.border:.2f} | {sum(first) / border:.2f} |"
    )


def _peak() -> float:
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=tuple(CAMERAS), default=tuple(CAMERAS))
    parser.add_argument("--count", action="store_true", help="factors instead of memory")
    parser.add_argument("--child", choices=tuple(CAMERAS), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        print(json.dumps(measured(options.child)))
        return
    if options.count:
        print("| camera | inside | over said | border | over said | at first over kept |")
        print("|---" * 6 + "|")
        for name in options.only:
            print(counted(name), flush=True)
        return
    print("| camera | said, MiB | used, MiB | said over used | kept, MiB |\n|---|---|---|---|---|")
    for name in options.only:
        child = subprocess.run(
            [sys.executable, "-W", "ignore", "-m", "benchmarks.memory", "--child", name],
            check=True, capture_output=True, text=True, env=os.environ | {"LUMIGRAPH_CACHE": "off"},
        )  # fmt: skip
        row = {key: value / 2**20 for key, value in json.loads(child.stdout).items()}
        ratio = row["said"] / row["used"]
        print(
            f"| {name} | {row['said']:.0f} | {row['used']:.0f} | {ratio:.2f} | {row['kept']:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
