"""Parts of a scene behind opaque slices: what these hide, and how far off that is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lumigraph.core import arrays
from lumigraph.core.progress import Progress
from lumigraph.core.progress import part as share_of
from lumigraph.errors import GeometryError
from lumigraph.operators import CameraOptics
from lumigraph.operators.lenslets import points
from lumigraph.operators.periodic import partial_occlusion
from lumigraph.operators.periodic.incoherent import PeriodicOperator, periodic_operator
from lumigraph.operators.periodic.screens import Screen
from lumigraph.operators.sampling import field_lenses
from lumigraph.scene import Points, Scene, Slice
from lumigraph.simulation import error
from lumigraph.simulation.camera import ImagedCamera
from lumigraph.simulation.coherence import Incoherent

OFF = 0.01
"""Relative rms error of what is hidden in part; by `benchmarks.hiding` it is 2.2e-3 to 5.2e-3."""

SOURCE = "points hidden in part"


def screens_of(scene: Scene, camera: ImagedCamera, coherence: object) -> list[Screen]:
    """The slices that hide something.

    Raises
    ------
    GeometryError
        Light that interferes, a camera without lenslets, or a lens that changes over the field.
    """
    opaque = [part for part in scene.parts if isinstance(part, Slice) and part.hides]
    if not opaque:
        return []
    if not isinstance(coherence, Incoherent):
        raise GeometryError(
            f"a slice at {opaque[0].dz * 1e3:.4g} mm is opaque but coherence is {coherence!r}: what hides "
            "what is known of incoherent light. Leave coherence out, or the opacity."
        )
    if camera.lattice is None:
        raise GeometryError(
            f"a slice at {opaque[0].dz * 1e3:.4g} mm is opaque but the camera has no lenslets: what hides "
            "what is known of cameras with lenslets. Leave the opacity out, or use a plenoptic camera."
        )
    field_lenses.check_one(camera.optics())
    return [
        Screen(part.opacity, part.grid, camera.object_distance + part.dz)
        for part in opaque
        if part.opacity is not None
    ]


def hidden_image(
    camera: CameraOptics, part: Slice | Points, accuracy: float, progress: Progress, screens: Sequence[Screen]
) -> tuple[np.ndarray, error.ReachedError]:
    """Raw image (ny, nx) of a part behind the screens that are nearer, and how far off it is."""
    camera = replace(camera, model="paraxial")
    if isinstance(part, Points):
        return _points_image(camera, part, accuracy, progress, screens)
    part = part.trimmed()
    nearer = _nearer(screens, camera.object_distance + part.dz)
    operator = periodic_operator(
        camera, part.grid, part.dz, accuracy=accuracy, progress=share_of(progress, 0, 2)
    )
    assert isinstance(operator, PeriodicOperator)  # a paraxial one is the same over the field
    intensity = arrays.to_numpy(part.intensity).astype(np.float32)
    reached = error.beside(error.of_operator(intensity, accuracy, camera), camera, 0.0).through(camera)
    if not nearer:
        return operator.forward(intensity), reached
    told = share_of(progress, 1, 2)
    whole, parts = partial_occlusion.plane_image(operator, camera, part.dz, intensity, nearer, told)
    return _both(whole, reached, parts, camera)


def _points_image(
    camera: CameraOptics, part: Points, accuracy: float, progress: Progress, screens: Sequence[Screen]
) -> tuple[np.ndarray, error.ReachedError]:
    """Depth by depth; points that nothing nearer could hide are as exact as asked."""
    depths = part.positions[:, 2]
    free = min(screen.distance for screen in screens) - camera.object_distance >= depths
    before = Points(part.positions[free], part.intensities[free])
    whole, off = points.image_and_error(camera, before, accuracy)
    reached = error.beside(error.of_points(off, accuracy), camera, 0.0).through(camera)
    behind, parts = np.unique(depths[~free]), np.zeros_like(whole)
    for k, dz in enumerate(behind):
        mine = depths == dz
        some = Points(part.positions[mine], part.intensities[mine])
        nearer = _nearer(screens, camera.object_distance + float(dz))
        parts += partial_occlusion.points_image(camera, some, nearer, share_of(progress, k, len(behind)))
    return _both(whole, reached, parts, camera)


def _both(
    whole: np.ndarray, reached: error.ReachedError, parts: np.ndarray, camera: CameraOptics
) -> tuple[np.ndarray, error.ReachedError]:
    """The image of points seen in full and of those hidden in part, and how far off it is."""
    if not parts.any():
        return whole, reached
    of_parts = error.ReachedError(OFF, SOURCE).through(camera)
    both = error.together([(error.norm(whole), reached), (error.norm(parts), of_parts)])
    assert both is not None  # of two
    return whole + parts, both


def _nearer(screens: Sequence[Screen], distance: float) -> list[Screen]:
    return [screen for screen in screens if screen.distance < distance]
