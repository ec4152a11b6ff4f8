"""Figures 5.4 and 5.5: the magnification of planes out of focus, and pictures rendered with it."""

import math

import numpy as np

from lumigraph.analysis import contrast
from lumigraph.design import thin_lens
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.plots.curves import curves, images
from lumigraph.rendering import render
from lumigraph.studies.thesis.figures.periodic import LinedCamera
from lumigraph.studies.thesis.figures.point_images import MAGNIFICATIONS, camera
from lumigraph.studies.thesis.registry import Context, ExperimentOutcome, ResultRow, experiment

_FREQUENCY = 3000.0  # of the grating, in the object [1/m]
_SAMPLES = 21  # of a picture per lenslet


@experiment(
    "figure-5.5",
    "Rendering by depth",
    question="Which patch renders a plane out of focus, and what does the picture lose with another one?",
    thesis="Figures 5.4 and 5.5, equations 5.6 to 5.10, section 5.1.3",
    shows="A curve of the magnification that sets the patch, over the defocus of the object.",
    camera="thesis-plenoptic-2-m050",
)
def run(context: Context) -> ExperimentOutcome:
    """Gratings at a depth, exact incoherent images, rendered with three patches; Keplerian and Galilean."""
    rows: list[ResultRow] = []
    figures = [_magnifications()]
    for number, (name, found, dz) in enumerate(_cases()):
        context.progress(number / 2, f"{name}, {dz * 1e3:+g} mm")
        lined = LinedCamera.of(found, dz, samples=21 if context.quick else 45)
        seen = {
            patch: _Picture(lined, size, 21 if context.quick else 39)
            for patch, size in _patches(found, dz).items()
        }
        rows += _rows(name, found, dz, seen)
        rows.append(_best_row(lined, f"{name}, {dz * 1e3:+g} mm", 21 if context.quick else 39))
        figures.append(_bands(seen, f"{name} at {dz * 1e3:+g} mm"))
    return ExperimentOutcome(
        tuple(rows),
        tuple(figures),
        why="The sensor does not move with the depth: m' = b/a' (equation 5.9 has b'/a'), and the patch is "
        "m' p z2'/L by rays (5.10 has m' p). By waves it is larger: a pixel sees the object through its "
        "lenslet, and the rim of the main lens cuts the diffracted light that leans outwards, so that what "
        "is left comes from nearer to the lenslet's axis. That draws depths towards the lenslets, by 3 to "
        "5 % of the patch for fine detail, by 10 to 25 % for coarse detail, in focus too, and it is why the "
        "printed, too large patch leaves less at +10 mm. patch_at(dz, frequency) computes how much, "
        "backwards from the pixels.",
    )


def _bands(seen: dict[str, "_Picture"], what: str) -> tuple[object, str]:
    """The pictures' middles, one below the other."""
    strips = []
    for one in seen.values():
        middle = one.profile[len(one.profile) // 4 : 3 * len(one.profile) // 4]
        strips += [np.tile(middle[None], (100, 1)), np.full((12, len(middle)), middle.max())]
    order = ", ".join(seen)
    return images([(np.concatenate(strips[:-1]), what)], columns=1), f"{what}; from the top: {order}."


def _cases() -> list[tuple[str, FocusedPlenopticCamera, float]]:
    galilean = camera(0.25, 39).replace(lenslets={"magnification": -0.25}, matching="full")
    return [("Keplerian", camera(0.5, 39), 10e-3), ("Galilean", galilean, -4e-3)]


def _patches(found: FocusedPlenopticCamera, dz: float) -> dict[str, float]:
    """Patches on the sensor [m]: right by rays and by waves, printed, and that of the focused plane."""
    pixel, p = found.pixels.pixel_pitch, found.lenslets.pitch
    return {
        "right patch": found.patch_at(dz) * pixel,
        "patch by waves": found.patch_at(dz, _FREQUENCY) * pixel,
        "printed patch": p * _printed_magnification(found, dz),
        "focused plane's patch": found.patch * pixel,
    }


def _printed_magnification(found: FocusedPlenopticCamera, dz: float) -> float:
    """Ratio b'/a' of equation 5.9, with b' where the lenslets would be in focus."""
    relay, f = found.lenslet_distance / found.magnification_at(dz), found.lenslets.focal_length[0]
    return f / (relay - f)


class _Picture:
    """A grating at a depth rendered with one patch: its profile, contrast and frequency."""

    def __init__(self, lined: LinedCamera, patch: float, lenslets: int) -> None:
        found, size = lined.camera, patch / lined.pixel_pitch
        pictures = []
        for sign in (1, -1):

            def profile(x: np.ndarray, sign: int = sign) -> np.ndarray:
                return 0.5 + sign * 0.5 * np.cos(2 * math.pi * _FREQUENCY * x)

            raw = lined.raw(profile, lenslets, rows=3)
            pictures.append(render(raw, lined.calibration(raw), size, samples=_SAMPLES).mean(0))
        self.profile = pictures[0]
        # Neighbouring lenslets look at main-image places p z2'/L apart, whatever the patch.
        distance = found.defocused(lined.dz)
        image = thin_lens.image_distance(found.main_lens.focal_length, distance)
        self.pitch = found.lenslets.pitch * image / found.separation / _SAMPLES * distance / image
        wave = (pictures[0] - pictures[1]) / (pictures[0] + pictures[1]).mean()
        self.contrast = contrast(1 + wave, _FREQUENCY, self.pitch)
        self.error = float(np.sqrt(np.mean((wave - self._fit(wave)) ** 2)) / wave.std())

    def _fit(self, wave: np.ndarray) -> np.ndarray:
        x = np.arange(len(wave)) * self.pitch
        waves = np.stack([np.cos(2 * math.pi * _FREQUENCY * x), np.sin(2 * math.pi * _FREQUENCY * x)], 1)
        return waves @ np.linalg.lstsq(waves, wave, rcond=None)[0]


def _rows(name: str, found: FocusedPlenopticCamera, dz: float, seen: dict[str, _Picture]) -> list[ResultRow]:
    focal, distance = found.main_lens.focal_length, found.defocused(dz)
    relay = found.separation - 1 / (1 / focal - 1 / distance)
    head = f"{name}, {dz * 1e3:+g} mm"
    rows = [
        ResultRow(f"m', {head}", found.magnification_at(dz), "", _printed_magnification(found, dz),
            found.lenslet_distance / relay, 1e-6, "thesis: by equation 5.9", "closed form"),
    ]  # fmt: skip
    right, other = seen["right patch"], seen["focused plane's patch"]
    rows += [
        ResultRow(f"contrast, {patch}, {head}", one.contrast, note="3000 /m in the object")
        for patch, one in seen.items()
    ]
    rows += [
        ResultRow(
            f"what is not the grating, right patch, {head}",
            right.error,
            "",
            None,
            0.0,
            0.05,
            "rms over the grating's",
        ),
        ResultRow(
            f"what is not the grating, patch by waves, {head}",
            seen["patch by waves"].error,
            "",
            None,
            0.0,
            0.015,
            "rms over the grating's",
        ),
        ResultRow(f"what is not the grating, printed patch, {head}", seen["printed patch"].error),
        ResultRow(
            f"what is not the grating, focused plane's patch, {head}",
            other.error,
            "",
            None,
            None,
            None,
            f"{other.error / right.error:.0f} times that of the right patch",
        ),
        ResultRow(
            f"right patch over focused plane's patch, {head}", right.error / other.error, "", None, 0.0, 0.15
        ),
    ]
    return rows


def _best_row(lined: LinedCamera, head: str, lenslets: int) -> ResultRow:
    """Patch that leaves least of the picture beside the grating, over that of rays; sizes 3 % apart."""
    camera, dz = lined.camera, lined.dz
    size = camera.patch_at(dz) * camera.pixels.pixel_pitch
    factors = np.array([0.97, 1.0, 1.03, 1.06, 1.09])
    left = [_Picture(lined, factor * size, lenslets).error for factor in factors]
    k = int(np.clip(np.argmin(left), 1, len(left) - 2))
    bend, tilt, _ = np.polyfit(factors[k - 1 : k + 2], np.square(left[k - 1 : k + 2]), 2)
    # Errors grow in proportion to what a patch is off: their squares are parabolas.
    return ResultRow(f"sharpest patch over that of rays, {head}", -tilt / (2 * bend), "",
        None, camera.patch_at(dz, _FREQUENCY) / camera.patch_at(dz), 0.012,
        "by waves back from the pixels to the pupil")  # fmt: skip


def _magnifications() -> tuple[object, str]:
    depths, lines = np.linspace(-6e-3, 40e-3, 93), {}
    for m in MAGNIFICATIONS:
        found = camera(m, 39)
        lines[f"m = {m:g}"] = np.array([found.magnification_at(dz) for dz in depths])
        lines[f"m = {m:g}, equation 5.9"] = np.array([_printed_magnification(found, dz) for dz in depths])
    figure = curves(depths * 1e3, lines, xlabel="depth from the focused plane [mm]", ylabel="m'")
    return figure, "Magnification that sets the patch, against depth (5.5)."
