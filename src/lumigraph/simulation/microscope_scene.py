"""Raw images of scenes by a light-field microscope: slices on its operator's samples, points where they are.

All light is incoherent: fluorescence. What stands beyond the field that the lenslets see is left out.
"""

import math
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from lumigraph.core import arrays, coverage
from lumigraph.core.grid import Grid
from lumigraph.core.progress import Progress
from lumigraph.core.raw import RawImage
from lumigraph.elements.objective import Objective
from lumigraph.errors import GeometryError
from lumigraph.operators.microscope_cell import Lenslet
from lumigraph.operators.microscope_kernels import DROPPED, point_cells, require_window
from lumigraph.operators.microscope_operator import Layout, MicroscopeOperator
from lumigraph.scene import Diffuser, Points, Scene, Slice
from lumigraph.sensor import Sensor
from lumigraph.simulation.coherence import Incoherent

SAMPLES = 5
"""Samples along a lenslet of a scene's slice, at least: those of the microscope's ``object_grid``."""


@runtime_checkable
class Microscope(Protocol):
    """What is asked of a light-field microscope."""

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

    def operator(self, depths: Sequence[float] | None = None, samples_per_lenslet: int | None = None) -> Any:
        """How it sees slices."""
        ...

    def point_image(self, y: float, x: float, dz: float) -> np.ndarray:
        """Raw image of a point."""
        ...


def microscope_image(
    scope: Microscope, scene: Scene, coherence: Any, progress: Progress | None = None
) -> RawImage:
    """Raw image (ny, nx) float32 of a scene.

    Raises
    ------
    GeometryError
        An empty scene, a coloured slice, or light that is not incoherent.
    """
    if not isinstance(coherence, Incoherent):
        raise GeometryError(
            f"coherence is {coherence!r} but a light-field microscope sees fluorescence, which does not "
            "interfere. Leave coherence out."
        )
    if not scene.parts:
        raise GeometryError("the scene is empty. Add targets, points or a diffuser.")
    pixels = np.zeros(scope.sensor.shape)
    for done, part in enumerate(scene.parts):
        pixels += _image(scope, part)
        if progress is not None:
            progress((done + 1) / len(scene.parts))
    known = {
        "simulated": repr(coherence), "shots": len(scene.parts), "wavelength": scope.objectives[0].wavelength
    }  # fmt: skip
    return RawImage(np.maximum(pixels, 0).astype(np.float32), scope.sensor.pixel_pitch, metadata=known)


def _image(scope: Microscope, part: Slice | Points | Diffuser) -> np.ndarray:
    if isinstance(part, Slice):
        return _slice_image(scope, part)
    if isinstance(part, Points):
        rows = zip(part.positions, part.intensities, strict=True)
        images = (float(light) * scope.point_image(*map(float, place)) for place, light in rows)
        return sum(images, np.zeros(scope.sensor.shape))
    return part.intensity * _white(scope.operator((0.0,), SAMPLES))


def _slice_image(scope: Microscope, part: Slice) -> np.ndarray:
    """By an operator as fine as the slice, or as the objective resolves."""
    if part.intensity.ndim != 2:
        raise GeometryError(
            f"a slice has shape {part.intensity.shape} but one wavelength needs grey (y, x). "
            "Give spectrum=Spectrum.rgb() for a coloured scene."
        )
    finest = min(one.wavelength / (4 * one.numerical_aperture) for one in scope.objectives)
    samples = math.ceil(scope.lenslet_size / max(finest, *part.grid.pitch) - 1e-6)
    operator = scope.operator((part.dz,), max(SAMPLES, samples))
    plane = averaged(arrays.to_numpy(part.intensity), part.grid, operator.object_grid)
    return operator.forward(plane[None].astype(np.float32))


def averaged(picture: np.ndarray, grid: Grid, wanted: Grid) -> np.ndarray:
    """Mean (y, x) over each sample of another grid; 0 beyond the picture.

    >>> averaged(np.arange(4.0)[None], Grid((1, 4), 1.0), Grid((1, 2), (1.0, 2.0), (0.0, 0.5))).tolist()
    [[0.5, 2.5]]
    """
    rows = _shares(grid.y, grid.pitch[0], wanted.y, wanted.pitch[0])
    columns = _shares(grid.x, grid.pitch[1], wanted.x, wanted.pitch[1])
    return rows @ picture @ columns.T


def _shares(at: np.ndarray, pitch: float, wanted: np.ndarray, step: float) -> np.ndarray:
    """What part of each wanted sample (rows) each sample (columns) covers."""
    rows = [coverage.interval(at, pitch, y - step / 2, y + step / 2) for y in wanted]
    return np.array(rows) * (pitch / step)


def _white(operator: Any) -> np.ndarray:
    """Of an even plane that goes on beyond the lenslets."""
    if not isinstance(operator, MicroscopeOperator):
        return operator.forward(np.ones(operator.shape[1], np.float32))
    N = operator.kernels[0].sampling.pixels
    cell = operator.kernels[0].matrix().sum(0, dtype=np.float64).reshape(N, N)
    plane = np.tile(cell, operator.cells)
    return plane if operator.placement is None else operator.placement.forward(plane)


def point_image(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    layout: Layout,
    position: tuple[float, float, float],
    dropped: float = DROPPED,
) -> np.ndarray:
    """Raw image (ny, nx) of a point at (y, x, dz) [m] that sends as much light as a sample of the layout.

    Parameters
    ----------
    objectives
        One for each wavelength.
    lenslet, layout
        The array and the pixels.
    position
        Anywhere; its image is cut off at the lenslets' border.
    dropped
        Part of the light that the window may miss.
    """
    for one in objectives:
        require_window(one, lenslet, layout.sampling, position[2])
    s, N, size = layout.sampling.points, layout.sampling.pixels, lenslet.pitch / lenslet.magnification
    place = [
        (at - middle) / size + (n - 1) / 2
        for at, middle, n in zip(position[:2], layout.center, layout.cells, strict=True)
    ]
    own = [math.floor(cell + 0.5) for cell in place]
    within = ((place[0] - own[0]) * s + (s - 1) / 2, (place[1] - own[1]) * s + (s - 1) / 2)
    cells = point_cells(objectives, lenslet, layout.sampling, within, (position[2], dropped))
    plane = np.zeros((layout.cells[0], N, layout.cells[1], N))
    reach = len(cells) // 2
    rows, columns = (
        slice(max(0, k - reach), max(0, min(n, k + reach + 1)))
        for k, n in zip(own, layout.cells, strict=True)
    )
    first = (rows.start - own[0] + reach, columns.start - own[1] + reach)
    lit = cells[first[0] :, first[1] :][: rows.stop - rows.start, : columns.stop - columns.start]
    plane[rows, :, columns] = lit.transpose(0, 2, 1, 3)
    image = plane.reshape(layout.cells[0] * N, layout.cells[1] * N)
    return image if layout.placement is None else layout.placement.forward(image)
