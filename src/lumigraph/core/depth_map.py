"""A depth for each place of a picture, in the quantity that was measured."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from lumigraph.core import checks, picture
from lumigraph.core.arrays import A, like, to_numpy
from lumigraph.core.brief import brief
from lumigraph.core.labelled import Labels
from lumigraph.core.noun import Noun
from lumigraph.errors import GeometryError

QUANTITIES: Mapping[str, str] = MappingProxyType(
    {"disparity": "px", "alpha": "1", "patch": "px", "virtual depth": "1", "depth": "m"}
)
"""Quantities of a map, and their units.

- disparity: lenslets that a point moves from one view to the next; positive is nearer than the plane in focus
- alpha: refocus factor α' = F/F'; above 1 is farther
- patch: size of the piece of a plenoptic 2.0 micro-image that tiles the picture, as `render` takes it
- virtual depth: a'/b, distance of the main lens' image from the lenslets over that of the sensor
- depth: distance from the focused plane, positive farther from the camera
"""


@dataclass(frozen=True, slots=True, eq=False)
class DepthMap(Noun[A]):
    """A value for each place of a picture, and how much to trust it.

    Parameters
    ----------
    values
        (y, x), in the unit of the quantity; NaN where nothing can be said.
    confidence
        0 (a guess) to 1 (as sharp as the data can be) for each value.
    quantity
        One of `QUANTITIES`.
    error
        Mean distance from the truth to expect of each value (y, x), in its unit; None where the method
        does not estimate it.

    Raises
    ------
    GeometryError
        Values that are not (y, x), a confidence or error of another shape, an unknown quantity.

    Examples
    --------
    >>> found = DepthMap(np.array([[0.5, -1.0]]), np.array([[1.0, 0.2]]), "disparity")
    >>> found.unit, found.trusted(0.5).tolist()
    ('px', [[0.5, nan]])
    """

    pixels: ClassVar[str] = "values"
    axes: ClassVar[str] = "yx"

    values: A
    confidence: A
    quantity: str
    error: A | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        checks.array("values", self.values)
        checks.array("confidence", self.confidence)
        checks.choice("quantity", self.quantity, QUANTITIES)
        shape, other = tuple(self.values.shape), tuple(self.confidence.shape)
        if len(shape) != 2 or other != shape:
            raise GeometryError(
                f"values have shape {shape} and confidence {other} but both must be (y, x), the same."
            )
        if self.error is None:
            return
        checks.array("error", self.error)
        if tuple(self.error.shape) != shape:
            raise GeometryError(
                f"values have shape {shape} and error {tuple(self.error.shape)} but both must be (y, x), "
                "the same."
            )

    @property
    def unit(self) -> str:
        """Unit of the values: "px", "1" or "m"."""
        return QUANTITIES[self.quantity]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns (y, x)."""
        return int(self.values.shape[0]), int(self.values.shape[1])

    @property
    def alpha(self) -> A:
        """Refocus factors (y, x) of a map that holds them."""
        self.check("alpha")
        return self.values

    @property
    def usual_error(self) -> float | None:
        """Median of the expected errors; None where none is known."""
        known = np.zeros(0) if self.error is None else to_numpy(self.error)
        known = known[np.isfinite(known)]
        return float(np.median(known)) if known.size else None

    def quantiles(self, *parts: float) -> tuple[float, ...]:
        """Values below which these parts of the map lie, places counted by their confidence; NaN of none."""
        values, trust = to_numpy(self.values).ravel(), to_numpy(self.confidence).ravel()
        known = np.isfinite(values) & (trust > 0)
        if not known.any():
            return (math.nan,) * len(parts)
        order = np.argsort(values[known])
        sums = np.cumsum(trust[known][order], dtype=float)
        places = np.searchsorted(sums, np.array(parts) * sums[-1])
        return tuple(float(v) for v in values[known][order][np.clip(places, 0, len(order) - 1)])

    def _repr_html_(self) -> str:
        values, trust = to_numpy(self.values), to_numpy(self.confidence)
        known = values[np.isfinite(values)]
        ends = [
            picture.length(float(end)) if self.unit == "m" else f"{end:.4g} {self.unit}".removesuffix(" 1")
            for end in ((known.min(), known.max()) if known.size else ())
        ]
        rows = [
            ("size", picture.sized(self.shape)), (self.quantity, " to ".join(ends) or "nothing is known"),
            ("mean confidence", f"{float(np.nanmean(trust)):.3g}"),
        ]  # fmt: skip
        if self.usual_error is not None:
            rows.append(("expected error, median", f"{self.usual_error:.3g} {self.unit}".removesuffix(" 1")))
        low = float(known.min()) if known.size else 0.0
        return picture.card(
            "Depth map", rows, picture.thumbnail(values - low), f"{self.quantity}, least black"
        )

    def trusted(self, lowest: float) -> A:
        """The values (y, x), NaN where the confidence is below `lowest`."""
        values, trust = to_numpy(self.values), to_numpy(self.confidence)
        return like(np.where(trust >= lowest, values, np.nan), self.values)

    def replaced(
        self, values: np.ndarray, quantity: str, slope: np.ndarray | float | None = None
    ) -> "DepthMap":
        """Map with other values; where they are NaN, the confidence becomes 0.

        `slope` is how much they change with the values before; where None, expected errors are not known.
        """
        trust = np.where(np.isfinite(values), to_numpy(self.confidence), 0.0)
        error = None if self.error is None or slope is None else np.abs(slope) * to_numpy(self.error)
        return replace(
            self,
            values=like(values, self.values),
            confidence=like(trust, self.confidence),
            quantity=quantity,
            error=None if error is None else like(error, self.values),
        )

    def _labels(self) -> Labels:
        along = {"confidence": (("y", "x"), to_numpy(self.confidence))}
        if self.error is not None:
            along["error"] = (("y", "x"), to_numpy(self.error))
        units = {"confidence": "1", "error": self.unit}
        return Labels("yx", self.quantity, self.unit, along, units, attributes={"quantity": self.quantity})

    @classmethod
    def _of_labels(cls, labels: Labels) -> Self:
        trust = labels.along.get("confidence", np.ones(labels.data.shape))
        return cls(labels.data, trust, labels.attribute("quantity"), labels.along.get("error"))

    def check(self, *quantities: str) -> None:
        """Refuse a map of another quantity.

        Raises
        ------
        GeometryError
            The message gives the one that it has and those that are needed.
        """
        if self.quantity not in quantities:
            raise GeometryError(
                f"the map holds {self.quantity} [{self.unit}] but {' or '.join(quantities)} is needed."
            )
