"""Microscopes whose images have derivatives by any difference between two nearby microscopes."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Self

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.instruments.described_microscope import DescribedMicroscope
from lumigraph.instruments.sees_volumes import VolumeGradients
from lumigraph.operators import microscope as operators

if TYPE_CHECKING:
    from lumigraph.operators.lenslets.whole_planes import WholePlane

RESOLVED = 0.21
"""Distance of points that hold all that an objective resolves, over λ/NA: 1.2 times closer than λ/(4 NA), so
that the kernel which spreads samples leaves its band alone.
"""


class MicroscopeGradients(VolumeGradients, DescribedMicroscope):
    """A microscope: those whose images are not traced by rays have derivatives."""

    def images_alike(
        self,
        pairs: Sequence[tuple[Self, Self]],
        farthest: float,
        points: int | None = None,
        *,
        accuracy: float = 1e-2,
        double: bool = False,
    ) -> "tuple[operators.PupilImages, list[tuple[operators.PupilImages, operators.PupilImages]]]":
        """Pupil images without terms, and those of pairs of slightly changed microscopes, sampled alike.

        By pixels that may stand anywhere, so that they may move; those of the pairs in double precision.

        Parameters
        ----------
        pairs
            Microscopes a little to either side of this one.
        farthest
            Largest distance of the points from the focused plane [m].
        points
            Along a lenslet, whose light is 1; None for as many as `point_image` has.
        accuracy, double
            As of `pupil_images`.

        Raises
        ------
        GeometryError
            As of `pupil_images`.
        """
        from lumigraph.simulation.microscope_scene import SAMPLES

        sampled = farthest, SAMPLES if points is None else points
        own = self._alike(None, sampled, operators.require_accuracy(accuracy))
        ends = [tuple(end._alike((self, own), sampled, accuracy) for end in pair) for pair in pairs]
        return replace(own, double=double), [(low, high) for low, high in ends]

    def fourier_points(self) -> "operators.FourierPoints":
        """Images of points anywhere by a Fourier microscope, with derivatives by their position.

        Raises
        ------
        GeometryError
            Another configuration.
        """
        if self.configuration != "fourier":
            raise GeometryError(f"fourier_points needs configuration 'fourier', not {self.configuration!r}.")
        return operators.FourierPoints(self.objectives, self._mosaic())

    def _alike(
        self, like: "tuple[Self, operators.PupilImages] | None", told: tuple[float, int], accuracy: float
    ) -> "operators.PupilImages":
        if self.in_pupil:
            raise GeometryError(
                "images of points by the pupil are of configuration '1.0' or '2.0', not 'fourier'."
            )
        operators.require_phase(self.objectives)
        (far, points), N = told, None if like is None else like[1].layout.sampling.pixels
        shortest = min(self.objectives, key=lambda one: one.wavelength)
        pixels = operators.SensorLayout(self.calibration, self.pixels.fill_factor)
        sampling = operators.interpolated(shortest, self.lenslet, pixels, points, (far, -far), accuracy, N)
        layout = operators.laid_out(sampling, self.calibration, self.lenslet_size, np.float64)
        if like is not None and self.calibration.lattice == like[0].calibration.lattice:
            layout = replace(layout, placement=like[1].layout.placement)
        return operators.PupilImages(self.objectives, self.lenslet, layout, (), accuracy, like is not None)

    def part_plane(
        self,
        pairs: Sequence[tuple[Self, Self]],
        grid: Grid | None = None,
        dz: float = 0.0,
        *,
        accuracy: float = 1e-2,
    ) -> "WholePlane":
        """Raw images of a plane, with derivatives by any difference between pairs of nearby microscopes.

        The object stays where it is before all microscopes, along the lenslets' rows and columns, and as
        bright for each area: how it falls onto their lenslets is part of what is differentiated.

        Parameters
        ----------
        pairs
            (n,), microscopes a little to either side of this one: by a length, the aperture, the wavelength,
            a term of the pupil's phase. Derivatives are changes from the first to the last of each.
        grid
            Samples of the object; `object_grid` if left out. They shine as points, as of `operator`, where
            they are farther apart than the objective resolves.
        dz
            Depth from the focused plane [m], positive farther.
        accuracy
            Relative rms error of points' images, 1e-5 to 0.1.

        Raises
        ------
        GeometryError
            Rays; microscopes of another number of lenslets before the pixels.

        Examples
        --------
        >>> import numpy as np
        >>> import lumigraph as lg
        >>> scope = lg.load_camera("lfm-worm").replace(
        ...     objective={"numerical_aperture": 0.5}, lenslets={"count": (5, 5)}, sensor={"shape": (75, 75)}
        ... )
        >>> pair = (scope.replace(lenslets={"pitch": d}) for d in ("149.999 um", "150.001 um"))
        >>> plane = scope.part_plane([tuple(pair)], dz=4e-6)
        >>> raw = plane.forward(np.ones(plane.grid.shape))
        >>> plane.gradient(np.ones(plane.grid.shape), raw).shape
        (1,)
        """
        wanted, depth = grid or self.object_grid, checks.finite("dz", dz)
        if self.in_pupil:
            points = [(low.fourier_points(), high.fourier_points()) for low, high in pairs]
            return operators.FourierPlane(self.fourier_points(), points, wanted, depth)
        shortest = min(self.objectives, key=lambda one: one.wavelength)
        finest = RESOLVED * shortest.wavelength / shortest.aperture
        points = math.ceil(self.lenslet_size / max(finest, min(wanted.pitch)) * (1 - 1e-9))
        own, ends = self.images_alike(pairs, abs(depth), points, accuracy=accuracy)
        return operators.PupilPlane(own, ends, wanted, depth)
