"""The lattice of a large picture: its middle as a whole, then tiles farther and farther out: `in_tiles`."""

import math
from dataclasses import replace

import numpy as np

from lumigraph.calibration.centres import Spots, TriedSpots, lit, measured, placed, traced
from lumigraph.calibration.fitting import Fitted, fit, recentred
from lumigraph.calibration.period import Request
from lumigraph.calibration.surface import flattened
from lumigraph.calibration.template import sharpened
from lumigraph.calibration.whole import FoundLattice, How, whole
from lumigraph.core.calibration import Calibration
from lumigraph.core.gaps import logarithm, valleys
from lumigraph.core.lattice import Vector
from lumigraph.core.progress import Progress, Stage, silent, within
from lumigraph.errors import CalibrationError

LARGEST = 2304
"""Pixels along a side of what is looked at as a whole."""

_MIDDLE, _LENSLETS = 2048, 8.0  # px of the middle, and lenslets across it where a pitch is asked for
_PARTS = (0.45, 0.65, 0.85, 1.0)  # of the picture that the fit grows over
_PROBES, _PROBE, _ACROSS = 5, 256, 9.0  # tiles along each side of a part, their pixels or lenslets at least
_TILE = 2048  # px of the tiles that all micro-images are measured in
_MARGIN = {"gaps": 3.0, "logarithm": 3.0}  # pitches around a tile that its centres depend on; 1 for others
_PROBED: dict[How, How] = {"sharp": "light"}  # on few tiles, where speed counts more than a hundredth of a px
_SHARE = 0.25  # of a quarter's lenslets must be found

_NONE = Spots(np.zeros((0, 2), np.int64), np.zeros((0, 2)), np.zeros(0))

Area = tuple[slice, slice]


def in_tiles(original: np.ndarray, request: Request, progress: Progress | None = None) -> FoundLattice:
    """The lattice of a large picture (y, x), and the centres of its micro-images.

    The lattice is found in the middle and fitted to ever more of the picture, by a few tiles at a time, so
    that tilt and distortion are known before they reach half a pitch. Then all micro-images are measured,
    tile by tile: besides the picture, memory holds one tile.

    Raises
    ------
    CalibrationError
        As `whole`; or no centre could be measured, or a quarter of the picture does not show the lattice.
    """
    size = max(_MIDDLE, math.ceil(_LENSLETS * (request.pitch or 0)))
    corner = np.array([max(0, (n - size) // 2) for n in original.shape])
    middle = original[tuple(slice(k, k + size) for k in corner)]
    found = whole(middle, request, within(progress, 0, 0.4, "middle"))
    if not found.measured:
        raise CalibrationError(
            f"the middle of the picture repeats every {found.fitted.lattice.pitch:.2f} px but no centre "
            "could be measured, which is too little for a picture of "
            f"{original.shape[0]} x {original.shape[1]} px. "
            "Take a white image, with gaps between micro-images."
        )
    shape = (original.shape[0], original.shape[1])
    fitted = _moved(found.fitted, corner)
    for k, part in enumerate(_PARTS):
        within(progress, 0.4, 0.6)(Stage(k / len(_PARTS), "farther out"))
        tiles = _probes(shape, part, fitted.lattice.pitch)
        spots = _measured(original, tiles, fitted.model(shape), _PROBED.get(found.how, found.how))
        fitted = fit(_united(fitted.spots, spots), fitted.model(shape))
    tell = within(progress, 0.6, 1, "centres of micro-images")
    spots = _measured(original, _tiles(shape), fitted.model(shape), found.how, tell)
    fitted = fit(spots, fitted.model(shape))
    _check_shares(fitted, shape)
    return found._replace(fitted=recentred(fitted, shape))


def _moved(fitted: Fitted, corner: np.ndarray) -> Fitted:
    """The fit to a part of a picture that begins at a corner (y, x), as one of the whole."""
    return Fitted(
        fitted.spots._replace(centers=fitted.spots.centers + corner),
        fitted.lattice.moved(*(float(k) for k in corner)),
        None if fitted.warp is None else replace(fitted.warp, center=_sum(fitted.warp.center, corner)),
    )


def _sum(point: Vector, way: np.ndarray) -> Vector:
    return point[0] + float(way[0]), point[1] + float(way[1])


def _probes(shape: tuple[int, int], part: float, pitch: float) -> list[Area]:
    """Small tiles over a part of a picture."""
    size = max(_PROBE, math.ceil(_ACROSS * pitch))
    first = []
    for n in shape:
        most = max(0, n - size)
        places = most / 2 + part * most * np.linspace(-0.5, 0.5, _PROBES)
        first.append(np.unique(np.rint(places).astype(int)))
    return [(slice(y, y + size), slice(x, x + size)) for y in first[0] for x in first[1]]


def _tiles(shape: tuple[int, int]) -> list[Area]:
    rows, columns = ([slice(k, min(k + _TILE, n)) for k in range(0, n, _TILE)] for n in shape)
    return [(row, column) for row in rows for column in columns]


def _measured(
    original: np.ndarray, tiles: list[Area], model: Calibration, how: How, tell: Progress = silent
) -> Spots:
    """Micro-images whose centres lie in tiles."""
    tried = []
    for k, tile in enumerate(tiles):
        tell(k / len(tiles))
        tried.append(_tried(original, tile, model, how))
    return lit(*tried)


def _tried(original: np.ndarray, tile: Area, model: Calibration, how: How) -> TriedSpots:
    margin = math.ceil(_MARGIN.get(how, 1.0) * model.lattice.pitch) + 3
    wide = [
        slice(max(0, part.start - margin), min(n, part.stop + margin))
        for part, n in zip(tile, original.shape, strict=True)
    ]
    picture, corner = original[wide[0], wide[1]], np.array([part.start for part in wide])
    here = _moved(Fitted(_NONE, model.lattice, model.warp), -corner).model(
        (picture.shape[0], picture.shape[1])
    )
    tried = _centres(picture, here, how)
    tried = tried._replace(centers=tried.centers + corner)
    places = model.position(tried.indices)
    first, last = (np.array([getattr(part, end) for part in tile]) for end in ("start", "stop"))
    inside = ((places >= first) & (places < last)).all(-1)
    return TriedSpots(*(column[inside] for column in tried))


def _centres(picture: np.ndarray, model: Calibration, how: How) -> TriedSpots:
    """Centres on one tile (y, x), found as those of the middle were."""
    if how == "gaps":
        gaps = valleys(picture, 1.0)
        return traced(gaps.max() - gaps, model)
    if how == "logarithm":
        return traced(logarithm(picture), model)
    if how == "discs":
        tried = placed(model)
    else:
        above = picture - np.float32(np.percentile(picture[::8, ::8], 2))
        tried = measured(above, model, **({"rounds": 1} if how == "sharp" else {}))
    if how == "light":
        return tried
    spots = sharpened(flattened(picture), Spots(tried.indices, tried.centers, tried.light[:, 0]), model)
    return tried._replace(centers=spots.centers)


def _united(first: Spots, second: Spots) -> Spots:
    """Both, each lenslet once."""
    both = Spots(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))
    once = np.unique(both.indices, axis=0, return_index=True)[1]
    return Spots(*(column[once] for column in both))


def _check_shares(fitted: Fitted, shape: tuple[int, int]) -> None:
    """Refuse a picture with a quarter in which few of the lenslets that should be there are found."""
    model, margin = fitted.model(shape), fitted.lattice.pitch / 2
    expected = model.centers_within((margin, shape[0] - 1 - margin), (margin, shape[1] - 1 - margin))
    counts = [np.histogram2d(*(2 * points / shape).T, bins=2, range=((0, 2), (0, 2)))[0]
              for points in (fitted.spots.centers, expected)]  # fmt: skip
    share = counts[0] / np.maximum(counts[1], 1)
    if share.min() < _SHARE:
        raise CalibrationError(
            f"only {share.min():.0%} of the micro-images of pitch {fitted.lattice.pitch:.2f} px were found "
            f"in a quarter of the picture, where {_SHARE:.0%} are needed to be sure of the lattice. "
            "Take a white image that is lit all over."
        )
