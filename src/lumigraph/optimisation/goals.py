"""What is made best of a camera."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph import metric
from lumigraph.errors import FormatError, GeometryError, SamplingWarning
from lumigraph.information import Light, bounds
from lumigraph.information.bounds import checked_depths
from lumigraph.information.points import collected
from lumigraph.instruments.instrument import Instrument
from lumigraph.metric.charts import check_camera

BOUNDS = {"depth": "m", "lateral": "m", "brightness": "1"}
"""Bounds of a point over the volume, and their units."""

LIGHT = "light caught"


@dataclass(frozen=True, slots=True)
class Goal:
    """A number of a camera that shall be as small, or as large, as it can be.

    Parameters
    ----------
    name
        "depth", "lateral" or "brightness", bounds of a point over the depths; or "light caught", a number
        that the camera's description prints, or one that `lumigraph.metric.simulated` measures, such as
        "mtf@10/mm".
    largest
        Whether large is good.
    depths
        Of the volume [m].
    light
        Of a point, as the first camera collects it; others get theirs by their aperture.
    places
        At each depth.
    """

    name: str = "depth"
    largest: bool = False
    depths: tuple[float, ...] = ()
    light: Light = field(default_factory=Light)
    places: int = 2

    @classmethod
    def parse(
        cls, text: str, depths: Sequence[float] = (), light: Light | None = None, places: int = 2
    ) -> "Goal":
        """From words such as "depth", "largest views per axis" or "least cross-talk".

        Raises
        ------
        FormatError
            A number without "largest" or "least" before it.

        >>> Goal.parse("largest mtf@10/mm").largest
        True
        """
        word, _, rest = text.strip().partition(" ")
        light, planes = Light() if light is None else light, tuple(float(dz) for dz in depths)
        if text.strip() in BOUNDS:
            return cls(text.strip(), False, planes, light, places)
        if word not in ("largest", "least") or not rest.strip():
            raise FormatError(
                f"--goal is {text!r} but must be {', '.join(BOUNDS)}, or 'largest' or 'least' and a number's "
                "name, such as 'largest views per axis'."
            )
        return cls(rest.strip(), word == "largest", planes, light, places)

    @property
    def of_points(self) -> bool:
        """Whether it follows from images of points."""
        return self.name in BOUNDS or self.name == LIGHT

    def check(self, instrument: Instrument) -> None:
        """Refuse what a kind of instrument has not.

        Raises
        ------
        FormatError
            An unknown number.
        GeometryError
            No depths where they are needed, or a measure of another kind of camera.
        """
        if self.of_points:
            if not self.depths:
                raise GeometryError(f"goal {self.name!r} needs depths, such as depths=(-5e-3, 0.0, 5e-3).")
            checked_depths(self.depths)
        elif metric.is_measure(self.name):
            check_camera(instrument)
        else:
            names = [row.name for row in instrument.quantities() if _is_number(row.value)]
            if self.name not in names:
                raise FormatError(
                    f"a {instrument.noun} has no number {self.name!r}. Known: {', '.join(names)}."
                )

    def values(self, instrument: Instrument, first: float) -> dict[str, float]:
        """The number by its name, and others that come with it.

        Parameters
        ----------
        instrument
            The camera.
        first
            Part of the light that the first camera collects.
        """
        if self.of_points:
            return self._bounds(instrument, first)
        if metric.is_measure(self.name):
            rng = np.random.default_rng(0)  # the same noise for all: differences are the camera's
            found = metric.simulated(check_camera(instrument), [self.name], rng=rng)[self.name].value
            return {self.name: math.nan if found is None else float(found)}
        return {row.name: float(row.value) for row in instrument.quantities() if row.name == self.name}

    def checked(self, instrument: Instrument, first: float, rough: float) -> tuple[float, float]:
        """A bound by derivatives of two steps, and its relative error; exact derivatives have none.

        The error is that of the derivatives, or what the second step changes of the bound where that is more.

        Parameters
        ----------
        instrument, first
            As of `values`.
        rough
            The bound by one step, as `values` has it.
        """
        light = self._light(instrument, first)
        found = bounds(instrument, self.depths, light, places=self.places)
        value = float(getattr(found, self.name))
        return value, max(float(np.max(found.errors)), abs(rough / value - 1))

    def _light(self, instrument: Instrument, first: float) -> Light:
        return Light(self.light.photons * collected(instrument) / first, self.light.background)

    def _bounds(self, instrument: Instrument, first: float) -> dict[str, float]:
        light = self._light(instrument, first)
        with warnings.catch_warnings():
            warnings.simplefilter("error", SamplingWarning)
            found = bounds(instrument, self.depths, light, places=self.places, checked=False)
        return {
            "depth": found.depth, "lateral": found.lateral, "brightness": found.brightness,
            LIGHT: float(found.caught.mean()), "photons": light.photons,
        }  # fmt: skip

    def cost(self, values: dict[str, Any]) -> float:
        """What a search makes small; infinite where there is no such camera."""
        value = values.get(self.name)
        if value is None or not math.isfinite(value):
            return math.inf
        return -value if self.largest else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
