"""Exposure of a raw image: offset, response, dead pixels, noise."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.brief import brief
from lumigraph.core.prepared import PreparedImage, Reason
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    r"""Relation of a raw image r to the light A o on the pixels.

    .. math:: g\,(r - r_0) \sim \mathrm{Poisson}(g\,(t v \cdot A o + b - r_0)) + \mathcal N(0, \sigma^2)

    Nothing is subtracted from a raw image or divided out of it, which would spoil the noise's statistics:
    a dark image is given as `background`, a white image's vignetting as `response`.

    Parameters
    ----------
    background
        b: what a pixel reads without light, in the raw image's values: a number or (ny, nx).
    response
        v: response of each pixel to light, over that of the model (ny, nx); None for 1.
    weights
        How much each pixel counts (ny, nx), from 0 to 1: 0 for dead or saturated ones, whose values are
        not read and may be NaN. None for 1.
    gain
        g: photo-electrons per unit of the raw image's values; known, it gives `Stop.deviance` its scale.
    read_noise
        σ, standard deviation of the reading [electrons]; needs the gain.
    black_level
        The part of the background that is no light and has no noise of its own, in the raw image's values.
    light
        t: light of this raw image over that of the others of the same object: the ratio of exposure times,
        lamps or apertures, whatever the gains are.

    Raises
    ------
    CalibrationError
        Values that are negative, not finite or above their limit, or a read noise without a gain.
    """

    background: float | Array = 0.0
    response: Array | None = None
    weights: Array | None = None
    gain: float | None = None
    read_noise: float = 0.0
    black_level: float = 0.0
    light: float = 1.0

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in ("background", "response", "weights"):
            if (value := getattr(self, name)) is not None:
                _check_plane(name, value, 1.0 if name == "weights" else None)
        if self.gain is not None:
            checks.positive("gain", self.gain, "electrons per value", CalibrationError)
        checks.positive("light", self.light, "1", CalibrationError)
        noise = checks.finite("read_noise", self.read_noise, "electrons", CalibrationError)
        if noise < 0 or (noise > 0 and self.gain is None):
            raise CalibrationError(
                f"read_noise is {noise:g} electrons but must be at least 0, and needs the gain. "
                "Give gain=, the electrons per unit of the raw image's values."
            )

        level = checks.finite("black_level", self.black_level, "1", CalibrationError)
        dark = float(np.mean(to_numpy(self.background))) if level else 0.0
        if not 0 <= level <= dark * (1 + 1e-9):
            raise CalibrationError(
                f"black_level is {level:g} but must lie between 0 and the background, {dark:g} in the mean. "
                "The background counts all that a dark pixel reads."
            )

    @classmethod
    def of(cls, raw: RawImage, **known: Any) -> "Exposure":
        """Exposure that `Sensor.expose` recorded or `lumigraph.prepare` found, and what else is `known`."""
        found: dict[str, Any] = {}
        if "full_well" in raw.metadata and raw.bit_depth is not None:
            told = {name: float(raw.metadata.get(name, 0.0)) for name in ("read_noise", "black_level")}
            highest = 2**raw.bit_depth - 1 - told["black_level"]
            gain = float(raw.metadata["full_well"]) / highest
            dark = float(raw.metadata.get("dark_signal", 0.0)) / gain
            found = {**told, "gain": gain, "background": told["black_level"] + dark}
        if isinstance(raw, PreparedImage):
            planes = {"background": raw.background, "response": raw.response}
            found |= {name: plane for name, plane in planes.items() if plane is not None}
            counted = raw.reasons < Reason.OUTSIDE  # dark ones do: no light is a measurement
            found |= {} if counted.all() else {"weights": counted.astype(np.float32)}
        return cls(**{**found, **known})

    @property
    def offset(self) -> float:
        """σ²/g less the black level: it shifts both data and model so that their noises sum to Poisson's.

        D. L. Snyder, A. M. Hammoud & R. L. White, J. Opt. Soc. Am. A 10, 1014 (1993).
        """
        return -self.black_level + (0.0 if self.gain is None else self.read_noise**2 / self.gain)


def _check_plane(name: str, value: Any, most: float | None) -> None:
    if not hasattr(value, "shape"):
        value = checks.finite(name, value, "1", CalibrationError)
    values = np.asarray(to_numpy(value) if hasattr(value, "shape") else value)
    checks.finite_array(name, values, CalibrationError)
    lowest, highest = float(values.min()), float(values.max())
    if lowest < 0 or (most is not None and highest > most):
        limit = "at least 0" if most is None else f"from 0 to {most:g}"
        raise CalibrationError(f"{name} goes from {lowest:.4g} to {highest:.4g} but must be {limit}.")
