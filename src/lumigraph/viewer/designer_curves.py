"""What a camera trades for what, in closed forms: the same numbers over a range of magnifications."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lumigraph.design import microscope as scope_forms
from lumigraph.design import plenoptic1, plenoptic2, resolution
from lumigraph.errors import LumigraphError
from lumigraph.instruments.loading import AnyCamera

POINTS = 41
"""Magnifications along a curve."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a curve shows.

    Parameters
    ----------
    name, unit, scale
        The unit as it is written, and its size in SI.
    equation
        Where it comes from.
    of
        Its value in SI for a camera.
    """

    name: str
    unit: str
    scale: float
    equation: str
    of: Callable[[Any], float]


def trade_offs(camera: AnyCamera) -> dict[str, Any]:
    """Curves over the magnification and where the camera stands on them, as JSON can hold them.

    What no camera can have is None.
    """
    label, here, numbers, at = _range(camera)
    cameras = [_attempt(at, value) for value in numbers]
    curves = []
    for each in _quantities(camera):
        values = [None if other is None else _attempt(each.of, other) for other in cameras]
        curves.append({
            "name": each.name, "unit": each.unit, "equation": each.equation,
            "values": [None if value is None else value / each.scale for value in values],
            "here": _scaled(_attempt(each.of, camera), each.scale),
        })  # fmt: skip
    return {"label": label, "at": here, "positions": list(numbers), "curves": curves}


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else value / scale


def _attempt(function: Callable[[Any], Any], value: Any) -> Any:
    try:
        found = function(value)
    except (LumigraphError, ZeroDivisionError, OverflowError):
        return None
    return None if isinstance(found, float) and not math.isfinite(found) else found


def _range(camera: Any) -> tuple[str, float, list[float], Callable[[float], Any]]:
    """Name of the magnification, the camera's own, those to look at, and the camera with another one."""
    if camera.KIND == "focused-plenoptic":
        m = camera.lenslet_magnification
        ends = (min(0.05, m), max(1.5, m)) if m > 0 else (min(-0.05, -m), max(0.95, -m))
        sign = math.copysign(1.0, m)
        numbers = [sign * value for value in _spaced(abs(ends[0]), ends[1])]
        return (
            "|m| = b/|a|, of the lenslets",
            m,
            numbers,
            lambda v: camera.replace(lenslets={"magnification": v}),
        )
    if camera.KIND == "light-field-microscope":
        own = camera.objective.magnification
        numbers = _spaced(own / 4, own * 4)
        return "M, of the objective", own, numbers, lambda v: camera.replace(objective={"magnification": v})
    own, focal = camera.magnification, camera.main_lens.focal_length
    numbers = _spaced(own / 5, own * 5)
    return (
        "z2/z1, of the main lens",
        own,
        numbers,
        lambda v: camera.replace(object_distance=focal * (1 + 1 / v)),
    )


def _spaced(low: float, high: float) -> list[float]:
    return [low * (high / low) ** (k / (POINTS - 1)) for k in range(POINTS)]


def _quantities(camera: AnyCamera) -> tuple[Quantity, ...]:
    return {
        "focused-plenoptic": _focused, "plenoptic": _plenoptic, "light-field-microscope": _microscope,
        "single-lens": _single,
    }[camera.KIND]()  # fmt: skip


def _to_object(camera: Any) -> float:
    return camera.object_distance / camera.image_distance


def _depth_of_field(camera: Any) -> float:
    return resolution.depth_of_field(camera.wavelength, camera.object_distance / camera.pupil_diameter)


def _cross_talk(camera: Any) -> float:
    width = camera.lenslets.pitch * camera.lenslets.fill_factor
    return plenoptic1.smallest_lenslet(camera.wavelength, camera.lenslet_distance) / width


def _field(name: str = "Depth of field") -> Quantity:
    return Quantity(name, "mm", 1e-3, "4 λ (z1/D)², whole aperture", _depth_of_field)


_TALK = Quantity("Cross-talk", "", 1.0, "sqrt(2.44 λ b) / d: above 1 micro-images mix", _cross_talk)


def _focused() -> tuple[Quantity, ...]:
    def views(camera: Any) -> float:
        return plenoptic2.views_per_axis(camera.lenslet_magnification)

    def cutoff(camera: Any) -> float:
        m, b = camera.lenslet_magnification, camera.lenslet_distance
        lenslets = plenoptic2.rendered_cutoff(camera.wavelength, camera.lenslets.pitch, m, b)
        return min(lenslets, abs(m) / (2 * camera.pixels.pixel_pitch)) / _to_object(camera)

    def axial(camera: Any) -> float:
        b, pitch = camera.lenslet_distance, camera.lenslets.pitch
        least = max(camera.wavelength * b / pitch, 2 * camera.pixels.pixel_pitch)
        return least * b / (abs(camera.lenslet_magnification) * pitch) * _to_object(camera) ** 2

    return (
        Quantity("Views per axis", "", 1.0, "1/|m|", views),
        Quantity("Lateral resolution", "µm", 1e-6, "1 / cut-off, a period at the object",
                 lambda camera: 1 / cutoff(camera)),
        Quantity("Axial resolution", "mm", 1e-3,
                 "δ b / (|m| p) (z1/z2)², δ = max(λ b/p, 2 pixels) between the outermost views", axial),
        Quantity("Cut-off at the object", "/mm", 1e3, "min(|m| p / (λ b), |m| / (2 pixel)) z2/z1", cutoff),
        _TALK, _field(),
    )  # fmt: skip


def _plenoptic() -> tuple[Quantity, ...]:
    def cutoff(camera: Any) -> float:
        main = resolution.incoherent_cutoff(camera.wavelength, camera.f_number)
        return min(1 / (2 * camera.lenslets.pitch), main) / _to_object(camera)

    def views(camera: Any) -> float:
        width = camera.lenslets.pitch * camera.lenslets.fill_factor
        seen = plenoptic1.resolvable_directions(camera.wavelength, width, camera.lenslet_distance)
        return min(camera.micro_image_pitch / camera.pixels.pixel_pitch, seen)

    def axial(camera: Any) -> float:
        reach = camera.lenslets.pitch * camera.separation / camera.pupil_diameter
        return reach * _to_object(camera) ** 2

    return (
        Quantity("Views per axis", "", 1.0, "min(p (1 + b/F) / pixel, d² / (1.22 λ f_µ))", views),
        Quantity("Lateral resolution", "µm", 1e-6, "1 / cut-off, a period at the object",
                 lambda camera: 1 / cutoff(camera)),
        Quantity("Axial resolution", "mm", 1e-3,
                 "p F/D (z1/z2)²: one lenslet between the outermost views", axial),
        Quantity("Cut-off at the object", "/mm", 1e3, "min(1 / (2 p), 1 / (λ F#)) z2/z1", cutoff),
        _TALK, _field(),
    )  # fmt: skip


def _microscope() -> tuple[Quantity, ...]:
    def views(scope: Any) -> float:
        return scope_forms.directions(
            scope.wavelength, scope.objective.numerical_aperture, scope.magnification, scope.lenslets.pitch
        )

    def lateral(scope: Any) -> float:
        finest = scope_forms.lateral_resolution(scope.wavelength, scope.objective.numerical_aperture)
        return max(2 * scope.lenslet_size, finest)

    def objective(function: Callable[..., float]) -> Callable[[Any], float]:
        return lambda scope: function(
            scope.wavelength, scope.objective.numerical_aperture, scope.objective.immersion_index
        )

    def talk(scope: Any) -> float:
        own = scope.lenslets.focal_length[0] / scope.lenslets.pitch
        return own / scope_forms.matched_f_number(scope.objective.numerical_aperture, scope.magnification)

    def refocus(scope: Any) -> float:
        part = scope.objective
        return scope_forms.refocus_range(
            scope.wavelength, part.numerical_aperture, part.immersion_index, views(scope)
        )

    return (
        Quantity("Directions per axis", "", 1.0, "d NA / (0.47 λ M)", views),
        Quantity("Lateral resolution", "µm", 1e-6, "max(2 d/M, 0.61 λ/NA), at the focused plane", lateral),
        Quantity("Axial resolution", "µm", 1e-6, "λ / (n - sqrt(n² - NA²)), of the objective",
                 objective(scope_forms.axial_resolution)),
        Quantity("Cut-off at the focused plane", "/mm", 1e3, "1 / lateral resolution",
                 lambda scope: 1 / lateral(scope)),
        Quantity("Cross-talk", "", 1.0, "f_µ/d over M / (2 NA): above 1 micro-images overlap", talk),
        Quantity("Refocus range", "µm", 1e-6, "(2 + N²) λ n / (2 NA²)", refocus),
    )  # fmt: skip


def _single() -> tuple[Quantity, ...]:
    def cutoff(camera: Any) -> float:
        main = resolution.incoherent_cutoff(camera.wavelength, camera.f_number)
        return min(main, 1 / (2 * camera.pixels.pixel_pitch)) / _to_object(camera)

    return (
        Quantity("Lateral resolution", "µm", 1e-6, "1 / cut-off, a period at the object",
                 lambda camera: 1 / cutoff(camera)),
        Quantity("Cut-off at the object", "/mm", 1e3, "min(1 / (λ F#), 1 / (2 pixel)) z2/z1", cutoff),
        _field(),
    )  # fmt: skip
