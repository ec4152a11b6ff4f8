"""The two lattice vectors of a picture, before any micro-image is known.

Candidates are pairs of peaks of the autocorrelation, of the evenly lit picture and of its dark gaps.
Pairs of lines of the spectrum are candidates, too. All are judged in the spectrum: a true lattice has a
line at every harmonic, a coarser one has harmonics without a line, and a finer one misses lines.
"""

import math
from typing import NamedTuple

import numpy as np

from lumigraph.calibration.autocorrelation import SMALLEST_PITCH, Peaks, autocorrelation, reduced, refined
from lumigraph.calibration.spectrum import Gaps, Spectrum, polished
from lumigraph.core.lattice import Layout
from lumigraph.errors import CalibrationError

_LEAST = 0.12  # of the autocorrelation's top; noise alone reaches 0.1 on pictures of 100 px
_PART = 0.3  # of the strongest peak: what may be a neighbour
_MOST = 16  # peaks paired
_ORDERS = (2.6, 4.6)  # of the harmonics are looked at
_EVIDENCE = 6.0  # of the score: noise reaches 3, a lattice on a clean white image 30 to 200
_GOOD = 0.5  # of the best score: what the coarsest must have
_MARGIN = 0.85  # the second candidate must stay below this part of the first
_THIRDS = (8, 8), (16, 16)
_ALIASED = 12.0  # px of pitch below which whole pixels make neighbours differ
_ABSENT = 0.12  # of the weakest first harmonic of the finer, or better, lattice: what only another one has
_KEPT = 0.55  # of the score of a candidate must its regular lattice keep
_SHEARED = 1.06  # two pitches that a search finds
_FOLDED = 768  # px of the middle that are folded
_ALIKE = 0.55  # correlation of lenslets of several kinds; touching discs of one kind reach 0.46
_FEWEST = 2.8  # lenslets across a picture
_COARSEST = 9  # cells of the finer lattice in one of the coarser
_SUBLATTICES = [
    (a, b, n // a)
    for n in range(_COARSEST, 1, -1)
    for a in range(1, n + 1)
    if n % a == 0
    for b in range(n // a)
]
_NEAR = 0.012  # of a pitch, within which two candidates are one
_AROUND = 0.04  # and within which polishing one finds the other
_LOOKED_AT = 4  # candidates polished
_SIZE = 2048  # px of the middle of the picture that is looked at
_RATIO, _ANGLES = 1.25, (52.0, 75.0)  # of neighbours: lengths, and what is hexagonal


class Vectors(NamedTuple):
    """Reduced lattice vectors (y, x) [px], row vector first, and the layout they form."""

    row: np.ndarray
    column: np.ndarray
    layout: Layout
    kinds: int = 1


class Request(NamedTuple):
    """What the caller knows: layout, pitch [px] to 10 %, rotation [rad] to 2°."""

    layout: Layout | None = None
    pitch: float | None = None
    rotation: float | None = None

    def near(self, vectors: Vectors) -> bool:
        """Whether a candidate is worth looking at: it may be beaten, but not ten times as coarse."""
        return self.pitch is None or 0.4 * self.pitch < math.sqrt(_area(vectors)) < 2.5 * self.pitch

    def allows(self, vectors: Vectors, slack: float = 0.0) -> bool:
        """Whether a candidate is what was asked for; slack [rad] is its own uncertainty."""
        pitch = (math.hypot(*vectors.row) + math.hypot(*vectors.column)) / 2
        if self.layout not in (None, vectors.layout):
            return False
        if self.pitch is not None and abs(pitch - self.pitch) > 0.1 * self.pitch + 0.5:
            return False
        if self.rotation is None:
            return True
        step = math.pi / (3 if vectors.layout == "hex" else 2)
        return abs(math.remainder(math.atan2(*vectors.row) - self.rotation, step)) < math.radians(2) + slack


class _Candidate(NamedTuple):
    vectors: Vectors
    score: float


def lattice_vectors(features: list[np.ndarray], request: Request) -> Vectors:
    """Lattice vectors of a picture, from its features (y, x): light, gaps, smoother gaps.

    Raises
    ------
    CalibrationError
        No period, several lattices, or a pitch, rotation or layout that the picture does not support.
    """
    middles = [_middle(feature) for feature in features]
    pairs, tops, repeats = [], [], []
    for feature in middles[:2]:
        correlation = autocorrelation(feature)
        peaks = Peaks(correlation)
        tops.append(peaks.top())
        strong = peaks.strong(_PART * tops[-1])
        repeats.append([float(peaks.lengths[k]) for k in strong])
        pairs += _pairs(correlation, peaks, strong, request)
    if max(tops) < _LEAST:
        raise CalibrationError(
            f"the image shows no lattice: its autocorrelation returns to {max(tops):.2f} of its top at most, "
            f"where a lattice gives over {_LEAST:g}. Use an evenly lit, focused white image with dark gaps "
            "between at least 3 x 3 micro-images."
        )
    spectra = [Spectrum(feature) for feature in middles]
    for spectrum in spectra:
        pairs += spectrum.pairs()
    longest = max(middles[0].shape) / _FEWEST
    found = [_vectors(first, second, longest) for first, second in pairs]
    found = _distinct([v for v in found if v is not None and request.near(v)], _NEAR)
    if not found:
        raise CalibrationError(_nothing(pairs, repeats[int(np.argmax(tops))]))
    gaps, light = Gaps(middles[1]), Gaps(_middle(features[0], _FOLDED))
    ranked = _ranked(spectra, _without_beats(found, (light, gaps)))
    chosen: list[Vectors] = []
    for candidate in ranked:
        if len(chosen) == _LOOKED_AT or candidate.score < 0.5 * ranked[0].score:
            break
        finest = _finest(light, candidate.vectors)
        if not any(_same(finest, other, _AROUND) for other in chosen):
            chosen.append(finest)
    chosen = _singles(middles, chosen)
    best = _ranked(spectra, _distinct([_polished(gaps, vectors) for vectors in chosen], _NEAR))
    if best[0].score < _KEPT * ranked[0].score:  # sheared, or no lattice of one pitch
        first, second = reduced(ranked[0].vectors.row, ranked[0].vectors.column)
        if math.hypot(*second) > _SHEARED * math.hypot(*first):
            raise CalibrationError(_nothing([(first, second)], []))
        best = _ranked(spectra, chosen)
    return _best(best, request, middles[0].shape, (light, gaps))


def _polished(gaps: Gaps, vectors: Vectors) -> Vectors:
    row, column = polished(gaps, vectors)
    again = _vectors(*reduced(row, column))
    return vectors if again is None else again._replace(kinds=vectors.kinds)


def _finest(light: Gaps, vectors: Vectors) -> Vectors:
    """The finest lattice that holds a candidate's points and all harmonics that its light really has.

    Micro-images of 5.5 px repeat on whole pixels after 11 px only: the aliases of high orders leave lines,
    faint ones, at the harmonics of the coarser lattice. Turned, they may repeat after any number of cells.
    """
    if _pitch(vectors) > math.sqrt(_COARSEST) * _ALIASED:
        return vectors
    coarse = np.stack([vectors.column, vectors.row], -1)
    for a, b, d in _SUBLATTICES:
        divided = coarse @ np.linalg.inv(np.array([[a, b], [0, d]], float))
        first, second = reduced(divided[:, 0], divided[:, 1])
        finer = _vectors(first, second) if math.hypot(*first) >= SMALLEST_PITCH else None
        if finer is not None and _pitch(finer) < _ALIASED and _absent(light, coarse, finer):
            return finer
    return vectors


def _absent(light: Gaps, coarse: np.ndarray, finer: Vectors) -> bool:
    """Whether the light has no harmonics, to the order of the finer lattice's first, but its own."""
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


def _singles(features: list[np.ndarray], chosen: list[Vectors]) -> list[Vectors]:
    """The lattices of single lenslets where hexagonal candidates are those of one of three kinds.

    Three kinds of lenslets in turn repeat after sqrt(3) pitches. Their micro-images are alike, so that the
    mean cell resembles itself moved by a third of its diagonal; the places between the lenslets of a
    lattice with one kind do not resemble lenslets, at least not in both light and gaps.
    """
    folded = [_middle(feature, _FOLDED) for feature in features]
    repeats = []
    for vectors in chosen:
        if vectors.layout == "hex" and _pitch(vectors) / math.sqrt(3) >= SMALLEST_PITCH:
            alike = [_likeness(feature, vectors, _THIRDS) for feature in folded]
            if float(np.median(alike)) > _ALIKE:
                repeats.append(_pitch(vectors))
    return [
        _third(v) if v.layout == "hex" and any(abs(_pitch(v) / p - 1) < 2 * _AROUND for p in repeats) else v
        for v in chosen
    ]


def _third(vectors: Vectors) -> Vectors:
    first, second = reduced((vectors.row + vectors.column) / 3, (2 * vectors.row - vectors.column) / 3)
    return Vectors(*_oriented(first, second, "hex"), "hex", 3)


def _likeness(feature: np.ndarray, vectors: Vectors, moves: tuple[tuple[int, int], ...]) -> float:
    """Correlation of the mean cell with itself moved by 24ths of it, the lowest of several ways."""
    pitch, (ny, nx) = _pitch(vectors), feature.shape
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


def _middle(feature: np.ndarray, size: int = _SIZE) -> np.ndarray:
    ny, nx = feature.shape
    y, x = max(0, (ny - size) // 2), max(0, (nx - size) // 2)
    return feature[y : y + size, x : x + size]


def _pairs(
    correlation: np.ndarray, peaks: Peaks, strong: list[int], request: Request
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Refined reduced bases from the shortest strong peaks that are not parallel."""
    limit = 1.12 * request.pitch + 1 if request.pitch is not None else math.inf
    floor = 0.88 * request.pitch - 1 if request.pitch is not None else 0.0
    near = [k for k in strong if floor <= peaks.lengths[k] <= limit][:_MOST]
    lags = peaks.lags[near].astype(float)
    result, seen = [], set()
    better = {}
    for a in range(len(near)):
        for b in range(a + 1, len(near)):
            if not _neighbours(lags[a], lags[b], 0.35):
                continue
            for k in (a, b):
                if k not in better:
                    better[k] = refined(correlation, lags[k])
            first, second = reduced(better[a], better[b])
            key = tuple(np.round(np.concatenate([first, second])).astype(int))
            if key not in seen and min(math.hypot(*first), math.hypot(*second)) >= SMALLEST_PITCH:
                seen.add(key)
                result.append((first, second))
    return result


def _neighbours(first: np.ndarray, second: np.ndarray, slack: float) -> bool:
    a, b = math.hypot(*first), math.hypot(*second)
    sine = abs(first[0] * second[1] - first[1] * second[0]) / (a * b)
    return sine > 0.5 and max(a, b) < (1 + slack) * min(a, b) * 2


def _vectors(first: np.ndarray, second: np.ndarray, longest: float = math.inf) -> Vectors | None:
    """Row and column vector where the basis is that of a square or hexagonal lattice."""
    a, b = math.hypot(*first), math.hypot(*second)
    angle = math.degrees(math.acos(min(1.0, abs(float(first @ second)) / (a * b))))
    if b > _RATIO * a or b > longest or angle < _ANGLES[0]:
        return None
    layout: Layout = "hex" if angle < _ANGLES[1] else "square"
    return Vectors(*_oriented(first, second, layout), layout)


def _nothing(pairs: list[tuple[np.ndarray, np.ndarray]], repeats: list[float]) -> str:
    if pairs:
        first, second = min(pairs, key=lambda pair: math.hypot(*pair[1]))
        angle = math.degrees(math.acos(abs(float(first @ second)) / math.hypot(*first) / math.hypot(*second)))
        return (
            f"the image shows 2 pitches ({math.hypot(*first):.1f}, {math.hypot(*second):.1f} px) "
            f"{angle:.0f} deg apart, where a square or hexagonal lattice has one. "
            "Check that the micro-images have dark gaps on all sides, or pass pitch= yourself."
        )
    return (
        f"the image repeats every {repeats[0]:.1f} px in one direction only. At least 3 x 3 lenslets are "
        "needed, with dark gaps between them."
    )


def _distinct(found: list[Vectors], slack: float) -> list[Vectors]:
    result: list[Vectors] = []
    for one in found:
        size = _area(one)
        alike = [other for other in result if abs(_area(other) - size) < 0.15 * size]
        if not any(_same(one, other, slack) for other in alike):
            result.append(one)
    return result


def _same(one: Vectors, other: Vectors, slack: float) -> bool:
    """Whether two bases span one lattice, to a part of a pitch."""
    matrix = np.stack([other.row, other.column], -1)
    steps = np.linalg.solve(matrix, np.stack([one.row, one.column], -1))
    whole = np.rint(steps)
    return bool(np.abs(steps - whole).max() < slack and abs(abs(np.linalg.det(whole)) - 1) < 1e-9)


def _ranked(spectra: list[Spectrum], found: list[Vectors]) -> list[_Candidate]:
    """Candidates by their score over the harmonics that the coarsest good one has in its first orders.

    First each is judged by its own first orders. There one that is too fine may look as good as the true
    one; over the first orders of the coarser one it misses lines.
    """
    own = [_total(spectra, vectors, math.sqrt(_area(vectors))) for vectors in found]
    good = [v for v, score in zip(found, own, strict=True) if score > _GOOD * max(own)]
    coarsest = max((math.sqrt(_area(v)) for v in good), default=math.inf)
    scores = [_total(spectra, v, coarsest) if s > 0.2 * max(own) else 0.0
              for v, s in zip(found, own, strict=True)]  # fmt: skip
    ranked = [_Candidate(v, score) for v, score in zip(found, scores, strict=True)]
    return sorted(ranked, key=lambda candidate: -candidate.score)


def _total(spectra: list[Spectrum], vectors: Vectors, pitch: float) -> float:
    """Score over the first orders of a pitch, and again over more, which only edges that stand still have."""
    limits = [min(0.46, orders / pitch) for orders in _ORDERS]
    return sum(max(0.0, spectrum.score(vectors, limit)) for spectrum in spectra for limit in limits)


def _area(vectors: Vectors) -> float:
    return abs(float(vectors.row[0] * vectors.column[1] - vectors.row[1] * vectors.column[0]))


def _best(
    ranked: list[_Candidate], request: Request, shape: tuple[int, ...], pictures: tuple[Gaps, ...]
) -> Vectors:
    allowed = [c for c in ranked if request.allows(c.vectors, _pitch(c.vectors) / min(shape) / 2)]
    if not allowed:
        best = ranked[0].vectors
        raise CalibrationError(
            f"the image has no lattice of {_asked(request)}: it has a {_told(best)}. "
            f"Leave out what does not fit, or pass pitch={_pitch(best):.1f}."
        )
    best = allowed[0]
    if best.score < _EVIDENCE:
        raise CalibrationError(
            f"the image shows no lattice for certain: the likeliest, a {_told(best.vectors)}, scores "
            f"{best.score:.1f} where {_EVIDENCE:g} is needed. Use an evenly lit, focused white image with "
            "dark gaps between at least 3 x 3 micro-images, or pass pitch= and layout=."
        )
    slack = min(0.2, 1.5 * _pitch(best.vectors) / min(shape))  # one bin and a half of the spectrum
    others = [c for c in allowed[1:] if c.score > _MARGIN * best.score]
    others = [c for c in others if not _same(c.vectors, best.vectors, slack)]
    others = [c for c in others if not all(_faint(one, c.vectors, best.vectors) for one in pictures)]
    if others:
        raise CalibrationError(
            f"the image shows {1 + len(others)} pitches that are about equally likely, "
            f"a {_told(best.vectors)} and a {_told(others[0].vectors)}. Pass pitch=, layout= or rotation=."
        )
    return best.vectors


def _without_beats(found: list[Vectors], pictures: tuple[Gaps, ...]) -> list[Vectors]:
    """Lattices but those that are beats of a finer one with the pixels: where edges are sharp, they have
    many lines, but faint ones. Those that repeat after few of the finer one's cells are left to `_finest`.
    """
    fine = [one for one in found if _pitch(one) < _ALIASED]
    return [v for v in found if not any(_beats(pictures, v, one) for one in fine)]


def _beats(pictures: tuple[Gaps, ...], vectors: Vectors, finer: Vectors) -> bool:
    """Whether a candidate is coarser than another, faint beside it, and more than a few of its cells."""
    if _area(vectors) < 1.05 * _area(finer) or not all(_faint(one, vectors, finer) for one in pictures):
        return False
    steps = np.linalg.solve(
        np.stack([finer.row, finer.column], -1), np.stack([vectors.row, vectors.column], -1)
    )
    return bool(np.abs(steps - np.rint(steps)).max() > _AROUND or abs(np.linalg.det(steps)) > _COARSEST + 0.5)


def _faint(picture: Gaps, vectors: Vectors, best: Vectors) -> bool:
    """Whether a candidate's first harmonics are next to nothing beside those of the best one.

    Lines count by how far they stand out of their surroundings: on a clean picture, a coarser lattice has
    one at each beat of the true one with the pixels or with a pattern of dead lenslets.
    """
    mine, rest = (picture.heights(_first(one)) for one in (best, vectors))
    return bool(rest.max() < _ABSENT * mine.min())


def _first(vectors: Vectors) -> np.ndarray:
    """First harmonics (2 or 3, 2) of a lattice, of one half plane [1/px]."""
    steps = np.stack(np.meshgrid(*2 * [np.arange(-1, 2)], indexing="ij"), -1).reshape(-1, 2)
    waves = steps @ np.linalg.inv(np.stack([vectors.column, vectors.row], -1))
    waves = waves[(waves[:, 1] > 0) | ((waves[:, 1] == 0) & (waves[:, 0] > 0))]
    return waves[np.argsort(np.hypot(*waves.T))[: 3 if vectors.layout == "hex" else 2]]


def _pitch(vectors: Vectors) -> float:
    return (math.hypot(*vectors.row) + math.hypot(*vectors.column)) / 2


def _told(vectors: Vectors) -> str:
    turn = math.degrees(math.atan2(*vectors.row))
    return f"{vectors.layout} lattice of pitch {_pitch(vectors):.2f} px turned by {turn:+.2f} deg"


def _asked(request: Request) -> str:
    parts = [
        f"layout {request.layout!r}" if request.layout else "",
        f"pitch {request.pitch:g} px" if request.pitch is not None else "",
        f"rotation {math.degrees(request.rotation):.2f} deg" if request.rotation is not None else "",
    ]
    return ", ".join(part for part in parts if part)


def _oriented(first: np.ndarray, second: np.ndarray, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Row vector nearest to +x, and the vector to the next row 90° or 60° further towards +y."""
    around = [first, second, -first, -second]
    if layout == "hex":
        third = first - second if first @ second > 0 else first + second
        around += [third, -third]
    angles = [math.atan2(y, x) for y, x in around]
    row = min(range(len(around)), key=lambda k: (round(abs(angles[k]), 6), -angles[k]))
    step = math.pi / 3 if layout == "hex" else math.pi / 2
    turns = [abs(math.remainder(angle - angles[row] - step, 2 * math.pi)) for angle in angles]
    return around[row], around[int(np.argmin(turns))]
