"""A raw image, its camera and its noise, put together for all methods."""

from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.errors import CalibrationError, GeometryError

UNSEEN = 1e-3
"""Object samples whose light reaches the sensor by less than this part of the most are left dark."""

FAINT = 1e-6
"""Floor of the model, as a part of the data's mean: an operator may ring a little below zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """Quantities that do not depend on the raw image, so that a time series needs them once.

    Parameters
    ----------
    operator
        A.
    response, weights
        t v and w of `Exposure` (ny, nx), or None for 1.
    background
        b + σ²/g, less the black level: a number or (ny, nx), at least 0.
    sensitivity
        Aᵀ(v w): light on the pixels of each object sample, per intensity; infinite where it is so little that
        the sensor does not see the sample, so that what is divided by it is 0 there.
    light_of_even
        On the pixels that count, of an object of intensity 1 where it is seen.
    gain
        Electrons per unit of the data.
    even
        A of an object of intensity 1 where it is seen (ny, nx), with which frames begin; None if not known.
    """

    operator: Linear
    response: Array | None
    weights: Array | None
    background: Array | float
    sensitivity: Array
    light_of_even: float
    gain: float
    even: Array | None = None

    @classmethod
    def of(cls, operator: Linear, exposure: Exposure, like: Array, least: float = UNSEEN) -> "Scale":
        """Scale of an operator, in the library and precision of an array; see `UNSEEN` for `least`."""
        shape, xp = tuple(operator.shape[0]), arrays.namespace(like)
        response = pixels("response", exposure.response, shape, like)
        if exposure.light != 1:
            response = exposure.light * (xp.ones_like(like) if response is None else response)
        weights = pixels("weights", exposure.weights, shape, like)
        background: Array = exposure.background
        if getattr(background, "shape", ()):  # not one number, be it a 0-d array
            background = pixels("background", background, shape, like)
        ones = xp.ones(shape, dtype=like.dtype, device=arrays.device(like))
        for factor in (response, weights):
            ones = ones if factor is None else ones * factor
        sensitivity = operator.adjoint(ones)
        highest = float(xp.max(sensitivity))
        if not highest > 0:
            raise GeometryError("no light of the object reaches a pixel that counts. Check grid and weights.")
        seen = sensitivity > least * highest
        light = arrays.sum_by_part(
            lambda light, seen: light * xp.astype(seen, light.dtype), sensitivity, seen
        )
        sensitivity = xp.where(seen, sensitivity, xp.full_like(sensitivity, float("inf")))
        total = background + exposure.offset
        if getattr(total, "shape", ()):  # a dark image's noise may reach below the black level
            total = xp.where(total > 0, total, xp.zeros_like(total))
        return cls(operator, response, weights, total, sensitivity, light, exposure.gain or 1.0)

    def begun(self) -> "Scale":
        """The same with `even`."""
        return replace(self, even=self.operator.forward(self.where_seen(1.0)))

    def where_seen(self, value: float) -> Array:
        """A value in object samples that the sensor sees, 0 in the others."""
        xp = arrays.namespace(self.sensitivity)

        def chosen(light: Array) -> Array:
            return xp.where(xp.isfinite(light), xp.full_like(light, value), xp.zeros_like(light))

        return arrays.by_part(chosen, self.sensitivity)

    def pictured(self, least: float) -> Array:
        """Truth values: samples that send at least this part of their light onto pixels that count.

        How much of it the pixels take, as of vignetting, does not matter.
        """
        xp, light = arrays.namespace(self.sensitivity), self.sensitivity
        if self.response is not None:
            ones = xp.ones_like(self.response) if self.weights is None else self.weights
            light = self.operator.adjoint(ones)
        else:
            light = xp.where(xp.isfinite(light), light, xp.zeros_like(light))
        return light > least * float(xp.max(light))

    @property
    def mean_sensitivity(self) -> float:
        """Mean sensitivity of the object samples that are seen."""
        xp, like = arrays.namespace(self.sensitivity), self.sensitivity.dtype
        seen = arrays.sum_by_part(lambda light: xp.astype(xp.isfinite(light), like), self.sensitivity)
        return self.light_of_even / seen

    def over_sensitivity(self, values: Array) -> Array:
        """`values` over the sensitivity; 0 where nothing is seen."""
        return arrays.by_part(lambda value, light: value / light, values, self.sensitivity)

    def back(self, residual: Array) -> Array:
        """Aᵀ(v w residual): an object from (ny, nx)."""
        for factor in (self.response, self.weights):
            residual = residual if factor is None else residual * factor
        return self.operator.adjoint(residual)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One raw image to explain.

    Parameters
    ----------
    scale
        What the frames of a series share.
    data
        r + σ²/g, less the black level (ny, nx), at least 0.
    floor
        Least value of a model.
    """

    scale: Scale
    data: Array
    floor: float

    @classmethod
    def of(cls, raw: RawImage | Array, exposure: Exposure, scale: Scale) -> "Problem":
        """Problem of a raw image that `values` has accepted."""
        data = values(raw, scale.operator, exposure)
        xp = arrays.namespace(data)
        if scale.weights is not None:
            data = xp.where(scale.weights > 0, data, xp.zeros_like(data))
        checks.finite_array("the raw image", data, CalibrationError)
        data = data + exposure.offset
        data = xp.where(data > 0, data, xp.zeros_like(data))
        if not float(xp.sum(data)) > 0:
            raise CalibrationError("the raw image is dark: there is nothing to deconvolve.")
        return cls(scale, data, FAINT * float(xp.mean(data)))

    def model(self, estimate: Array) -> Array:
        """Expected data (ny, nx) of an estimate: v A o + b, kept above 0."""
        return self.read(self.scale.operator.forward(estimate))

    def read(self, light: Array) -> Array:
        """Expected data (ny, nx) where light A o falls on the pixels."""
        xp = arrays.namespace(light)
        if self.scale.response is not None:
            light = light * self.scale.response
        return xp.where(light > 0, light, xp.zeros_like(light)) + self.scale.background + self.floor

    @property
    def level(self) -> float:
        """Intensity of the even object that sends as much light as was measured."""
        xp = arrays.namespace(self.data)
        light = self._weighted(self.data - self.scale.background)
        return max(float(xp.sum(light)), self.floor) / self.scale.light_of_even

    @property
    def light(self) -> np.ndarray:
        """Light on the pixels by their values (ny, nx), at least 0; 0 where they do not count."""
        light = np.maximum(arrays.to_numpy(self.data) - arrays.to_numpy(self.scale.background), 0)
        if self.scale.response is None:
            return light
        response = arrays.to_numpy(self.scale.response)
        return np.divide(light, response, out=np.zeros_like(light), where=response > 0)

    def flat(self) -> Array:
        """The even object of `level`, 0 where nothing is seen."""
        return self.scale.where_seen(self.level)

    def deviance(self, model: Array) -> float:
        r"""Poisson deviance of a model per pixel that counts, in electrons; near 1 where only noise is left.

        .. math:: D = \frac{2 g}{\sum w} \sum w \left[ r \ln\frac{r}{m} - (r - m) \right]
        """
        xp, data = arrays.namespace(model), self.data
        off = model - data
        lit = data > FAINT * self.floor  # fainter data count for nothing, and would overflow
        safe = xp.where(lit, data, xp.ones_like(data))
        terms = off - xp.where(lit, data * xp.log1p(off / safe), xp.zeros_like(data))
        count = float(np.prod(data.shape))
        if self.scale.weights is not None:
            count = float(xp.sum(self.scale.weights))
        return 2 * self.scale.gain * float(xp.sum(self._weighted(terms))) / count

    def _weighted(self, plane: Array) -> Array:
        return plane if self.scale.weights is None else plane * self.scale.weights


def values(raw: RawImage | Array, operator: Linear, exposure: Exposure) -> Array:
    """A raw image's values (ny, nx) as real floating-point numbers of its library, shape and kind checked."""
    data = raw.data if isinstance(raw, RawImage) else raw
    checks.array("the raw image", data, CalibrationError)
    if isinstance(raw, RawImage) and raw.bayer is not None and exposure.weights is None:
        raise CalibrationError(
            f"the raw image is a {raw.bayer} mosaic, whose colours the model mixes. Demosaic it and take one "
            "colour, or count the pixels of one colour by Exposure(weights=...)."
        )
    expected = tuple(operator.shape[0])
    if tuple(data.shape) != expected:
        raise CalibrationError(
            f"the raw image has shape {tuple(data.shape)} but the operator makes {expected}. "
            "Use the camera that took it, one colour at a time."
        )
    xp = arrays.namespace(data)
    if arrays.is_complex(data):
        raise CalibrationError("the raw image is complex. Give its intensity.")
    if not xp.isdtype(data.dtype, "real floating") or str(data.dtype).endswith("float16"):
        data = xp.astype(data, xp.float32)
    return data


def pixels(name: str, plane: Array | None, shape: tuple[int, ...], like: Array) -> Array | None:
    """Plane of values of each pixel, in the library and precision of an array; None where there is none."""
    if plane is None:
        return None
    if tuple(plane.shape) != shape:
        raise CalibrationError(
            f"{name} has shape {tuple(plane.shape)} but the raw image {shape}: one value for each pixel."
        )
    return arrays.like(np.asarray(arrays.to_numpy(plane), np.float64), like)
