"""Patch of a camera 2.0 by waves: the size at which tiles of a grating of a frequency meet.

A pixel sees the object through the lenslets. The wave that it would send back spreads by diffraction, and the
rim of the main lens cuts the part that leans outwards: what is left looks, in the mean, at a place nearer to
the lenslet's axis than the ray through the middle of the lenslet does. So the picture in a micro-image is
larger than rays have it, the more so the coarser its detail.
"""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.elements import CircularAperture, LensletArray
from lumigraph.errors import GeometryError
from lumigraph.instruments.lenslet_camera import LensletCamera

PUPIL_SAMPLES, LENSLET_SAMPLES = 128, 64
"""Samples across the pupil, and fewest across a lenslet."""
LENSLETS = 5
"""Lenslets along each axis through which a pixel sees: of three, patches are 0.3 % off."""
PLACES, ROWS = 16, 4
"""Places along half a patch, and across it, whose pixels are computed."""
LARGEST = 1.5
"""Largest patch that is looked for, over that of rays."""


@dataclass(frozen=True, slots=True)
class GratingImage:
    r"""Image of a grating behind the main lens of a camera 2.0.

    With the pupil at u, the lenslets' transmission A(X), z' from the pupil to the image, L to the lenslets
    and b on to the sensor, a pixel at y would send back to the pupil

    .. math:: g_y(u) = P(u) e^{i\pi u^2 (1/L - 1/z')/\lambda} \int A(X)
              e^{i\pi X^2 (1/L + 1/b)/\lambda} e^{-2\pi i X (u/L + y/b)/\lambda} dX

    is that wave in the pupil, and

    .. math:: T_y = \int g_y(u + \Delta) g_y^*(u - \Delta) du, \quad \Delta = \lambda z' \nu / 2

    what the pixel sees of a grating of ν per length of the image. Neighbouring lenslets look at places p z'/L
    apart there: their tiles meet at the patch 2y where the phase of T is π ν p z'/L.

    Parameters
    ----------
    camera
        With an ideal round main lens.
    distance
        Main lens to the image [m].
    frequency
        Of the grating there, along x [1/m].
    focal_length
        Of the lenslets that see it [m].
    """

    camera: LensletCamera
    distance: float
    frequency: float
    focal_length: float

    def __post_init__(self) -> None:
        lens = self.camera.main_lens
        if lens.varies or lens.aberrations or lens.mask is not None:
            raise GeometryError(
                "a patch by waves needs an ideal main lens, but this one has aberrations, a prescription or "
                "a mask. Leave the frequency out: the patch is that of rays."
            )

    def patch(self, rays: float) -> float | None:
        """Width on the sensor at which tiles meet [m], from that of rays [m]; None where nothing is seen."""
        camera = self.camera
        places = np.linspace(0, LARGEST * rays / 2, PLACES)
        phases = self._phases(places, rays / 2)
        wanted = math.pi * self.frequency * camera.lenslets.pitch * self.distance / camera.separation
        return 2 * float(np.interp(wanted, phases, places)) if phases[-1] > wanted else None

    def _phases(self, places: np.ndarray, half: float) -> np.ndarray:
        """Phase (n,) of what pixels at places [m] see [rad], the mean of rows to `half` of the axis [m]."""
        camera = self.camera
        shift = camera.wavelength * self.distance * self.frequency / 2
        pupil = Grid.square(PUPIL_SAMPLES, 1.02 * camera.pupil_diameter / PUPIL_SAMPLES)
        nodes, weights = np.polynomial.legendre.leggauss(2 * ROWS)
        lenslets, x = self._lenslets()
        rows = self._kernels(pupil.y, half * nodes[ROWS:], x) @ lenslets
        bend = 2 * math.pi * (1 / camera.separation - 1 / self.distance) / camera.wavelength
        overlap = np.exp(2j * bend * shift * pupil.x)
        waves = []
        for side in (shift, -shift):
            columns = np.swapaxes(self._kernels(pupil.x + side, places, x), -1, -2)
            waves.append(rows[:, None] @ columns)
            stop = CircularAperture(camera.pupil_diameter, (0.0, -side))
            overlap = overlap * stop.transmission(pupil, camera.wavelength)
        seen = ((waves[0] * waves[1].conj() * overlap).sum((-2, -1)) * weights[ROWS:, None]).sum(0)
        phases = np.unwrap(np.angle(seen))
        return np.abs(phases - phases[0])

    def _lenslets(self) -> tuple[np.ndarray, np.ndarray]:
        """Transmission (y, x) of the lenslets around the axis with the curvatures of both ways, and x [m]."""
        camera, parts = self.camera, self.camera.lenslets
        reach = camera.pupil_diameter / camera.separation + parts.pitch / camera.lenslet_distance
        samples = max(LENSLET_SAMPLES, math.ceil(4 * parts.pitch * reach / camera.wavelength))
        grid = Grid.square(LENSLETS * samples, parts.pitch / samples)
        lattice = Lattice.square(parts.pitch) if parts.layout == "square" else Lattice.hex(parts.pitch)
        extent = (LENSLETS - 0.5) * parts.pitch
        array = LensletArray(
            lattice,
            self.focal_length,
            shape=parts.shape,
            fill_factor=parts.fill_factor,
            extent=(extent, extent),
        )
        curvature = (1 / camera.separation + 1 / camera.lenslet_distance) / camera.wavelength
        chirp = np.exp(1j * math.pi * curvature * grid.x**2)
        return array.transmission(grid, camera.wavelength) * np.outer(chirp, chirp), grid.x

    def _kernels(self, u: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Fourier factors (place, pupil, lenslet) along one axis."""
        camera = self.camera
        sines = u / camera.separation + places[:, None] / camera.lenslet_distance
        return np.exp(-2j * math.pi / camera.wavelength * sines[..., None] * x)
