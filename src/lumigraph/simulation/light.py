"""Light that has arrived on the sensor, and its raw image."""

import math
from dataclasses import dataclass, field

import numpy as np

from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.sensor import integrate
from lumigraph.simulation import error
from lumigraph.simulation.camera import ImagedCamera
from lumigraph.simulation.coherence import Coherence, Incoherent, PartiallyCoherent

FEW = 3
"""Shots in a block, from which on their error falls as that of many does: 16 tilted waves in blocks of two
were off by 0.12 where 0.08 was stated."""


@dataclass(slots=True)
class Shots:
    """Sum of the images of mutually incoherent shots, in blocks whose spread gives its error.

    Parameters
    ----------
    camera
        Camera of the shots.
    total
        Light on the pixels, of all blocks that are complete.
    drawn
        Shots in each of these.
    squares
        Squared norms of their images, each over its shots, summed.
    """

    camera: ImagedCamera
    total: np.ndarray
    drawn: list[int] = field(default_factory=list)
    squares: float = 0.0
    _block: int = 0
    _begun: int = 0
    _image: np.ndarray | None = None

    def add(self, block: int, image: np.ndarray) -> None:
        """Intensity on the camera's grid, of a shot of a block; blocks come one after the other."""
        if block != self._block:
            self.complete()
        self._block, self._begun = block, self._begun + 1
        self._image = image if self._image is None else self._image + image

    def complete(self) -> None:
        """Close the block of shots that was begun, and start a new one."""
        if self._image is None:
            return
        seen = integrate(self._image, self.camera.image_grid, self.camera.sensor)
        self.total = self.total + seen
        self.drawn.append(self._begun)
        self.squares += error.norm(seen) ** 2 / self._begun
        self._begun, self._image = 0, None

    def brighten(self, factor: float) -> None:
        """All that they have brought, times a factor."""
        self.total, self.squares = self.total * factor, self.squares * factor**2

    def error(self, power: float) -> float:
        r"""Relative rms error of the mean of n shots, from how the means of B blocks are spread around it.

        Errors that fall as a power p of the number of shots are :math:`B^p` times as large in a block, whose
        mean square error is that of the whole more than the spread

        .. math:: V = \sum_b \frac{n_b}{n} |m_b - m|^2 = e^2 (B^{2p} - 1)
        """
        n, squared = sum(self.drawn), error.norm(self.total) ** 2
        spread = max(0.0, n * self.squares - squared)
        if n < FEW * len(self.drawn):  # so few quasi-random ones err no less than random ones
            power = min(power, 0.5)
        return math.sqrt(spread / (len(self.drawn) ** (2 * power) - 1) / max(squared, np.finfo(float).tiny))


@dataclass(slots=True)
class AccumulatedLight:
    """Light that has arrived so far: intensity on the pixels, after `done` shots or parts."""

    pixels: np.ndarray
    shots: Shots
    done: int = 0
    reached: list[tuple[float, error.ReachedError]] = field(default_factory=list)
    """Norm of each part that is imaged at once, and how far off it is."""

    def count(self, progress: Progress | None, total: int) -> None:
        """One more of all shots has arrived."""
        self.done += 1
        if progress is not None:
            progress(self.done / total)


def read_out(
    camera: ImagedCamera, light: AccumulatedLight, coherence: Coherence | Incoherent | PartiallyCoherent
) -> RawImage:
    """Raw image of what has arrived, with what is known of its error."""
    shots, reached = light.shots, list(light.reached)
    shots.complete()
    pixels = light.pixels + shots.total
    # A hard edge rings below zero when it is interpolated to pixels; a sensor counts no negative light.
    data = np.maximum(pixels, 0, dtype=np.float32)
    known = {"simulated": repr(coherence), "shots": light.done, "wavelength": camera.wavelength}
    if shots.drawn and not isinstance(coherence, Incoherent | PartiallyCoherent):
        there = error.of_grids(camera).through(camera.optics())
        if len(shots.drawn) > 1:
            drawn = shots.error(coherence.convergence)
            known["estimated_error"] = drawn * error.norm(shots.total) / (error.norm(pixels) or 1.0)
            source = f"{len(shots.drawn)} blocks of {sum(shots.drawn)} shots on grids"
            there = error.ReachedError(drawn, source, there.paraxial).and_also(there.rms)
        reached.append((error.norm(shots.total), there))
    if (whole := error.together(reached)) is not None:
        known["error"] = {"rms": whole.rms, "source": whole.source}
        if whole.paraxial:
            known["error"]["paraxial"] = whole.paraxial
    if isinstance(coherence, Incoherent):
        error.warn_if_missed(coherence.accuracy, whole)
    return RawImage(data, pixel_pitch=camera.sensor.pixel_pitch, metadata=known)
