"""`ToleranceTrials`: computations on a camera with tolerances, item by item, in any order."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from typing import Any

import numpy as np

from lumigraph import metrology
from lumigraph.cluster import Values
from lumigraph.core import checks
from lumigraph.errors import FormatError, GeometryError, LumigraphError
from lumigraph.instruments import LensletCamera, Tolerance
from lumigraph.instruments.loading import camera_of
from lumigraph.instruments.tolerances import FORM
from lumigraph.metrology.datasheet.charts import check_camera as check_charts
from lumigraph.studies.tolerance.making import (
    LEANS,
    SEED,
    built,
    check_camera,
    drawn,
    tolerances_of,
    value_of,
)
from lumigraph.studies.tolerance.measures import STREHL, is_finite, measures, of_differing, of_making
from lumigraph.studies.tolerance.single import changes

MOST = 1_000_000
"""Cameras that are drawn at most."""

VIEWS = "lenslets that see a point"
"""Measure of cameras 2.0, in place of the views that matched f-numbers would give."""

USUAL = (
    "focus shift", "depth error", "blur at the object", "lateral resolution", "views per axis",
    VIEWS, "micro-image fill", "cross-talk", "corner shift y", "corner shift x",
)  # fmt: skip
"""Measures that are taken where none are named."""

OF_LENSLETS = ("lenslet focus shift", "light of a point")
"""Additional measures where lenslets differ from each other."""

OF_LEANING = ("corner focus shift", "corner depth error")
"""Additional measures where array or sensor lean."""

CAMERA, ERROR = "camera", "error"
"""Columns: which camera it is, and why there is none."""


@dataclass(frozen=True)
class ToleranceTrials:
    """Work of `lumigraph.cluster.batch`: a camera as described, with one error each way, or by chance.

    Parameters
    ----------
    camera
        Text of a camera file.
    tolerances
        How far values may be off.
    names
        Of the measures.
    seed
        Of all that is drawn.
    """

    camera: str
    tolerances: tuple[Tolerance, ...]
    names: tuple[str, ...]
    seed: int = 0

    @classmethod
    def of(
        cls,
        camera: LensletCamera,
        tolerances: Mapping[str, str | Tolerance] | None = None,
        measure: Sequence[str] | None = None,
        *,
        seed: int = 0,
    ) -> "ToleranceTrials":
        """Trials of a camera.

        Parameters
        ----------
        camera
            What is meant, a plenoptic camera 1.0 or 2.0.
        tolerances
            Beside those of the camera file, or instead of them.
        measure
            Names of `measures`, or of `lumigraph.metrology.datasheet.simulated`; `USUAL` ones if left out.
        seed
            Of all that is drawn.

        Raises
        ------
        FormatError
            No tolerances, one that cannot be read, or a measure that is no number of this camera.
        GeometryError
            Another kind of instrument, or simulated measures of lenslets that differ from each other.
        """
        check_camera(camera)
        found = tolerances_of(camera, tolerances)
        known = [row.name for row in measures(camera, built(camera, {})) if is_finite(row.value)]
        names = _names(camera, measure, known, found)
        return cls(camera.to_toml(), found, names, checks.whole("seed", seed, 0, FormatError))

    @cached_property
    def meant(self) -> LensletCamera:
        """The camera as described."""
        return check_camera(camera_of(tomllib.loads(self.camera), "the camera file"))

    @cached_property
    def deviations(self) -> tuple[float, ...]:
        """Standard deviation of each value that may be off, in SI."""
        return tuple(one.deviation_of(value_of(self.meant, one.name)) for one in self.tolerances)

    @property
    def what(self) -> dict[str, Any]:
        """Description of the work, for a ledger."""
        given = {one.name: [one.half, one.relative, one.shape] for one in self.tolerances}
        return {"camera": self.camera, "tolerances": given, "measure": list(self.names), "seed": self.seed}

    @property
    def steps(self) -> int:
        """Items before those drawn by chance."""
        return 1 + 2 * len(self.tolerances)

    def items(self, draws: int) -> list[dict[str, Any]]:
        """The camera as described, with one standard deviation of each error either way, and drawn ones.

        Raises
        ------
        FormatError
            Fewer than 2 draws, or too many.
        """
        if not 2 <= checks.whole("draws", draws, 2, FormatError) <= MOST:
            raise FormatError(f"draws is {draws} but must be at most {MOST}.")
        sides = [{"off": one.name, "side": side} for one in self.tolerances for side in (1, -1)]
        return [{"off": ""}, *sides, *({"draw": k} for k in range(draws))]

    def errors_of(self, item: Mapping[str, Any]) -> dict[str, float]:
        """Errors of an item, in SI, by name."""
        if "draw" in item:
            return drawn(self.tolerances, self.deviations, item["draw"], seed=self.seed)
        pairs = zip(self.tolerances, self.deviations, strict=True)
        return {one.name: item["side"] * size for one, size in pairs if one.name == item["off"]}

    def __call__(self, item: Mapping[str, Any]) -> Values:
        """Errors and measures of an item, or the reason why there is no such camera."""
        errors = self.errors_of(item)
        about = f"draw {item['draw']}" if "draw" in item else _about(item)
        row: dict[str, Any] = {CAMERA: about}
        row |= {column(one.name, one.unit): errors.get(one.name, 0.0) for one in self.tolerances}
        if any(one.is_of_each for one in self.tolerances):
            row[SEED] = errors.get(SEED)
        each = next((one for one in self.tolerances if one.is_of_each and one.name == item.get("off")), None)
        try:
            found = self._found(built(self.meant, {} if each else errors))
            if each is not None:
                self._add_effects(found, each.name, item["side"])
        except LumigraphError as error:
            return Values({**row, ERROR: " ".join(str(error).split())})
        return Values(row | found)

    def _add_effects(self, found: dict[str, Any], name: str, side: int) -> None:
        """Add the effects of lenslets that differ by one deviation each, as independent errors add up."""
        size = next(s for one, s in zip(self.tolerances, self.deviations, strict=True) if one.name == name)
        for measure, (effect, bend) in changes(self.meant, name, size, of_differing(self.meant)).items():
            for heading in found.keys() & {measure, *(column(measure, unit) for unit in ("m", "px"))}:
                found[heading] += side * effect + bend

    def _found(self, made: LensletCamera) -> dict[str, Any]:
        known: dict[str, Any] = {row.name: row for row in of_making(self.meant, made)}
        for more in (made.trade_offs, made.quantities):  # the latter take a hundred times as long
            if not known.keys() >= set(self.names):
                known |= {row.name: row for row in more()}
        if simulated := [name for name in self.names if name not in known]:
            rng = np.random.default_rng(self.seed)  # the same noise for all: differences are the camera's
            known |= metrology.simulated(check_charts(made), simulated, rng=rng)
        return {column(name, known[name].unit): known[name].value for name in self.names}


def column(name: str, unit: str) -> str:
    """Heading of a value.

    >>> column("focus shift", "m"), column("views per axis", "")
    ('focus shift [m]', 'views per axis')
    """
    return f"{name} [{unit}]" if unit else name


def unit_of(heading: str) -> tuple[str, str]:
    """Name and unit of a heading.

    >>> unit_of("focus shift [m]")
    ('focus shift', 'm')
    """
    name, _, unit = heading.partition(" [")
    return name, unit.rstrip("]")


def _about(item: Mapping[str, Any]) -> str:
    if not item["off"]:
        return "as described"
    return f"{item['off']} {'+' if item['side'] > 0 else '-'} one deviation"


def _names(
    camera: LensletCamera,
    asked: Sequence[str] | None,
    known: Sequence[str],
    tolerances: Sequence[Tolerance],
) -> tuple[str, ...]:
    """The measures to compute, by name."""
    each = [one.name for one in tolerances if one.is_of_each]
    leans = any(one.name in (*LEANS, "array_bow") for one in tolerances)
    if asked is None:
        left = {"views per axis"} if VIEWS in known else set()
        usual = (*USUAL, *(OF_LENSLETS if each else ()), *(OF_LEANING if leans else ()))
        usual = (*usual, *((STREHL,) if FORM in each else ()))
        return tuple(name for name in usual if name in known and name not in left)
    for name in asked:
        if name not in known and not metrology.is_measure(name):
            near = get_close_matches(name, known, 3, 0.4)
            hint = f" Did you mean {', '.join(map(repr, near))}?" if near else ""
            raise FormatError(f"{name!r} is no number of a {camera.noun} camera.{hint}")
    if simulated := [name for name in asked if metrology.is_measure(name)]:
        check_charts(camera)
        if each:
            raise GeometryError(
                f"{simulated[0]} is simulated by an operator, which repeats from lenslet to lenslet; "
                f"{each[0]} makes them differ. Leave one of them out."
            )
    return tuple(dict.fromkeys(asked))
