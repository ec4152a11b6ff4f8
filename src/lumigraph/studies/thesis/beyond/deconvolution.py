"""A camera 2.0's main-lens image by deconvolution: its transfer beside basic and blended rendering."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure, RichardsonLucy, deconvolve
from lumigraph.design.plenoptic2 import rendered_cutoff
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.operators.periodic.incoherent import periodic_operator
from lumigraph.plots.curves import curves, images
from lumigraph.rendering import render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

PARTS = (0.1, 0.3, 0.42, 0.6, 0.75, 0.9, 1.1)
"""Frequencies over the main lens's cut-off; the rendered picture ends at 0.5 where m = 0.5."""

AMPLITUDE = 0.13
"""Amplitude of each frequency: all together stay below the mean."""

ELECTRONS = 9000.0
"""Electrons of an even scene in a pixel in the middle of a micro-image."""

_MAGNIFICATION = 0.5
_OVERSAMPLING = 1.25  # of the main-lens image above twice its cut-off


@dataclass(frozen=True, slots=True, eq=False)
class _Bench:
    """The camera, its operator, and the frequencies [1/m] in the object."""

    camera: FocusedPlenopticCamera
    operator: Any
    grid: Grid
    cutoff: float
    iterations: int

    @classmethod
    def of(cls, *, quick: bool) -> "_Bench":
        lenslets = 5 if quick else 9
        camera = FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050").replace(
            lenslets={"count": (lenslets, lenslets)}
        )
        cutoff = camera.pupil_diameter / (camera.wavelength * camera.object_distance)
        pitch = 1 / (2 * _OVERSAMPLING * cutoff)
        field = lenslets * camera.lenslets.pitch * camera.object_distance / camera.separation
        grid = Grid.square(math.ceil(1.15 * field / pitch), pitch)
        return cls(camera, periodic_operator(camera, grid), grid, cutoff, 12 if quick else 100)

    @property
    def frequencies(self) -> np.ndarray:
        return self.cutoff * np.array(PARTS)

    @property
    def optics(self) -> float:
        """Magnification of the main lens."""
        return self.camera.image_distance / self.camera.object_distance

    def scene(self, sign: float) -> np.ndarray:
        """Even light and a wave of each frequency along x, their phases spread."""
        phases = np.pi * np.arange(len(PARTS)) ** 2 / len(PARTS)  # Schroeder: no high peaks
        waves = np.cos(2 * np.pi * self.frequencies[:, None] * self.grid.x + phases[:, None]).sum(0)
        return np.ones((self.grid.shape[0], 1), np.float32) * (1 + sign * AMPLITUDE * waves).astype(
            np.float32
        )

    def raw(self, scene: np.ndarray, rng: np.random.Generator | None) -> np.ndarray:
        """Raw image in electrons, with photon noise where there are random numbers."""
        light = np.maximum(self.operator.forward(scene), 0)
        light = light * (ELECTRONS / np.percentile(self.operator.forward(np.ones_like(scene)), 90))
        return light.astype(np.float32) if rng is None else rng.poisson(light).astype(np.float32)

    def deconvolved(self, raw: np.ndarray, iterations: int) -> np.ndarray:
        return deconvolve(
            raw,
            self.operator,
            iterations,
            method=RichardsonLucy(accelerated=True),
            exposure=Exposure(gain=1.0),
        )

    def pictures(self, raw: np.ndarray) -> dict[str, tuple[np.ndarray, Grid]]:
        """Picture of a raw image by each method, and the grid of its samples in the object."""
        calibration, patch = self.camera.calibration, self.camera.patch
        image = RawImage(raw, self.camera.pixels.pixel_pitch)
        place = rendered_grid(calibration, patch)
        in_object = Grid(place.shape, (place.pitch[0] / self.optics, place.pitch[1] / self.optics))
        return {
            "basic": (np.asarray(render(image, calibration, patch)), in_object),
            "blended": (np.asarray(render(image, calibration, patch, blend=True)), in_object),
            "deconvolved": (self.deconvolved(raw, self.iterations), self.grid),
        }


def _main_transfer(part: np.ndarray) -> np.ndarray:
    """Incoherent transfer of a round pupil without aberrations at parts of its cut-off."""
    s = np.clip(part, 0, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))


def _spectrum(bench: _Bench, picture: np.ndarray, grid: Grid) -> np.ndarray:
    """Amplitude of each frequency of a picture (y, x), seen through a window over its middle."""
    field = bench.grid.size[0] / 1.15
    rows, columns = (np.abs(axis) < 0.3 * field for axis in (grid.y, grid.x))
    window = np.cos(np.pi * grid.x[columns] / (0.6 * field)) ** 2
    turns = np.exp(-2j * np.pi * bench.frequencies[:, None] * grid.x[columns])
    profile = picture[rows][:, columns].mean(0)
    return 2 * (turns @ (window * profile)) / window.sum()


def _transfer(bench: _Bench, pair: tuple[np.ndarray, np.ndarray], grid: Grid) -> np.ndarray:
    """Contrast of each frequency over the object's, from a scene and its complement, whose seams cancel."""
    one, other = (_spectrum(bench, picture, grid) for picture in pair)
    even = 0.5 * _mean(bench, pair[0] + pair[1], grid)
    return np.abs(one - other) / (2 * AMPLITUDE * even)


def _mean(bench: _Bench, picture: np.ndarray, grid: Grid) -> float:
    inside = [np.abs(axis) < 0.3 * bench.grid.size[0] / 1.15 for axis in (grid.y, grid.x)]
    return float(picture[np.ix_(*inside)].mean())


def _raw_modulation(bench: _Bench) -> np.ndarray:
    """Modulation on the sensor by each frequency, over the light: what there is to be deconvolved."""
    even = np.maximum(bench.operator.forward(np.ones(bench.grid.shape, np.float32)), 0)
    n = even.shape[0]
    inner = slice(n // 4, 3 * n // 4)
    kept, found = even[inner, inner], []
    for frequency in bench.frequencies:
        square = np.zeros(kept.shape)
        for wave in (np.cos, np.sin):
            scene = np.ones((bench.grid.shape[0], 1)) * wave(2 * np.pi * frequency * bench.grid.x)
            square += bench.operator.forward(scene.astype(np.float32))[inner, inner] ** 2
        found.append(math.sqrt(float((square / np.maximum(kept, 1e-4 * kept.max())).sum() / kept.sum())))
    return np.array(found)


@experiment(
    "deconvolution-2.0",
    "The main-lens image by deconvolution",
    question="Which frequencies does Richardson-Lucy bring back that rendering loses, and at what noise?",
    thesis="not in the thesis; its section 5.6 renders by patches",
    shows="Section 5.6 renders a grating by patches, and what lies above the lenslets' cut-off is lost; it "
    "deconvolves nothing.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Seven frequencies in one scene, from a tenth of the main lens's cut-off to beyond it, photon noise."""
    bench, rng = _Bench.of(quick=context.quick), np.random.default_rng(1)
    context.progress(0.2, "raw images")
    modulation = _raw_modulation(bench)
    context.progress(0.4, "deconvolution")
    seen = [bench.pictures(bench.raw(bench.scene(sign), rng)) for sign in (1, -1)]
    transfer = {
        name: _transfer(bench, (seen[0][name][0], seen[1][name][0]), seen[0][name][1]) for name in seen[0]
    }
    context.progress(0.7, "noise")
    noise = {} if context.quick else _noise(bench, rng)
    return ExperimentOutcome(
        tuple(_rows(bench, transfer, modulation, noise)),
        tuple(_figures(bench, transfer, modulation, noise, seen[0])),
        why="A lenslet passes what its part p of the pupil passes: p/(λa) = m p/(λb), half of the main "
        "lens's cut-off D/(λz1) at m = 0.5. Beyond, only light that is diffracted across the micro-images' "
        "borders still carries the object: a few per cent of the raw image's light, and less towards the "
        "main lens's cut-off. Deconvolution brings back what stands above the photon noise, and amplifies "
        "the noise by the inverse of that modulation. Above D/(λz1) nothing is in the raw image: what an "
        "estimate shows there comes from its non-negativity and its start, not from the object.",
    )


def _noise(bench: _Bench, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Amplitude of photon noise in each frequency of an even scene, over the light, of each picture."""
    even = np.ones(bench.grid.shape, np.float32)
    pair = [bench.pictures(bench.raw(even, rng)) for _ in range(2)]
    found = {}
    for name, (picture, grid) in pair[0].items():
        other, field = pair[1][name][0], bench.grid.size[0] / 1.15
        rows, columns = (np.abs(axis) < 0.3 * field for axis in (grid.y, grid.x))
        off = (picture - other)[rows][:, columns] / math.sqrt(2) / _mean(bench, picture, grid)
        window = np.cos(np.pi * grid.x[columns] / (0.6 * field)) ** 2
        turns = np.exp(-2j * np.pi * bench.frequencies[:, None] * grid.x[columns])
        lines = 2 * np.abs(turns @ (window[:, None] * off.T)) / window.sum()
        independent = off.shape[0] * grid.pitch[0] * 2 * bench.cutoff  # rows of the main-lens image
        found[name] = np.sqrt((lines**2).mean(1) / independent)
    return found


def _rows(
    bench: _Bench,
    transfer: dict[str, np.ndarray],
    modulation: np.ndarray,
    noise: dict[str, np.ndarray],
) -> list[ResultRow]:
    camera, rows = bench.camera, []
    rendered = rendered_cutoff(
        camera.wavelength, camera.lenslets.pitch, _MAGNIFICATION, camera.lenslet_distance
    )
    rows.append(ResultRow("cut-off of the main lens D/(λz1)", bench.cutoff, "1/m"))
    rows.append(ResultRow("cut-off of rendering m p/(λb), in the object", rendered * bench.optics, "1/m"))
    for k, part in enumerate(PARTS):
        told = f"at {part:g} of the main lens's cut-off"
        rows.append(
            ResultRow(
                f"modulation of the raw image {told}",
                modulation[k],
                "",
                None,
                *_expected(part),
                "waves" if part > 1 else "told",
            )
        )
        rows += [ResultRow(f"contrast, {name}, {told}", values[k]) for name, values in transfer.items()]
        if noise:
            gain = noise["deconvolved"][k] / noise["blended"][k]
            rows.append(ResultRow(f"noise, deconvolved over blended, {told}", gain))
    low, lost = PARTS.index(0.42), PARTS.index(1.1)
    gain = transfer["deconvolved"][low] / transfer["blended"][low]
    rows.append(
        ResultRow(
            "contrast, deconvolved over blended, at 0.42", gain, "", None, 1.5, (0.0, math.inf), kind="told"
        )
    )
    rows.append(
        ResultRow(
            "contrast, deconvolved, above every cut-off",
            transfer["deconvolved"][lost],
            "",
            None,
            0.0,
            0.03,
            "nothing but noise",
        )
    )
    return rows


def _expected(part: float) -> tuple[float | None, float | None, str]:
    if part > 1:
        return 0.0, 2e-3, "absent from the raw image; the operator is exact to 1e-3"
    if part > 0.5:
        return 0.025, 0.024, "only by light across the micro-images' borders"
    return None, None, ""


def _figures(
    bench: _Bench,
    transfer: dict[str, np.ndarray],
    modulation: np.ndarray,
    noise: dict[str, np.ndarray],
    seen: dict[str, tuple[np.ndarray, Grid]],
) -> list[tuple[object, str]]:
    frequencies = bench.frequencies * 1e-3
    fine = np.linspace(0, 1.15, 60)
    lines = {
        "main lens": (fine * bench.cutoff * 1e-3, _main_transfer(fine)),
        "raw image": (frequencies, modulation),
        **{name: (frequencies, values) for name, values in transfer.items()},
    }
    noisy = {name: (frequencies, values) for name, values in noise.items()}
    half = 0.3 * bench.grid.size[0] / 1.15
    panels = [("scene", bench.scene(1)[_inside(bench.grid, half)])]
    panels += [(name, picture[_inside(grid, half)]) for name, (picture, grid) in seen.items()]
    label = "frequency in the object [1/mm]"
    figures: list[tuple[object, str]] = [
        (curves([], lines, xlabel=label, ylabel="contrast"),
         "Contrast over the object's, one noisy raw image; the raw image's own modulation."),
        (images([(image, name) for name, image in panels], columns=2),
         "Seven frequencies together: the scene, and what is made of its raw image."),
    ]  # fmt: skip
    if noise:
        caption = "Photon noise in each frequency, over the even light."
        figures.append((curves([], noisy, xlabel=label, ylabel="noise over light"), caption))
    return figures


def _inside(grid: Grid, half: float) -> tuple[np.ndarray, ...]:
    rows, columns = (np.flatnonzero(np.abs(axis) < half) for axis in (grid.y, grid.x))
    return np.ix_(rows, columns)
