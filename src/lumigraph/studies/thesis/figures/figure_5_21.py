"""Figures 5.21 to 5.28: a grating of five frequencies behind three magnifications."""

import math

import numpy as np

from lumigraph.analysis import contrast
from lumigraph.core.grid import Grid
from lumigraph.core.raw import RawImage
from lumigraph.design.plenoptic2 import rendered_cutoff
from lumigraph.plots.curves import curves, images
from lumigraph.rendering import low_pass, render
from lumigraph.rendering.focused import rendered_grid
from lumigraph.scene.targets import THESIS_FREQUENCIES
from lumigraph.studies.thesis.figures.periodic import LinedCamera, line_spread
from lumigraph.studies.thesis.figures.point_images import MAGNIFICATIONS, camera
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

FILTER = 1.162e4
"""Standard deviation of the thesis' Gaussian low-pass [1/m]."""

_SAMPLES = 21  # of the picture per lenslet


@experiment(
    "figure-5.21",
    "A grating of five frequencies",
    question="Which of five frequencies does the rendered picture keep, at m = 0.5, 0.3 and 0.25?",
    thesis="Figures 5.20 to 5.28, Table 5.5, section 5.6",
    shows="A grating of five frequencies, raw, behind the main lens, rendered and low-passed: high ones are "
    "lost, more at low magnification.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Exact incoherent images by the lenslets' periodicity; contrasts from a grating and its complement.

    The mean of both is the seams' own brightness, their difference the grating alone: near 8000 /m, where
    the seams repeat at m = 0.25, one picture would not tell them apart.
    """
    rows: list[ResultRow] = []
    figures = []
    for number, m in enumerate(MAGNIFICATIONS):
        context.progress(number / 3, f"grating, m = {m:g}")
        lined = LinedCamera.of(camera(m, 39), samples=21 if context.quick else 45)
        gratings = [_Grating(lined, f, 21 if context.quick else 39) for f in THESIS_FREQUENCIES]
        rows += _rows(gratings, m)
        figures += _figures(gratings, m)
    return ExperimentOutcome(
        tuple(rows),
        tuple(figures),
        why="At m = 0.25 the second frequency is below the cut-off of 9117 /m: it is weak, not gone as the "
        "thesis says of its 6300 /m.",
    )


class _Grating:
    """One frequency: raw image, rendered picture and main-lens image of 0.5 ± 0.5 cos(2πfx)."""

    def __init__(self, lined: LinedCamera, frequency: float, lenslets: int) -> None:
        self.frequency = frequency
        self.raw, self.picture, self.grid = self._seen(lined, lenslets, 0.5)
        complement = self._seen(lined, lenslets, -0.5)[1]
        self.even = (self.picture + complement) / 2
        self.wave = (self.picture - complement) / 2 / self.even.mean()
        self.main = self._main_lens(lined)

    def _seen(self, lined: LinedCamera, lenslets: int, amplitude: float) -> tuple[RawImage, np.ndarray, Grid]:
        def profile(x: np.ndarray) -> np.ndarray:
            return 0.5 + amplitude * np.cos(2 * math.pi * self.frequency * x)

        raw = lined.raw(profile, lenslets, rows=3)
        calibration = lined.calibration(raw)
        grid = rendered_grid(calibration, lined.patch, _SAMPLES)
        return raw, render(raw, calibration, lined.patch, samples=_SAMPLES).mean(0), grid

    def _main_lens(self, lined: LinedCamera) -> np.ndarray:
        """Main-lens image at the picture's places: magnification 1, so frequencies stay."""
        x, camera = (np.arange(1201) - 600) * 2e-6, lined.camera
        spread = line_spread(camera, x, camera.image_distance)
        passed = float(spread @ np.cos(2 * math.pi * self.frequency * x))
        return 0.5 + 0.5 * passed * np.cos(2 * math.pi * self.frequency * self.grid.x)

    @property
    def rendered_contrast(self) -> float:
        return contrast(1 + self.wave, self.frequency, self.grid.pitch[1])

    @property
    def main_contrast(self) -> float:
        return contrast(self.main, self.frequency, self.grid.pitch[1])

    @property
    def filtered(self) -> np.ndarray:
        return low_pass(self.picture, self.grid.pitch[1], FILTER)

    @property
    def filtered_contrast(self) -> float:
        return contrast(
            1 + low_pass(self.wave, self.grid.pitch[1], FILTER), self.frequency, self.grid.pitch[1]
        )


def _ideal(frequency: float, m: float) -> tuple[float, float]:
    """MTF of the main lens and of a lenslet, both round and ideal, at a frequency of the main-lens image."""
    found = camera(m, 3)
    tile = rendered_cutoff(found.wavelength, found.lenslets.pitch, m, found.lenslet_distance)
    return _round(frequency * found.wavelength * found.f_number), _round(frequency / tile)


def _round(part: float) -> float:
    """MTF of a round pupil at a part of its cut-off: Goodman, equation 6-31."""
    return 2 / math.pi * (math.acos(part) - part * math.sqrt(1 - part**2))


def _rows(gratings: list[_Grating], m: float) -> list[ResultRow]:
    second, third = gratings[1], gratings[2]
    main, tile = _ideal(second.frequency, m)
    kept = math.exp(-(second.frequency**2) / (2 * FILTER**2))
    return [
        ResultRow(f"f2, main lens, m = {m:g}", second.main_contrast, "", None, main, 0.008),
        ResultRow(
            f"f2, rendered, m = {m:g}",
            second.rendered_contrast,
            "",
            "gone" if m == 0.25 else None,
            tile,
            0.12 * tile,
            "the lenslet's own MTF: it sees the point through a part of the main lens only",
        ),
        ResultRow(
            f"f2, rendered and filtered, m = {m:g}",
            second.filtered_contrast,
            "",
            None,
            kept * second.rendered_contrast,
            0.02 * second.rendered_contrast,
            "exp(-f²/2σ²) = 0.79 of it",
        ),
        ResultRow(
            f"f3, rendered, m = {m:g}",
            third.rendered_contrast,
            "",
            "gone",
            0.0,
            0.04,
            "at or above the cut-off; seams let some through",
        ),
        ResultRow(f"f1, rendered, m = {m:g}", gratings[0].rendered_contrast),
        ResultRow(f"seams, rms of an even scene, m = {m:g}", float(second.even.std() / second.even.mean())),
        ResultRow(
            f"seams after the filter, rms, m = {m:g}",
            float(low_pass(second.even, second.grid.pitch[1], FILTER)[20:-20].std() / second.even.mean()),
        ),
    ]


def _figures(gratings: list[_Grating], m: float) -> list[tuple[object, str]]:
    raw = np.concatenate([np.asarray(one.raw.data) for one in gratings])
    bands = [
        np.concatenate([np.tile(profile, (36, 1)) for profile in profiles])
        for profiles in (
            [one.main for one in gratings],
            [one.picture for one in gratings],
            [one.filtered for one in gratings],
        )
    ]
    middle = slice(bands[0].shape[1] // 4, 3 * bands[0].shape[1] // 4)
    half = raw.shape[1] // 4
    names = ("main-lens image", "rendered picture", "rendered, Gaussian filter")
    panels = [(raw[:, half:-half], "raw image")]
    panels += [(band[:, middle], name) for band, name in zip(bands, names, strict=True)]
    spectra = {}
    for name, part in (("main lens", "main"), ("rendered", "picture"), ("rendered, filtered", "filtered")):
        spectra[name] = _spectrum(gratings, part)
    marks = {f"f{k + 1}": f / 1e4 for k, f in enumerate(THESIS_FREQUENCIES)}
    return [
        (images(panels, columns=2), f"Bands of 0.10, 0.80, 1.52, 2.22 and 2.94e4 /m, m = {m:g}."),
        (
            curves([], spectra, xlabel="frequency [10⁴ /m]", ylabel="power", log=True, marks=marks),
            f"Power spectra of the five bands together, m = {m:g}.",
        ),
    ]


def _spectrum(gratings: list[_Grating], part: str) -> tuple[np.ndarray, np.ndarray]:
    total = 0.0
    for one in gratings:
        profile = getattr(one, part)
        windowed = (profile - profile.mean()) * np.hanning(len(profile))
        total = total + np.square(np.abs(np.fft.rfft(windowed / profile.mean() / len(profile))))
    frequency = np.fft.rfftfreq(len(gratings[0].main), gratings[0].grid.pitch[1])
    shown = frequency < 4e4
    return frequency[shown] / 1e4, np.maximum(np.asarray(total)[shown], 1e-9)
