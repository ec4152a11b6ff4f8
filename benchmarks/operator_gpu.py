"""The lenslet-periodic operator on a GPU, float32, against float64 on the CPU, and its floors.

The same `forward` and `adjoint` take NumPy and PyTorch arrays. The floors count what the matrices of the
cells must do at least: their factors, the object's points and the image's samples are read and written once,
each factor multiplies every cell of its part once. Bandwidth and arithmetic of the device are measured here,
by a copy and by a matrix product in float32. Without CUDA it says so and is done.

    python -m benchmarks.operator_gpu [--count 39] [--device cuda]
"""

import argparse
import math
import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import numpy as np

from benchmarks import plenoptic_snapshots
from benchmarks.two_f_snapshots import show as show
from lumigraph.core import arrays
from lumigraph.operators.periodic import PeriodicOperator, periodic_operator

Row = dict[str, Any]
REPEATS = 7


def multiply_adds(operator: PeriodicOperator) -> int:
    """Of the cells' matrices in one forward, or one adjoint."""
    total = 0
    for plane in operator.planes:
        for part in plane.matrix.parts:
            cells = (part.rows[1] - part.rows[0]) * (part.columns[1] - part.columns[0])
            total += cells * (part.left.size + part.right.size)
    return total


def least_bytes(operator: PeriodicOperator) -> int:
    """Of factors, points and samples in float32, each once."""
    cells = operator.cells
    samples = math.prod(n + 2 for n in cells.count) * math.prod(cells.samples)
    total = 4 * (samples + math.prod(operator.sensor.shape))
    for plane in operator.planes:
        around = (n + 2 + 2 * m for n, m in zip(cells.count, plane.matrix.margin, strict=True))
        total += plane.matrix.nbytes + 4 * math.prod(around) * math.prod(cells.points)
    return total + 4 * math.prod(operator.shape[1])


def seconds(torch: Any, device: str, work: Callable[[], Any]) -> float:
    """Median of several, after a first one, waiting for the device."""
    times = []
    for _ in range(REPEATS + 1):
        _wait(torch, device)
        start = time.perf_counter()
        work()
        _wait(torch, device)
        times.append(time.perf_counter() - start)
    return median(times[1:])


def _wait(torch: Any, device: str) -> None:
    if device.startswith("cuda"):
        torch.cuda.synchronize()


def limits(torch: Any, device: str) -> tuple[float, float]:
    """Bytes and multiply-adds per second of the device, float32."""
    n = 2**26 if device.startswith("cuda") else 2**22
    block = torch.ones(n, device=device)
    copy = torch.empty_like(block)
    side = 8192 if device.startswith("cuda") else 1024
    square = torch.ones((side, side), device=device)
    return (
        8 * n / seconds(torch, device, lambda: copy.copy_(block)),
        side**3 / seconds(torch, device, lambda: square @ square),
    )


def run(count: int = 39, device: str = "cuda") -> Sequence[Row]:
    """Times, floors and differences of forward and adjoint."""
    try:
        import torch
    except ImportError:
        return [{"skipped": "PyTorch is not installed (make torch)"}]
    if device.startswith("cuda") and not torch.cuda.is_available():
        return [{"skipped": "PyTorch sees no CUDA device"}]
    found = plenoptic_snapshots.camera().replace(lenslets={"count": (count, count)})
    operator, rng = periodic_operator(found, found.object_grid), np.random.default_rng(1)
    raw_shape, object_shape = operator.shape
    bandwidth, arithmetic = limits(torch, device)
    floors = least_bytes(operator) / bandwidth, multiply_adds(operator) / arithmetic
    rows = []
    for name, shape in (("forward", object_shape), ("adjoint", raw_shape)):
        here, apply = rng.random(shape), getattr(operator, name)
        there = torch.asarray(here, dtype=torch.float32, device=device)
        exact = apply(here)
        result = arrays.to_numpy(apply(there)).astype(float)
        taken = seconds(torch, device, lambda apply=apply, there=there: apply(there))
        rows.append({
            "operator": f"{name}, {count}² lenslets", "device": device, "ms": f"{1e3 * taken:.2f}",
            "bandwidth floor ms": f"{1e3 * floors[0]:.2f}", "arithmetic floor ms": f"{1e3 * floors[1]:.2f}",
            "over the floor": f"{taken / max(floors):.1f}",
            "rms beside float64": f"{np.linalg.norm(result - exact) / np.linalg.norm(exact):.1e}",
        })  # fmt: skip
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=39)
    parser.add_argument("--device", default="cuda")
    options = parser.parse_args()
    show(run(options.count, options.device))
