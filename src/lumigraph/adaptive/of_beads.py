"""Aberrations of a microscope from the light field of beads, together with their places, light and width."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from lumigraph.adaptive.checked import BEADS, asked_for, bent
from lumigraph.adaptive.field import PRIOR, Nodes
from lumigraph.adaptive.fit import Fit, Model, solved
from lumigraph.adaptive.images import OWN, diameter
from lumigraph.adaptive.known import covariance_of, covariance_of_coefficients, scattered
from lumigraph.adaptive.search import Search
from lumigraph.adaptive.start import starts
from lumigraph.adaptive.wavefront import Wavefront
from lumigraph.adaptive.worth import UNKNOWN, worth
from lumigraph.core import memory
from lumigraph.core.calibration import Calibration
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution import Exposure
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.instruments import LightFieldMicroscope, PlenopticCamera
from lumigraph.operators.microscope_pupil import PLACES
from lumigraph.scene import Points

ACCURACY = 3e-2
"""Accuracy of points' images: their errors differ from bead to bead, below noise but in bright images."""

FINE = 1e-2
"""Accuracy of the last steps where beads leave more than noise: with 2·10⁵ photons in each of 6, images
to 3e-2 left 1.084 times its variance, those to 1e-2 left 1.002, in 17 CPU s for 15."""

COARSE = 0.3
"""Accuracy of their derivatives, which then are off by 4 to 11 %, and single ones by up to 36 %."""

ROUNDS = 3
"""Searches for beads at most: in the raw image, then in what those before leave."""

STEPS = {"places": 4, "all": 40}
"""Steps of the fit, at most."""

SPREAD = 3.0
"""Pixels that beads light through aberrations of 1 wave rms, over those without: 2.7 before a 20x/0.5."""

SHAPE = 0.05
"""Part of beads' width that is wrong by how few points they are: 2.4 µm came out 1 to 8 % too narrow."""

Given = tuple[RawImage | np.ndarray, Exposure | None, Calibration | None]


def of_beads(
    given: Given, instrument: LightFieldMicroscope | PlenopticCamera, depths: Sequence[float],
    terms: Sequence[int], regions: tuple[int, int], progress: Progress,
) -> Wavefront:  # fmt: skip
    """The wavefront of (raw image, exposure, pixels), and the beads; see `estimate`."""
    known = _Known.of(given, instrument, depths, terms)
    model = known.model(regions, progress)
    none = np.zeros((len(model.nodes), len(known.terms)))
    first = Fit(known.search.beads(known.problem), none)
    _require_memory(model, first)
    plain = model.placed(first, STEPS["places"])
    alone = model.deviance(plain)
    model, fit, rounds = _fitted(known, model, _begun(known, model, plain))
    model, fit = _finer(known, model, fit)
    if len(model.nodes) > 1:
        nodes = model.nodes.learnt(fit.coefficients, covariance_of_coefficients(model, fit))
        model = replace(model, nodes=nodes)
        fit = model.improved(fit, model.every, STEPS["all"])
    model, fit, covariance = _worth(known, model, fit)
    return _wavefront(known, model, fit, covariance, (alone, rounds))


def _worth(known: "_Known", model: Model, fit: Fit) -> tuple[Model, Fit, np.ndarray]:
    """The fit of the terms, and of the width, that are worth it; and the covariance of all."""
    balls, full = (model, fit) if model.unit else _balls(known, model, fit)
    covariance = scattered(balls, full, known.calibration)
    free = worth(covariance, full.coefficients, balls.counted, balls.nodes.information)
    fit = full
    if not free.all():
        model, free = (balls, free) if free[-1] else (_points(balls), free[:-1])
        kept = full.changed(coefficients=full.coefficients[:, : len(free)] * free, beads=())
        fit = model.improved(kept, free, STEPS["all"])
    spread = fit.coefficients if model.unit else _with_none(fit.coefficients)
    left_out = (spread - full.coefficients).ravel()
    return model, fit, covariance + np.outer(left_out, left_out)


def _wavefront(
    known: "_Known", model: Model, fit: Fit, covariance: np.ndarray, before: tuple[float, int]
) -> Wavefront:
    """Wavefront by the covariance of terms and spread, the deviance of beads alone, and their searches."""
    terms, misfit = known.terms, model.misfit(fit)
    own = np.tile(np.arange(len(terms) + 1) < len(terms), len(model.nodes))
    own_covariance = covariance[np.ix_(own, own)]
    shape = (len(model.nodes.y), len(model.nodes.x), len(terms))
    found = fit.coefficients[:, : len(terms)].reshape(shape)
    deviations = np.sqrt(np.diag(own_covariance)).reshape(shape)
    unknown = {j: UNKNOWN for j, d in zip(terms, deviations.max((0, 1)), strict=True) if d > PRIOR / 2}
    spread = float(fit.coefficients[:, len(terms) :].mean(0).sum())
    unsure = math.sqrt(covariance[np.ix_(~own, ~own)].mean())
    width = diameter(spread, known.unit)
    width_deviation = math.hypot(diameter(spread + unsure, known.unit) - width, SHAPE * width)
    return Wavefront(
        terms, found, deviations, (model.nodes.y, model.nodes.x), known.untold | unknown, fit.points,
        (before[0], model.deviance(fit)), misfit.pearson, before[1], fit.steps,
        bent(known.microscope, terms, found.mean((0, 1))), own_covariance,
        pearson_deviation=misfit.deviation,
        bead_width=width, bead_width_deviation=width_deviation,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """Arguments of an estimate, put together."""

    microscope: LightFieldMicroscope
    search: Search
    problem: Problem
    terms: tuple[int, ...]
    untold: dict[int, str]
    pixels: Calibration | None

    @classmethod
    def of(
        cls,
        given: tuple[RawImage | np.ndarray, Exposure | None, Calibration | None],
        instrument: LightFieldMicroscope | PlenopticCamera,
        depths: Sequence[float],
        terms: Sequence[int],
    ) -> "_Known":
        raw, exposure, pixels = given
        planes, found, untold = asked_for(instrument, depths, terms, BEADS)
        microscope = cast("LightFieldMicroscope", instrument)  # cameras have no beads
        if len(planes) < 2:
            raise GeometryError(
                f"depths are {list(planes)} but beads need at least two planes, to lie between them."
            )
        if exposure is None:
            exposure = Exposure.of(raw) if isinstance(raw, RawImage) else Exposure()
        search = Search.of(microscope, found, planes, (raw, exposure, pixels), ACCURACY)
        return cls(microscope, search, search.problem(np.zeros(len(found))), found, untold, pixels)

    def model(self, regions: tuple[int, int], progress: Progress) -> Model:
        """Model of the pixels."""
        images = replace(self.search.sight.images, accuracy=ACCURACY)
        nodes = Nodes.of(self.search.sight.picture, regions, len(self.terms))
        coarse = replace(images, accuracy=COARSE)
        return Model(images, self.problem, nodes, self.search.limits, progress, coarse=coarse)

    @property
    def unit(self) -> float:
        """Unit of the spread of beads [m]: the objective's resolution, λ/(2 NA)."""
        return min(one.wavelength / (2 * one.aperture) for one in self.search.sight.images.objectives)

    @property
    def calibration(self) -> Calibration:
        """Calibration of the raw image."""
        return self.microscope.calibration if self.pixels is None else self.pixels

    def starts(self) -> list[np.ndarray]:
        """Coefficients (terms,) of the whole field, from the views' shifts."""
        return starts(self.problem, self.microscope, self.terms, self.pixels)


def _begun(known: _Known, model: Model, plain: Fit) -> Fit:
    """A fit without aberrations, or the beads that are seen through those of views' shifts, if likelier."""
    fits = [plain]
    for c in known.starts():
        everywhere = np.tile(c, (len(model.nodes), 1))
        fits.append(model.judged(plain.changed(coefficients=everywhere)))
    found = min(fits, key=lambda fit: fit.objective)
    if found is plain:
        return plain
    beads = known.search.beads(known.search.problem(found.coefficients[0]))
    return model.placed(found.changed(points=beads), STEPS["places"])


def _fitted(known: _Known, model: Model, fit: Fit) -> tuple[Model, Fit, int]:
    """The fit with all beads that are worth their unknowns, and how often they were looked for.

    Balls in place of points, with one width for all, if that is worth it: through points, a ball looks like
    several beads.
    """
    fit = _without_faint(model, model.fitted(fit, model.every, STEPS["all"]))
    model, fit = _widened(known, model, fit)
    for done in range(1, ROUNDS):
        more = known.search.more(fit, model.expected(model.light(fit)))
        if more is None:
            return model, fit, done
        both = Points(*(np.concatenate(two) for two in zip(_parts(fit.points), _parts(more), strict=True)))
        longer = _without_faint(model, model.fitted(fit.changed(points=both), model.every, STEPS["all"]))
        unknowns = OWN * (len(longer.points.intensities) - len(fit.points.intensities))
        if fit.objective - longer.objective < max(unknowns, 1) * math.log(model.counted):
            return model, fit, done
        fit = longer
    return model, fit, ROUNDS


def _finer(known: _Known, model: Model, fit: Fit) -> tuple[Model, Fit]:
    """Finer images, and steps by them, where the fit does not explain the raw image."""
    if model.misfit(fit).explained:
        return model, fit
    finer = replace(model, images=replace(known.search.sight.images, accuracy=FINE))
    return finer, finer.improved(fit.changed(), finer.every, STEPS["all"])


def _widened(known: _Known, model: Model, fit: Fit) -> tuple[Model, Fit]:
    """Balls in place of points, if their spread is worth it where the slope at points leads to."""
    balls, first = _balls(known, model, fit)
    around, prior, n = balls.around(first), balls.nodes.information, first.coefficients.size
    information, slope = around.information.copy(), around.slope.copy()
    information[-n:, -n:] += prior
    slope[-n:] -= prior @ first.coefficients.ravel()
    ahead = first.coefficients + solved(information, slope)[-n:].reshape(first.coefficients.shape)
    free = worth(covariance_of_coefficients(balls, first), ahead, balls.counted, prior)
    if not free[-1] or ahead[:, -1].mean() <= 0:
        return model, fit
    return balls, _without_faint(balls, balls.fitted(first, balls.every, STEPS["all"]))


def _balls(known: _Known, model: Model, fit: Fit) -> tuple[Model, Fit]:
    """A model whose beads may be balls, and a fit of points in it."""
    nodes = replace(model.nodes, terms=model.nodes.terms + 1)
    balls = replace(model, unit=known.unit, nodes=nodes)
    return balls, balls.known(replace(fit, coefficients=_with_none(fit.coefficients), beads=()))


def _points(balls: Model) -> Model:
    """The model whose beads are points."""
    return replace(balls, unit=0.0, nodes=replace(balls.nodes, terms=balls.nodes.terms - 1))


def _with_none(coefficients: np.ndarray) -> np.ndarray:
    """Coefficients (nodes, terms) with no spread."""
    return np.column_stack([coefficients, np.zeros(len(coefficients))])


def _parts(points: Points) -> tuple[np.ndarray, np.ndarray]:
    return points.positions, points.intensities


def _without_faint(model: Model, fit: Fit) -> Fit:
    """The fit without beads whose light is not known well enough to be there."""
    fit = model.known(fit)
    covariance = covariance_of(model, fit)
    light = np.diag(covariance)[PLACES : OWN * len(fit.points.intensities) : OWN]
    kept = light < 1 / (OWN * math.log(model.counted))
    if kept.all():
        return fit
    if not kept.any():
        raise GeometryError("no bead stands out of the noise. Give a raw image with more light, or of beads.")
    points = Points(fit.points.positions[kept], fit.points.intensities[kept])
    return model.improved(fit.changed(points=points), model.every, STEPS["all"])


def _require_memory(model: Model, fit: Fit) -> None:
    """Refuse derivatives of the pixels that beads light if they do not fit in memory twice."""
    images, count = model.coarse or model.images, len(fit.points.intensities)
    farthest = float(np.abs(fit.points.positions[:, 2]).max())
    unknowns = OWN + fit.coefficients.shape[1]
    lit = images.share(farthest) * math.prod(images.shape)
    needed = 2 * SPREAD * 4.0 * count * unknowns * lit
    what = f"the derivatives of {images.shape} pixels by {count} beads and {unknowns} unknowns of each"
    memory.require(needed, what, "Crop the raw image.", SamplingError)
