"""Lengths behind a calibration, and the rectangle of lenslets whose micro-images are whole."""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core.arrays import Array, namespace, to_numpy
from lumigraph.core.aside import Aside
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.errors import CalibrationError

DISTANCE_RATIO = 20.0
"""F / b where the camera's distances are not known: the scale of alpha and of the aperture depends on it."""

_LENSLET_F_NUMBER = 20.0  # b over the lenslet pitch, where it is not known


@dataclass(frozen=True, slots=True)
class Frame:
    """Scale and axes of a decoded light field.

    The axes are the lattice's own: `row` along its rows, `column` across them, unit vectors (y, x) on the
    sensor. The optical axis meets the sensor in the middle of pixel (ny // 2, nx // 2).
    """

    row: np.ndarray
    column: np.ndarray
    axis: np.ndarray
    lenslet_per_px: float  # position of a lenslet per pixel of its micro-image's centre: pixel / (1 + b/F)
    aperture_per_px: float  # position on the main lens per pixel inside a micro-image: pixel F/b
    separation: float

    @classmethod
    def of(cls, calibration: Calibration) -> "Frame":
        """Frame of a calibration; in lenslet pitches instead of metres where the pixel pitch is unknown."""
        c, angle = calibration, calibration.lattice.rotation
        separation, distance = c.separation, c.lenslet_distance
        ratio = separation / distance if separation and distance else DISTANCE_RATIO
        pixel = c.pixel_pitch or (1 + 1 / ratio) / c.lattice.pitch
        scale = pixel / (1 + 1 / ratio)
        if c.pixel_pitch is None or not (separation or distance):
            separation = ratio * _LENSLET_F_NUMBER * c.lattice.pitch * scale
        elif not separation:
            separation = ratio * (distance or 0.0)
        return cls(
            np.array([math.sin(angle), math.cos(angle)]), np.array([math.cos(angle), -math.sin(angle)]),
            np.array([n // 2 for n in c.shape], float), scale, pixel * ratio, separation,
        )  # fmt: skip

    def along(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Components (across the rows, along the rows) of vectors (..., 2) on the sensor."""
        return points @ self.column, points @ self.row


def transposed(calibration: Calibration) -> Calibration | None:
    """Calibration with y and x exchanged, where a hexagonal lattice has dense rows along y; else None."""
    lattice = calibration.lattice
    if lattice.layout != "hex" or abs(abs(lattice.rotation) - math.pi / 6) > math.pi / 12:
        return None
    vectors = [np.array(v[::-1]) for v in lattice.basis]
    vectors += [vectors[0] - vectors[1], vectors[0] + vectors[1]]
    vectors = sorted((v for w in vectors for v in (w, -w)), key=lambda v: float(v @ v))[:6]
    row = min(vectors, key=lambda v: abs(math.atan2(*v)))
    turn = math.atan2(*row) + math.pi / 3
    column = min(vectors, key=lambda v: abs(math.remainder(math.atan2(*v) - turn, 2 * math.pi)))
    basis = (float(row[0]), float(row[1])), (float(column[0]), float(column[1]))
    flipped = Lattice(basis, (lattice.origin[1], lattice.origin[0]), "hex", lattice.kinds)

    def here(indices: np.ndarray) -> np.ndarray:
        return np.stack(flipped.index(*lattice.position(indices).T[::-1]), -1)

    aside = calibration.aside
    return replace(
        calibration,
        lattice=flipped,
        shape=calibration.shape[::-1],
        indices=np.zeros((0, 2), int),
        centers=np.zeros((0, 2)),
        light=None,
        missing=here(calibration.missing),
        warp=None if calibration.warp is None else calibration.warp.transposed(),
        aside=None if aside is None else Aside(here(aside.indices), aside.ways[:, ::-1]),
    )


def lit(data: Array) -> np.ndarray:
    """Mask (v, u) of views that are not dark everywhere: those inside a round or hexagonal aperture."""
    xp = namespace(data)
    return to_numpy(xp.any(data != 0, axis=tuple(range(2, data.ndim))))


def lenslet_rectangle(
    calibration: Calibration, before: tuple[float, float], after: tuple[float, float]
) -> np.ndarray:
    """Indices (t, s, 2) as (i, j) of a rectangle of lenslets whose micro-images are whole.

    In a hexagonal lattice every other row stands half a pitch to the right.

    Parameters
    ----------
    calibration
        Rows along x.
    before, after
        What a micro-image needs on both sides of its centre (y, x) [px]; one pixel may lie outside.
    """
    lattice, (ny, nx) = calibration.lattice, calibration.shape
    inside = calibration.indices_within((0, ny - 1), (0, nx - 1))
    if not len(inside):
        raise _none_whole(calibration)
    skew = inside[:, 0] // 2 if lattice.layout == "hex" else 0
    rows = np.arange(inside[:, 0].min(), inside[:, 0].max() + 1)
    places = inside[:, 1] + skew
    columns = np.arange(places.min(), places.max() + 1)
    i, s = np.meshgrid(rows, columns, indexing="ij")
    indices = np.stack([i, s - (i // 2 if lattice.layout == "hex" else 0)], -1)
    centers = calibration.position(indices)
    whole = np.ones(i.shape, bool)
    for axis, n in enumerate((ny, nx)):
        whole &= (centers[..., axis] - before[axis] >= -1) & (centers[..., axis] + after[axis] <= n)
    top, bottom, left, right = largest_rectangle(whole)
    if bottom <= top or right <= left:
        raise _none_whole(calibration)
    return indices[top:bottom, left:right]


def largest_rectangle(good: np.ndarray) -> tuple[int, int, int, int]:
    """(top, bottom, left, right) of a rectangle of true values: the worst border line goes until all are."""
    top, left, (bottom, right) = 0, 0, good.shape
    while top < bottom and left < right:
        part = good[top:bottom, left:right]
        bad = [1 - float(line.mean()) for line in (part[0], part[-1], part[:, 0], part[:, -1])]
        worst = int(np.argmax(bad))
        if bad[worst] == 0:
            if part.all():
                break
            worst = int(np.argmin([part.shape[1], part.shape[1], part.shape[0], part.shape[0]]))
        top, bottom, left, right = (
            top + (worst == 0), bottom - (worst == 1), left + (worst == 2), right - (worst == 3)
        )  # fmt: skip
    return top, bottom, left, right


def _none_whole(calibration: Calibration) -> CalibrationError:
    ny, nx = calibration.shape
    return CalibrationError(
        f"no micro-image of pitch {calibration.lattice.pitch:.1f} px lies wholly inside {ny} x {nx} pixels. "
        "Use the whole sensor's picture and its own white image."
    )


def raw_places(
    views: LightField, calibration: Calibration, samples: np.ndarray, which: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places (y, x) of samples of views on the raw image [px].

    Parameters
    ----------
    views
        Decoded with the calibration.
    calibration
        Of the raw image.
    samples
        (n, 2) as (t, s), not rounded.
    which
        (n, 2) views (v, u).

    Returns
    -------
    tuple
        Centres (n, 2) of the micro-images, those between two lenslets too, and the ways (n, 2) from there.
    """
    calibration.require_regular("a metric light field")
    flipped = transposed(calibration)
    frame = Frame.of(calibration if flipped is None else flipped)
    turn = slice(None) if flipped is None else slice(None, None, -1)
    axes = np.stack([frame.column, frame.row])

    def on_raw(grid: Grid, index: np.ndarray) -> np.ndarray:
        at = [grid.center[k] + (index[:, k] - grid.shape[k] // 2) * grid.pitch[k] for k in (0, 1)]
        return np.stack(at[turn], 1) @ axes

    flat = (frame.axis + on_raw(views.lenslets, samples) / frame.lenslet_per_px)[:, turn]
    center = flat if calibration.warp is None else calibration.warp.applied(flat)
    return center, -on_raw(views.aperture, which)[:, turn] / frame.aperture_per_px
