"""Beads of a raw image, looked for by Richardson-Lucy through a wavefront."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.adaptive.beads import brightest
from lumigraph.adaptive.fit import Fit
from lumigraph.adaptive.sight import Sight
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure, RichardsonLucy
from lumigraph.deconvolution.beyond import BARELY
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.problem import Problem, Scale, values
from lumigraph.instruments import LightFieldMicroscope
from lumigraph.scene import Points

COARSE = 0.1
"""Accuracy of the images by which beads are looked for."""

SAMPLES = 3
"""Samples along a lenslet of the volume in which beads are searched."""

ITERATIONS = 30
"""Iterations of Richardson-Lucy in a search for beads."""

APART = (1.6, 1.25)
"""Half axes of the spheroids in which light is one bead's, in lenslets: at first, at whatever depth, for
aberrations may spread it, and later."""

FAINT = (0.15, 0.05)
"""Light of a bead that counts, over the brightest's at first, and over the median of those found later."""

BEYOND = 6e-6
"""Distance beyond the outermost depths within which beads may stand [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """Search for beads in a raw image.

    Parameters
    ----------
    sight
        Operators of a volume by coefficients.
    raw, exposure
        What was seen.
    slope
        Of the steepest light in the object.
    size
        Of a lenslet in the object [m].
    """

    sight: Sight
    raw: RawImage | np.ndarray
    exposure: Exposure
    slope: float
    size: float

    @classmethod
    def of(
        cls,
        microscope: LightFieldMicroscope,
        terms: Sequence[int],
        planes: np.ndarray,
        given: tuple[RawImage | np.ndarray, Exposure, Calibration | None],
        accuracy: float,
    ) -> "Search":
        """Search in (raw image, exposure, pixels), on planes [m], with images to an accuracy."""
        raw, exposure, pixels = given
        farthest, part = float(np.abs(planes).max()), microscope.objective
        images = microscope.pupil_images(terms, farthest=farthest, accuracy=accuracy, pixels=pixels)
        slope = part.numerical_aperture / math.sqrt(part.immersion_index**2 - part.numerical_aperture**2)
        images, depths = replace(images, accuracy=COARSE), tuple(map(float, planes))
        Sight(images, depths, SAMPLES).require_memory(0)
        sight = Sight.of(images, depths, SAMPLES)
        return cls(sight, raw, exposure, slope, microscope.lenslet_size)

    def problem(self, coefficients: np.ndarray) -> Problem:
        """Deconvolution problem of the raw image, through aberrations (terms,) [waves rms]."""
        operator = self.sight.operator(coefficients)
        data = values(self.raw, operator, self.exposure)
        return Problem.of(self.raw, self.exposure, Scale.of(operator, self.exposure, data, BARELY))

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest (y, x, dz) of beads [m]."""
        grid, beside = self.sight.grid, np.array([self.size, self.size, BEYOND])
        axes = grid.y, grid.x, self.sight.planes
        return np.array([min(a) for a in axes]) - beside, np.array([max(a) for a in axes]) + beside

    def beads(self, problem: Problem, shown: np.ndarray | None = None) -> Points:
        """Beads of a `problem`; only of what is brighter than `shown` (ny, nx) where that is given."""
        if shown is not None:
            problem = replace(problem, scale=replace(problem.scale, background=shown))
        method, state = RichardsonLucy(), State.at(problem, problem.flat())
        for _ in range(ITERATIONS):
            state = method.step(problem, state)
        volume, grid = np.asarray(state.estimate) * self.sight.brighter, self.sight.grid
        across = APART[shown is not None] * self.size
        along = float(np.ptp(self.sight.planes)) * 10 if shown is None else across / self.slope
        return brightest(volume, (np.array(self.sight.planes), grid.y, grid.x), (across, along), FAINT[0])

    def more(self, fit: Fit, shown: np.ndarray) -> Points | None:
        """Beads in what a fit leaves of the raw image, if bright enough; None where there are none."""
        terms = len(self.sight.images.terms)  # without the beads' spread
        found = self.beads(self.problem(fit.coefficients[:, :terms].mean(0)), shown)
        bright = found.intensities > FAINT[1] * float(np.median(fit.points.intensities))
        return Points(found.positions[bright], found.intensities[bright]) if bright.any() else None
