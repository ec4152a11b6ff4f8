"""Depth for each pixel of a plenoptic 2.0 picture, from the raw image alone: all steps."""

from collections.abc import Sequence
from typing import NamedTuple

from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.progress import Progress, silent, within
from lumigraph.core.raw import RawImage
from lumigraph.depth.correlation import correlation
from lumigraph.depth.dense import dense
from lumigraph.preparation.prepare import of_raw
from lumigraph.rendering import match_kinds

_LENSLETS = 0.3  # of the time


class PixelDepth(NamedTuple):
    """Result of `of_pixels`.

    Parameters
    ----------
    depth
        Patches [px] of the samples (y, x) of the picture.
    lenslets
        Patches [px] of the lenslets (rows, cols), which `lumigraph.render` takes.
    focus
        As given, in the order of the kinds of lenslets that the raw image shows.
    """

    depth: DepthMap
    lenslets: DepthMap
    focus: tuple[float, ...] | None


@of_raw
def of_lenslets(
    raw: RawImage | Array,
    calibration: Calibration,
    patches: tuple[float, float] | None = None,
    *,
    focus: Sequence[float] | None = None,
    progress: Progress = silent,
) -> tuple[DepthMap, tuple[float, ...] | None]:
    """Patch [px] of each lenslet (`correlation`), and `focus` in the order that the raw image shows.

    The arguments are those of `of_pixels`; both are what `lumigraph.render` takes.
    """
    lenslets = correlation(raw, calibration, patches, progress=progress)
    return lenslets, None if focus is None else match_kinds(raw, calibration, lenslets.values, focus)


@of_raw
def of_pixels(
    raw: RawImage | Array,
    calibration: Calibration,
    patches: tuple[float, float] | None = None,
    *,
    focus: Sequence[float] | None = None,
    progress: Progress = silent,
) -> PixelDepth:
    """Patch [px] of each pixel of a camera 2.0's picture, as `lumigraph depth` and the viewer measure it.

    The patches of the lenslets (`correlation`) say which sizes `dense` tries, and which kind of lenslets is
    sharp where (`lumigraph.rendering.match_kinds`).

    Parameters
    ----------
    raw
        Pixels (y, x[, c]), not divided by a white image.
    calibration
        Of the same camera.
    patches
        Least and most that may occur [px], as for `correlation`; found by itself if left out.
    focus
        For three kinds of lenslets: the patch [px] at which each is sharp, in any order.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    CalibrationError, GeometryError, LumigraphError
        As `correlation`, `lumigraph.rendering.match_kinds` and `dense`.
    """
    lenslets, order = of_lenslets(
        raw, calibration, patches, focus=focus, progress=within(progress, 0, _LENSLETS)
    )
    found = dense(raw, calibration, lenslets, focus=order, progress=within(progress, _LENSLETS, 1))
    return PixelDepth(found, lenslets, order)
