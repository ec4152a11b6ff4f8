"""One white-phase snapshot of the thesis' Table 5.1 camera, 39 x 39 lenslets: Octave, SciPy and lumigraph.

Octave runs `octave/plenoptic_snapshot.m`: plain fft2 in double precision on 3500² samples, three legs. The
SciPy version is the same on complex64, in place, with workers. lumigraph's is `Snapshots` on the grids that
the camera itself chooses (its pixels are finer than its samples). Snapshots cost the same each, so the time
of 350 is extrapolated from the median of a few; that is said in the table. Octave is left out where there is
no `octave-cli`.

    python -m benchmarks.plenoptic_snapshots
"""

import shutil
import subprocess
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import scipy.fft

import lumigraph as lg
from benchmarks.two_f_snapshots import show as show
from lumigraph.core.arrays import WORKERS, intensity
from lumigraph.errors import SamplingWarning
from lumigraph.propagation.angular_spectrum import transfer_function
from lumigraph.propagation.sampling import band_limits

CAMERA = "thesis-plenoptic-2-m050"
SAMPLES = 3500
THESIS_SNAPSHOTS = 350
SCRIPT = Path(__file__).parent / "octave" / "plenoptic_snapshot.m"

_fft2: Any = scipy.fft.fft2
_ifft2: Any = scipy.fft.ifft2


def camera() -> lg.FocusedPlenopticCamera:
    """The camera with 39 x 39 lenslets."""
    return lg.FocusedPlenopticCamera.from_catalogue(CAMERA)


def sample_pitch(samples: int = SAMPLES) -> float:
    """Pitch [m] of that many samples across the array: 90 for each lenslet with 3500, about."""
    found = camera()
    return found.lenslets.pitch * found.lenslets.count[0] / samples


def octave_snapshot_seconds(samples: int = SAMPLES, count: int = 3) -> list[float] | None:
    """Wall seconds of each of `count` snapshots in Octave after a first one; None without `octave-cli`."""
    octave = shutil.which("octave-cli")
    if octave is None:
        return None
    c = camera()
    lengths = (
        sample_pitch(samples), c.wavelength, c.object_distance, c.separation, c.lenslet_distance,
        c.main_lens.focal_length, c.pupil_diameter, c.lenslets.pitch, c.lenslets.focal_length,
    )  # fmt: skip
    words = [octave, "--norc", "--quiet", str(SCRIPT), str(samples), *map(repr, lengths), str(count + 1)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return [float(line) for line in done.stdout.split()][1:]


def scipy_snapshot_seconds(samples: int = SAMPLES, count: int = 3) -> list[float]:
    """The same by scipy.fft on complex64, in place and with workers; after a first one."""
    c, grid = camera(), lg.Grid.square(samples, sample_pitch(samples))
    transfers = [_transfer(grid, z, c.wavelength) for z in (c.object_distance, c.separation, _b(c))]
    main = lg.ThinLens(c.main_lens.focal_length, c.pupil_diameter, edge="hard")
    lattice = lg.Lattice.square(c.lenslets.pitch)
    masks = [
        element.transmission(grid, c.wavelength).astype(np.complex64)
        for element in (main, lg.LensletArray(lattice, c.lenslets.focal_length))
    ]
    rng, times = np.random.default_rng(1), []
    bars = ((np.arange(samples) // 40) % 2).astype(np.float32)[:, None]
    total = np.zeros(grid.shape, np.float32)
    for _ in range(count + 1):
        start = time.perf_counter()
        data = bars * np.exp(2j * np.pi * rng.random(grid.shape, np.float32)).astype(np.complex64)
        for H, mask in zip(transfers, (*masks, None), strict=True):
            data = _fft2(data, overwrite_x=True, workers=WORKERS)
            data *= H
            data = _ifft2(data, overwrite_x=True, workers=WORKERS)
            if mask is not None:
                data *= mask
        total += intensity(data)
        times.append(time.perf_counter() - start)
    return times[1:]


def propagate_snapshot_seconds(samples: int = SAMPLES, count: int = 3) -> list[float]:
    """The same by `lumigraph.propagate`, unpadded, on complex64; after a first one."""
    c, grid = camera(), lg.Grid.square(samples, sample_pitch(samples))
    main = lg.ThinLens(c.main_lens.focal_length, c.pupil_diameter, edge="hard")
    lenslets = lg.LensletArray(lg.Lattice.square(c.lenslets.pitch), c.lenslets.focal_length)
    steps = lg.Propagate(c.object_distance, pad=0), main, lg.Propagate(c.separation, pad=0), lenslets
    train, last = lg.Train(steps), lg.Propagate(_b(c), pad=0)
    rng, times, total = np.random.default_rng(1), [], np.zeros(grid.shape, np.float32)
    bars = ((np.arange(samples) // 40) % 2).astype(np.float32)[:, None]
    with warnings.catch_warnings():  # unpadded windows, as the thesis has them
        warnings.simplefilter("ignore", SamplingWarning)
        for _ in range(count + 1):
            start = time.perf_counter()
            data = bars * np.exp(2j * np.pi * rng.random(grid.shape, np.float32)).astype(np.complex64)
            total += last.intensity(train(lg.Field(data, grid, c.wavelength)))
            times.append(time.perf_counter() - start)
    return times[1:]


def snapshots_seconds(count: int = 3, found: Any = None) -> list[float]:
    """Wall seconds of a further snapshot by `lumigraph.simulate`: what `8 count` more of them take."""
    found = found or camera()
    target = lg.targets.siemens_star(found.object_grid)

    def seconds(snapshots: int) -> float:
        start = time.perf_counter()
        lg.simulate(found, target, lg.Snapshots(snapshots, rng=1))
        return time.perf_counter() - start

    seconds(2)
    few = seconds(8)
    return [(seconds(8 + 8 * count) - few) / (8 * count)]


def _b(found: Any) -> float:
    return float(found.lenslet_distance)


def _transfer(grid: lg.Grid, distance: float, wavelength: float) -> np.ndarray:
    limit_y, limit_x = band_limits(grid, distance, wavelength)
    H = transfer_function(grid.fy, grid.fx, distance, wavelength)
    H *= (np.abs(grid.fy) <= limit_y)[:, None] & (np.abs(grid.fx) <= limit_x)
    return H.astype(np.complex64)


def run(count: int = 3) -> Sequence[dict[str, Any]]:
    """Rows of the table: seconds of one snapshot, and of the thesis' 350 by extrapolation."""
    grid = camera().image_grid
    measured = {
        f"Octave, fft2, {SAMPLES}²": octave_snapshot_seconds(count=count),
        f"SciPy, complex64, {SAMPLES}²": scipy_snapshot_seconds(count=count),
        f"lumigraph.propagate, {SAMPLES}²": propagate_snapshot_seconds(count=count),
        f"lumigraph.Snapshots, its own {grid.shape[0]}²": snapshots_seconds(count),
    }
    return [
        {
            "method": name,
            "median s of one": "octave-cli is not installed" if times is None else round(median(times), 3),
            f"s of {THESIS_SNAPSHOTS}, extrapolated": None
            if times is None
            else round(THESIS_SNAPSHOTS * median(times), 1),
        }
        for name, times in measured.items()
    ]


if __name__ == "__main__":
    show(run())
