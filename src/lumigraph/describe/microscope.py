"""The table of everything that follows from the description of a light-field microscope."""

from collections.abc import Iterator

from lumigraph.describe.cameras import describe, readout
from lumigraph.design import microscope as design
from lumigraph.instruments.description import TRADE_OFFS, Description, Row
from lumigraph.instruments.microscope import LightFieldMicroscope

DEPTHS = (5e-6, 10e-6, 25e-6, 50e-6, 100e-6)
"""Depths for which the band limit is listed [m]."""


@describe.register
def microscope(scope: LightFieldMicroscope) -> Description:
    """The table of a light-field microscope."""
    sections = [("Objective", tuple(_objective(scope))), ("Lenslets", tuple(_lenslets(scope)))]
    if scope.configuration == "fourier":
        sections.append(("Fourier configuration", tuple(_fourier(scope))))
    else:
        sections.append(("Reconstruction", tuple(_reconstruction(scope))))
    sections.append((TRADE_OFFS, scope.trade_offs()))
    sections.append(("Sensor", tuple(_sensor(scope))))
    title = f"light-field microscope {scope.configuration} at {Row('', scope.wavelength, 'm').text}"
    return Description(title, tuple(sections), tuple(_warnings(scope)))


def _objective(scope: LightFieldMicroscope) -> Iterator[Row]:
    part, wave = scope.objective, scope.wavelength
    n, number = part.immersion_index, part.numerical_aperture
    yield Row("wavelength", wave, "m", "given")
    yield Row("magnification", scope.magnification, "", "M, engraved times tube lens over maker's")
    yield Row("numerical aperture", number, "", "given")
    yield Row("immersion index", n, "", "n, given")
    if part.tube_lens is not None:
        focal_length = part.tube_lens / scope.magnification
        yield Row("objective focal length", focal_length, "m", "tube lens / M")
    yield Row(
        "lateral resolution", design.lateral_resolution(wave, number), "m", "0.61 λ/NA, of the objective"
    )
    yield Row("depth of field", design.depth_of_field(wave, number, n), "m", "λ n/NA², of the objective")
    yield Row("point images", scope.objectives[0].model, "", "Debye integral")
    for index, waves in part.aberrations.items():
        yield Row(f"Noll {index}", float(waves), "waves rms", "given")


def _lenslets(scope: LightFieldMicroscope) -> Iterator[Row]:
    part = scope.lenslets
    yield Row("lenslets", part.count, "", f"{part.layout}, {part.count[0] * part.count[1]} in all")
    yield Row("lenslet pitch", part.pitch, "m", "d, given")
    yield Row("lenslet focal length", part.focal_length[0], "m", "f_µ, given")
    yield Row("lenslet f-number", part.focal_length[0] / part.pitch, "", "f_µ/d")
    if scope.configuration != "fourier":
        matched = design.matched_f_number(scope.objective.numerical_aperture, scope.magnification)
        yield Row("matched f-number", matched, "", "M / (2 NA): micro-images touch")
    if scope.lenslet_offset is not None:
        yield Row("lenslet offset", scope.lenslet_offset, "m", "native image to lenslets, given")
    yield Row("lenslet distance", scope.lenslet_distance, "m", "b, lenslets to the sensor's conjugate plane")


def _reconstruction(scope: LightFieldMicroscope) -> Iterator[Row]:
    M, pitch, wave = scope.magnification, scope.lenslets.pitch, scope.wavelength
    size = scope.lenslet_size
    yield Row("lenslet in object space", size, "m", "d/M: the focused plane's sampling")
    near = design.near_field(wave, M, pitch)
    yield Row("near field", near, "m", "d² / (2 M² λ) on either side: one lenslet per point")
    for dz in DEPTHS:
        if dz >= near:
            limit = design.band_limit(wave, M, pitch, dz)
            yield Row(f"band limit at {dz * 1e6:g} µm", limit, "1/m", "d / (0.94 λ M |dz|)")
    at = (0.0, *DEPTHS)
    for dz, distance in zip(at, scope.sampling_distances(at), strict=True):
        yield Row(
            f"sampling at {dz * 1e6:g} µm",
            distance,
            "m",
            "d/M up to d / (2 M tan θ), then what a lenslet resolves",
        )


def _fourier(scope: LightFieldMicroscope) -> Iterator[Row]:
    assert scope.fourier_lens is not None  # asked by `microscope`
    M, pitch, relay = scope.magnification, scope.lenslets.pitch, scope.fourier_lens
    focal_length = scope.lenslet_distance
    yield Row("Fourier lens", relay, "m", "f_F, given")
    yield Row("pupil", scope.pupil_diameter, "m", "2 f_F NA/M, on the lenslets")
    yield Row("lenslets across the pupil", scope.pupil_diameter / pitch, "", "")
    yield Row("total magnification", M * focal_length / relay, "", "M b/f_F")
    yield Row("field of view", design.fourier_field(relay, M, pitch, focal_length), "m", "d f_F / (b M)")
    resolution = design.fourier_resolution(scope.wavelength, relay, M, pitch)
    yield Row("reconstructed resolution", resolution, "m", "λ f_F / (d M)")
    depths = scope.in_focus
    for number in scope.lenslets.single:
        yield Row(
            f"lenslet {number} is in focus at", float(depths[number - 1]), "m", "n (1/b - 1/f) (f_F/M)²"
        )


def _sensor(scope: LightFieldMicroscope) -> Iterator[Row]:
    sensor = scope.sensor
    yield Row("pixels", tuple(sensor.shape), "", "given" if scope.pixels.shape else "all micro-images fit")
    yield Row("pixel pitch", sensor.pixel_pitch, "m", "given")
    yield from readout(sensor)
    yield Row("relay magnification", scope.relay_magnification, "", "lenslets' images to sensor, given")
    yield Row("micro-image pitch", scope.micro_image_pitch, "m", "d times relay")
    yield Row("micro-image pitch in pixels", scope.micro_image_pitch / sensor.pixel_pitch, "px", "")


def _warnings(scope: LightFieldMicroscope) -> Iterator[str]:
    if scope.configuration != "fourier":
        matched = design.matched_f_number(scope.objective.numerical_aperture, scope.magnification)
        own = scope.lenslets.focal_length[0] / scope.lenslets.pitch
        if own > matched * 1.05:
            yield (
                f"micro-images overlap: lenslets of f/{own:.3g} where f/{matched:.3g} match the objective. "
                "Use faster lenslets or a smaller numerical aperture."
            )
        elif own < matched * 0.8:
            yield (
                f"micro-images fill {own / matched:.0%} of their pitch: lenslets of f/{own:.3g} where "
                f"f/{matched:.3g} match the objective."
            )
    pixel = scope.pixels.pixel_pitch / scope.relay_magnification
    nyquist = scope.wavelength * scope.lenslet_distance / (2 * scope.lenslets.pitch)
    if pixel > nyquist * 1.1:
        yield (
            f"pixels of {pixel * 1e6:.3g} µm at the lenslets are coarser than their detail, "
            f"λ b / (2 d) = {nyquist * 1e6:.3g} µm."
        )
