"""Depth from the lines of epipolar-plane images."""

import warnings
from dataclasses import dataclass, replace

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import like, to_numpy
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.lightfield import LightField
from lumigraph.core.progress import Progress, silent, within
from lumigraph.depth.expected import LINES, Evidence, expected, uniform
from lumigraph.depth.lines import refined
from lumigraph.depth.pictures import Pictures
from lumigraph.depth.repeats import repeats
from lumigraph.depth.sweep import farthest, labels, span, swept
from lumigraph.errors import GeometryError, SamplingWarning

_BEYOND = 0.01  # part of the places that may lie beyond the range without a warning
_STEP = 0.5  # px in the outermost view
_BY_CHANCE, _BLIND = 0.5, 0.25  # likelihood; part of the places that may be so without a warning
_HIGHEST, _SATURATED = 0.999, 0.25  # of the brightest; part of the places that may be so without a warning
_REPEATED = 0.05  # part of the places that may be off by a period without a warning
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
        explain an area as well, such as a texture that repeats: all that a lens camera could show, or
        `disparities`. Places that match no better than by chance, as noise does, may be anywhere.
        Confidence is exp(-error/0.65 px).

    Raises
    ------
    GeometryError
        One view, pictures of less than 8 x 8, NaN, values a million times as bright as the middle view, more
        negative than positive light, a range that is empty or takes too many labels.
    LumigraphError
        It would not fit in memory.

    Warns
    -----
    SamplingWarning
        Places lie beyond the given disparities, match no better than by chance, repeat, or are
        saturated; or light is negative.

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
    found, evidence, searched = lines_of(pictures, disparities, progress)
    evidence = replace(evidence, period=searched.repeats(found), farthest=searched.farthest)
    error = expected(found, evidence, LINES) / pictures.reach
    found = found / pictures.reach
    if disparities is not None:
        _check_ends(found, error, disparities, _STEP / pictures.reach)
    _check_chance(evidence, searched)
    _check_repeats(np.asarray(evidence.period) / pictures.reach)
    _check_saturated(pictures.center.mean(0), evidence)
    known = _known(views) & (pictures.seen is None or pictures.seen[pictures.middle])
    found, error = np.where(known, found, np.nan), np.where(known, error, np.nan)
    trust = known * np.exp(-np.nan_to_num(error) / min(_DOUBT, _DOUBT * 4 / pictures.reach))
    found, trust, error = (like(part, views.data) for part in (found, trust, error))
    return DepthMap(found, trust, "disparity", error)


@dataclass(frozen=True, slots=True)
class Searched:
    """Ranges in which a map's values were searched.

    Parameters
    ----------
    ends, coarse
        Least and most disparity of the sweep, and what a coarse one found [px per view].
    allowed
        Least and most movement in the outermost view that may occur [px].
    farthest
        Most movement that a lens camera could show [px].
    period
        Movement (y, x) of a place that no view shows [px]; 0 where there is no such movement.
    """

    ends: tuple[float, float]
    coarse: tuple[float, float]
    allowed: tuple[float, float]
    farthest: float
    period: np.ndarray

    def repeats(self, found: np.ndarray) -> np.ndarray:
        """The period where a movement (y, x), more or less by it, may occur as well."""
        low, high = self.allowed
        return np.where((found + self.period <= high) | (found - self.period >= low), self.period, 0)


def lines_of(
    pictures: Pictures, disparities: tuple[float, float] | None = None, progress: Progress = silent
) -> tuple[np.ndarray, Evidence, Searched]:
    """Movements (y, x) in the outermost view [px], what they rest on, and where they were looked for."""
    given = None if disparities is None else _range(disparities, pictures.reach)
    (low, high), shading = span(pictures)
    most, reach = farthest(pictures), pictures.reach
    allowed, coarse = given or (-most, most), (low / reach, high / reach)
    period = repeats(pictures, allowed[1] - allowed[0])
    if given:
        low, high = given
    elif (half := float(np.median(period)) / 2) > 0:
        low, high = min(low, -half), max(high, half)
    searched = Searched((low / reach, high / reach), coarse, allowed, most, period)
    moves = labels(low, high)
    share = len(moves) / (len(moves) + 20)
    first = swept(pictures, moves, shading, within(progress, 0, share))
    return *refined(pictures, first, shading, within(progress, share, 1)), searched


def _known(views: LightField) -> np.ndarray:
    """Mask (t, s) of places that the middle view shows: all others are unknown."""
    if views.valid is None:
        return np.ones(views.lenslets.shape, bool)
    v, u = (n // 2 for n in views.aperture.shape)
    return to_numpy(views.valid)[v, u].astype(bool)


def _check_ends(found: np.ndarray, error: np.ndarray, given: tuple[float, float], step: float) -> None:
    beyond = (found < given[0] - step) | (found > given[1] + step)
    share = float((beyond & (error < step)).mean())
    if share > _BEYOND:
        warnings.warn(
            f"{share:.1%} of the places lie beyond the given disparities, {given[0]:g} to "
            f"{given[1]:g} px: theirs are those at the end of the search. Give a wider range, or none.",
            SamplingWarning,
            stacklevel=3,
        )


def _check_chance(evidence: Evidence, searched: Searched) -> None:
    textured = evidence.contrast > 0
    share = float(((evidence.chance > _BY_CHANCE) & textured).mean())
    if share > _BLIND:
        given = searched.ends != searched.coarse
        (low, high), (least, most) = searched.ends, searched.coarse
        wider = f"A coarse search of all finds {least:.3g} to {most:.3g} px: give a wider range, or none. "
        warnings.warn(
            f"{share:.0%} of the places match no better than by chance at disparities of {low:.3g} to "
            f"{high:.3g} px: their confidence is low. {wider if given else ''}Otherwise check that the views "
            "are in order and not mirrored, that they overlap, and that they show more than noise.",
            SamplingWarning,
            stacklevel=3,
        )


def _check_repeats(alike: np.ndarray) -> None:
    share = float((alike > 0).mean())
    if share > _REPEATED:
        period = float(np.median(alike[alike > 0]))
        warnings.warn(
            f"{share:.0%} of the places repeat every {period:.3g} px, and may be off by as much. Give "
            f"disparities=(low, high) that are less than {period:.3g} px apart.",
            SamplingWarning,
            stacklevel=3,
        )


def _check_saturated(middle: np.ndarray, evidence: Evidence) -> None:
    share = float((uniform(evidence) & (middle > _HIGHEST * middle.max())).mean())
    if _SATURATED < share < 1:  # a picture that is even all over has no confidence at all
        warnings.warn(
            f"{share:.0%} of the middle view are saturated: as bright as all around them, and as its "
            "brightest place. Depth there is only that of what is near. Expose for less time.",
            SamplingWarning,
            stacklevel=3,
        )


def _range(disparities: tuple[float, float], reach: float) -> tuple[float, float]:
    low, high = checks.pair("disparities", disparities, "px")
    if not low < high:
        raise GeometryError(f"disparities are from {low:g} to {high:g} px but the first must be less.")
    return low * reach, high * reach
