"""What stands before an instrument: a volume, or a picture at one depth, and what shows it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.adaptive.sight import Sight
from lumigraph.core import arrays
from lumigraph.core.calibration import Calibration
from lumigraph.deconvolution import Exposure, RichardsonLucy
from lumigraph.deconvolution.beyond import BARELY
from lumigraph.deconvolution.filters import LowPass
from lumigraph.instruments import LensletCamera, LightFieldMicroscope, PlenopticCamera
from lumigraph.operators.microscope_pupil import PupilImages

ACCURACY = {"volume": 2e-2, "picture": 1e-2}
"""Of points' images.

With 3e-2, 0.3 waves of astigmatism before a textured volume came out 0.01 to 0.03 too low, by how pixels were
sampled; with 2e-2 or 1e-2, 0.01.
"""

ITERATIONS = {"volume": (4, 15), "picture": (4, 40)}
"""Of Richardson-Lucy, accelerated: few at first, for a volume that explains a wrong wavefront resists it.

After 15 iterations, pictures of a camera without aberrations looked likelier with 0.008 waves of defocus and
spherical aberration; after 40 and 200 with no more than noise brings, 0.003.
"""

SMOOTH = 1 / 3
"""Of a lenslet, how finely a picture is resolved.

A picture as fine as its samples explains noise, and the better the more light is spread: without aberrations
0.009 waves came out after 40 iterations, 0.024 after 200. With 1/5 to 1/2 of a lenslet it was 0.003.
"""

MORE = {"volume": 0, "picture": 2}
"""Lenslets that the object goes on beyond what sends most of its light onto the picture."""

LEAST = {"volume": BARELY, "picture": 1e-3}
"""Part of the most light that a sample must send onto pixels that count, to be lit.

A main lens sends some per cent of a point's light lenslets aside. Where samples beside the picture were dark,
0.3 waves before a scene that goes on there came out 0.022 too weak; with these, not at all.
"""

LEFT = {"volume": 0.0, "picture": 1e-3}
"""Standard deviation of a term by what such a picture leaves [waves rms], beside that of noise."""

SAMPLES = 3
"""Of a volume along a lenslet."""

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
    kind
        "volume" or "picture".
    pixels
        Calibration of a real instrument.
    """

    instrument: LightFieldMicroscope | PlenopticCamera
    depths: tuple[float, ...]
    kind: str
    pixels: Calibration | None

    @property
    def iterations(self) -> tuple[int, int]:
        """Of Richardson-Lucy, at first and then."""
        return ITERATIONS[self.kind]

    @property
    def least(self) -> float:
        """Light that a sample must send onto pixels that count, over the most."""
        return LEAST[self.kind]

    @property
    def left(self) -> float:
        """Standard deviation of a term by what the object leaves [waves rms]."""
        return LEFT[self.kind]

    def method(self, sight: Sight) -> RichardsonLucy:
        """By which it is found."""
        low_pass = LowPass((sight.samples * SMOOTH,)) if self.kind == "picture" else None
        return RichardsonLucy(accelerated=True, filter=low_pass)

    def sight(self, terms: tuple[int, ...]) -> Sight:
        """Its operators by the terms' coefficients."""
        images, planes = self._images(terms)
        samples = finest(images) if self.kind == "picture" else SAMPLES
        narrow = Sight(images, planes, samples, -images.layout.frame)
        narrow.require_memory()
        sight = Sight.of(images, planes, samples)
        return replace(sight, margin=sight.margin + MORE[self.kind])

    def _images(self, terms: tuple[int, ...]) -> tuple[PupilImages, tuple[float, ...]]:
        """Images of points, and the depths of the planes as these count them."""
        accuracy, scope = ACCURACY[self.kind], self.instrument
        if isinstance(scope, LensletCamera):
            (dz,) = self.depths
            return scope.pupil_images(terms, dz=dz, accuracy=accuracy, pixels=self.pixels), (0.0,)
        farthest = float(np.abs(self.depths).max())
        images = scope.pupil_images(terms, farthest=farthest, accuracy=accuracy, pixels=self.pixels)
        return images, self.depths

    def counted(self, exposure: Exposure) -> Exposure:
        """Without the pixels that see where a camera's array ends."""
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
    ny, nx = calibration.shape
    y, x = calibration.straightened(np.arange(ny)[:, None] + 0.0, np.arange(nx)[None, :] + 0.0)
    origin = calibration.lattice.origin
    place = np.stack(np.broadcast_arrays(y - origin[0], x - origin[1]), -1)
    own = place @ np.linalg.inv(calibration.lattice.matrix).T
    inside = (own > array.min(0) + OUTER - 0.5) & (own < array.max(0) - OUTER + 0.5)
    return inside.all(-1).astype(np.float64)
