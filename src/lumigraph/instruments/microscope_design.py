"""Designer of a light-field microscope: its sliders, and the image of a point."""

from dataclasses import replace

from lumigraph.instruments.described_microscope import DescribedMicroscope
from lumigraph.instruments.parameters import Parameter, length, lenslets, magnified, number, pixel, wavelength
from lumigraph.instruments.point_view import PointImage, of_operator

VIEW_PIXELS = 15
"""Along a lenslet, of a point's quick view."""


def point_view(scope: DescribedMicroscope, dz: float) -> PointImage:
    """Image of a point on the axis, by few lenslets, the scalar model and one wavelength."""
    if scope.configuration == "fourier":
        whole = scope.replace(sensor={"shape": None})
        return of_operator(whole.operator((dz,)), scope.pixels.pixel_pitch)
    count, N = (min(scope.lenslets.count[0], 9), min(scope.lenslets.count[1], 9)), VIEW_PIXELS
    small = scope.replace(
        lenslets={"count": count}, sensor={"shape": None}, objective={"model": "scalar"}, bandwidth=None
    )
    seen = of_operator(small.operator((dz,), 1, pixels=N, accuracy=1e-2), scope.micro_image_pitch / N)
    notes = (f"scalar model, one wavelength, {N} × {N} px per lenslet",)
    return replace(seen, lenslets=count, notes=notes)


def parameters(scope: DescribedMicroscope) -> tuple[Parameter, ...]:
    """Wavelength, objective, distances, lenslets, relay and pixels."""
    part, own = scope.objective, []
    for key, label, value in (
        ("fourier_lens", "Fourier lens", scope.fourier_lens),
        ("sensor_distance", "Lenslets to sensor b", scope.sensor_distance),
    ):
        own += [] if value is None else [length(key, label, value, "mm")]
    relay, aperture = scope.relay_magnification, part.numerical_aperture
    return (
        wavelength(scope.wavelength),
        magnified("objective.magnification", "Magnification", part.magnification, (2.0, 150.0)),
        number("objective.numerical_aperture", "Numerical aperture NA", aperture, (0.05, 1.49)),
        number("objective.immersion_index", "Immersion index n", part.immersion_index, (1.0, 1.6)),
        *own, *lenslets(scope.lenslets, layouts=False),
        magnified("relay_magnification", "Relay magnification", relay, (0.1, 10.0)), pixel(scope.pixels),
    )  # fmt: skip
