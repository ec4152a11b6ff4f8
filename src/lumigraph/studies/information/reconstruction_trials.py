"""`reconstruction_trials`: errors of drawn scenes, reconstructed from noisy raw images."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError
from lumigraph.instruments.instrument import Instrument
from lumigraph.studies.information.bounds import Light, checked_depths, reading
from lumigraph.studies.information.imaging import SceneImaging, imaging
from lumigraph.studies.information.scenes import Scenes

MOST = 10_000
"""Scenes that are drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class ReconstructionTrials:
    """Errors that reconstructions of some scenes have.

    Parameters
    ----------
    errors
        (draws, nz): rms of what is reconstructed less the scene, the mean left out, over `Scenes.contrast`.
    scene, raw, reconstructed
        Of the first one: (nz, n, n), (ny, nx) [electrons], (nz, n, n); raw is of the first depth, or of all.
    """

    errors: np.ndarray
    scene: np.ndarray
    raw: np.ndarray
    reconstructed: np.ndarray

    __repr__ = brief

    @property
    def rms(self) -> float:
        """Rms error over scenes and depths."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def rms_error(self) -> float:
        """Standard error of `rms` by the number of scenes; NaN of one."""
        squares = np.mean(self.errors**2, axis=1)
        if len(squares) < 2:
            return math.nan
        return float(squares.std(ddof=1) / math.sqrt(len(squares)) / 2 / self.rms)


def reconstruction_trials(
    instrument: Instrument,
    depths: Sequence[float],
    scenes: Scenes,
    light: Light | None = None,
    *,
    draws: int | Sequence[Any] = 8,
    volume: bool = False,
    accuracy: float = 1e-2,
    rng: np.random.Generator,
) -> ReconstructionTrials:
    """Draw scenes, their raw images and the noise in these, and reconstruct each by the best linear rule.

    Noise is Poisson's and the reading's. The mean of the errors' squares is `reconstruction_error`'s, but for
    chance.

    Parameters
    ----------
    instrument, depths, scenes, light, volume, accuracy
        As of `reconstruction_error`.
    draws
        Scenes, or how many are drawn: (n, n), brightness in proportion to light, reconstructed as if they
        were drawn as `scenes` are. Before a `volume` each stands at all depths, turned by 90° from one to
        the next.
    rng
        Random numbers.

    Raises
    ------
    GeometryError
        As `reconstruction_error`; no scenes, too many, or of another shape.
    """
    light = Light() if light is None else light
    planes = checked_depths(depths)
    some, errors = [planes] if volume else list(planes[:, None]), []
    given, begun = given_scenes(draws, scenes), []
    for group in some:
        seen = imaging(instrument, group, scenes, light, accuracy)
        found = [_trial(seen, scene, reading(instrument.sensor), rng)
                 for scene in each_scene(given, scenes, len(group), rng)]  # fmt: skip
        off = [seen_as - scene for scene, _, seen_as in found]
        errors.append(np.array([one.std(axis=(1, 2)) for one in off]) / scenes.contrast)
        begun.append(found[0])
    return ReconstructionTrials(
        np.concatenate(errors, axis=1), np.concatenate([one[0] for one in begun]), begun[0][1],
        np.concatenate([one[2] for one in begun]),
    )  # fmt: skip


def given_scenes(draws: int | Sequence[Any], scenes: Scenes) -> int | list[np.ndarray]:
    """Scenes over their mean, or how many are drawn; others are refused."""
    if isinstance(draws, int):
        if checks.whole("draws", draws) > MOST:
            raise GeometryError(f"draws are {draws} but must be at most {MOST}.")
        return draws
    found = [np.asarray(one, np.float64) for one in draws]
    for one in found:
        checks.brightness("a scene", one, GeometryError)
        if one.shape != (scenes.samples, scenes.samples) or not one.mean() > 0:
            raise GeometryError(
                f"a scene has shape {one.shape} but must be lit, of {scenes.samples} x {scenes.samples}."
            )
    if not found:
        raise GeometryError("there are no scenes. Give one at least, or how many are drawn.")
    return [one / one.mean() for one in found]


def each_scene(
    given: int | list[np.ndarray], scenes: Scenes, planes: int, rng: np.random.Generator
) -> Iterator[np.ndarray]:
    """Scenes (nz, n, n)."""
    if isinstance(given, int):
        for _ in range(given):
            yield np.stack([scenes.drawn(rng) for _ in range(planes)])
        return
    for one in given:
        yield np.stack([np.rot90(one, k) for k in range(planes)])


def _trial(
    seen: SceneImaging, scene: np.ndarray, read: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A scene, its raw image, and what is made of that."""
    even = seen.mean - seen.electrons(np.ones_like(scene))
    mean = np.maximum(seen.electrons(scene) + even, 0)
    raw = rng.poisson(mean) + rng.normal(0, read, mean.shape)
    return scene, raw, seen.reconstructed(raw)
