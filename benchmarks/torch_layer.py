"""What a training step through `lg.torch.Camera` costs, over a forward pass.

``python -m benchmarks.torch_layer``: a scene of 81 x 81 samples before 9 x 9 lenslets, three keys. Both run
in processes of their own, after a small camera has loaded what PyTorch loads once: CPU seconds, and the peak
beyond what the process had. The last two columns are of a heap that gives freed memory back at once, which is
slower and shows what is held.
"""

import ctypes
import gc
import os
import subprocess
import sys
import time
from pathlib import Path

import torch

import lumigraph as lg

KEYS = {
    "lenslets.focal_length": "5 mm:5.4 mm",
    "object_distance": "118 mm:122 mm",
    "main_lens.focal_length": "59 mm:61 mm",
}
SAMPLES, PITCH, DEPTH = 81, 10e-6, 1e-3
STOPS = ("1 mm", "2.3 mm")
AT_ONCE = {"MALLOC_MMAP_THRESHOLD_": "65536"}


def model(stop: str, count: int, pixels: int, samples: int) -> lg.torch.Camera:
    """A camera 2.0 as a layer."""
    camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
        main_lens={"diameter": stop}, lenslets={"count": (count, count)}, sensor={"shape": (pixels, pixels)}
    )
    return lg.torch.Camera(camera, KEYS, grid=lg.Grid.square(samples, PITCH), depths=[DEPTH], accuracy=1e-2)


def memory(kind: str) -> float:
    """VmRSS or VmHWM of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(kind))


def work(module: lg.torch.Camera, scene: torch.Tensor, *, step: bool) -> None:
    """A forward pass without slopes, or one there and back."""
    with torch.set_grad_enabled(step):
        loss = (module(scene) ** 2).sum()
    if step:
        loss.backward()


def measured(stop: str, *, step: bool) -> None:
    """Print CPU seconds and memory of this process' one pass."""
    torch.set_num_threads(1)
    work(model(stop, 3, 24, 9), torch.rand(1, 1, 9, 9), step=True)
    layer, scene = model(stop, 9, 77, SAMPLES), torch.rand(1, 1, SAMPLES, SAMPLES)
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before, began = memory("VmRSS"), time.process_time()
    work(layer, scene, step=step)
    print(time.process_time() - began, memory("VmHWM") - before)


def told(stop: str, step: bool, **environment: str) -> tuple[float, float]:
    """The same, by another process."""
    command = [sys.executable, "-m", "benchmarks.torch_layer", stop, "step" if step else "forward"]
    found = subprocess.run(
        command, check=True, capture_output=True, text=True, env={**os.environ, **environment}
    )
    seconds, megabytes = found.stdout.split()
    return float(seconds), float(megabytes)


def main() -> None:
    """Print the table."""
    print("| stop | forward | step | ratio | forward [MB] | step [MB] | ratio | held: forward | step |")
    for stop in STOPS:
        (short, little), (long, much) = told(stop, False), told(stop, True)
        held = [told(stop, step, **AT_ONCE)[1] for step in (False, True)]
        print(
            f"| {stop} | {short:.2f} | {long:.2f} | {long / short:.1f} | {little:.0f} | {much:.0f} | "
            f"{much / little:.1f} | {held[0]:.0f} | {held[1]:.0f} |"
        )


if __name__ == "__main__":
    if len(sys.argv) == 3:
        measured(sys.argv[1], step=sys.argv[2] == "step")
    else:
        main()
