"""A plenoptic 1.0 raw image to the light field it holds, resampled on the true micro-image lattice."""

import math
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, is_complex, is_single, namespace
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.rendering.geometry import Frame, lenslet_rectangle, transposed
from lumigraph.rendering.interpolate import (
    Interpolation,
    as_float,
    check_interpolation,
    sample,
    take,
    weighted,
)

MOST_DIRECTIONS = 4096
"""Views along one axis; more would be far beyond the pixels of any micro-image."""


def decode(
    raw: RawImage | Array,
    calibration: Calibration,
    *,
    directions: int | tuple[int, int] | None = None,
    interpolation: Interpolation = "cubic",
) -> LightField:
    r"""Light field L(v, u, t, s) of a plenoptic 1.0 raw image.

    Every micro-image is sampled about its own centre, c (1 + b/F) for a lenslet at c, along the lattice's
    own axes. Light from the main lens at u lands at -u b/F from that centre, so the order of the pixels
    turns round. A hexagonal lattice is resampled onto rows √3/2 pitch apart, every other row interpolated
    half a pitch along itself; the views outside its hexagonal cell, whose pixels belong to other lenslets,
    are 0 and do not count in `refocus`.

    Parameters
    ----------
    raw
        Pixels (y, x[, c]); devignetted, if pictures shall not darken at their edges. Whole numbers become
        float32.
    calibration
        Of the same camera. Where its pixel pitch is unknown, lengths are in lenslet pitches; where its
        distances are unknown, F/b = 20 is assumed: only the scale of `alpha` depends on it.
    directions
        Views along (v, u); one pixel apart, as many as fit in a micro-image, where None. Otherwise the
        micro-image's pitch is divided into that many, each the mean over its width.
    interpolation
        "cubic" or "linear".

    Returns
    -------
    LightField
        Of the largest rectangle of lenslets with whole micro-images.

    Raises
    ------
    CalibrationError
        The raw image has another size than the white image, NaN, or a Bayer pattern.
    LumigraphError
        It would not fit in memory.

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.lattice import Lattice
    >>> lattice = Lattice.square(5.0, origin=(2, 2))
    >>> none = np.zeros((0, 2))
    >>> views = decode(np.ones((20, 30)), Calibration(lattice, (20, 30), none, none, 0.0))
    >>> views.data.shape
    (5, 5, 4, 6)
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_interpolation(interpolation)
    check_raw(raw, calibration)
    if (flipped := transposed(calibration)) is not None:
        return _turned(raw, flipped, directions, interpolation)
    frame, plan = Frame.of(calibration), _Directions.of(calibration, directions)
    before, after = plan.reach(frame)
    indices = lenslet_rectangle(calibration, before, after)
    _check_memory(raw, plan, indices)
    data = _gather(
        as_float(raw.data),
        calibration.lattice.position(indices),
        (frame, plan, calibration.lattice),
        interpolation,
    )
    if calibration.lattice.layout == "hex":
        data = _straightened(data, indices[:, 0, 0] % 2 == 1, interpolation)
    pitch = plan.step[0] * frame.aperture_per_px, plan.step[1] * frame.aperture_per_px
    return LightField(
        data, Grid(plan.count, pitch), _lenslet_grid(calibration, frame, indices), frame.separation
    )


def check_raw(raw: RawImage, calibration: Calibration) -> None:
    """Refuse a raw image that does not belong to a calibration or has no grey or full-colour pixels."""
    checks.instance("calibration", calibration, Calibration, CalibrationError)
    calibration.check_fits(raw.shape)
    if is_complex(raw.data):
        raise CalibrationError("the raw image is complex. Give its intensity.")
    checks.finite_array("the raw image", raw.data, CalibrationError)
    if raw.bayer is not None:
        raise CalibrationError(
            f"the raw image has a Bayer pattern ({raw.bayer}): its neighbours have different colours. "
            "Demosaic it to (y, x, 3) first."
        )


@dataclass(frozen=True, slots=True)
class _Directions:
    """How micro-images are sampled: `count` views (v, u), `step` pixels apart."""

    count: tuple[int, int]
    step: tuple[float, float]

    @classmethod
    def of(cls, calibration: Calibration, directions: int | tuple[int, int] | None) -> "_Directions":
        if directions is None:
            count = tuple(max(1, math.floor(p + 1e-6)) for p in calibration.lattice.pitches)
            return cls((count[0], count[1]), (1.0, 1.0))
        nv, nu = checks.shape("directions", directions)
        if max(nv, nu) > MOST_DIRECTIONS:
            raise CalibrationError(
                f"directions is ({nv}, {nu}) but micro-images of {calibration.lattice.pitch:.1f} px hold no "
                f"more than {MOST_DIRECTIONS} on either axis. Ask for as many as they have pixels."
            )
        first, second = calibration.lattice.pitches
        return cls((nv, nu), (first / nv, second / nu))

    def offsets(self, axis: int) -> np.ndarray:
        """Pixels from a micro-image's centre to each view's sample (n, m): m of them are averaged."""
        n, step = self.count[axis], self.step[axis]
        parts = max(1, round(step))
        within = (np.arange(parts) - (parts - 1) / 2) / parts
        return -(np.arange(n)[:, None] - n // 2 + within) * step

    def reach(self, frame: Frame) -> tuple[tuple[float, float], tuple[float, float]]:
        """What a micro-image needs before and after its centre (y, x) [px], turned lattices included."""
        across, along = self.offsets(0), self.offsets(1)
        corners = [(v, u) for v in (across.min(), across.max()) for u in (along.min(), along.max())]
        ends = [v * frame.column + u * frame.row for v, u in corners]
        low, high = np.min(ends, 0), np.max(ends, 0)
        return (-low[0], -low[1]), (high[0], high[1])


def _gather(
    image: Array, centers: np.ndarray, how: tuple[Frame, _Directions, Lattice], interpolation: Interpolation
) -> Array:
    """Samples (v, u, t, s[, c]) about micro-image centres (t, s, 2), one row of views at a time."""
    frame, plan, lattice = how
    xp, tail = namespace(image), image.ndim - 2
    along = plan.offsets(1)[:, :, None, None, None] * frame.row
    rows = []
    for offsets in plan.offsets(0):
        total = None
        for across in offsets:
            for part in range(along.shape[1]):
                places = centers + across * frame.column + along[:, part]
                term = sample(image, places[..., 0], places[..., 1], interpolation)
                total = term if total is None else total + term
        if lattice.layout == "hex":
            vectors = offsets.mean() * frame.column + along.mean(1)[:, 0, 0]
            total = weighted(total, _own(vectors, lattice)[:, None, None], tail)
        rows.append(total / (len(offsets) * along.shape[1]))
    return xp.stack(rows)


def _own(vectors: np.ndarray, lattice: Lattice) -> np.ndarray:
    """1 where a pixel at `vectors` (k, 2) from a micro-image's centre belongs to it, else 0."""
    i, j = lattice.index(*(vectors + lattice.origin).T)
    return ((i == 0) & (j == 0)).astype(float)


def _straightened(data: Array, odd: np.ndarray, interpolation: Interpolation) -> Array:
    """Rows `odd` (t,) of a hexagonal light field moved by half a pitch along s, onto the other rows' columns.

    Half way between samples, six points of Lagrange's polynomial are far better than four.
    """
    xp, columns = namespace(data), data.shape[3]
    weights = (0.5, 0.5) if interpolation == "linear" else tuple(w / 256 for w in (3, -25, 150, 150, -25, 3))
    moved = None
    for step, weight in enumerate(weights, start=-len(weights) // 2):
        index = np.clip(np.arange(columns) + step, 0, columns - 1)
        term = take(data, index, 3) * weight
        moved = term if moved is None else moved + term
    mask = xp.asarray(odd.reshape((-1,) + (1,) * (data.ndim - 3)), device=data.device)
    return xp.where(mask, moved, data)


def _lenslet_grid(calibration: Calibration, frame: Frame, indices: np.ndarray) -> Grid:
    """Where the lenslets of a rectangle stand, along the lattice's own axes."""
    lattice, shape = calibration.lattice, (indices.shape[0], indices.shape[1])
    i, j = indices[shape[0] // 2, shape[1] // 2]
    middle = np.array([i, j - (i % 2) / 2 if lattice.layout == "hex" else j])
    across, along = frame.along(lattice.position(middle) - frame.axis)
    pitch_t, pitch_s = abs(float(frame.along(np.array(lattice.basis[1]))[0])), lattice.pitches[1]
    size = frame.lenslet_per_px
    return Grid(shape, (pitch_t * size, pitch_s * size), (float(across) * size, float(along) * size))


def _turned(
    raw: RawImage,
    calibration: Calibration,
    directions: int | tuple[int, int] | None,
    interpolation: Interpolation,
) -> LightField:
    """Decode with y and x exchanged, and exchange them back: a hexagonal lattice with dense columns."""
    xp, extra = namespace(raw.data), tuple(range(2, len(raw.data.shape)))
    turned = RawImage(xp.permute_dims(raw.data, (1, 0, *extra)), raw.pixel_pitch)
    if directions is not None:
        nv, nu = checks.shape("directions", directions)
        directions = nu, nv
    views = decode(turned, calibration, directions=directions, interpolation=interpolation)
    data = xp.permute_dims(views.data, (1, 0, 3, 2, *(4 for _ in extra)))
    return LightField(data, _exchanged(views.aperture), _exchanged(views.lenslets), views.separation)


def _exchanged(grid: Grid) -> Grid:
    (ny, nx), (dy, dx), (y, x) = grid.shape, grid.pitch, grid.center
    return Grid((nx, ny), (dx, dy), (x, y))


def _check_memory(raw: RawImage, plan: _Directions, indices: np.ndarray) -> None:
    values = math.prod(plan.count) * indices.shape[0] * indices.shape[1] * math.prod(raw.data.shape[2:])
    size = 2.5 * values * (4 if is_single(raw.data) else 8)
    memory.require(
        size,
        f"a light field of {plan.count[0]} x {plan.count[1]} views",
        "Ask for {factor:.1f}x fewer directions.",
    )
