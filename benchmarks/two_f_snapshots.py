"""Incoherent 2f image by 20 random-phase snapshots: pruned propagation against full transforms.

f = 158 mm, D = 5 mm, 633 nm, 2000² samples over 1 cm, complex64, band-limited, one window of 2000² for
all. lumigraph goes from the object's box to the pupil's box to the whole image, or only to the box
that holds the image; or, the window's band limit being a quarter of its frequencies, on every second sample:
a lens without the frequencies that no wave within the band sees, and a sum of intensities that holds all of
the image, brought onto 2000² after the last snapshot. The intensities are compared where both have them. The
plain version is fft2 · H ·
ifft2 by scipy.fft on complex64, in place, with workers and a cached transfer function, as chromatix
does it. Both end with the intensity added to a sum. They run in turns, snapshot by snapshot, on the
same random phases, which are drawn outside the measured time. `lg.simulate` with `Snapshots` follows, on the
grids that the camera chooses for 2000² pixels of 5 µm; it draws its phases within the measured time.

    python -m benchmarks.two_f_snapshots
"""

import resource
import time
import warnings
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import numpy as np
import scipy.fft
from scipy.signal import resample

import lumigraph as lg
from lumigraph.core.arrays import WORKERS, intensity
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingWarning
from lumigraph.propagation import Propagate, propagate
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.propagation.sampling import band_limits

FOCAL_LENGTH, DIAMETER, WAVELENGTH = 158e-3, 5e-3, 633e-9
DISTANCE = 2 * FOCAL_LENGTH
GRID = Grid.square(2000, 5e-6)
OBJECT = GRID.resized(800)
PUPIL = GRID.resized(1002)
IMAGE = GRID.resized(900)
SECOND = Grid.square(1000, 10e-6)
FULL, SPARSE = "full transforms (scipy.fft)", "pruned, every second sample"
SIMULATED = "lg.simulate, its own grids"

_fft2: Any = scipy.fft.fft2
_ifft2: Any = scipy.fft.ifft2
Step = Callable[[np.ndarray], np.ndarray]


def bars(grid: Grid) -> np.ndarray:
    """Groups of three horizontal and three vertical bars, as on a USAF-1951 target, (y, x)."""
    image = np.zeros(grid.shape, np.float32)
    row = 10
    for width in (40, 30, 20, 14, 10, 6):
        for k in range(3):
            start = 2 * k * width
            image[row : row + 5 * width, 20 + start : 20 + start + width] = 1
            image[row + start : row + start + width, 420 : 420 + 5 * width] = 1
        row += 5 * width + 20
    return image


def lens(grid: Grid) -> np.ndarray:
    """Thin lens behind a round stop, complex64 (y, x)."""
    r2 = grid.y[:, None] ** 2 + grid.x**2
    phase = np.exp(-1j * np.pi * r2 / (WAVELENGTH * FOCAL_LENGTH))
    return np.where(r2 <= (DIAMETER / 2) ** 2, phase, 0).astype(np.complex64)


def pruned(image: Grid) -> Step:
    """One snapshot by lumigraph: object's box to pupil's box to `image`."""
    pupil = lens(PUPIL)
    pads = [GRID.shape[0] / grid.shape[0] - 1 for grid in (OBJECT, PUPIL)]  # a window of 2000² for both legs

    last = Propagate(DISTANCE, pad=pads[1] if image != GRID else 0, grid=image)

    def snapshot(waves: np.ndarray) -> np.ndarray:
        field = propagate(Field(waves, OBJECT, WAVELENGTH), DISTANCE, pad=pads[0], grid=PUPIL)
        return last.intensity(field * pupil)

    return snapshot


def sparse() -> Step:
    """One snapshot by lumigraph on every second sample, behind the object."""
    last = Propagate(DISTANCE, pad=0)
    warnings.filterwarnings("ignore", "light that leaves the window", SamplingWarning)  # the plain one's, too
    pupil = resample(resample(lens(GRID), 1000, axis=0), 1000, axis=1).astype(np.complex64)

    def snapshot(waves: np.ndarray) -> np.ndarray:
        field = propagate(Field(waves, OBJECT, WAVELENGTH), DISTANCE, pad=0, grid=SECOND)
        return last.intensity(field * pupil)

    return snapshot


def plain() -> Step:
    """One snapshot by full transforms of the whole window."""
    pupil = lens(GRID)
    limit_y, limit_x = band_limits(GRID, DISTANCE, WAVELENGTH)
    H = transfer_function(GRID.fy, GRID.fx, DISTANCE, WAVELENGTH)
    H *= (np.abs(GRID.fy) <= limit_y)[:, None] & (np.abs(GRID.fx) <= limit_x)
    H = H.astype(np.complex64)
    box = slice(600, 1400)

    def leg(data: np.ndarray) -> np.ndarray:
        data = _fft2(data, overwrite_x=True, workers=WORKERS)
        data *= H
        return _ifft2(data, overwrite_x=True, workers=WORKERS)

    def snapshot(waves: np.ndarray) -> np.ndarray:
        data = np.zeros(GRID.shape, np.complex64)
        data[box, box] = waves
        data = leg(data)
        data *= pupil
        return intensity(leg(data))

    return snapshot


def run(snapshots: int = 20) -> list[dict[str, Any]]:
    """Rows of the table: medians of one snapshot, wall and processor time, ratios, and difference."""
    rng = np.random.default_rng(1)
    methods = {
        FULL: plain(),
        "pruned, whole image": pruned(GRID),
        "pruned, image's box": pruned(IMAGE),
        SPARSE: sparse(),
    }
    middle = slice(550, 1450)
    target = bars(OBJECT)
    wall: dict[str, list[float]] = {name: [] for name in methods}
    busy: dict[str, list[float]] = {name: [] for name in methods}
    sums: dict[str, Any] = dict.fromkeys(methods, 0)
    for index in range(-1, snapshots):  # the first one warms the caches and does not count
        phase = rng.random(OBJECT.shape, np.float32) * np.float32(2 * np.pi)
        waves = (target * np.exp(1j * phase)).astype(np.complex64)
        for name in sorted(methods, reverse=bool(index % 2)):
            start, used = time.perf_counter(), user_seconds()
            sums[name] += methods[name](waves)
            if index >= 0:
                wall[name].append(time.perf_counter() - start)
                busy[name].append(user_seconds() - used)
    start, used = time.perf_counter(), user_seconds()
    sums[SPARSE] = resample(resample(sums[SPARSE].astype(float), 2000, axis=0), 2000, axis=1)
    wall[SPARSE] = [one + (time.perf_counter() - start) / snapshots for one in wall[SPARSE]]
    busy[SPARSE] = [one + (user_seconds() - used) / snapshots for one in busy[SPARSE]]
    wall[SIMULATED], busy[SIMULATED] = simulated(snapshots)
    full = sums[FULL]
    pairs = {
        name: (found, full[middle, middle] if found.shape != full.shape else full)
        for name, found in sums.items()
    }
    off = {name: np.linalg.norm(a - b) / np.linalg.norm(b) for name, (a, b) in pairs.items()}
    return [
        {
            "method": name,
            "median ms": round(1e3 * median(wall[name]), 1),
            "user CPU ms": round(1e3 * median(busy[name]), 1),
            "times faster": round(median(wall[FULL]) / median(wall[name]), 2),
            "less CPU": round(median(busy[FULL]) / median(busy[name]), 2),
            "relative difference": f"{off[name]:.1e}" if name in off else "other samples",
        }
        for name in wall
    ]


def simulated(snapshots: int) -> tuple[list[float], list[float]]:
    """Wall and processor time [s] of each snapshot of `lg.simulate`, the drawing of its phases included."""
    camera = lg.SingleLensCamera.from_catalogue("thesis-2f")
    ticks = []

    def tick(fraction: float) -> None:
        ticks.append((time.perf_counter(), user_seconds()))

    lg.simulate(
        camera, lg.targets.usaf1951(camera.object_grid), lg.Snapshots(snapshots + 1, rng=1), progress=tick
    )
    wall, busy = np.diff(ticks, axis=0).T.tolist()
    return wall, busy


def user_seconds() -> float:
    """Processor time that this process has used for itself, without the system's for it [s]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print rows as a table."""
    from rich.console import Console
    from rich.table import Table

    table = Table(*rows[0])
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    Console().print(table)


if __name__ == "__main__":
    show(run())
