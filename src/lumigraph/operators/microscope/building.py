"""A light-field microscope's operator from its description, with kernels that are kept in files."""

import hashlib
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from threading import Lock

import numpy as np

from lumigraph import store
from lumigraph.core import checks, memory
from lumigraph.core.grid import Grid
from lumigraph.core.linear import Linear
from lumigraph.core.progress import Progress
from lumigraph.core.threads import each
from lumigraph.elements.objective import Objective
from lumigraph.errors import FormatError, GeometryError, SamplingError, SamplingWarning
from lumigraph.operators.microscope.cell import CellSampling, Lenslet
from lumigraph.operators.microscope.far_light import FarCells
from lumigraph.operators.microscope.kernels import (
    SHARES,
    KernelAccuracy,
    SliceKernel,
    kernel_bytes,
    octant,
    require_window,
    slice_kernel,
)
from lumigraph.operators.microscope.pixels import FRAME
from lumigraph.operators.microscope.volume_operator import MicroscopeOperator, suits_frequencies
from lumigraph.units import um

VERSION = 10
"""Of the kernels' numbers: a change of theirs makes those that are kept useless."""


@dataclass(frozen=True, slots=True)
class SampledLenslets:
    """Lenslets that see the object, how finely they are sampled, and the pixels behind them.

    Parameters
    ----------
    seen
        Lenslets (rows, columns) before the object.
    sampling
        Of a cell.
    placement
        From samples, those of the frame too, to real pixels; None for N × N samples per cell.
    center
        Of the cells, in the object (y, x) [m].
    """

    seen: tuple[int, int]
    sampling: CellSampling
    placement: Linear | None = None
    center: tuple[float, float] = (0.0, 0.0)

    @property
    def frame(self) -> int:
        """Lenslets around those that are seen, to each side: pixels at the border see some of their light."""
        return 0 if self.placement is None else FRAME

    @property
    def cells(self) -> tuple[int, int]:
        """Lenslets whose light is followed."""
        return self.seen[0] + 2 * self.frame, self.seen[1] + 2 * self.frame


def microscope_operator(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    layout: SampledLenslets,
    depths: Sequence[float] | None = None,
    *,
    accuracy: float = 1e-3,
    folder: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> MicroscopeOperator:
    """Operator from slices at `depths` to a raw image.

    Parameters
    ----------
    objectives
        One for each wavelength.
    lenslet, layout
        The array and the pixels.
    depths
        Of the slices from the focused plane [m], positive farther from the objective, for an object
        (z, y, x); None for the focused plane alone, an object (y, x).
    accuracy
        Relative rms of points' images.
    folder
        Keeps the kernels in files that are mapped into memory, and finds again those that are there: for
        volumes whose kernels do not fit in memory, and for the next run.
    progress
        Called as ``progress(fraction)`` after each slice.

    Raises
    ------
    SamplingError
        The kernels do not fit in memory and no folder is given, or not on its disk.
    GeometryError
        No depths, one that is not finite, or depths that are not in order.
    FormatError
        A folder that cannot be made.
    """
    planes = (0.0,) if depths is None else tuple(checks.finite("a depth", dz) for dz in depths)
    _check_order(planes)
    demand = KernelAccuracy(require_accuracy(accuracy), math.ceil(1.5 * max(layout.cells)))
    for one in objectives:
        require_window(one, lenslet, layout.sampling, max(planes, key=abs), demand, layout.sampling.points)
    sizes = [kernel_bytes(objectives[0], lenslet, layout.sampling, dz, demand) for dz in planes]
    stored = 1 if folder is None else 0
    worked_on = max(sizes) * min(len(sizes) + 1, 3)  # the one before is being written
    needed = worked_on + stored * sum(sizes) * (0.25 if objectives[0].is_round else 1)
    remedy = "Use fewer slices or samples, or folder= to keep them on disk."
    memory.require(needed, f"the images of points at {len(planes)} depths", remedy, SamplingError)
    if folder is not None:
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FormatError(f"folder {folder} cannot be made ({error.strerror}). Give another.") from error
        share = len(octant(layout.sampling.points)) / layout.sampling.classes if objectives[0].is_round else 1
        memory.require_disk(sum(sizes) * share, folder, "the images of points", SamplingError)
    kernels, turn = [], Lock()

    def kept(dz: float) -> SliceKernel:
        return _kept(objectives, lenslet, layout.sampling, dz, demand, folder, turn)

    for done, kernel in enumerate(each(kept, planes, 2)):
        kernels.append(kernel)
        if progress is not None:
            progress((done + 1) / len(planes))
    _warn_if_missed(kernels, planes, accuracy)
    left_out = 0.0 if objectives[0].model == "rays" else SHARES["patterns"] * accuracy
    return MicroscopeOperator(
        tuple(kernels), layout.cells, layout.placement, -layout.frame,
        suits_frequencies(kernels, layout.cells, -layout.frame, left_out), left_out,
        object_grid=points_grid(lenslet, layout), depths=None if depths is None else planes,
        resolved_pitch=min(one.wavelength / (4 * one.numerical_aperture) for one in objectives),
    )  # fmt: skip


def _warn_if_missed(kernels: Sequence[SliceKernel], planes: Sequence[float], accuracy: float) -> None:
    worst = max(range(len(planes)), key=lambda k: kernels[k].error)
    if kernels[worst].error > accuracy:
        warnings.warn(
            f"an accuracy of {accuracy:g} was asked for but points' images at {planes[worst] / um:g} um are "
            f"off by some {kernels[worst].error:.2g} rms. Ask for a smaller one, or take it as it is.",
            SamplingWarning,
            stacklevel=4,  # whoever asked a microscope
        )


def require_accuracy(accuracy: float) -> float:
    """A relative rms that can be asked for, or an error."""
    if not 1e-5 <= checks.finite("accuracy", accuracy, "1") <= 0.1:
        raise GeometryError(f"accuracy is {accuracy:g} but must be from 1e-5 to 0.1.")
    return accuracy


def _check_order(depths: tuple[float, ...]) -> None:
    if not depths:
        raise GeometryError("there are no depths. Give at least one, such as 0.0 for the focused plane.")
    steps = np.diff(depths)
    if len(steps) and not ((steps > 0).all() or (steps < 0).all()):
        raise GeometryError("depths must ascend or descend, and differ. Sort them, and leave out duplicates.")


def points_grid(lenslet: Lenslet, layout: SampledLenslets, margin: int = 0) -> Grid:
    """Points in the object of the lenslets that are seen, and of a margin of so many more on all sides."""
    s = layout.sampling.points
    shape = ((layout.seen[0] + 2 * margin) * s, (layout.seen[1] + 2 * margin) * s)
    pitch = lenslet.pitch / lenslet.magnification / s
    # Cells are centred as a whole: with an even number of samples the middle lies between two.
    center = [c + (0.0 if n % 2 else pitch / 2) for c, n in zip(layout.center, shape, strict=True)]
    return Grid(shape, (pitch, pitch), (center[0], center[1]))


def _kept(
    objectives: Sequence[Objective],
    lenslet: Lenslet,
    sampling: CellSampling,
    dz: float,
    demand: KernelAccuracy,
    folder: str | PathLike[str] | None,
    turn: Lock,
) -> SliceKernel:
    """The kernel of a depth, mapped from its file in the folder, or in the user's cache.

    One is computed at a time, while the one before is written.
    """
    told = repr((VERSION, tuple(objectives), lenslet, sampling, dz, demand))
    key = f"slice-{hashlib.sha256(told.encode()).hexdigest()[:20]}"

    def built() -> dict[str, np.ndarray]:
        with turn:
            kernel = slice_kernel(objectives, lenslet, sampling, dz, demand)
        held = {"offsets": kernel.offsets, "blocks": kernel.blocks}
        if kernel.far is not None:
            held |= {f"far_{name}": getattr(kernel.far, name) for name in ("offsets", "weights", "images")}
        return held | {"told": np.array([kernel.error, kernel.passed])}

    found = store.kept(key, built, None if folder is None else Path(folder))
    symmetric = all(one.is_round for one in objectives)
    far = (
        FarCells(found["far_offsets"], found["far_weights"], found["far_images"])
        if "far_images" in found
        else None
    )
    error, passed = (float(value) for value in found["told"])
    offsets = np.array(found["offsets"])  # a mapped file takes a microsecond for each look at it
    return SliceKernel(offsets, found["blocks"], sampling, symmetric, far, error, passed)
