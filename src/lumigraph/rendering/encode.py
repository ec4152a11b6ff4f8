"""A light field to the plenoptic 1.0 raw image that holds it: the inverse of `decode`."""

import math

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import A, Array, like, namespace
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.rendering.geometry import Frame, lit, transposed
from lumigraph.rendering.interpolate import Interpolation, as_float, neighbours, take, weighted

_BAND = 1 << 20  # pixels handled at a time


def encode(
    views: LightField[A], calibration: Calibration, *, interpolation: Interpolation = "cubic"
) -> RawImage[A]:
    """Raw image (y, x[, c]) that decodes to the light field.

    Every pixel belongs to the lenslet whose micro-image's centre is nearest, and takes the radiance
    interpolated between that lenslet's directions. Pixels that no lenslet of the light field reaches,
    or that see past its aperture, are 0. With whole-number pitch and centres, what `decode` read comes
    back exactly; a hexagonal lattice is interpolated once more along its rows.

    Parameters
    ----------
    views
        Its lengths must be those that `decode` gives with this calibration: metres, or lenslet pitches.
    calibration
        Of the raw image to make.
    interpolation
        "cubic" or "linear".

    Raises
    ------
    LumigraphError
        It would not fit in memory.
    """
    checks.instance("views", views, LightField)
    checks.instance("calibration", calibration, Calibration)
    ny, nx = calibration.shape
    memory.require(16.0 * ny * nx * math.prod(views.data.shape[4:]), "the raw image", "Use a smaller sensor.")
    xp, extra = namespace(views.data), tuple(range(4, len(views.data.shape)))
    data, grids = as_float(views.data), (views.aperture, views.lenslets)
    axes = np.array([[1.0, 0.0], [0.0, 1.0]])
    if (flipped := transposed(calibration)) is not None:
        data = xp.permute_dims(data, (1, 0, 3, 2, *extra))
        axes = axes[::-1]
    coordinates = _Coordinates(flipped or calibration, tuple(_Axes(g, axes) for g in grids))
    tall, wide = coordinates.calibration.shape
    band = max(1, _BAND // wide)
    parts = [_rows(data, coordinates, (k, min(k + band, tall)), interpolation) for k in range(0, tall, band)]
    image = xp.concat(parts, axis=0)
    if flipped is not None:
        image = xp.permute_dims(image, (1, 0, *(a - 2 for a in extra)))
    return RawImage(image, calibration.pixel_pitch)


class _Axes:
    """First sample, pitch and count of a grid along (y, x), exchanged where the lattice is."""

    def __init__(self, grid: Grid, axes: np.ndarray) -> None:
        order = (0, 1) if axes[0, 0] == 1 else (1, 0)
        self.count = tuple(grid.shape[k] for k in order)
        self.first = tuple((grid.y, grid.x)[k][0] for k in order)
        self.pitch = tuple(grid.pitch[k] for k in order)

    def index(self, axis: int, position: np.ndarray) -> np.ndarray:
        """Fractional index of positions [m] along one axis."""
        return (position - self.first[axis]) / self.pitch[axis]


class _Coordinates:
    """Fractional indices (v, u, t, s) into a light field of every pixel of a band of rows."""

    def __init__(self, calibration: Calibration, grids: tuple[_Axes, ...]) -> None:
        self.calibration, self.frame = calibration, Frame.of(calibration)
        self.aperture, self.lenslets = grids

    def at(self, rows: tuple[int, int]) -> list[np.ndarray]:
        lattice, frame = self.calibration.lattice, self.frame
        y, x = np.mgrid[rows[0] : rows[1], : self.calibration.shape[1]].astype(float)
        # Half way between two micro-images, the pixel belongs to the one before it: decode turns the order
        # of the pixels round, so that with an even number of them the last one stands half a pitch after.
        nudge = 1e-6 * lattice.pitch
        i, j = self.calibration.index(y - nudge, x - nudge)
        centers = self.calibration.position(np.stack([i, j], -1))
        across, along = frame.along(np.stack([y, x], -1) - centers)
        t, s = frame.along(centers - frame.axis)
        v, u = (self.aperture.index(k, -d * frame.aperture_per_px) for k, d in enumerate((across, along)))
        t, s = (self.lenslets.index(k, d * frame.lenslet_per_px) for k, d in enumerate((t, s)))
        return [v, u, np.rint(t), s if lattice.layout == "hex" else np.rint(s)]


def _rows(
    data: Array, coordinates: _Coordinates, rows: tuple[int, int], interpolation: Interpolation
) -> Array:
    """Pixels (y, x[, c]) of a band of rows."""
    places = coordinates.at(rows)
    counts = (*coordinates.aperture.count, *coordinates.lenslets.count)
    reached = np.ones(places[0].shape)
    for place, count, margin in zip(places, counts, (1, 1, 0.01, 0.51), strict=True):
        reached *= (place >= -margin) & (place <= count - 1 + margin)
    near = [neighbours(place, count, interpolation) for place, count in zip(places, counts, strict=True)]
    xp, tail = namespace(data), tuple(data.shape[4:])
    flat = xp.reshape(data, (math.prod(counts), *tail))
    total, seen = like(np.zeros((reached.size, *tail)), data), np.zeros(reached.size)
    open_views = lit(data)
    for v, wv in near[0]:
        for u, wu in near[1]:
            for t, wt in near[2]:
                for s, ws in near[3]:
                    index = ((v * counts[1] + u) * counts[2] + t) * counts[3] + s
                    weight = (wv * wu * wt * ws * reached * open_views[v, u]).ravel()
                    seen += weight
                    total = total + weighted(take(flat, index.ravel(), 0), weight, len(tail))
    # Weights lost to dark views outside the aperture are made up by the others, where these are most of it.
    total = weighted(total, np.where(seen > 0.5, 1 / np.maximum(seen, 0.5), 0), len(tail))
    return xp.reshape(total, (*reached.shape, *tail))
