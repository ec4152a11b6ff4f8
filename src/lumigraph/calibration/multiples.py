"""Candidates that hold several cells of the true lattice: aliases, beats with pixels, kinds of lenslets."""

import math

import numpy as np

from lumigraph.calibration.autocorrelation import SMALLEST_PITCH, reduced
from lumigraph.calibration.spectrum import Gaps
from lumigraph.calibration.vectors import Vectors, oriented

_THIRDS = (8, 8), (16, 16)
_ALIASED = 12.0  # px of pitch below which whole pixels make neighbours differ
_ABSENT = 0.12  # of the weakest first harmonic of the finer, or better, lattice: what only another one has
_BETWEEN = 0.15  # orders beside those of another lattice
_ALIKE = 0.55  # correlation of lenslets of several kinds; touching discs of one kind reach 0.46
_COARSEST = 9  # cells of the finer lattice in one of the coarser
AROUND = 0.04
"""Part of a pitch within which polishing one candidate finds the other."""
_SUBLATTICES = [
    (a, b, n // a)
    for n in range(_COARSEST, 1, -1)
    for a in range(1, n + 1)
    if n % a == 0
    for b in range(n // a)
]


def finest(light: Gaps, vectors: Vectors) -> Vectors:
    """The finest lattice that holds a candidate's points and all harmonics that its light really has.

    Micro-images of 5.5 px repeat on whole pixels after 11 px only: the aliases of high orders leave lines,
    faint ones, at the harmonics of the coarser lattice. Turned, they may repeat after any number of cells.
    """
    if vectors.pitch > math.sqrt(_COARSEST) * _ALIASED:
        return vectors
    coarse = np.stack([vectors.column, vectors.row], -1)
    for a, b, d in _SUBLATTICES:
        divided = coarse @ np.linalg.inv(np.array([[a, b], [0, d]], float))
        first, second = reduced(divided[:, 0], divided[:, 1])
        finer = Vectors.of(first, second) if math.hypot(*first) >= SMALLEST_PITCH else None
        if finer is not None and finer.pitch < _ALIASED and _absent(light, coarse, finer):
            return finer
    return vectors


def _absent(light: Gaps, coarse: np.ndarray, finer: Vectors) -> bool:
    """True if the light has only its own harmonics, to the order of the finer lattice's first."""
    fine = np.stack([finer.column, finer.row], -1)
    steps = np.stack(np.meshgrid(*2 * [np.arange(-5, 6)], indexing="ij"), -1).reshape(-1, 2)
    waves = steps @ np.linalg.inv(coarse)
    order = waves @ fine
    own = (np.abs(order - np.rint(order)) < 1e-6).all(-1)
    size = np.hypot(*waves.T)
    first = np.sort(size[own & (size > 1e-9)])[3]  # both directions of two waves
    near = (size < 1.2 * first) & (size > 1e-9) & (waves[:, 1] >= 0)
    heights = light.heights(waves)
    mine, rest = heights[near & own], heights[near & ~own]
    return bool(len(rest) and rest.max() < _ABSENT * mine.min())


def singles(features: list[np.ndarray], chosen: list[Vectors]) -> list[Vectors]:
    """The lattices of single lenslets where hexagonal candidates are those of one of three kinds.

    Three kinds of lenslets in turn repeat after sqrt(3) pitches. Their micro-images are alike, so that the
    mean cell resembles itself moved by a third of its diagonal; the places between the lenslets of a
    lattice with one kind do not resemble lenslets, at least not in both light and gaps.
    """
    repeats = []
    for vectors in chosen:
        if vectors.layout == "hex" and vectors.pitch / math.sqrt(3) >= SMALLEST_PITCH:
            alike = [_likeness(feature, vectors, _THIRDS) for feature in features]
            if float(np.median(alike)) > _ALIKE:
                repeats.append(vectors.pitch)
    return [
        _third(v) if v.layout == "hex" and any(abs(v.pitch / p - 1) < 2 * AROUND for p in repeats) else v
        for v in chosen
    ]


def _third(vectors: Vectors) -> Vectors:
    first, second = reduced((vectors.row + vectors.column) / 3, (2 * vectors.row - vectors.column) / 3)
    return Vectors(*oriented(first, second, "hex"), "hex", 3)


def _likeness(feature: np.ndarray, vectors: Vectors, moves: tuple[tuple[int, int], ...]) -> float:
    """Correlation of the mean cell with itself moved by 24ths of it, the lowest of several ways."""
    pitch, (ny, nx) = vectors.pitch, feature.shape
    size = 24 if pitch > 36 else 12 if pitch > 18 else 6  # every sample holds pixels
    moves = tuple((a * size // 24, b * size // 24) for a, b in moves)
    y, x = np.mgrid[:ny, :nx]
    inverse = np.linalg.inv(np.stack([vectors.column, vectors.row], -1))
    u, v = (inverse[k, 0] * y + inverse[k, 1] * x for k in (0, 1))
    place = (np.floor(u % 1 * size) % size * size + np.floor(v % 1 * size) % size).astype(np.int64).ravel()
    count = np.maximum(np.bincount(place, minlength=size**2), 1)
    cell = (np.bincount(place, feature.ravel(), size**2) / count).reshape(size, size)
    moved = (np.roll(cell, move, (0, 1)) for move in moves)
    return min(float(np.corrcoef(cell.ravel(), other.ravel())[0, 1]) for other in moved)


def without_beats(found: list[Vectors], pictures: tuple[Gaps, ...]) -> list[Vectors]:
    """Lattices but those that are beats of a finer one with the pixels: where edges are sharp, they have
    many lines, but faint ones. Those that repeat after few of the finer one's cells are left to `finest`.
    """
    fine = [one for one in found if one.pitch < _ALIASED]
    return [v for v in found if not any(_beats(pictures, v, one) for one in fine)]


def _beats(pictures: tuple[Gaps, ...], vectors: Vectors, finer: Vectors) -> bool:
    """True if a candidate is coarser than another, faint beside it, and more than a few of its cells."""
    if vectors.area < 1.05 * finer.area or not all(faint(one, vectors, finer) for one in pictures):
        return False
    steps = np.linalg.solve(
        np.stack([finer.row, finer.column], -1), np.stack([vectors.row, vectors.column], -1)
    )
    return bool(np.abs(steps - np.rint(steps)).max() > AROUND or abs(np.linalg.det(steps)) > _COARSEST + 0.5)


def faint(picture: Gaps, vectors: Vectors, best: Vectors) -> bool:
    """True if a candidate's first harmonics are negligible beside those of the best one.

    Lines count by how far they stand out of their surroundings: on a clean picture, a coarser lattice has
    one at each beat of the true one with the pixels or with a pattern of dead lenslets.
    """
    mine, rest = (picture.heights(_first(one)) for one in (best, vectors))
    return bool(rest.max() < _ABSENT * mine.min())


def without_lines(picture: Gaps, vectors: Vectors, other: Vectors) -> bool:
    """True if the first harmonics that a lattice has and another one has not are next to nothing."""
    steps = np.stack(np.meshgrid(*2 * [np.arange(-3, 4)], indexing="ij"), -1).reshape(-1, 2)
    waves = steps @ np.linalg.inv(np.stack([vectors.column, vectors.row], -1))
    waves = waves[(waves[:, 1] > 0) | ((waves[:, 1] == 0) & (waves[:, 0] > 0))]
    first = _first(other)
    waves = waves[np.hypot(*waves.T) < 1.2 * np.hypot(*first.T).max()]
    order = waves @ np.stack([other.column, other.row], -1)
    extra = waves[np.abs(order - np.rint(order)).max(-1) > _BETWEEN]
    mine = picture.heights(first).min()
    return not len(extra) or bool(picture.heights(extra).max() < _ABSENT * mine)


def _first(vectors: Vectors) -> np.ndarray:
    """First harmonics (2 or 3, 2) of a lattice, of one half plane [1/px]."""
    steps = np.stack(np.meshgrid(*2 * [np.arange(-1, 2)], indexing="ij"), -1).reshape(-1, 2)
    waves = steps @ np.linalg.inv(np.stack([vectors.column, vectors.row], -1))
    waves = waves[(waves[:, 1] > 0) | ((waves[:, 1] == 0) & (waves[:, 0] > 0))]
    return waves[np.argsort(np.hypot(*waves.T))[: 3 if vectors.layout == "hex" else 2]]
