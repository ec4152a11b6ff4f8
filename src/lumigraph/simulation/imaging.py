"""A raw image from a camera and a scene: fields through the camera's train, intensities onto pixels."""

import math
import warnings
from builtins import map as serial_map
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lumigraph.core import arrays, checks, memory
from lumigraph.core.field import Field
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress
from lumigraph.core.progress import part as share
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.elements import CircularAperture, Train
from lumigraph.errors import GeometryError, SamplingError, SamplingWarning
from lumigraph.operators import points as _points
from lumigraph.operators import single_lens, white
from lumigraph.operators.periodic import periodic_operator
from lumigraph.propagation import Propagate, propagate
from lumigraph.scene import Diffuser, Points, Scene, Slice, sources
from lumigraph.sensor import integrate
from lumigraph.simulation import error
from lumigraph.simulation.camera import Camera, Imaging
from lumigraph.simulation.coherence import Coherence, Coherent, Incoherent, Plane, Snapshots, TiltedWaves
from lumigraph.simulation.microscope_scene import Microscope, microscope_image
from lumigraph.simulation.spectrum import Spectrum, by_wavelength

PUPIL_OVERSAMPLING = 1.1
"""How much denser than half of λL/p the points of the pupil stand that make a white image."""

Part = Slice | Points | Diffuser

# Seen on a few cameras, 1e-2 to 3e-2; not estimated from the image.
_PROPAGATED = error.Reached(0.03, "propagation on grids twice as fine as the rules ask")
_SINGLE_LENS = error.Reached(1e-4, "convolution with a point's image")


class Interrupted(KeyboardInterrupt):
    """`simulate` was interrupted; `partial` is the raw image of the shots that were finished.

    Where all shots are alike, as for extended scenes, it is as bright as the whole would have been.
    """

    def __init__(self, partial: RawImage) -> None:
        super().__init__(f"interrupted after {partial.metadata['shots']} shots")
        self.partial = partial


@dataclass(frozen=True, slots=True)
class _Shot:
    """One field on its way: where it enters the camera, and the weight of its intensity."""

    field: Field
    train: Train
    weight: float
    half: int | None = None
    """Of two halves of a random or quasi-random sample, the one that this shot belongs to."""

    def arrive(self) -> tuple[int | None, np.ndarray]:
        *elements, last = self.train.elements or (Train(()),)
        before = Train(elements)(self.field)
        intensity = last.intensity(before) if isinstance(last, Propagate) else last(before).intensity
        return self.half, intensity if self.weight == 1 else self.weight * intensity


def simulate(
    camera: Camera | Microscope,
    scene: Scene | Volume,
    coherence: Coherence | Incoherent | None = None,
    *,
    spectrum: Spectrum | None = None,
    progress: Progress | None = None,
    map: Callable[..., Iterable[Any]] = serial_map,  # noqa: A002 - what it is
) -> RawImage:
    """Raw image (ny, nx) of a scene, float32, turned by 180° so that pictures stand upright.

    Light goes from each plane of the scene to the main lens, through the camera's train to the sensor,
    where its intensity is integrated over the pixels. Depths add up: planes do not hide one another. An
    evenly lit, wide scene of intensity 1 gives a mean of about 1; a point of intensity 1 counts as one
    sample of ``camera.object_grid``.

    Parameters
    ----------
    camera
        Any instrument.
    scene
        Slices, points and diffusers; see `lumigraph.targets`. Or a `Volume`, whose planes are slices.
    coherence
        `Incoherent` (default), `Coherent`, `Snapshots` or `TiltedWaves`. The last two leave the raw image's
        relative rms error, estimated from two halves of their shots, in ``metadata["estimated_error"]``.
    spectrum
        Wavelengths that take the place of the camera's own, and the channels that see them. Then slices
        may be coloured, (y, x, 3), and the raw image is (ny, nx, 3) or a Bayer mosaic.
    progress
        Called as ``progress(fraction)`` after each propagation and while an operator is built.
    map
        Runs the propagations, such as a pool's ``imap``; results are added in order, so that every map
        gives the same raw image.

    Raises
    ------
    GeometryError
        An empty scene, or one that reaches behind the main lens.
    SamplingError
        The propagation does not fit in memory.
    Interrupted
        A KeyboardInterrupt; it carries the raw image of what was finished.
    """
    coherence = Incoherent() if coherence is None else coherence
    if isinstance(scene, Volume):
        planes = zip(scene.data, scene.depths, strict=True)
        scene = Scene(Slice(plane, scene.grid, dz) for plane, dz in planes)
    if spectrum is not None:
        return _coloured(camera, scene, coherence, spectrum, progress, map)
    if isinstance(camera, Microscope):
        checks.instance("scene", scene, Scene)
        return microscope_image(camera, scene, coherence, progress)
    _check(camera, scene, coherence)
    accuracy = coherence.accuracy if isinstance(coherence, Incoherent) else None
    exact = _exact(camera, scene, accuracy)
    rest = Scene(part for part in scene.parts if part not in exact)
    shots, count = _shots(camera, rest, _drawn(coherence))
    light = _Light(np.zeros(camera.image_grid.shape), np.zeros(camera.sensor.shape))
    total = len(exact) + count
    try:
        for part in exact:
            image, reached = _exactly(camera, part, accuracy or 1e-3, share(progress, light.done, total))
            light.pixels += image
            light.reached.append((error.norm(image), reached))
            light.count(progress, total)
        for half, image in map(_Shot.arrive, shots):
            light.add(half, image)
            light.count(progress, total)
    except KeyboardInterrupt:
        if not light.done:
            raise
        if not exact and all(isinstance(part, Slice) for part in rest.parts):
            light.brighten(total / light.done)  # equal shots: fewer of them, as bright
        raise Interrupted(_read_out(camera, light, coherence)) from None
    return _read_out(camera, light, coherence)


def _coloured(
    camera: Camera | Microscope,
    scene: Scene,
    coherence: Coherence | Incoherent,
    spectrum: Spectrum,
    progress: Progress | None,
    map: Callable[..., Iterable[Any]],  # noqa: A002
) -> RawImage:
    count = len(spectrum.wavelengths)

    def at_wavelength(camera: Camera | Microscope, scene: Scene, number: int) -> RawImage:
        return simulate(camera, scene, coherence, progress=share(progress, number, count), map=map)

    return by_wavelength(camera, scene, spectrum, at_wavelength)


@dataclass(slots=True)
class _Light:
    """What has arrived so far: intensity on the camera's grid and on the pixels, after `done` shots."""

    intensity: np.ndarray
    pixels: np.ndarray
    done: int = 0
    halves: dict[int, np.ndarray] = field(default_factory=dict)
    """What random or quasi-random shots brought, in two halves."""
    drawn: dict[int, int] = field(default_factory=lambda: {0: 0, 1: 0})
    """Shots in each half."""
    reached: list[tuple[float, error.Reached]] = field(default_factory=list)
    """Norm of each part that is imaged at once, and how far off it is."""

    def add(self, half: int | None, image: np.ndarray) -> None:
        if half is None:
            self.intensity += image
            return
        self.halves[half] = self.halves.get(half, 0.0) + image
        self.drawn[half] += 1

    def brighten(self, factor: float) -> None:
        self.intensity *= factor
        self.halves = {half: image * factor for half, image in self.halves.items()}

    def count(self, progress: Progress | None, total: int) -> None:
        self.done += 1
        if progress is not None:
            progress(self.done / total)


def _drawn(coherence: Coherence | Incoherent) -> Coherence:
    """Incoherent light as snapshots, for what the periodic operator does not take."""
    if isinstance(coherence, Incoherent):
        return Snapshots(coherence.snapshots, rng=coherence.rng)
    return coherence


def _exactly(
    camera: Camera, part: Part, accuracy: float, progress: Progress
) -> tuple[np.ndarray, error.Reached]:
    """Raw image of a part, and how far off it is."""
    if camera.lattice is None:
        if isinstance(part, Points):
            return single_lens.points_image(camera, part), _SINGLE_LENS
        assert isinstance(part, Slice)
        return single_lens.slice_image(camera, part.trimmed()), _SINGLE_LENS
    if isinstance(part, Points):
        return _points.points_image(camera, part, accuracy), error.of_quadrature("points", accuracy)
    if isinstance(part, Diffuser):
        image = part.intensity * white.white_image(camera, accuracy)
        return image, error.of_quadrature("white image", accuracy)
    part = part.trimmed()
    operator = periodic_operator(camera, part.grid, part.dz, accuracy=accuracy, progress=progress)
    image = operator.forward(arrays.to_numpy(part.intensity).astype(np.float32))
    return image, error.of_quadrature("operator", accuracy)


def _exact(camera: Camera, scene: Scene, accuracy: float | None) -> list[Part]:
    """Parts whose images are computed without a train of elements.

    None of them where no accuracy is asked for: the light is not incoherent.
    """
    if accuracy is None:
        return []
    if camera.lattice is None:
        return [part for part in scene.parts if isinstance(part, Slice | Points)]
    whole = white.separable(camera, accuracy)
    return [part for part in scene.parts if whole or not isinstance(part, Diffuser)]


def _read_out(camera: Camera, light: _Light, coherence: Coherence | Incoherent) -> RawImage:
    pixels = light.pixels
    reached = list(light.reached)
    if light.intensity.any():
        seen = integrate(light.intensity, camera.image_grid, camera.sensor)
        reached.append((error.norm(seen), _SINGLE_LENS if camera.lattice is None else _PROPAGATED))
        pixels = pixels + seen
    halves = {k: integrate(image, camera.image_grid, camera.sensor) for k, image in light.halves.items()}
    for half in halves.values():
        pixels = pixels + half
    # A hard edge rings below zero when it is interpolated to pixels; a sensor counts no negative light.
    data = np.maximum(pixels, 0, dtype=np.float32)
    known = {"simulated": repr(coherence), "shots": light.done, "wavelength": camera.wavelength}
    if len(halves) == 2:
        known["estimated_error"] = _error(halves, light.drawn, pixels, _drawn(coherence).convergence)
        drawn = error.Reached(known["estimated_error"], f"two halves of {light.done} shots")
        reached.append((error.norm(pixels), drawn))
    if (whole := error.together(reached)) is not None:
        known["error"] = {"rms": whole.rms, "source": whole.source}
    if isinstance(coherence, Incoherent):
        error.warn_if_missed(coherence.accuracy, whole)
    return RawImage(data, pixel_pitch=camera.sensor.pixel_pitch, metadata=known)


def _error(halves: dict[int, np.ndarray], drawn: dict[int, int], pixels: np.ndarray, power: float) -> float:
    """Relative rms error of a mean, from the difference between the means of its two halves.

    Errors that fall as a power p of the number of shots make halves of n1 and n2 of them differ by
    sqrt((n/n1)^2p + (n/n2)^2p) times the error of all n. Of a dozen quasi-random ones it may be twice that.
    """
    both = drawn[0] + drawn[1]
    difference = halves[0] * (both / drawn[0]) - halves[1] * (both / drawn[1])
    spread = math.hypot(*((both / n) ** power for n in drawn.values()))
    return float(np.linalg.norm(difference) / spread / max(np.linalg.norm(pixels), np.finfo(float).tiny))


def _check(camera: Camera, scene: Scene, coherence: Coherence | Incoherent) -> None:
    """Refuse scenes that are empty or behind the lens, and propagations that do not fit in memory."""
    checks.instance("scene", scene, Scene)
    if not isinstance(coherence, Incoherent | Coherent | Snapshots | TiltedWaves):
        raise GeometryError(
            f"coherence is of type {type(coherence).__name__} but must be Incoherent(), Coherent(), "
            "Snapshots(...) or TiltedWaves(...)."
        )
    if not isinstance(camera, Imaging):
        raise GeometryError(
            f"camera is of type {type(camera).__name__} but must be a camera, such as PlenopticCamera."
        )
    if not scene.parts:
        raise GeometryError("the scene is empty. Add targets, points or a diffuser.")
    for part in scene.parts:
        if isinstance(part, Slice) and part.intensity.ndim != 2:
            raise GeometryError(
                f"a slice has shape {part.intensity.shape} but one wavelength needs grey (y, x). "
                "Give spectrum=Spectrum.rgb() for a coloured scene."
            )
        depths = part.positions[:, 2] if isinstance(part, Points) else np.array([getattr(part, "dz", 0.0)])
        if (nearest := camera.object_distance + float(depths.min())) <= 0:
            raise GeometryError(
                f"the scene reaches {nearest * 1e3:.4g} mm in front of the main lens: depth "
                f"{depths.min() * 1e3:.4g} mm, object distance {camera.object_distance * 1e3:.4g} mm. "
                "Use depths that stay in front of the camera."
            )
    samples = max(math.prod(grid.shape) for grid in (camera.image_grid, camera.object_grid))
    pixels = math.prod(camera.sensor.shape)
    memory.require(
        8 * (12 * samples + 2 * pixels),
        "the simulation",
        "Use fewer lenslets or larger pixels.",
        SamplingError,
    )


def _shots(camera: Camera, scene: Scene, coherence: Coherence) -> tuple[Iterator[_Shot], int]:
    """Every field to send through the camera, made when it is its turn, and their number."""
    points = [part for part in scene.parts if isinstance(part, Points)]
    slices = [part.trimmed() for part in scene.parts if isinstance(part, Slice)]
    diffusers = [part for part in scene.parts if isinstance(part, Diffuser)]
    directions = _pupil_points(camera) if diffusers else np.empty((0, 3))
    brightness = sum(part.intensity for part in diffusers)
    planes = min(len(slices), 1) if coherence.planes_independent else len(slices)
    total = sum(len(part.positions) for part in points) + len(directions) + planes * coherence.shots

    def one_after_the_other() -> Iterator[_Shot]:
        yield from _diffuser_shots(camera, directions, brightness)
        for part in points:
            yield from _point_shots(camera, part)
        if slices:
            yield from _slice_shots(camera, slices, coherence)

    return one_after_the_other(), total


def _pupil_area(camera: Camera) -> float:
    return math.pi * camera.pupil_diameter**2 / 4


def _point_shots(camera: Camera, points: Points) -> Iterator[_Shot]:
    """Spherical waves at the main lens. Points never interfere with each other."""
    train, grid = camera.image_train(), camera.pupil_grid
    sample_area = math.prod(camera.object_grid.pitch)
    weight = sample_area * camera.separation**2 / _pupil_area(camera)
    for (y, x, dz), intensity in zip(points.positions, points.intensities, strict=True):
        wave = sources.point_source(
            grid, camera.wavelength, camera.object_distance + dz, (y, x), np.complex64
        )
        yield _Shot(wave, train, weight * float(intensity))


def _slice_shots(camera: Camera, slices: list[Slice], coherence: Coherence) -> Iterator[_Shot]:
    """What independent planes send goes together in one propagation: its interference averages out."""
    train, grid = camera.image_train(), camera.pupil_grid
    planes = [_plane(camera, part) for part in slices]
    # Each slice's own scale goes into its amplitude: its samples may differ in area.
    amplitudes = [plane.amplitude * np.float32(_factor(camera, plane, coherence)) for plane in planes]
    for number, waves in enumerate(coherence.illuminations(planes, camera.wavelength)):
        arriving = []
        for amplitude, light, plane in zip(amplitudes, waves, planes, strict=True):
            with warnings.catch_warnings():
                if coherence.planes_independent:  # samples of random phase are points: no pitch is too coarse
                    warnings.simplefilter("ignore", SamplingWarning)
                wave = Field(amplitude * light, plane.grid, camera.wavelength)
                arriving.append(propagate(wave, plane.distance, "fresnel", grid=grid))
        half = coherence.half(number)
        if coherence.planes_independent:
            together = Field(sum(wave.data for wave in arriving), grid, camera.wavelength)
            yield _Shot(together, train, 1.0, half)
        else:
            yield from (_Shot(wave, train, 1.0, half) for wave in arriving)


def _plane(camera: Camera, part: Slice) -> Plane:
    amplitude = np.sqrt(arrays.to_numpy(part.intensity)).astype(np.float32)
    return Plane(amplitude, part.grid, camera.object_distance + part.dz, camera.pupil_diameter)


def _factor(camera: Camera, plane: Plane, coherence: Coherence) -> float:
    """Factor of a plane's amplitude that makes an even scene of intensity 1 a raw image of mean 1."""
    area = math.prod(plane.grid.pitch)
    scale = coherence.scale(area, camera.wavelength, _pupil_area(camera), plane.distance)
    return math.sqrt(scale) * camera.separation / plane.distance


def _diffuser_shots(camera: Camera, directions: np.ndarray, brightness: float) -> Iterator[_Shot]:
    """Spherical waves from points of the main lens, without speckle: see `_pupil_points`."""
    train, grid = camera.relay_train(), camera.lenslet_grid
    if train is None or grid is None:
        train, grid = Train(()), camera.image_grid
    for y, x, weight in directions:
        wave = sources.point_source(
            grid, camera.wavelength, camera.separation, (y, x), np.complex64, paraxial=True
        )
        yield _Shot(wave * camera.separation, train, weight * brightness)


def _pupil_points(camera: Camera) -> np.ndarray:
    """Rows (y, x, weight): points of the main lens that stand for an evenly lit diffuser before it.

    Behind a diffuser the light in the pupil is incoherent, and a lenslet of pitch p resolves λL/p of the
    pupil: points at half that distance, weighted by the pupil's area around each, give its image without
    speckle, to 1 or 2 % rms: what neighbouring lenslets share interferes more finely.
    """
    if camera.lattice is None:
        return np.array([[0.0, 0.0, 1.0]])
    finest = camera.wavelength * camera.separation / (2 * PUPIL_OVERSAMPLING * max(camera.lattice.pitches))
    n = 2 * math.ceil(camera.pupil_diameter / 2 / finest) + 3
    grid = Grid.square(n, camera.pupil_diameter / (n - 2))
    area = CircularAperture(camera.pupil_diameter)
    weights = area(Field(np.ones(grid.shape, np.complex128), grid, camera.wavelength)).data.real
    rows, columns = np.nonzero(weights)
    picked = weights[rows, columns]
    return np.stack([grid.y[rows], grid.x[columns], picked / picked.sum()], axis=1)
