r"""`unknown_depth`: best linear reconstruction of scenes whose depth is not known, trained in closed form.

A scene x of covariance C stands at one of D depths, all as likely, before an instrument A_d of noise N_d and
mean raw image m_d. One rule for all depths, x̂ = 1 + K (y - m) with m = ⟨m_d⟩, leaves least for

.. math:: K = C \bar A^T (N + B B^T)^{-1}, \quad
          B = \tfrac{1}{\sqrt D} \big[A_1 C^{1/2}, m_1 - m, \dots, A_D C^{1/2}, m_D - m\big]

with N and Ā the means over depths: that the depth is not known is noise that B holds. S. M. Kay,
"Fundamentals of Statistical Signal Processing", vol. 1, Prentice Hall 1993, chapter 12.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np
import scipy

from lumigraph.core import checks, memory, upper_floors
from lumigraph.core.short_repr import brief
from lumigraph.errors import SamplingError
from lumigraph.instruments.instrument import Instrument
from lumigraph.studies.information.bounds import Light, checked_depths, reading
from lumigraph.studies.information.imaging import SceneImaging, imaging
from lumigraph.studies.information.reconstruction_trials import ReconstructionTrials, each_scene, given_scenes
from lumigraph.studies.information.scenes import Scenes, coloured


@dataclass(frozen=True, slots=True, eq=False)
class TrainedRule:
    """Linear reconstruction of scenes at an unknown depth, and what it leaves.

    Parameters
    ----------
    depths
        (nz,), at which scenes may stand [m].
    errors
        (nz,): expected rms error at each, the mean brightness left out, over the scenes' contrast.
    scenes
        What is looked at.
    matrix
        (n n, pixels), K.
    mean
        (ny, nx), the mean raw image m [electrons].
    brightest
        Mean electrons of the brightest pixel.
    """

    depths: np.ndarray
    errors: np.ndarray
    scenes: Scenes
    matrix: np.ndarray
    mean: np.ndarray
    brightest: float

    __repr__ = brief

    @property
    def value(self) -> float:
        """Rms error over the depths."""
        return float(np.sqrt(np.mean(self.errors**2)))

    def reconstructed(self, raw: np.ndarray) -> np.ndarray:
        """Scene (n, n) of a raw image (ny, nx) [electrons], brightness over its mean."""
        n = self.scenes.samples
        return 1 + (self.matrix @ (raw - self.mean).ravel()).reshape(n, n)


@dataclass(frozen=True, slots=True, eq=False)
class _Depth:
    """An instrument at one depth, on the pixels of all."""

    seen: SceneImaging
    shape: tuple[int, int]
    dark: float

    def framed(self, raw: np.ndarray, beyond: float = 0.0) -> np.ndarray:
        """A raw image of the pixels around the axis that this depth lights, on those of all depths."""
        before = [n // 2 - m // 2 for n, m in zip(self.shape, raw.shape, strict=True)]
        pads = [(k, n - m - k) for k, n, m in zip(before, self.shape, raw.shape, strict=True)]
        return np.pad(raw, pads, constant_values=beyond)

    @property
    def mean(self) -> np.ndarray:
        """Electrons of the mean scene (ny, nx)."""
        return self.framed(self.seen.mean, self.dark)

    def waves(self, power: np.ndarray) -> np.ndarray:
        """A C^½ (pixels, n n)."""
        n = len(power)
        parts = [
            self.framed(self.seen.electrons(coloured(one, power))).ravel()
            for one in np.eye(n * n).reshape(-1, 1, n, n)
        ]
        return np.stack(parts, axis=1)


def unknown_depth(
    instrument: Instrument | str | PathLike[str],
    depths: Sequence[float],
    scenes: Scenes,
    light: Light | None = None,
    *,
    accuracy: float = 1e-2,
) -> TrainedRule:
    """Best linear reconstruction of scenes whose depth is not known, and its expected error.

    The scene is flat, around the axis, and stands at one of the depths, all as likely; one rule, trained in
    closed form on the scenes' statistics and the instrument's images, serves all of them. Noise is as of
    `reconstruction_error`, which knows the depth: the errors there are a lower bound of these.

    Parameters
    ----------
    instrument
        A camera or microscope of any kind, its file, or a name of the catalogue.
    depths
        From the focused plane [m].
    scenes, light, accuracy
        As of `reconstruction_error`.

    Raises
    ------
    GeometryError
        As of `reconstruction_error`.
    SamplingError
        Too many samples or pixels for the memory.

    Examples
    --------
    >>> import lumigraph as lg
    >>> camera = lg.load_camera("thesis-2f").replace(sensor={"shape": (48, 48)})
    >>> scenes = lg.information.Scenes(25e-6, 8)
    >>> one, three = (
    ...     lg.information.unknown_depth(camera, depths, scenes).value
    ...     for depths in ([0.0], [-8e-3, 0.0, 8e-3])
    ... )
    >>> 0 < one < three < 1
    True
    """
    light = Light() if light is None else light
    found = upper_floors.camera(instrument)
    checks.instance("instrument", found, Instrument)
    checks.instance("scenes", scenes, Scenes)
    planes = checked_depths(depths)
    some = _depths(found, planes, scenes, light, accuracy)
    count, pixels = scenes.samples**2, some[0].mean.size
    memory.require(
        8.0 * (len(planes) * (count + 1) * (2 * pixels + len(planes) * count)),
        f"a rule for {scenes.samples} x {scenes.samples} samples of {pixels} pixels",
        "Use scenes of fewer samples, or fewer depths.", SamplingError,
    )  # fmt: skip
    return _trained(planes, scenes, some, reading(found.sensor))


def _depths(
    instrument: Instrument, planes: np.ndarray, scenes: Scenes, light: Light, accuracy: float
) -> list[_Depth]:
    each = [imaging(instrument, planes[k : k + 1], scenes, light, accuracy) for k in range(len(planes))]
    y, x = (max(one.mean.shape[k] for one in each) for k in (0, 1))
    sensor = instrument.sensor
    dark = sensor.dark_signal + sensor.quantum_efficiency * light.background
    return [_Depth(one, (y, x), dark) for one in each]


def _trained(planes: np.ndarray, scenes: Scenes, some: Sequence[_Depth], read: float) -> TrainedRule:
    """The rule of some depths: (N + B Bᵀ)⁻¹ by a matrix as large as B is wide."""
    root, means = np.sqrt(len(some)), np.stack([one.mean.ravel() for one in some])
    waves, mean, n = [one.waves(scenes.power) for one in some], means.mean(0), scenes.samples
    noise = mean + read**2
    held = np.concatenate([*waves, (means - mean).T], axis=1) / root
    over = held / noise[:, None]
    inner = scipy.linalg.cho_factor(np.eye(held.shape[1]) + held.T @ over)
    seen = np.mean(waves, axis=0) / noise[:, None]  # N⁻¹ Ā C^½
    white = (seen - over @ scipy.linalg.cho_solve(inner, held.T @ seen)).T  # K = C^½ of this
    matrix = _colour(white, scenes)
    errors = []
    for one, light in zip(means, waves, strict=True):
        left = matrix @ light - _colour(np.eye(n * n), scenes)
        noisy = (matrix**2 @ (one + read**2)).sum()
        errors.append(_flat(left, n) + noisy - _of_mean(matrix, one + read**2) + _beside(matrix, one - mean))
    share = scenes.contrast**2 * n * n
    return TrainedRule(
        planes, np.sqrt(np.array(errors) / share), scenes, matrix, mean.reshape(some[0].shape),
        float(means.max()),
    )  # fmt: skip


def _colour(matrix: np.ndarray, scenes: Scenes) -> np.ndarray:
    """C^½ times a matrix (n n, k)."""
    n = scenes.samples
    return coloured(matrix.T.reshape(-1, n, n), scenes.power).reshape(len(matrix.T), -1).T


def _flat(left: np.ndarray, n: int) -> float:
    """Sum of squares of what is left (n n, k), the means of each column's scene left out."""
    return float((left**2).sum() - (left.sum(0) ** 2).sum() / n**2)


def _of_mean(matrix: np.ndarray, noise: np.ndarray) -> float:
    """Noise in the mean brightness of what is reconstructed."""
    return float(matrix.sum(0) ** 2 @ noise) / len(matrix)


def _beside(matrix: np.ndarray, mean: np.ndarray) -> float:
    """Square of what a mean image that is another than the mean of all brings."""
    found = matrix @ mean
    return float(found @ found - found.sum() ** 2 / len(found))


def unknown_depth_trials(
    instrument: Instrument | str | PathLike[str],
    depths: Sequence[float],
    scenes: Scenes,
    light: Light | None = None,
    *,
    draws: int | Sequence[np.ndarray] = 8,
    accuracy: float = 1e-2,
    rng: np.random.Generator,
) -> ReconstructionTrials:
    """Draw scenes, their noisy raw images at each depth, and reconstruct all by one trained rule.

    Parameters
    ----------
    instrument, depths, scenes, light, accuracy
        As of `unknown_depth`.
    draws
        Scenes (n, n), or how many are drawn; see `reconstruction_trials`.
    rng
        Random numbers.

    Raises
    ------
    GeometryError, SamplingError
        As of `unknown_depth` and `reconstruction_trials`.
    """
    light = Light() if light is None else light
    found, planes = upper_floors.camera(instrument), checked_depths(depths)
    some, read = _depths(found, planes, scenes, light, accuracy), reading(found.sensor)
    rule, given = _trained(planes, scenes, some, read), given_scenes(draws, scenes)
    drawn, errors, first = [one[0] for one in each_scene(given, scenes, 1, rng)], [], []
    for depth in some:
        off = []
        for scene in drawn:
            beyond = depth.mean - depth.framed(depth.seen.electrons(np.ones((1, *scene.shape))))
            mean = np.maximum(depth.framed(depth.seen.electrons(scene[None])) + beyond, 0)
            raw = rng.poisson(mean) + rng.normal(0, read, mean.shape)
            off.append((rule.reconstructed(raw) - scene).std() / scenes.contrast)
            first.append((raw, rule.reconstructed(raw)))
        errors.append(off)
    kept = first[:: len(drawn)]
    return ReconstructionTrials(
        np.array(errors).T, np.stack([drawn[0]] * len(some)), kept[0][0], np.stack([one[1] for one in kept])
    )
