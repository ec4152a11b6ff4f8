"""Coherence of a scene's light: which parts of it interfere.

A coherence turns the parts of a scene into *shots*: fields that are mutually incoherent, so that their
intensities on the sensor are added, each with a weight.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.core.modes import CoherentModes
from lumigraph.elements import masks
from lumigraph.errors import GeometryError, LumigraphError, SamplingError
from lumigraph.operators.sampling.sampling_rules import COARSEST, FINEST
from lumigraph.propagation import propagate
from lumigraph.simulation import directions

Seed = int | np.random.Generator | None

BLOCKS = 8
"""Blocks of shots, whose spread shows the error: two show one difference, which by chance may be small."""

_COARSER, _COARSEST = 8.0, 0.9
"""Times the accuracy of fewer modes, which show how far an image is off, and the largest accuracy of them."""


@dataclass(frozen=True, slots=True, eq=False)
class ScenePlane:
    """A plane of the scene on its way to the main lens.

    Parameters
    ----------
    amplitude
        Square root of its intensity (y, x).
    grid
        Where its samples stand [m].
    distance
        To the main lens [m].
    pupil_diameter
        Diameter of the main lens' stop [m].
    """

    amplitude: np.ndarray
    grid: Grid
    distance: float
    pupil_diameter: float


class Coherence(Protocol):
    """Protocol of a coherence: shots, and their illumination of one plane of the scene."""

    @property
    def shots(self) -> int:
        """Number of mutually incoherent fields."""
        ...

    @property
    def planes_independent(self) -> bool:
        """True if planes have independent phases in each shot, and so may share one propagation."""
        ...

    @property
    def convergence(self) -> float:
        """Power of the number of shots with which the error falls."""
        ...

    @property
    def blocks(self) -> int:
        """Blocks of shots, alike in kind and one after the other, whose spread shows the error; or 1."""
        ...

    def illuminations(self, planes: list[ScenePlane], wavelength: float) -> Iterator[list]:
        """Each shot's complex amplitude on each plane of the scene."""
        ...

    def scale(self, sample_area: float, wavelength: float, pupil_area: float, distance: float) -> float:
        """Factor of a shot's intensity that makes an even scene of intensity 1 a raw image of mean 1."""
        ...


def _positive_count(count: int) -> None:
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise LumigraphError(f"count is {count!r} but must be a whole number of at least 1.")


@dataclass(frozen=True, slots=True)
class Coherent:
    """One plane wave along the axis lights each plane of the scene; planes do not interfere."""

    @property
    def shots(self) -> int:
        """One field."""
        return 1

    @property
    def planes_independent(self) -> bool:
        """No: one wave lights all planes."""
        return False

    @property
    def convergence(self) -> float:
        """None: nothing is drawn."""
        return 0.0

    @property
    def blocks(self) -> int:
        """One: nothing is drawn."""
        return 1

    def illuminations(self, planes: list[ScenePlane], wavelength: float) -> Iterator[list]:
        """Amplitude 1 everywhere."""
        yield [np.ones((1, 1), np.complex64)] * len(planes)

    def scale(self, sample_area: float, wavelength: float, pupil_area: float, distance: float) -> float:
        """A coherent image keeps the object's amplitude, divided by the magnification."""
        return 1.0


@dataclass(frozen=True, slots=True)
class Snapshots:
    """Random phases on the scene, many times: the thesis' way to incoherent light.

    Intensities are added (the thesis' listings add moduli, which is wrong by 25 % rms for any count).

    Parameters
    ----------
    count
        Number of snapshots M. White phases approach the exact incoherent image as 1/sqrt(M): 5 % rms of a
        pixel at 375, 1 % at 9370.
    coherence_index
        None for white phases (one independent phase per sample). A number C for the thesis' masks of
        C × C random areas (thesis 3.4.3): light stays partially coherent, so that the image keeps a bias
        of about 10 % rms at C/N = 0.14 however many snapshots are taken, which its estimated error, made
        from the spread between snapshots, does not see.
    rng
        Seed or generator; the same seed gives the same raw image, whatever the number of workers.

    Examples
    --------
    >>> Snapshots(350, rng=1).shots
    350
    """

    count: int = 100
    coherence_index: int | None = None
    rng: Seed = None

    def __post_init__(self) -> None:
        _positive_count(self.count)
        if self.coherence_index is not None:
            checks.whole("coherence_index", self.coherence_index, error=LumigraphError)

    @property
    def shots(self) -> int:
        """One field for each snapshot."""
        return self.count

    @property
    def planes_independent(self) -> bool:
        """Yes: each plane has its own random phases."""
        return True

    @property
    def convergence(self) -> float:
        """Power 0.5, as for independent random numbers."""
        return 0.5

    @property
    def blocks(self) -> int:
        """A few."""
        return min(self.count, BLOCKS)

    def illuminations(self, planes: list[ScenePlane], wavelength: float) -> Iterator[list]:
        """Random phases, independent from plane to plane and from snapshot to snapshot."""
        grids = [plane.grid for plane in planes]
        for rng in np.random.default_rng(self.rng).spawn(self.count):
            if self.coherence_index is None:
                yield [masks.white_phase(grid, rng) for grid in grids]
            else:
                yield [masks.random_phase_mask(g, wavelength, self.coherence_index, rng) for g in grids]

    def scale(self, sample_area: float, wavelength: float, pupil_area: float, distance: float) -> float:
        """A sample radiates into all angles; this is the inverse of the part that enters the pupil."""
        return wavelength**2 * distance**2 / (sample_area * pupil_area) / self.count


@dataclass(frozen=True, slots=True, init=False)
class Incoherent:
    """Spatially incoherent light, like every lit scene.

    A camera without lenslets has its exact image, to 1e-4 rms: the object convolved with the image of a point
    (`operators.single_lens`). Before a lenslet array slices go through the lenslet-periodic operator
    (`operators.periodic`), points and white images through quadratures of their own (`operators.points`,
    `operators.white`), all to `accuracy` and without speckle. What takes more memory or time than there is
    is refused, with the accuracy that could be had; nothing is replaced by `Snapshots`. The raw image's
    ``metadata["error"]`` holds the estimated relative rms error and its source.

    Parameters
    ----------
    accuracy
        Relative rms error, 1e-2 to 1e-5; within a lenslet of the array's border it may be twice as large.

    Raises
    ------
    LumigraphError
        An accuracy out of range, or `snapshots` and `rng`, which are those of `Snapshots`.
    """

    accuracy: float = 1e-3

    def __init__(self, accuracy: float = 1e-3, **others: object) -> None:
        if others:
            raise LumigraphError(
                f"Incoherent takes no {' and no '.join(others)}: its images are exact and have no snapshots. "
                "Leave it out, or use Snapshots(count, rng=...)."
            )
        accuracy = checks.finite("accuracy", accuracy, "1", LumigraphError)
        if not FINEST <= accuracy <= COARSEST:
            raise SamplingError(
                f"accuracy is {accuracy:g} but must lie between {FINEST:g} and {COARSEST:g}, relative rms."
            )
        object.__setattr__(self, "accuracy", accuracy)


@dataclass(frozen=True, slots=True)
class TiltedWaves:
    """Mutually incoherent plane waves light the scene one after the other (Abbe's method).

    The illumination converges on the main lens (Köhler), so that a wave without tilt fills the pupil's
    centre from every point of the scene. Directions follow the R2 low-discrepancy sequence, moved so that
    more of them fall where the object sends more light through the pupil, with weights that make up for it.
    Of a binary chart before a single lens 30, 75 and 260 waves give 5, 3 and 1 % rms, where random phases
    take 375, 1040 and 9370. Behind lenslets they gain little over `Snapshots`.

    Parameters
    ----------
    count
        Number of waves.
    na
        Numerical aperture of the illumination, a disc of directions: 0 is coherent, the main lens' own
        is matched. None fills all directions that the scene's grid can tell apart, whose limit for many
        waves is fully incoherent light.
    """

    count: int = 64
    na: float | None = None

    def __post_init__(self) -> None:
        _positive_count(self.count)
        if self.na is not None:
            checks.finite("na", self.na, "1", LumigraphError)
            if not 0 <= self.na <= 1:
                raise LumigraphError(f"na is {self.na:g} but must lie between 0 and 1.")

    @property
    def shots(self) -> int:
        """One field for each wave."""
        return self.count

    @property
    def planes_independent(self) -> bool:
        """No: one wave lights all planes."""
        return False

    def directions(self, plane: ScenePlane, wavelength: float) -> tuple[np.ndarray, np.ndarray]:
        """Direction sines (count, 2) as (y, x), and the weight of each wave's intensity (count,)."""
        radius = plane.pupil_diameter / (2 * wavelength * plane.distance)
        share, frequencies = directions.share_of_light(plane.amplitude, plane.grid, radius)
        if self.na is None:
            found, weights = directions.over_the_band(share, frequencies, self.count)
            return found * wavelength, weights
        if (limit := wavelength / (2 * max(plane.grid.pitch))) < self.na:
            raise SamplingError(
                f"na is {self.na:g} but the scene's pitch of {max(plane.grid.pitch) * 1e6:.3g} µm "
                f"resolves directions up to {limit:.3g}. Use a pitch of "
                f"{wavelength / (2 * self.na) * 1e6:.3g} µm or finer."
            )
        found, weights = directions.over_a_disc(share, frequencies, self.na / wavelength, self.count)
        return found * wavelength, weights

    @property
    def convergence(self) -> float:
        """Power 0.75, as for quasi-random points counted in a disc: here, the main lens' pupil."""
        return 0.75

    @property
    def blocks(self) -> int:
        """A few: what comes one after the other covers all directions evenly."""
        return min(self.count, BLOCKS)

    def illuminations(self, planes: list[ScenePlane], wavelength: float) -> Iterator[list]:
        """Converging waves exp(-ikr²/2z) with a tilt, each as bright as the directions it stands for."""
        k = 2 * math.pi / wavelength
        tilts = [self.directions(plane, wavelength) for plane in planes]
        for number in range(self.count):
            waves = []
            for plane, (sines, weights) in zip(planes, tilts, strict=True):
                grid, curvature = plane.grid, 2 * plane.distance
                along_y = np.exp(1j * k * (sines[number, 0] * grid.y - grid.y**2 / curvature))
                along_x = np.exp(1j * k * (sines[number, 1] * grid.x - grid.x**2 / curvature))
                along_x *= math.sqrt(weights[number])
                waves.append((along_y[:, None] * along_x).astype(np.complex64))
            yield waves

    def scale(self, sample_area: float, wavelength: float, pupil_area: float, distance: float) -> float:
        """Waves whose direction enters the pupil carry the image; the others are the dark field."""
        pupil = pupil_area / distance**2
        source = wavelength**2 / sample_area if self.na is None else math.pi * self.na**2
        return max(1.0, source / pupil) / self.count


@runtime_checkable
class Source(Protocol):
    """Source of partially coherent light, such as `scene.GaussianSchell` or `scene.ExtendedSource`."""

    def sampled(
        self, grid: Grid, wavelength: float, distance: float, accuracy: float, dtype: Any
    ) -> CoherentModes:
        """The light on a grid at a distance behind the plane for which the source is described [m]."""
        ...


@dataclass(frozen=True, slots=True)
class PartiallyCoherent:
    """Light of a source shines through each slice, as coherent modes whose images add.

    The source is described on the focused plane; its light goes to slices at other depths by the source's
    own formulas, and planes do not interfere or hide one another. Of a slice of intensity 1 where the source
    gives 1, what enters the main lens arrives: to fill it from a wide slice, let the light converge, as in
    ``ExtendedSource.disc(na, distance=-camera.object_distance)``. Quadratures follow each mode, as for
    `Coherent`; not before lenslets that are turned.

    Parameters
    ----------
    source
        `GaussianSchell` or `ExtendedSource`; or `CoherentModes` of the camera's wavelength, with a sample
        wherever a slice has one, in the focused plane.
    accuracy
        Error of a source's mutual intensity, over the largest intensity; `CoherentModes` have their own. What
        it does to the image is found beside an image of fewer modes, as part of ``metadata["error"]``.

    Raises
    ------
    GeometryError
        No source, or an accuracy that is not between 0 and 1.
    """

    source: Source | CoherentModes
    accuracy: float = 1e-3

    def __post_init__(self) -> None:
        if not isinstance(self.source, Source | CoherentModes):
            raise GeometryError(
                f"source is of type {type(self.source).__name__} but must be GaussianSchell(...), "
                "ExtendedSource.disc(...) or CoherentModes."
            )
        if not 0 < checks.finite("accuracy", self.accuracy, "1") < 1:
            raise GeometryError(f"accuracy is {self.accuracy:g} but must lie between 0 and 1.")

    def on(self, grid: Grid, dz: float, wavelength: float) -> CoherentModes:
        """Modes on a plane at a depth from the focused plane [m].

        Raises
        ------
        GeometryError
            `CoherentModes` of another wavelength, or without samples on the plane.
        SamplingError
            More modes than fit in memory.
        """
        if not isinstance(self.source, CoherentModes):
            return self.source.sampled(grid, wavelength, -dz, self.accuracy, np.complex64)
        known = self.source.grid
        if any(abs(w - wavelength) > 1e-9 * wavelength for w in self.source.wavelengths):
            told = ", ".join(f"{w * 1e9:.6g}" for w in self.source.wavelengths)
            raise GeometryError(
                f"the modes have {told} nm but the camera {wavelength * 1e9:.6g} nm. Give modes of its "
                "wavelength, or camera.replace(wavelength=...)."
            )
        first = grid.samples_to(known)
        if any(a < 0 or a + n > m for a, n, m in zip(first, grid.shape, known.shape, strict=True)):
            raise GeometryError(
                f"a slice of {grid.shape[0]} x {grid.shape[1]} samples reaches beyond the modes' grid of "
                f"{known.shape[0]} x {known.shape[1]}. Give modes on a larger grid."
            )
        return self.source.through(lambda field: propagate(field, -dz, grid=grid))

    def fewer(self, modes: CoherentModes, grid: Grid, dz: float) -> CoherentModes | None:
        """Fewer modes on a plane, of twice the error or more, to judge others by; None where there are none.

        Parameters
        ----------
        modes
            Those of `on`.
        grid, dz
            The plane.
        """
        accuracy = self.accuracy
        judged = isinstance(self.source, CoherentModes) or modes.count == 1
        while not judged and accuracy < _COARSEST:
            accuracy = min(_COARSER * accuracy, _COARSEST)
            found = replace(self, accuracy=accuracy).on(grid, dz, modes.wavelengths[0])
            if found.count < modes.count and found.error > 2 * modes.error:
                return found
        return None
