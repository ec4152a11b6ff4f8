"""Goals of a search: the quantity of a camera that is optimised."""

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, cast

import numpy as np

from lumigraph import metrology
from lumigraph.core.result import Quantity
from lumigraph.errors import FormatError, GeometryError, SamplingWarning
from lumigraph.instruments.instrument import Instrument
from lumigraph.metrology.datasheet.charts import check_camera
from lumigraph.studies.information import (
    Bounds,
    Light,
    Scenes,
    TrainedRule,
    bounds,
    reconstruction_error,
    reconstruction_slopes,
    unknown_depth,
)
from lumigraph.studies.information.bounds import checked_depths, checked_places
from lumigraph.studies.information.followed import require_followed
from lumigraph.studies.information.imaging import check as check_scenes
from lumigraph.studies.information.imaging import usual_scenes
from lumigraph.studies.information.points import collected
from lumigraph.studies.information.reconstruction import ReconstructionError
from lumigraph.studies.information.reconstruction_slopes import require_planes
from lumigraph.studies.information.slopes import Bound, slopes

BOUNDS = {"depth": "m", "lateral": "m", "brightness": "1"}
"""Bounds of a point over the volume, and their units."""

ERRORS = ("picture error", "volume error", "reconstruction")
"""Expected errors of reconstructed scenes: at each depth alone, at all depths at once, at an unknown one."""

UNCERTAIN = "uncertain"

LIGHT, PLACES = "light caught", "places"

EVEN = 0.01
"""Part of a bound that places may leave unknown where their number is not given."""

ROUNDS = (range(2), range(2, 4), range(4, 8), range(8, 16))
"""Places that are taken one after the other, until a bound is even."""

OTHERS = 4
"""Places at which bounds are judged, at least."""


class JudgedBound(NamedTuple):
    """A bound at other places and depths than those of a search.

    Parameters
    ----------
    value
        Over the volume.
    error
        Relative: of the derivatives, or what places and steps change of the bound where that is more.
    over_depths
        The bound at each depth (nz,); infinite where it is not determined.
    between
        The bound half-way between neighbouring depths, rms, at the other places; NaN of one depth.
    """

    value: float
    error: float
    over_depths: np.ndarray
    between: float = math.nan


@dataclass(frozen=True, slots=True)
class Goal:
    """A number of a camera that shall be as small, or as large, as it can be.

    Parameters
    ----------
    name
        "depth", "lateral" or "brightness", bounds of a point over the depths; "picture error" or "volume
        error", expected errors of reconstructed scenes, at each depth alone or at all at once;
        "reconstruction", the same by one linear rule that is trained together with the camera, for scenes
        whose depth it does not know; or "light caught", a number that the camera's description prints, or one
        that `lumigraph.metrology.datasheet.simulated` measures, such as "mtf@10/mm".
    largest
        Whether large is good.
    depths
        Of the volume [m].
    light
        Of a point, or of a sample of a scene, as the first camera collects it; others get theirs by their
        aperture.
    places
        At each depth; None for as many as leave a bound unknown by 1 %, two to 16: more where pixels are as
        coarse as spots.
    scenes
        Of the errors of reconstruction; None for power 1/f² and what the first camera resolves.
    """

    name: str = "depth"
    largest: bool = False
    depths: tuple[float, ...] = ()
    light: Light = field(default_factory=Light)
    places: int | None = None
    scenes: Scenes | None = None

    @classmethod
    def parse(
        cls,
        text: str,
        depths: Sequence[float] = (),
        light: Light | None = None,
        places: int | None = None,
        *,
        scenes: Scenes | None = None,
    ) -> "Goal":
        """Goal from words such as "depth", "largest views per axis" or "least cross-talk".

        Raises
        ------
        FormatError
            A number without "largest" or "least" before it.

        >>> Goal.parse("largest mtf@10/mm").largest
        True
        """
        word, _, rest = text.strip().partition(" ")
        light, planes = Light() if light is None else light, tuple(float(dz) for dz in depths)
        if text.strip() in (*BOUNDS, *ERRORS):
            return cls(text.strip(), False, planes, light, places, scenes)
        if word not in ("largest", "least") or not rest.strip():
            raise FormatError(
                f"--goal is {text!r} but must be {', '.join((*BOUNDS, *ERRORS))}, or 'largest' or 'least' "
                "and a number's name, such as 'largest views per axis'."
            )
        return cls(rest.strip(), word == "largest", planes, light, places, scenes)

    def told(self, value: float) -> str:
        """A value in words: lengths with a unit that suits them, errors no finer than they are known."""
        if self.name in ERRORS:
            return f"{value:#.3g}"
        return str(Quantity(self.name, float(value), BOUNDS.get(self.name, "")))

    @property
    def of_points(self) -> bool:
        """True if the goal follows from images of points."""
        return self.name in BOUNDS or self.name == LIGHT

    @property
    def judged(self) -> bool:
        """True if the best camera is judged anew, at other places than those of the search."""
        return self.name in BOUNDS or self.name in ERRORS

    @property
    def label(self) -> str:
        """The number in words."""
        return f"{self.name} bound" if self.name in BOUNDS else self.name

    def ready(self, instrument: Instrument) -> "Goal":
        """Goal with scenes that the first camera resolves, where it needs some and has none."""
        if self.name not in ERRORS or self.scenes is not None:
            return self
        return replace(self, scenes=usual_scenes(instrument))

    def check(self, instrument: Instrument) -> None:
        """Refuse a goal that a kind of instrument does not have.

        Raises
        ------
        FormatError
            An unknown number.
        GeometryError
            No depths where they are needed, or a measure of another kind of camera.
        """
        if (self.of_points or self.name in ERRORS) and not self.depths:
            raise GeometryError(f"goal {self.name!r} needs depths, such as depths=(-5e-3, 0.0, 5e-3).")
        if self.of_points:
            checked_depths(self.depths)
            self._rounds()
        elif self.name in ERRORS:
            check_scenes(instrument, checked_depths(self.depths), self.judged_scenes)
        elif metrology.is_measure(self.name):
            camera = check_camera(instrument)
            for dz in checked_depths(self.depths or (0.0,)):
                camera.defocused(float(dz))
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
        if self.name in ERRORS:
            return self._left(instrument, first)
        if metrology.is_measure(self.name):
            rng = np.random.default_rng(0)  # the same noise for all: differences are the camera's
            depths = self.depths or (0.0,)
            seen = metrology.simulated(check_camera(instrument), [self.name], depths=depths, rng=rng)
            found = seen[self.name].value
            return {self.name: math.nan if found is None else float(found)}
        return {row.name: float(row.value) for row in instrument.quantities() if row.name == self.name}

    def slopes(self, instrument: Instrument, pairs: Sequence[Any], first: float, places: int) -> np.ndarray:
        """Changes (n,) of a bound or an error from the first to the last of each pair of cameras."""
        light = self.light_of(instrument, first)
        if self.name in ERRORS:
            scenes, volume = self.judged_scenes, self.name == ERRORS[1]
            return reconstruction_slopes(instrument, pairs, self.depths, scenes, light, volume=volume).changes
        return slopes(
            instrument,
            pairs,
            self.depths,
            light,
            name=cast(Bound, self.name),
            places=places,
        ).changes

    def check_slopes(self, instrument: Instrument) -> None:
        """Refuse what has no derivatives by the camera's keys.

        Raises
        ------
        GeometryError
            No bound and no error of scenes, or an instrument without derivatives of them.
        """
        if self.name == ERRORS[2]:
            raise GeometryError(f"search 'gradient' is not for {self.name!r}. Use 'local' or 'global'.")
        if self.name in ERRORS:
            require_planes(instrument)
            return
        if self.name not in BOUNDS:
            raise GeometryError(
                f"search 'gradient' is for {', '.join((*BOUNDS, *ERRORS))}, not {self.name!r}. Use 'local'."
            )
        require_followed(instrument)

    def checked(self, instrument: Instrument, first: float, rough: Mapping[str, Any]) -> JudgedBound:
        """A bound at other places, by derivatives of two steps, and half-way between the depths.

        Errors of reconstruction have no places: they are those of the search, at each depth and between.

        Parameters
        ----------
        instrument, first
            As of `values`.
        rough
            What `values` has found, at its places and by one step.
        """
        if self.name in ERRORS:
            found = self.reconstructions(instrument, first)
            between = math.nan
            if self.name == ERRORS[0] and len(halves := self._halves()):  # a volume of others is another
                between = replace(self, depths=halves).reconstructions(instrument, first).value
            return JudgedBound(found.value, getattr(found, "uncertain", 0.0), found.errors, between)
        light, used = self.light_of(instrument, first), int(rough[PLACES])
        others = range(used, used + max(used, OTHERS))
        found = bounds(instrument, self.depths, light, places=others)
        value = float(getattr(found, self.name))
        error = max(float(np.max(found.errors)), abs(rough[self.name] / value - 1))
        return JudgedBound(value, error, found.of(self.name), self._between(instrument, light, others))

    def _between(self, instrument: Instrument, light: Light, places: range) -> float:
        halves = self._halves()
        if not halves:
            return math.nan
        found = bounds(instrument, halves, light, places=places, checked=False)
        return float(getattr(found, self.name))

    def _halves(self) -> tuple[float, ...]:
        """Depths half-way between neighbouring ones."""
        depths = np.unique(self.depths)
        return tuple(float(dz) for dz in (depths[1:] + depths[:-1]) / 2)

    def reconstructions(self, instrument: Instrument, first: float) -> ReconstructionError | TrainedRule:
        """Expected errors of reconstructed scenes, by an instrument; `first` as of `values`."""
        if self.name == ERRORS[2]:
            return unknown_depth(
                instrument, self.depths, self.judged_scenes, self.light_of(instrument, first)
            )
        return reconstruction_error(
            instrument,
            self.depths,
            self.judged_scenes,
            self.light_of(instrument, first),
            volume=self.name == ERRORS[1],
        )

    @property
    def judged_scenes(self) -> Scenes:
        """The scenes.

        Raises
        ------
        GeometryError
            None.
        """
        if self.scenes is None:
            raise GeometryError(f"goal {self.name!r} needs scenes, such as lg.information.Scenes(10e-6).")
        return self.scenes

    def _left(self, instrument: Instrument, first: float) -> dict[str, float]:
        with warnings.catch_warnings():
            warnings.simplefilter("error", SamplingWarning)
            found = self.reconstructions(instrument, first)
        light = self.light_of(instrument, first)
        uncertain = getattr(found, UNCERTAIN, 0.0)  # of a rule in closed form
        return {self.name: found.value, UNCERTAIN: uncertain, "photons": light.photons}

    def light_of(self, instrument: Instrument, first: float) -> Light:
        """Light that an instrument collects by its aperture; `first` as of `values`."""
        return Light(self.light.photons * collected(instrument) / first, self.light.background)

    def _rounds(self) -> tuple[range, ...]:
        return ROUNDS if self.places is None else (checked_places(self.places),)

    def _bounds(self, instrument: Instrument, first: float) -> dict[str, float]:
        light = self.light_of(instrument, first)
        with warnings.catch_warnings():
            warnings.simplefilter("error", SamplingWarning)
            found = self._even(instrument, light)
        return {
            "depth": found.depth, "lateral": found.lateral, "brightness": found.brightness,
            LIGHT: float(found.caught.mean()), "photons": light.photons, PLACES: found.places.shape[1],
        }  # fmt: skip

    def _even(self, instrument: Instrument, light: Light) -> Bounds:
        """Bounds at some places, and at more until they are even."""
        first, *more = self._rounds()
        found = bounds(instrument, self.depths, light, places=first, checked=False)
        for numbers in more:
            if self.name == LIGHT or not found.uneven(self.name) > EVEN:
                break
            found = found.beside(bounds(instrument, self.depths, light, places=numbers, checked=False))
        return found

    def cost(self, values: Mapping[str, Any]) -> float:
        """Cost that a search minimises; infinite where there is no such camera."""
        value = values.get(self.name)
        if value is None or not math.isfinite(value):
            return math.inf
        return -value if self.largest else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
