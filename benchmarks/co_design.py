"""Cameras and linear reconstruction trained together, at equal photons: ``python -m benchmarks.co_design``.

Scenes stand at a depth that the reconstruction does not know. The best camera of the thesis' family is found
on a grid; cameras without lenslets have a stop of several widths, a diffuser, a coded aperture, or a stop and
a free phase in it that are trained with three seeds through `lg.torch.Camera` and the best linear rule.
Held-out pictures are drawn with noise and reconstructed, and the Cramér-Rao bound of a point's depth stands
beside.
"""

import itertools
import time
import warnings

import numpy as np
import torch

import lumigraph as lg
from lumigraph.studies.information import (
    Light,
    Scenes,
    bounds,
    reconstruction_error,
    unknown_depth,
    unknown_depth_trials,
)
from lumigraph.studies.information.imaging import waves_between
from lumigraph.studies.information.scenes import coloured

DEPTHS = (-6e-3, 0.0, 6e-3)
SCENES = Scenes(40e-6, 12)
LIGHT = Light(3000)
LENS = {"diameter": "3 mm"}
PIXELS = {"pixel_pitch": "10 um"}
SEEDS = (0, 1, 2)
STOPS = ("1.5 mm", "1.8 mm", "2 mm", "3 mm")
MASK, ROUGH = 6, 0.15
"""Control points across the free phase, and how rough it begins [waves]."""
STEPS = 30
GRID = lg.Grid.square(48, 10e-6)


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


class Rule:
    """Error that the best linear rule for all depths leaves, through PyTorch; see `unknown_depth`."""

    def __init__(self, camera: lg.SingleLensCamera) -> None:
        n = SCENES.samples
        across = waves_between(GRID.y, SCENES)
        colour = coloured(np.eye(n * n).reshape(-1, n, n), SCENES.power)
        scenes = np.concatenate([colour, np.ones((1, n, n))])
        self.scenes = torch.as_tensor(across @ scenes @ across.T)[:, None]
        self.colour = torch.as_tensor(colour.reshape(n * n, -1))
        self.electrons = camera.sensor.quantum_efficiency * LIGHT.photons * n * n
        self.read = camera.sensor.read_noise**2 + camera.sensor.gain**2 / 12

    def errors(self, model: lg.torch.Camera) -> torch.Tensor:
        """Mean squares at each depth, over the scenes' own."""
        waves, means, n2 = [], [], len(self.colour)
        for dz in DEPTHS:
            model.depths = [dz]
            raw = model(self.scenes).flatten(1)
            raw = raw * self.electrons / raw[-1].sum()
            waves.append(raw[:-1].T)
            means.append(raw[-1].clamp(min=0))
        mean = torch.stack(means).mean(0)
        noise = mean + self.read
        held = torch.cat([*waves, (torch.stack(means) - mean).T], 1) / len(DEPTHS) ** 0.5
        over = held / noise[:, None]
        inner = torch.eye(held.shape[1], dtype=held.dtype) + held.T @ over
        seen = torch.stack(waves).mean(0) / noise[:, None]
        rule = self.colour @ (seen - over @ torch.linalg.solve(inner, held.T @ seen)).T
        found = []
        for dark, light in zip(means, waves, strict=True):
            left, beside = rule @ light - self.colour, (rule @ (dark - mean))[:, None]
            noisy = rule * (dark + self.read) ** 0.5
            found.append(sum((one**2).sum() - (one.sum(0) ** 2).sum() / n2 for one in (left, beside, noisy)))
        return torch.stack(found) / (SCENES.contrast**2 * n2)


def trained(seed: int) -> lg.instruments.Camera:
    """Stop and phase in it that a training from a rough phase ends with."""
    phase = ROUGH * np.random.default_rng(seed).standard_normal((MASK, MASK))
    camera = without_lenslets(diameter="2.2 mm", mask={"phase": phase.tolist()})
    camera = camera.replace(sensor={"shape": (65, 65)})
    keys = {"main_lens.diameter": "1.2 mm:4 mm", "main_lens.mask.phase": ""}
    model, rule = lg.torch.Camera(camera, keys, grid=GRID, accuracy=1e-2), Rule(camera)
    rates = [{"params": [model.parts], "lr": 0.02}, {"params": model.mask.parameters(), "lr": 0.05}]
    optimiser = torch.optim.Adam(rates)
    for _ in range(STEPS):
        optimiser.zero_grad()
        rule.errors(model).mean().backward()
        optimiser.step()
    return model.camera.replace(sensor={"shape": (81, 81)})


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
        camera = trained(seed)
        print(f"seed {seed}: {time.process_time() - began:.0f} CPU s", camera.main_lens.diameter, flush=True)
        told(f"trained stop and phase, seed {seed}", camera, squares)


if __name__ == "__main__":
    main()
