"""Shifts of a scan found from its raw images: `python -m benchmarks.found_shifts [pulls|chart]`.

A stage is told to move by even parts of a lenslet and is off by up to 0.2 lenslets each time. `pulls` draws
objects, places and noise again and again: errors over the standard deviations that are told. `chart` has
slanted lines in the middle of discs, found with the true, the found and the told shifts.
"""

import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import lumigraph as lg
from benchmarks import scanned
from lumigraph.deconvolution import RichardsonLucy, Stop

SIZE, SAMPLES, CANVAS, OFF = scanned.SIZE, 24, 512, 0.2
FIRST = 1000
"""Draws are counted from it: those below served to set `shifts.MARGIN`."""

Draw = Callable[[np.random.Generator], np.ndarray]
FY = np.fft.fftfreq(CANVAS, 1 / SAMPLES)[:, None]
FX = np.fft.rfftfreq(CANVAS, 1 / SAMPLES)[None]
AT = (np.arange(CANVAS) - CANVAS // 2) / SAMPLES


def filtered(rng: np.random.Generator, by: np.ndarray) -> np.ndarray:
    """A random picture of a spectrum, 0.15 rms about 0.5."""
    waves = np.fft.rfft2(rng.standard_normal((CANVAS, CANVAS))) * by
    waves[0, 0] = 0
    picture = np.fft.irfft2(waves, (CANVAS, CANVAS))
    return np.clip(0.5 + 0.15 * picture / picture.std(), 0, None)


def power(steepness: float) -> Draw:
    """Textures whose amplitude falls with this power of the frequency."""
    return lambda rng: filtered(rng, (1 + 16 * (FY**2 + FX**2)) ** (-steepness / 2))


def blobs(rng: np.random.Generator) -> np.ndarray:
    """Smooth ones."""
    return filtered(rng, np.exp(-2 * (np.pi * 0.35) ** 2 * (FY**2 + FX**2)))


def discs(rng: np.random.Generator) -> np.ndarray:
    """Sharp ones, 0.3 to 1.4 lenslets wide, that overlap."""
    picture = np.full((CANVAS, CANVAS), 0.1)
    for y, x, radius, light in zip(
        *rng.uniform(AT[0], AT[-1], (2, 250)), rng.uniform(0.15, 0.7, 250), rng.uniform(0.08, 0.4, 250),
        strict=True,
    ):  # fmt: skip
        far = np.hypot(*(np.abs((AT[:, None] - y, AT - x)[k]) for k in (0, 1)))
        picture += light * np.clip((radius - far) * SAMPLES / 2 + 0.5, 0, 1)
    return picture


def squares(rng: np.random.Generator) -> np.ndarray:
    """Black and white ones, a quarter of a lenslet wide, as of a code."""
    n = SAMPLES // 4
    dark = rng.random((CANVAS // n + 1,) * 2) < 0.35
    return 0.1 + 0.8 * np.kron(dark, np.ones((n, n)))[:CANVAS, :CANVAS]


KINDS: dict[str, Draw] = {
    "power 1": power(1), "power 1.5": power(1.5), "power 2.5": power(2.5), "blobs": blobs, "discs": discs,
    "squares": squares,
}  # fmt: skip


@dataclass
class Stage:
    """A camera before an object that is moved."""

    camera: lg.PlenopticCamera

    def __post_init__(self) -> None:
        own = self.camera.operator_grid(SAMPLES)
        height, width = (n + 4 * SAMPLES for n in own.shape)  # the object goes on beyond the lenslets
        self.grid = lg.Grid((height, width), own.pitch, own.center)
        self.operator = self.camera.operator_on(self.grid)

    def seen(
        self, picture: np.ndarray, shifts: np.ndarray, photons: float, rng: np.random.Generator
    ) -> list[lg.RawImage]:
        """Raw images of a picture that was moved by shifts (k, 2) [lenslets], of `photons` in all."""
        waves, lights = np.fft.rfft2(picture), []
        rows, columns = (slice((CANVAS - n) // 2, (CANVAS - n) // 2 + n) for n in self.grid.shape)
        for y, x in shifts:
            moved = np.fft.irfft2(waves * np.exp(-2j * np.pi * (FY * y + FX * x)), picture.shape)
            lights.append(np.maximum(self.operator.forward(moved[rows, columns].astype(np.float32)), 0))
        expose = self.camera.sensor.expose
        return [expose(light, photons=photons / len(shifts), rng=rng) for light in lights]


def off(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Where the stage goes (k, 2) [lenslets]."""
    told = lg.scan(steps, 1.0)
    return told + rng.uniform(-OFF, OFF, told.shape)


def pulls(
    stage: Stage, draw: Draw, steps: int, runs: int, photons: float, first: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Errors [lenslets], and over what is told of them, (runs, k - 1, 2)."""
    errors, over = [], []
    for seed in range(first, first + runs):
        rng = np.random.default_rng(seed)
        picture, true = draw(rng), off(steps, rng)
        raws = stage.seen(picture, true, photons, rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", lg.errors.SamplingWarning)
            found = lg.find_shifts(raws, stage.camera, lg.scan(steps, SIZE))
        moved = (found.shifts - found.shifts[0]) / SIZE - (true - true[0])
        errors.append(moved[1:])
        over.append(moved[1:] / (found.errors[1:] / SIZE))
    return np.array(errors), np.array(over)


def show_pulls(runs: int) -> None:
    """Print a table."""
    stage = Stage(scanned.CAMERA)
    print("object       raw images   photons   error [lenslets]   pull rms   CPU s a run")
    for steps, photons, some in ((2, 4500.0, runs), (2, 500.0, runs // 2), (3, 4500.0, runs // 2)):
        for name, draw in KINDS.items():
            began = time.process_time()
            errors, over = pulls(stage, draw, steps, some, photons, FIRST)
            cost = (time.process_time() - began) / some
            told = [float(np.sqrt(np.mean(one**2))) for one in (errors, over)]
            print(
                f"{name:12s} {steps} x {steps}        {photons:7.0f}   {told[0]:16.4f}   {told[1]:8.2f}   "
                f"{cost:11.1f}", flush=True,
            )  # fmt: skip


def lines_in_discs(frequency: float, rng: np.random.Generator) -> np.ndarray:
    """Slanted lines, as `scanned.lines` has them, in 4.5 x 6.5 lenslets amid discs."""
    phase = 2 * np.pi * frequency * (AT + scanned.SLANT * AT[:, None])
    inner = (np.abs(AT)[:, None] < 2.25) & (np.abs(AT) < 3.25)
    return np.where(inner, 0.5 + 0.5 * np.cos(phase), discs(rng))


def show_chart(frequencies: tuple[float, ...] = (0.4, 0.5, 0.75, 0.9, 1.1)) -> None:
    """Print a table."""
    stage = Stage(scanned.CAMERA.replace(lenslets={"count": (9, 11)}))
    told = lg.scan(3, SIZE)
    print(
        "periods to a lenslet   one raw image   true   found   told     found off by, told off by [lenslets]"
    )
    for frequency in frequencies:
        rng = np.random.default_rng(1)
        picture, true = lines_in_discs(frequency, rng), off(3, rng)
        raws = stage.seen(picture, true, scanned.PHOTONS, rng)
        single = stage.seen(picture, np.zeros((1, 2)), scanned.PHOTONS, rng)
        found = lg.find_shifts(raws, stage.camera, told).shifts
        where = [found[0] - true[0] * SIZE + true * SIZE, found, told]
        row = [contrast(stage, single, np.zeros((1, 2)), frequency)]
        row += [contrast(stage, raws, shifts, frequency) for shifts in where]
        far = [float(np.sqrt(np.mean((one - where[0])[1:] ** 2))) / SIZE for one in where[1:]]
        print(
            f"{frequency:20.2f} {row[0]:15.2f} {row[1]:6.2f} {row[2]:7.2f} {row[3]:6.2f}     "
            f"{far[0]:.3f}, {far[1]:.3f}", flush=True,
        )  # fmt: skip


def contrast(stage: Stage, raws: list[lg.RawImage], shifts: np.ndarray, frequency: float) -> float:
    """Of the lines found, at any phase: all shifts together are not known."""
    operator = lg.joint_operator(stage.camera, None, scanned.SAMPLES, shifts=shifts, accuracy=1e-2)
    method = RichardsonLucy(accelerated=True)
    picture = lg.deconvolve(raws, operator, Stop(40, deviance=1), method=method)
    grid = operator.object_grid
    assert grid is not None
    phase, _ = scanned.lines(grid, frequency)
    inner = (np.abs(grid.y)[:, None] < 1.75 * SIZE) & (np.abs(grid.x) < 2.75 * SIZE)
    waves = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])[:, inner]
    level, *both = np.linalg.lstsq(waves.T, np.asarray(picture.data)[inner], rcond=None)[0]
    return float(np.hypot(*both) / level)


if __name__ == "__main__":
    words = sys.argv[1:]
    if words[:1] != ["chart"]:
        show_pulls(int(words[1]) if len(words) > 1 else 40)
    if words[:1] != ["pulls"]:
        show_chart()
