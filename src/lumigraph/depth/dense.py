"""Depth of each sample of a plenoptic 2.0 picture, by all micro-images that show it."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.ndimage import median_filter

from lumigraph.core import memory
from lumigraph.core.arrays import Array, like, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.progress import Progress, silent, within
from lumigraph.core.raw import RawImage
from lumigraph.depth import repeats
from lumigraph.depth.chance import by_chance, slowly
from lumigraph.depth.correlation import WIDEST, correlation
from lumigraph.depth.expected import MICRO_IMAGES, Evidence, contrast, deviation, expected
from lumigraph.depth.flat import FlatImage
from lumigraph.depth.micro_images import MicroImages
from lumigraph.depth.pictures import LEAST_NOISE, noise_of
from lumigraph.depth.sightings import Sightings
from lumigraph.depth.smooth import Stiffness, tears, update
from lumigraph.depth.volume import box, cheapest, guided, rivals, semi_global
from lumigraph.errors import SamplingWarning
from lumigraph.preparation.prepare import of_raw
from lumigraph.rendering.decode import check_raw
from lumigraph.rendering.patches import Patches, PatchLayout, checked_focus

# Lengths in px are those by which a detail moves that stands at the edge of its micro-image.
_STEP = 0.4  # px between sizes that are tried
_BEYOND = 0.01  # part of the places that may lie at the end of the sizes without a warning
_SPARE = 2.0  # px beyond the sizes of the lenslets' map
_SURE = 0.3  # confidence of the lenslets whose sizes span the range
_MOST = 0.06  # of white: more says only that the size is wrong
_ROUNDS = (2.0, 1.2)  # px: second difference that counts as an edge, round by round
_TEAR = 1.0  # px between neighbours that are not of one surface
_KINK, _STIFFNESS = 1e-3, 3e4  # px; per variance of the noise
_FARTHEST = 1.2  # px that a round may move a place
_WINDOW = 3  # samples to each side that tell what noise does
_BLANK = 1e-4  # contrast between neighbours of what shows nothing
_UNMET = 25  # deviations of a place that are as much as what a window asks for and the stiff surface denies
_BY_CHANCE, _BLIND = 0.5, 0.25  # likelihood; part of the places that may be so without a warning
_DOUBT = 0.8  # px: expected error with a confidence of 1/e


@of_raw
def dense(
    raw: RawImage | Array,
    calibration: Calibration,
    lenslets: DepthMap | None = None,
    *,
    samples: int | None = None,
    focus: Sequence[float] | None = None,
    progress: Progress = silent,
) -> DepthMap:
    r"""Patch size [px] of each sample of the picture that `lumigraph.render` makes: a depth for each pixel.

    A sample at Y, in the lattice of the micro-images' centres, lies on the ray through the middle of the main
    lens. If its patch is s, the lenslet at C shows it at

    .. math:: C - \frac{s}{P} (Y - C)

    on the sensor, as far as its micro-image reaches: some 0.8 (P/s)² of them do. For each size they are
    compared with the nearest one that is sharp there, the better half of them on each axis, because what
    stands before a place hides it from one side. Costs are smoothed along the picture's edges and by
    semi-global matching; least squares on all lenslets, joined by a surface that may be slanted, bent and
    torn, then find the sizes between the steps, as for `lumigraph.depth.epi`.

    Parameters
    ----------
    raw
        Pixels (y, x[, c]); colours are averaged.
    calibration
        Of the same camera; square or hexagonal lattice, of one kind of lenslets or three.
    lenslets
        Patch of each lenslet, from `correlation`, which measures it where None: says which sizes are tried.
    samples
        Of the picture, per lenslet, as for `lumigraph.render`.
    focus
        For three kinds of lenslets: the patch [px] at which each is sharp. Those that blur a place by more
        than the sharpest kind, by the difference of the patches, count less.
    progress
        Called as ``progress(fraction)``.

    Returns
    -------
    DepthMap
        Patches (y, x) of the samples of ``render(raw, calibration, lenslets.values, samples=samples)``, whose
        places are `lumigraph.rendering.sight_grid`. `error` and confidence as for `lumigraph.depth.epi`.

    Raises
    ------
    CalibrationError
        Micro-images of less than 6 px, or a raw image that does not belong to the calibration.
    GeometryError
        A map of another shape than the lenslets, or another number of `focus` than kinds of lenslets.
    LumigraphError
        It would not fit in memory.

    Warns
    -----
    SamplingWarning
        Places have patches at the end of those that are tried, or match no better than by chance.

    References
    ----------
    Perwass and Wietzke, "Single lens 3D-camera with extended depth-of-field", Proc. SPIE 8291 (2012).
    """
    raw = raw if isinstance(raw, RawImage) else RawImage(raw)
    check_raw(raw, calibration)
    calibration.require_regular("depth from patches at each place")
    kinds = checked_focus(focus, calibration)
    if lenslets is None:
        lenslets = correlation(raw, calibration, progress=within(progress, 0, 0.3))
    lenslets.check("patch")
    sizes = Patches.of(lenslets.values, calibration)
    layout = PatchLayout.of(calibration, sizes, samples)
    sights = Sightings(FlatImage.of(raw, calibration), calibration, layout, kinds)
    trust = to_numpy(lenslets.confidence)
    found, evidence, ends = moves_of(sights, (sizes, trust), within(progress, 0.3, 1))
    sign, reach = math.copysign(1.0, sizes.middle), sights.flat.even
    parts = [expected(side * found, evidence, MICRO_IMAGES, slants=False) for side in (1, -1)]
    error = np.minimum(np.maximum(*parts), reach)
    all_tried = np.ptp(ends) >= evidence.farthest
    counts = (error < _DOUBT) | ((evidence.chance > _BY_CHANCE) & ~all_tried)
    if not _beyond(found, counts, ends, sign * np.exp(ends / reach)):
        _check_chance(evidence)
    values = sign * np.exp(found / reach)
    trust, error = np.exp(-error / _DOUBT), error * np.abs(values) / reach
    values, trust, error = (like(part, raw.data) for part in (values, trust, error))
    return DepthMap(values, trust, "patch", error)


def moves_of(
    sights: Sightings, lenslets: tuple[Patches, np.ndarray], progress: Progress = silent
) -> tuple[np.ndarray, Evidence, np.ndarray]:
    """Logarithms (y, x) of the sizes of patches times the reach [px], what they rest on, and the ends tried.

    `lenslets` are their patches, and how sure each is.
    """
    (sizes, trust), reach = lenslets, sights.flat.even
    sign = math.copysign(1.0, sizes.middle)
    moves = _labels(np.abs(sizes.values), trust, reach, sights.calibration.lattice.pitch)
    guide = _joined(sights, lambda part, rows: part.picture(sizes.between(*part.fractional)))
    first = _swept(sights, moves, (sign, guide), within(progress, 0, 0.7))
    found, evidence = _refined(sights, first, (sign, guide), within(progress, 0.7, 1))
    evidence = replace(evidence, farthest=reach * math.log(WIDEST[1] / WIDEST[0]))
    return found, evidence, moves[[0, -1]]


def _labels(sizes: np.ndarray, trust: np.ndarray, reach: float, pitch: float) -> np.ndarray:
    """Logarithms of the sizes that are tried (n,), times the reach: `_STEP` px apart at its end."""
    sure = sizes[trust >= min(_SURE, float(np.median(trust)))]
    if not (trust >= _SURE).any():
        sure = pitch * np.array(WIDEST)
    low, high = (reach * math.log(end) for end in (sure.min(), sure.max()))
    low, high = low - _SPARE, min(high + _SPARE, reach * math.log(pitch))
    count = max(math.ceil((high - low) / _STEP), 4)
    return low + (high - low) * np.arange(count + 1) / count


def _beyond(found: np.ndarray, counts: np.ndarray, ends: np.ndarray, sizes: np.ndarray) -> bool:
    """True, with a warning, if more than a few of the places that count lie at the ends."""
    low, high = ends[0] + _STEP / 2, ends[1] - _STEP / 2
    share = float((((found < low) | (found > high)) & counts).mean())
    if share > _BEYOND:
        first, last = sorted(sizes.tolist())
        warnings.warn(
            f"{share:.1%} of the places have patches at the end of those tried, "
            f"{first:.4g} to {last:.4g} px: "
            "theirs may lie beyond. Give lenslets= by correlation with wider patches=(least, most).",
            SamplingWarning,
            stacklevel=3,
        )
    return share > _BEYOND


def _check_chance(evidence: Evidence) -> None:
    share = float(((evidence.chance > _BY_CHANCE) & (evidence.contrast > _BLANK)).mean())
    if share > _BLIND:
        warnings.warn(
            f"{share:.0%} of the places match no better than by chance: their confidence is low. Give "
            "lenslets= by correlation with other patches=(least, most), and check that the raw image shows "
            "more than noise.",
            SamplingWarning,
            stacklevel=3,
        )


def _swept(
    sights: Sightings, moves: np.ndarray, how: tuple[float, np.ndarray], progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """The label (y, x) of each place, to a fraction of a step, and its `rivals`."""
    (sign, guide), reach = how, sights.flat.even
    memory.require(
        4.5 * 4 * len(moves) * guide.size,
        f"the cost of {len(moves)} sizes for {guide.shape[0]} x {guide.shape[1]} samples",
        "Ask for {factor:.1f}x fewer samples, or crop the raw image.",
    )
    cost = np.empty((len(moves), *guide.shape), np.float32)
    sizes = sign * np.exp(moves / reach)
    blurred = sights.blurred(sizes)
    for k, (rows, columns, part) in enumerate(sights.blocks):
        cost[:, rows, columns] = part.disagreements(sizes, _MOST, blurred)
        progress((k + 1) / len(sights.blocks))
    cost = semi_global(guided(cost, guide, 3), guide, 0.2 * _MOST, _MOST)
    step = moves[1] - moves[0]
    first = median_filter(moves[0] + cheapest(cost) * step, 5)
    return np.clip(first, moves[0], moves[-1]).astype(np.float32), rivals(
        cost, max(_MOST, 3 * noise_of(sights.flat.image))
    ) * step


def _refined(
    sights: Sightings,
    first: tuple[np.ndarray, np.ndarray],
    how: tuple[float, np.ndarray],
    progress: Progress,
) -> tuple[np.ndarray, Evidence]:
    """Labels (y, x) refined on all micro-images by least squares, and what they rest on."""
    (sign, guide), noise, (moves, others) = how, noise_of(sights.flat.image), first
    slow, asked = slowly(guide, guide > 0), np.zeros((6, *moves.shape), np.float32)
    for k, jump in enumerate(_ROUNDS):
        sizes = sign * np.exp(moves / sights.flat.even)
        asked = np.moveaxis(_joined(sights, partial(_asked, sizes=sizes, noise=noise, slow=slow)), 1, 0)
        pull, information, variance = asked[:3]
        # By how lenslets differ: a micro-image has no even part, and its texture would pass for noise.
        noise = max(LEAST_NOISE, float(np.sqrt(np.median(variance))))
        held = Stiffness(_STIFFNESS * noise**2, _KINK, jump)
        change = update(moves, information, pull, held, None, tears(moves, _TEAR)) - moves
        change = np.clip(change, -_FARTHEST, _FARTHEST)
        moves, asked[0] = moves + change, pull - information * change
        progress((k + 1) / len(_ROUNDS))
    repeated = _period(sights, sign * np.exp(moves / sights.flat.even), noise)
    return moves, replace(_evidence(sights, asked, (moves, guide), noise), rivals=others, period=repeated)


def _evidence(
    sights: Sightings, asked: np.ndarray, maps: tuple[np.ndarray, np.ndarray], noise: float
) -> Evidence:
    """Evidence for a map of moves (y, x), with its picture, by the pull of lenslets on it (6, y, x)."""
    pull, information, variance, disputed, shared, own = asked
    variance = np.maximum(box(variance, 2), noise**2)
    white = noise_of(sights.flat.image)
    alone, around = deviation(maps[0], information, information * variance, MICRO_IMAGES)
    unmet = np.abs(box(pull, _WINDOW)) / (box(information, _WINDOW) + 1e-12)
    return Evidence(
        np.hypot(alone, _UNMET * unmet),
        around,
        box(disputed, 1),
        contrast(maps[1]),
        np.zeros_like(maps[0]),
        by_chance(shared, own, white, 1),
    )


def _period(sights: Sightings, sizes: np.ndarray, noise: float) -> np.ndarray:
    """Period (y, x) of moves that no lenslet distinguishes from none; see `repeats`."""
    calibration, flat = sights.calibration, sights.flat
    pitch = calibration.lattice.pitch
    least, most = (part * pitch for part in WIDEST)
    micro = MicroImages.read(flat.image, calibration, flat.radius)
    found = repeats.of_micro_images(micro, most - least, noise)
    lenslets = replace(Patches.of(np.ones(found.shape), calibration), values=found)
    period = _joined(sights, lambda part, rows: np.asarray(lenslets.at(*part.index)))
    sizes = np.abs(sizes)
    there = (sizes + period <= most) | (sizes - period >= least)
    return np.where(there, period * flat.even / sizes, 0)


def _asked(part: Sightings, rows: slice, sizes: np.ndarray, noise: float, slow: np.ndarray) -> np.ndarray:
    return part.asked(sizes[rows], noise, slow[rows]).swapaxes(0, 1)


def _joined(sights: Sightings, made: Callable[[Sightings, slice], np.ndarray]) -> np.ndarray:
    """Array joined from each band of rows (y, ...)."""
    return np.concatenate([made(part, rows) for rows, part in sights.bands])
