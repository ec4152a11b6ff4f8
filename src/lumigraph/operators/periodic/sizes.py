"""Memory that the periodic operator's matrices take while they are built, and what is built together."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lumigraph.elements import LensletArray
from lumigraph.operators.lenslets.exact_lenslets import terms_of
from lumigraph.operators.periodic.border_correction import AT_A_TIME, HELD
from lumigraph.operators.sampling import cells as _cells
from lumigraph.operators.sampling.border_classes import (
    INSIDE,
    BorderBand,
    BorderClass,
    BorderState,
    alike,
    flipped,
    places,
    terms,
)
from lumigraph.operators.sampling.cell_axis import INFINITE
from lumigraph.operators.sampling.optics import Optics
from lumigraph.operators.sampling.sampling_rules import tail

MORE = 1.4
"""Factors that are found at first, of those that are kept in the end."""

LEAST = 12 * 2.0**20
"""What building takes besides [bytes]: the main lens' light, the white image."""


def build_bytes(optics: Optics, workers: int = 1) -> float:
    """Memory that building all parts takes [bytes], from their sizes and the usual number of factors.

    What was let go is not given back, but serves again where large arrays follow large ones: the fields of
    few points and the images at the border. Factors are small arrays, found, cut and put side by side.
    """
    cells, factors = optics.cells, Factors.of(optics)
    points, samples = math.prod(cells.points), math.prod(cells.samples)
    block, factor = 4.0 * points * samples, 4.0 * points + np.dtype(optics.precision).itemsize * samples
    inside, border = factors.inside * factor, factors.border * factor
    # What computing takes is let go before all factors are put side by side.
    put = inside * cells.kinds + border + inside * cells.kinds + factors.all * factor
    if optics.straight:
        states = {INSIDE} | states_of(wanted(optics))
        light = len({state.x for state in states}) * optics.images_bytes(optics.near) * terms_of(optics)
        shared = 1 + sum(INFINITE in state for state in states)
        computed = light + workers * (2 * shared + 4) * block + MORE * (inside + border)
    else:
        few = SubsetSizes.of(optics)
        computed = few.table + few.matrices + MORE * inside * cells.kinds
        computed += max(
            few.fields + workers * (few.line + 5 * block),
            few.images + workers * few.stacks + MORE * border,
        )
    return max(computed, put) + glare_bytes(optics) + LEAST


def glare_bytes(optics: Optics, more: tuple[int, int] = (0, 0)) -> float:
    """Memory that transforming the pictures of `glare` takes, of more cells on each side [bytes]."""
    cells, reach = optics.cells, optics.reach
    margin = [m + n for m, n in zip(optics.margin(reach), more, strict=True)]
    window = math.prod(2 * (n + m) for n, m in zip(cells.image, margin, strict=True))
    return 40.0 * 4 * sum(reach) * window * (2 if cells.staggered else 1)


def wanted(optics: Optics) -> list[BorderClass]:
    """Places at the border whose blocks do not mirror those of others."""
    mirrored = _cells.mirrored(optics.camera)
    even = mirrored, mirrored and symmetric(optics.array)
    square = mirrored and optics.cells.size[0] == optics.cells.size[1]
    return [place for place, source, _ in alike(places(optics), even, square) if place is source]


@dataclass(frozen=True, slots=True)
class Factors:
    """Number of factors of blocks: a power of the points, as `benchmarks.memory --count` counts them.

    Opaque rims make more of them; those at the border are fewer where only strong ones count, and the farther
    a row is from it.

    Parameters
    ----------
    inside
        Of the cells of one kind inside the array.
    border, all
        Of the places at the border that do not mirror others, and of all.
    """

    inside: float
    border: float
    all: float

    @classmethod
    def of(cls, optics: Optics) -> "Factors":
        """Factors of one depth."""
        cells, edges, finer = optics.cells, _cells.edges(optics.array), 1e-3 / optics.fineness.accuracy
        aside = tail(_cells.fresnel_number(optics.camera))
        # Of one cell, and of as many of them as there are in a square of so many pitches.
        usual = math.prod(cells.points) ** 0.85 * optics.array.lattice.pitch**2 / math.prod(cells.size)
        usual *= {"meet": 1.0, "straight": 1.75, "other": 1.3}[edges]
        inside, border = (0.45, 0.26) if optics.straight else (0.55, 0.75)
        coarse, fine = (0.27, 0.05) if optics.straight else (0.4, 0.26)
        inside *= math.sqrt(aside) * finer ** (0.1 if edges == "straight" and finer > 1 else -0.11)
        border *= aside**1.25 * finer ** (fine if finer > 1 else coarse)
        border *= 1.25 if edges == "straight" else 1.5 if cells.kinds > 1 else 1.0
        near, reach = (usual * (2 * pitches + 1) ** 2 for pitches in (optics.missed, optics.followed))
        return cls(
            inside * reach,
            border * near * sum(_share(optics, place) for place in wanted(optics)),
            border * near * sum(_share(optics, place) for place in places(optics)),
        )


def _share(optics: Optics, place: BorderClass) -> float:
    """Factors of a place's blocks over those of the array's outermost row."""
    y, x = (_nearness(optics, band) for band in (place.y, place.x))
    return 0.55 * (y * x) ** 1.2 if y and x else y + x


def _nearness(optics: Optics, band: BorderBand) -> float:
    """Factors of rows that lack lenslets on either side, over the outermost row's; 0 if none is missed."""
    pitch = optics.array.lattice.pitch
    farthest = optics.fineness.border(_cells.fresnel_number(optics.camera), optics.blur) + 1
    rows = [max(0.0, abs(limit) / pitch - 0.5) for limit in band.limits if math.isfinite(limit)]
    sides = [max(0.03, 1 - row / farthest) / math.sqrt(1 + row) for row in rows]
    return math.hypot(*sides) * (0.37 if band.ring else 1.0)


@dataclass(frozen=True, slots=True)
class SubsetSizes:
    """Memory and time of images of few points behind lenslets that are not square.

    Parameters
    ----------
    table
        Light in a lenslet, of all points around it [bytes].
    matrices
        From there to the few numbers on a cell, of all lenslets that are followed [bytes].
    fields, line
        Fields of the few points, and of all of one row of cells [bytes].
    chosen
        Points that are looked at for the border, of one kind.
    stacks
        What a thread holds of the lenslets' light along x and along y for them [bytes].
    images
        Of the points of some offsets with some lenslets missing [bytes].
    operations
        Multiplications and additions of all fields and images.
    """

    table: float
    matrices: float
    fields: float
    line: float
    chosen: float
    stacks: float
    images: float
    operations: float

    @classmethod
    def of(cls, optics: Optics) -> "SubsetSizes":
        """Memory and time for one depth."""
        cells, axes, kinds = optics.cells, optics.axes, optics.cells.kinds
        samples, pitch = math.prod(cells.samples), optics.array.lattice.pitch
        squared = optics.camera.wavelength * _cells.telecentric_distance(optics.camera)
        light = math.prod(2 * axis.band * pitch + 7 for axis in axes)
        modes = [pitch * axis.size / squared + 8 for axis in axes]
        points = math.prod((2 * optics.lit / axis.size + 1) * axis.points for axis in axes)
        followed = math.prod(2 * axis.neighbourhood / axis.size + 1 for axis in axes)
        folded = 2.0 if _cells.mirrored(optics.camera) else 1.0
        few = math.prod(optics.few(optics.reach)) / folded
        lit = math.pi * optics.lit**2 / math.prod(cells.size)
        rows = 2 * optics.lit / axes[0].size
        # To the few numbers behind each lenslet, by way of some thirty from most of them, and along
        # x, then along y: 8 for a complex product and sum.
        numbers = math.prod(modes)
        through = min(lit, 3) * light * numbers + lit * min(30, light / 2) * (light + numbers)
        along_x = through + lit * numbers * axes[1].samples
        along_y = rows * modes[0] * samples
        states = states_of(wanted(optics))
        turns = len({state.x for state in states})
        chosen = math.prod((2 * optics.missed + 1) * pitch * 2 * axis.band + 12 for axis in axes) / 2
        # Amplitudes up to each limit, of rows and of samples; the largest block's images are held at least.
        stacks = 8.0 * AT_A_TIME * ((turns + 1) * rows * modes[0] * axes[1].samples + turns * samples)
        images = 4.0 * len(states) / kinds * samples * chosen
        return cls(
            8.0 * light * points,
            8.0 * light * math.prod(modes) * kinds * followed,
            8.0 * samples * few,
            8.0 * samples * axes[0].points * optics.few(optics.reach)[1],
            chosen,
            stacks,
            max(min(4.0 * HELD, images), images / 15),
            8.0 * kinds * (few * (along_x + along_y) + chosen * (along_x + turns * along_y)),
        )


def build_operations(optics: Optics) -> float:
    """Multiplications and additions that most of building takes."""
    points, samples = math.prod(optics.cells.points), math.prod(optics.cells.samples)
    if optics.straight:
        inside, border = _blocks(optics)
        # Factors by products with a fifth of the points.
        places = len(wanted(optics)) * math.prod(2 * n + 1 for n in optics.near)
        return (inside + border) * _block(optics) + 2.0 * samples * points**2 * (inside + places)
    few = SubsetSizes.of(optics)
    # Factors of blocks: three products of theirs, each block and its mirror image once; at the border of the
    # chosen points, a fifteenth of them in the largest block.
    blocks = optics.cells.kinds * math.prod(2 * n + 1 for n in optics.reach) / 2
    border = len(wanted(optics)) * few.chosen**2 / 15
    return few.operations + 3 * 2.0 * samples * (blocks * points**2 + border)


def stream_operations(optics: Optics) -> float:
    """Multiplications and additions of an image whose blocks are computed for it, behind square lenslets."""
    applied = 2.0 * math.prod((*optics.cells.points, *optics.cells.samples, *optics.cells.count))
    applied *= math.prod(2 * n + 1 for n in optics.reach)
    return sum(_blocks(optics)) * _block(optics) + applied


def _blocks(optics: Optics) -> tuple[int, int]:
    """Blocks behind square lenslets that do not mirror others: inside the array, and at its border."""
    even = _cells.mirrored(optics.camera)

    def count(state: BorderState, reach: tuple[int, int]) -> int:
        pairs = zip((state.y, state.x), reach, strict=True)
        return math.prod(n + 1 if even and flipped(limits) == limits else 2 * n + 1 for limits, n in pairs)

    border = states_of(wanted(optics)) - {INSIDE}
    return count(INSIDE, optics.reach), sum(count(state, optics.near) for state in border)


def _block(optics: Optics) -> float:
    """Multiplications and additions of one: complex products with light in half of a window's points."""
    y, numbers = optics.axes[0], math.prod((*optics.cells.points, *optics.cells.samples))
    return 8.0 * terms_of(optics) * (y.margin + y.points / 2) * numbers


def states_of(group: Iterable[BorderClass]) -> set[BorderState]:
    """Lenslets whose light some places need."""
    return {state for place in group for state in terms(place)}


def symmetric(array: LensletArray) -> bool:
    """True if a lenslet's surroundings are the same in a mirror."""
    return array.lattice.kinds == 1 or isinstance(array.focal_length, float)
