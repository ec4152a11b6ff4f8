"""White images of a camera whose parts are not where they should be, for figures 6.5 to 6.7."""

import math

import numpy as np
from scipy.ndimage import map_coordinates

from lumigraph.core.raw import RawImage
from lumigraph.instruments import FocusedPlenopticCamera
from lumigraph.scene import targets
from lumigraph.simulation import simulate
from lumigraph.studies.thesis.figures.point_images import camera

PIXEL = 3.3333e-6


class MisplacedCamera(FocusedPlenopticCamera):
    """A camera whose sensor or lenslets stand elsewhere along the axis.

    Parameters
    ----------
    sensor_shift
        Shift of the sensor away from the lenslets [m].
    lenslet_shift
        Shift of the lenslets towards the sensor [m].
    """

    sensor_shift: float = 0.0
    lenslet_shift: float = 0.0

    @property
    def lenslet_distance(self) -> float:
        """Lenslets to sensor, as they stand [m]."""
        return super().lenslet_distance + self.sensor_shift - self.lenslet_shift

    @property
    def separation(self) -> float:
        """Main lens to lenslets, as they stand [m]."""
        return super().separation + self.lenslet_shift


def laboratory_camera(lenslets: int) -> MisplacedCamera:
    """The laboratory camera at m = 0.5 with everything in its place and micro-images that touch."""
    found = camera(0.5, lenslets)
    values = found.model_dump(by_alias=True)
    values["sensor"] = {
        **values["sensor"], "pixel_pitch": PIXEL, "shape": _sensor_shape(found, lenslets)
    }  # fmt: skip
    values["main_lens"] = {**values["main_lens"], "diameter": found.diameters.touching}
    return MisplacedCamera(**values)


def _sensor_shape(found: FocusedPlenopticCamera, lenslets: int) -> tuple[int, int]:
    """A little smaller than the array's picture: no camera's array ends on its sensor."""
    n = math.floor((lenslets - 2) * found.micro_image_pitch / PIXEL) // 2 * 2 + 1
    return n, n


def white(found: FocusedPlenopticCamera) -> RawImage:
    """White image through a diffuser before the main lens."""
    return simulate(found, targets.white())


def tilted_white(found: MisplacedCamera, angle: float) -> RawImage:
    """White image with the lenslets turned by `angle` [rad] about the y axis, the side +x to the sensor.

    Each lenslet has the micro-image of a camera whose lenslets all stand at its distance; three such
    cameras are simulated, and what lies between is interpolated. Its centre is where the ray from the
    middle of the main lens goes.
    """
    half = found.lenslets.count[1] / 2 * found.lenslets.pitch * math.sin(angle)
    small = found.replace(lenslets={"count": (7, 7)}, sensor={"shape": (283, 283)})
    cells = [
        np.asarray(white(small.replace(lenslet_shift=shift)).data, float) for shift in (-half, 0.0, half)
    ]
    ny, nx = found.sensor.shape
    y, x = np.mgrid[:ny, :nx].astype(float)
    y, x = (y - ny // 2) * PIXEL, (x - nx // 2) * PIXEL
    near = _nearest(found, angle, y, x)
    shift, (center_y, center_x) = near[0] / half, near[1:]
    places = np.stack([y - center_y, x - center_x]) / PIXEL + 141
    light = [map_coordinates(cell, places, order=3, mode="nearest") for cell in cells]
    weights = shift * (shift - 1) / 2, 1 - shift**2, shift * (shift + 1) / 2
    data = sum(weight * part for weight, part in zip(weights, light, strict=True))
    return RawImage(np.maximum(data, 0).astype(np.float32), PIXEL)


def _nearest(
    found: MisplacedCamera, angle: float, y: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shift towards the sensor, and centre (y, x), of the micro-image that each place belongs to [m]."""
    pitch, separation = found.lenslets.pitch, found.separation
    total = separation + found.lenslet_distance
    # s = c cos θ T / (L + c sin θ), solved for c.
    j = np.rint(x * separation / (math.cos(angle) * total - x * math.sin(angle)) / pitch)
    shift = j * pitch * math.sin(angle)
    scale = total / (separation + shift)
    return shift, np.rint(y / scale / pitch) * pitch * scale, j * pitch * math.cos(angle) * scale
