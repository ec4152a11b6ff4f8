r"""Richardson-Lucy: the most likely object under photon noise, by steps that keep it positive.

.. math:: o \leftarrow \frac{o}{A^T w}\; A^T\!\left[ w\, \frac{r}{A o + b} \right]

W. H. Richardson, J. Opt. Soc. Am. 62, 55 (1972); L. B. Lucy, Astron. J. 79, 745 (1974); with weights and
background as L. A. Shepp & Y. Vardi, IEEE Trans. Med. Imaging 1, 113 (1982).
"""

from dataclasses import dataclass

from lumigraph.core import arrays
from lumigraph.core.arrays import Array
from lumigraph.deconvolution.methods import Filter, Prior, State, check_offers, check_start
from lumigraph.deconvolution.problem import Problem

_RISE = 1.02  # of the deviance: priors and filters may raise it a little


@dataclass(frozen=True, slots=True, eq=False)
class RichardsonLucy:
    """Richardson-Lucy iterations, plain or with a prior, a filter or momentum.

    Plain steps never lower the likelihood, and keep the light: Σ Aᵀ1 · o is what was measured. Object
    samples that the sensor hardly sees stay dark.

    Parameters
    ----------
    prior
        `TotalVariation` or `Wavelets`; None for the most likely object.
    filter
        Applied to the factor of each step, such as `LowPass`: an even start never takes up what it removes,
        and light is not drawn from one plane to another. What it leaves below 0 becomes 0. A step that would
        fit the raw image worse by 2 % is taken without it.
    accelerated
        Accelerated Richardson-Lucy: extrapolates each step by the last one (Biggs & Andrews), and reaches the
        same likelihood in a third to a tenth of the steps; a plain step is taken where it is likelier.
    start
        First estimate (y, x) or (z, y, x); an even object if left out. What is 0 there stays 0.

    Raises
    ------
    GeometryError
        A start with negative or NaN values, or what is no prior or filter.

    References
    ----------
    D. S. C. Biggs & M. Andrews, "Acceleration of iterative image restoration algorithms", Appl. Opt. 36,
    1766 (1997).
    """

    prior: Prior | None = None
    filter: Filter | None = None
    accelerated: bool = False
    start: Array | None = None

    def __post_init__(self) -> None:
        check_start(self.start)
        if self.prior is not None:
            check_offers("prior", self.prior, ("shrink",), "Give TotalVariation(...) or Wavelets(...).")
        if self.filter is not None:
            check_offers("filter", self.filter, ("__call__",), "Give LowPass(...).")

    def step(self, problem: Problem, state: State) -> State:
        """The next state: one application of Aᵀ and one of A, or up to three where it would fit far worse."""
        light = problem.scale.back(problem.data / state.model)
        most = state.deviance * (1.0 if self.prior is None and self.filter is None else _RISE)
        estimate, memory = self._drawn(problem, state, self._improved(problem, state, light))
        if self.accelerated:
            change = estimate - state.estimate
            ahead = _ahead(estimate, change, state)
            memory |= {"last": estimate, "change": change}
            found = State.at(problem, ahead, memory, state.done + 1)
            if found.deviance <= most:
                return found
        found = State.at(problem, estimate, memory, state.done + 1)
        if self.filter is None or found.deviance <= most:
            return found
        return State.at(problem, *self._drawn(problem, state, _plain(problem, state, light)), state.done + 1)

    def _improved(self, problem: Problem, state: State, light: Array) -> Array:
        if self.filter is None:
            return _plain(problem, state, light)
        factor = arrays.by_part(_where_seen, problem.scale.over_sensitivity(light), problem.scale.sensitivity)
        return arrays.by_part(_times, state.estimate, self.filter(factor))

    def _drawn(self, problem: Problem, state: State, estimate: Array) -> tuple[Array, dict[str, Array]]:
        if self.prior is None:
            return estimate, {}
        return self.prior.shrink(problem, estimate, state)


def _plain(problem: Problem, state: State, light: Array) -> Array:
    """The estimate times `light` over the sensitivity, in one go: arrays may be far larger than caches."""

    def after(before: Array, light: Array, by: Array) -> Array:
        return _times(before, light / by)

    return arrays.by_part(after, state.estimate, light, problem.scale.sensitivity)


def _ahead(estimate: Array, change: Array, state: State) -> Array:
    """The estimate and a part of its move since the last one: that by which changes shrink."""
    last, before = state.memory.get("last"), state.memory.get("change")
    if last is None or before is None:
        return estimate
    xp = arrays.namespace(estimate)
    whole = float(xp.sum(before * before))
    part = float(xp.sum(change * before)) / whole if whole > 0 else 0.0
    return _positive(estimate + min(max(part, 0.0), 1.0) * (estimate - last))


def _where_seen(factor: Array, sensitivity: Array) -> Array:
    xp = arrays.namespace(factor)
    return xp.where(xp.isfinite(sensitivity), factor, xp.ones_like(factor))


def _times(before: Array, factor: Array) -> Array:
    return _positive(before * factor)


def _positive(values: Array) -> Array:
    xp = arrays.namespace(values)
    return xp.maximum(values, xp.zeros_like(values))
