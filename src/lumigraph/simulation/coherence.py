"""How the light of a scene interferes with itself.

A coherence turns the parts of a scene into *shots*: fields that are mutually incoherent, so that their
intensities on the sensor are added, each with a weight.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lumigraph.core import checks
from lumigraph.core.grid import Grid
from lumigraph.elements import masks
from lumigraph.errors import LumigraphError, SamplingError

Seed = int | np.random.Generator | None


class Coherence(Protocol):
    """What `simulate` asks of a coherence: shots, and their illumination of one plane of the scene."""

    @property
    def shots(self) -> int:
        """Number of mutually incoherent fields."""
        ...

    @property
    def planes_independent(self) -> bool:
        """Whether planes have independent phases in each shot, and may so share one propagation."""
        ...

    def illuminations(self, grids: list[Grid], wavelength: float, distances: list[float]) -> Iterator[list]:
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

    def illuminations(self, grids: list[Grid], wavelength: float, distances: list[float]) -> Iterator[list]:
        """Amplitude 1 everywhere."""
        yield [np.ones((1, 1), np.complex64)] * len(grids)

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
        of about 10 % rms at C/N = 0.14 however many snapshots are taken.
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

    def illuminations(self, grids: list[Grid], wavelength: float, distances: list[float]) -> Iterator[list]:
        """Random phases, independent from plane to plane and from snapshot to snapshot."""
        for rng in np.random.default_rng(self.rng).spawn(self.count):
            if self.coherence_index is None:
                yield [masks.white_phase(grid, rng) for grid in grids]
            else:
                yield [masks.random_phase_mask(g, wavelength, self.coherence_index, rng) for g in grids]

    def scale(self, sample_area: float, wavelength: float, pupil_area: float, distance: float) -> float:
        """A sample radiates into all angles; this is the inverse of the part that enters the pupil."""
        return wavelength**2 * distance**2 / (sample_area * pupil_area) / self.count


@dataclass(frozen=True, slots=True)
class Incoherent:
    """Spatially incoherent light, like every lit scene.

    Points are exact: their intensities are added. Extended scenes before a lenslet array that is not
    turned go through the lenslet-periodic operator (`simulation.periodic`), without speckle, to 1 to 3 %
    rms. Single lenses, turned arrays and operators above 1 GiB take white-phase `Snapshots`, which carry
    speckle of about 1/sqrt(snapshots) rms in a pixel that resolves it.

    Parameters
    ----------
    snapshots
        Number of snapshots, where they are needed.
    rng
        Seed or generator of the snapshots.
    """

    snapshots: int = 100
    rng: Seed = 0

    def __post_init__(self) -> None:
        _positive_count(self.snapshots)


@dataclass(frozen=True, slots=True)
class TiltedWaves:
    """Mutually incoherent plane waves light the scene one after the other (Abbe's method).

    The illumination converges on the main lens (Köhler), so that a wave without tilt fills the pupil's
    centre from every point of the scene. Tilts follow the R2 low-discrepancy sequence.

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

    def directions(self, grid: Grid, wavelength: float) -> np.ndarray:
        """Direction sines (count, 2) as (y, x)."""
        golden = 1.32471795724474602596  # root of x³ = x + 1: Roberts' R2 sequence
        unit = np.mod(0.5 + np.arange(self.count)[:, None] / [golden, golden**2], 1.0)
        if self.na is None:
            return (unit - 0.5) * wavelength / np.asarray(grid.pitch)
        if (limit := wavelength / (2 * max(grid.pitch))) < self.na:
            raise SamplingError(
                f"na is {self.na:g} but the scene's pitch of {max(grid.pitch) * 1e6:.3g} um tells directions "
                f"apart up to {limit:.3g}. Use a pitch of {wavelength / (2 * self.na) * 1e6:.3g} um or finer."
            )
        radius, angle = self.na * np.sqrt(unit[:, 0]), 2 * math.pi * unit[:, 1]
        return np.stack([radius * np.sin(angle), radius * np.cos(angle)], axis=1)

    def illuminations(self, grids: list[Grid], wavelength: float, distances: list[float]) -> Iterator[list]:
        """Converging waves exp(-ikr²/2z) with a tilt."""
        k = 2 * math.pi / wavelength
        tilts = [self.directions(grid, wavelength) for grid in grids]
        for number in range(self.count):
            planes = []
            for grid, distance, directions in zip(grids, distances, tilts, strict=True):
                tilt_y, tilt_x = directions[number]
                along_y = np.exp(1j * k * (tilt_y * grid.y - grid.y**2 / (2 * distance)))
                along_x = np.exp(1j * k * (tilt_x * grid.x - grid.x**2 / (2 * distance)))
                planes.append((along_y[:, None] * along_x).astype(np.complex64))
            yield planes

    def scale(self, sample_area: float, wavelength: float, pupil_area: float, distance: float) -> float:
        """Waves whose direction enters the pupil carry the image; the others are the dark field."""
        pupil = pupil_area / distance**2
        source = wavelength**2 / sample_area if self.na is None else math.pi * self.na**2
        return max(1.0, source / pupil) / self.count
