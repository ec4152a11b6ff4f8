"""Sizes of the pieces of micro-images that tile a plenoptic 2.0 picture, and where its samples stand."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.errors import GeometryError
from lumigraph.rendering.geometry import largest_rectangle, lenslet_rectangle


def lenslet_indices(calibration: Calibration) -> np.ndarray:
    """Indices (rows, cols, 2) as (i, j) of the lenslets that a map of patches stands for.

    They are those with whole micro-images; lenslets outside take the nearest one's patch. In a hexagonal
    lattice every other row stands half a pitch to the right.
    """
    half = calibration.lattice.pitches[0] / 2, calibration.lattice.pitches[1] / 2
    return lenslet_rectangle(calibration, half, half)


@dataclass(frozen=True, slots=True)
class Patches:
    """Patch sizes [px]: one, or one for each lenslet of a rectangle."""

    values: np.ndarray
    first: tuple[int, int] = (0, 0)
    hexagonal: bool = False

    @classmethod
    def of(cls, patch: float | Array, calibration: Calibration) -> "Patches":
        """Patch sizes as the user gave them, refused where no micro-image can have them."""
        try:
            values = np.asarray(to_numpy(patch) if hasattr(patch, "shape") else patch, float)
        except (TypeError, ValueError):
            values = np.zeros(0)
        if values.size == 0 or patch is None or isinstance(patch, bool | str):
            raise GeometryError(f"patch is {patch!r} but must be a size in pixels, or a map of sizes.")
        check_sizes("patch", values, calibration)
        if values.ndim == 0:
            return cls(values)
        indices = lenslet_indices(calibration)
        if values.shape != indices.shape[:2]:
            raise GeometryError(
                f"the map of patches has shape {values.shape} but {indices.shape[:2]} lenslets (rows, cols) "
                "have whole micro-images. Make one size for each of lenslet_indices(calibration)."
            )
        hexagonal = calibration.lattice.layout == "hex"
        i, j = (int(k) for k in indices[0, 0])
        return cls(values, (i, j + i // 2 if hexagonal else j), hexagonal)

    @property
    def middle(self) -> float:
        """The median."""
        return float(np.median(self.values))

    @property
    def largest(self) -> float:
        """The largest size, without its sign."""
        return float(np.abs(self.values).max())

    def at(self, i: np.ndarray, j: np.ndarray) -> np.ndarray | float:
        """Patch size of lenslets of index (i, j)."""
        if self.values.ndim == 0:
            return float(self.values)
        row, column = i - self.first[0], (j + i // 2 if self.hexagonal else j) - self.first[1]
        rows, columns = self.values.shape
        return self.values[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]

    def between(self, i: np.ndarray, j: np.ndarray) -> np.ndarray | float:
        """Patch size at places of fractional index (i, j), linear between the lenslets of two rows."""
        if self.values.ndim == 0:
            return float(self.values)
        along = j + i / 2 if self.hexagonal else j
        below = np.floor(i).astype(np.int64)
        total = np.zeros(np.broadcast(i, j).shape)
        for row in (below, below + 1):
            start = np.mod(row, 2) / 2 if self.hexagonal else 0.0
            column = along - start - self.first[1]
            left = np.floor(column).astype(np.int64)
            inside = np.clip(row - self.first[0], 0, self.values.shape[0] - 1)
            columns = (np.clip(left + k, 0, self.values.shape[1] - 1) for k in (0, 1))
            first, second = (self.values[inside, k] for k in columns)
            share = column - left
            total += (1 - np.abs(i - row)) * (first * (1 - share) + second * share)
        return total


def check_sizes(name: str, values: np.ndarray, calibration: Calibration) -> None:
    """Refuse sizes [px] of 0, NaN or above the pitch."""
    pitch = calibration.lattice.pitch
    checks.finite_array(name, values, GeometryError)
    smallest, largest = float(np.abs(values).min()), float(np.abs(values).max())
    if smallest == 0 or largest > pitch * (1 + 1e-6):
        shown = 0.0 if smallest == 0 else largest
        raise GeometryError(
            f"{name} is {shown:g} px but must be above 0 and at most the micro-images' pitch, {pitch:.4g} px "
            "(below 0 for a Galilean camera). Its size is m p z2 / L in pixels."
        )


def checked_focus(focus: Sequence[float] | None, calibration: Calibration) -> np.ndarray | None:
    """The patches [px] (kinds,) at which each kind of lenslets is sharp.

    Raises
    ------
    GeometryError
        Another number of patches than the lattice has kinds of lenslets, or sizes that no patch can have.
    """
    if focus is None:
        return None
    kinds = calibration.lattice.kinds
    if not isinstance(focus, Sequence | np.ndarray) or isinstance(focus, str) or np.shape(focus) != (kinds,):
        raise GeometryError(
            f"focus is {focus!r} but the lattice has {kinds} kind{'s' if kinds > 1 else ''} of lenslets. "
            "Give one patch [px] for each, at which it is sharp."
        )
    values = np.array([checks.finite("focus", value, "px") for value in focus])
    check_sizes("focus", values, calibration)
    return values


def sharp_patches(
    calibration: Calibration, virtual_depths: Sequence[tuple[float, float]]
) -> tuple[float, ...]:
    """Patches [px] at which three kinds of lenslets are sharp, for ``render(focus=...)``.

    Virtual depth v is the distance of a Galilean camera's main-lens image behind the lenslets over b, so that
    the patch is -P/v. Ranges that meet are those of equal blur, `|patch - sharp patch|` of both kinds.

    Parameters
    ----------
    calibration
        Of the camera.
    virtual_depths
        Nearest and farthest virtual depth of each kind, in the order of `lattice.kind`, as the calibration
        files of multi-focus cameras give them.

    Raises
    ------
    GeometryError
        Another number of ranges than kinds, or depths that do not ascend from above 0.

    Examples
    --------
    >>> import numpy as np
    >>> none = np.zeros((0, 2))
    >>> from lumigraph.core.lattice import Lattice
    >>> calibration = Calibration(Lattice.hex(36.0, kinds=3), (400, 400), none, none, 0.0)
    >>> sharp_patches(calibration, [(1, 3), (3, 4), (4, 100)])
    (-13.5, -10.5, -7.5)
    """
    kinds, pitch = calibration.lattice.kinds, calibration.lattice.pitch
    ranges = np.asarray(virtual_depths, float)
    if ranges.shape != (kinds, 2) or kinds != 3:
        raise GeometryError(
            f"virtual_depths has shape {ranges.shape} for a lattice of {kinds} kinds of lenslets. "
            "Give (nearest, farthest) for each of three kinds."
        )
    checks.finite_array("virtual_depths", ranges, GeometryError)
    order = np.argsort(ranges[:, 0])
    ends = ranges[order]
    if (ranges[:, 0] <= 0).any() or (np.diff(ends, axis=1) <= 0).any():
        raise GeometryError(f"virtual_depths are {ranges.tolist()} but must ascend from above 0.")
    near, far = (pitch * 2 / (ends[k, 1] + ends[k + 1, 0]) for k in (0, 1))
    middle = (near + far) / 2
    sharp = np.clip([2 * near - middle, middle, 2 * far - middle], 0.01 * pitch, pitch)
    return tuple(-float(sharp[int(np.flatnonzero(order == kind)[0])]) for kind in range(kinds))


@dataclass(frozen=True, slots=True)
class PatchLayout:
    """Places of the picture's rows and columns in the lattice of micro-image centres [px]."""

    y: np.ndarray
    x: np.ndarray
    step: float

    @classmethod
    def of(cls, calibration: Calibration, sizes: Patches, samples: int | None) -> "PatchLayout":
        """Samples of lenslets whose patch lies on the sensor; one of them would be on the optical axis."""
        lattice = calibration.lattice
        if samples is None:
            samples = max(1, round(abs(sizes.middle)))
        checks.shape("samples", (samples, samples))
        step = lattice.pitch / samples
        memory.require(
            40.0 * math.prod(calibration.shape) / step**2,
            f"a picture of {samples} samples per lenslet",
            "Ask for {factor:.1f}x fewer samples.",
        )
        axes = []
        for n in calibration.shape:
            first, last = math.ceil(-(n // 2) / step), math.floor((n - 1 - n // 2) / step)
            axes.append(n // 2 + np.arange(first, last + 1) * step)
        i, j = lattice.index(axes[0][:, None], axes[1][None, :])
        centers = calibration.position(np.stack([i, j], -1))
        half = sizes.largest / 2
        whole = np.ones(i.shape, bool)
        for axis, n in enumerate(calibration.shape):
            whole &= (centers[..., axis] - half >= -1) & (centers[..., axis] + half <= n)
        top, bottom, left, right = largest_rectangle(whole)
        if bottom <= top or right <= left:
            raise GeometryError(
                f"no patch of {sizes.largest:g} px lies wholly on the sensor of {calibration.shape[0]} x "
                f"{calibration.shape[1]} px. Use a smaller patch or the whole sensor's picture."
            )
        return cls(axes[0][top:bottom], axes[1][left:right], step)

    def part(self, rows: slice, columns: slice = slice(None)) -> "PatchLayout":
        """Some of its rows and columns."""
        return replace(self, y=self.y[rows], x=self.x[columns])
