"""Cameras whose images have derivatives by any difference between two nearby cameras."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Self

from lumigraph.core.grid import Grid
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.sees_volumes import VolumeGradients

if TYPE_CHECKING:
    from lumigraph.operators.lenslets.part_leaning import TiltedImages
    from lumigraph.operators.lenslets.point_images import PointImages
    from lumigraph.operators.lenslets.whole_planes import WholePlane


class CameraGradients(VolumeGradients, Camera):
    """A camera with a main lens: images of points, and raw images of planes and volumes, have derivatives."""

    def part_images(
        self, pairs: Sequence[tuple[Self, Self]], *, accuracy: float = 1e-2
    ) -> "PointImages | TiltedImages[PointImages]":
        """Images of points, with derivatives by any difference between pairs of nearby cameras.

        Parameters
        ----------
        pairs
            (n,), cameras a little to either side of this one: by a length, the aperture, the wavelength, a
            term of the main lens' phase. Derivatives are changes from the first to the last of each.
        accuracy
            Relative rms error of points' images, 1e-3 to 1e-2. Changes are less accurate: by the lenslets'
            focal length and the wavelength 0.05 to 0.15 at 1e-2, 0.03 at 3e-3.

        Raises
        ------
        GeometryError
            The exact model, or lenslets that differ by chance, where they are not square and of one focal
            length; the exact model behind a lens that changes over the field; a pair of other models, numbers
            of pixels or lenslets, or of which other lenslets are missing.
        SamplingError
            Array or sensor is tilted farther than nine distances can follow.

        Examples
        --------
        >>> import numpy as np
        >>> import lumigraph as lg
        >>> camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
        ...     lenslets={"count": (7, 7)}, sensor={"shape": (61, 61)}
        ... )
        >>> pair = (camera.replace(lenslets={"focal_length": f}) for f in ("5.1999 mm", "5.2001 mm"))
        >>> images = camera.part_images([tuple(pair)])
        >>> point = lg.Points(np.array([[1e-5, 0.0, 2e-3]]), np.ones(1))
        >>> change = images.derivative(point, np.ones(1))  # by 0.2 um
        >>> images.gradient(point, images.forward(point)).shape
        (1,)
        """
        from lumigraph.operators.lenslets.part_leaning import by_parts

        return by_parts(self, pairs, accuracy)

    def part_plane(
        self,
        pairs: Sequence[tuple[Self, Self]],
        grid: Grid | None = None,
        dz: float = 0.0,
        *,
        accuracy: float = 1e-2,
    ) -> "WholePlane | TiltedImages[WholePlane]":
        """Raw images of a plane, with derivatives by any difference between pairs of nearby cameras.

        The object stays where it is before all cameras, and as bright for each area: how it falls onto their
        lenslets is part of what is differentiated.

        Parameters
        ----------
        pairs
            As of `part_images`.
        grid
            Samples of the object; those of `operator` if left out.
        dz
            Depth from the focused plane [m], positive farther.
        accuracy
            Relative rms error of raw images, 1e-3 to 1e-2, of objects inside the array's field. Where
            lenslets are alike behind one lens for all fields, images of the outermost ones are some 3 % off,
            and light that misses the array's cells is left out. Where images do not repeat from lenslet to
            lenslet (`over_field`, `prescription`, lenslets that differ, fast ones of the exact model over
            wide fields), each sample is a point, which takes its time.

        Raises
        ------
        GeometryError
            As of `part_images`; a depth that is not imaged.
        SamplingError
            By the methods of what comes back: samples that would take too long as points.

        Examples
        --------
        >>> import numpy as np
        >>> import lumigraph as lg
        >>> camera = lg.load_camera("thesis-plenoptic-2-m050").replace(
        ...     lenslets={"count": (5, 5)}, sensor={"shape": (61, 61)}, main_lens={"diameter": "1 mm"}
        ... )
        >>> pair = (camera.replace(lenslets={"focal_length": f}) for f in ("5.1999 mm", "5.2001 mm"))
        >>> plane = camera.part_plane([tuple(pair)], lg.Grid.square(20, 50e-6))
        >>> raw = plane.forward(np.ones((20, 20)))
        >>> plane.gradient(np.ones((20, 20)), raw).shape
        (1,)
        """
        from lumigraph.operators.lenslets.part_leaning import TiltedImages
        from lumigraph.operators.lenslets.plane_of_points import plane_before

        self.defocused(float(dz))
        images = self.part_images(pairs, accuracy=accuracy)
        wanted = grid or self.operator_grid()

        def plane(one: "PointImages") -> "WholePlane":
            return plane_before(one, wanted, float(dz))

        return images.each(plane) if isinstance(images, TiltedImages) else plane(images)
