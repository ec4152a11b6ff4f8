"""Depth from focus: which picture of a focal stack is the sharpest, in all or around each place."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like, to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.errors import CalibrationError, GeometryError
from lumigraph.rendering import refocus_stack

Alphas = Sequence[float] | np.ndarray

_NO_CONTRAST = 1e-6  # of a surface that is even but for rounding
_FEWEST = 3  # a peak needs a neighbour on both sides


@dataclass(frozen=True, slots=True, eq=False)
class BiasCurve:
    """Calibration curve of refocus factors: measured by a focal stack, against the true ones.

    A lenslet blurs the directions that it sees by λ/p, as much as all of them where it is small. The oblique
    line of a defocused point is smeared, and the picture that is sharpest lies nearer to the lenslets'
    plane, α' = 1, than the point does. The blur is the same for every point of a camera, so that points
    simulated at some depths correct any measured one.

    Parameters
    ----------
    measured, true
        Refocus factors (k,) of the sharpest picture and of the lens equation; both ascending.

    Raises
    ------
    CalibrationError
        Fewer than two points, or factors that do not ascend: then a measured one could mean several depths.

    Examples
    --------
    >>> curve = BiasCurve([0.8, 1.0, 1.15], [0.75, 1.0, 1.2])
    >>> [round(float(curve(alpha)), 3) for alpha in (0.8, 1.0)]
    [0.75, 1.0]
    """

    measured: Alphas
    true: Alphas

    def __post_init__(self) -> None:
        measured, true = (np.asarray(values, float) for values in (self.measured, self.true))
        if measured.ndim != 1 or measured.shape != true.shape or len(measured) < 2:
            raise CalibrationError(
                f"measured has shape {measured.shape} and true {true.shape}: both must be (k,), two at least."
            )
        for name, values in (("measured", measured), ("true", true)):
            if (np.diff(values) <= 0).any():
                place = int(np.argmax(np.diff(values) <= 0))
                raise CalibrationError(
                    f"{name} refocus factors must ascend but {values[place]:.4g} is followed by "
                    f"{values[place + 1]:.4g}. Leave out depths where the measurement fails."
                )
        object.__setattr__(self, "measured", measured)
        object.__setattr__(self, "true", true)

    @classmethod
    def simulated(
        cls, views_at: Callable[[float], LightField], true: Alphas, measure: Callable[[LightField], float]
    ) -> Self:
        """The curve of a camera, from light fields of a point at each true refocus factor.

        Parameters
        ----------
        views_at
            The simulated and decoded light field of a point whose refocus factor is given.
        true
            Refocus factors (k,), ascending.
        measure
            What is to be corrected, such as ``lambda views: point_alpha(views, alphas)``.
        """
        return cls(np.array([measure(views_at(float(alpha))) for alpha in true]), true)

    def __call__(self, measured: Array | float) -> np.ndarray:
        """True refocus factors of measured ones, by monotone cubic interpolation; NaN outside the curve."""
        curve = PchipInterpolator(self.measured, self.true, extrapolate=False)
        return np.asarray(curve(to_numpy(measured) if hasattr(measured, "shape") else measured))


def sharpness(stack: Array) -> np.ndarray:
    r"""Concentration of the light in each picture (n, t, s) of a focal stack (n,) [1/lenslets²].

    .. math:: S = \frac{\int E^2\, dx\, dy}{(\int E\, dx\, dy)^2}

    One over the area that the light covers. By ray optics a point is sharpest at its own refocus factor,
    because the pictures of `refocus` keep its size and place. By Parseval's theorem it is the energy of the
    spectrum, as in the thesis' method, whose pictures are drawn on their own planes: there x' = x/α', and
    S is α'² times as large.

    Raises
    ------
    GeometryError
        Another shape.

    References
    ----------
    The thesis, section 4.7, with the energy of all frequencies.
    """
    pictures = np.asarray(to_numpy(stack), float)
    if pictures.ndim != 3:
        raise GeometryError(f"the stack has shape {pictures.shape} but must be (n, t, s), grey.")
    total = pictures.sum((1, 2))
    return (pictures**2).sum((1, 2)) / np.where(total, total, 1.0) ** 2


def point_alpha(
    views: LightField, alphas: Alphas, *, oversample: int = 4, correction: BiasCurve | None = None
) -> float:
    """Refocus factor of the one point that a light field shows, where its stack is sharpest.

    Parameters
    ----------
    views
        Of a point before a dark ground.
    alphas
        Refocus factors of the stack, evenly spaced; the peak is found between them by a parabola.
    oversample
        Samples of the pictures per lenslet. With one, as in the thesis, α' = 1 alone needs no interpolation
        and is the sharper for it: the measured factor jumps near 1 and cannot be corrected.
    correction
        Of the camera, for this oversampling; without it diffraction draws the answer towards 1.

    Raises
    ------
    GeometryError
        Fewer than three alphas, or not evenly spaced.
    """
    alphas = _even(alphas)
    stack = refocus_stack(views, alphas, oversample=oversample)
    curve = sharpness(stack)
    found = float(_peaks(curve[:, None], alphas)[0])
    return found if correction is None else float(correction(found))


def from_focus(
    views: LightField, alphas: Alphas, *, window: float = 1.5, correction: BiasCurve | None = None
) -> DepthMap:
    r"""Refocus factor of each lenslet's place: where the stack has its highest local contrast.

    .. math:: C(x) = \frac{\langle E^2 \rangle - \langle E \rangle^2}{\langle E \rangle^2}

    Parameters
    ----------
    views
        Light field (v, u, t, s[, c]); colours are averaged.
    alphas
        Refocus factors of the stack, evenly spaced.
    window
        Standard deviation of the Gaussian mean ⟨·⟩ [lenslets].
    correction
        Of the camera; see `BiasCurve`.

    Returns
    -------
    DepthMap
        Refocus factors (t, s), of the light field's library and precision. Even surfaces have no contrast:
        their confidence is low.

    Raises
    ------
    GeometryError
        Fewer than three alphas, not evenly spaced, or a window that is not above zero.

    References
    ----------
    Nayar & Nakagawa, "Shape from focus", IEEE PAMI 16, 824 (1994), with variance as the measure.
    """
    alphas = _even(alphas)
    stack = np.asarray(to_numpy(refocus_stack(views, alphas, oversample=1)), float)
    stack = stack.mean(-1) if stack.ndim == 4 else stack
    contrast = _contrast(stack, checks.positive("window", window, "lenslets"))
    alpha = _peaks(contrast.reshape(len(alphas), -1), alphas).reshape(stack.shape[1:])
    if correction is not None:
        alpha = correction(alpha)
    highest, usual = contrast.max(0), np.median(contrast, axis=0)
    stands_out = (highest - usual) / (highest + _NO_CONTRAST)
    inside = (contrast.argmax(0) % (len(alphas) - 1)) > 0
    trust = np.where(inside & np.isfinite(alpha), stands_out, 0.0)
    return DepthMap(like(alpha, views.data), like(trust, views.data), "alpha")


def _contrast(stack: np.ndarray, window: float) -> np.ndarray:
    """Local variance over squared mean of each picture."""
    sigma = (0.0, window, window)
    mean = gaussian_filter(stack, sigma)
    variance = np.maximum(gaussian_filter(stack**2, sigma) - mean**2, 0.0)
    floor = 1e-6 * max(float((mean**2).max()), math.ulp(0.0))
    return variance / np.maximum(mean**2, floor)


def _even(alphas: Alphas) -> np.ndarray:
    values = np.asarray(alphas, float)
    if values.ndim != 1 or len(values) < _FEWEST:
        raise GeometryError(f"alphas has shape {values.shape} but a peak needs (n,), three at least.")
    steps = np.diff(values)
    if steps[0] <= 0 or np.ptp(steps) > 1e-6 * steps[0]:
        raise GeometryError(
            f"alphas must ascend in equal steps but theirs are {steps.min():.4g} to {steps.max():.4g}. "
            "Use numpy.linspace."
        )
    return values


def _peaks(curves: np.ndarray, alphas: np.ndarray) -> np.ndarray:
    """Peak of each curve (n, k): vertex of the parabola through the highest sample's neighbours."""
    top = curves.argmax(0)
    middle = np.clip(top, 1, len(alphas) - 2)
    below, at, above = (np.take_along_axis(curves, (middle + k)[None], 0)[0] for k in (-1, 0, 1))
    bend = below - 2 * at + above
    move = np.where((bend < 0) & (top == middle), (below - above) / np.where(bend < 0, 2 * bend, 1.0), 0.0)
    return alphas[top] + move * (alphas[1] - alphas[0])
