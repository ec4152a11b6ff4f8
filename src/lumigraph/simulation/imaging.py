"""A raw image from a camera and a scene: parts imaged at once, fields through the camera's train."""

import math
from builtins import map as serial_map
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.progress import Progress
from lumigraph.core.progress import part as share
from lumigraph.core.raw import RawImage
from lumigraph.core.volume import Volume
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.periodic.coherent import is_followed
from lumigraph.scene import Medium, Points, Scene, Slice
from lumigraph.simulation import error
from lumigraph.simulation.camera import ImagedCamera, Imaging
from lumigraph.simulation.coherence import (
    Coherence,
    Coherent,
    Incoherent,
    PartiallyCoherent,
    Snapshots,
    TiltedWaves,
)
from lumigraph.simulation.exact import image_of
from lumigraph.simulation.hiding import screens_of
from lumigraph.simulation.light import AccumulatedLight, Shots, read_out
from lumigraph.simulation.microscope_scene import Microscope, microscope_image
from lumigraph.simulation.shots import Shot, number_of_shots, shots
from lumigraph.simulation.spectrum import Spectrum, by_wavelength

COHERENT = 1e-4
"""Accuracy to which coherent light is followed: little is gained by less."""


class Interrupted(KeyboardInterrupt):
    """`simulate` was interrupted; `partial` is the raw image of the shots that were finished.

    Where all shots are alike, as for extended scenes, it is as bright as the whole would have been.
    """

    def __init__(self, partial: RawImage) -> None:
        super().__init__(f"interrupted after {partial.metadata['shots']} shots")
        self.partial = partial


def simulate(
    camera: ImagedCamera | Microscope,
    scene: Scene | Volume,
    coherence: Coherence | Incoherent | PartiallyCoherent | None = None,
    *,
    spectrum: Spectrum | None = None,
    progress: Progress | None = None,
    map: Callable[..., Iterable[Any]] = serial_map,  # noqa: A002 - what it is
    medium: Medium | None = None,
) -> RawImage:
    """Raw image (ny, nx) of a scene, float32, turned by 180° so that pictures stand upright.

    Light goes from each plane of the scene to the main lens, through the camera's train to the sensor,
    where its intensity is integrated over the pixels. An evenly lit, wide scene of intensity 1 gives a mean
    of about 1; a point of intensity 1 counts as one sample of ``camera.object_grid``, at all wavelengths of a
    spectrum.

    Depths add up, and slices with an opacity hide what stands behind them, before cameras with lenslets and
    in incoherent light: each point that their edges hide in part sends its own wave past them (Kirchhoff's
    and Fresnel's integrals, to 1e-2 rms of these points' light). Where edges of two slices stand within some
    Fresnel zones of each other, seen from a point, the product is taken. Lenses are paraxial then.

    Parameters
    ----------
    camera
        Any instrument.
    scene
        Slices, points and diffusers; see `lumigraph.targets`. Or a `Volume`, whose planes are slices.
    coherence
        For slices: `Incoherent` (default), `Coherent`, `PartiallyCoherent`, `Snapshots` or `TiltedWaves`. The
        last two leave the raw image's relative rms error, estimated from the spread of blocks of their
        shots, in ``metadata["estimated_error"]``.
    spectrum
        Wavelengths that take the place of the camera's own, and the channels that detect them. Then slices
        may be coloured, (y, x, 3), and the raw image is (ny, nx, 3) or a Bayer mosaic.
    progress
        Called as ``progress(fraction)`` after each propagation and while an operator is built.
    map
        Runs the propagations, such as a pool's ``imap``; results are added in order, so that every map
        gives the same raw image.
    medium
        Refracting medium before the scene, for microscopes "1.0" and "2.0": slices that delay light,
        by multislice; at most some thousand points and lit samples.

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
        if medium is not None:
            raise GeometryError(
                "medium and spectrum are both given: one sample's indices have one wavelength."
            )
        return _coloured(camera, scene, coherence, spectrum, progress, map)
    if isinstance(camera, Microscope):
        checks.instance("scene", scene, Scene)
        return microscope_image(camera, scene, coherence, progress, medium)
    if medium is not None:
        raise GeometryError("medium is of light-field microscopes: before a camera leave it out.")
    _check(camera, scene, coherence)
    return _imaged(camera, scene, coherence, progress, map)


def _imaged(
    camera: ImagedCamera,
    scene: Scene,
    coherence: Coherence | Incoherent | PartiallyCoherent,
    progress: Progress | None,
    map: Callable[..., Iterable[Any]],  # noqa: A002 - as `simulate` names it
) -> RawImage:
    dark = np.zeros(camera.sensor.shape)
    light = AccumulatedLight(dark, Shots(camera, dark))
    slices, count, accuracy, screens = [], 0, 1e-3, screens_of(scene, camera, coherence)
    fields: Iterable[Shot] = ()
    followed = None
    if isinstance(coherence, PartiallyCoherent) or (isinstance(coherence, Coherent) and is_followed(camera)):
        followed = coherence
    if isinstance(coherence, Incoherent):
        accuracy = coherence.accuracy
    elif followed is not None or isinstance(coherence, PartiallyCoherent):
        accuracy = COHERENT
        scene = Scene(part.trimmed() if isinstance(part, Slice) else part for part in scene.parts)
    elif slices := [part.trimmed() for part in scene.parts if isinstance(part, Slice)]:
        fields = shots(camera, slices, coherence)
        count = number_of_shots(slices, coherence)
    exact = [part for part in scene.parts if not (slices and isinstance(part, Slice))]
    total = len(exact) + count
    try:
        for part in exact:
            report = share(progress, light.done, total)
            image, reached = image_of(camera, part, accuracy, report, followed, screens=screens)
            light.pixels = light.pixels + image
            light.reached.append((error.norm(image), reached))
            light.count(progress, total)
        for block, image in map(Shot.arrive, fields):
            light.shots.add(block, image)
            light.count(progress, total)
    except KeyboardInterrupt:
        if not light.done:
            raise
        if not exact:
            light.shots.complete()
            light.shots.brighten(total / light.done)  # equal shots: fewer of them, as bright
        raise Interrupted(read_out(camera, light, coherence)) from None
    return read_out(camera, light, coherence)


def _coloured(
    camera: ImagedCamera | Microscope,
    scene: Scene,
    coherence: Coherence | Incoherent | PartiallyCoherent,
    spectrum: Spectrum,
    progress: Progress | None,
    map: Callable[..., Iterable[Any]],  # noqa: A002 - as `simulate` names it
) -> RawImage:
    count = len(spectrum.wavelengths)

    def at_wavelength(camera: ImagedCamera | Microscope, scene: Scene, number: int) -> RawImage:
        return simulate(camera, scene, coherence, progress=share(progress, number, count), map=map)

    return by_wavelength(camera, scene, spectrum, at_wavelength)


def _check(camera: ImagedCamera, scene: Scene, coherence: Coherence | Incoherent | PartiallyCoherent) -> None:
    """Refuse scenes that are empty or behind the lens, and propagations that do not fit in memory."""
    checks.instance("scene", scene, Scene)
    if not isinstance(coherence, Incoherent | Coherent | PartiallyCoherent | Snapshots | TiltedWaves):
        raise GeometryError(
            f"coherence is of type {type(coherence).__name__} but must be Incoherent(), Coherent(), "
            "PartiallyCoherent(...), Snapshots(...) or TiltedWaves(...)."
        )
    if not isinstance(camera, Imaging):
        raise GeometryError(
            f"camera is of type {type(camera).__name__} but must be a camera, such as PlenopticCamera."
        )
    if isinstance(coherence, PartiallyCoherent) and not is_followed(camera):
        raise GeometryError(
            "coherence is PartiallyCoherent, whose modes are followed by lenses and plates to lenslets that "
            "are not turned: this camera has others. Set rotation to 0, or use TiltedWaves(count, na=...)."
        )
    if isinstance(coherence, Snapshots | TiltedWaves) and camera.sensor.angular_response is not None:
        raise GeometryError(
            f"coherence is {type(coherence).__name__}, which counts light alike at all angles, "
            "but sensor.angular_response is given. Use Incoherent() or Coherent(), or leave it out."
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
