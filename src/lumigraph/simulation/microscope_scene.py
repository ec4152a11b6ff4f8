"""Raw images of scenes by a light-field microscope: slices on its operator's samples, points where they are.

All light is incoherent: fluorescence. Parts beyond the field of the lenslets are left out.
"""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from lumigraph.core import arrays, coverage
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.elements.objective import Objective
from lumigraph.errors import GeometryError, SamplingWarning
from lumigraph.operators.microscope.building import SampledLenslets
from lumigraph.operators.microscope.cell import Lenslet
from lumigraph.operators.microscope.kernels import KernelAccuracy, point_cells, require_window
from lumigraph.operators.microscope.pupil import PupilImages
from lumigraph.operators.microscope.volume_operator import MicroscopeOperator
from lumigraph.scene import Diffuser, Medium, Points, Scene, Slice
from lumigraph.sensor import Sensor
from lumigraph.simulation import error
from lumigraph.simulation.coherence import Incoherent
from lumigraph.simulation.through_medium import lit_points, medium_image

SAMPLES = 5
"""Samples along a lenslet of a scene's slice, at least: those of the microscope's ``object_grid``."""

_SOURCE = "cells treated as far, what samples behind a lenslet do not hold, samples of slices"

COARSER = 1.5
"""Pitch of the samples that estimate the error of an operator's own, over theirs."""

LEAST = 0.5
"""Smallest part of the accuracy left to an operator, if a slice's samples take up the rest."""


@runtime_checkable
class Microscope(Protocol):
    """Protocol of a light-field microscope that images a scene."""

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """The objective at each wavelength."""
        ...

    @property
    def lenslet_size(self) -> float:
        """Pitch of the lenslets in object space [m]."""
        ...

    @property
    def sensor(self) -> Sensor:
        """Pixels."""
        ...

    def operator(
        self,
        depths: Sequence[float] | None = None,
        samples_per_lenslet: int | None = None,
        *,
        accuracy: float,
    ) -> Any:
        """Operator from slices of the object to the raw image."""
        ...

    @property
    def object_grid(self) -> Grid:
        """Samples of the focused plane."""
        ...

    def pupil_images(self, terms: Sequence[int], *, farthest: float, accuracy: float) -> PupilImages:
        """Images of points as functions of its pupil."""
        ...

    def imaged_point(self, y: float, x: float, dz: float, accuracy: float) -> tuple[np.ndarray, float]:
        """Raw image of a point, and its estimated relative rms error."""
        ...


def microscope_image(
    scope: Microscope,
    scene: Scene,
    coherence: Any,
    progress: Progress | None = None,
    medium: Medium | None = None,
) -> RawImage:
    """Raw image (ny, nx) float32 of a scene, seen through a medium or none.

    Raises
    ------
    GeometryError
        An empty scene, a coloured slice, or light that is not incoherent.
    """
    if not isinstance(coherence, Incoherent):
        raise GeometryError(
            f"coherence is {coherence!r} but a light-field microscope images fluorescence, which does not "
            "interfere. Leave coherence out."
        )
    if not scene.parts:
        raise GeometryError("the scene is empty. Add targets, points or a diffuser.")
    if any(isinstance(part, Slice) and part.hides for part in scene.parts):
        raise GeometryError(
            "a slice is opaque but fluorescence shines through a sample: before a light-field microscope "
            "nothing hides. Leave the opacity out."
        )
    pixels, reached = np.zeros(scope.sensor.shape), []
    if medium is not None:
        scene = Scene([lit_points(scope, scene)])
    for done, part in enumerate(scene.parts):
        if medium is not None and isinstance(part, Points):
            image, rms = medium_image(scope, part, medium, coherence.accuracy, progress)
        else:
            image, rms = _image(scope, part, coherence.accuracy)
        pixels += image
        reached.append((error.norm(image), error.ReachedError(rms, _SOURCE)))
        if progress is not None:
            progress((done + 1) / len(scene.parts))
    known = {
        "simulated": repr(coherence), "shots": len(scene.parts), "wavelength": scope.objectives[0].wavelength
    }  # fmt: skip
    whole = error.together(reached)
    if whole is not None and math.isfinite(whole.rms):  # of Fourier microscopes it is not known
        known["error"] = {"rms": whole.rms, "source": whole.source}
    error.warn_if_missed(coherence.accuracy, whole)
    return RawImage(np.maximum(pixels, 0).astype(np.float32), scope.sensor.pixel_pitch, metadata=known)


def _image(scope: Microscope, part: Slice | Points | Diffuser, accuracy: float) -> tuple[np.ndarray, float]:
    """Raw image of a part, and its estimated relative rms error."""
    if isinstance(part, Slice):
        return _slice_image(scope, part, accuracy)
    if isinstance(part, Points):
        return _points_image(scope, part, accuracy)
    operator = _operator(scope, 0.0, _even_samples(scope), accuracy)
    return part.intensity * _white(operator), operator.error


def _even_samples(scope: Microscope) -> int:
    """Samples behind a lenslet whose points' images add up to that of an even plane.

    An image's light changes with the point's place by no more than 2 NA / λ: farther apart, points are seen.
    """
    band = max(2 * one.numerical_aperture / one.wavelength for one in scope.objectives)
    return max(SAMPLES, math.floor(scope.lenslet_size * band) + 1)


def _points_image(scope: Microscope, part: Points, accuracy: float) -> tuple[np.ndarray, float]:
    """The sum of points' images, whose errors are independent."""
    whole, squares = np.zeros(scope.sensor.shape), 0.0
    for light, place in zip(part.intensities, part.positions, strict=True):
        image, rms = scope.imaged_point(*map(float, place), accuracy=accuracy)
        whole += float(light) * image
        squares += (float(light) * rms * error.norm(image)) ** 2
    return whole, math.sqrt(squares) / (error.norm(whole) or 1.0)


def _slice_image(scope: Microscope, part: Slice, accuracy: float) -> tuple[np.ndarray, float]:
    """Image of a slice and its error; the operator is as fine as the slice, then finer, then more exact."""
    if part.intensity.ndim != 2:
        raise GeometryError(
            f"a slice has shape {part.intensity.shape} but one wavelength needs grey (y, x). "
            "Give spectrum=Spectrum.rgb() for a coloured scene."
        )
    finest = min(one.wavelength / (4 * one.numerical_aperture) for one in scope.objectives)
    steps, found = (
        (max(finest, *part.grid.pitch), finest),
        _FoundSlice(np.zeros(scope.sensor.shape), 0.0, 0.0),
    )
    counts = [max(SAMPLES, math.ceil(scope.lenslet_size / p - 1e-6)) for p in steps]
    for samples in dict.fromkeys(counts):
        found = _by_operator(scope, part, samples, accuracy)
        if not found.error > accuracy:  # nor where it is not known
            return found.image, found.error
    left = math.sqrt(max(accuracy**2 - found.sampled**2, 0.0))
    if left > LEAST * accuracy:
        found = _by_operator(scope, part, counts[-1], left)
    return found.image, found.error


@dataclass(frozen=True, slots=True)
class _FoundSlice:
    """Image of a slice, its relative rms error, and what of it is that of the operator's samples."""

    image: np.ndarray
    error: float
    sampled: float


def _by_operator(scope: Microscope, part: Slice, samples: int, accuracy: float) -> _FoundSlice:
    operator = _operator(scope, part.dz, samples, accuracy)
    image = operator.forward(_plane(part, operator.object_grid))
    sampled = _sampling_error(operator, part, image)
    return _FoundSlice(image, math.hypot(operator.error, sampled), sampled)


def _operator(scope: Microscope, dz: float, samples: int, accuracy: float) -> Any:
    """Without its own warning: that of the whole raw image counts."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingWarning)
        return scope.operator((dz,), samples, accuracy=accuracy)


def _plane(part: Slice, grid: Grid) -> np.ndarray:
    return averaged(arrays.to_numpy(part.intensity), part.grid, grid)[None].astype(np.float32)


def _sampling_error(operator: Any, part: Slice, image: np.ndarray) -> float:
    """Relative rms by the pitch of the operator's samples, from that of samples `COARSER` times as far apart.

    It falls as the square of their pitch. A slice on the operator's own samples is what it is.
    """
    grid = operator.object_grid
    if part.grid == grid:
        return 0.0
    shape = (math.ceil(grid.shape[0] / COARSER), math.ceil(grid.shape[1] / COARSER))
    coarse = Grid(shape, (grid.pitch[0] * COARSER, grid.pitch[1] * COARSER), grid.center)
    there = Slice(_plane(part, coarse)[0], coarse, part.dz)
    difference = operator.forward(_plane(there, grid)) - image
    return error.norm(difference) / (COARSER**2 - 1) / (error.norm(image) or 1.0)


def averaged(picture: np.ndarray, grid: Grid, wanted: Grid) -> np.ndarray:
    """Mean (y, x) over each sample of another grid; 0 beyond the picture.

    >>> averaged(np.arange(4.0)[None], Grid((1, 4), 1.0), Grid((1, 2), (1.0, 2.0), (0.0, 0.5))).tolist()
    [[0.5, 2.5]]
    """
    rows = _shares(grid.y, grid.pitch[0], wanted.y, wanted.pitch[0])
    columns = _shares(grid.x, grid.pitch[1], wanted.x, wanted.pitch[1])
    return rows @ picture @ columns.T


def _shares(at: np.ndarray, pitch: float, wanted: np.ndarray, step: float) -> np.ndarray:
    """Part of each wanted sample (rows) that each sample (columns) covers."""
    rows = [coverage.interval(at, pitch, y - step / 2, y + step / 2) for y in wanted]
    return np.array(rows) * (pitch / step)


def _white(operator: Any) -> np.ndarray:
    """Image of an even plane that extends beyond the lenslets."""
    if not isinstance(operator, MicroscopeOperator):
        return operator.forward(np.ones(operator.shape[1], np.float32))
    N = operator.kernels[0].sampling.pixels
    plane = np.tile(operator.kernels[0].white().reshape(N, N), operator.cells)
    return plane if operator.placement is None else operator.placement.forward(plane)


def point_image(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    layout: SampledLenslets,
    position: tuple[float, float, float],
    accuracy: float = 1e-3,
) -> tuple[np.ndarray, float]:
    """Raw image (ny, nx) of a point that sends as much light as a sample of the layout, and its rms error.

    Parameters
    ----------
    objectives
        One for each wavelength.
    lenslet, layout
        The array and the pixels.
    position
        (y, x, dz) [m], anywhere; its image is cut off at the lenslets' border.
    accuracy
        Relative rms; that of the image, which is returned, is an estimate.
    """
    s, N, size = layout.sampling.points, layout.sampling.pixels, lenslet.pitch / lenslet.magnification
    place = [
        (at - middle) / size + (n - 1) / 2
        for at, middle, n in zip(position[:2], layout.center, layout.cells, strict=True)
    ]
    own = [math.floor(cell + 0.5) for cell in place]
    within = ((place[0] - own[0]) * s + (s - 1) / 2, (place[1] - own[1]) * s + (s - 1) / 2)
    farthest = max(max(k, n - 1 - k) for k, n in zip(own, layout.cells, strict=True))
    demand = KernelAccuracy(accuracy, farthest + 1)  # what falls beside the sensor needs no window
    for one in objectives:
        require_window(one, lenslet, layout.sampling, position[2], demand)
    cells, error = point_cells(objectives, lenslet, layout.sampling, within, (position[2], demand))
    plane = np.zeros((layout.cells[0], N, layout.cells[1], N))
    reach = len(cells) // 2
    starts = [min(n, max(0, k - reach)) for k, n in zip(own, layout.cells, strict=True)]
    rows, columns = (
        slice(start, max(start, min(n, k + reach + 1)))
        for start, k, n in zip(starts, own, layout.cells, strict=True)
    )
    first = (rows.start - own[0] + reach, columns.start - own[1] + reach)
    lit = cells[first[0] :, first[1] :][: rows.stop - rows.start, : columns.stop - columns.start]
    plane[rows, :, columns] = lit.transpose(0, 2, 1, 3)
    image = plane.reshape(layout.cells[0] * N, layout.cells[1] * N)
    return (image if layout.placement is None else layout.placement.forward(image)), error
