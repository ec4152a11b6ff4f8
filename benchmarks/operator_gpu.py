"""Operators on a GPU in float32: their time beside NumPy's on that machine, their error, and their floors.

The same `forward` and `adjoint` take NumPy and PyTorch arrays, and so do `deconvolve` and `Propagate`. The
floors count what the matrices between a camera's cells must do at least: factors, the object's points and the
image's samples are read and written once, each factor multiplies every cell of its part once. Bandwidth and
arithmetic of the device are measured here, by a copy and by a matrix product in float32. Without CUDA it says
so and is done.

    python -m benchmarks.operator_gpu [--count 39 101] [--device cuda]
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np

import lumigraph as lg
from benchmarks import plenoptic_snapshots
from benchmarks.two_f_snapshots import show as show
from lumigraph.core import arrays
from lumigraph.core.linear import Linear
from lumigraph.deconvolution import deconvolve
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.operators.periodic.incoherent import PeriodicOperator, periodic_operator

Row = dict[str, Any]
Work = tuple[str, Callable[[Any], Any], np.ndarray, Linear | None]
"""A name, a function of one array, the array, and the operator whose floors count."""
REPEATS, ITERATIONS, FIELD = 7, 16, 4096
DEPTHS = tuple(1e-6 * z for z in range(-6, 7))


def multiply_adds(operator: PeriodicOperator) -> int:
    """Of the cells' matrices in one forward, or one adjoint."""
    total = 0
    for plane in operator.planes:
        for part in plane.matrix.parts:
            left = 0 if part.left is None else part.left.size
            total += len(part.rows) * len(part.columns) * (left + part.right.size)
    return total


def least_bytes(operator: PeriodicOperator) -> int:
    """Of factors, points and samples in float32, each once."""
    cells = operator.cells
    samples = math.prod(cells.image) * math.prod(cells.samples)
    total = 4 * (samples + math.prod(operator.shape[0]) + math.prod(operator.shape[1]))
    for plane in operator.planes:
        around = (n + 2 * m for n, m in zip(cells.image, plane.matrix.margin, strict=True))
        total += plane.matrix.nbytes + 4 * math.prod(around) * math.prod(cells.points)
    return int(total)


def seconds(torch: Any, device: str, work: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Median of several, after a first one, waiting for the device."""
    times = []
    for _ in range(repeats + 1):
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
    n = 2**28 if device.startswith("cuda") else 2**22
    block = torch.rand(n, device=device)
    copy = torch.empty_like(block)
    side = 8192 if device.startswith("cuda") else 1024
    square = torch.rand((side, side), device=device)
    return (
        8 * n / seconds(torch, device, lambda: copy.copy_(block)),
        side**3 / seconds(torch, device, lambda: square @ square),
    )


def works(counts: Sequence[int]) -> Iterator[Work]:
    """Cameras of several sizes, a microscope and its deconvolution, a field."""
    rng = np.random.default_rng(1)
    for count in counts:
        found = plenoptic_snapshots.camera().replace(lenslets={"count": (count, count)})
        operator = periodic_operator(found, found.object_grid)
        raw, thing = (rng.random(shape) for shape in operator.shape)
        yield f"forward, {count}² lenslets", operator.forward, thing, operator
        yield f"adjoint, {count}² lenslets", operator.adjoint, raw, operator
    scope = LightFieldMicroscope.from_catalogue("lfm-guv").replace(objective={"model": "scalar"})
    operator = scope.operator(DEPTHS, 5, pixels=15, accuracy=1e-2)
    raw, thing = (rng.random(shape) for shape in operator.shape)
    yield f"forward, microscope, {len(DEPTHS)} depths", operator.forward, thing, None
    yield f"adjoint, microscope, {len(DEPTHS)} depths", operator.adjoint, raw, None
    seen = operator.forward(thing) + 1
    yield (
        f"Richardson-Lucy, {ITERATIONS} times",
        lambda one: deconvolve(one, operator, ITERATIONS),
        seen,
        None,
    )
    grid, step = lg.Grid.square(FIELD, 2e-6), lg.Propagate(0.05)
    wave = rng.random(grid.shape) + 1j * rng.random(grid.shape)
    yield f"angular spectrum, {FIELD}²", lambda one: step(lg.Field(one, grid, 500e-9)).data, wave, None


def run(counts: Sequence[int] = (39, 101), device: str = "cuda") -> Iterator[Row]:
    """Times, floors and differences, one after the other."""
    try:
        import torch
    except ImportError:
        yield {"skipped": "PyTorch is not installed (make torch)"}
        return
    if device.startswith("cuda") and not torch.cuda.is_available():
        yield {"skipped": "PyTorch sees no CUDA device"}
        return
    bandwidth, arithmetic = limits(torch, device)
    yield {
        "device": device,
        "GB/s": f"{bandwidth / 1e9:.0f}",
        "GMAC/s": f"{arithmetic / 1e9:.0f}",
    }
    for name, apply, given, operator in works(counts):
        single = given.astype(np.complex64 if np.iscomplexobj(given) else np.float32)
        there = torch.asarray(single, device=device)
        exact, result = apply(given), arrays.to_numpy(apply(there))
        taken = seconds(torch, device, lambda apply=apply, there=there: apply(there))
        here = seconds(torch, "cpu", lambda apply=apply, single=single: apply(single), repeats=2)
        counted = isinstance(operator, PeriodicOperator)
        floor = _floor(operator, bandwidth, arithmetic, taken) if counted else ""
        yield {
            "operator": name, "ms": f"{1e3 * taken:.2f}", "NumPy ms": f"{1e3 * here:.0f}", "floor ms": floor,
            "rms beside float64": f"{np.linalg.norm(result - exact) / np.linalg.norm(exact):.1e}",
        }  # fmt: skip


def _floor(operator: PeriodicOperator, bandwidth: float, arithmetic: float, taken: float) -> str:
    floor = max(least_bytes(operator) / bandwidth, multiply_adds(operator) / arithmetic)
    return f"{1e3 * floor:.2f} ({taken / floor:.0f} times)"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, nargs="+", default=[39, 101])
    parser.add_argument("--device", default="cuda")
    options = parser.parse_args()
    for row in run(options.count, options.device):
        print("   ".join(f"{name}: {value}" for name, value in row.items()), flush=True)
