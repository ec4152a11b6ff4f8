"""Scenes from a picture and the depth of its samples: opaque slices, which go on behind nearer ones."""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy.ndimage import distance_transform_edt

from lumigraph.core import checks
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError
from lumigraph.scene.volumes import Scene, Slice

MOST = 64
"""Slices."""

BESIDE = 2.0
"""Samples that a slice is continued beyond what the main lens sees behind an edge."""


@runtime_checkable
class Seeing(Protocol):
    """Protocol of the camera that a scene with hidden parts is made for."""

    @property
    def object_distance(self) -> float:
        """Focused plane to main lens [m]."""
        ...

    @property
    def pupil_diameter(self) -> float:
        """Diameter of the main lens' stop [m]."""
        ...


def rgbd(
    picture: Any, depth: Any, grid: Grid, camera: Seeing, planes: int = 8, *, behind: Any = None
) -> Scene:
    r"""Opaque slices that look like a picture with depths, from the middle of a camera's main lens.

    Depths are sorted into slices at even steps of 1/z, z from the main lens. A sample stands where its
    central ray meets its slice: one that is dz farther than the focused plane, at :math:`z_1`, is
    :math:`1 + dz/z_1` times as large. What the middle of the lens does not see, its border does: behind
    nearer slices each goes on for the parallax :math:`\frac{D}{2} z_1 (1/z_{near} - 1/z)` and two samples, in
    the colours of its nearest samples or those of `behind`. Slices are flat: surfaces are off by up to half a
    step.

    Parameters
    ----------
    picture
        (y, x) or (y, x, 3), not negative, as seen in the focused plane.
    depth
        (y, x), from the focused plane [m], positive farther.
    grid
        Samples of the picture in the focused plane.
    camera
        Whose distance and main lens the slices are made for.
    planes
        Slices, 1 to 64; those without a sample are left out.
    behind
        Colours of what goes on behind nearer slices, as `picture`; None takes those of the nearest samples.

    Raises
    ------
    GeometryError
        Shapes that differ from the grid's, depths that are not finite or reach the camera.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> camera = SimpleNamespace(object_distance=0.1, pupil_diameter=5e-3)
    >>> depth = np.zeros((16, 16))
    >>> depth[4:9, 5:12] = -0.02
    >>> scene = rgbd(np.ones((16, 16)), depth, Grid.square(16, 1e-4), camera, 2)
    >>> [(round(part.dz, 4), float(part.opacity.sum())) for part in scene.parts]
    [(0.0, 256.0), (-0.02, 35.0)]
    """
    colours, depths = np.asarray(to_numpy(picture), np.float32), np.asarray(to_numpy(depth), np.float64)
    under = colours if behind is None else np.asarray(to_numpy(behind), np.float32)
    z = _distances(colours, depths, under, grid, camera)
    planes = checks.whole("planes", planes, 1)
    if planes > MOST:
        raise GeometryError(f"planes is {planes} but must be at most {MOST}.")
    low, high = float((1 / z).min()), float((1 / z).max())
    step = (high - low) / max(planes - 1, 1)
    number = np.round((1 / z - low) / step).astype(int) if step > 1e-9 * high else np.zeros(z.shape, int)
    places = (low + step * np.arange(planes) if planes > 1 else np.array([(low + high) / 2])).tolist()
    number = np.minimum(number, planes - 1)
    parts = []
    for k in np.unique(number).tolist():
        size = 1 / places[k] / camera.object_distance
        covered, sources = _going_on(number, k, places, grid, camera)
        seen = colours[sources] if behind is None else np.where(_like(number == k, colours), colours, under)
        shape = Grid(grid.shape, _times(grid.pitch, size), _times(grid.center, size))
        dz = 1 / places[k] - camera.object_distance
        parts.append(Slice(seen * _like(covered, seen), shape, dz, covered.astype(np.float32)))
    return Scene(parts)


def _distances(
    colours: np.ndarray, depths: np.ndarray, under: np.ndarray, grid: Grid, camera: Seeing
) -> np.ndarray:
    """Distances of the picture's samples to the main lens (y, x) [m]."""
    for name, shape in (("picture", colours.shape[:2]), ("depth", depths.shape), ("behind", under.shape[:2])):
        if shape != grid.shape:
            raise GeometryError(f"{name} has shape {shape} but the grid has {grid.shape}. Resample it.")
    if under.shape != colours.shape:
        raise GeometryError(f"behind has shape {under.shape} but the picture has {colours.shape}.")
    checks.finite_array("depth", depths, GeometryError)
    z = camera.object_distance + depths
    if z.min() <= 0:
        raise GeometryError(
            f"depth goes down to {depths.min() * 1e3:.4g} mm but the main lens stands at "
            f"{-camera.object_distance * 1e3:.4g} mm. Use depths in metres from the focused plane."
        )
    return z


def _going_on(
    number: np.ndarray, k: int, places: Sequence[float], grid: Grid, camera: Seeing
) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Mask of slice k (y, x), continued behind nearer slices, and indices of the colours to use there."""
    found: Any = distance_transform_edt(number != k, sampling=grid.pitch, return_indices=True)
    away, sources = found
    parallax = camera.pupil_diameter / 2 * camera.object_distance * (np.array(places)[number] - places[k])
    covered = (number == k) | ((number > k) & (away <= parallax + BESIDE * max(grid.pitch)))
    return covered, tuple(sources)


def _like(mask: np.ndarray, colours: np.ndarray) -> np.ndarray:
    return mask[..., None] if colours.ndim == 3 else mask


def _times(pair: tuple[float, float], factor: float) -> tuple[float, float]:
    return pair[0] * factor, pair[1] * factor
