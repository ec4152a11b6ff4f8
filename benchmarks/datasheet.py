"""Data sheets of drawn cameras: do numbers repeat, and do intervals hold the truth?

``python -m benchmarks.datasheet [--cameras 30] [--first 0] [--exposures 16] [--seed 0]`` draws plenoptic
cameras 1.0 and 2.0, simulates the charts of each at the plane in focus by wave optics, exposes them twice
with other noise, and measures both. It prints how far the two sheets differ (of numbers that are 0 within
their intervals: over half an interval), how often that is within what the sheet says, how many intervals hold
what is known of the camera, and the mean and the root mean square of (measured - true) over half an interval,
times 1.96: 0 and 1 if errors are normal and intervals neither too wide nor too narrow.
"""

import argparse
import time
from collections import defaultdict

import numpy as np

import lumigraph as lg
from lumigraph.metrology.datasheet.lights import FILL, Lights

SEEDS = (1, 2)


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


def truths(camera, lights):
    """What a sheet must find: name and value."""
    sensor = camera.sensor
    return {
        "gain": sensor.gain, "dark_noise": sensor.dark_noise, "dark_signal": sensor.black_level,
        "pitch_px": camera.calibration.lattice.pitch, "rotation": 0.0, "light_at_corner": 100.0,
        "distortion": 0.0, "snr_of_pixels": snr(sensor, lights.white),
    }  # fmt: skip


def snr(sensor, white):
    """Of the pixels above half of the bright ones: mean electrons over the root of their mean variance."""
    electrons = white * (FILL * sensor.full_well / np.quantile(white, 0.999))
    bright = electrons[electrons > np.median(electrons[electrons > electrons.max() / 2]) / 2]
    return bright.mean() / np.sqrt(bright.mean() + sensor.dark_noise**2 + sensor.gain**2 / 12)


def on_chart(camera, sample, spacing):
    """The true size of a sample, with as many to a lenslet as were measured."""
    lenslet = camera.lenslets.pitch * camera.object_distance / camera.separation
    return lenslet / round(lenslet / sample)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--exposures", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    apart, zeros, told = defaultdict(list), defaultdict(list), []
    scores, slowest = defaultdict(list), 0.0
    for number in range(given.first + given.cameras):
        camera = drawn(rng)
        if number < given.first:
            continue
        print(f"camera {number}: {camera.KIND}", flush=True)
        started = time.process_time()
        lights, sheets = Lights.of(camera, [0.0]), []
        simulated = time.process_time() - started
        for seed in SEEDS:
            started = time.process_time()
            charts = lights.exposed(np.random.default_rng(seed), exposures=given.exposures)
            sheet = lg.metrology.datasheet(charts)
            sheets.append({q.name: q for q in sheet.quantities()})
            repeats = {one.quantity.name: one.repeats for one in sheet.planes[0].entries}
            slowest = max(slowest, simulated + time.process_time() - started)
        for name, one in sheets[0].items():
            if name not in sheets[1] or not isinstance(one.value, float):
                continue
            off = abs(sheets[1][name].value - one.value)
            low, high = one.interval or (one.value, one.value)
            if low <= 0 <= high:
                zeros[name].append(off / ((high - low) / 2))
            else:
                apart[name].append(off / abs(one.value))
            if said := repeats.get(name.removeprefix("least_")):
                told.append(off <= said)
        for sheet in sheets:
            known = truths(camera, lights)
            if "sample_on_chart" in sheet:
                known["sample_on_chart"] = on_chart(camera, sheet["sample_on_chart"].value, lights.spacing)
            for name, true in known.items():
                if name in sheet and sheet[name].interval:
                    low, high = sheet[name].interval
                    scores[name].append(1.96 * (sheet[name].value - true) / ((high - low) / 2))
    for name, values in apart.items():
        within = np.mean(np.array(values) <= 0.02)
        print(
            f"{name:28s} apart: median {np.median(values):.3%}, worst {max(values):.3%} of {len(values)}; "
            f"{within:.0%} within 2 %"
        )
    for name, values in zeros.items():
        print(f"{name:28s} apart: at most {max(values):.2f} of half an interval of {len(values)}")
    everything = np.concatenate(list(apart.values()))
    print(f"{np.mean(everything <= 0.02):.1%} of {len(everything)} numbers repeat to 2 %")
    if told:
        print(f"{np.mean(told):.0%} of {len(told)} depths, errors and noises are apart by no more than said")
    for name, values in scores.items():
        held, rms = np.mean(np.abs(values) <= 1.96), np.sqrt(np.mean(np.square(values)))
        print(
            f"{name:28s} inside {held:4.0%} of {len(values)}, mean {np.mean(values):+.2f}, rms {rms:.2f} of 1"
        )
    everything = np.concatenate(list(scores.values()))
    print(
        f"truth inside {np.mean(np.abs(everything) <= 1.96):.1%} of {len(everything)} intervals; "
        f"slowest {slowest:.1f} CPU s"
    )


if __name__ == "__main__":
    main()
