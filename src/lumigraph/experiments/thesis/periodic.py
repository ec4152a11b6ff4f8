"""Exact raw images of lined objects, without speckle, by the periodicity of the lenslets.

Mutually incoherent points are summed; n points per lenslet and axis have only n² different images, moved by
whole periods. docs/theory/experiments.md has the reasons and Talanov's transformation, which puts the period
on whole samples. Coordinates are those of the upright raw image: an object at x appears around the lenslet at
x L/z1.

V. I. Talanov, JETP Lett. 11, 199 (1970).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lumigraph.core.calibration import Calibration
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.elements import CircularAperture, LensletArray
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.instruments.camera import Camera
from lumigraph.propagation import propagate

_PUPIL_SAMPLES = 192


def main_lens_amplitude(
    camera: Camera, y: np.ndarray, x: np.ndarray, separation: float, dz: float = 0.0
) -> np.ndarray:
    r"""Amplitude (ny, nx) that a point on the axis sends to a plane behind the main lens, telecentric.

    .. math:: G(x) = \int P(u) \exp\left(\frac{iπu^2}{λ}\left(\frac1{z_1} - \frac1f + \frac1L\right)\right)
              \exp\left(-\frac{2πi ux}{λL}\right) du

    Parameters
    ----------
    camera
        Main lens, wavelength and focused distance.
    y, x
        Places in the plane, relative to where the chief ray of the point meets it [m].
    separation
        Main lens to the plane, L, or z2 for the main-lens image [m].
    dz
        Depth of the point from the focused plane [m].
    """
    pupil = Grid.square(_PUPIL_SAMPLES, 1.02 * camera.pupil_diameter / _PUPIL_SAMPLES)
    curvature = 1 / camera.defocused(dz) - 1 / camera.main_lens.focal_length + 1 / separation
    phase = np.exp(1j * math.pi * curvature * pupil.x**2 / camera.wavelength)
    stop = CircularAperture(camera.pupil_diameter).transmission(pupil, camera.wavelength)
    turns = -2j * math.pi / (camera.wavelength * separation)
    along_y = np.exp(turns * np.outer(y, pupil.y))
    along_x = np.exp(turns * np.outer(pupil.x, x))
    return (along_y @ (stop * np.outer(phase, phase)) @ along_x) * pupil.pitch[0] * pupil.pitch[1]


def line_spread(camera: Camera, x: np.ndarray, separation: float, dz: float = 0.0) -> np.ndarray:
    """Image (n,) of an incoherent line behind the main lens alone, of sum 1; `x` evenly spaced [m]."""
    step = camera.wavelength * separation / (4 * camera.pupil_diameter)
    n = math.ceil((x[-1] - x[0]) / step)
    y = (np.arange(n) - n // 2) * step
    spread = np.square(np.abs(main_lens_amplitude(camera, y, x, separation, dz))).sum(0)
    return spread / spread.sum()


@dataclass(frozen=True, slots=True, eq=False)
class LinedCamera:
    """Raw images of bright lines along y, one lenslet high, before a camera.

    Parameters
    ----------
    camera
        Square lattice; the number of lenslets does not matter.
    dz
        Depth of the object from the focused plane [m].
    samples
        Samples of the sensor per lenslet, an odd number.
    classes
        Points per lenslet, an odd number.
    spreads
        Images (classes, samples, reach · samples) of lines at (k - classes // 2)/classes of a lenslet, around
        the middle lenslet; of mean 1 for an even object.
    """

    camera: FocusedPlenopticCamera
    dz: float
    samples: int
    classes: int
    spreads: np.ndarray

    @classmethod
    def of(cls, camera: FocusedPlenopticCamera, dz: float = 0.0, samples: int = 45) -> "LinedCamera":
        """The lines' images, as fine as the camera's cut-off asks and as wide as its light reaches."""
        period = camera.lenslets.pitch * camera.defocused(dz) / camera.separation
        finest = camera.wavelength * camera.defocused(dz) / (2 * camera.pupil_diameter)
        classes = math.ceil(1.1 * period / finest) // 2 * 2 + 1
        reach = _reach(camera, dz)
        places = (np.arange(classes) - classes // 2) / classes
        spreads = np.zeros((classes, samples, reach * samples))
        middle = classes // 2
        for iy in range(middle + 1):
            for ix in range(iy + 1):  # camera and image are the same with y and x exchanged
                image = _point(camera, dz, (places[iy], places[ix]), (samples, reach))
                _add_mirrored(spreads, image, (iy, ix), middle)
                if ix != iy:
                    _add_mirrored(spreads, image.T, (ix, iy), middle)
        return cls(camera, dz, samples, classes, spreads / spreads.sum(0).mean() / reach)

    @property
    def spacing(self) -> float:
        """Distance of the lines in the object [m]."""
        camera = self.camera
        return camera.lenslets.pitch * camera.defocused(self.dz) / camera.separation / self.classes

    def raw(self, profile: Callable[[np.ndarray], np.ndarray], lenslets: int, rows: int = 5) -> RawImage:
        """Raw image (rows · samples, lenslets · samples) of an object that varies along x only.

        Parameters
        ----------
        profile
            Intensity at places x [m] of the object, band-limited or slowly varying.
        lenslets, rows
            Size of the raw image in lenslets, odd numbers.
        """
        reach = self.spreads.shape[-1] // self.samples
        wide = lenslets + 2 * reach
        x = (np.arange(wide * self.classes) - wide * self.classes // 2) * self.spacing
        weights = profile(x).reshape(wide, self.classes)
        strip = np.zeros((self.samples, (wide + reach) * self.samples))
        for number, weight in enumerate(weights):
            start = number * self.samples
            strip[:, start : start + reach * self.samples] += np.tensordot(weight, self.spreads, 1)
        first = (reach + reach // 2) * self.samples
        strip = strip[:, first : first + lenslets * self.samples]
        return RawImage(np.tile(strip, (rows, 1)), self.pixel_pitch)

    @property
    def pixel_pitch(self) -> float:
        """Pixel pitch of the raw image [m]."""
        camera = self.camera
        return camera.lenslets.pitch * (1 + camera.lenslet_distance / camera.separation) / self.samples

    @property
    def patch(self) -> float:
        """Patch of the raw image at the object's depth [px]; signed."""
        return self.camera.patch_at(self.dz) * self.camera.pixels.pixel_pitch / self.pixel_pitch

    def calibration(self, raw: RawImage) -> Calibration:
        """Calibration of the micro-images."""
        ny, nx = raw.shape
        lattice = Lattice.square(self.samples, origin=(ny // 2, nx // 2))
        none, camera = np.zeros((0, 2)), self.camera
        return Calibration(
            lattice, raw.shape, none, none, 0.0,
            self.pixel_pitch, camera.separation, camera.lenslet_distance,
        )  # fmt: skip


def _reach(camera: FocusedPlenopticCamera, dz: float) -> int:
    """Lenslets (odd) of a window that holds the light of one point, and what diffraction spreads."""
    relay = camera.separation - 1 / (1 / camera.main_lens.focal_length - 1 / camera.defocused(dz))
    disc = camera.pupil_diameter * abs(relay) / (camera.separation - relay)
    return 2 * math.ceil(disc / camera.lenslets.pitch / 2 + 3) + 1


def _point(
    camera: FocusedPlenopticCamera, dz: float, place: tuple[float, float], size: tuple[int, int]
) -> np.ndarray:
    """Intensity (reach · samples)² of a point seen straight at `place` [pitches] of the middle lenslet."""
    samples, reach = size
    grid = Grid.square(reach * samples, camera.lenslets.pitch / samples)
    y, x = grid.y - place[0] * camera.lenslets.pitch, grid.x - place[1] * camera.lenslets.pitch
    amplitude = main_lens_amplitude(camera, y, x, camera.separation, dz)
    parts = camera.lenslets
    array = LensletArray(
        Lattice.square(parts.pitch), parts.focal_length[0], shape=parts.shape, fill_factor=parts.fill_factor
    )
    b, separation = camera.lenslet_distance, camera.separation
    field = array(Field(amplitude, grid, camera.wavelength))
    return propagate(field, b * separation / (separation + b), "band_limited").intensity


def _add_mirrored(spreads: np.ndarray, image: np.ndarray, place: tuple[int, int], middle: int) -> None:
    """Fold an image into one lenslet's height, and add it and its mirror images."""
    samples = spreads.shape[1]
    folded = image.reshape(-1, samples, image.shape[-1]).sum(0)
    mirrors = [folded] if place[0] == middle else [folded, folded[::-1]]
    for part in mirrors:
        spreads[place[1]] += part
        if place[1] != middle:
            spreads[2 * middle - place[1]] += part[:, ::-1]
