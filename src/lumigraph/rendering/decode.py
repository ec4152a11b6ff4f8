"""A plenoptic 1.0 raw image to the light field it holds, resampled on the true micro-image lattice."""

import math
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import checks, memory
from lumigraph.core.arrays import Array, is_complex, is_single, namespace
from lumigraph.core.calibration import Calibration
from lumigraph.core.grid import Grid
from lumigraph.core.lattice import Lattice
from lumigraph.core.lightfield import LightField
from lumigraph.core.prepared import PreparedImage
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.rendering.geometry import Frame, lenslet_rectangle, transposed
from lumigraph.rendering.interpolate import Interpolation, as_float, check_interpolation, sample, weighted
from lumigraph.rendering.kind_check import warn_if_focused
from lumigraph.rendering.pixels import checked_mask, repaired
from lumigraph.rendering.squared import Squared

MOST_DIRECTIONS = 4096
"""Views along one axis; more would be far beyond the pixels of any micro-image."""

_WHOLE = 0.05  # px of a view that may belong to the next micro-image: fits of whole pitches are no better


def decode(
    raw: RawImage | Array,
    calibration: Calibration,
    *,
    directions: int | tuple[int, int] | None = None,
    samples: int = 1,
    interpolation: Interpolation = "cubic",
    bad: Array | None = None,
) -> LightField:
    r"""Light field L(v, u, t, s) of a plenoptic 1.0 raw image.

    Every micro-image is sampled about its own centre, c (1 + b/F) for a lenslet at c, along the lattice's
    own axes; the raw image is neither turned nor scaled before, so that each value is interpolated once.
    Light from the main lens at u lands at -u b/F from that centre, so the order of the pixels turns round.

    A hexagonal lattice comes out on a square grid: its rows stay, √3/2 of a pitch apart, and each is sampled
    along itself at that same distance. Nothing is mixed across rows, and no detail is lost. The views
    outside its hexagonal cell, whose pixels belong to other lenslets, are 0 and do not count in `refocus`.

    Parameters
    ----------
    raw
        Pixels (y, x[, c]), demosaiced if they had a Bayer pattern; devignetted, if pictures shall not darken
        at their edges. Whole numbers become float32.
    calibration
        Of the same camera. Where its pixel pitch is unknown, lengths are in lenslet pitches; where its
        distances are unknown, F/b = 20 is assumed: only the scale of `alpha` depends on it.
    directions
        Views along (v, u); one pixel apart, as many as fit in a micro-image, where None. Otherwise the
        micro-image's pitch is divided into that many, each the mean over its width.
    samples
        Samples of a view per lenslet along each axis (of a hexagonal lattice, per row): those between the
        lenslets are interpolated.
    interpolation
        "linear" (bilinear), "cubic" or "band_limited", between pixels and between lenslets.
    bad
        Pixels (y, x) to leave out, true or false, such as `hot_pixels` finds. They are filled from their
        neighbours, and samples that rest on them for more than half are marked in ``valid``. Left out, those
        that `lumigraph.prepare` found dead.

    Returns
    -------
    LightField
        Of the largest rectangle of lenslets with whole micro-images; with `valid` where `bad` is given or
        the calibration misses lenslets.

    Warns
    -----
    SamplingWarning
        The raw image looks like that of a camera 2.0, which is not decoded but rendered.

    Raises
    ------
    CalibrationError
        The raw image has another size than the white image, NaN, or a Bayer pattern; bad has another size.
    LumigraphError
        It would not fit in memory.

    Examples
    --------
    >>> import numpy as np
    >>> from lumigraph.core.lattice import Lattice
    >>> lattice = Lattice.square(5.0, origin=(2, 2))
    >>> none = np.zeros((0, 2))
    >>> calibration = Calibration(lattice, (20, 30), none, none, 0.0)
    >>> decode(np.ones((20, 30)), calibration).data.shape
    (5, 5, 4, 6)
    >>> decode(np.ones((20, 30)), calibration, samples=3).data.shape
    (5, 5, 10, 16)
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_interpolation(interpolation)
    check_raw(raw, calibration)
    samples = checks.whole("samples", samples)
    warn_if_focused(raw.data, calibration)
    data, mask = as_float(raw.data), None
    if isinstance(raw, PreparedImage):
        calibration = _without_dark(raw, calibration)
        bad = raw.dead if bad is None and raw.dead.any() else bad
    if bad is not None:
        mask = checked_mask(bad, raw)
        data = repaired(data, mask)
    if (flipped := transposed(calibration)) is None:
        return _decoded(data, mask, calibration, _How(directions, samples, interpolation))
    # A hexagonal lattice with dense columns: y and x are exchanged, and exchanged back.
    xp, extra = namespace(data), tuple(range(2, data.ndim))
    if directions is not None:
        nv, nu = checks.shape("directions", directions)
        directions = nu, nv
    how, turned = _How(directions, samples, interpolation), None if mask is None else mask.T
    views = _decoded(xp.permute_dims(data, (1, 0, *extra)), turned, flipped, how)
    data = xp.permute_dims(views.data, (1, 0, 3, 2, *(4 for _ in extra)))
    valid = None if views.valid is None else xp.permute_dims(views.valid, (1, 0, 3, 2))
    return LightField(data, _exchanged(views.aperture), _exchanged(views.lenslets), views.separation, valid)


def _without_dark(ready: PreparedImage, calibration: Calibration) -> Calibration:
    """The calibration that also misses lenslets whose pixels are dark in the white image, or dead."""
    if ready.lenslets is None:
        return calibration
    lost = ready.lenslets.indices[ready.lenslets.lost]
    return replace(calibration, missing=np.concatenate([calibration.missing, lost]))


@dataclass(frozen=True, slots=True)
class _How:
    """Options of a decoding, as the user chose them."""

    directions: int | tuple[int, int] | None
    samples: int
    interpolation: Interpolation


def _decoded(data: Array, bad: np.ndarray | None, calibration: Calibration, how: _How) -> LightField:
    """Light field of an image (y, x[, c]) whose lattice has dense rows, without checks."""
    frame, plan = Frame.of(calibration), _Directions.of(calibration, how.directions)
    before, after = plan.reach(frame)
    indices = lenslet_rectangle(calibration, before, after)
    squared = Squared.of(calibration.lattice, indices, how.samples, _row_spacing(calibration, frame))
    _check_memory(data, plan, squared)
    centers = calibration.position(indices)
    taken = _gather(data, centers, (frame, plan, calibration.lattice), how.interpolation)
    result, valid = squared.apply(taken, how.interpolation), None
    good = None if bad is None else (~bad).astype(np.float32)
    if good is not None or len(calibration.missing):
        good = good if good is not None else np.ones(calibration.shape, np.float32)
        seen = _gather(good, centers, (frame, plan, calibration.lattice), "linear")
        seen = seen * ~calibration.misses(indices)
        valid = namespace(data).asarray(squared.apply(seen, "linear") > 0.5, device=data.device)
    pitch = plan.step[0] * frame.aperture_per_px, plan.step[1] * frame.aperture_per_px
    grid = _lenslet_grid(calibration, frame, indices, squared)
    return LightField(result, Grid(plan.count, pitch), grid, frame.separation, valid)


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
            "Demosaic it to (y, x, 3) first: lg.demosaic(raw)."
        )


@dataclass(frozen=True, slots=True)
class _Directions:
    """Sampling of micro-images: `count` views (v, u), `step` pixels apart."""

    count: tuple[int, int]
    step: tuple[float, float]

    @classmethod
    def of(cls, calibration: Calibration, directions: int | tuple[int, int] | None) -> "_Directions":
        if directions is None:
            count = tuple(max(1, math.floor(p + _WHOLE)) for p in calibration.lattice.pitches)
            return cls((count[0], count[1]), (1.0, 1.0))
        nv, nu = checks.shape("directions", directions)
        if max(nv, nu) > MOST_DIRECTIONS:
            raise CalibrationError(
                f"directions is ({nv}, {nu}) but micro-images of {calibration.lattice.pitch:.1f} px hold no "
                f"more than {MOST_DIRECTIONS} on either axis. Use as many as they have pixels."
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
        """Margins that a micro-image needs before and after its centre (y, x) [px], also if turned."""
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


def _row_spacing(calibration: Calibration, frame: Frame) -> float:
    """Distance of the rows of lenslets, in pitches along the rows."""
    (to_next, along) = (np.array(vector) for vector in calibration.lattice.basis[::-1])
    return abs(float(frame.along(to_next)[0])) / float(np.hypot(*along))


def _lenslet_grid(calibration: Calibration, frame: Frame, indices: np.ndarray, squared: Squared) -> Grid:
    """Grid of the samples of views, along the lattice's own axes."""
    lattice, shape = calibration.lattice, (len(squared.t), len(squared.s))
    t, s = squared.t[shape[0] // 2], squared.s[shape[1] // 2]
    i, j = (int(k) for k in indices[0, 0])
    # Columns are counted from the even rows' lenslets; (i, j) counts along a slanted axis in a hexagonal one.
    middle = np.array([i + t, j + i // 2 + s - (i + t) / 2 if lattice.layout == "hex" else j + s])
    across, along = frame.along(lattice.position(middle) - frame.axis)
    row, size = lattice.pitches[1], frame.lenslet_per_px
    steps = _row_spacing(calibration, frame) * _step(squared.t, 1.0), _step(squared.s, 1.0)
    return Grid(
        shape, (row * steps[0] * size, row * steps[1] * size), (float(across) * size, float(along) * size)
    )


def _step(places: np.ndarray, alone: float) -> float:
    return float(places[1] - places[0]) if len(places) > 1 else alone


def _exchanged(grid: Grid) -> Grid:
    (ny, nx), (dy, dx), (y, x) = grid.shape, grid.pitch, grid.center
    return Grid((nx, ny), (dx, dy), (x, y))


def _check_memory(data: Array, plan: _Directions, squared: Squared) -> None:
    values = math.prod(plan.count) * len(squared.t) * len(squared.s) * math.prod(data.shape[2:])
    memory.require(
        2.5 * values * (4 if is_single(data) else 8),
        f"a light field of {plan.count[0]} x {plan.count[1]} views",
        "Ask for {factor:.1f}x fewer directions.",
    )
