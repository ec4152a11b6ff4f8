r"""Main lenses whose aberrations change over the field: images of all their points by few lenses.

Intensity behind the lens of a field θ is linear in what that lens makes of two places of light, which is
smooth in θ. So the images of all fields follow from those of a few, chosen ones,

.. math:: A(\theta) = \sum_r \varphi_r(\theta) A_r

(docs/theory/lenslets.md). Images of a few points behind them tell which, how many, and how far off fields
between them are, which is stated.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeVar

import numpy as np

from lumigraph.core.grid import Grid
from lumigraph.core.linear import Chain, Linear, Sum
from lumigraph.elements import ThinLens, Train
from lumigraph.elements.field_plate import OF_ONE_LENS, FieldPlate
from lumigraph.errors import GeometryError, SamplingError
from lumigraph.operators.sampling.camera import CameraOptics
from lumigraph.operators.sampling.sample_weights import SampleWeights

COUNTS = (3, 5, 7, 9, 11)
"""Nodes along each axis that are tried."""

SHARE = 0.6
"""Part of the accuracy that fields between the nodes may be off by."""

CHOSEN = 0.4
"""Part of the accuracy that lenses at the nodes may be off by that are not chosen."""

KEPT = 2**13
"""Numbers that stand for an image when lenses are told apart; distances stay right to some 1.5 %."""

ALONE = np.eye(2)[None]
"""Mirrors of a camera that has none: the fields themselves."""

ASIDE = 1.1
"""Fields that reach farther to one side than this, of half of them, are not mirrored."""

Pair = tuple[float, float]

M = TypeVar("M", bound=Linear)

Image = Callable[[CameraOptics], np.ndarray]
"""Of some points behind a camera's lens: what tells lenses apart, as one row of numbers."""


def plate_of(camera: CameraOptics) -> FieldPlate | None:
    """Plate of the main lens that changes over the field; None where nothing does."""
    return next((part for part in camera.lens.elements if isinstance(part, FieldPlate)), None)


def at(camera: CameraOptics, y: float, x: float) -> CameraOptics:
    """The camera with the lens that light of a field has, tangents (y, x)."""
    elements = []
    for part in camera.lens.elements:
        if isinstance(part, FieldPlate):
            plate = part.at(y, x, camera.wavelength)
            if not plate.coefficients and plate.axes == (1.0, 1.0) and plate.center == (0.0, 0.0):
                return replace(camera, lens=_ideal(camera, plate.diameter))
            part = plate
        elements.append(part)
    return replace(camera, lens=Train(elements))


def _ideal(camera: CameraOptics, diameter: float) -> Train:
    """A round lens with its stop, whose light is known better than that behind a plate."""
    return Train(replace(p, diameter=diameter) for p in camera.lens.elements if isinstance(p, ThinLens))


def some(camera: CameraOptics) -> list[CameraOptics]:
    """The camera with lenses from all over the field, or itself."""
    plate = plate_of(camera)
    if plate is None:
        return [camera]
    (down, across), steps = plate.aberrations.reach, (-1.0, -0.5, 0.0, 0.5, 1.0)
    if plate.aberrations.y is None:
        return [at(camera, 0.0, across * step) for step in steps[2:]]
    return [at(camera, *plate.aberrations.nearest(a * down, b * across)) for a in steps for b in steps]


def check_one(camera: CameraOptics) -> None:
    """Refuse a camera whose lens changes over the field.

    Raises
    ------
    GeometryError
        It does.
    """
    if plate_of(camera) is not None:
        raise GeometryError(OF_ONE_LENS)


@dataclass(frozen=True, slots=True)
class StandInLens:
    """A lens that stands for others.

    Parameters
    ----------
    field
        (y, x), tangents.
    source, mirror
        The field that it mirrors, or itself, and the number of the mirror.
    """

    field: Pair
    source: Pair
    mirror: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class FieldLenses:
    """Fields whose lenses stand for all others.

    Parameters
    ----------
    chosen
        Those lenses.
    shares
        Of each chosen lens in those of all nodes (R, n, n).
    middle, half
        Of the fields along y and x that the nodes lie in.
    left
        What fields between the nodes are off by, relative rms, at the worst of those tried.
    """

    chosen: tuple[StandInLens, ...]
    shares: np.ndarray
    middle: Pair
    half: Pair
    left: float

    @property
    def sources(self) -> list[Pair]:
        """Fields whose lenses the chosen ones mirror, each once."""
        return list(dict.fromkeys(one.source for one in self.chosen))

    def weights(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Weights of the chosen lenses (R, ny, nx), for fields at y (ny,) and x (nx,)."""
        down, across = (
            lagrange(self.shares.shape[1], (np.asarray(at) - middle) / half)
            for at, middle, half in zip((y, x), self.middle, self.half, strict=True)
        )
        return np.einsum("rij,iy,jx->ryx", self.shares, down, across, optimize=True)


def nodes(count: int) -> np.ndarray:
    """Chebyshev's, from -1 to 1."""
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)[::-1]


def lagrange(count: int, at: np.ndarray) -> np.ndarray:
    """Lagrange's polynomials (count, n) on Chebyshev's nodes."""
    known, degree = nodes(count), np.arange(count)
    basis = np.cos(degree[:, None] * np.arccos(known))
    basis[0] /= 2
    clipped = np.clip(at, -1 - 1e-9, 1 + 1e-9)
    return 2 / count * basis.T @ np.cos(degree[:, None] * np.arccos(np.clip(clipped, -1, 1)))


def sketch(image: np.ndarray) -> np.ndarray:
    """`KEPT` numbers of an image (n,) whose distances are those of images: sums of every KEPTth, by signs.

    The signs are drawn once for all images of a size. W. Johnson, J. Lindenstrauss, Contemp. Math. 26, 189
    (1984); M. Charikar, K. Chen, M. Farach-Colton, Theor. Comput. Sci. 312, 3 (2004).
    """
    if len(image) <= KEPT:
        return image.astype(np.float64)
    whole = np.zeros(math.ceil(len(image) / KEPT) * KEPT)
    signs = np.random.default_rng(0).integers(0, 2, len(image), np.int8) * 2 - 1
    whole[: len(image)] = image * signs
    return whole.reshape(-1, KEPT).sum(0)


def lenses(
    camera: CameraOptics,
    fields: tuple[np.ndarray, np.ndarray],
    image: Image,
    accuracy: float,
    mirrors: np.ndarray = ALONE,
) -> FieldLenses:
    """The fewest lenses that fields along y and along x have, to a part of the accuracy, relative rms.

    Parameters
    ----------
    camera
        Whose lens changes over the field.
    fields
        Along y and along x, tangents.
    image
        What tells lenses apart.
    accuracy
        Of operators.
    mirrors
        Matrices (n, 2, 2) of what fields (y, x) become in mirrors that change nothing else, the first of
        them the fields themselves: where a lens is chosen, all that it mirrors may be.

    Raises
    ------
    GeometryError
        Fields that lie beyond those at which the aberrations are given.
    SamplingError
        Aberrations that change faster than `COUNTS` can follow.
    """
    plate = plate_of(camera)
    assert plate is not None  # asked by those who call
    ends = [(float(at.min()), float(at.max())) for at in fields]
    corners = np.array([(a, b) for a in ends[0] for b in ends[1]])
    plate.aberrations.check(corners[:, 0], corners[:, 1])
    if any(max(map(abs, pair)) > ASIDE * max((pair[1] - pair[0]) / 2, 1e-12) for pair in ends):
        mirrors = ALONE
    if len(mirrors) > 1:
        ends = [(-max(map(abs, pair)), max(map(abs, pair))) for pair in ends]
    middle = (sum(ends[0]) / 2, sum(ends[1]) / 2)
    half = tuple(max((high - low) / 2, 1e-12) for low, high in ends)
    known: dict[Pair, np.ndarray] = {}

    def seen(field: Pair) -> np.ndarray:
        key = round(field[0], 12), round(field[1], 12)
        if key not in known:
            known[key] = sketch(image(at(camera, *key)))
        return known[key]

    search = _LensSearch(seen, middle, (half[0], half[1]), accuracy, mirrors)
    goal, tried = SHARE * accuracy, [(0, math.inf), (1, math.inf)]
    for count in COUNTS:
        if count < min(_enough(tried, goal), COUNTS[-1]):
            continue
        found = search.with_nodes(count)
        if found.left <= goal:
            return found
        tried.append((count, found.left))
    least = min(left for _, left in tried)
    raise SamplingError(
        f"aberrations change so fast over the field that lenses between {COUNTS[-1]} x {COUNTS[-1]} "
        f"others are off by {least:.2g} rms; accuracy {accuracy:g} allows {goal:.2g}. "
        f"Ask for {least / SHARE:.2g}, or use a smaller field; single points are not interpolated."
    )


def _enough(tried: Sequence[tuple[int, float]], goal: float) -> float:
    """Nodes that leave no more than a goal, where each leaves a part of what the one before it left."""
    (fewer, more), (count, left) = tried[-2:]
    if math.isinf(more) or not left < more:
        return count + 1
    return count + math.log(left / goal) * (count - fewer) / math.log(more / left) - 0.5


TRIED = ((0.97, 0.93), (-0.88, 0.31), (0.05, -0.6), (-0.41, -0.77))
"""Fields, of half of them, at which interpolation is measured."""


@dataclass(frozen=True, slots=True)
class _LensSearch:
    """Search for the lenses of fields around a `middle`, up to `half` of them away; see `lenses`."""

    seen: Callable[[Pair], np.ndarray]
    middle: Pair
    half: Pair
    accuracy: float
    mirrors: np.ndarray

    def with_nodes(self, count: int) -> FieldLenses:
        """Lenses that are found with so many nodes along each axis."""
        places = [self._field(y, x) for y in nodes(count) for x in nodes(count)]
        known = np.array([self.seen(place) for place in places])
        chosen, rows = self._chosen(places, known)
        shares = np.linalg.lstsq(rows.T, known.T, rcond=None)[0].reshape(-1, count, count)
        found, off = FieldLenses(chosen, shares, self.middle, self.half, 0.0), 0.0
        for y, x in TRIED:
            field = self._field(y, x)
            weights, expected = found.weights(*np.array(field)[:, None])[:, 0, 0], self.seen(field)
            off = max(off, float(np.linalg.norm(weights @ rows - expected) / np.linalg.norm(expected)))
        return replace(found, left=off)

    def _field(self, y: float, x: float) -> Pair:
        return self.middle[0] + y * self.half[0], self.middle[1] + x * self.half[1]

    def _chosen(
        self, places: Sequence[Pair], known: np.ndarray
    ) -> tuple[tuple[StandInLens, ...], np.ndarray]:
        """Lenses of which all at some places are sums, and their images (R, m)."""
        least, chosen, rows = CHOSEN * self.accuracy, [], []
        norms, rest, basis = np.linalg.norm(known, axis=1), known.copy(), np.zeros((0, known.shape[1]))
        off = np.ones(len(places))
        worst = len(places) // 2  # light from the axis is the same in mirrors: its operator costs least
        while not chosen or off[worst] > least:
            for one in self._mirrored(places[worst]):
                row = self.seen(one.field)
                new = row - (row @ basis.T) @ basis
                new -= (new @ basis.T) @ basis  # once is not enough in finite precision
                if np.linalg.norm(new) <= least * np.linalg.norm(row):
                    continue
                new /= np.linalg.norm(new)
                basis, rest = np.vstack((basis, new)), rest - np.outer(rest @ new, new)
                chosen.append(one)
                rows.append(row)
            off = np.linalg.norm(rest, axis=1) / norms
            worst = int(np.argmax(off))
        return tuple(chosen), np.array(rows)

    def _mirrored(self, field: Pair) -> list[StandInLens]:
        """A field and all that it mirrors, from the one of them that has the largest coordinates."""
        fields = [(float(y), float(x)) for y, x in self.mirrors @ field]
        source = max(fields, key=lambda one: (round(min(one), 12), round(max(one), 12)))
        found: dict[Pair, StandInLens] = {}
        for number, (y, x) in enumerate(self.mirrors @ source):
            found.setdefault((round(y, 12), round(x, 12)), StandInLens((float(y), float(x)), source, number))
        return list(found.values())


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FieldOperator(Sum):
    """Operator of a camera whose main lens changes over the field: of few lenses, each of its share."""

    left: float = 0.0
    held: float = 0.0

    title: ClassVar[str] = "Operator of a lens that changes over the field"

    @property
    def memory_bytes(self) -> float:
        """Memory of the operators, those that mirror others not counted, and of their shares [bytes]."""
        return self.held + 4.0 * len(self.maps) * math.prod(self.shape[0])

    @property
    def error(self) -> float:
        """Relative rms error of the operators, and of fields between those of their lenses."""
        return math.hypot(max(part.error for part in self.maps), self.left)


def operator(
    camera: CameraOptics,
    grid: Grid,
    distance: float,
    found: FieldLenses,
    of: Callable[[CameraOptics], M],
    mirrored: Callable[[M, int], Linear] | None = None,
) -> FieldOperator:
    """Operator of a plane at a distance [m], by operators `of` cameras with one lens and `mirrored` ones."""
    weights = found.weights(grid.y / distance, grid.x / distance).astype(np.float32)
    known = {source: of(at(camera, *source)) for source in found.sources}
    maps: list[Linear] = []
    for one, weight in zip(found.chosen, weights, strict=True):
        part: Linear = known[one.source]
        if one.mirror and mirrored is not None:
            part = mirrored(known[one.source], one.mirror)
        maps.append(Chain((SampleWeights(weight), part), object_grid=grid))
    held = sum(part.memory_bytes for part in known.values())
    return FieldOperator(
        tuple(maps), (1.0,) * len(maps), left=found.left, held=held + weights.nbytes, object_grid=grid
    )
