"""The two lattice vectors of a picture, before any micro-image is known.

Candidates are pairs of peaks of the autocorrelation, of the evenly lit picture and of its dark gaps.
Pairs of lines of the spectrum are candidates, too. All are judged in the spectrum: a true lattice has a
line at every harmonic, a coarser one has harmonics without a line, and a finer one misses lines.
"""

import math
from typing import NamedTuple

import numpy as np

from lumigraph.calibration.autocorrelation import SMALLEST_PITCH, Peaks, autocorrelation, reduced, refined
from lumigraph.calibration.following import Lines, followed
from lumigraph.calibration.multiples import AROUND, faint, finest, singles, without_beats, without_lines
from lumigraph.calibration.spectrum import Gaps, PowerSpectrum, polished, single_direction
from lumigraph.calibration.vectors import Vectors
from lumigraph.core.lattice import Layout
from lumigraph.errors import CalibrationError

_LEAST = 0.12  # of the autocorrelation's top; noise alone reaches 0.1 on pictures of 100 px
_PART = 0.3  # of the strongest peak: what may be a neighbour
_MOST = 16  # peaks paired
_ORDERS = (2.6, 4.6)  # of the harmonics are looked at
_EVIDENCE = 6.0  # of the score: noise reaches 3, a lattice on a clean white image 30 to 200
_GOOD = 0.5  # of the best score: what the coarsest must have
_MARGIN = 0.85  # the second candidate must stay below this part of the first
_KEPT = 0.55  # of the score of a candidate must its regular lattice keep
_SHEARED = 1.06  # two pitches that a search finds
_FOLDED = 768  # px of the middle that are folded
_FEWEST = 2.8  # lenslets across a picture
_NEAR = 0.012  # of a pitch, within which two candidates are one
_LOOKED_AT = 4  # candidates polished
_LONGEST = 3.4  # lengths of a rectangular lattice's vectors
_HALF, _CLEARLY = 0.6, 1.2  # of a regular lattice's score: what a rectangular one must have, and at the end
_CERTAIN = 12.0  # of the score of a rectangular one: twice that of a regular one
_ASIDE = 0.16  # of 25 % of the pitch and 6 degrees that a candidate may lie beside the lattice
_DIVISIONS = ((3, 1), (1, 3), (2, 2), (2, 1), (1, 2))  # cells along a row, and down, in one of an alias
_FOLLOWED = 1024  # px of the middle that it is followed in
_SIZE = 2048  # px of the middle of the picture that is looked at


class Request(NamedTuple):
    """Constraints given by the caller: layout, pitch [px] to 10 %, rotation [rad] to 2°."""

    layout: Layout | None = None
    pitch: float | None = None
    rotation: float | None = None

    def near(self, vectors: Vectors) -> bool:
        """True if a candidate is worth a look: it may lose to others, but is not ten times as coarse."""
        return self.pitch is None or 0.4 * self.pitch < math.sqrt(vectors.area) < 2.5 * self.pitch

    def allows(self, vectors: Vectors, slack: float = 0.0) -> bool:
        """True if a candidate is what was asked for; slack [rad] is its own uncertainty."""
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


class _Looked(NamedTuple):
    """Middles (y, x) of a picture's features (light, gaps, smoother gaps), and their spectra."""

    middles: list[np.ndarray]
    spectra: list[PowerSpectrum]
    correlated: list[tuple[np.ndarray, Peaks]]
    gaps: Gaps
    light: Gaps

    @classmethod
    def at(cls, features: list[np.ndarray]) -> "_Looked":
        """Features of a picture, looked at in its middle."""
        middles = [_middle(feature) for feature in features]
        correlations = [autocorrelation(feature) for feature in middles[:2]]
        return cls(
            middles, [PowerSpectrum(feature) for feature in middles],
            [(correlation, Peaks(correlation)) for correlation in correlations],
            Gaps(middles[1]), Gaps(_middle(features[0], _FOLDED)),
        )  # fmt: skip

    @property
    def longest(self) -> float:
        """Longest lattice vector [px] that a picture can show."""
        return max(self.middles[0].shape) / _FEWEST


def lattice_vectors(features: list[np.ndarray], request: Request) -> list[Vectors]:
    """Lattice vectors of a picture, from its features (y, x): light, gaps, smoother gaps.

    Those of a rectangular lattice, where it explains the picture better, come before those of the square or
    hexagonal one: a scene may have lines between those of its lenslets, a white image has none.

    Raises
    ------
    CalibrationError
        No period, or one in a single direction; several lattices; or a pitch, rotation or layout that the
        picture does not support.
    """
    looked, regular, refusal = _Looked.at(features), None, None
    oblong_only = request.layout == "rectangular"
    try:
        regular = _regular(looked, Request() if oblong_only else request)
    except CalibrationError as error:
        refusal = error
    if regular is None and (pitch := single_direction(looked.light)) is not None:
        raise CalibrationError(
            f"the image shows a one-dimensional (cylindrical) lens array: it repeats every {pitch:.2f} px in "
            "one direction only, where a lattice repeats in two. lumigraph has no model of cylindrical "
            "lenslets; if they are round, take a white image with dark gaps on all sides."
        )
    oblong = _oblong(looked, request, regular) if request.layout in (None, "rectangular") else None
    found = [oblong, None if oblong_only else regular]
    if regular is not None and oblong_only and oblong is None:
        raise CalibrationError(_unlike(request, regular))
    if refusal is not None and oblong is None:
        raise refusal
    return [one for one in found if one is not None]


def _oblong(looked: _Looked, request: Request, regular: Vectors | None) -> Vectors | None:
    """The rectangular lattice that explains a picture far better than a square or hexagonal one, or None."""
    pairs = [pair for spectrum in looked.spectra for pair in spectrum.pairs(_LONGEST)]
    for correlation, peaks in looked.correlated:
        pairs += _pairs(correlation, peaks, peaks.strong(_PART * peaks.top()), request, _LONGEST)
    found = [Vectors.rectangular(first, second, looked.longest) for first, second in pairs]
    found = _distinct([v for v in found if v is not None and request.near(v)], _NEAR)
    ranked = _ranked(looked.spectra, found) if found else []
    ranked = [c for c in ranked if c.score > _HALF * _rival(looked, regular, c.vectors)][:_LOOKED_AT]
    if not ranked:
        return None
    lines = [Lines.of(_middle(feature, _FOLLOWED)) for feature in looked.middles[:2]]
    polished = [one for c in ranked for one in _straightened(lines, c.vectors)]
    again = [c for c in _ranked(looked.spectra, _distinct(polished, _NEAR)) if request.allows(c.vectors)]
    if not again:
        return None
    best = _undivided(looked.light, again[0].vectors)
    if regular is not None and without_lines(looked.light, best, regular):
        return None
    clearly = _CLEARLY if regular is not None and regular.is_regular else 1.0
    score = max(again[0].score, _total(looked.spectra, best, math.sqrt(best.area)))
    return best if score > max(_CERTAIN, clearly * _rival(looked, regular, best)) else None


def _undivided(light: Gaps, vectors: Vectors) -> Vectors:
    """The finest rectangular lattice that has all lines of one that may hold several of its cells."""
    for parts in _DIVISIONS:
        row, column = vectors.row / parts[0], vectors.column / parts[1]
        if min(math.hypot(*row), math.hypot(*column)) < SMALLEST_PITCH:
            continue
        finer = Vectors.rectangular(row, column)
        if finer is not None and without_lines(light, vectors, finer):
            return finer
    return vectors


def _rival(looked: _Looked, regular: Vectors | None, vectors: Vectors) -> float:
    """Score of a regular lattice over the first orders of the coarser of it and a rectangular one."""
    if regular is None:
        return 0.0
    return _total(looked.spectra, regular, math.sqrt(max(regular.area, vectors.area)))


def _straightened(lines: list[Lines], vectors: Vectors) -> list[Vectors]:
    """Rectangular lattices near one that the lines of light and gaps follow, and itself."""
    result = [vectors]
    for each in lines:
        found = followed(each, np.stack([vectors.column, vectors.row], -1), False, share=_ASIDE)
        if found is not None and (one := Vectors.rectangular(*reduced(*found.basis.T))) is not None:
            result.append(one)
    return result


def _regular(looked: _Looked, request: Request) -> Vectors:
    """Vectors of a square or hexagonal lattice."""
    middles, spectra, gaps, light = looked.middles, looked.spectra, looked.gaps, looked.light
    pairs, tops, repeats = [], [], []
    for correlation, peaks in looked.correlated:
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
    for spectrum in spectra:
        pairs += spectrum.pairs()
    found = [Vectors.of(first, second, looked.longest) for first, second in pairs]
    found = _distinct([v for v in found if v is not None and request.near(v)], _NEAR)
    if not found:
        raise CalibrationError(_nothing(pairs, repeats[int(np.argmax(tops))]))
    ranked = _ranked(spectra, without_beats(found, (light, gaps)))
    best = _looked_at(looked, ranked)
    return _best(best, request, middles[0].shape, (light, gaps))


def _looked_at(looked: _Looked, ranked: list[_Candidate]) -> list[_Candidate]:
    """The likeliest candidates, made regular where they are."""
    chosen: list[Vectors] = []
    for candidate in ranked:
        if len(chosen) == _LOOKED_AT or candidate.score < 0.5 * ranked[0].score:
            break
        one = finest(looked.light, candidate.vectors)
        if not any(one.same(other, AROUND) for other in chosen):
            chosen.append(one)
    chosen = singles([_middle(feature, _FOLDED) for feature in looked.middles], chosen)
    best = _ranked(looked.spectra, _distinct([_polished(looked.gaps, vectors) for vectors in chosen], _NEAR))
    if best[0].score < _KEPT * ranked[0].score:  # sheared, or no lattice of one pitch
        first, second = reduced(ranked[0].vectors.row, ranked[0].vectors.column)
        if math.hypot(*second) > _SHEARED * math.hypot(*first):
            raise CalibrationError(_nothing([(first, second)], []))
        best = _ranked(looked.spectra, chosen)
    return best


def _polished(gaps: Gaps, vectors: Vectors) -> Vectors:
    row, column = polished(gaps, vectors)
    again = Vectors.of(*reduced(row, column))
    return vectors if again is None else again._replace(kinds=vectors.kinds)


def _middle(feature: np.ndarray, size: int = _SIZE) -> np.ndarray:
    ny, nx = feature.shape
    y, x = max(0, (ny - size) // 2), max(0, (nx - size) // 2)
    return feature[y : y + size, x : x + size]


def _pairs(
    correlation: np.ndarray, peaks: Peaks, strong: list[int], request: Request, ratio: float = 1.35
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Refined reduced bases from the shortest strong peaks that are not parallel."""
    limit, floor = math.inf, 0.0
    if request.pitch is not None:  # the mean of two lengths up to a ratio
        wide = 1.0 if ratio < 2 else 2 * ratio / (1 + ratio)
        limit, floor = 1.12 * wide * request.pitch + 1, 0.88 * (2 - wide) * request.pitch - 1
    near = [k for k in strong if floor <= peaks.lengths[k] <= limit][:_MOST]
    lags = peaks.lags[near].astype(float)
    result, seen = [], set()
    better = {}
    for a in range(len(near)):
        for b in range(a + 1, len(near)):
            if not _neighbours(lags[a], lags[b], 2 * ratio):
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


def _neighbours(first: np.ndarray, second: np.ndarray, ratio: float) -> bool:
    a, b = math.hypot(*first), math.hypot(*second)
    sine = abs(first[0] * second[1] - first[1] * second[0]) / (a * b)
    return sine > 0.5 and max(a, b) < ratio * min(a, b)


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
        size = one.area
        alike = [other for other in result if abs(other.area - size) < 0.15 * size]
        if not any(one.same(other, slack) for other in alike):
            result.append(one)
    return result


def _ranked(spectra: list[PowerSpectrum], found: list[Vectors]) -> list[_Candidate]:
    """Candidates by their score over the harmonics that the coarsest good one has in its first orders.

    First each is judged by its own first orders. There one that is too fine may look as good as the true
    one; over the first orders of the coarser one it misses lines.
    """
    own = [_total(spectra, vectors, math.sqrt(vectors.area)) for vectors in found]
    good = [v for v, score in zip(found, own, strict=True) if score > _GOOD * max(own)]
    coarsest = max((math.sqrt(v.area) for v in good), default=math.inf)
    scores = [_total(spectra, v, coarsest) if s > 0.2 * max(own) else 0.0
              for v, s in zip(found, own, strict=True)]  # fmt: skip
    ranked = [_Candidate(v, score) for v, score in zip(found, scores, strict=True)]
    return sorted(ranked, key=lambda candidate: -candidate.score)


def _total(spectra: list[PowerSpectrum], vectors: Vectors, pitch: float) -> float:
    """Score over the first orders of a pitch, and again over more, which only edges that stand still have."""
    limits = [min(0.46, orders / pitch) for orders in _ORDERS]
    return sum(max(0.0, spectrum.score(vectors, limit)) for spectrum in spectra for limit in limits)


def _best(
    ranked: list[_Candidate], request: Request, shape: tuple[int, ...], pictures: tuple[Gaps, ...]
) -> Vectors:
    allowed = [c for c in ranked if request.allows(c.vectors, c.vectors.pitch / min(shape) / 2)]
    if not allowed:
        best = ranked[0].vectors
        raise CalibrationError(_unlike(request, best))
    best = allowed[0]
    if best.score < _EVIDENCE:
        raise CalibrationError(
            f"the image shows no lattice for certain: the likeliest, a {_told(best.vectors)}, scores "
            f"{best.score:.1f} where {_EVIDENCE:g} is needed. Use an evenly lit, focused white image with "
            "dark gaps between at least 3 x 3 micro-images, or pass pitch= and layout=."
        )
    slack = min(0.2, 1.5 * best.vectors.pitch / min(shape))  # one bin and a half of the spectrum
    others = [c for c in allowed[1:] if c.score > _MARGIN * best.score]
    others = [c for c in others if not c.vectors.same(best.vectors, slack)]
    others = [c for c in others if not all(faint(one, c.vectors, best.vectors) for one in pictures)]
    if others:
        raise CalibrationError(
            f"the image shows {1 + len(others)} pitches that are about equally likely, "
            f"a {_told(best.vectors)} and a {_told(others[0].vectors)}. Pass pitch=, layout= or rotation=."
        )
    return best.vectors


def _unlike(request: Request, best: Vectors) -> str:
    return (
        f"the image has no lattice of {_asked(request)}: it has a {_told(best)}. "
        f"Leave out what does not fit, or pass pitch={best.pitch:.1f}."
    )


def _told(vectors: Vectors) -> str:
    turn = math.degrees(math.atan2(*vectors.row))
    return f"{vectors.layout} lattice of pitch {vectors.pitch:.2f} px turned by {turn:+.2f} deg"


def _asked(request: Request) -> str:
    parts = [
        f"layout {request.layout!r}" if request.layout else "",
        f"pitch {request.pitch:g} px" if request.pitch is not None else "",
        f"rotation {math.degrees(request.rotation):.2f} deg" if request.rotation is not None else "",
    ]
    return ", ".join(part for part in parts if part)
