"""`sense`: the wavefront before a plenoptic camera, from one raw image of a point of light."""

from collections.abc import Sequence

import numpy as np

from lumigraph.adaptive.checked import PISTON, bent
from lumigraph.adaptive.field import PRIOR, Nodes
from lumigraph.adaptive.fit import Fit, Model
from lumigraph.adaptive.images import OWN
from lumigraph.adaptive.known import scattered
from lumigraph.adaptive.star import Alone, Star
from lumigraph.adaptive.wavefront import Wavefront
from lumigraph.adaptive.worth import UNKNOWN
from lumigraph.core import checks, memory
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure
from lumigraph.deconvolution.problem import Problem, Scale, values
from lumigraph.elements.zernike import noll_to_nm
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.instruments import LensletCamera
from lumigraph.operators.microscope_pupil import PLACES
from lumigraph.scene import Points

MODES = tuple(range(4, 22))
"""Noll indices up to the fifth order that a point's place does not explain."""

STEPS = 30
"""Steps of the fit, at most."""

PLACED = {
    1: PISTON,
    2: "the point's place along x explains it",
    3: "the point's place along y explains it",
}


def sense(
    raw: RawImage | np.ndarray,
    camera: LensletCamera,
    terms: Sequence[int] = MODES,
    *,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    exposure: Exposure | None = None,
    progress: Progress | None = None,
) -> Wavefront:
    """The wavefront at a camera's main lens, from one raw image of a point of light, such as a star.

    A plenoptic wavefront sensor: lenslets near the image of the point sort its light by place and direction.
    Zernike modes, the point's place across the axis and its light are fitted to the pixels together, by
    Levenberg and Marquardt's steps on the Poisson likelihood, through the camera's wave optics. What is known
    before: a coefficient is of the order of 1 wave rms.

    Parameters
    ----------
    raw
        As it was read.
    camera
        With a main lens and lenslets. Aberrations of its description are taken as known.
    terms
        Noll indices. Piston and tilt are left out: see `Wavefront.untold`. Defocus is estimated: the
        point's depth is taken as known.
    place
        Of the point (y, x, dz), from the axis and the focused plane [m]; y and x within half a lenslet's
        cell. A sharp image in the middle of a lenslet carries little information; on the corner of four it
        makes the camera a pyramid sensor.
    exposure
        Background, gain, dead pixels; None for what a `RawImage` records. Without a gain a grey value counts
        as one electron.
    progress
        Called as ``progress(fraction)`` after each step; how many there will be is not known.

    Returns
    -------
    Wavefront
        With one node, the point as its bead, and the `covariance` of the modes.

    Raises
    ------
    GeometryError
        A camera without lenslets, no terms, a place that is not imaged.
    CalibrationError
        A raw image of another shape, or a dark one.
    SamplingError
        Derivatives that do not fit in memory.

    Warns
    -----
    SamplingWarning
        A point with these modes does not explain the raw image: there may be others, or the steps ended in
        another maximum of the likelihood.

    References
    ----------
    R. M. Clare & R. G. Lane, J. Opt. Soc. Am. A 22, 117 (2005).
    """
    checks.instance("camera", camera, LensletCamera)
    modes, untold = _asked(terms)
    star = Star(camera, modes)
    needed = 10.0 * (len(modes) + OWN) * star.shape[0] * star.shape[1]
    memory.require(needed, "derivatives of the raw image", "Use fewer terms.", SamplingError)
    model, first = _model(star, raw, place, exposure, progress or silent)
    plain = model.placed(first, STEPS)
    fit = model.improved(plain, model.every, STEPS)
    misfit = model.misfit(fit)
    misfit.warn("a point with these modes leaves", "Ask for more modes, or give the point's place.")
    covariance = scattered(model, fit, camera.calibration)
    deviations = np.sqrt(np.diag(covariance))
    unknown = {j: UNKNOWN for j, d in zip(modes, deviations, strict=True) if d > PRIOR / 2}
    return Wavefront(
        modes, fit.coefficients[None], deviations[None, None], (model.nodes.y, model.nodes.x),
        untold | unknown, fit.points, (model.deviance(plain), model.deviance(fit)), misfit.pearson, 1,
        fit.steps, bent(camera, modes, fit.coefficients[0]), covariance,
        pearson_deviation=misfit.deviation,
    )  # fmt: skip


def _asked(terms: Sequence[int]) -> tuple[tuple[int, ...], dict[int, str]]:
    """Modes that can be found, and the others with reasons."""
    asked = tuple(dict.fromkeys(int(j) for j in terms))
    for j in asked:
        noll_to_nm(j)
    modes = tuple(j for j in asked if j not in PLACED)
    if not modes:
        raise GeometryError(f"terms are {asked} but the point explains 1 to 3 itself. Give others.")
    return modes, {j: reason for j, reason in PLACED.items() if j in asked}


def _model(
    star: Star,
    raw: RawImage | np.ndarray,
    place: tuple[float, float, float],
    exposure: Exposure | None,
    progress: Progress,
) -> tuple[Model, Fit]:
    """Model of the expected pixels, and a point without aberrations to begin with."""
    at = np.array([checks.finite("a place", float(one)) for one in place])
    star.camera.defocused(float(at[2]))
    if exposure is None:
        exposure = Exposure.of(raw) if isinstance(raw, RawImage) else Exposure()
    count, period = len(star.terms), star.period(float(at[2]))
    operator = Alone(star.forward(Points(at[None], np.ones(1)), np.zeros(count)))
    data = values(raw, operator, exposure)
    problem = Problem.of(raw, exposure, Scale.of(operator, exposure, data))
    nodes = Nodes(at[:1], at[1:2], count)
    beside = np.append(np.full(PLACES - 1, star.cell(float(at[2])) / 2), 0.0)
    longest = (period, period, 1.0, 1.0, 0.25)
    model = Model(star, problem, nodes, (at - beside, at + beside), progress, longest)
    return model, Fit(Points(at[None], np.array([problem.level])), np.zeros((1, count)))
