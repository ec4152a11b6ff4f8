"""Estimated relative rms error of a raw image, and the source of each estimate."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.errors import ParaxialWarning, SamplingWarning
from lumigraph.operators import CameraOptics
from lumigraph.operators.paraxial import paraxial_error
from lumigraph.simulation.camera import Camera

_MEASURED = {  # by benchmarks.accuracy and estimates, over the accuracy asked: at 1e-2, 1e-3 and 1e-4
    "operator": (0.45, 0.3, 0.25),
    "coherent": (0.1, 0.1, 0.025),
}


@dataclass(frozen=True, slots=True)
class Reached:
    """Estimated error of an image, or of a part of it.

    Parameters
    ----------
    rms
        Relative rms error, estimated.
    source
        Source of the estimate.
    paraxial
        Additional error of parabolic lenses, relative rms, estimated; 0 where lenses are exact.
    """

    rms: float
    source: str
    paraxial: float = 0.0

    def and_also(self, rms: float, source: str = "") -> "Reached":
        """Error together with an independent one, which may have a source of its own."""
        return replace(self, rms=math.hypot(self.rms, rms), source=self.source + source)

    def through(self, camera: CameraOptics) -> "Reached":
        """Error of an image formed by a camera's parabolic lenses and lenslets."""
        return self if camera.array is None else replace(self, paraxial=paraxial_error(camera))


def of_quadrature(path: str, accuracy: float) -> Reached:
    """Error of a path that takes an accuracy: measured at three accuracies, power laws in between."""
    share = np.interp(-math.log10(accuracy), (2, 3, 4), np.log(_MEASURED[path]))
    return Reached(accuracy * math.exp(share), f"{path} at accuracy {accuracy:g}")


SINGLE = 1.3
"""Ratio of the error of one sample's image to that of many samples'."""


def of_operator(intensity: np.ndarray, accuracy: float) -> Reached:
    """Error of a slice's image: smaller for many samples than for few, whose errors differ."""
    light, squared = float(np.abs(intensity).sum()), float(np.square(intensity, dtype=float).sum())
    few = SINGLE * math.sqrt(squared) / (light or 1.0)
    found = of_quadrature("operator", accuracy)
    return replace(found, rms=found.rms * max(1.0, few))


ROUNDING = 1.5e-6
"""Rounding error of points' images in single precision, relative rms."""


def of_points(difference: float, accuracy: float) -> Reached:
    """Error of points, from the difference that `points.image_and_error` finds for the brightest."""
    return Reached(difference, f"points at accuracy {accuracy:g}, beside another image of one").and_also(
        ROUNDING
    )


def of_white(difference: float, accuracy: float) -> Reached:
    """Error of a white image, from the difference that `white.image_and_error` finds."""
    return Reached(
        difference, f"white image at accuracy {accuracy:g}, beside light that is followed less far"
    )


def of_convolution(operator_error: float, source: str = "") -> Reached:
    """Error of a camera without lenslets, from the one that its operator states."""
    return Reached(max(operator_error, ROUNDING), f"convolution with a point's image{source}")


def of_grids(camera: Camera) -> Reached:
    """Error of fields propagated on grids, whatever their number: measured against exact images of slices.

    Before lenslets 1.7e-2 to 3e-2. Without them paraxial lenses and exact free space differ by a spherical
    aberration of W = D⁴/(128 λL³) waves: f/16 to f/63 and 120 mm by 2e-4 to 1e-3, f/8 by 0.1 to 2 W.
    """
    source = "propagation on grids"
    if camera.lattice is not None:
        return Reached(0.025, source)
    aberration = camera.pupil_diameter**4 / (128 * camera.wavelength * camera.separation**3)
    return Reached(math.hypot(7e-4, 0.5 * aberration), source)


def together(parts: Sequence[tuple[float, Reached]]) -> Reached | None:
    """Error of a sum of images of the given norms, whose errors are independent."""
    if not parts:
        return None
    whole = math.hypot(*(norm for norm, _ in parts)) or 1.0
    rms = math.hypot(*(norm * part.rms for norm, part in parts)) / whole
    paraxial = math.hypot(*(norm * part.paraxial for norm, part in parts)) / whole
    return Reached(rms, "; ".join(dict.fromkeys(part.source for _, part in parts)), paraxial)


def warn_if_missed(asked: float, reached: Reached | None) -> None:
    """Warn where the error is larger than what was asked for."""
    if reached is not None and reached.rms > asked:
        warnings.warn(
            f"an accuracy of {asked:g} was asked for but the raw image is off by some {reached.rms:.2g} rms "
            f"({reached.source}).",
            SamplingWarning,
            stacklevel=4,
        )
    if reached is not None and reached.paraxial > asked:
        warnings.warn(
            f"an accuracy of {asked:g} was asked for but parabolic lenses put the raw image off by some "
            f'{reached.paraxial:.2g} rms. With square lenslets, model = "exact" in the camera file goes '
            "beyond them; else take it as the paraxial image.",
            ParaxialWarning,
            stacklevel=4,
        )


def norm(image: np.ndarray) -> float:
    """Root of the sum of an image's squares."""
    return float(np.linalg.norm(image))
