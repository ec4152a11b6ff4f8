r"""Images of points before a camera with lenslets, and how they change with whatever changes of it.

A point's light is a product of matrices, and a raw image what pixels take of its square,

.. math:: I = R\,|U|^2, \quad U = A(E_y P E_x^T), \quad
          \delta I = R\,2\,\mathrm{Re}(U^* \delta U) + \delta R\,|U|^2

with P the wave in the main lens, E phases of nodes there times those of places before the lenslets, and A
the way past these, whose steps are each linear in a matrix (`passed`). How all matrices change with a length,
the wavelength or a term of the phase is the difference of two cameras a little apart, sampled alike; all else
is differentiated. What is made of the image is followed back to them once, so that each camera more
costs no product of large matrices.
"""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from lumigraph.core.threads import single_products
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.camera import CameraOptics
from lumigraph.operators.fineness import COARSEST
from lumigraph.operators.part_sight import Sight
from lumigraph.operators.part_waves import Both, Change, Slopes, Waves, read_anew, times
from lumigraph.operators.point_changes import has_changes
from lumigraph.scene import Points

FINEST = 1e-3
"""Accuracy that can be asked for: finer ones would need many samples across the main lens."""


@dataclass(frozen=True, eq=False)
class PartImages:
    """How a camera sees points, with derivatives by what differs between pairs of cameras.

    Points shine as samples of the camera's own object grid, as `simulate` has them.

    Parameters
    ----------
    camera
        With lenslets of any shape and focal lengths, paraxial, behind a thin lens for all fields.
    pairs
        (n,), cameras a little to either side of it: by a length, a term of the phase, the wavelength.
    accuracy
        Relative rms error of points' images.

    Raises
    ------
    GeometryError
        Another camera; one of a pair that has another number of pixels or lenslets.
    SamplingError
        An accuracy out of 1e-3 to 1e-2.
    """

    camera: CameraOptics
    pairs: tuple[tuple[CameraOptics, CameraOptics], ...]
    accuracy: float = 1e-2

    def __post_init__(self) -> None:
        if not FINEST <= self.accuracy <= COARSEST:
            raise SamplingError(
                f"accuracy is {self.accuracy:g} but must lie between {FINEST:g} and {COARSEST:g}."
            )
        for one in (self.camera, *(end for pair in self.pairs for end in pair)):
            require_paraxial(one)
            _require_as_many(one, self.camera)

    @property
    def shape(self) -> tuple[int, int]:
        """Of a raw image."""
        return self.camera.sensor.shape

    @single_products()
    def forward(self, points: Points) -> np.ndarray:
        """Raw image (ny, nx) of points."""
        own = Sight.of(self.camera, points, self.accuracy)
        light = np.zeros(own.shape)
        for spot in own.spots(points):
            light[spot.window] += spot.intensity * np.abs(Waves.of(own, spot).field) ** 2
        return own.read.forward(light)

    @single_products()
    def derivative(self, points: Points, change: np.ndarray) -> np.ndarray:
        """Change (ny, nx) of `forward`, so many times (n,) from the first to the last camera of each pair."""
        if np.shape(change) != (len(self.pairs),):
            raise GeometryError(f"change has shape {np.shape(change)} but must be ({len(self.pairs)},).")
        own = Sight.of(self.camera, points, self.accuracy)
        light, moved, spots = np.zeros(own.shape), np.zeros(own.shape), own.spots(points)
        by = Change.of(own, zip(np.asarray(change, np.float64).tolist(), self.ends(own), strict=True), spots)
        for spot in spots:
            waves = Waves.of(own, spot)
            light[spot.window] += spot.intensity * np.abs(waves.field) ** 2
            moved[spot.window] += 2 * spot.intensity * np.real(waves.field.conj() * waves.changed(by))
        return own.read.forward(moved) + by.sum(lambda one: one.read.forward(light))

    @single_products()
    def gradient(self, points: Points, weights: np.ndarray) -> np.ndarray:
        """Transpose of `derivative`: (n,) from weights (ny, nx) of the raw image's pixels."""
        if np.shape(weights) != self.shape:
            raise GeometryError(f"weights have shape {np.shape(weights)} but the raw image {self.shape}.")
        own = Sight.of(self.camera, points, self.accuracy)
        seen, by, light = own.read.adjoint(np.asarray(weights, np.float64)), Slopes(), np.zeros(own.shape)
        found, ends = np.zeros(len(self.pairs)), self.ends(own)
        for dz, spots in groupby(own.spots(points), lambda spot: spot.dz):
            pupil = np.zeros(())
            for spot in spots:
                waves = Waves.of(own, spot)
                light[spot.window] += spot.intensity * np.abs(waves.field) ** 2
                pupil = pupil + by.add(waves, spot.intensity * seen[spot.window] * waves.field.conj())
            found += [times(pupil, *(one.anew.pupil(dz) for one in both)) for both in ends]
        seen_anew = [read_anew(both, light, weights) for both in ends]
        return 2 * (found + [by.along(first.anew, last.anew) for first, last in ends]) + seen_anew

    def ends(self, own: Sight) -> list[Both]:
        """Cameras of each pair."""
        return [(own.alike(first), own.alike(last)) for first, last in self.pairs]


def require_paraxial(camera: CameraOptics) -> None:
    """Refuse cameras whose light behind lenslets is no product along two axes."""
    array = camera.array
    if not has_changes(camera) or array is None or array.scatter is not None:
        raise GeometryError(
            "derivatives by a camera's parts are of paraxial cameras with lenslets that are alike, behind a "
            "thin lens. Use model = 'paraxial' without over_field, prescription and scatter."
        )


def _require_as_many(camera: CameraOptics, other: CameraOptics) -> None:
    """Refuse cameras between which more differs than numbers that change by little."""
    counts = []
    for one in (camera, other):
        extent, pitches = (one.array.extent, one.array.lattice.pitches) if one.array else (None, ())
        counts.append(tuple(round(e / p) for e, p in zip(extent or (), pitches, strict=False)))
    if camera.sensor.shape != other.sensor.shape or counts[0] != counts[1]:
        raise GeometryError(
            f"cameras have {camera.sensor.shape} and {other.sensor.shape} pixels, {counts[0]} and "
            f"{counts[1]} lenslets, but derivatives need as many. Give lenslets.count and sensor.shape."
        )
