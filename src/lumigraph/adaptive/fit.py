r"""Beads and wavefronts together: the most likely ones, by Levenberg and Marquardt's steps.

With the expected values m of the pixels, their derivatives J by all unknowns, gain g and weights w, Fisher's
information of Poisson noise is F = Jᵀ diag(g w / m) J. A step solves
(F + Q + μ diag) δ = Jᵀ g w (r/m - 1) - Q x with the prior's information Q. Unknowns x are each bead's place
and the logarithm of its light, then the coefficients at each node of the field.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lumigraph.adaptive.changes import Changes, scored, told
from lumigraph.adaptive.field import Nodes
from lumigraph.adaptive.images import OWN, Images, changes_of, image_of
from lumigraph.adaptive.misfit import Misfit
from lumigraph.core import arrays
from lumigraph.core.progress import Progress, Stage, silent
from lumigraph.core.threads import each
from lumigraph.deconvolution.problem import Problem
from lumigraph.operators.microscope_pupil import PLACES
from lumigraph.operators.resampling import Part
from lumigraph.scene import Points

LONGEST = (1.5e-6, 1.5e-6, 3e-6, 1.0, 0.25)
"""Longest steps before a microscope: y, x, dz [m], the logarithm of light, a coefficient [waves rms]."""

TRIES = 5
"""Steps, each shorter than the one before, of which one must be likelier."""

GAIN = 1.0
"""Log-likelihood that a step must gain for another one to follow: what noise gives each unknown."""

SHORT = 1.2
"""Gain over the promised one above which a step was too short, as along a curved valley."""

STALE = 0.02
"""Part of the longest steps by which a bead may change before its derivatives are computed anew: they change
by less than 1 in 10 then, as little as those of coarse images are off.
"""

CURVED = 10.0
"""Log-likelihood gained by a step above which a fit may go on the way of its last two steps: along a curved
valley each step is short.
"""

USUAL = 10
"""Steps after which progress is said to be half: how many there will be is not known."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Beads and coefficients that explain a raw image.

    Parameters
    ----------
    points
        The beads.
    coefficients
        (nodes, terms) [waves rms].
    objective
        What is minimised: deviance of all pixels [electrons] and the prior's.
    steps
        Taken so far.
    light
        On the pixels (ny, nx); None before the fit is judged.
    beads
        How pixels change by each bead, of light 1, where that was last computed: near here, or elsewhere.
    """

    points: Points
    coefficients: np.ndarray
    objective: float = np.inf
    steps: int = 0
    light: np.ndarray | None = None
    beads: tuple[Changes, ...] = ()

    def changed(self, **changes: Any) -> "Fit":
        """The same fit with other points or coefficients, not judged yet."""
        return replace(self, objective=np.inf, light=None, **changes)


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """The model around a fit.

    Parameters
    ----------
    information
        F (n, n), without the prior.
    slope
        Of the log-likelihood (n,), without the prior.
    """

    information: np.ndarray
    slope: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Model of the expected pixels, and of their derivatives.

    Parameters
    ----------
    images
        Of points, by the pupil.
    problem
        Raw image, background and noise.
    nodes
        Of the field, where coefficients stand.
    limits
        Least and greatest (y, x, dz) of beads [m].
    progress
        Of the fit's steps.
    longest
        Steps: see `LONGEST`.
    coarse
        Images by which the first steps are judged, and whose derivatives show the way of all; None for
        `images`. What derivatives get wrong meets only noise at the end, so that it costs no more of a fit's
        precision than its own square.
    unit
        Of the last coefficient, how far beads spread: see `images`; 0 where they are points and it is none.
    """

    images: Images
    problem: Problem
    nodes: Nodes
    limits: tuple[np.ndarray, np.ndarray]
    progress: Progress = silent
    longest: tuple[float, ...] = LONGEST
    coarse: Images | None = None
    unit: float = 0.0

    @property
    def weights(self) -> np.ndarray:
        """Electrons that a unit of each pixel counts for (ny, nx)."""
        scale = self.problem.scale
        ones = np.ones(self.images.shape) if scale.weights is None else arrays.to_numpy(scale.weights)
        return scale.gain * ones

    @property
    def counted(self) -> float:
        """Pixels that count."""
        return float(self.weights.sum()) / self.problem.scale.gain

    @property
    def every(self) -> np.ndarray:
        """All terms (terms,), as free."""
        return np.ones(self.nodes.terms, bool)

    def expected(self, light: np.ndarray) -> np.ndarray:
        """Values of pixels (ny, nx) that receive this light."""
        scale = self.problem.scale
        if scale.response is not None:
            light = light * arrays.to_numpy(scale.response)
        return np.maximum(light, 0) + arrays.to_numpy(scale.background) + self.problem.floor

    def light(self, fit: Fit) -> np.ndarray:
        """Light on the pixels (ny, nx)."""
        found = np.zeros(self.images.shape)
        for (part, pixels), light in zip(
            each(self._image, self._at(fit)), fit.points.intensities, strict=True
        ):
            found[part] += light * pixels[0]
        return found

    def _image(self, at: np.ndarray) -> tuple[Part, np.ndarray]:
        """Image of a bead of light 1 by place and coefficients: its part of the raw image, and its pixels."""
        return image_of(self.images, at, self.unit)

    def _at(self, fit: Fit) -> np.ndarray:
        """Place and coefficients of each bead (beads, 3 + terms)."""
        return np.column_stack([fit.points.positions, self.nodes.at(fit.points) @ fit.coefficients])

    def judged(self, fit: Fit) -> Fit:
        """The fit with its objective."""
        light = self.light(fit) if fit.light is None else fit.light
        deviance = self.problem.deviance(self.expected(light)) * self.counted
        return replace(fit, objective=deviance + self._prior(fit), light=light)

    def deviance(self, fit: Fit) -> float:
        """Poisson deviance per pixel that counts of a fit that was judged."""
        return (fit.objective - self._prior(fit)) / self.counted

    def _prior(self, fit: Fit) -> float:
        x = fit.coefficients.ravel()
        return float(x @ self.nodes.information @ x)

    def misfit(self, fit: Fit) -> Misfit:
        """Misfit of a judged fit: what it leaves of the raw image."""
        assert fit.light is not None  # it was judged
        data = arrays.to_numpy(self.problem.data)
        return Misfit.of(self.weights, self.problem.scale.gain, data, self.expected(fit.light))

    def known(self, fit: Fit) -> Fit:
        """The fit with derivatives of its beads, those before where a bead hardly changed."""
        return replace(fit, beads=tuple(each(lambda at: self._changes(at, fit.beads), self._at(fit))))

    def around(self, fit: Fit) -> Around:
        """Information and slope at a fit."""
        fit = self.known(fit)
        told_of = told(fit.beads, fit.points.intensities, *self._told(fit))
        shared = _shared(self.nodes.at(fit.points), fit.coefficients.shape[1])
        return Around(shared.T @ told_of[0] @ shared, shared.T @ told_of[1])

    def scores(self, fit: Fit, mixed: np.ndarray) -> np.ndarray:
        """Scores (k, ny, nx): pixels' shares of the likelihood's slopes along mixed unknowns (all, k)."""
        fit = self.known(fit)
        shared = _shared(self.nodes.at(fit.points), fit.coefficients.shape[1])
        return scored(fit.beads, fit.points.intensities, shared @ mixed, self._told(fit)[1])

    def _told(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        """Information, and slope of the log-likelihood, by what each pixel (ny, nx) should read."""
        shown = self.expected(self.light(fit) if fit.light is None else fit.light)
        data, weights = arrays.to_numpy(self.problem.data), self.weights
        return weights / shown, weights * (data / shown - 1)

    def _changes(self, at: np.ndarray, before: Sequence[Changes]) -> Changes:
        """Changes of pixels by a bead's place, light and coefficients (places, terms), for light 1."""
        longest = np.append(self.longest[:PLACES], np.full(len(at) - PLACES, self.longest[OWN]))
        for one in before:
            if (np.abs(at - one.at) < STALE * longest).all():
                return one
        images = self.images if self.coarse is None else self.coarse
        part, by = changes_of(images, at, self.unit)
        if self.problem.scale.response is not None:
            by = by * arrays.to_numpy(self.problem.scale.response)[part].astype(np.float32)
        return Changes(part, by, at)

    def fitted(self, fit: Fit, free: np.ndarray, steps: int) -> Fit:
        """The fit after at most some steps of coarse images, and then as many more of exact ones."""
        if self.coarse is not None:
            fit = replace(self, images=self.coarse).improved(fit.changed(), free, steps)
        return self.improved(fit.changed(), free, steps)

    def placed(self, fit: Fit, steps: int) -> Fit:
        """The fit with beads where coarse images show them, by coefficients that are alike everywhere."""
        images, nodes = self.coarse or self.images, replace(self.nodes, terms=0)
        held = replace(self, images=images.fixed(fit.coefficients[0]), coarse=None, nodes=nodes)
        none = Fit(fit.points, np.zeros((len(nodes), 0)), steps=fit.steps)
        found = held.improved(none, np.zeros(0, bool), steps)
        return self.judged(replace(fit.changed(points=found.points), steps=found.steps))

    def improved(self, fit: Fit, free: np.ndarray, steps: int) -> Fit:
        """The fit after at most some steps, with those coefficients free that are marked (terms,)."""
        last = fit.steps + steps
        damping, fit, before = 1e-2, self.judged(fit), None
        while fit.steps < last:
            fit = self.known(fit)
            found, damping = self._likelier(self.around(fit), fit, free, damping)
            if found is None:
                return fit
            if before is not None and fit.objective - found.objective > 2 * CURVED:
                found = self._farther(found, _way(before, found) / 2)
            gained = (fit.objective - found.objective) / 2
            before, fit = fit, replace(found, steps=fit.steps + 1)
            stepped(self.progress, fit.steps)
            if gained < GAIN:
                return fit
        return fit

    def _likelier(
        self, around: Around, fit: Fit, free: np.ndarray, damping: float
    ) -> tuple[Fit | None, float]:
        """The fit after a likelier step and the next damping; None where no step is likelier."""
        for _ in range(TRIES):
            step = self._step(around, fit, free, damping)
            found = self.judged(self._moved(fit, step))
            if found.objective < fit.objective:
                if fit.objective - found.objective > SHORT * 2 * _promised(around, step):
                    found = self._farther(found, step)
                return found, max(damping / 10, 1e-7)
            damping *= 10
        return None, damping

    def _farther(self, found: Fit, step: np.ndarray) -> Fit:
        """The likeliest after a step more, and after steps each twice as long as the one before."""
        while True:
            tried = self.judged(self._moved(found, step))
            if not tried.objective < found.objective:
                return found
            found, step = tried, 2 * step

    def _step(self, around: Around, fit: Fit, free: np.ndarray, damping: float) -> np.ndarray:
        c = fit.coefficients
        first, n = len(around.slope) - c.size, len(around.slope)
        prior = np.zeros((n, n))
        prior[first:, first:] = self.nodes.information
        slope = around.slope - prior[:, first:] @ c.ravel()
        used = np.append(np.ones(first, bool), np.tile(free, len(c)))
        step = np.zeros(n)
        step[used] = solved((around.information + prior)[np.ix_(used, used)], slope[used], damping)
        own = step[:first].reshape(-1, OWN)  # a view, as the next
        own /= np.maximum(1, np.max(np.abs(own) / self.longest[:OWN], axis=1, keepdims=True))
        shared = step[first:]
        shared /= max(1.0, float(np.max(np.abs(shared), initial=0)) / self.longest[OWN])
        return step

    def _moved(self, fit: Fit, step: np.ndarray) -> Fit:
        count = len(fit.points.intensities)
        own = step[: OWN * count].reshape(count, OWN)
        places = np.clip(fit.points.positions + own[:, :PLACES], *self.limits)
        points = Points(places, fit.points.intensities * np.exp(own[:, PLACES]))
        found = fit.coefficients + step[OWN * count :].reshape(fit.coefficients.shape)
        if self.unit:
            found[:, -1] = np.maximum(found[:, -1], 0)
        return fit.changed(points=points, coefficients=found)


def solved(matrix: np.ndarray, right: np.ndarray, damping: float = 0.0) -> np.ndarray:
    """Solution of a system whose unknowns are scaled to a diagonal of 1, and damped."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12 * np.diag(matrix).max()))
    whole = matrix / np.outer(scale, scale) + (damping + 1e-10) * np.eye(len(matrix))
    right = right / (scale if right.ndim == 1 else scale[:, None])
    found = np.linalg.solve(whole, right)
    return found / (scale if right.ndim == 1 else scale[:, None])


def _promised(around: Around, step: np.ndarray) -> float:
    """Log-likelihood that a step gains if derivatives stay as they are."""
    return float(around.slope @ step - step @ around.information @ step / 2)


def _way(before: Fit, after: Fit) -> np.ndarray:
    """The step from one fit to another of as many beads."""
    light = np.log(after.points.intensities / before.points.intensities)
    own = np.column_stack([after.points.positions - before.points.positions, light])
    return np.append(own, after.coefficients - before.coefficients)


def _shared(basis: np.ndarray, terms: int) -> np.ndarray:
    """Matrix (beads, own, all) from all unknowns to each bead's own and the coefficients at its place."""
    beads, nodes = basis.shape
    found = np.zeros((beads, OWN + terms, beads * OWN + nodes * terms))
    for p in range(beads):
        found[p, :OWN, p * OWN :][:, :OWN] = np.eye(OWN)
        found[p, OWN:, beads * OWN :] = np.kron(basis[p], np.eye(terms))
    return found.reshape(-1, found.shape[-1])


def stepped(progress: Progress, steps: int) -> None:
    """Report that a fit has taken so many steps."""
    progress(Stage(steps / (steps + USUAL), f"step {steps} of the fit"))
