"""A simulated bench that is out of place: how exactly `lg.metric.twin` says so, and whether it is ever wrong.

``python -m benchmarks.twin [--runs 50] [--pictures 1] [--lenslets 41] [--seed 0]`` draws ±1 degree of tilt
about both axes, ±0.3 mm of height, ±30 µm of shift, ±5 mrad of turn and ±5 % of aperture at once, exposes
white images by wave optics with noise, and compares what is found. An instruction is wrong if its sign is, or
if the truth is farther from it than three standard deviations and a tenth of the value.
"""

import argparse
import math
import time

import numpy as np

import lumigraph as lg
from lumigraph.metric.twin import CAUSES, SURE


def camera(count):
    """A bench of count x count lenslets."""
    return lg.PlenopticCamera(
        wavelength=550e-9,
        object_distance="240 mm",
        main_lens={"focal_length": "120 mm", "diameter": "3.2 mm"},
        lenslets={"pitch": "150 um", "focal_length": "10 mm", "count": (count, count)},
        sensor={"pixel_pitch": "8 um", "black_level": 64},
    )


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--pictures", type=int, default=1)
    parser.add_argument("--lenslets", type=int, default=41)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng, bench = np.random.default_rng(given.seed), lg.metric.Bench(camera(given.lenslets))
    sensor, off, sure, wrong, started = bench.camera.sensor, [], [], 0, time.process_time()
    for _ in range(given.runs):
        tilt, shift = np.radians(rng.uniform(-1, 1, 2)), rng.uniform(-30e-6, 30e-6, 2)
        alone = (rng.uniform(-0.3e-3, 0.3e-3), rng.uniform(-5e-3, 5e-3), rng.uniform(-0.05, 0.05))
        true = np.array([alone[0], *tilt, *shift, alone[1], alone[2]])
        light = bench.white(true)
        raws = [sensor.expose(light, fill=0.8, rng=rng) for _ in range(given.pictures)]
        found = lg.metric.twin(raws, bench, dark=sensor.expose(0 * light, reference=1, rng=rng))
        off.append(found.values - true)
        sure.append(found.errors)
        told = np.abs(found.values) > SURE * found.errors
        far = np.abs(off[-1]) > SURE * found.errors + 0.1 * np.abs(found.values)
        wrong += int((told & (far | (found.values * true < 0))).sum())
    off, sure = np.abs(off), np.array(sure)
    rms, score = (np.sqrt((one**2).mean(0)) for one in (off, off / sure))
    units = ("um", *(2 * ("deg",)), *(2 * ("um",)), "mrad", "%")
    scales = (1e6, *(2 * (180 / math.pi,)), *(2 * (1e6,)), 1e3, 1e2)
    for k, (name, unit, scale) in enumerate(zip(CAUSES, units, scales, strict=True)):
        inside = (off[:, k] < 1.96 * sure[:, k]).mean()
        print(
            f"{name:9s} worst {scale * off[:, k].max():8.4f} {unit:4s} rms {scale * rms[k]:8.4f}, "
            f"{score[k]:.2f} of what is said; inside 95 %: {inside:.0%}"
        )
    cost = (time.process_time() - started) / given.runs
    print(
        f"{given.runs} runs of {given.pictures} pictures: {wrong} wrong instructions; {cost:.1f} CPU s each"
    )


if __name__ == "__main__":
    main()
