"""What has arrived on the sensor, and the raw image of it."""

import math
from dataclasses import dataclass, field

import numpy as np

from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.sensor import integrate
from lumigraph.simulation import error
from lumigraph.simulation.camera import Camera
from lumigraph.simulation.coherence import Coherence, Incoherent


@dataclass(slots=True)
class Light:
    """What has arrived so far: intensity on the camera's grid and on the pixels, after `done` shots."""

    intensity: np.ndarray
    pixels: np.ndarray
    done: int = 0
    halves: dict[int, np.ndarray] = field(default_factory=dict)
    """What random or quasi-random shots brought, in two halves."""
    drawn: dict[int, int] = field(default_factory=lambda: {0: 0, 1: 0})
    """Shots in each half."""
    reached: list[tuple[float, error.Reached]] = field(default_factory=list)
    """Norm of each part that is imaged at once, and how far off it is."""

    def add(self, half: int | None, image: np.ndarray) -> None:
        """Intensity on the camera's grid, of a shot that belongs to one of two halves or to none."""
        if half is None:
            self.intensity += image
            return
        self.halves[half] = self.halves.get(half, 0.0) + image
        self.drawn[half] += 1

    def brighten(self, factor: float) -> None:
        """All that shots have brought, times a factor."""
        self.intensity *= factor
        self.halves = {half: image * factor for half, image in self.halves.items()}

    def count(self, progress: Progress | None, total: int) -> None:
        """One more of all shots has arrived."""
        self.done += 1
        if progress is not None:
            progress(self.done / total)


def read_out(camera: Camera, light: Light, coherence: Coherence | Incoherent) -> RawImage:
    """Raw image of what has arrived, with what is known of its error."""
    pixels = light.pixels
    reached = list(light.reached)
    if light.intensity.any():
        seen = integrate(light.intensity, camera.image_grid, camera.sensor)
        reached.append((error.norm(seen), error.of_grids(camera)))
        pixels = pixels + seen
    halves = {k: integrate(image, camera.image_grid, camera.sensor) for k, image in light.halves.items()}
    for half in halves.values():
        pixels = pixels + half
    # A hard edge rings below zero when it is interpolated to pixels; a sensor counts no negative light.
    data = np.maximum(pixels, 0, dtype=np.float32)
    known = {"simulated": repr(coherence), "shots": light.done, "wavelength": camera.wavelength}
    if len(halves) == 2 and not isinstance(coherence, Incoherent):
        known["estimated_error"] = _error(halves, light.drawn, pixels, coherence.convergence)
        drawn = error.Reached(known["estimated_error"], f"two halves of {light.done} shots on grids")
        reached.append((error.norm(pixels), drawn.and_also(error.of_grids(camera).rms)))
    if (whole := error.together(reached)) is not None:
        known["error"] = {"rms": whole.rms, "source": whole.source}
    if isinstance(coherence, Incoherent):
        error.warn_if_missed(coherence.accuracy, whole)
    return RawImage(data, pixel_pitch=camera.sensor.pixel_pitch, metadata=known)


def _error(halves: dict[int, np.ndarray], drawn: dict[int, int], pixels: np.ndarray, power: float) -> float:
    """Relative rms error of a mean, from the difference between the means of its two halves.

    Errors that fall as a power p of the number of shots make halves of n1 and n2 of them differ by
    sqrt((n/n1)^2p + (n/n2)^2p) times the error of all n. Of a dozen quasi-random ones it may be twice that.
    """
    both = drawn[0] + drawn[1]
    difference = halves[0] * (both / drawn[0]) - halves[1] * (both / drawn[1])
    spread = math.hypot(*((both / n) ** power for n in drawn.values()))
    return float(np.linalg.norm(difference) / spread / max(np.linalg.norm(pixels), np.finfo(float).tiny))
