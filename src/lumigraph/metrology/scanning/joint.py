"""Operators of several raw images of one object: scanned light fields, and cameras beside each other."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from lumigraph.core import checks, upper_floors
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.joint import Joint
from lumigraph.core.linear import Linear
from lumigraph.core.progress import Progress, part
from lumigraph.errors import GeometryError
from lumigraph.instruments.camera import Camera
from lumigraph.instruments.capabilities import WithMainLens
from lumigraph.instruments.instrument import Instrument
from lumigraph.operators.sampling.regrid import on_grid

Shift = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Maker:
    """Factory of operators for an object on any grid, and its own grid."""

    grid: Grid
    on: Callable[[Grid], Linear]

    @classmethod
    def of(cls, operator: Linear) -> "Maker":
        """Factory from an operator that knows its grid, resampled onto others."""
        if operator.object_grid is None:
            raise GeometryError("the operator does not know where its object stands.")
        return cls(operator.object_grid, lambda grid: on_grid(operator, grid))


def scan(steps: int, period: float | Sequence[float]) -> np.ndarray:
    """Shifts (steps², 2) as (y, x) [m] that divide a period evenly, about (0, 0).

    Parameters
    ----------
    steps
        Along each axis.
    period
        Divided period (y, x) [m]: a lenslet's pitch where the array moves, ``camera.lenslet_size`` where the
        object does.

    Raises
    ------
    GeometryError
        Fewer than one step, or a period that is not above zero.

    Examples
    --------
    >>> scan(3, 150e-6)[:3].round(9).tolist()
    [[-5e-05, -5e-05], [-5e-05, 0.0], [-5e-05, 5e-05]]
    """
    checks.whole("steps", steps)
    height, width = (checks.positive("period", p) for p in checks.pair("period", period))
    at = (np.arange(steps) - (steps - 1) / 2) / steps
    return np.stack([a.ravel() for a in np.meshgrid(at * height, at * width, indexing="ij")], axis=-1)


def joint_operator(
    cameras: Instrument | Sequence[Instrument] | str | PathLike[str],
    depths: Sequence[float] | None = None,
    samples_per_lenslet: int | None = None,
    *,
    shifts: Sequence[Sequence[float]] | np.ndarray | None = None,
    grid: Grid | None = None,
    accuracy: float = 1e-3,
    progress: Progress | None = None,
) -> Joint:
    """The model of several raw images of one object, for `lumigraph.deconvolve` with a list of them.

    The object is sampled on one grid, which holds what any of the raw images shows of it, as finely as the
    finest of the cameras' own.

    Parameters
    ----------
    cameras
        One for each raw image, or one that took all of them. Where a lenslet array was moved, the cameras
        ``camera.replace(lenslets={"offset": shift})``; beside a light field any other camera that saw the
        same, such as one without lenslets.
    depths, samples_per_lenslet, accuracy
        As for ``camera.operator``. Depths count from the first camera's focused plane; main lenses stand at
        one place.
    shifts
        Displacements of the object (k, 2) as (y, x) [m], one for each raw image; None where it did not move.
    grid
        Grid of the object; None for the one described above.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    GeometryError
        No cameras, shifts that are not finite or not one for each, cameras of which only some have a main
        lens, or cameras focused at several distances without depths.
    SamplingError
        As ``camera.operator``.

    References
    ----------
    J. Wu et al., "Iterative tomography with digital adaptive optics permits hour-long intravital observation
    of 3D subcellular dynamics at millisecond scale", Cell 184, 3318 (2021), for scanned microscopes.

    Examples
    --------
    ``lg.deconvolve(raws, lg.joint_operator(camera, shifts=shifts))``
    """
    cameras = upper_floors.camera(cameras)
    moved = pairs_of(shifts, None if isinstance(cameras, Instrument) else len(cameras))
    some = [cameras] * len(moved) if isinstance(cameras, Instrument) else list(cameras)
    for camera in some:
        checks.instance("a camera", camera, Instrument)
    makers = _makers(some, depths, samples_per_lenslet, accuracy, progress)
    return joined(makers, moved, grid)


def joint_operator_for(
    camera: Instrument,
    calibration: Calibration | None,
    shifts: Sequence[Shift],
    depths: Sequence[float] | None = None,
    samples_per_lenslet: int | None = None,
    progress: Progress | None = None,
) -> Joint:
    """Joint operator as of `joint_operator`, on a real camera's pixels as in `Instrument.operator_for`."""
    if isinstance(camera, Camera):
        return joint_operator(camera, depths, samples_per_lenslet, shifts=shifts, progress=progress)
    own = camera.operator_for(calibration, depths, samples_per_lenslet, progress)
    return joined([Maker.of(own)] * len(shifts), shifts)


def joined(makers: Sequence[Maker], shifts: Sequence[Shift], grid: Grid | None = None) -> Joint:
    """Operators of one object, which was moved by each of the shifts; on `common_grid` if none is given."""
    if grid is None:
        grid = common_grid([maker.grid for maker in makers], shifts)
    maps = []
    for maker, (dy, dx) in zip(makers, shifts, strict=True):
        y, x = grid.center
        maps.append(replace(maker.on(Grid(grid.shape, grid.pitch, (y + dy, x + dx))), object_grid=grid))
    depths = next((one.depths for one in maps if one.depths is not None), None)
    maps = [one if one.depths is None else replace(one, depths=depths) for one in maps]
    return Joint(tuple(maps), object_grid=grid, depths=depths)


def common_grid(grids: Sequence[Grid], shifts: Sequence[Shift]) -> Grid:
    """Samples that hold what each raw image shows of an object that was moved, as fine as the finest.

    They coincide with those of the first of the finest grids.
    """
    finest = min(range(len(grids)), key=lambda k: max(grids[k].pitch))
    shape, center = [], []
    for axis in (0, 1):
        step, mine = grids[finest].pitch[axis], (grids[finest].y, grids[finest].x)[axis]
        low, high = mine[0] - shifts[finest][axis], mine[-1] - shifts[finest][axis]
        firsts, lasts = [], []
        for g, shift in zip(grids, shifts, strict=True):
            positions, wider = (g.y, g.x)[axis], (g.pitch[axis] - step) / 2
            firsts.append(float(positions[0]) - shift[axis] - wider)
            lasts.append(float(positions[-1]) - shift[axis] + wider)
        before = math.ceil((low - min(firsts)) / step - 1e-6)
        after = math.ceil((max(lasts) - high) / step - 1e-6)
        count = len(mine) + before + after
        shape.append(count)
        center.append(low + (count // 2 - before) * step)
    return Grid((shape[0], shape[1]), grids[finest].pitch, (center[0], center[1]))


def _makers(
    cameras: Sequence[Instrument],
    depths: Sequence[float] | None,
    samples: int | None,
    accuracy: float,
    progress: Progress | None,
) -> list[Maker]:
    focused = [camera.object_distance for camera in cameras if isinstance(camera, WithMainLens)]
    if 0 < len(focused) < len(cameras):
        raise GeometryError("some cameras have a main lens and some an objective: depths mean other things.")
    if focused and depths is None and max(focused) - min(focused) > 1e-9 * focused[0]:
        raise GeometryError(
            f"the cameras are focused at {min(focused)} to {max(focused)} m. Give depths, which count from "
            "the first camera's focused plane."
        )
    kept: dict[int, Maker] = {}
    found = []
    for number, camera in enumerate(cameras):
        told = part(progress, number, len(cameras))
        if id(camera) not in kept:
            kept[id(camera)] = _maker(camera, cameras[0], depths, samples, accuracy, told)
        found.append(kept[id(camera)])
    return found


def _maker(
    camera: Instrument,
    first: Instrument,
    depths: Sequence[float] | None,
    samples: int | None,
    accuracy: float,
    progress: Progress,
) -> Maker:
    if isinstance(camera, Camera) and isinstance(first, WithMainLens):
        nearer = first.object_distance - camera.object_distance
        planes = None if depths is None else tuple(dz + nearer for dz in depths)
        count = samples if camera.calibration is not None else None

        def on(grid: Grid) -> Linear:
            return camera.operator_on(grid, planes, accuracy=accuracy, progress=progress)

        return Maker(camera.operator_grid(count), on)
    own = camera.operator(depths, samples, accuracy=accuracy, progress=progress)  # type: ignore[attr-defined]
    return Maker.of(own)


def pairs_of(shifts: Sequence[Sequence[float]] | np.ndarray | None, count: int | None) -> list[Shift]:
    """Pairs (y, x) [m], one for each raw image."""
    if shifts is None:
        if not count:
            raise GeometryError("there is one camera and no shifts. Give shifts=, or a list of cameras.")
        return [(0.0, 0.0)] * count
    try:
        pairs: np.ndarray = np.asarray(shifts, np.float64)
    except (TypeError, ValueError):
        pairs = np.zeros((0, 2))
    if pairs.ndim != 2 or pairs.shape[-1] != 2 or not len(pairs) or not np.isfinite(pairs).all():
        raise GeometryError(
            f"shifts have shape {pairs.shape} but must be finite pairs (y, x) [m], one for each raw image."
        )
    if count not in (None, len(pairs)):
        raise GeometryError(f"there are {len(pairs)} shifts for {count} cameras. Give one for each.")
    return [(float(pair[0]), float(pair[1])) for pair in pairs]
