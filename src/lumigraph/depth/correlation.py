"""Patch size of each plenoptic 2.0 lenslet, by correlation of neighbouring micro-images."""

import warnings
from dataclasses import dataclass

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, like
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.progress import Progress, silent, within
from lumigraph.core.raw import RawImage
from lumigraph.depth.micro_images import MicroImages
from lumigraph.depth.smooth import Stiffness, update
from lumigraph.depth.volume import cheapest, semi_global
from lumigraph.errors import CalibrationError, GeometryError, SamplingWarning
from lumigraph.preparation.prepare import of_raw
from lumigraph.rendering.decode import check_raw
from lumigraph.rendering.patches import lenslet_indices

_STEP = 0.5  # between the sizes that are compared [px]
WIDEST = 0.08, 0.6
"""Least and most size that is tried where nothing is known, of the pitch."""

_FEWEST_LENSLETS = 3
_FEWEST_PIXELS = 6  # pitch below which a micro-image has nothing to compare
_TIE = 1e-6  # by which the ends of the range agree less: places that show nothing have its middle
_ALIKE = 0.7  # of the better sign's score; textures that do not repeat reach 0.61, wrong signs begin at 0.71
_SEEN = 0.35  # score below which a picture shows nothing, as its confidence says: white noise has 0.32
_BEND = 0.01  # of the correlation's peak: what a texture of waves 60 px long has [1/px²]


@of_raw
def correlation(
    raw: RawImage | Array,
    calibration: Calibration,
    patches: tuple[float, float] | None = None,
    *,
    progress: Progress = silent,
) -> DepthMap:
    r"""Patch size of each lenslet [px], as `lumigraph.render` takes it: one map (rows, cols) of lenslets.

    What the lenslet at C shows, its neighbour at C + n shows moved by the patch times n over the pitch P:

    .. math:: I_{C+n}(r + patch \, n / P) = I_C(r), \qquad patch = m' p z_2' / L

    for positions r from each micro-image's own centre. For each size the micro-images are compared by their
    normalised correlation, which does not mind another brightness, with the nearest and next-nearest
    neighbours; the better half of them counts, so that a neighbour that sees something else in front, or is
    out of focus, does no harm. Sizes are found between the steps by a parabola, and joined along the lattice.

    Parameters
    ----------
    raw
        Pixels (y, x[, c]); colours are averaged.
    calibration
        Of the same camera; square or hexagonal lattice, of one kind of lenslets or three.
    patches
        Least and most size that may occur [px]: above 0 Keplerian, below 0 Galilean. Both are tried from
        0.08 to 0.6 of the pitch where None; and the sign that fits the picture better is kept.
    progress
        Called as ``progress(fraction)``.

    Returns
    -------
    DepthMap
        Patches (rows, cols) of `lumigraph.rendering.lenslet_indices`, finite everywhere. Confidence is how
        well the micro-images agree, 0 to 1, times how sharply that depends on the size. Of a maker's
        calibration they are those of the lattice as `lumigraph.prepare` moves it, which `lumigraph.render`
        uses, too: ``prepare(raw, calibration).calibration``.

    Raises
    ------
    CalibrationError
        Micro-images of less than 6 px, fewer than 3 lenslets across, or a raw image that does not belong to
        the calibration.
    GeometryError
        A range that is empty, holds 0, or reaches beyond the pitch.
    LumigraphError
        It would not fit in memory.

    Warns
    -----
    SamplingWarning
        Patches above and below 0 explain the picture about as well, as for textures that repeat.

    References
    ----------
    Georgiev and Lumsdaine, "Reducing plenoptic camera artifacts", Comput. Graph. Forum 29, 1955 (2010);
    Perwass and Wietzke, "Single lens 3D-camera with extended depth-of-field", Proc. SPIE 8291 (2012).
    """
    found = of_signs(raw, calibration, patches, progress)
    if len(found) > 1:
        _warn(*found)
    return found[0].depth(raw.data)


@dataclass(frozen=True, slots=True, eq=False)
class Sign:
    """Scores of patch sizes (n,) [px] of one sign: overall, and (n, rows, cols) for each lenslet.

    `ends` are the least and the largest size that were given [px].
    """

    overall: float
    ends: tuple[float, float]
    sizes: np.ndarray
    scores: np.ndarray

    def depth(self, data: Array) -> DepthMap:
        """Depth map of the lenslets, in the type of the raw image's pixels."""
        values, trust = _joined(self.scores, self.sizes)
        return DepthMap(like(np.clip(values, *self.ends), data), like(trust, data), "patch")


def of_signs(
    raw: RawImage,
    calibration: Calibration,
    patches: tuple[float, float] | None = None,
    progress: Progress = silent,
) -> list[Sign]:
    """The sign that fits best, then the other one where it explains the picture about as well.

    Of a range in `patches` there is one. Parameters and errors are those of `correlation`.
    """
    check_raw(raw, calibration)
    pitch = calibration.lattice.pitch
    if pitch < _FEWEST_PIXELS:
        raise CalibrationError(
            f"micro-images are {pitch:.3g} px wide but correlation needs {_FEWEST_PIXELS} px at least."
        )
    if (fewest := min(lenslet_indices(calibration).shape[:2])) < _FEWEST_LENSLETS:
        raise CalibrationError(
            f"the raw image shows {fewest} whole lenslets across but correlation compares each with its "
            f"neighbours and needs {_FEWEST_LENSLETS} at least. Crop less."
        )
    ranges = _ranges(patches, pitch)
    micro, found = MicroImages.of(raw, calibration), []
    for k, (low, high) in enumerate(ranges):
        sizes = np.arange(low, high + _STEP / 2, _STEP)
        scores = micro.scores(sizes, within(progress, k / len(ranges), (k + 1) / len(ranges)))
        found.append(Sign(_overall(scores), (low, high), sizes, scores))
    found.sort(key=lambda sign: -sign.overall)
    good = max(_ALIKE * found[0].overall, _SEEN)
    return found[:1] + [other for other in found[1:] if other.overall >= good]


def _ranges(patches: tuple[float, float] | None, pitch: float) -> list[tuple[float, float]]:
    if patches is None:
        low, high = (part * pitch for part in WIDEST)
        return [(low, high), (-high, -low)]
    low, high = checks.pair("patches", patches, "px")
    if not low < high or low <= 0 <= high or max(abs(low), abs(high)) > pitch:
        raise GeometryError(
            f"patches are from {low:g} to {high:g} px but must ascend, have one sign, and be no larger "
            f"than the pitch, {pitch:.4g} px. Above 0 is Keplerian, below 0 Galilean."
        )
    return [(low, max(high, low + 2 * _STEP))]


def _overall(scores: np.ndarray) -> float:
    """Score of a range of sizes: how well the best ones explain the picture, and better than the others."""
    best = scores.max(0)
    return float((2 * best - np.median(scores, axis=0)).mean())


def _warn(taken: Sign, other: Sign) -> None:
    """Warn that the other sign explains the picture about as well as the one that is taken."""
    (least, most), (low, high) = taken.ends, other.ends
    warnings.warn(
        f"patches from {low:.3g} to {high:.3g} px explain the picture about as well as those from "
        f"{least:.3g} to {most:.3g} px, which are taken (scores of {other.overall:.2f} and "
        f"{taken.overall:.2f}): "
        "textures that repeat do not show the sign. Give patches=(least, most), or --range least:most, if "
        "it is known: above 0 for a Keplerian camera, below for a Galilean one.",
        SamplingWarning,
        stacklevel=4,
    )


def _joined(scores: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes (rows, cols) of the best scores (n, rows, cols), smooth where the scores do not say; trust."""
    beside = np.abs(np.linspace(-_TIE, _TIE, len(sizes)))[:, None, None]
    cost = (1 - scores + beside).astype(np.float32)
    flat = np.zeros(cost.shape[1:], np.float32)
    best = cheapest(semi_global(cost, flat, 0.02, 0.1))
    values = sizes[0] + _STEP * best
    near = np.clip(np.rint(best).astype(int), 1, len(sizes) - 2)[None]
    below, at, above = (np.take_along_axis(cost, near + k, 0)[0] for k in (-1, 0, 1))
    bend = np.maximum(below - 2 * at + above, 0) / _STEP**2
    trust = np.clip(1 - at, 0, 1) * bend / (bend + _BEND)
    # Where agreement still grows at the end of the range, the size lies beyond it.
    trust = np.where((cost.argmin(0) % (len(sizes) - 1) == 0) & (np.abs(best - near[0]) > 0.5), 0, trust)
    aim = cheapest(np.concatenate([below[None], at[None], above[None]])) - 1
    aim = sizes[0] + _STEP * (near[0] + aim)
    information = bend * trust**2
    pull = information * np.clip(aim - values, -_STEP, _STEP)
    how = Stiffness(2e-3, 0.5, 2.0)
    return update(
        values.astype(np.float64), information.astype(np.float64), pull.astype(np.float64), how
    ), trust
