"""Expected errors of reconstructed scenes beside what reconstructions reach in drawn noise.

    python -m benchmarks.picture_errors

prints a table: cameras 1.0 and 2.0 and one without lenslets, of the same main lens, before the same scenes.
"""

import time
from typing import Any

import numpy as np

import lumigraph as lg
from lumigraph.deconvolution import Exposure, RichardsonLucy
from lumigraph.studies.information import Light, Scenes, reconstruction_error, reconstruction_trials
from lumigraph.studies.information.bounds import reading
from lumigraph.studies.information.imaging import SceneImaging, imaging

SCENES = Scenes(30e-6, 24)
PHOTONS, DRAWS, DEPTHS = 3000, 6, (0.0, 4e-3)
COUNTS = (10, 40, 160)
"""Iterations of deconvolutions, the best of which counts."""


def cameras() -> dict[str, Any]:
    """Of one main lens, by name."""
    focused: Any = lg.load_camera("thesis-plenoptic-2-m050")
    lens = {"focal_length": "60 mm", "diameter": focused.pupil_diameter}
    common: dict[str, Any] = {
        "wavelength": focused.wavelength,
        "object_distance": focused.object_distance,
        "main_lens": lens,
    }
    pixels: Any = {"pixel_pitch": "6.6668 um", "shape": (401, 401)}
    return {
        "without lenslets, 6.7 µm pixels": lg.SingleLensCamera(**common, sensor=pixels),
        "2.0, m = 0.5, 6.7 µm pixels": focused.replace(sensor={"pixel_pitch": "6.6668 um", "shape": None}),
        "2.0, m = 0.25, 6.7 µm pixels": focused.replace(
            lenslets={"magnification": 0.25}, sensor={"pixel_pitch": "6.6668 um", "shape": None}
        ),
    }


def deconvolved(seen: SceneImaging, raw: np.ndarray, scene: np.ndarray) -> float:
    """Error of Richardson and Lucy's best iteration, over the contrast."""
    light = float(seen.light[0])
    more = seen.noise**2 - seen.mean  # reading counts as so many electrons, known in the mean
    background = (seen.mean - seen.electrons(np.ones_like(scene)) + more) / light
    exposure, method = Exposure(background=background), RichardsonLucy()
    seen_as = np.maximum(raw + more, 0) / light
    found = (lg.deconvolve(seen_as, seen.operator, n, method=method, exposure=exposure) for n in COUNTS)
    return min(_error(np.asarray(one)[0], seen.across, scene[0]) for one in found)


def _error(estimate: np.ndarray, across: tuple[np.ndarray, np.ndarray], scene: np.ndarray) -> float:
    """Of an object on the operator's samples, seen at those of the scene."""
    y, x = (np.linalg.pinv(one) for one in across)
    off = y @ estimate @ x.T - scene
    return float(off.std()) / SCENES.contrast


def main() -> None:
    """Print the table."""
    names = "camera", "depth", "expected", "linear", "Richardson-Lucy", "CPU s"
    print("{:34s} {:>6s} {:>9s} {:>16s} {:>16s} {:>6s}".format(*names))
    for name, camera in cameras().items():
        for dz in DEPTHS:
            rng, began = np.random.default_rng(1), time.process_time()
            found = reconstruction_error(camera, [dz], SCENES, Light(PHOTONS))
            took = time.process_time() - began
            linear = reconstruction_trials(camera, [dz], SCENES, Light(PHOTONS), draws=DRAWS, rng=rng)
            seen, rows = imaging(camera, np.array([dz]), SCENES, Light(PHOTONS), 1e-2), []
            for _ in range(2):
                scene = SCENES.drawn(rng)[None]
                mean = np.maximum(seen.electrons(scene) + seen.mean - seen.electrons(np.ones_like(scene)), 0)
                raw = rng.poisson(mean) + rng.normal(0, reading(camera.sensor), mean.shape)
                rows.append(deconvolved(seen, raw, scene))
            print(
                f"{name:34s} {dz * 1e3:4.0f}mm {found.value:9.4f} {linear.rms:8.4f} ± {linear.rms_error:.4f} "
                f"{np.mean(rows):16.4f} {took:6.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
