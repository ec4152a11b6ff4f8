r"""A volume and a wavefront together: Richardson-Lucy's steps on one, Gauss and Newton's on both.

With o the volume, A(c) the operator of coefficients c, m = A o + b and F = diag(g w / m), the change of the
image by c_j is J_j = ∂A/∂c_j o. What the volume can explain of it, by changes o u of its own, counts for
nothing: u_j is the most likely one for J_j, with a prior of 1 for u, and what is left is

.. math:: P_j = J_j - A (o u_j), \quad S = J^T F P, \quad S\, \delta = P^T F (r - m)

S is Fisher's information of c with all voxels unknown (a Schur complement).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lumigraph.adaptive.field import PRIOR
from lumigraph.adaptive.fit import solved, stepped
from lumigraph.adaptive.misfit import Misfit
from lumigraph.adaptive.sight import Sight
from lumigraph.core import arrays
from lumigraph.core.progress import Progress, silent
from lumigraph.core.threads import single_products
from lumigraph.deconvolution import RichardsonLucy
from lumigraph.deconvolution.beyond import BARELY
from lumigraph.deconvolution.exposure import Exposure
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.problem import Problem, Scale
from lumigraph.operators.microscope_operator import MicroscopeOperator

SOLVED = 20
"""Steps of conjugate gradients by which the volume explains a change."""

LONGEST = 0.5
"""Longest step of all coefficients together [waves rms]."""

TRIES = 4
"""Steps, each shorter than the one before, of which one must be likelier."""

STEPS = 25
"""Steps, at most."""

SETTLED, SETTLING = 0.1, 6
"""Chi square of a step, all coefficients together, that need not be taken any more; and steps at most."""

PROBE, LEAST = 3.0, 0.2
"""Standard deviations, all coefficients together, of a step that shows how the slope changes; and the least
part of the promised change that is believed.
"""

GAIN = 2.0
"""Log-likelihood that a step must gain for another one to follow."""


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """A volume and coefficients that explain a raw image.

    Parameters
    ----------
    coefficients
        (terms,) [waves rms].
    problem
        With the operator of these coefficients.
    state
        The volume, its image and its deviance per pixel.
    steps
        Taken so far.
    iterations
        Of Richardson-Lucy.
    """

    coefficients: np.ndarray
    problem: Problem
    state: State
    steps: int
    iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """Derivatives of the log-likelihood by coefficients, around a volume and a wavefront.

    Parameters
    ----------
    information
        S (terms, terms), without the prior.
    slope
        Of the log-likelihood (terms,).
    fixed
        Fisher's information (terms, terms) if the volume were known.
    scores
        What each pixel adds to the slope (terms, ny, nx).
    pull
        What was taken from the slope (terms,).
    """

    information: np.ndarray
    slope: np.ndarray
    fixed: np.ndarray
    scores: np.ndarray
    pull: np.ndarray

    def less(self, part: float, pull: np.ndarray) -> "Around":
        """The same with a part of the information, and a slope without what pulls at it."""
        return replace(self, information=part * self.information, slope=self.slope - pull, pull=pull)


@dataclass(frozen=True, slots=True, eq=False)
class Voxels:
    """Model of a raw image: a volume before its instrument's wavefront.

    Parameters
    ----------
    sight
        Operators by coefficients.
    raw, exposure
        What was seen.
    progress
        Of the steps.
    method
        By which the object is found.
    least
        Part of the most light that a sample must send onto pixels that count, to be lit.
    """

    sight: Sight
    raw: np.ndarray
    exposure: Exposure
    progress: Progress = silent
    method: RichardsonLucy = field(default_factory=lambda: RichardsonLucy(accelerated=True))
    least: float = BARELY

    def begun(self, coefficients: np.ndarray, iterations: int, steps: int = 0) -> Told:
        """Coefficients with the volume that Richardson-Lucy finds from an even one."""
        operator = self.sight.operator(coefficients)
        problem = Problem.of(self.raw, self.exposure, Scale.of(operator, self.exposure, self.raw, self.least))
        state = State.at(problem, problem.flat())
        for _ in range(iterations):
            state = self.method.step(problem, state)
        return Told(coefficients, problem, state, steps, iterations)

    def counted(self, told: Told) -> float:
        """Pixels that count."""
        return float(self._weights(told.problem).sum()) / told.problem.scale.gain

    def misfit(self, told: Told) -> Misfit:
        """Misfit of the raw image."""
        shown, data = arrays.to_numpy(told.state.model), arrays.to_numpy(told.problem.data)
        return Misfit.of(self._weights(told.problem), told.problem.scale.gain, data, shown)

    def improved(self, told: Told, free: np.ndarray, steps: int = STEPS) -> tuple[Told, Around]:
        """Volume and coefficients after at most some steps of the marked terms, and what is around them."""
        damping, around = 1e-2, self.around(told)
        for _ in range(steps):
            found = None
            for _ in range(TRIES):
                tried = self._moved(told, self._step(told, around, free, damping))
                if tried.state.deviance < told.state.deviance:
                    found, damping = self._farther(told, tried), damping / 10
                    break
                damping = max(10 * damping, 0.1)
            if found is None:
                break
            gained = (told.state.deviance - found.state.deviance) / 2 * self.counted(told)
            told, around = found, self.around(found)
            stepped(self.progress, told.steps)
            if gained < GAIN:
                break
        return told, around

    def settled(self, told: Told, around: Around, free: np.ndarray) -> tuple[Told, Around]:
        """The same after at most some steps to where the slope vanishes, and what is around them.

        An object takes up noise, and the more of it the more a wavefront spreads the light: where the
        deviance is least, coefficients are off by that. The slope leaves out most of what the object takes
        up, and what pulls at it is taken away. Noise in the object looks like information, too: less of it is
        left, by how the slope changes.
        """
        less = self._part(told, around, free), self._pull(told)
        around = around.less(*less)
        for _ in range(SETTLING):
            if self._steep(told, around, free) < SETTLED:
                break
            tried = self._moved(told, self._step(told, around, free, 0.0))
            beyond = self.around(tried).less(*less)
            if self._steep(tried, beyond, free) >= self._steep(told, around, free):
                break
            told, around = tried, beyond
            stepped(self.progress, told.steps)
        return told, around

    def _pull(self, told: Told) -> np.ndarray:
        """Slope (terms,) where an object like this one is seen through these very coefficients, with noise.

        With a noise and with its negative, so that what is linear in it goes.
        """
        shown, by = arrays.to_numpy(told.state.model), self.sight.changes(told.coefficients)
        noise = np.random.default_rng(0).normal(size=shown.shape) * np.sqrt(shown / told.problem.scale.gain)
        slopes = []
        for sign in (1, -1):
            drawn = shown + sign * np.clip(noise, -shown, shown) - self.exposure.offset
            seen = replace(self, raw=drawn.astype(self.raw.dtype))
            slopes.append(seen.around(seen.begun(told.coefficients, told.iterations), by).slope)
        return (slopes[0] + slopes[1]) / 2

    def _part(self, told: Told, around: Around, free: np.ndarray) -> float:
        """Part of the slope's change that the information promises and a step brings; at most 1."""
        whole, _ = self._free(told, around, free)
        step = np.zeros(len(free))
        step[free] = np.linalg.inv(np.linalg.cholesky(whole)).T.sum(1) * PROBE / math.sqrt(len(whole))
        beyond = self.around(self._moved(told, step))
        return float(
            np.clip(step @ (around.slope - beyond.slope) / (step @ around.information @ step), LEAST, 1)
        )

    def _farther(self, told: Told, found: Told) -> Told:
        """Volume and coefficients after steps each twice as long, as long as they are likelier."""
        while True:
            step = 2 * (found.coefficients - told.coefficients)
            if np.linalg.norm(step) > LONGEST:
                return found
            tried = replace(self._moved(told, step), steps=found.steps)
            if tried.state.deviance >= found.state.deviance:
                return found
            found = tried

    @single_products()
    def around(self, told: Told, by: Sequence[MicroscopeOperator] | None = None) -> Around:
        """Derivatives of the image by coefficients, without what the volume explains of them."""
        scale, volume = told.problem.scale, np.asarray(told.state.estimate, np.float32)
        response = 1.0 if scale.response is None else arrays.to_numpy(scale.response)
        shown, data = arrays.to_numpy(told.state.model), arrays.to_numpy(told.problem.data)
        weights = (self._weights(told.problem) / shown).astype(np.float32)
        changes = [response * one.forward(volume) for one in by or self.sight.changes(told.coefficients)]
        columns = np.stack(changes).astype(np.float32)
        left = np.stack([c - self._seen(told, self._explained(told, weights, c)) for c in columns])
        whole, fixed = (
            np.tensordot(columns * weights, those, ((1, 2), (1, 2))).astype(np.float64)
            for those in (left, columns)
        )
        scores = left * (weights * (data - shown)).astype(np.float32)
        slope = scores.sum((1, 2), dtype=np.float64)
        return Around((whole + whole.T) / 2, slope, fixed, scores, 0 * slope)

    def _explained(self, told: Told, weights: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Relative changes u of the volume that explain an image best, by conjugate gradients."""
        u, right = 0.0, self._back(told, weights * column)
        rows = self._back(told, weights * self._seen(told, np.ones_like(right))) + 1
        ahead = moved = right / rows
        power = float((right * moved).sum(dtype=np.float64))
        first = power
        for _ in range(SOLVED):
            if power <= 1e-4 * first:
                break
            turned = self._back(told, weights * self._seen(told, ahead)) + ahead
            step = power / float((ahead * turned).sum(dtype=np.float64))
            u, right = u + step * ahead, right - step * turned
            moved = right / rows
            power, before = float((right * moved).sum(dtype=np.float64)), power
            ahead = moved + power / before * ahead
        return u + 0 * ahead

    def _seen(self, told: Told, move: np.ndarray) -> np.ndarray:
        """A (o u), on the pixels."""
        scale = told.problem.scale
        light = scale.operator.forward(np.asarray(told.state.estimate, np.float32) * move)
        return light if scale.response is None else light * arrays.to_numpy(scale.response)

    def _back(self, told: Told, image: np.ndarray) -> np.ndarray:
        """Transpose of `_seen`."""
        scale = told.problem.scale
        light = image if scale.response is None else image * arrays.to_numpy(scale.response)
        return np.asarray(told.state.estimate, np.float32) * scale.operator.adjoint(light.astype(np.float32))

    def _step(self, told: Told, around: Around, free: np.ndarray, damping: float) -> np.ndarray:
        step, (whole, slope) = np.zeros(len(free)), self._free(told, around, free)
        step[free] = solved(whole, slope, damping)
        return step / max(1.0, float(np.linalg.norm(step)) / LONGEST)

    def _steep(self, told: Told, around: Around, free: np.ndarray) -> float:
        """Chi square of the step that the slope implies."""
        whole, slope = self._free(told, around, free)
        return float(slope @ solved(whole, slope))

    def _free(self, told: Told, around: Around, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Information and slope of the free coefficients, with the prior."""
        whole = around.information + np.eye(len(free)) / PRIOR**2
        return whole[np.ix_(free, free)], (around.slope - told.coefficients / PRIOR**2)[free]

    def _moved(self, told: Told, step: np.ndarray) -> Told:
        return self.begun(told.coefficients + step, told.iterations, told.steps + 1)

    def _weights(self, problem: Problem) -> np.ndarray:
        """Electrons that a unit of each pixel counts for (ny, nx)."""
        scale = problem.scale
        ones = np.ones(self.raw.shape) if scale.weights is None else arrays.to_numpy(scale.weights)
        return scale.gain * ones
