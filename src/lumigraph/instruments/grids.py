"""Grids of a camera's simulation: the sampling rules, each with its source, and the windows."""

import math
from dataclasses import dataclass

import scipy

from lumigraph.core.grid import Grid
from lumigraph.errors import SamplingError

MARGIN = 2.0
"""Factor by which grids are finer than the rules for lens phases and intensities require."""

ANGLE_MARGIN = 1.1
"""Factor by which grids are finer than the steepest ray requires: depths differ a little in angle."""

BORDER = 4
"""Samples left free around the stop, the lenslets and the sensor."""

MOST_SAMPLES = 2**28
"""Largest plane: 2 GiB in complex64, of which a propagation needs several."""


@dataclass(frozen=True, slots=True)
class Rule:
    """The largest pitch that something allows [m], margin included, and why."""

    name: str
    pitch: float
    source: str


@dataclass(frozen=True, slots=True)
class Sampling:
    """Pitches and half widths of a camera's planes; grids are made, and refused if too large, when asked for.

    Parameters
    ----------
    rules
        Rules for the pitch of pupil, lenslets and sensor.
    pitch
        Pitch of pupil, lenslets and sensor [m].
    object_rules, object_pitch
        The same in the focused plane.
    object_half, pupil_half, lenslet_half, image_half
        Half widths to cover (y, x) [m]; lenslet_half is None without lenslets.
    """

    rules: tuple[Rule, ...]
    pitch: float
    object_rules: tuple[Rule, ...]
    object_pitch: float
    object_half: tuple[float, float]
    pupil_half: tuple[float, float]
    lenslet_half: tuple[float, float] | None
    image_half: tuple[float, float]

    @property
    def object_grid(self) -> Grid:
        """The focused plane, as wide as the field of view."""
        shape = [math.ceil(2 * half / self.object_pitch - 1e-6) for half in self.object_half]
        return _grid("the object", shape, self.object_pitch)

    @property
    def pupil_grid(self) -> Grid:
        """The main lens, a little wider than its stop."""
        return self._window("the main lens", self.pupil_half)

    @property
    def lenslet_grid(self) -> Grid | None:
        """The lenslets, a little wider than the array."""
        return None if self.lenslet_half is None else self._window("the lenslet array", self.lenslet_half)

    @property
    def image_grid(self) -> Grid:
        """The sensor, a little wider than its pixels."""
        return self._window("the sensor", self.image_half)

    def _window(self, name: str, half: tuple[float, float]) -> Grid:
        return _grid(name, [_samples(width, self.pitch) for width in half], self.pitch)


def _samples(half: float, pitch: float) -> int:
    """Samples of a window that covers `half` on either side, of a quick FFT size."""
    n = 2 * (math.ceil(half / pitch) + BORDER) + 1
    return int(scipy.fft.next_fast_len(n) or n) if n < 2**31 else n


def _grid(name: str, shape: list[int], pitch: float) -> Grid:
    if math.prod(shape) > MOST_SAMPLES:
        raise SamplingError(
            f"{name} needs {shape[0]} x {shape[1]} samples of {pitch * 1e6:.3g} µm, more than the "
            f"{MOST_SAMPLES:.3g} that can be simulated. Use fewer lenslets, a smaller sensor or a larger "
            "f-number."
        )
    return Grid((shape[0], shape[1]), (pitch, pitch))


def plane_rules(
    wavelength: float, focal_length: float, diameter: float, f_number: float, steepest: float
) -> tuple[Rule, ...]:
    """Rules for the planes behind the object.

    Parameters
    ----------
    wavelength, focal_length, diameter
        Wavelength; focal length and diameter of the main lens [m].
    f_number
        F-number of the light on the sensor.
    steepest
        Largest slope of a ray behind the lenses.
    """
    return (
        Rule("main lens", wavelength * focal_length / (diameter * MARGIN), "λ f / D / 2"),
        Rule("intensity", wavelength * f_number / (2 * MARGIN), "λ F# / 4"),
        Rule("steepest ray", wavelength / (2 * steepest * ANGLE_MARGIN), "λ / (2.2 θ)"),
    )


def object_rules(
    wavelength: float, distance: float, diameter: float, half_field: float, pitch: float
) -> tuple[Rule, ...]:
    """Rules for the object: it is low-passed at D / (λ z1), and seen from all of the pupil's window.

    Parameters
    ----------
    wavelength, distance, diameter
        Wavelength; object to main lens, z1; diameter D of the stop [m].
    half_field
        Half width of the object, X [m].
    pitch
        Pitch of the pupil's samples [m].
    """
    half_window = _samples(diameter / 2, pitch) * pitch / 2
    return (
        Rule("object detail", wavelength * distance / (2 * diameter) / 1.2, "λ z1 / (2 D) / 1.2"),
        Rule(
            "object field", wavelength * distance / (2 * (half_field + half_window)), "λ z1 / (2 (X + pupil))"
        ),
    )


def smallest(rules: tuple[Rule, ...]) -> float:
    """The pitch that obeys all rules [m]."""
    return min(rule.pitch for rule in rules)
