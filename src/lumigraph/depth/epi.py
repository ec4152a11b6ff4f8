"""Depth from the lines of epipolar-plane images."""

import warnings

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import like, to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, silent, within
from lumigraph.depth.expected import Evidence, expected
from lumigraph.depth.lines import refined
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.sweep import labels, span, swept
from lumigraph.errors import GeometryError, SamplingWarning

_BEYOND = 0.01  # part of the places that may lie beyond the range without a warning
_STEP = 0.5  # px in the outermost view
_DOUBT = 0.65
"""Expected error [px per view, or in the outermost view if that is less] with a confidence of 1/e."""


def epi(
    views: LightField, disparities: tuple[float, float] | None = None, *, progress: Progress = silent
) -> DepthMap:
    r"""Disparity of each lenslet of the middle view: slope of the line its point draws through the views.

    .. math:: L(u, x + d\, u) = L(0, x), \qquad d = (1 - \alpha') \Delta u / \Delta s

    A plane sweep over the cross of views, the better half of each arm taken (occlusion), smoothed along the
    picture's edges and by semi-global matching, finds each line to a fraction of a pixel. Least squares on
    all views that see the point, joined by a surface that may be slanted, bent and torn, then finds slopes.

    Parameters
    ----------
    views
        Light field (v, u, t, s[, c]). More than nine views per axis are thinned evenly.
    disparities
        Least and most that may occur [lenslets per view]; found by a coarse sweep where None.
    progress
        Called as ``progress(fraction)``.

    Returns
    -------
    DepthMap
        Disparities (t, s): positive is nearer than the plane in focus; NaN where the middle view is not
        `valid`, such as in vignetted corners. `error` is the mean distance from
        the truth to expect, by what noise and contrast allow in a 7 x 7 window and what is at stake beside an
        edge of depth, where the map may be on the wrong side; and by how far other disparities lie that
        explain an area as well, such as a texture that repeats. Confidence is exp(-error/0.65 px).

    Raises
    ------
    GeometryError
        One view, pictures of less than 8 x 8, NaN, a range that is empty or takes too many labels.
    LumigraphError
        It would not fit in memory.

    Warns
    -----
    SamplingWarning
        Places lie beyond the disparities asked for.

    References
    ----------
    Bolles, Baker, Marimont, "Epipolar-plane image analysis", Int. J. Comput. Vis. 1, 7 (1987); occlusion by
    half apertures as in Chen et al., "Light field stereo matching using bilateral statistics", CVPR 2014,
    and others.

    Examples
    --------
    >>> from lumigraph.core.grid import Grid
    >>> def texture(y, x):
    ...     return 2 + np.sin(x) + np.sin(0.7 * y + 0.4 * x)
    >>> v, u, y, x = np.meshgrid(*(np.arange(n) - n // 2 for n in (5, 5, 24, 24)), indexing="ij")
    >>> data = texture(y - 0.3 * v, x - 0.3 * u)  # moves by 0.3 lenslets per view
    >>> found = epi(LightField(data, Grid((5, 5), 1.0), Grid((24, 24), 1.0), 10.0), (-1, 1))
    >>> round(float(np.median(found.values)), 2)
    0.3
    """
    pictures = Pictures.of(views)
    found, evidence = lines_of(pictures, disparities, progress)
    found, error = found / pictures.reach, expected(found, evidence) / pictures.reach
    if disparities is not None:
        _check_ends(found, error, disparities, _STEP / pictures.reach)
    known = _known(views) & (pictures.seen is None or pictures.seen[pictures.middle])
    found, error = np.where(known, found, np.nan), np.where(known, error, np.nan)
    trust = known * np.exp(-np.nan_to_num(error) / min(_DOUBT, _DOUBT * 4 / pictures.reach))
    found, trust, error = (like(part, views.data) for part in (found, trust, error))
    return DepthMap(found, trust, "disparity", error)


def lines_of(
    pictures: Pictures, disparities: tuple[float, float] | None = None, progress: Progress = silent
) -> tuple[np.ndarray, Evidence]:
    """Movements (y, x) in the outermost view [px], and what they rest on."""
    (low, high), shading = span(pictures)
    if disparities is not None:
        low, high = _range(disparities, pictures.reach)
    moves = labels(low, high)
    share = len(moves) / (len(moves) + 20)
    first = swept(pictures, moves, shading, within(progress, 0, share))
    return refined(pictures, first, shading, within(progress, share, 1))


def _known(views: LightField) -> np.ndarray:
    """Whether the middle view shows a place (t, s): where it is not valid, nothing can be said."""
    if views.valid is None:
        return np.ones(views.lenslets.shape, bool)
    v, u = (n // 2 for n in views.aperture.shape)
    return to_numpy(views.valid)[v, u].astype(bool)


def _check_ends(found: np.ndarray, error: np.ndarray, given: tuple[float, float], step: float) -> None:
    beyond = (found < given[0] - step) | (found > given[1] + step)
    share = float((beyond & (error < step)).mean())
    if share > _BEYOND:
        warnings.warn(
            f"{share:.1%} of the places lie beyond the disparities asked for, {given[0]:g} to "
            f"{given[1]:g} px: theirs are those at the end of the search. Give a wider range, or none.",
            SamplingWarning,
            stacklevel=3,
        )


def _range(disparities: tuple[float, float], reach: float) -> tuple[float, float]:
    low, high = checks.pair("disparities", disparities, "px")
    if not low < high:
        raise GeometryError(f"disparities are from {low:g} to {high:g} px but the first must be less.")
    return low * reach, high * reach
