"""Object before an instrument, a volume or a picture at one depth, and its operators."""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.adaptive.checked import PICTURE, VOLUME, Kind
from lumigraph.adaptive.clusters import Clusters, on_lattice
from lumigraph.adaptive.sight import Sight
from lumigraph.core import arrays
from lumigraph.core.calibration import Calibration
from lumigraph.deconvolution import Exposure, RichardsonLucy
from lumigraph.deconvolution.beyond import BARELY
from lumigraph.deconvolution.filters import LowPass
from lumigraph.instruments import LensletCamera, LightFieldMicroscope, PlenopticCamera
from lumigraph.operators.microscope_pupil import PupilImages


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the search for one kind of object.

    Parameters
    ----------
    kind
        What it explains itself.
    accuracy
        Of points' images.
    iterations
        Of Richardson-Lucy, accelerated, at first and then.
    resolved
        Of a lenslet, how finely the object is resolved; None for its samples.
    samples
        Along a lenslet; None for as many as `finest` says.
    beside
        Lenslets that the object goes on beyond what sends most of its light onto the picture.
    least
        Part of the most light that a sample must send onto pixels that count, to be lit.
    left
        Standard deviation of a term by errors of the model that leave no trace [waves rms].
    """

    kind: Kind
    accuracy: float
    iterations: tuple[int, int]
    resolved: float | None
    samples: int | None
    beside: int
    least: float
    left: float


OF_VOLUME = Settings(
    VOLUME, accuracy=2e-2, iterations=(4, 15), resolved=None, samples=3, beside=0, least=BARELY, left=0.0
)
"""Few iterations at first, for a volume that explains a wrong wavefront resists it.

With an accuracy of 3e-2, 0.3 waves of astigmatism before a textured volume came out 0.01 to 0.03 too low, by
how pixels were sampled; with 2e-2 or 1e-2, 0.01.
"""

OF_PICTURE = Settings(
    PICTURE, accuracy=1e-2, iterations=(4, 40), resolved=1 / 6, samples=None, beside=2, least=1e-3, left=1e-3
)
"""A main lens sends some per cent of a point's light lenslets aside: where samples beside the picture were
dark, 0.3 waves before a scene that goes on there came out 0.022 too weak; with these, not at all.

Resolved to 1/3, 1/6 and 1/12 of a lenslet, scenes of a fine 0.15 of a lenslet and 1000 electrons a pixel pull
eight terms by 0.0062, 0.0043 and 0.0043 waves rms, smooth ones of 100 electrons by 0.0042, 0.0035 and 0.0036.
Images of an accuracy of 1e-2 pull them by 0.0033 waves, of 5e-3 by 0.0020, at twice the cost: hence `left`.
"""

SETTINGS = {"volume": OF_VOLUME, "picture": OF_PICTURE}

FINER = 1.1
"""Samples of a picture, over as many as hold how the images of its points change from one to the next: with
0.95 of them a picture of 10⁴ electrons a pixel is not explained, with more of them as well."""

OUTER = 2
"""Lenslets at a camera's border whose pixels do not count: they see less light than if the array went on.

With one, 0.5 waves of a camera came out 0.004 off, mostly in defocus; with two, 0.0015.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A volume, or a picture, as an instrument sees it.

    Parameters
    ----------
    instrument
        With the aberrations that are known.
    depths
        Of the planes [m].
    settings
        How the object is looked for.
    pixels
        Calibration of a real instrument.
    """

    instrument: LightFieldMicroscope | PlenopticCamera
    depths: tuple[float, ...]
    settings: Settings
    pixels: Calibration | None

    def method(self, sight: Sight) -> RichardsonLucy:
        """Method by which the object is found."""
        resolved = self.settings.resolved
        low_pass = None if resolved is None else LowPass((sight.samples * resolved,))
        return RichardsonLucy(accelerated=True, filter=low_pass)

    def sight(self, terms: tuple[int, ...]) -> Sight:
        """Operators of the object by the terms' coefficients."""
        images, planes = self._images(terms)
        samples = self.settings.samples or finest(images)
        narrow = Sight(images, planes, samples, -images.layout.frame)
        narrow.require_memory(len(terms))
        sight = Sight.of(images, planes, samples)
        return replace(sight, margin=sight.margin + self.settings.beside)

    def _images(self, terms: tuple[int, ...]) -> tuple[PupilImages, tuple[float, ...]]:
        """Images of points, and the depths of the planes as these count them."""
        accuracy, scope = self.settings.accuracy, self.instrument
        if isinstance(scope, LensletCamera):
            (dz,) = self.depths
            return scope.pupil_images(terms, dz=dz, accuracy=accuracy, pixels=self.pixels), (0.0,)
        farthest = float(np.abs(self.depths).max())
        images = scope.pupil_images(terms, farthest=farthest, accuracy=accuracy, pixels=self.pixels)
        return images, self.depths

    def clusters(self, terms: int) -> Clusters:
        """Clusters of the pixels, for so many terms."""
        return Clusters.of(self.instrument.calibration if self.pixels is None else self.pixels, terms)

    def counted(self, exposure: Exposure) -> Exposure:
        """Exposure without the pixels that see the edge of a camera's array."""
        if not isinstance(self.instrument, LensletCamera):
            return exposure
        inner = inner_pixels(self.instrument, self.pixels)
        weights = 1.0 if exposure.weights is None else arrays.to_numpy(exposure.weights)
        return replace(exposure, weights=inner * weights)


def finest(images: PupilImages) -> int:
    """Samples along a lenslet that hold how points' images change: these have no period below λ/(2 NA)."""
    size = images.lenslet.pitch / images.lenslet.magnification
    periods = max(2 * one.aperture / one.wavelength for one in images.objectives)
    return math.ceil(FINER * size * periods)


def own_defocus(images: PupilImages, depth: float) -> float:
    """Noll's term 4 of what an objective sees at a depth [waves rms], paraxially."""
    one = images.objectives[0]
    path = depth / one.medium + one.image_defocus
    return -path * one.numerical_aperture**2 / (4 * math.sqrt(3) * one.wavelength)


def inner_pixels(camera: PlenopticCamera, pixels: Calibration | None) -> np.ndarray:
    """Weights (ny, nx): 0 behind the `OUTER` lenslets at the array's border, else 1."""
    calibration = camera.calibration if pixels is None else pixels
    array = -camera.lenslets.indices() if pixels is None else calibration.indices
    own = on_lattice(calibration)
    inside = (own > array.min(0) + OUTER - 0.5) & (own < array.max(0) - OUTER + 0.5)
    return inside.all(-1).astype(np.float64)
