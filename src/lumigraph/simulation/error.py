"""Estimated relative rms error of a raw image, and the source of each estimate."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.errors import ParaxialWarning, SamplingWarning
from lumigraph.operators import CameraOptics
from lumigraph.operators.lenslets.paraxial_error import paraxial_error
from lumigraph.operators.sampling import cells
from lumigraph.scene import Points, Slice
from lumigraph.simulation.camera import ImagedCamera

_MEASURED = {  # by benchmarks.accuracy and estimates, over the accuracy asked: at 1e-2, 1e-3 and 1e-4
    "operator": (0.45, 0.3, 0.25),
    "coherent": (0.1, 0.1, 0.025),
}


@dataclass(frozen=True, slots=True)
class ReachedError:
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

    def and_also(self, rms: float, source: str = "") -> "ReachedError":
        """Error together with an independent one, which may have a source of its own."""
        return replace(self, rms=math.hypot(self.rms, rms), source=self.source + source)

    def through(self, camera: CameraOptics) -> "ReachedError":
        """Error of an image formed by a camera's parabolic lenses and lenslets."""
        return self if camera.array is None else replace(self, paraxial=paraxial_error(camera))


def of_quadrature(path: str, accuracy: float) -> ReachedError:
    """Error of a path that takes an accuracy: measured at three accuracies, power laws in between."""
    share = np.interp(-math.log10(accuracy), (2, 3, 4), np.log(_MEASURED[path]))
    return ReachedError(accuracy * math.exp(share), f"{path} at accuracy {accuracy:g}")


SINGLE = 1.3
"""Ratio of the error of one sample's image to that of many samples'."""


LEAST_FRESNEL, MOST_BELOW = 2.75, 3.0
"""Number p²/(λb) down to which the operator's error is that of the table, and how much more it is at most
below, where it grows as its inverse: about 1 slices were off by 1.24 times what was asked."""


SLOWEST = 0.8, 0.055
"""Slices behind lenslets whose number is below the first: relative rms at an accuracy of 1e-2. 0.034 to 0.081
at 1e-2, of numbers 0.5 to 0.66; at 3e-3 1.1e-3."""

GAPS = 1.5, 0.012, 0.45, 1.3
"""Slices behind lenslets with gaps whose number is below the first: relative rms at an accuracy of 1e-2 and
the last number, and how it falls with the accuracy. 7.7e-3 and 1.1e-2 at 3e-3, 4.2e-3 at 1e-3."""


def of_operator(intensity: np.ndarray, accuracy: float, camera: CameraOptics | None = None) -> ReachedError:
    """Error of a slice's image: smaller for many samples than for few, larger behind slow lenslets."""
    light, squared = float(np.abs(intensity).sum()), float(np.square(intensity, dtype=float).sum())
    few = SINGLE * math.sqrt(squared) / (light or 1.0)
    found = of_quadrature("operator", accuracy)
    number = math.inf if camera is None else cells.fresnel_number(camera)
    rms = found.rms * max(1.0, few) * min(max(1.0, LEAST_FRESNEL / number), MOST_BELOW)
    if number < SLOWEST[0]:
        rms = max(rms, SLOWEST[1] * (accuracy / 1e-2) ** 2)
    if camera is not None and camera.array is not None and camera.array.fill_factor < 1:
        least, at, power, falls = GAPS
        more = at * (accuracy / 1e-2) ** power * math.sqrt(falls / number) if number < least else 0.0
        rms = max(rms, more)
    return replace(found, rms=rms)


TRACED = 2.5e-3
"""Of a main lens by its prescription, whose rays are fitted by Zernike terms: relative rms beside Huygens
sums over its rays, 1.3e-3 to 4.9e-3."""

SLANTED = 0.5
"""Relative rms of images behind lenslets of glass by the angle at which light arrives [1/rad]: coma and
astigmatism of glass are not followed. 0.33 to 1.0 at 0.03 to 0.06 rad."""


def beside(found: ReachedError, camera: CameraOptics, aslant: float) -> ReachedError:
    """Error with what the camera's own model leaves out of light that arrives at an angle [rad], rms."""
    if camera.objects is not None:
        found = found.and_also(TRACED, ", a main lens by its rays")
    if camera.surface is not None and camera.model == "exact":
        found = found.and_also(SLANTED * aslant, f", glass at {aslant:.2g} rad")
    return found


def aslant(part: Slice | Points, camera: CameraOptics) -> float:
    """Angle [rad], rms over its light, at which light of a part arrives at the lenslets."""
    if isinstance(part, Points):
        light, places = np.abs(part.intensities), part.positions
        squared = (places[:, 0] ** 2 + places[:, 1] ** 2) / (camera.object_distance + places[:, 2]) ** 2
    else:
        light = np.abs(arrays.to_numpy(part.intensity))
        squared = part.grid.y[:, None] ** 2 + part.grid.x**2
        squared = squared / (camera.object_distance + part.dz) ** 2
    weights = np.square(light, dtype=float)
    return math.sqrt(float((weights * squared).sum()) / (float(weights.sum()) or 1.0))


ROUNDING = 1.5e-6
"""Rounding error of points' images in single precision, relative rms."""


def of_points(difference: float, accuracy: float) -> ReachedError:
    """Error of points, from the difference that `points.image_and_error` finds for the brightest."""
    return ReachedError(difference, f"points at accuracy {accuracy:g}, beside another image of one").and_also(
        ROUNDING
    )


def of_white(difference: float, accuracy: float) -> ReachedError:
    """Error of a white image, from the difference that `white.image_and_error` finds."""
    return ReachedError(
        difference, f"white image at accuracy {accuracy:g}, beside light that is followed less far"
    )


def of_convolution(operator_error: float, source: str = "") -> ReachedError:
    """Error of a camera without lenslets, from the one that its operator states."""
    return ReachedError(max(operator_error, ROUNDING), f"convolution with a point's image{source}")


def of_grids(camera: ImagedCamera) -> ReachedError:
    """Error of fields propagated on grids, whatever their number: measured against exact images of slices.

    Before lenslets 1.7e-2 to 3e-2. Without them paraxial lenses and exact free space differ by a spherical
    aberration of W = D⁴/(128 λL³) waves: f/16 to f/63 and 120 mm by 2e-4 to 1e-3, f/8 by 0.1 to 2 W.
    """
    source = "propagation on grids"
    if camera.lattice is not None:
        return ReachedError(0.025, source)
    aberration = camera.pupil_diameter**4 / (128 * camera.wavelength * camera.separation**3)
    return ReachedError(math.hypot(7e-4, 0.5 * aberration), source)


def together(parts: Sequence[tuple[float, ReachedError]]) -> ReachedError | None:
    """Error of a sum of images of the given norms, whose errors are independent."""
    if not parts:
        return None
    whole = math.hypot(*(norm for norm, _ in parts)) or 1.0
    rms = math.hypot(*(norm * part.rms for norm, part in parts)) / whole
    paraxial = math.hypot(*(norm * part.paraxial for norm, part in parts)) / whole
    return ReachedError(rms, "; ".join(dict.fromkeys(part.source for _, part in parts)), paraxial)


def warn_if_missed(asked: float, reached: ReachedError | None) -> None:
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
