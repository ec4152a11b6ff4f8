r"""`reconstruction_error`: error of the best linear reconstruction of scenes from one raw image.

Scenes are Gaussian with covariance C, raw images A x + noise of variance N. The best linear estimate leaves

.. math:: P = C^{1/2} (1 + C^{1/2} A^T N^{-1} A C^{1/2})^{-1} C^{1/2}

Its trace is the mean of zᵀ P z over random objects z, each solved by conjugate gradients: see
docs/theory/information.md. S. M. Kay, "Fundamentals of Statistical Signal Processing", vol. 1, Prentice Hall
1993, chapter 12; M. F. Hutchinson, Commun. Stat. Simul. Comput. 18, 1059 (1989).
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from lumigraph.core import checks, upper_floors
from lumigraph.core.progress import Progress
from lumigraph.core.result import Quantity
from lumigraph.core.short_repr import brief
from lumigraph.errors import SamplingWarning
from lumigraph.instruments.instrument import Instrument
from lumigraph.studies.information.bounds import Light, checked_depths
from lumigraph.studies.information.imaging import SceneImaging, imaging, shares
from lumigraph.studies.information.scenes import Scenes, frequencies, ring_means, rings

FEW, MANY = 4, 16
"""Objects z, at least and at most."""

EVEN = 0.01
"""Relative error of an error by the number of those, below which no more are taken."""


@dataclass(frozen=True, slots=True, eq=False)
class ReconstructionError:
    """Error of the best linear reconstruction of scenes, over their contrast.

    Parameters
    ----------
    depths
        (nz,), from the focused plane [m].
    errors
        (nz,): rms of what is reconstructed less the scene, over the scene's standard deviation; 0 where all
        is found, 1 where nothing but the mean is known. Errors of the mean brightness do not count.
    frequencies
        (k,), of the object [1/m].
    over_frequency
        (nz, k): the same for waves of these frequencies.
    uncertain
        Of `value`, relative: one standard error, by the objects that the mean is taken over.
    brightest
        Mean electrons of the brightest pixel.
    """

    depths: np.ndarray
    errors: np.ndarray
    frequencies: np.ndarray
    over_frequency: np.ndarray
    uncertain: float
    brightest: float

    __repr__ = brief

    @property
    def value(self) -> float:
        """Rms error over the depths."""
        return float(np.sqrt(np.mean(self.errors**2)))

    def quantities(self) -> tuple[Quantity, ...]:
        """Values over the depths, with units and equations."""
        off = self.value * self.uncertain
        return (Quantity("reconstruction_error", self.value, "1", (self.value - off, self.value + off)),)

    def rows(self) -> list[dict[str, Any]]:
        """Row for each depth, in metres."""
        return [
            {"depth [m]": float(dz), "reconstruction error": float(e)}
            for dz, e in zip(self.depths, self.errors, strict=True)
        ]


def reconstruction_error(
    instrument: Instrument | str | PathLike[str],
    depths: Sequence[float],
    scenes: Scenes,
    light: Light | None = None,
    *,
    volume: bool = False,
    accuracy: float = 1e-2,
    progress: Progress | None = None,
) -> ReconstructionError:
    """Expected error of the best linear reconstruction of scenes from one raw image, over depths.

    The scene is flat and square to the axis, around it, and dark beyond; its depth, its mean and its spectrum
    are known. Noise is that of photons, dark current, reading and rounding. With a `volume` independent
    scenes shine at all depths at once, through each other, and are reconstructed together.

    Parameters
    ----------
    instrument
        A camera or microscope of any kind, its file, or a name of the catalogue.
    depths
        From the focused plane [m], positive farther.
    scenes
        What is looked at. Use the same for cameras that are compared.
    light
        Photons from a sample of the mean scene that enter the main lens or the objective; 10,000 without
        background if left out.
    volume
        Whether all depths shine at once.
    accuracy
        Of the operator: relative rms error of raw images.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        No depths, one that is not imaged, a scene wider than a Fourier microscope's field or finer than its
        pixels.
    SamplingError
        An operator that does not fit in memory.

    Warns
    -----
    SamplingWarning
        Pixels would be full.

    Examples
    --------
    >>> import lumigraph as lg
    >>> camera = lg.load_camera("thesis-2f")
    >>> scenes = lg.information.Scenes(25e-6, 16)
    >>> few, many = (
    ...     lg.information.reconstruction_error(camera, [0.0], scenes, lg.information.Light(n)).value
    ...     for n in (100, 10_000)
    ... )
    >>> many < few < 1
    True
    """
    light = Light() if light is None else light
    instrument = upper_floors.camera(instrument)
    checks.instance("light", light, Light)
    checks.instance("scenes", scenes, Scenes)
    checks.instance("instrument", instrument, Instrument)
    planes = checked_depths(depths)
    some = [planes] if volume else list(planes[:, None])
    found, brightest = [], 0.0
    for number, group in enumerate(some):
        seen = imaging(instrument, group, scenes, light, accuracy)
        found.append(probed(seen, scenes.samples)[:2])
        brightest = max(brightest, float(seen.mean.max()))
        if progress is not None:
            progress((number + 1) / len(some))
    if brightest > instrument.sensor.full_well:
        warnings.warn(
            f"the brightest pixel has {brightest:.4g} electrons in the mean but pixels hold "
            f"{instrument.sensor.full_well:.4g}. Use less light, or a sensor with a larger full well.",
            SamplingWarning,
            stacklevel=2,
        )
    return _summed(planes, np.concatenate([means for means, _ in found]), [off for _, off in found],
                   scenes, brightest)  # fmt: skip


def _summed(
    planes: np.ndarray, left: np.ndarray, off: list[float], scenes: Scenes, brightest: float
) -> ReconstructionError:
    """Error by what is left of each wave (nz, n, n), and by the standard errors of each group's sum."""
    at, power = frequencies(scenes.samples), scenes.power
    inside = at > 0
    errors = np.sqrt(left[:, inside].sum(1)) / scenes.contrast
    count = rings(scenes.samples)
    before = ring_means(power, at, count)
    over = np.stack([ring_means(one, at, count) for one in left]) / np.maximum(before, 1e-300)
    total = float(left[:, inside].sum())
    return ReconstructionError(
        planes, errors, np.arange(1, count + 1) / scenes.size, np.sqrt(np.clip(over, 0, None)),
        float(np.hypot.reduce(off)) / total / 2, brightest,
    )  # fmt: skip


class ProbedWaves(NamedTuple):
    """Rest of each wave (nz, n, n), the standard error of the sum, and P z (nz, n, n) of each z."""

    left: np.ndarray
    off: float
    found: list[np.ndarray]


def probed(seen: SceneImaging, samples: int) -> ProbedWaves:
    """Rest by as many objects z as make the sum even."""
    rng = np.random.default_rng(0)  # alike for all cameras: differences are theirs
    left, found, sums = [], [], np.zeros(0)
    for z in _objects(rng, (seen.planes, samples, samples)):
        found.append(seen.covered(z))
        left.append(shares(z, found[-1]))
        sums = np.array([one.sum() for one in left])
        if len(left) >= FEW and sums.std(ddof=1) / math.sqrt(len(left)) < 2 * EVEN * sums.mean():
            break
    return ProbedWaves(np.mean(left, axis=0), float(sums.std(ddof=1) / math.sqrt(len(left))), found)


def _objects(rng: np.random.Generator, shape: tuple[int, int, int]) -> Iterator[np.ndarray]:
    """Waves of all frequencies but 0 and of phases by chance, of power 1."""
    for _ in range(MANY):
        waves = np.fft.fft2(rng.standard_normal(shape))
        waves *= shape[-1] / np.abs(waves)
        waves[:, 0, 0] = 0
        yield np.fft.ifft2(waves).real
