"""Snapshots of the 2f system by one library: ``python snapshots.py LIBRARY COUNT``; see `run.py`.

f = 158 mm, D = 5 mm, 633 nm, 2000² samples over 1 cm. Each function returns a step: phases in, intensity out,
with whatever the library can prepare made outside of it. The same window of 2000² for all, else defaults.
"""

import os
import resource
import sys
import time
from statistics import median

import numpy as np

N, PITCH, F, D, WAVELENGTH = 2000, 5e-6, 158e-3, 5e-3, 633e-9
DISTANCE = 2 * F


def axes():
    x = (np.arange(N) - N // 2) * PITCH
    return x[:, None] ** 2 + x**2


def lens():
    r2 = axes()
    return np.where(r2 <= (D / 2) ** 2, np.exp(-1j * np.pi * r2 / (WAVELENGTH * F)), 0)


def by_scipy():
    import scipy.fft as fft

    f = np.fft.fftfreq(N, PITCH)
    s = (WAVELENGTH * f[:, None]) ** 2 + (WAVELENGTH * f) ** 2
    H = np.exp(2j * np.pi * DISTANCE / WAVELENGTH * np.sqrt(1 - s))
    limit = 1 / (WAVELENGTH * np.sqrt((2 * DISTANCE / (N * PITCH)) ** 2 + 1))
    H *= (np.abs(f) <= limit)[:, None] & (np.abs(f) <= limit)
    H, pupil = H.astype(np.complex64), lens().astype(np.complex64)
    workers = len(os.sched_getaffinity(0))

    def leg(data):
        data = fft.fft2(data, overwrite_x=True, workers=workers)
        data *= H
        return fft.ifft2(data, overwrite_x=True, workers=workers)

    def step(data):
        data = leg(data.astype(np.complex64))
        data *= pupil
        return np.abs(leg(data)) ** 2

    return step


def by_hcipy():
    import hcipy

    grid = hcipy.make_uniform_grid([N, N], [N * PITCH, N * PITCH])
    pupil = hcipy.Field(lens().ravel(), grid)
    leg = hcipy.AngularSpectrumPropagator(grid, DISTANCE)

    def step(data):
        wave = leg(hcipy.Wavefront(hcipy.Field(data.ravel(), grid), WAVELENGTH))
        return leg(hcipy.Wavefront(wave.electric_field * pupil, WAVELENGTH)).intensity.shaped

    return step


def by_prysm():
    from prysm.propagation import Wavefront

    pupil = lens()  # prysm counts in millimetres and micrometres
    transfer = None

    def step(data):
        nonlocal transfer
        wave = Wavefront(data, WAVELENGTH * 1e6, PITCH * 1e3)
        if transfer is None:
            from prysm.propagation import angular_spectrum_transfer_function as build

            transfer = build(data.shape, WAVELENGTH * 1e6, PITCH * 1e3, DISTANCE * 1e3)
        wave = wave.free_space(tf=transfer)
        wave = Wavefront(wave.data * pupil, WAVELENGTH * 1e6, PITCH * 1e3).free_space(tf=transfer)
        return np.abs(wave.data) ** 2

    return step


def by_torchoptics():
    import torch
    import torchoptics

    torchoptics.set_default_spacing(PITCH)
    torchoptics.set_default_wavelength(WAVELENGTH)
    pupil = torch.tensor(lens())
    window = {"propagation_method": "ASM", "asm_pad": (0, 0)}  # by default it has 10000²

    def step(data):
        field = torchoptics.Field(torch.tensor(data)).propagate_to_z(DISTANCE, **window)
        field = torchoptics.Field(field.data * pupil, z=DISTANCE).propagate_to_z(2 * DISTANCE, **window)
        return field.intensity()

    return step


def by_lumenairy():
    from lumenairy import angular_spectrum_propagate as leg

    pupil = lens()

    def step(data):
        return np.abs(leg(leg(data, DISTANCE, WAVELENGTH, PITCH) * pupil, DISTANCE, WAVELENGTH, PITCH)) ** 2

    return step


def by_lumigraph():
    from benchmarks.two_f_snapshots import sparse

    snapshot = sparse()
    return lambda data: snapshot(data[600:1400, 600:1400].astype(np.complex64))  # all else is dark


def difference(intensity, data):
    """From full transforms: relative rms in the middle half of the window."""
    every = N // len(intensity)  # lumigraph has every second sample
    expected = by_scipy()(data)[::every, ::every]
    middle = slice(len(intensity) // 4, 3 * len(intensity) // 4)
    found, expected = np.asarray(intensity).reshape(expected.shape)[middle, middle], expected[middle, middle]
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


def main():
    library, count = sys.argv[1], int(sys.argv[2])
    step = globals()[f"by_{library}"]()
    rng, wall, busy = np.random.default_rng(1), [], []
    box = np.zeros((N, N))
    box[600:1400, 600:1400] = (np.arange(800) // 20 % 2)[:, None]
    for _ in range(count + 1):
        data = box * np.exp(2j * np.pi * rng.random((N, N)))
        start, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_utime
        intensity = step(data)
        wall.append(time.perf_counter() - start)
        busy.append(resource.getrusage(resource.RUSAGE_SELF).ru_utime - used)
    times = 1e3 * median(wall[1:]), 1e3 * median(busy[1:])
    off = difference(intensity, data)
    print(f"{library:12} {times[0]:8.0f} ms a snapshot, {times[1]:8.0f} ms of processor time, {off:.1e} off")


if __name__ == "__main__":
    main()
