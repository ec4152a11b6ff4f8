"""Parts of a scene whose images need no shots: points, evenly lit stops, slices in light of one kind."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.modes import CoherentModes
from lumigraph.core.progress import Needs, Progress, Stage
from lumigraph.core.progress import part as share
from lumigraph.operators import CameraOptics, SingleLensOperator, single_lens, single_lens_operator
from lumigraph.operators.lenslets import points
from lumigraph.operators.lenslets.paraxial_error import left_by_field, resolved
from lumigraph.operators.lenslets.tilted_planes import flat
from lumigraph.operators.periodic import white
from lumigraph.operators.periodic.coherent import coherent_image
from lumigraph.operators.periodic.incoherent import periodic_operator
from lumigraph.operators.periodic.screens import Screen
from lumigraph.operators.sampling.field_lenses import FieldOperator
from lumigraph.operators.sampling.regrid import Regridded
from lumigraph.scene import Diffuser, Points, Slice
from lumigraph.simulation import error
from lumigraph.simulation.camera import ImagedCamera
from lumigraph.simulation.coherence import Coherent, PartiallyCoherent
from lumigraph.simulation.hiding import hidden_image
from lumigraph.simulation.lamp_light import in_lamp_light

Part = Slice | Points | Diffuser


def image_of(
    camera: ImagedCamera,
    part: Part,
    accuracy: float,
    progress: Progress,
    light: Coherent | PartiallyCoherent | None = None,
    *,
    screens: Sequence[Screen] = (),
) -> tuple[np.ndarray, error.ReachedError]:
    """Image of a part in incoherent light, or of a slice in light that interferes; and how far off it is.

    In incoherent light screens hide what stands behind them.
    """
    plain = camera.optics()
    if plain.lean is not None:
        return _leaning(plain, part, accuracy, progress, light, screens)
    return _image_of(camera, part, accuracy, progress, light, screens)


def _leaning(
    camera: CameraOptics,
    part: Part,
    accuracy: float,
    progress: Progress,
    light: Coherent | PartiallyCoherent | None,
    screens: Sequence[Screen],
) -> tuple[np.ndarray, error.ReachedError]:
    """Image of a part by a tilted camera, as the sum of upright cameras' images, and its error."""
    found, reached = flat(camera, accuracy), []

    def image(one: CameraOptics) -> np.ndarray:
        told = share(progress, len(reached), len(found.cameras))
        image, off = _image_of(one, part, accuracy, told, light, screens)
        reached.append(off)
        return image

    total = found.image(image)
    worst = max(reached, key=lambda one: one.rms)
    return total, worst.and_also(found.left, f", {len(found.cameras)} cameras that do not lean")


def _image_of(
    camera: ImagedCamera | CameraOptics,
    part: Part,
    accuracy: float,
    progress: Progress,
    light: Coherent | PartiallyCoherent | None,
    screens: Sequence[Screen],
) -> tuple[np.ndarray, error.ReachedError]:
    """Image of a part formed by an upright camera (ny, nx), and its error."""
    plain = camera.optics()
    if screens and not isinstance(part, Diffuser):
        return hidden_image(plain, part, accuracy, progress, screens)
    if light is not None and isinstance(part, Slice):
        return _lit(replace(plain, model="paraxial"), part, accuracy, light, progress)
    if plain.lattice is None and not isinstance(camera, CameraOptics):
        return _without_lenslets(camera, part, accuracy)
    if isinstance(part, Diffuser):
        image, off = white.image_and_error(plain, accuracy)
        return part.intensity * image, error.of_white(off, accuracy).through(plain)
    plain = resolved(plain, accuracy)
    aslant = error.aslant(part, plain) if plain.surface is not None else 0.0
    if isinstance(part, Points):
        image, off = points.image_and_error(plain, part, accuracy)
        reached = error.beside(error.of_points(off, accuracy), plain, aslant)
        return image, reached if plain.model == "exact" else reached.through(plain)
    part = part.trimmed()
    operator = periodic_operator(plain, part.grid, part.dz, accuracy=accuracy, progress=progress)
    intensity = arrays.to_numpy(part.intensity).astype(np.float32)
    image = operator.forward(intensity)
    reached = error.beside(error.of_operator(intensity, accuracy, plain), plain, aslant)
    if plain.model == "exact":
        return image, reached.and_also(left_by_field(plain, accuracy), ", alike over the field")
    behind = operator.of if isinstance(operator, Regridded) else operator
    if isinstance(behind, FieldOperator):
        reached = reached.and_also(behind.left, f", {len(behind.maps)} lenses over the field")
    return image, reached.through(plain)


def _lit(
    camera: CameraOptics, part: Slice, accuracy: float, light: Coherent | PartiallyCoherent,
    progress: Progress,
) -> tuple[np.ndarray, error.ReachedError]:  # fmt: skip
    """Image of a slice in coherent or partially coherent light (ny, nx), and its error."""
    if isinstance(light, PartiallyCoherent):
        found = in_lamp_light(camera, part, light, max(accuracy, light.accuracy / 3), progress)
        if found is not None:
            return found
    reached = error.of_quadrature("coherent", accuracy).through(camera)
    amplitude = np.sqrt(arrays.to_numpy(part.intensity))
    if not isinstance(light, PartiallyCoherent):
        return coherent_image(camera, amplitude, part.grid, part.dz, accuracy, progress), reached
    progress(Stage(0.0, "modes of the source"))
    modes = light.on(part.grid, part.dz, camera.wavelength)
    fewer = light.fewer(modes, part.grid, part.dz)

    def image(chosen: np.ndarray, told: Progress) -> np.ndarray:
        lit = amplitude.astype(np.float32) * chosen
        return coherent_image(camera, lit, part.grid, part.dz, accuracy, told)

    data = _stacked(modes)
    if fewer is None:
        whole, off = image(data, progress), modes.error
    else:
        whole, off = _beside_fewer(image, data, _stacked(fewer), progress)
        off *= modes.error / (fewer.error - modes.error)
    return whole, reached.and_also(off, f", {modes.count} modes to {modes.error:.2g}").and_also(
        error.ROUNDING
    )


def _stacked(modes: CoherentModes) -> np.ndarray:
    return np.concatenate([arrays.to_numpy(field.data) for field in modes.fields])


def _beside_fewer(
    image: Callable[[np.ndarray, Progress], np.ndarray],
    modes: np.ndarray,
    fewer: np.ndarray,
    progress: Progress,
) -> tuple[np.ndarray, float]:
    """Image of all modes, and its relative rms difference from that of fewer modes.

    Fewer modes that are the first of all are imaged once.
    """

    def again(stage: float) -> None:
        """Progress of the second image, without what it needs: that is told once."""
        if not isinstance(stage, Needs):
            share(progress, 1, 2)(stage)

    first = np.array_equal(modes[: len(fewer)], fewer)
    other = image(modes[len(fewer) :] if first else modes, share(progress, 0, 2))
    coarse = image(fewer, again)
    whole = coarse + other if first else other
    return whole, error.norm(whole - coarse) / (error.norm(whole) or 1.0)


def _without_lenslets(
    camera: ImagedCamera, part: Part, accuracy: float
) -> tuple[np.ndarray, error.ReachedError]:
    if isinstance(part, Points):
        image, off = single_lens.points_image(camera, part)
        return image, error.of_convolution(off)
    if isinstance(part, Diffuser):  # a sharp image of nothing: even light
        return np.full(camera.sensor.shape, part.intensity), error.of_convolution(0.0)
    part = part.trimmed()
    operator = single_lens_operator(camera, part.grid, part.dz, accuracy)
    several = "" if isinstance(operator, SingleLensOperator) else ", lenses over the field"
    image = operator.forward(arrays.to_numpy(part.intensity).astype(np.float32))
    return image, error.of_convolution(operator.error, several)
