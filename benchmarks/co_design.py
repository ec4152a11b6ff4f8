"""Cameras and linear reconstruction trained together, at equal photons: ``python -m benchmarks.co_design``.

Scenes stand at a depth that the reconstruction does not know. The best camera of the thesis' family is found
on a grid; cameras without lenslets have a stop of several widths, terms of a phase mask that are searched
with three seeds, a diffuser, or a coded aperture. Held-out pictures are drawn with noise and reconstructed,
and the Cramér-Rao bound of a point's depth stands beside.
"""

import itertools
import time
import warnings

import numpy as np

import lumigraph as lg
from lumigraph.studies.information import (
    Light,
    Scenes,
    bounds,
    reconstruction_error,
    unknown_depth,
    unknown_depth_trials,
)
from lumigraph.studies.optimisation import Goal

DEPTHS = (-6e-3, 0.0, 6e-3)
SCENES = Scenes(40e-6, 12)
LIGHT = Light(3000)
LENS = {"diameter": "3 mm"}
PIXELS = {"pixel_pitch": "10 um"}
SEEDS = (0, 1, 2)
TERMS = (4, 7, 8, 9, 10, 11)
RANGE = "-0.3:0.3"
STOPS = ("1.5 mm", "2 mm", "3 mm")


def family() -> dict[str, lg.FocusedPlenopticCamera]:
    """Cameras of the thesis' family, of one main lens and sensor."""
    found = {}
    focused = lg.load_camera("thesis-plenoptic-2-m050")
    for m, pitch, stop in itertools.product((0.25, 0.5, 1.0), ("100 um", "150 um"), STOPS):
        found[f"2.0, m = {m}, {pitch}, stop {stop}"] = focused.replace(
            main_lens={"diameter": stop}, sensor={**PIXELS, "shape": None},
            lenslets={"magnification": m, "pitch": pitch, "count": (25, 25)},
        )  # fmt: skip
    plain = lg.load_camera("thesis-plenoptic-1")
    for stop in STOPS:
        found[f"1.0, stop {stop}"] = plain.replace(
            main_lens={"diameter": stop}, sensor={**PIXELS, "shape": None}, lenslets={"count": (25, 25)}
        )
    return found


def without_lenslets(**lens: object) -> lg.SingleLensCamera:
    """The same main lens and pixels without lenslets."""
    table = {"focal_length": "60 mm", **LENS, **lens}
    return lg.SingleLensCamera(
        wavelength="633 nm", object_distance="120 mm", main_lens=table, sensor={**PIXELS, "shape": (81, 81)}
    )


def masks() -> dict[str, lg.SingleLensCamera]:
    """Diffusers and coded apertures of one seed, which nobody searched."""
    rng = np.random.default_rng(0)
    rough = (0.3 * rng.standard_normal((8, 8))).tolist()
    coded = (rng.random((7, 7)) < 0.5).astype(float).tolist()
    return {
        "diffuser, 8 x 8, 0.3 waves": without_lenslets(mask={"phase": rough}),
        "coded aperture, 7 x 7": without_lenslets(mask={"open": coded}),
    }


def error(camera: lg.instruments.Camera) -> float:
    """Expected error of a rule for all depths; NaN of a camera that the scenes do not fit."""
    try:
        return unknown_depth(camera, DEPTHS, SCENES, LIGHT).value
    except lg.LumigraphError as problem:
        print("   ", problem)
        return float("nan")


def searched(seed: int) -> tuple[lg.instruments.Camera, float]:
    """Terms of a phase mask that leave least."""
    vary = {f"main_lens.aberrations.{j}": f"{RANGE}:x1" for j in TERMS}
    vary["main_lens.diameter"] = "1.5 mm:3 mm:x1"
    start = without_lenslets(aberrations=dict.fromkeys(TERMS, 0.0))
    goal = Goal("reconstruction", False, DEPTHS, LIGHT, None, SCENES)
    found = lg.optimise(start, vary, goal=goal, search="global", evaluations=60, seed=seed)
    return found.camera, found.best["reconstruction"]


def told(name: str, camera: lg.instruments.Camera, squares: list[np.ndarray]) -> None:
    """Print a row of the table."""
    began = time.process_time()
    rule = unknown_depth(camera, DEPTHS, SCENES, LIGHT)
    known = reconstruction_error(camera, DEPTHS, SCENES, LIGHT).value
    whole = reconstruction_error(camera, DEPTHS, SCENES, LIGHT, volume=True).value
    trials = unknown_depth_trials(
        camera, DEPTHS, SCENES, LIGHT, draws=squares * len(SEEDS), rng=np.random.default_rng(0)
    )
    held = np.sqrt(np.mean(trials.errors.reshape(len(SEEDS), -1) ** 2, axis=1))
    depth = bounds(camera, DEPTHS, Light(20_000))
    print(
        f"| {name} | {rule.value:.3f} | {' '.join(f'{one:.3f}' for one in rule.errors)} | {known:.3f} | "
        f"{whole:.3f} | {' '.join(f'{one:.3f}' for one in held)} | {depth.depth * 1e6:.1f} | "
        f"{time.process_time() - began:.0f} |",
        flush=True,
    )


def main() -> None:
    """Print all cameras' errors, then the table of the best."""
    from skimage import data

    warnings.simplefilter("ignore")
    began, cameras = time.process_time(), family()
    errors = {name: error(one) for name, one in cameras.items()}
    for name, value in errors.items():
        print(f"{name}: {value:.3f}", flush=True)
    best = min(errors, key=lambda name: np.nan_to_num(errors[name], nan=9.0))
    print(f"family: {time.process_time() - began:.0f} CPU s", flush=True)
    pictures = [
        one[::6, ::6] / 255 for one in (data.camera(), data.coins(), data.moon(), data.page()[:, :190])
    ]
    squares = SCENES.squares(pictures, 16)
    print(
        "| camera | unknown depth | at each | known depth | all depths at once | held out | depth [um] | s |"
    )
    told(f"best of the family: {best}", cameras[best], squares)
    for stop in STOPS:
        told(f"no lenslets, stop {stop}", without_lenslets(diameter=stop), squares)
    for name, camera in masks().items():
        told(name, camera, squares)
    for seed in SEEDS:
        began = time.process_time()
        camera, value = searched(seed)
        print(seed, f"{value:.3f}", f"{time.process_time() - began:.0f} CPU s", camera.main_lens.aberrations)
        told(f"phase mask, seed {seed}", camera, squares)


if __name__ == "__main__":
    main()
