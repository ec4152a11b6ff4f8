"""What the lenslet-periodic operator of one depth depends on, and its sizes."""

import hashlib
import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.elements import LensletArray
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics
from lumigraph.operators.sampling.cell_axis import SLACK, CellAxis
from lumigraph.operators.sampling.cells import Cells
from lumigraph.operators.sampling.sampling_rules import Edges, SamplingRules

VERSION = 24
"""Of what is kept on disk: to be raised with every change of the numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """What the kernels of one depth depend on.

    Parameters
    ----------
    camera, array, cells, fineness
        The camera, its array with rows along x, the array's cells, and the accuracy.
    distance
        Object to main lens [m].
    blurred
        That of the plane whose points are blurred most, of those that share the cells [m].
    place
        Where all cells are taken to be in the straight array (y, x) [m]; it matters to the exact model.
    followed_to
        How far beyond a cell light comes into it [pitches]; None for what the accuracy asks.
    """

    camera: CameraOptics
    array: LensletArray
    cells: Cells
    fineness: SamplingRules
    distance: float
    blurred: float
    place: tuple[float, float] = (0.0, 0.0)
    followed_to: float | None = None

    @classmethod
    def of(
        cls, camera: HasOptics, distance: float, accuracy: float, blurred: float | None = None
    ) -> "Optics":
        """Of a plane at a distance from the main lens [m]; `blurred`, that of the most blurred of several."""
        plain, fineness = camera.optics(), SamplingRules(accuracy)
        array, widest = _cells.lenslet_array(plain), distance if blurred is None else blurred
        cells = _cells.cells_of(plain, array, fineness, widest)
        return cls(plain, array, cells, fineness, distance, widest)

    def alike(self, camera: HasOptics) -> "Optics":
        """Of a camera that hardly differs, with as many cells, points and samples, at a depth as far away."""
        plain = camera.optics()
        array, distance = _cells.lenslet_array(plain), self.distance
        own, mine = _cells.cells_of(plain, array, self.fineness, distance), self.cells
        cells = replace(own, count=mine.count, points=mine.points, samples=mine.samples, ring=mine.ring)
        # To a quarter pitch, of which cameras beside it have as many; whole samples, however rounded.
        followed = self.followed_to or _quarters(self._aside / self.array.lattice.pitch) * (1 - 1e-9)
        return replace(self, camera=plain, array=array, cells=cells, followed_to=followed)

    @property
    def bricks(self) -> "Optics":
        """With a cell around each lenslet, as the matrices have them."""
        return replace(self, cells=_cells.bricks_of(self.camera, self.array, self.fineness, self.blurred))

    @property
    def rotation(self) -> float:
        """Of the array [rad]; the cells lie in a frame that turns with it."""
        return 0.0 if self.camera.lattice is None else self.camera.lattice.rotation

    @property
    def key(self) -> str:
        """Names all that the matrix depends on: not the pixels, nor the object's samples."""
        camera = self.camera
        with np.printoptions(threshold=2**62, floatmode="unique"):
            known = repr((
                VERSION, camera.wavelength, camera.separation, camera.lenslet_distance, camera.pupil_diameter,
                _cells.lens(camera), self.array, self.cells, self.fineness, self.distance, camera.model,
                self.place,
            ))  # fmt: skip
            known += "".join(repr(x) for x in (_cells.accepted(camera), camera.surface) if x is not None)
        return hashlib.sha256(known.encode()).hexdigest()[:32]

    @property
    def straight(self) -> bool:
        """Whether what the lenslets do along y does not depend on x."""
        return self.array.shape == "square" and not isinstance(self.array.focal_length, tuple)

    @property
    def precision(self) -> type[np.floating]:
        """Of the right factors: half of it, off by 2e-4, where those are many and the accuracy allows."""
        return np.float32 if self.straight or self.fineness.accuracy < 1e-3 else np.float16

    @property
    def spill(self) -> float:
        """How far a micro-image reaches over its lenslet's edge [m]."""
        return _cells.spill(self.camera)

    @property
    def blur(self) -> float:
        """Radius of a point's geometric image [pitches]."""
        return _cells.blur(self.camera, self.distance) / self.array.lattice.pitch

    @property
    def axes(self) -> tuple[CellAxis, CellAxis]:
        """Sampling of a cell along y and along x."""
        band = SLACK / 2 / _cells.airy(self.camera)
        y, x = (
            CellAxis(size, points, samples, self._aside, band)
            for size, points, samples in zip(
                self.cells.size, self.cells.points, self.cells.samples, strict=True
            )
        )
        return y, x

    @property
    def _aside(self) -> float:
        """How far beyond a cell light comes into it [m]."""
        pitch = self.array.lattice.pitch
        if self.followed_to is not None:
            return self.followed_to * pitch
        return self.fineness.neighbours(*self._lit_alike) * pitch + self.spill

    @property
    def beside(self) -> float:
        """How far beyond a lenslet its light is followed, as `SamplingRules.beside`, to a quarter pitch [m].

        Depths whose points light much the same share what lenslets do to light.
        """
        pitch = self.array.lattice.pitch
        return _quarters(self.fineness.beside(*self._lit_alike) + self.spill / pitch) * pitch

    @property
    def _lit_alike(self) -> tuple[float, float, Edges]:
        """What tells how far lenslets send light aside."""
        return _cells.fresnel_number(self.camera), self.blur, _cells.edges(self.array)

    @property
    def reach(self) -> tuple[int, int]:
        """Cells along y and x to which a point's light is followed in full.

        Two lenslets at least, three below 5e-3: beyond one of them samples of slices had 2.2e-2 of their
        images, beyond two 3.5e-3. Four below 5e-3 behind straight opaque rims: samples on them were off by
        2.4e-3 at 1e-3 in a camera 1.0. Two beyond a point's image, whose lenslets send light aside however
        little the main lens does: with one, slices were off by 1.2e-2 to 1.6e-2 at 1e-2, by 1.1e-3 at 1e-3.
        """
        least = 2 if self.fineness.accuracy >= 5e-3 else 4 if _cells.edges(self.array) == "straight" else 3
        return self._cells(max(math.ceil(self.followed), self._beyond, least))

    @property
    def _beyond(self) -> int:
        """Lenslets to two beyond a point's image, but for a twentieth of one."""
        return math.ceil(self.blur + 1.95)

    @property
    def followed(self) -> float:
        """How far a point's light is followed inside the array [pitches]."""
        return self.fineness.reach(*self._spread) / self.array.lattice.pitch

    @property
    def lit(self) -> float:
        """How far from a point's image lenslets are lit [m]: as far as their light is followed."""
        return (self.followed + 1) * self.array.lattice.pitch

    @property
    def near(self) -> tuple[int, int]:
        """Cells to which a point's light is followed at the border of the array.

        A lenslet farther behind straight opaque rims: the image of a point on them is half as bright as
        others, and they send light along two lines. Two at least: with one, cameras 1.0 and Galilean ones
        were off by 2e-2 and 5e-3, at 3e-3, two lenslets inside. Three from 2e-3 on: with two, a camera 1.0 in
        focus was off by 3e-3 at 1e-3. Four below 5e-4: an array ends in straight rims, and beyond them three
        left out 3e-4 of a point's image. Two beyond a point's image from 2e-3 on, as inside: with one, discs
        were off by 1.3e-3 at 1e-3.
        """
        accuracy = self.fineness.accuracy
        least = 2 if accuracy > 2e-3 else max(3, self._beyond) if accuracy >= 5e-4 else max(4, self._beyond)
        y, x = self._cells(max(least, math.ceil(self.missed)))
        return min(y, self.reach[0]), min(x, self.reach[1])

    @property
    def missed(self) -> float:
        """How far a point's light is followed at the border of the array [pitches]."""
        farther = 1 if _cells.edges(self.array) == "straight" else 0
        return self.fineness.near(*self._spread) / self.array.lattice.pitch + farther

    def _cells(self, lenslets: int) -> tuple[int, int]:
        """Cells along y and x that so many lenslets on each side lie in, one at least."""
        far = (max(1, lenslets) + 0.5) * self.array.lattice.pitch
        y, x = (math.ceil(far / size - 0.5 - 1e-6) for size in self.cells.size)
        return y, x

    def margin(self, reach: tuple[int, int]) -> tuple[int, int]:
        """Cells on each side that hold those `reach` away: one more where rows are staggered."""
        return reach[0], reach[1] + self.cells.staggered

    @property
    def _spread(self) -> tuple[float, float]:
        """Radius of a point's geometric image and width of the diffraction around it [m].

        An edge between lenslets that cuts a sharp image spreads it over micro-images, however small it is.
        """
        pitch = self.array.lattice.pitch
        cut = pitch / 4 * max(0.0, 1 - 2 * self.blur)
        return self.blur * pitch + self.spill, max(_cells.diffraction(self.camera), cut)

    def images_bytes(self, reach: tuple[int, int]) -> float:
        """Memory that images of points `reach` cells around square lenslets are made from [bytes]."""
        (y, x), n = self.axes, 2 * reach[0] + 1
        return 8.0 * (n * y.points + 2 * y.margin) * (2 * reach[1] + 1) * x.points * x.samples

    def few(self, reach: tuple[int, int]) -> tuple[float, float]:
        """Points along y and x from whose light follows that of all, some more than the band has."""
        y, x = (
            (2 * r + 1) * axis.size * 2 * axis.band + 12
            for axis, r in zip(self.axes, self.margin(reach), strict=True)
        )
        return y, x

    @property
    def image_scale(self) -> float:
        """Magnification of the telecentric image onto the sensor, 1 + b/L."""
        return 1 + _cells.lenslet_distance(self.camera) / self.camera.separation


def _quarters(pitches: float) -> float:
    """Rounded up."""
    return math.ceil(4 * pitches - 1e-6) / 4
