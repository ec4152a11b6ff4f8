"""`study`: random cameras beside first-order sensitivities, and the most costly tolerances."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lumigraph import cluster
from lumigraph.core.result import Quantity
from lumigraph.core.short_repr import brief
from lumigraph.errors import GeometryError
from lumigraph.instruments import LensletCamera, Tolerance
from lumigraph.studies.tolerance.making import SEED
from lumigraph.studies.tolerance.outcome import PERCENTS, ToleranceOutcome
from lumigraph.studies.tolerance.trials import CAMERA, ERROR, ToleranceTrials, column, unit_of

ROUNDING = {"m": 1e-12, "rad": 1e-12}
"""Lengths and angles below these are 0: rounding of what is computed, a hundredth of an atom."""


@dataclass(frozen=True, eq=False)
class Study:
    """Result of a study: the effect of tolerances on a camera.

    Parameters
    ----------
    tolerances
        How far values may be off.
    deviations
        Standard deviation of each value, in SI.
    outcomes
        Of each measure.
    draws
        Cameras that were drawn.
    failures
        Reasons why some of them are impossible.
    """

    tolerances: tuple[Tolerance, ...]
    deviations: tuple[float, ...]
    outcomes: tuple[ToleranceOutcome, ...]
    draws: int
    failures: tuple[str, ...] = ()

    __repr__ = brief

    @classmethod
    def of(cls, trials: ToleranceTrials, rows: Sequence[Mapping[str, Any]]) -> "Study":
        """Study from the rows of some trials, in the order of their items.

        Raises
        ------
        GeometryError
            If the camera cannot be measured as described, or with one deviation of an error, or if too few
            of those drawn are possible.
        """
        for row in rows[: trials.steps]:
            if ERROR in row:
                raise GeometryError(f"{row[CAMERA]}: {row[ERROR]}")
        taken = rows[trials.steps :]
        good = [row for row in taken if ERROR not in row]
        bad = tuple(str(row[ERROR]) for row in taken if ERROR in row)
        if len(good) < 2:
            raise GeometryError(f"{len(bad)} of {len(taken)} cameras drawn are impossible, such as: {bad[0]}")
        given = {CAMERA, SEED, *(column(one.name, one.unit) for one in trials.tolerances)}
        headings = [heading for heading in rows[0] if heading not in given]
        found = (_outcome(heading, rows[: trials.steps], good) for heading in headings)
        outcomes = tuple(one for one in found if one is not None)
        return cls(trials.tolerances, trials.deviations, outcomes, len(taken), bad)

    def __getitem__(self, name: str) -> ToleranceOutcome:
        return next(one for one in self.outcomes if one.name == name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tolerances."""
        return tuple(one.name for one in self.tolerances)

    def rows(self) -> list[dict[str, Any]]:
        """A row for each measure and tolerance: which one to pay for, the most expensive first."""
        return [row for one in self.outcomes for row in self._rows(one)]

    def _rows(self, one: ToleranceOutcome) -> Iterator[dict[str, Any]]:
        for k in np.argsort(-one.shares, kind="stable").tolist():
            tolerance, size = self.tolerances[k], self.deviations[k]
            yield {
                "measure": one.name, "unit": one.unit, "as described": one.nominal,
                "tolerance": tolerance.name, "range": str(tolerance),
                "one deviation": size, "unit of the tolerance": tolerance.unit,
                "sensitivity": float(one.effects[k]) / size, "effect": float(one.effects[k]),
                "bend": float(one.bends[k]), "share": float(one.shares[k]),
                "deviation if halved": float(one.halved[k]), "deviation to first order": one.first_order,
                "deviation": one.deviation, "deviation error": one.deviation_error,
            }  # fmt: skip

    def quantities(self) -> tuple[Quantity, ...]:
        """Mean, deviation and percentiles of each measure with their 95 % intervals."""
        return tuple(quantity for one in self.outcomes for quantity in _quantities(one))

    def notes(self) -> Iterator[str]:
        """Remarks, one sentence each."""
        if self.failures:
            yield (
                f"{len(self.failures)} of {self.draws} cameras drawn are impossible and left out of all "
                f"numbers, such as: {self.failures[0]}"
            )
        for one in self.outcomes:
            if one.changes and not one.is_linear:
                yield (
                    f"{one.name} is not linear in these errors: its deviation is {one.deviation:.3g} but "
                    f"{one.first_order:.3g} to first order{f' [{one.unit}]' * bool(one.unit)}. "
                    "Trust the cameras drawn, not the shares"
                )
            if len(one.sample) < self.draws - len(self.failures):
                yield f"{one.name} has a value for {len(one.sample)} of {self.draws} cameras only"


def study(
    camera: LensletCamera,
    tolerances: Mapping[str, str | Tolerance] | None = None,
    *,
    draws: int = 1000,
    measure: Sequence[str] | None = None,
    seed: int = 0,
    output: str | os.PathLike[str] | None = None,
    workers: int | cluster.Cluster = 1,
) -> Study:
    """Monte Carlo study of tolerances: many random cameras beside first-order sensitivities.

    Parameters
    ----------
    camera
        What is meant, a plenoptic camera 1.0 or 2.0.
    tolerances
        Such as ``{"separation": "±0.05 mm"}``, beside those of the camera file or instead of them; see
        `Tolerance`.
    draws
        Cameras drawn by chance.
    measure
        Names of `measures`, or of `lumigraph.metrology.datasheet.simulated`, minutes for each camera.
    seed
        Of all that is drawn: the same one draws the same.
    output
        Beside which a ledger lists what is done. Safe to interrupt: the same call resumes. None
        computes in this process.
    workers
        Processes, or a `lumigraph.cluster.Dask`, with an output.

    Returns
    -------
    Study
        An `ToleranceOutcome` for each measure.

    Raises
    ------
    FormatError
        No tolerances, one that cannot be read, an unknown measure, or an output of another job.
    GeometryError
        Another kind of instrument, or errors with which there is no camera.

    Notes
    -----
    Errors are independent of each other, and of the whole camera, but for those below ``lenslets.each``:
    these are independent from lenslet to lenslet. To first order their effect is the root of the sum of
    squares of what each lenslet alone does to a measure.

    Examples
    --------
    >>> import lumigraph as lg
    >>> camera = lg.FocusedPlenopticCamera.from_catalogue("thesis-plenoptic-2-m050")
    >>> found = lg.tolerance.study(camera, {"separation": "±0.05 mm"}, draws=50, measure=["focus shift"])
    >>> float(round(found["focus shift"].first_order * 1e6, 1))  # the image of 2f moves as the lenslets do
    25.0
    """
    trials = ToleranceTrials.of(camera, tolerances, measure, seed=seed)
    items = trials.items(draws)
    if output is None:
        return Study.of(trials, [trials(item).row for item in items])
    files = cluster.inputs.named_in(trials.camera)
    cluster.batch(trials, items, output, what=trials.what, inputs=files, workers=workers)
    with cluster.rows(output) as rows:
        return Study.of(trials, rows)


def _outcome(
    heading: str, steps: Sequence[Mapping[str, Any]], drawn: Sequence[Mapping[str, Any]]
) -> ToleranceOutcome | None:
    """Outcome of one measure; None where the camera as described has no value."""
    name, unit = unit_of(heading)
    first = np.array([np.nan if row.get(heading) is None else row[heading] for row in steps], float)
    sample = np.array([row[heading] for row in drawn if row.get(heading) is not None], float)
    if np.isnan(first).any() or len(sample) < 2:
        return None
    more, less = first[1::2], first[2::2]
    nominal, effects, bends, sample = (
        np.where(np.abs(values) < ROUNDING.get(unit, 0.0), 0.0, values)
        for values in (first[0], (more - less) / 2, (more + less) / 2 - first[0], sample)
    )
    return ToleranceOutcome(name, unit, float(nominal), effects, bends, sample)


def _quantities(one: ToleranceOutcome) -> Iterator[Quantity]:
    def told(what: str, value: float, half: float) -> Quantity:
        return Quantity(f"{one.name}, {what}", value, one.unit, (value - 1.96 * half, value + 1.96 * half))

    yield Quantity(f"{one.name}, as described", one.nominal, one.unit)
    yield told("mean", one.mean, one.mean_error)
    yield told("deviation", one.deviation, one.deviation_error)
    yield Quantity(f"{one.name}, deviation to first order", one.first_order, one.unit)
    for percent in PERCENTS:
        value, interval = one.percentile(percent)
        yield Quantity(f"{one.name}, percentile {percent:g}", value, one.unit, interval)
