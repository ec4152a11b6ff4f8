"""A table of everything that follows from a camera's description, each value with its equation."""

import math
from collections.abc import Iterator
from functools import singledispatch

from lumigraph.describe import lens_glass
from lumigraph.design import plenoptic1 as design1
from lumigraph.design import plenoptic2 as design2
from lumigraph.design import resolution
from lumigraph.design.matching import ALIKE
from lumigraph.errors import SamplingError
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.description import TRADE_OFFS, Description, Row
from lumigraph.instruments.instrument import Instrument
from lumigraph.instruments.lenslet_camera import LensletCamera
from lumigraph.instruments.over_field import OverField
from lumigraph.instruments.plenoptic1 import PlenopticCamera
from lumigraph.instruments.plenoptic2 import FocusedPlenopticCamera
from lumigraph.instruments.single_lens import SingleLensCamera
from lumigraph.sensor import Sensor


@singledispatch
def describe(instrument: Instrument) -> Description:
    """Table of everything that follows from an instrument's description, by its kind."""
    raise TypeError(f"nothing describes a {type(instrument).__name__}.")


@describe.register
def single_lens(camera: SingleLensCamera) -> Description:
    """The table of a camera without lenslets."""
    sections = (
        ("Geometry", tuple(_geometry(camera))),
        ("Main lens", tuple(_main_lens(camera))),
        (TRADE_OFFS, camera.trade_offs()),
        ("Sensor", tuple(_sensor(camera))),
        ("Simulation", tuple(_sampling(camera))),
    )
    return Description(_title(camera), sections, tuple(_warnings(camera)))


@describe.register
def plenoptic1(camera: PlenopticCamera) -> Description:
    """The table of a plenoptic camera 1.0."""
    wavelength, pitch, f = camera.wavelength, camera.lenslets.pitch, camera.lenslet_distance
    width = pitch * camera.lenslets.fill_factor
    pixels = camera.micro_image_pitch / camera.pixels.pixel_pitch
    directions = (
        Row("pixels per micro-image", pixels, "px", "p (1 + b/F) / pixel"),
        Row(
            "resolvable directions",
            design1.resolvable_directions(wavelength, width, f),
            "",
            "d² / (1.22 λ f_µ)",
        ),
        Row("angular resolution", design1.angular_resolution(camera.f_number, pixels), "rad", "1 / (F# N)"),
        Row("diffraction angle", design1.diffraction_angle(wavelength, width), "rad", "λ / d"),
        Row(
            "smallest lenslet",
            design1.smallest_lenslet(wavelength, f),
            "m",
            "sqrt(2.44 λ f_µ), against cross-talk",
        ),
        Row(
            "picture cut-off",
            1 / (2 * pitch),
            "1/m",
            "1 / (2 p): one sample per lenslet, on the main-lens image",
        ),
    )
    return _with_lenslets(camera, ("Directions", directions))


@describe.register
def plenoptic2(camera: FocusedPlenopticCamera) -> Description:
    """The table of a focused plenoptic camera 2.0."""
    wavelength, pitch, m, b = (
        camera.wavelength, camera.lenslets.pitch, camera.lenslet_magnification, camera.lenslet_distance
    )  # fmt: skip
    cutoff = design2.rendered_cutoff(wavelength, pitch, m, b)
    rendered = (
        Row("lenslet magnification", m, "", "m = b/a; " + ("Keplerian" if m > 0 else "Galilean")),
        Row("patch", camera.patch, "px", "m p z2 / L / pixel; " + ("turned" if m > 0 else "not turned")),
        Row("rendered cut-off", cutoff, "1/m", "|m| p / (λ b), on the main-lens image"),
        *_stages(camera),
        Row("rendered cut-off at the object", cutoff * camera.magnification, "1/m", "times z2/z1"),
        Row(
            "rendered lobe",
            design2.rendered_lobe(wavelength, pitch, camera.relay_distance),
            "m",
            "2.44 λ |a| / p",
        ),
    )
    return _with_lenslets(camera, ("Rendered picture", rendered))


def _stages(camera: FocusedPlenopticCamera) -> tuple[Row, ...]:
    """Settings of a bench's two stages, where a real main-lens image lies before the lenslets."""
    b, a = camera.lenslet_distance, camera.relay_distance
    if a < 0:
        return ()
    return (
        Row("stage c", b, "m", "c = b, lenslets to sensor"),
        Row("stage d", a - b, "m", "d = a - b, of the whole plenoptic stage"),
    )


def _with_lenslets(camera: LensletCamera, own: tuple[str, tuple[Row, ...]]) -> Description:
    sections = (
        ("Geometry", (*_geometry(camera), *_distances(camera))),
        ("Main lens", tuple(_main_lens(camera))),
        ("Lenslets", tuple(_lenslets(camera))),
        own,
        (TRADE_OFFS, camera.trade_offs()),
        ("Sensor", tuple(_sensor(camera))),
        ("Simulation", tuple(_sampling(camera))),
    )
    return Description(_title(camera), sections, (*_warnings(camera), *_lenslet_warnings(camera)))


def _title(camera: Camera) -> str:
    return f"{camera.KIND} camera at {Row('', camera.wavelength, 'm').text}"


def _geometry(camera: Camera) -> Iterator[Row]:
    z1, z2 = camera.object_distance, camera.image_distance
    yield Row("wavelength", camera.wavelength, "m", "given")
    yield Row("object distance", z1, "m", "z1, given")
    yield Row("image distance", z2, "m", "z2 = f z1 / (z1 - f)")
    yield Row("magnification", camera.magnification, "", "z2 / z1")


def _distances(camera: LensletCamera) -> Iterator[Row]:
    z2, length, built = camera.image_distance, camera.separation, camera.built
    sources = ("F = z2", "b = f_µ")
    if length != z2:
        source = "a = L - z2" if built else "a = b/m"
        yield Row("relay distance", length - z2, "m", f"{source}, main-lens image to lenslets")
        sources = ("L = z2 + a, main lens to lenslets", "b = f_µ (1 + m)")
    if camera.lean is not None:
        yield from _leaning(camera)
    given = "as built, main lens to lenslets"
    yield Row("separation", length, "m", given if built.separation else sources[0])
    source = "as built" if built.lenslet_distance else sources[1]
    yield Row("lenslet distance", camera.lenslet_distance, "m", f"{source}, lenslets to sensor")


def _leaning(camera: LensletCamera) -> Iterator[Row]:
    lean, (y, x) = camera.lean, camera.lenslets.reach
    assert lean is not None  # asked by `_distances`
    axes = ("down", "across")
    for name, tilts in (("array", camera.built.array_tilt), ("sensor", camera.built.sensor_tilt)):
        for axis, tilt in zip(axes, tilts, strict=True):
            if tilt:
                yield Row(f"{name} tilt {axis}", tilt, "rad", "as built, farther from the main lens")
    if camera.built.array_bow:
        yield Row("array bow", camera.built.array_bow, "m", "as built, corners farther from the main lens")
    places = [(a * y, b * x) for a in (-1, 1) for b in (-1, 1)]
    apart = [lean.of_sensor(*at) - lean.of_array(*at) for at in places]
    yield Row("lenslet distance, most", camera.lenslet_distance + max(0.0, *apart), "m", "at a corner")
    yield Row("lenslet distance, least", camera.lenslet_distance + min(0.0, *apart), "m", "at a corner")


def _main_lens(camera: Camera) -> Iterator[Row]:
    wavelength, f_number = camera.wavelength, camera.f_number
    at_object = camera.object_distance / camera.pupil_diameter
    yield Row("focal length", camera.main_lens.focal_length, "m", "f, given")
    yield Row("diameter", camera.pupil_diameter, "m", _diameter_source(camera))
    yield Row("f-number", f_number, "", "F# = z2/D")
    yield Row("numerical aperture", resolution.numerical_aperture(f_number), "", "1 / (2 F#)")
    yield Row("object-side numerical aperture", resolution.numerical_aperture(at_object), "", "D / (2 z1)")
    yield Row("cut-off", resolution.incoherent_cutoff(wavelength, f_number), "1/m", "1 / (λ F#), incoherent")
    yield Row("coherent cut-off", resolution.coherent_cutoff(wavelength, f_number), "1/m", "1 / (2 λ F#)")
    yield Row(
        "cut-off at the object", resolution.incoherent_cutoff(wavelength, at_object), "1/m", "D / (λ z1)"
    )
    yield Row("Airy radius", resolution.airy_first_zero(wavelength, f_number), "m", "1.22 λ F#, first zero")
    for index, waves in camera.main_lens.aberrations.items():
        yield Row(f"Noll {index}", float(waves), "waves rms", "given")
    if camera.main_lens.over_field is not None:
        yield from _over_field(camera.main_lens.over_field, wavelength)
    yield from lens_glass.rows(camera)


def _over_field(table: OverField, wavelength: float) -> Iterator[Row]:
    aberrations = table.aberrations
    reach, per_wave = aberrations.reach, 1 / wavelength if aberrations.metres else 1.0
    yield Row("field of the aberrations", math.degrees(math.atan(max(reach))), "deg", "given, from the axis")
    for k, j in enumerate(aberrations.terms):
        most = float(abs(aberrations.values[..., k]).max()) * per_wave
        yield Row(f"Noll {j}, most over the field", most, "waves rms", "given")


def _diameter_source(camera: Camera) -> str:
    matching = getattr(camera, "matching", None)
    if camera.main_lens.diameter is not None or matching is None:
        return "D, given"
    return {
        "views": "D = z2 p / b, f-numbers matched",
        "full": "D = p L / b, full micro-images",
        "touching": "D = p (L + b) / b, touching micro-images",
    }[matching]


def _lenslets(camera: LensletCamera) -> Iterator[Row]:
    parts, f_number = camera.lenslets, camera.lenslet_distance / camera.lenslets.pitch
    pixel = camera.pixels.pixel_pitch
    yield Row("lenslets", parts.count, "", f"{parts.layout}, {len(parts.indices())} in all")
    yield Row("lenslet pitch", parts.pitch, "m", "p, given")
    for number, focal_length in enumerate(parts.focal_length):
        kind = "" if len(parts.focal_length) == 1 else f" {number + 1}"
        yield Row(f"lenslet focal length{kind}", focal_length, "m", "f_µ, given")
    yield from _glass(camera)
    yield from _singles(camera)
    if camera.errors is not None:
        yield Row("focal length scatter", camera.built.focal_length_scatter, "", "rms part, as built")
        yield Row("decentre scatter", camera.built.decentre_scatter, "m", "rms along each axis, as built")
        yield Row("tilt scatter", camera.built.tilt_scatter, "rad", "rms about each axis, as built")
        yield Row("form scatter", camera.built.form_scatter, "m", "rms path but for focus and tilt, as built")
        yield Row("missing", camera.built.missing, "", "part of the lenslets, as built")
    yield Row("lenslet f-number", f_number, "", "b/p")
    yield Row(
        "lenslet cut-off",
        resolution.incoherent_cutoff(camera.wavelength, f_number),
        "1/m",
        "p / (λ b), on the sensor",
    )
    yield Row(
        "lenslet Airy radius",
        resolution.airy_first_zero(camera.wavelength, f_number),
        "m",
        "1.22 λ b/p, on the sensor",
    )
    yield Row("micro-image pitch", camera.micro_image_pitch, "m", "p (1 + b/L)")
    yield Row("micro-image pitch in pixels", camera.micro_image_pitch / pixel, "px", "")
    yield Row("micro-image width", camera.micro_image_width, "m", "D b / L, without diffraction")


def _singles(camera: LensletCamera) -> Iterator[Row]:
    parts = camera.lenslets
    for number, one in parts.single.items():
        own = parts.focal_length[0] * (1 + one.focal_change)
        yield Row(f"lenslet {number} focal length", own, "m", "f_µ, its own")
        if any(one.vertex):
            for axis, way in zip("yx", one.vertex, strict=True):
                yield Row(f"lenslet {number} vertex {axis}", way, "m", "from its place on the lattice")


def _glass(camera: LensletCamera) -> Iterator[Row]:
    """Rows on lenslets with a surface, or whose focal length changes with the wavelength."""
    parts, surface = camera.lenslets, camera.lenslets.surface(camera.wavelength)
    if parts.abbe is not None:
        yield Row("lenslet Abbe number", parts.abbe, "", "V_d, given")
    if surface is None:
        return
    facing = "sensor" if surface.thickness is None else "main lens"
    yield Row("lenslet index", surface.index, "", "n at the wavelength")
    yield Row("lenslet radius", (surface.index - 1) * parts.focal_length[0], "m", "(n - 1) f_µ")
    yield Row("lenslet conic", surface.conic, "", f"K, given; faces the {facing}")
    if surface.thickness is not None:
        yield Row("lenslet thickness", surface.thickness, "m", "given; counts as thickness / n")


def _sensor(camera: Camera) -> Iterator[Row]:
    sensor = camera.sensor
    given = "given" if camera.pixels.shape else "all micro-images fit"
    yield Row("pixels", tuple(sensor.shape), "", given)
    yield Row("pixel pitch", sensor.pixel_pitch, "m", "given")
    yield Row("sensor size", tuple(n * sensor.pixel_pitch for n in sensor.shape), "m", "height x width")
    yield from readout(sensor)
    yield Row(
        "field of view", tuple(2 * half for half in camera.sampling.object_half), "m", "in the focused plane"
    )


def readout(sensor: Sensor) -> Iterator[Row]:
    """Rows on the sensor by EMVA 1288's model: photons to digital numbers."""
    noise = 3 * sensor.dark_noise / sensor.gain
    if sensor.fill_factor < 1:
        yield Row("pixel fill factor", sensor.fill_factor, "", "active width / pitch, given")
        zero = 1 / (sensor.fill_factor * sensor.pixel_pitch)
        yield Row("pixels' first zero", zero, "1/m", "1 / (fill factor x pitch), on the sensor")
    if (response := sensor.angular_response) is not None:
        yield Row("response at 10°", float(response.of(math.radians(10))), "", "of one axis, given")
    yield Row("full well", sensor.full_well, "electrons", "given")
    yield Row("gain", sensor.gain, "electrons per count", "full well / (highest count - black level)")
    yield Row("read noise", sensor.read_noise, "electrons", "given")
    yield Row(
        "dynamic range",
        sensor.full_well / math.hypot(sensor.dark_noise, sensor.gain / math.sqrt(12)),
        "",
        "full well / noise in the dark, quantisation included",
    )
    clipped = "" if sensor.black_level >= noise else f"; below 3 σ = {noise:.3g} counts dark noise is clipped"
    yield Row("black level", sensor.black_level, "counts", f"given{clipped}")
    if sensor.quantum_efficiency < 1:
        yield Row("quantum efficiency", sensor.quantum_efficiency, "", "electrons per photon, given")
    if sensor.dark_signal:
        yield Row("dark signal", sensor.dark_signal, "electrons", "dark current times exposure time")
    if sensor.prnu:
        yield Row("PRNU", sensor.prnu, "", "rms of the pixels' response over its mean, given")
    if sensor.dsnu:
        yield Row("DSNU", sensor.dsnu, "electrons", "rms of the pixels' dark signal, given")


def _sampling(camera: Camera) -> Iterator[Row]:
    sampling = camera.sampling
    for rule in sampling.rules:
        yield Row(f"largest pitch, {rule.name}", rule.pitch, "m", f"{rule.source}, margin included")
    yield Row("pitch", sampling.pitch, "m", "chosen, of pupil, lenslets and sensor")
    for rule in sampling.object_rules:
        yield Row(f"largest pitch, {rule.name}", rule.pitch, "m", f"{rule.source}, margin included")
    yield Row("object pitch", sampling.object_pitch, "m", "chosen")
    for name in ("object", "pupil", "lenslet", "image"):
        try:
            grid = getattr(sampling, f"{name}_grid")
        except SamplingError:
            continue
        if grid is not None:
            yield Row(f"{name} samples", grid.shape)


def _warnings(camera: Camera) -> Iterator[str]:
    for name in ("object", "pupil", "lenslet", "image"):
        try:
            getattr(camera.sampling, f"{name}_grid")
        except SamplingError as error:
            yield f"cannot be simulated: {error}"
    yield from camera.glass_warnings()
    if camera.f_number < 4:
        yield f"the main lens works at f/{camera.f_number:.3g}: below f/4 paraxial, scalar forms are rough."
    pixel, airy = camera.pixels.pixel_pitch, resolution.airy_first_zero(camera.wavelength, camera.f_number)
    if camera.lenslet_distance is None and pixel > camera.wavelength * camera.f_number / 2:
        yield (
            f"pixels of {pixel * 1e6:.3g} µm sample the Airy radius of {airy * 1e6:.3g} µm too coarsely: "
            f"{camera.wavelength * camera.f_number / 2 * 1e6:.3g} µm would keep all detail."
        )


def _lenslet_warnings(camera: LensletCamera) -> Iterator[str]:
    diameter, fill = camera.pupil_diameter, camera.micro_image_width / camera.micro_image_pitch
    if diameter < min(camera.diameters) * (1 - ALIKE):
        words = ", ".join(f"{word} {d * 1e3:.4g} mm" for word, d in camera.diameters._asdict().items())
        yield (
            f"the main lens is {diameter * 1e3:.4g} mm wide, less than any of {words}: micro-images fill "
            f"only {fill:.0%} of their distance."
        )
    if fill > 1 + ALIKE:
        yield (
            f"micro-images overlap: {camera.micro_image_width * 1e6:.4g} µm wide, "
            f"{camera.micro_image_pitch * 1e6:.4g} µm apart. Reduce the main lens' diameter from "
            f"{diameter * 1e3:.4g} to {diameter / fill * 1e3:.4g} mm, with which they touch."
        )
    width, smallest = camera.lenslets.pitch * camera.lenslets.fill_factor, _smallest(camera)
    if width < smallest:
        yield (
            f"cross-talk by diffraction: lenslets of {width * 1e6:.4g} µm are narrower than "
            f"sqrt(2.44 λ b) = {smallest * 1e6:.4g} µm. Use wider lenslets or a shorter focal length."
        )
    pixel, nyquist = camera.pixels.pixel_pitch, camera.wavelength * camera.lenslet_distance / (2 * width)
    if pixel > camera.micro_image_pitch / 2:
        yield f"pixels of {pixel * 1e6:.3g} µm leave less than two per micro-image."
    elif pixel > nyquist * (1 + 1e-9):
        yield (
            f"pixels of {pixel * 1e6:.3g} µm are coarser than the lenslets' detail, "
            f"λ b / (2 p) = {nyquist * 1e6:.3g} µm."
        )
    yield from _cropped(camera)


def _smallest(camera: LensletCamera) -> float:
    return design1.smallest_lenslet(camera.wavelength, camera.lenslet_distance)


def _cropped(camera: LensletCamera) -> Iterator[str]:
    seen, present = len(camera.calibration.indices), len(camera.lenslets.indices())
    if seen < present:
        yield f"the sensor shows {seen} micro-image centres of {present}. Leave its shape out to show all."
    if camera.lenslet_distance and max(camera.lenslets.reach) > camera.separation / 4:
        yield "the array is wide for its distance: rays beyond 14 degrees are not paraxial."
