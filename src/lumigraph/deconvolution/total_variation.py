r"""Total variation: objects are even but for edges.

.. math:: \min_{o \ge 0}\; \sum w\,[A o + b - r \ln(A o + b)] + \lambda \bar s \int |\nabla o|

Each step is a step of Richardson-Lucy, then the total variation is lowered in the metric of that step. The
steps, and the multiplicative form of Dey et al.: docs/theory/deconvolution.md.

N. Dey et al., Microsc. Res. Tech. 69, 260 (2006); C. Brune, A. Sawatzky & M. Burger, Int. J. Comput. Vis. 92,
211 (2011); the dual steps are those of A. Beck & M. Teboulle, IEEE Trans. Image Process. 18, 2419 (2009).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lumigraph.core import arrays, checks
from lumigraph.core.arrays import Array
from lumigraph.deconvolution.methods import State
from lumigraph.deconvolution.problem import Problem
from lumigraph.errors import GeometryError

_TINY = 1e-30


@dataclass(frozen=True, slots=True)
class TotalVariation:
    """A prior for `RichardsonLucy` and `LeastSquares`: noise goes, edges stay.

    Parameters
    ----------
    strength
        λ, without unit: the weight of `|∇o|` per sample, over that of a sample's light. The noise of n
        photons per sample is flattened from about 1/√n on: 0.002 for bright images, 0.05 for dim ones.
    spacing
        Distances between samples (y, x) or (z, y, x) [any unit]: differences along z count by the slope that
        they mean, over the mean lateral pitch. None takes those that the operator knows, else equal ones.
    steps
        Of the inner iteration; what it has reached is kept for the next.

    Raises
    ------
    GeometryError
        A strength, spacing or number of steps that is not above zero.
    """

    strength: float = 0.005
    spacing: Sequence[float] | None = None
    steps: int = 8

    def __post_init__(self) -> None:
        checks.positive("strength", self.strength, "1")
        checks.whole("steps", self.steps)
        if self.spacing is not None:
            spacing = tuple(checks.positive("spacing", value, "") for value in self.spacing)
            object.__setattr__(self, "spacing", spacing)

    def shrink(self, problem: Problem, before: Array, state: State) -> tuple[Array, dict[str, Array]]:
        """The step of Richardson-Lucy, smoothed in its own metric s/o."""
        metric = problem.scale.over_sensitivity(state.estimate) * problem.scale.mean_sensitivity
        return self.smoothed(problem, before, metric, state.memory.get("dual"))

    def smoothed(
        self, problem: Problem, image: Array, metric: Array, dual: Array | None
    ) -> tuple[Array, dict[str, Array]]:
        """Minimum of ½ Σ (o - image)²/metric + λ Σ `|∇o|` for o ≥ 0, and its dual variable."""
        weights = self.axis_weights(problem)
        scaled = self.strength * metric
        steps = _dual_steps(scaled, weights)
        xp = arrays.namespace(image)
        dual = xp.zeros_like(gradient(image, weights)) if dual is None else dual
        ahead, pace = dual, 1.0
        for _ in range(self.steps):
            moved = _within(ahead + steps * gradient(_primal(image, scaled, ahead, weights), weights))
            faster = (1 + (1 + 4 * pace**2) ** 0.5) / 2
            ahead, pace = moved + ((pace - 1) / faster) * (moved - dual), faster
            dual = moved
        return _primal(image, scaled, dual, weights), {"dual": dual}

    def axis_weights(self, problem: Problem) -> tuple[float, ...]:
        """Mean lateral pitch over the spacing of each axis; 0 along an axis of one sample."""
        shape = tuple(problem.scale.sensitivity.shape)
        spacing = self.spacing
        if spacing is None:
            spacing = _spacing_of(problem, len(shape))
        if len(spacing) != len(shape):
            raise GeometryError(
                f"spacing has {len(spacing)} numbers but the object has {len(shape)} axes {shape}."
            )
        lateral = float(np.mean(spacing[-2:]))
        return tuple(lateral / step if n > 1 else 0.0 for n, step in zip(shape, spacing, strict=True))

    def penalty(self, problem: Problem, estimate: Array) -> float:
        """λ s̄ Σ `|∇o|`, to be compared with half of the deviance's sum over the gain."""
        slopes = gradient(estimate, self.axis_weights(problem))
        xp = arrays.namespace(estimate)
        total = float(xp.sum(xp.sqrt(xp.sum(slopes**2, axis=0))))
        return self.strength * problem.scale.mean_sensitivity * total


def gradient(image: Array, weights: Sequence[float]) -> Array:
    """Differences to the next sample along each axis (axes, ...), weighted; 0 at the end."""
    xp = arrays.namespace(image)
    parts = []
    for axis, weight in enumerate(weights):
        first, last = _cut(image, axis, slice(0, -1)), _cut(image, axis, slice(1, None))
        end = xp.zeros_like(_cut(image, axis, slice(0, 1)))
        parts.append(weight * xp.concat([last - first, end], axis=axis))
    return xp.stack(parts)


def gradient_adjoint(slopes: Array, weights: Sequence[float]) -> Array:
    """Transpose of `gradient`: minus the divergence."""
    xp = arrays.namespace(slopes)
    result = xp.zeros_like(slopes[0, ...])
    for axis, weight in enumerate(weights):
        inner = _cut(slopes[axis, ...], axis, slice(0, -1))
        end = xp.zeros_like(_cut(slopes[axis, ...], axis, slice(0, 1)))
        result = result + weight * (xp.concat([end, inner], axis=axis) - xp.concat([inner, end], axis=axis))
    return result


def _primal(image: Array, scaled: Array, dual: Array, weights: Sequence[float]) -> Array:
    xp = arrays.namespace(image)
    values = image - scaled * gradient_adjoint(dual, weights)
    return xp.where(values > 0, values, xp.zeros_like(values))


def _dual_steps(scaled: Array, weights: Sequence[float]) -> Array:
    """One step length per sample that keeps the dual iteration from overshooting.

    T. Pock & A. Chambolle, ICCV 2011 (10.1109/ICCV.2011.6126441), lemma 2: rows' sums of |∇| (metric) |∇ᵀ|.
    """
    xp = arrays.namespace(scaled)
    column, largest = 2 * sum(weights), xp.zeros_like(scaled)
    for axis, weight in enumerate(weights):
        end = _cut(scaled, axis, slice(-1, None))
        beyond = xp.concat([_cut(scaled, axis, slice(1, None)), end], axis=axis)
        largest = xp.maximum(largest, column * weight * (scaled + beyond))
    return 1 / (largest + _TINY)


def _within(dual: Array) -> Array:
    """Each sample's vector, shortened to 1 where it is longer."""
    xp = arrays.namespace(dual)
    length = xp.sqrt(xp.sum(dual**2, axis=0))
    return dual / xp.where(length > 1, length, xp.ones_like(length))


def _cut(image: Array, axis: int, part: slice) -> Array:
    return image[(*(slice(None) for _ in range(axis)), part, ...)]


def _spacing_of(problem: Problem, axes: int) -> tuple[float, ...]:
    operator = problem.scale.operator
    grid = operator.object_grid
    if grid is None:
        return (1.0,) * axes
    pitch = grid.pitch
    if axes == 2:
        return pitch
    depths = operator.depths
    if depths is None:
        return (float(np.mean(pitch)), *pitch)
    return (float(np.abs(np.diff(depths)).mean()) if len(depths) > 1 else 1.0, *pitch)
