"""A plenoptic camera as wavefront sensor, beside a Shack-Hartmann's: `python -m benchmarks.wavefront_sensor`.

Phases with the modal spectrum of turbulence (Noll 4 to 21, variances as (n + 1)^(-11/3), 1 rad rms) before
one star, at equal photons, with .001 electrons of background a pixel. Behind the camera's main lens, lenslets
of 9.6 λF# take apart the star's image, on the corner of four lenslets. The Shack-Hartmann has 8 × 8 lenslets
in the pupil, each with 16 × 16 pixels of half of its λ/d; its slopes are centres of gravity within 3 λ/d, and
its modes fits by least squares, weighted by light, through responses that its own wave optics gives. Beside
it stands the bound of any estimate from its pixels (Cramér-Rao), as for the camera. Tilt is unknown to both.

`places` prints bounds by where the star stands; `scenes` measures slopes (`lg.adaptive.start`) of a scene.
"""

import math
import sys
import tempfile
import time

import numpy as np
from scipy.ndimage import gaussian_filter

import lumigraph as lg
from lumigraph.deconvolution import Exposure
from lumigraph.elements.zernike import noll_to_nm, zernike
from lumigraph.scene import Points
from lumigraph.studies.adaptive import sense, start
from lumigraph.studies.adaptive.checked import bent
from lumigraph.studies.adaptive.sense import MODES
from lumigraph.studies.adaptive.star import StarImages
from lumigraph.studies.information.points import CameraSource

CAMERA = lg.PlenopticCamera(
    wavelength="600 nm",
    object_distance="400 mm",
    main_lens={"focal_length": "200 mm"},
    lenslets={"pitch": "120 um", "count": (4, 4), "focal_length": "2.5 mm"},
    sensor={"pixel_pitch": "8 um"},
)
ALL = (*MODES, 2, 3)
BACKGROUND = 0.001
PHOTONS = (1e3, 1e4, 1e5)
FRAMES = 4


def turbulence(rng: np.random.Generator) -> np.ndarray:
    """Coefficients of `MODES` [waves rms], 1 rad rms in all."""
    orders = np.array([noll_to_nm(j)[0] for j in MODES])
    drawn = rng.normal(size=len(MODES)) * (orders + 1.0) ** (-11 / 6)
    return drawn / np.linalg.norm(drawn) / (2 * math.pi)


class ShackHartmann:
    """Lenslets in the pupil."""

    def __init__(self, across: int = 8, samples: int = 16) -> None:
        n = across * samples
        at = (np.arange(n) + 0.5) / n * 2 - 1
        rho, angle = np.hypot(at[:, None], at), np.arctan2(at[:, None], at)
        self.across, self.samples, self.inside = across, samples, rho <= 1
        self.modes = np.stack([zernike(j, np.minimum(rho, 1), angle) for j in ALL])
        self.used = self._tiles(self.inside.astype(float)).mean((1, 2)) > 0.5

    def _tiles(self, plane: np.ndarray) -> np.ndarray:
        a, s = self.across, self.samples
        return plane.reshape(a, s, a, s).transpose(0, 2, 1, 3).reshape(a * a, s, s)

    def image(self, coefficients: np.ndarray) -> np.ndarray:
        """(lenslets, 16, 16) of coefficients [waves rms], parts of the light in the pupil."""
        wave = self.inside * np.exp(2j * np.pi * np.tensordot(coefficients, self.modes, 1))
        size = 4 * self.samples
        # Half a sample of tilt, so that spots stand between the middle pixels.
        ramp = np.exp(1j * np.pi / size * (np.arange(self.samples)[:, None] + np.arange(self.samples)))
        spots = np.fft.fftshift(np.fft.fft2(self._tiles(wave) * ramp.conj(), (size, size)), (1, 2))
        light = np.abs(spots) ** 2 / size**2 / self.inside.sum()
        pixels = light.reshape(-1, size // 2, 2, size // 2, 2).sum((2, 4))
        return pixels[:, size // 8 : -size // 8, size // 8 : -size // 8]

    def slopes(self, image: np.ndarray) -> np.ndarray:
        """Centres of gravity of the spots that are used, within 3 λ/d (2 lenslets) [pixels]."""
        n = image.shape[-1]
        at = np.arange(n) - (n - 1) / 2
        near = (np.hypot(at[:, None], at) <= 6) * (image[self.used] - self.dark)
        total = np.maximum(near.sum((1, 2)), 1e-12)
        return np.stack([(near.sum(2) @ at) / total, (near.sum(1) @ at) / total])

    dark = 0.0

    def reconstructor(self, step: float = 1e-3) -> np.ndarray:
        """Modes by slopes (modes, 2 lenslets)."""
        eye = np.eye(len(ALL)) * step
        response = [(self.slopes(self.image(e)) - self.slopes(self.image(-e))).ravel() for e in eye]
        matrix = np.stack(response, 1) / (2 * step)
        weight = np.tile(np.sqrt(self.image(np.zeros(len(ALL)))[self.used].sum((1, 2))), 2)
        return np.linalg.pinv(weight[:, None] * matrix) * weight

    def found(self, raw: np.ndarray, reconstructor: np.ndarray) -> np.ndarray:
        """Modes of a raw image in electrons."""
        self.dark = BACKGROUND
        found = (
            reconstructor
            @ (self.slopes(raw) - self.slopes(self.image(np.zeros(len(ALL))) + BACKGROUND)).ravel()
        )
        self.dark = 0.0
        return found

    def bound(self, coefficients: np.ndarray, photons: float, step: float = 1e-3) -> float:
        """Least rms error of `MODES` of any estimate [rad]."""
        eye = np.eye(len(ALL)) * step
        change = [(self.image(coefficients + e) - self.image(coefficients - e)) / (2 * step) for e in eye]
        flat = photons * np.stack([*change, self.image(coefficients)]).reshape(len(ALL) + 1, -1)
        covariance = np.linalg.inv((flat / (flat[-1] + BACKGROUND)) @ flat.T)
        return 2 * math.pi * math.sqrt(np.trace(covariance[: len(MODES), : len(MODES)]))


def stars() -> None:
    """Print residuals before a star."""
    other, exposure = ShackHartmann(), Exposure(background=BACKGROUND, gain=1.0)
    inverse = other.reconstructor()
    print("photons | camera: left, bound | Shack-Hartmann: left, bound [rad rms of 1]", flush=True)
    for photons in PHOTONS:
        rows, began = [], time.process_time()
        for seed in range(FRAMES):
            rng = np.random.default_rng(seed)
            true = turbulence(rng)
            light = CameraSource(bent(CAMERA, MODES, true), 1e-3).image(np.zeros(3))
            found = sense(
                rng.poisson(photons * light + BACKGROUND).astype(np.float32), CAMERA, exposure=exposure
            )
            left = np.linalg.norm(found.values.ravel() - true)
            full = np.append(true, [0.0, 0.0])
            raw = rng.poisson(photons * other.image(full) + BACKGROUND)
            off = other.found(raw, inverse)[: len(MODES)] - true
            bounds = math.sqrt(np.trace(found.covariance)), other.bound(full, photons) / (2 * math.pi)
            rows.append([left, bounds[0], np.linalg.norm(off), bounds[1]])
        mean = 2 * math.pi * np.sqrt(np.mean(np.square(rows), axis=0))
        words = ", ".join(f"{value:.4f}" for value in mean)
        print(
            f"{photons:.0e} | {words} | {(time.process_time() - began) / FRAMES:.0f} CPU s a frame",
            flush=True,
        )


def places() -> None:
    """Print bounds by where the star stands in a lenslet's cell, and how far from the focus."""
    pitch = 120e-6
    for y, dz in ((0.0, 0.0), (0.125, 0.0), (0.25, 0.0), (0.5, 0.0), (0.0, 6e-3), (0.5, 6e-3)):
        at, rows = np.array([y * pitch, y * pitch, dz]), []
        for seed in range(FRAMES):
            true = turbulence(np.random.default_rng(seed))
            lit = next(StarImages(CAMERA, MODES).lit(Points(at[None], np.ones(1)), true))
            flat = 1e5 * np.concatenate([lit.changes[:-1], lit.image[None]]).reshape(len(MODES) + 3, -1)
            flat[-1] = np.maximum(flat[-1], 0)
            covariance = np.linalg.inv((flat / (flat[-1] + BACKGROUND)) @ flat.T)
            rows.append(np.trace(covariance[: len(MODES), : len(MODES)]))
        print(
            f"{y} {y} of a pitch from the corner, {dz * 1e3:g} mm from focus: "
            f"{2 * math.pi * np.sqrt(np.mean(rows)):.4f} rad",
            flush=True,
        )


def scenes() -> None:
    """Print residuals of slopes before a random scene."""
    camera = CAMERA.replace(lenslets={"count": (12, 12)}, sensor={"shape": None})
    for seed in range(3):
        rng = np.random.default_rng(seed)
        true = turbulence(rng)
        scene = gaussian_filter(rng.normal(size=camera.operator_grid().shape), 6)
        scene = np.maximum(1 + scene / scene.std() / 2, 0.05).astype(np.float32)
        with tempfile.TemporaryDirectory() as folder:
            light = bent(camera, MODES, true).operator(accuracy=1e-2, folder=folder).forward(scene)
        light = np.maximum(light, 0)
        for photons in (1e5, 1e6, 1e7, 1e9):
            raw = rng.poisson(light / light.sum() * photons).astype(np.float32)
            found = start(raw, camera, MODES)
            off = np.array(list(found.coefficients.values())) - true
            said = np.array(list(found.deviations.values()))
            left, known = (2 * math.pi * np.linalg.norm(one) for one in (off, said))
            part = np.sqrt(np.mean((off / said) ** 2))
            print(
                f"scene {seed}, {photons:.0e} photons: {left:.3f} rad left, {known:.3f} said; term by term "
                f"{part:.2f} of what is said"
            )


if __name__ == "__main__":
    {"scenes": scenes, "places": places}.get(sys.argv[-1], stars)()
