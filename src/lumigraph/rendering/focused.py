"""Plenoptic 2.0 pictures: every micro-image's patch, turned and tiled without seams."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, namespace, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.errors import GeometryError
from lumigraph.rendering.decode import check_raw
from lumigraph.rendering.geometry import Frame, largest_rectangle, lenslet_rectangle
from lumigraph.rendering.interpolate import Interpolation, as_float, check_interpolation, sample, weighted

_BAND = 1 << 20  # picture samples handled at a time


def render(
    raw: RawImage | Array,
    calibration: Calibration,
    patch: float | Array,
    *,
    samples: int | None = None,
    blend: bool = False,
    interpolation: Interpolation = "cubic",
) -> Array:
    r"""Picture (y, x[, c]) of the main image plane behind a plenoptic 2.0 raw image.

    The micro-image centred at C shows the main image at X = c z2/L, and around it a copy m times as large,
    turned by 180° (Keplerian) or not (Galilean). For each sample of the picture the lenslet whose cell
    holds it is found, and the raw image is read at

    .. math:: C - \frac{patch}{P} (Y - C),

    where Y is the sample's place in the lattice of centres of pitch P. Tiles meet without seams for a patch
    of any size, whole or not, on square, hexagonal and turned lattices. The picture's axes are the raw
    image's: a turned lattice does not turn the picture.

    Parameters
    ----------
    raw
        Pixels (y, x[, c]). Whole numbers become float32.
    calibration
        Of the same camera.
    patch
        Size of one tile on the sensor, m p z2 / L [px]: above 0 Keplerian, below 0 Galilean; or one size for
        each lenslet, (rows, cols) of `lenslet_indices`, for scenes of several depths.
    samples
        Samples of the picture per lenslet; the patch size to the nearest whole number where None.
    blend
        Take the mean of all micro-images that show a place, weighted by a window about their centres, instead
        of the nearest one: less noise and softer seams where the depth is not right.
    interpolation
        "cubic" or "linear", between the raw image's pixels.

    Raises
    ------
    GeometryError
        A patch of 0, NaN, larger than a micro-image, or a map of another shape than the lenslets.
    CalibrationError
        The raw image has another size than the white image, NaN, or a Bayer pattern.
    LumigraphError
        It would not fit in memory.

    References
    ----------
    Georgiev and Lumsdaine, "Focused plenoptic camera and rendering", J. Electron. Imaging 19, 021106 (2010).

    Examples
    --------
    >>> import numpy as np
    >>> lattice = Lattice.square(10.0, origin=(5, 5))
    >>> none = np.zeros((0, 2))
    >>> render(np.ones((40, 60)), Calibration(lattice, (40, 60), none, none, 0.0), 5.2).shape
    (19, 29)
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_interpolation(interpolation)
    check_raw(raw, calibration)
    sizes = _patches(patch, calibration)
    layout = _Layout.of(calibration, sizes, samples)
    data = as_float(raw.data)
    memory.require(
        16.0 * len(layout.y) * len(layout.x) * math.prod(data.shape[2:]),
        f"a picture of {len(layout.y)} x {len(layout.x)} samples",
        "Ask for {factor:.1f}x fewer samples.",
    )
    band = max(1, _BAND // len(layout.x))
    source = _blended if blend else _nearest
    parts = []
    for k in range(0, len(layout.y), band):
        y, x = np.meshgrid(layout.y[k : k + band], layout.x, indexing="ij")
        total = None
        for places, weight in source(y, x, calibration, sizes):
            term = sample(data, places[0], places[1], interpolation)
            term = term if weight is None else weighted(term, weight, len(data.shape) - 2)
            total = term if total is None else total + term
        parts.append(total)
    return namespace(data).concat(parts, axis=0)


def rendered_grid(calibration: Calibration, patch: float | Array, samples: int | None = None) -> Grid:
    """Where the samples of a rendered picture lie in the main image [m].

    X = c z2 / L, with z2 / L from the patch: 1 - a/L, and a = b / (m z2/L + b/L). Where the calibration's
    pixel pitch, separation L or lenslet distance b is unknown, one lenslet's tile is 1.

    Parameters
    ----------
    calibration, patch, samples
        As given to `render`; of a map of patches, the median counts.

    Examples
    --------
    >>> import numpy as np
    >>> none = np.zeros((0, 2))
    >>> calibration = Calibration(Lattice.square(10.0, origin=(5, 5)), (40, 60), none, none, 0.0)
    >>> rendered_grid(calibration, 5.2).pitch
    (0.2, 0.2)
    """
    sizes = _patches(patch, calibration)
    layout = _Layout.of(calibration, sizes, samples)
    frame, scale = Frame.of(calibration), 1 / calibration.lattice.pitch
    pixel, distance, separation = (
        calibration.pixel_pitch,
        calibration.lenslet_distance,
        calibration.separation,
    )
    if pixel and distance and separation:
        magnified = sizes.middle / calibration.lattice.pitch * (1 + distance / separation)  # m z2 / L
        image_distance = distance / (magnified + distance / separation)
        scale = frame.lenslet_per_px * (1 - image_distance / separation)
    middle = layout.y[len(layout.y) // 2], layout.x[len(layout.x) // 2]
    center = [(place - axis) * scale for place, axis in zip(middle, frame.axis, strict=True)]
    pitch = layout.step * scale
    return Grid((len(layout.y), len(layout.x)), (pitch, pitch), (float(center[0]), float(center[1])))


def lenslet_indices(calibration: Calibration) -> np.ndarray:
    """Indices (rows, cols, 2) as (i, j) of the lenslets that a map of patches stands for.

    They are those with whole micro-images; lenslets outside take the nearest one's patch. In a hexagonal
    lattice every other row stands half a pitch to the right.
    """
    half = calibration.lattice.pitches[0] / 2, calibration.lattice.pitches[1] / 2
    return lenslet_rectangle(calibration, half, half)


@dataclass(frozen=True, slots=True)
class _Patches:
    """Patch sizes [px]: one, or one for each lenslet of a rectangle."""

    values: np.ndarray
    first: tuple[int, int] = (0, 0)
    hexagonal: bool = False

    @property
    def middle(self) -> float:
        return float(np.median(self.values))

    @property
    def largest(self) -> float:
        return float(np.abs(self.values).max())

    def at(self, i: np.ndarray, j: np.ndarray) -> np.ndarray | float:
        """Patch size of lenslets of index (i, j)."""
        if self.values.ndim == 0:
            return float(self.values)
        column = j + i // 2 if self.hexagonal else j
        rows, columns = self.values.shape
        row, column = i - self.first[0], column - self.first[1]
        return self.values[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]


def _patches(patch: float | Array, calibration: Calibration) -> _Patches:
    try:
        values = np.asarray(to_numpy(patch) if hasattr(patch, "shape") else patch, float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.size == 0 or patch is None or isinstance(patch, bool | str):
        raise GeometryError(f"patch is {patch!r} but must be a size in pixels, or a map of sizes.")
    pitch = calibration.lattice.pitch
    checks.finite_array("patch", values, GeometryError)
    smallest, largest = float(np.abs(values).min()), float(np.abs(values).max())
    if smallest == 0 or largest > pitch * (1 + 1e-6):
        shown = 0.0 if smallest == 0 else largest
        raise GeometryError(
            f"patch is {shown:g} px but must be above 0 and at most the micro-images' pitch, {pitch:.4g} px "
            "(below 0 for a Galilean camera). Its size is m p z2 / L in pixels."
        )
    if values.ndim == 0:
        return _Patches(values)
    indices = lenslet_indices(calibration)
    if values.shape != indices.shape[:2]:
        raise GeometryError(
            f"the map of patches has shape {values.shape} but {indices.shape[:2]} lenslets (rows, cols) have "
            "whole micro-images. Make one size for each of lenslet_indices(calibration)."
        )
    hexagonal = calibration.lattice.layout == "hex"
    i, j = (int(k) for k in indices[0, 0])
    return _Patches(values, (i, j + i // 2 if hexagonal else j), hexagonal)


@dataclass(frozen=True, slots=True)
class _Layout:
    """Places of the picture's rows and columns in the lattice of micro-image centres [px]."""

    y: np.ndarray
    x: np.ndarray
    step: float

    @classmethod
    def of(cls, calibration: Calibration, sizes: _Patches, samples: int | None) -> "_Layout":
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
        centers = lattice.position(np.stack([i, j], -1))
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


_Source = Iterator[tuple[tuple[np.ndarray, np.ndarray], np.ndarray | None]]


def _nearest(y: np.ndarray, x: np.ndarray, calibration: Calibration, sizes: _Patches) -> _Source:
    """Where on the sensor (y, x) each sample is seen by the lenslet whose cell holds it."""
    i, j = calibration.lattice.index(y, x)
    yield _seen(y, x, calibration.lattice, sizes, i, j), None


def _seen(
    y: np.ndarray, x: np.ndarray, lattice: Lattice, sizes: _Patches, i: np.ndarray, j: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    center = np.moveaxis(lattice.position(np.stack([i, j], -1)), -1, 0)
    ratio = sizes.at(i, j) / lattice.pitch
    return center[0] - ratio * (y - center[0]), center[1] - ratio * (x - center[1])


def _blended(y: np.ndarray, x: np.ndarray, calibration: Calibration, sizes: _Patches) -> _Source:
    """The same for every lenslet that sees a sample inside its micro-image, with weights that add up to 1."""
    lattice = calibration.lattice
    i, j = lattice.index(y, x)
    # Two pixels from the edge of the micro-image, so that no tap falls into the next one.
    inside = max(0.5 * lattice.pitch - 2, 0.25 * lattice.pitch)
    reach = min(inside * lattice.pitch / sizes.largest, 2 * lattice.pitch)
    steps = math.ceil(reach / lattice.pitch * 1.2) + 1
    around = [(di, dj) for di in range(-steps, steps + 1) for dj in range(-steps, steps + 1)]
    near = [d for d in around if np.hypot(*(lattice.matrix @ d)) < reach + 0.75 * lattice.pitch]
    weights = [_window(y, x, calibration, (i + di, j + dj), reach) for di, dj in near]
    weights[near.index((0, 0))] += 1e-6  # corners that no window reaches take the nearest lenslet
    total = np.sum(weights, axis=0)
    for (di, dj), weight in zip(near, weights, strict=True):
        if np.any(weight):
            yield _seen(y, x, lattice, sizes, i + di, j + dj), weight / total


def _window(
    y: np.ndarray, x: np.ndarray, calibration: Calibration, index: tuple[np.ndarray, np.ndarray], reach: float
) -> np.ndarray:
    """Weight of a lenslet for samples around it; 0 where its micro-image is cut by the sensor's edge."""
    lattice, (ny, nx) = calibration.lattice, calibration.shape
    cy, cx = np.moveaxis(lattice.position(np.stack(index, -1)), -1, 0)
    distance = np.minimum(np.hypot(y - cy, x - cx) / reach, 1)
    half = lattice.pitch / 2
    whole = (cy >= half - 1) & (cy + half <= ny) & (cx >= half - 1) & (cx + half <= nx)
    return np.cos(math.pi / 2 * distance) ** 2 * (distance < 1) * whole
