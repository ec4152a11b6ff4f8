"""Trade-offs of an instrument, to first order, and how they change with its magnification."""

import math
from collections.abc import Iterator
from functools import singledispatch

from lumigraph.design import microscope as scope_forms
from lumigraph.design import plenoptic1, plenoptic2, resolution
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.description import Row
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.microscope import LightFieldMicroscope
from lumigraph.instruments.plenoptic1 import PlenopticCamera
from lumigraph.instruments.plenoptic2 import FocusedPlenopticCamera
from lumigraph.instruments.single_lens import SingleLensCamera


@singledispatch
def rows(instrument: Instrument) -> Iterator[Row]:
    """Rows of an instrument that change with its magnification, to first order."""
    raise TypeError(f"nothing is known of trade-offs of a {type(instrument).__name__}.")


def trade_offs(instrument: Instrument) -> tuple[Row, ...]:
    """Rows of an instrument that change with its magnification, to first order."""
    return tuple(rows(instrument))


@rows.register
def single_lens(camera: SingleLensCamera) -> Iterator[Row]:
    """Trade-offs of a camera without lenslets."""
    main = resolution.incoherent_cutoff(camera.wavelength, camera.f_number)
    cutoff = min(main, 1 / (2 * camera.pixels.pixel_pitch)) * camera.magnification
    yield from _resolved(cutoff, "min(1 / (λ F#), 1 / (2 pixel)) z2/z1")
    yield depth_of_field(camera)


@rows.register
def plenoptic(camera: PlenopticCamera) -> Iterator[Row]:
    """Trade-offs of a plenoptic camera 1.0."""
    pitch, main = camera.lenslets.pitch, resolution.incoherent_cutoff(camera.wavelength, camera.f_number)
    pixels = camera.micro_image_pitch / camera.pixels.pixel_pitch
    apart = plenoptic1.resolvable_directions(camera.wavelength, _width(camera), camera.lenslet_distance)
    yield Row("views per axis", min(pixels, apart), "", "min(p (1 + b/F) / pixel, d² / (1.22 λ f_µ))")
    yield from _resolved(
        min(1 / (2 * pitch), main) * camera.magnification, "min(1 / (2 p), 1 / (λ F#)) z2/z1"
    )
    axial = pitch * camera.separation / camera.pupil_diameter / camera.magnification**2
    yield Row("axial resolution", axial, "m", "p F/D (z1/z2)²: one lenslet between the outermost views")
    yield _cross_talk(camera)
    yield depth_of_field(camera)


@rows.register
def focused(camera: FocusedPlenopticCamera) -> Iterator[Row]:
    """Trade-offs of a focused plenoptic camera 2.0."""
    wave, pitch, pixel = camera.wavelength, camera.lenslets.pitch, camera.pixels.pixel_pitch
    m, b = camera.lenslet_magnification, camera.lenslet_distance
    lenslets = plenoptic2.rendered_cutoff(wave, pitch, m, b)
    yield Row("views per axis", plenoptic2.views_per_axis(m), "", "1/|m|")
    yield from _resolved(
        min(lenslets, abs(m) / (2 * pixel)) * camera.magnification,
        "min(|m| p / (λ b), |m| / (2 pixel)) z2/z1",
    )
    least = max(wave * b / pitch, 2 * pixel)
    yield Row(
        "axial resolution", least * b / (abs(m) * pitch) / camera.magnification**2, "m",
        "δ b / (|m| p) (z1/z2)², δ = max(λ b/p, 2 pixels)",
    )  # fmt: skip
    yield _cross_talk(camera)
    yield depth_of_field(camera)


@rows.register
def any_microscope(scope: LightFieldMicroscope) -> Iterator[Row]:
    """Trade-offs of a microscope with lenslets at the native image or in the pupil."""
    return fourier_microscope(scope) if scope.configuration == "fourier" else microscope(scope)


def microscope(scope: LightFieldMicroscope) -> Iterator[Row]:
    """Trade-offs of a light-field microscope whose lenslets stand at the native image."""
    part, wave = scope.objective, scope.wavelength
    aperture, n = part.numerical_aperture, part.immersion_index
    directions = scope_forms.directions(wave, aperture, scope.magnification, scope.lenslets.pitch)
    finest = max(2 * scope.lenslet_size, scope_forms.lateral_resolution(wave, aperture))
    yield Row("directions per axis", directions, "", "N = d NA / (0.47 λ M)")
    yield Row("finest period", finest, "m", "max(2 d/M, 0.61 λ/NA), at the focused plane")
    yield Row("cut-off at the focused plane", 1 / finest, "1/m", "1 / finest period")
    yield _axial(scope)
    matched = scope_forms.matched_f_number(aperture, scope.magnification)
    yield Row("cross-talk", scope.lenslets.focal_length[0] / scope.lenslets.pitch / matched, "",
              "f_µ/d over M / (2 NA): above 1 micro-images overlap")  # fmt: skip
    yield Row(
        "refocus range", scope_forms.refocus_range(wave, aperture, n, directions), "m",
        "(2 + N²) λ n / (2 NA²)",
    )  # fmt: skip


def fourier_microscope(scope: LightFieldMicroscope) -> Iterator[Row]:
    """Trade-offs of a light-field microscope whose lenslets stand in the pupil."""
    relay, pitch = scope.fourier_lens or math.nan, scope.lenslets.pitch
    finest = scope_forms.fourier_resolution(scope.wavelength, relay, scope.magnification, pitch)
    yield Row("directions per axis", scope.pupil_diameter / pitch, "", "2 f_F NA / (M d), across the pupil")
    yield Row("finest period", finest, "m", "λ f_F / (d M)")
    yield Row("cut-off at the focused plane", 1 / finest, "1/m", "1 / finest period")
    yield _axial(scope)


def _axial(scope: LightFieldMicroscope) -> Row:
    part = scope.objective
    value = scope_forms.axial_resolution(scope.wavelength, part.numerical_aperture, part.immersion_index)
    return Row("axial resolution", value, "m", "λ / (n - sqrt(n² - NA²)), of the objective")


def depth_of_field(camera: Camera) -> Row:
    """Row of the whole aperture's depth of field."""
    at_object = camera.object_distance / camera.pupil_diameter
    value = resolution.depth_of_field(camera.wavelength, at_object)
    return Row("depth of field", value, "m", "4 λ (z1/D)², whole aperture")


def _resolved(cutoff: float, equation: str) -> Iterator[Row]:
    yield Row("lateral resolution", 1 / cutoff, "m", "1 / picture cut-off, a period at the object")
    yield Row("picture cut-off at the object", cutoff, "1/m", equation)


def _width(camera: LensletCamera) -> float:
    return camera.lenslets.pitch * camera.lenslets.fill_factor


def _cross_talk(camera: LensletCamera) -> Row:
    smallest = plenoptic1.smallest_lenslet(camera.wavelength, camera.lenslet_distance)
    return Row("cross-talk", smallest / _width(camera), "", "sqrt(2.44 λ b) / d: above 1 micro-images mix")
