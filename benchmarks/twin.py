"""A simulated bench that is out of place: how exactly `lg.metrology.twin` says so, and whether it is ever wrong.

``python -m benchmarks.twin [--runs 5] [--pictures 1] [--lenslets 41] [--seed 0] [--pitch 0]`` draws ±1 degree
of tilt about both axes, ±0.3 mm of height, ±30 µm of shift, ±5 mrad of turn and ±5 % of aperture at once,
exposes white images with noise, and compares what is found. An instruction is wrong if its sign is, or if the
truth is farther from it than three standard deviations and a tenth of the value.

The bench is not the twin's: its white image is that of a camera file whose array leans, made lenslet by
lenslet (`[built]`), not the twin's image moved from place to place. A leaning array looks shorter by its
cosine, which camera files leave out, so it is drawn in afterwards. ``--pitch 5e-4`` makes the lenslets' pitch
wrong by up to that part, which the twin is told as its `pitch_error`; ``--untold`` does not tell it, and
``--claimed 1e-5`` tells it that instead.
"""

import argparse
import math
import time

import numpy as np
from scipy.ndimage import map_coordinates

import lumigraph as lg
from lumigraph.metrology.twin import CAUSES, SURE

ACCURACY = 5e-4
"""Of the bench's white images; the twin's own are at twice of it."""


def camera(count):
    """A bench of count x count lenslets."""
    return lg.PlenopticCamera(
        wavelength=550e-9,
        object_distance="240 mm",
        main_lens={"focal_length": "120 mm", "diameter": "3.2 mm"},
        lenslets={"pitch": "150 um", "focal_length": "10 mm", "count": (count, count)},
        sensor={"pixel_pitch": "8 um", "black_level": 64},
    )


def stood(meant, true, pitch):
    """The white image of a camera that stands as `CAUSES` say, with lenslets farther apart by a part."""
    height, *tilt, shift_y, shift_x, turn, aperture = (float(one) for one in true)
    bench = meant.replace(
        lenslets={
            "pitch": meant.lenslets.pitch * (1 + pitch), "rotation": turn, "offset": (-shift_y, -shift_x)
        },
        main_lens={"diameter": meant.pupil_diameter * (1 + aperture)},
        sensor={"shape": meant.sensor.shape},
        built={
            "separation": meant.separation - height, "lenslet_distance": meant.lenslet_distance + height,
            "array_tilt": tuple(tilt),
        },
    )  # fmt: skip
    light = np.asarray(lg.simulate(bench, lg.targets.white(), lg.Incoherent(ACCURACY)).data, float)
    return np.maximum(shorter(light, tilt), 0)


def shorter(image, tilt):
    """An image drawn in along a tilt, by its cosine."""
    angle, middle = math.hypot(*tilt), [n // 2 for n in image.shape]
    way = np.array(tilt) / angle
    places = np.stack(
        np.meshgrid(*(np.arange(n) - m for n, m in zip(image.shape, middle, strict=True)), indexing="ij")
    )
    along = np.tensordot(way, places, 1) * (1 / math.cos(angle) - 1)
    back = [one + part * along + m for one, part, m in zip(places, way, middle, strict=True)]
    return map_coordinates(image, back, order=5, mode="nearest")


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--pictures", type=int, default=1)
    parser.add_argument("--lenslets", type=int, default=41)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pitch", type=float, default=0.0)
    parser.add_argument("--untold", action="store_true")
    parser.add_argument("--claimed", type=float)
    given = parser.parse_args()
    rng, bench = np.random.default_rng(given.seed), lg.metrology.BenchModel(camera(given.lenslets))
    sensor, off, sure, wrong, started = bench.camera.sensor, [], [], 0, time.process_time()
    for _ in range(given.runs):
        tilt, shift = np.radians(rng.uniform(-1, 1, 2)), rng.uniform(-30e-6, 30e-6, 2)
        alone = (rng.uniform(-0.3e-3, 0.3e-3), rng.uniform(-5e-3, 5e-3), rng.uniform(-0.05, 0.05))
        true = np.array([alone[0], *tilt, *shift, alone[1], alone[2]])
        pitch = given.pitch * rng.uniform(-1, 1)
        light = stood(bench.camera, true, pitch)
        raws = [sensor.expose(light, fill=0.8, rng=rng) for _ in range(given.pictures)]
        known = None if given.untold else given.claimed or max(1e-5, given.pitch / math.sqrt(3))
        dark = sensor.expose(0 * light, reference=1, rng=rng)
        found = lg.metrology.twin(raws, bench, dark=dark, pitch_error=known)
        off.append(found.values - true)
        sure.append(found.errors)
        told = np.abs(found.values) > SURE * found.errors
        far = np.abs(off[-1]) > SURE * found.errors + 0.1 * np.abs(found.values)
        bad = told & (far | (found.values * true < 0))
        wrong += int(bad.sum())
        named = [name for name, one in zip(CAUSES, bad, strict=True) if one]
        print(
            f"{int(told.sum())} instructions, wrong: {named or 'none'}; misfit {found.misfit:.1g}", flush=True
        )
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
