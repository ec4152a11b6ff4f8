"""Data sheets of drawn cameras: do numbers repeat, and do intervals hold the truth?

``python -m benchmarks.datasheet [--cameras 30] [--seed 0]`` draws plenoptic cameras 1.0 and 2.0, simulates
the charts of each at the plane in focus by wave optics, exposes them twice with other noise, and measures
both. It prints how far the two sheets differ, and how many intervals hold what is known of the camera.
"""

import argparse
import time
from collections import defaultdict

import numpy as np

import lumigraph as lg

TRUTHS = ("gain", "dark_noise", "dark_signal", "pitch_px", "rotation", "distortion", "light_at_corner")


def drawn(rng):
    """A camera 1.0 or 2.0 of few lenslets."""
    pitch = rng.uniform(90e-6, 160e-6)
    sensor = {
        "pixel_pitch": pitch / rng.uniform(12, 20), "black_level": 64.0,
        "full_well": rng.uniform(6000, 20000), "read_noise": rng.uniform(3, 12),
    }  # fmt: skip
    f, near = rng.uniform(50e-3, 110e-3), rng.uniform(1.7, 2.6)
    common = {"wavelength": 550e-9, "object_distance": near * f, "main_lens": {"focal_length": f}}
    if rng.random() < 0.5:
        lenslets = {"pitch": pitch, "focal_length": pitch * rng.uniform(20, 36), "count": (53, 53)}
        return lg.PlenopticCamera(**common, lenslets=lenslets, sensor=sensor)
    sensor["pixel_pitch"] = pitch / rng.uniform(26, 36)
    lenslets = {
        "pitch": pitch, "focal_length": pitch * rng.uniform(25, 34), "count": (21, 21),
        "magnification": rng.uniform(0.3, 0.5),
    }  # fmt: skip
    return lg.FocusedPlenopticCamera(**common, lenslets=lenslets, sensor=sensor)


def truths(camera):
    """What a sheet must find: name and value."""
    sensor = camera.sensor
    return dict(zip(
        TRUTHS,
        (sensor.gain, sensor.dark_noise, sensor.black_level, camera.calibration.lattice.pitch, 0, 0, 100),
        strict=True,
    ))  # fmt: skip


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    apart, held, slowest = defaultdict(list), defaultdict(list), 0.0
    for number in range(given.cameras):
        camera = drawn(rng)
        print(f"camera {number}: {camera.KIND}", flush=True)
        started, sheets = time.process_time(), []
        for seed in (1, 2):
            charts = lg.metric.simulate_charts(camera, [0.0], rng=np.random.default_rng(seed))
            sheets.append({q.name: q for q in lg.metric.datasheet(charts).quantities()})
        slowest = max(slowest, (time.process_time() - started) / 2)
        for name, one in sheets[0].items():
            if name in sheets[1] and isinstance(one.value, float) and one.value:
                apart[name].append(abs(sheets[1][name].value / one.value - 1))
        for name, true in truths(camera).items():
            for sheet in sheets:
                if name in sheet and sheet[name].interval:
                    low, high = sheet[name].interval
                    held[name].append(low <= true <= high)
    for name, values in apart.items():
        inside = f"{np.mean(held[name]):4.0%} of {len(held[name])}" if name in held else ""
        line = f"median {np.median(values):.3%}, worst {max(values):.3%} of {len(values)}"
        print(f"{name:28s} apart: {line}  {inside}")
    everything = [one for values in held.values() for one in values]
    print(
        f"truth inside {np.mean(everything):.1%} of {len(everything)} intervals; slowest {slowest:.1f} CPU s"
    )


if __name__ == "__main__":
    main()
