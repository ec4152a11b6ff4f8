"""The lattice of a picture that is looked at as a whole: `whole`."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from lumigraph.calibration.borders import border, edges
from lumigraph.calibration.centres import Spots, followed, measure
from lumigraph.calibration.fitting import Fitted, fit, recentred
from lumigraph.calibration.following import followed as light_followed
from lumigraph.calibration.overlap import OverlappingDiscs, overlapping, separated
from lumigraph.calibration.period import Request, lattice_vectors
from lumigraph.calibration.quality import fill_of, near_centre, sharpness_of
from lumigraph.calibration.surface import Surface, flattened
from lumigraph.calibration.template import mean_cell, sharpened
from lumigraph.calibration.vectors import Vectors
from lumigraph.core.calibration import Calibration
from lumigraph.core.gaps import logarithm, valleys
from lumigraph.core.lattice import Lattice, Vector
from lumigraph.core.progress import Progress, Stage, within
from lumigraph.errors import CalibrationError

_PARTS = (0.3, 0.45, 0.65, 0.85)  # of the picture that the fit grows over
_CLEAR = 0.15  # px of residual below which a picture is a white image for certain
_BETTER = 0.8  # of the residual at which gaps are trusted more than light
_SHARPENED = 6.0  # px of pitch from which the mean micro-image has enough pixels
_AGREED = 0.01  # of a pitch
_LARGEST = 0.02  # of the pitch: a white image's residual
_WHITE = 0.6  # of the lenslets are found on a white image
_SHARE = 0.4  # of the lenslets must be found on a raw image
_BY_LIGHT = ("light", "sharp")
_STEADY = 0.12  # of a pitch that the quarters of a picture may place it apart: 0.02 and 0.06 on real ones
_SMALL, _GROUND = 0.5, 0.1  # of the pitch: a spot's width; of its light: the ground half a pitch aside
_CORE = 0.12  # of the pitch around a place where its light is looked at
_BRIGHTER = 0.3  # of the contrast by which a lattice's points may be darker than places half a pitch aside
_UNMEASURED = (
    "found by all gaps of a raw image together: no single centre was measured, so that no residual is known; "
    "check the overlay, or calibrate on a white image"
)


How = Literal["light", "sharp", "edges", "gaps", "logarithm", "discs", "nothing"]
"""Source of the centres: first harmonics of the light, the mean micro-image, the edges of a few large discs,
the dark gaps, the logarithm
of the picture, overlapping discs; or nothing, where none was measured."""


class FoundLattice(NamedTuple):
    """A fit, how it was found, and what is to be known of it."""

    fitted: Fitted
    how: How
    notes: tuple[str, ...] = ()
    white: bool = False
    fill: float | None = None
    sharpness: tuple[float, ...] = ()
    spread: float = (
        0.0  # px that the quarters of the picture place the lattice apart, where none was measured
    )

    @property
    def measured(self) -> bool:
        """True if single centres were measured."""
        return self.how != "nothing"


def whole(original: np.ndarray, request: Request, progress: Progress | None = None) -> FoundLattice:
    """The lattice of a picture (y, x), and the centres of its micro-images.

    Raises
    ------
    CalibrationError
        No lattice, several that are about equally likely, or one that does not hold all over the picture.
    """
    shape = (original.shape[0], original.shape[1])
    flat = flattened(original)
    gaps = valleys(original, 1.0)
    tell = within(progress, 0, 1)
    tell(Stage(0.0, "period of the lattice"))
    candidates = lattice_vectors([flat, gaps, valleys(original, 2.0)], request)
    tell(Stage(0.4, "centres of micro-images"))
    found = _likelier(original, flat, gaps, candidates)
    start = found.fitted if found.measured else _by_lines(flat, found.fitted)
    cell = mean_cell(flat, start.model(shape))
    discs = overlapping(cell, start.lattice)
    found = found._replace(fill=fill_of(cell)) if discs is None else _overlapped(flat, start, discs)
    _check_spread(found)
    tell(Stage(0.9, "micro-images"))
    return found._replace(sharpness=sharpness_of(original, found.fitted.model(shape)))


def _likelier(
    original: np.ndarray, flat: np.ndarray, gaps: np.ndarray, candidates: list[Vectors]
) -> FoundLattice:
    """The fit to the first lattice that micro-images stand on as on a white image, or to the last."""
    shape = (flat.shape[0], flat.shape[1])
    for vectors in candidates[:-1]:
        try:
            _check_size(vectors, shape)
            if (found := _followed(original, flat, gaps, vectors)).white:
                return found
        except CalibrationError:
            continue  # the last one says what is wrong
    last = candidates[-1]
    _check_size(last, shape)
    found = _followed(original, flat, gaps, last)
    if last.layout == "rectangular" and not found.white:
        spread = _spread(found.fitted)
        why = (
            f"its micro-images are {spread:.2f} px off it, where {_CLEAR:g} px are allowed"
            if spread > _CLEAR
            else "only the gaps between its micro-images were found, not their light"
        )
        raise CalibrationError(
            f"the likeliest lattice is rectangular, of pitches {np.hypot(*last.column):.2f} x "
            f"{np.hypot(*last.row):.2f} px, but {why}. Take a white image."
        )
    return found


def _check_spread(found: FoundLattice) -> None:
    lattice = found.fitted.lattice
    if found.spread > _STEADY * lattice.pitch:
        raise CalibrationError(
            f"the quarters of the picture do not agree on the lattice of pitch {lattice.pitch:.2f} px: they "
            f"place it {found.spread:.2f} px apart, where {_STEADY * lattice.pitch:.2f} px is too much, and "
            "no centre could be measured. Take a white image, with gaps between micro-images."
        )


def _by_lines(flat: np.ndarray, fitted: Fitted) -> Fitted:
    """The lattice that the light repeats on, where the gaps could not be followed."""
    lattice = fitted.lattice
    found = light_followed(flat, lattice.matrix, lattice.layout == "hex")
    if found is None:
        return fitted
    column, row = found.basis.T
    return fitted._replace(lattice=replace(lattice, basis=(_vector(row), _vector(column))))


def _overlapped(flat: np.ndarray, fitted: Fitted, discs: OverlappingDiscs) -> FoundLattice:
    """The fit to discs that overlap, with what is to be known of it."""
    note = (
        f"micro-images overlap, they are {discs.size:.2f} pitches wide: their centres were found by the sum "
        "of such discs; close the main lens for less cross-talk"
    )
    return FoundLattice(separated(flat, fitted, discs), "discs", (note,), white=True, fill=discs.size)


def _followed(original: np.ndarray, flat: np.ndarray, gaps: np.ndarray, vectors: Vectors) -> FoundLattice:
    """The fit to the light of the micro-images, or to what is between them where that is steadier."""
    above = original - np.float32(original.min())
    found, refused = [], []
    try:
        light = _by_light(flat, above, vectors)
        clear = _spread(light.fitted) <= _CLEAR or _sparse(mean_cell(flat, light.fitted.model(flat.shape)))
        if clear and _share(light.fitted, flat.shape) > _WHITE:
            return light._replace(white=True)
        found.append(light)
    except CalibrationError as error:
        refused.append(error)
    features: tuple[tuple[How, np.ndarray], ...]
    features = ("gaps", gaps.max() - gaps), ("logarithm", logarithm(original))
    for how, picture in features:
        try:
            found.append(FoundLattice(_outwards(picture, picture, vectors, followed), how))
        except CalibrationError as error:
            refused.append(error)
    steady = [one for one in found if _agrees(one.fitted, vectors)]
    if not steady:
        return _by_gaps(gaps, original, vectors)
    found = steady
    sizes = [_spread(one.fitted) for one in found]
    best = int(np.argmin(sizes))
    if (
        found[0].how in _BY_LIGHT
        and _spread(found[0].fitted) < _LARGEST * found[0].fitted.lattice.pitch
        and sizes[best] > _BETTER * sizes[0]
    ):
        best = 0
    one = found[best]
    if one.how in _BY_LIGHT:
        return one._replace(notes=_uncertain(one.fitted))
    return _on_light(flat, above, one) or one._replace(notes=_raw_notes(one.fitted, original.shape))


def _sparse(cell: np.ndarray) -> bool:
    """True if the mean micro-image (m, m) is a small spot on dark ground, which no scene can move far."""
    fill, dark = fill_of(cell), float(cell.min())
    aside = max(float(cell[part].mean()) for part in _aside(len(cell)))
    center = float(cell[near_centre(len(cell), _CORE)].mean())
    return fill is not None and fill < _SMALL and aside - dark < _GROUND * (center - dark)


def _aside(size: int) -> list[np.ndarray]:
    """Samples of a cell around the places half a pitch aside of its centre, along i, j and both."""
    core, half = near_centre(size, _CORE), size // 2
    return [np.roll(core, move, (0, 1)) for move in ((half, 0), (0, half), (half, half))]


def _on_light(flat: np.ndarray, above: np.ndarray, found: FoundLattice) -> FoundLattice | None:
    """The lattice moved to the light where its points are darker than places half a pitch aside; or None.

    Gaps of sparse spots are as wide as the spots are apart, and their middle looks like a micro-image.

    Raises
    ------
    CalibrationError
        There no centres can be measured.
    """
    shape, lattice = (flat.shape[0], flat.shape[1]), found.fitted.lattice
    cell = mean_cell(flat, found.fitted.model(shape))
    center, aside = float(cell[near_centre(len(cell), _CORE)].mean()), [
        float(cell[part].mean()) for part in _aside(len(cell))
    ]  # fmt: skip
    best = int(np.argmax(aside))
    if aside[best] - center < _BRIGHTER * float(np.ptp(cell)):
        return None
    steps = np.array([(0.5, 0.0), (0.0, 0.5), (0.5, 0.5)][best])
    moved = found.fitted._replace(lattice=lattice.moved(*(float(k) for k in lattice.matrix @ steps)))
    try:
        fitted = fit(measure(above, moved.model(shape)), moved.model(shape))
    except CalibrationError as error:
        raise CalibrationError(
            f"the lattice of pitch {lattice.pitch:.2f} px stands where it is dark: light {center:.3g} on its "
            f"points, {aside[best]:.3g} half a pitch aside, where no centres can be measured ({error}) "
            "Take a white image that is evenly lit."
        ) from error
    return FoundLattice(recentred(fitted, shape), "light", _uncertain(fitted))


def _agrees(fitted: Fitted, vectors: Vectors) -> bool:
    """True if a fit kept to the lattice of all harmonics, apart from two pitches and shear."""
    steps = np.linalg.solve(
        np.stack([vectors.row, vectors.column]).T,
        np.array([fitted.lattice.basis[0], fitted.lattice.basis[1]]).T,
    )
    return bool(np.abs(steps - np.eye(2)).max() < _AGREED)


def _by_gaps(gaps: np.ndarray, original: np.ndarray, vectors: Vectors) -> FoundLattice:
    """The lattice of all harmonics of the gaps; none of its micro-images is measured.

    They stand between the gaps, or between the edges of the picture where those are clearer.
    """
    shape = (gaps.shape[0], gaps.shape[1])
    none = np.zeros((0, 2), np.int64)
    lattice = Lattice(
        (_vector(vectors.row), _vector(vectors.column)), (0.0, 0.0), vectors.layout, vectors.kinds
    )
    model = Calibration(lattice, shape, none, none.astype(float), 0.0)
    found = max((border(gaps, model), border(edges(original), model)), key=lambda one: one.clearness)
    lattice = _centred(lattice.moved(*found.move), shape)
    margin = lattice.pitch / 2
    indices = lattice.indices((margin, shape[0] - 1 - margin), (margin, shape[1] - 1 - margin))
    fitted = Fitted(Spots(indices, lattice.position(indices), np.ones(len(indices))), lattice, None)
    return FoundLattice(fitted, "nothing", (_UNMEASURED,), spread=found.spread)


def _share(fitted: Fitted, shape: tuple[int, ...]) -> float:
    """Micro-images found, of those that are whole on the picture."""
    margin = fitted.lattice.pitch / 2
    ranges = [(margin, n - 1 - margin) for n in shape]
    whole = fitted.model((shape[0], shape[1])).indices_within(ranges[0], ranges[1])
    return len(fitted.spots.indices) / max(len(whole), 1)


def _raw_notes(fitted: Fitted, shape: tuple[int, ...]) -> tuple[str, ...]:
    share = _share(fitted, shape)
    if share < _SHARE:
        raise CalibrationError(
            f"only {share:.0%} of the micro-images of pitch {fitted.lattice.pitch:.2f} px were found on this "
            f"raw image where {_SHARE:.0%} are needed. Take a white image with the same camera settings."
        )
    return (
        "found by the gaps between micro-images of a raw image; a white image shows their centres better",
    )


def _uncertain(fitted: Fitted) -> tuple[str, ...]:
    spread, pitch = _spread(fitted), fitted.lattice.pitch
    if spread <= _LARGEST * pitch:
        return ()
    return (
        f"the micro-images stand {spread:.2f} px from a lattice of pitch {pitch:.2f} px, where a white image "
        f"leaves less than {_LARGEST * pitch:.2f} px: do not trust it without a look at the overlay",
    )


def _spread(fitted: Fitted) -> float:
    """Median distance of the micro-images from the lattice [px]."""
    spots = fitted.spots
    points = fitted.lattice.position(spots.indices)
    points = points if fitted.warp is None else fitted.warp.applied(points)
    return float(np.median(np.hypot(*(spots.centers - points).T)))


def _by_light(flat: np.ndarray, above: np.ndarray, vectors: Vectors) -> FoundLattice:
    """Fit to light, taken again evenly lit, and once more by the mean micro-image if that is steadier."""
    shape = (flat.shape[0], flat.shape[1])
    fitted = _outwards(flat, above, vectors)
    even = _evenly_lit(above, fitted)
    fitted = recentred(fit(measure(even, fitted.model(shape)), fitted.model(shape)), shape)
    if fitted.lattice.pitch >= _SHARPENED:
        better = fitted
        for _ in range(2):
            spots = sharpened(even, better.spots, better.model(shape))
            better = fit(spots, better.model(shape))
        if _spread(better) < _spread(fitted) and len(better.spots.indices) > 0.95 * len(fitted.spots.indices):
            return FoundLattice(better, "sharp")
    return FoundLattice(fitted, "light")


def _outwards(
    picture: np.ndarray, whole: np.ndarray, vectors: Vectors, measured: Callable[..., Spots] = measure
) -> Fitted:
    """Fit the middle first, so that the error of the first guess does not grow over many lenslets."""
    shape = (picture.shape[0], picture.shape[1])
    none = np.zeros((0, 2), np.int64)
    model = Calibration(_starting_lattice(picture, vectors), shape, none, none.astype(float), 0.0)
    fitted = None
    for part, source in (*((part, picture) for part in _PARTS), (1.0, whole), (1.0, whole)):
        spots = measured(source, model, part=part)
        if part < 1 and len(spots.indices) < 50:
            continue
        fitted = fit(spots, model)
        model = fitted.model(shape)
    assert fitted is not None
    return recentred(fitted, shape)


def _check_size(vectors: Vectors, shape: tuple[int, int]) -> None:
    lattice = Lattice((_vector(vectors.row), _vector(vectors.column)), (0.0, 0.0), vectors.layout)
    _check_count(lattice, shape)


def _starting_lattice(picture: np.ndarray, vectors: Vectors) -> Lattice:
    """Lattice whose origin is read off the phases of the two first harmonics of the whole picture."""
    matrix = np.stack([vectors.column, vectors.row], -1)
    windowed = picture - picture.mean()
    windows = [np.hanning(n + 2)[1:-1] for n in picture.shape]
    phases = []
    for ky, kx in np.linalg.inv(matrix):
        wave_y = windows[0] * np.exp(-2j * np.pi * ky * np.arange(picture.shape[0]))
        wave_x = windows[1] * np.exp(-2j * np.pi * kx * np.arange(picture.shape[1]))
        phases.append(-np.angle(wave_y @ (windowed @ wave_x.astype(np.complex64))) / (2 * np.pi))
    origin = matrix @ np.array(phases)
    lattice = Lattice(
        (_vector(vectors.row), _vector(vectors.column)), _vector(origin), vectors.layout, vectors.kinds
    )
    return _centred(lattice, picture.shape)


def _vector(values: np.ndarray) -> Vector:
    return float(values[0]), float(values[1])


def _centred(lattice: Lattice, shape: tuple[int, ...]) -> Lattice:
    """The same points, with index (0, 0) nearest to the middle of the picture."""
    index = np.stack(lattice.index(np.array(shape[0] // 2), np.array(shape[1] // 2)), -1)
    y, x = lattice.position(index)
    return Lattice(lattice.basis, (float(y), float(x)), lattice.layout, lattice.kinds)


def _check_count(lattice: Lattice, shape: tuple[int, ...]) -> None:
    rows, columns = (n / size for n, size in zip(shape, lattice.pitches, strict=True))
    if min(rows, columns) < 3:
        raise CalibrationError(
            f"the white image holds {rows:.1f} x {columns:.1f} lenslets of pitch {lattice.pitch:.1f} px "
            "but a lattice needs at least 3 x 3. Use the whole sensor's picture."
        )


def _evenly_lit(picture: np.ndarray, fitted: Fitted) -> np.ndarray:
    """Picture without the vignetting of its micro-images' brightness, which would move their centres."""
    spots, (ny, nx) = fitted.spots, picture.shape
    y, x = (2 * spots.centers[:, axis] / (n - 1) - 1 for axis, n in enumerate((ny, nx)))
    surface = Surface(4 if len(y) > 100 else 2 if len(y) >= 12 else 1)
    surface.fit(y, x, spots.light / max(float(spots.light.mean()), 1e-30))
    rows, columns = np.linspace(-1, 1, ny, dtype=np.float32), np.linspace(-1, 1, nx, dtype=np.float32)
    return picture / surface(rows[:, None], columns[None, :])
