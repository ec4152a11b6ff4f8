"""From a white image, or a raw image alone, to the places of its micro-images."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lumigraph.calibration.autocorrelation import SMALLEST_PITCH
from lumigraph.calibration.borders import border, edges
from lumigraph.calibration.centres import Spots, followed, measure
from lumigraph.calibration.devignette import as_raw, grey
from lumigraph.calibration.fitting import Fitted, fit, recentred
from lumigraph.calibration.following import followed as light_followed
from lumigraph.calibration.overlap import Discs, overlapping, separated
from lumigraph.calibration.period import Request, Vectors, lattice_vectors
from lumigraph.calibration.quality import fill_of, sharpness_of
from lumigraph.calibration.surface import Surface, flattened
from lumigraph.calibration.template import mean_cell, sharpened
from lumigraph.calibration.unlit import saturated, unlit
from lumigraph.core import checks
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.gaps import logarithm, valleys
from lumigraph.core.lattice import Lattice, Layout, Vector
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError

_PARTS = (0.3, 0.45, 0.65, 0.85)  # of the picture that the fit grows over
_CLEAR = 0.15  # px of residual below which a picture is a white image for certain
_BETTER = 0.8  # of the residual at which gaps are trusted more than light
_SHARPENED = 6.0  # px of pitch from which the mean micro-image has enough pixels
_AGREED = 0.01  # of a pitch
_LARGEST = 0.02  # of the pitch: a white image's residual
_WHITE = 0.6  # of the lenslets are found on a white image
_SHARE = 0.4  # of the lenslets must be found on a raw image
_UNMEASURED = (
    "found by all gaps of a raw image together: no single centre was measured, so that no residual is known; "
    "check the overlay, or calibrate on a white image"
)


def calibrate(
    white: RawImage | Array | Sequence[RawImage | Array],
    layout: Layout | None = None,
    pitch: float | None = None,
    *,
    rotation: float | None = None,
    pixel_pitch: float | None = None,
    separation: float | None = None,
    lenslet_distance: float | None = None,
) -> Calibration:
    """Micro-image lattice of a white image, or of a raw image alone, with the centre of every micro-image.

    Candidates for the lattice come from autocorrelation and spectrum of the light and of its dark gaps, and
    are judged by all their harmonics. Centres come from the phase of each micro-image's first harmonic and
    are sharpened by the mean micro-image; the lattice from least squares with two free basis vectors, and
    tilt and radial distortion where the residuals ask for them (`fitting.fit` says when). Lenslets without
    light are listed as missing; one that stands off the lattice is not fitted, but it counts.

    On a raw image of a scene the gaps between micro-images are followed instead of their light, since a
    scene moves from one micro-image to the next; the result says so in its notes.

    Parameters
    ----------
    white
        Picture (y, x[, c]) of an evenly lit surface, or a list of several, or a raw image of any scene; a
        Bayer pattern is scaled to grey first.
    layout
        "square" or "hex"; found by itself where None.
    pitch
        Distance of neighbouring micro-images [px], to 10 %; found by itself where None.
    rotation
        Of the rows of lenslets from +x towards +y [rad], to 2°; found by itself where None.
    pixel_pitch
        Of the sensor [m]; the white image's own where None.
    separation, lenslet_distance
        Main lens to lenslets and lenslets to sensor [m], where known: kept in the result, which `decode`
        and `rendered_grid` need for lengths in metres.

    Returns
    -------
    Calibration
        Its lattice's index (0, 0) is the micro-image nearest to the middle of the picture.

    Raises
    ------
    CalibrationError
        NaN, no light, no lattice, fewer than 3 × 3 lenslets, several lattices that are about equally likely,
        or a pitch, rotation or layout that the picture does not support.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[:90, :120]
    >>> white = np.cos(np.pi * (y - 44) / 15) ** 2 * np.cos(np.pi * (x - 59) / 15) ** 2
    >>> print(calibrate(white).report())
    layout      square, 35 lenslets on 90 x 120 px
    pitch       15.000 px (15.000 along rows, 15.000 to the next row)
    rotation    +0.000 mrad (+0.000 deg)
    origin      (44.000, 59.000) px (y, x)
    residual    0.000 px rms, 0.000 px at worst
    missing     0 lenslets without light
    """
    first, original = _light(white)
    _check_request(layout, pitch, rotation)
    shape = (original.shape[0], original.shape[1])
    flat = flattened(original)
    gaps = valleys(original, 1.0)
    vectors = lattice_vectors([flat, gaps, valleys(original, 2.0)], Request(layout, pitch, rotation))
    _check_size(vectors, shape)
    found = _followed(original, flat, gaps, vectors)
    start = found.fitted if found.notes != (_UNMEASURED,) else _by_lines(flat, found.fitted)
    cell = mean_cell(flat, start.model(shape))
    discs = overlapping(cell, start.lattice)
    if discs is not None:
        found = _overlapped(flat, start, discs)
    fitted = found.fitted
    model = fitted.model(shape)
    rms = float(np.sqrt(((fitted.spots.centers - model.position(fitted.spots.indices)) ** 2).sum(-1).mean()))
    rms = rms if found.notes != (_UNMEASURED,) else math.nan
    bright = max(float(np.percentile(fitted.spots.light, 95)), 1e-30)
    return Calibration(
        fitted.lattice, shape, fitted.spots.indices, fitted.spots.centers, rms,
        pixel_pitch if pixel_pitch is not None else first.pixel_pitch, separation, lenslet_distance,
        warp=fitted.warp, light=fitted.spots.light / bright,
        fill=fill_of(cell) if discs is None else discs.size,
        missing=unlit(original, model, fitted.spots.centers, white=found.white),
        sharpness=sharpness_of(original, model),
        notes=(*found.notes, *_overexposed(first, model, fitted.spots.indices)),
    )  # fmt: skip


def _by_lines(flat: np.ndarray, fitted: Fitted) -> Fitted:
    """The lattice that the light repeats on, where the gaps could not be followed."""
    lattice = fitted.lattice
    found = light_followed(flat, lattice.matrix, lattice.layout == "hex")
    if found is None:
        return fitted
    column, row = found[0].T
    return fitted._replace(lattice=replace(lattice, basis=(_vector(row), _vector(column))))


def _overlapped(flat: np.ndarray, fitted: Fitted, discs: Discs) -> "_Followed":
    """The fit to discs that overlap, with what is to be known of it."""
    note = (
        f"micro-images overlap, they are {discs.size:.2f} pitches wide: their centres were found by the sum "
        "of such discs; close the main lens for less cross-talk"
    )
    return _Followed(separated(flat, fitted, discs), flat, (note,), white=True)


def _overexposed(image: RawImage, model: Calibration, indices: np.ndarray) -> tuple[str, ...]:
    """What is to be known of micro-images at the top of the range."""
    if not (many := saturated(image, model, indices)):
        return ()
    return (
        f"{many} of {len(indices)} micro-images are saturated in their middle: they count, but their light "
        "is not known; expose less",
    )


class _Followed(NamedTuple):
    """A fit, the picture whose micro-images it follows, and what is to be known of it."""

    fitted: Fitted
    picture: np.ndarray
    notes: tuple[str, ...] = ()
    white: bool = False


def _light(white: RawImage | Array | Sequence[RawImage | Array]) -> tuple[RawImage, np.ndarray]:
    """The first image, and the mean of all as one grey picture (y, x), each scaled to a mean of 1."""
    images = [as_raw(image) for image in white] if isinstance(white, list | tuple) else [as_raw(white)]
    if not images:
        raise CalibrationError("the list of white images is empty. Give at least one image.")
    total = np.zeros(images[0].shape, np.float32)
    for image in images:
        if image.shape != images[0].shape:
            raise CalibrationError(
                f"the white images have {images[0].shape} and {image.shape} pixels. "
                "Give images of one camera at one setting."
            )
        checks.finite_array("the white image", image.data, CalibrationError)
        picture = _picture(image)
        total += picture / max(abs(float(picture.mean())), 1e-30)
    return images[0], _picture(images[0]) if len(images) == 1 else total / len(images)


def _followed(original: np.ndarray, flat: np.ndarray, gaps: np.ndarray, vectors: Vectors) -> _Followed:
    """The fit to the light of the micro-images, or to what is between them where that is steadier."""
    above = original - np.float32(original.min())
    found, refused = [], []
    try:
        light = _by_light(flat, above, vectors)
        if _spread(light) <= _CLEAR and _share(light, flat.shape) > _WHITE:
            return _Followed(light, above, white=True)
        found.append(_Followed(light, above))
    except CalibrationError as error:
        refused.append(error)
    for picture in (gaps.max() - gaps, logarithm(original)):
        try:
            found.append(_Followed(_outwards(picture, picture, vectors, followed), picture))
        except CalibrationError as error:
            refused.append(error)
    steady = [one for one in found if _agrees(one.fitted, vectors)]
    if not steady:
        return _Followed(_by_gaps(gaps, original, vectors), gaps, (_UNMEASURED,))
    found = steady
    sizes = [_spread(one.fitted) for one in found]
    best = int(np.argmin(sizes))
    if (
        found[0].picture is above
        and _spread(found[0].fitted) < _LARGEST * found[0].fitted.lattice.pitch
        and sizes[best] > _BETTER * sizes[0]
    ):
        best = 0
    one = found[best]
    if one.picture is above:
        return one._replace(notes=_uncertain(one.fitted))
    return one._replace(notes=_raw_notes(one.fitted, original.shape))


def _agrees(fitted: Fitted, vectors: Vectors) -> bool:
    """Whether a fit kept to the lattice that all harmonics tell, but for two pitches and shear."""
    steps = np.linalg.solve(
        np.stack([vectors.row, vectors.column]).T,
        np.array([fitted.lattice.basis[0], fitted.lattice.basis[1]]).T,
    )
    return bool(np.abs(steps - np.eye(2)).max() < _AGREED)


def _by_gaps(gaps: np.ndarray, original: np.ndarray, vectors: Vectors) -> Fitted:
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
    return Fitted(Spots(indices, lattice.position(indices), np.ones(len(indices))), lattice, None)


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
        "found by the gaps between micro-images of a raw image; a white image tells their centres better",
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


def _by_light(flat: np.ndarray, above: np.ndarray, vectors: Vectors) -> Fitted:
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
            return better
    return fitted


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


def _check_request(layout: str | None, pitch: float | None, rotation: float | None) -> None:
    if not (layout is None or isinstance(layout, str)) or layout not in (None, "square", "hex"):
        raise CalibrationError(f"layout is {layout!r} but must be 'square' or 'hex', or left out.")
    if pitch is not None and checks.positive("pitch", pitch, "px", CalibrationError) < SMALLEST_PITCH:
        raise CalibrationError(
            f"pitch is {pitch:g} px but micro-images below {SMALLEST_PITCH:g} px cannot be told apart. "
            "Use a sensor with smaller pixels, or lenslets farther apart."
        )
    if rotation is not None:
        checks.finite("rotation", rotation, "rad", CalibrationError)


def _check_size(vectors: Vectors, shape: tuple[int, int]) -> None:
    lattice = Lattice((_vector(vectors.row), _vector(vectors.column)), (0.0, 0.0), vectors.layout)
    _check_count(lattice, shape)


def _picture(white: RawImage) -> np.ndarray:
    """The white image as one grey picture, refused where it is too small or flat."""
    ny, nx = white.shape
    least = int(3 * SMALLEST_PITCH)
    if min(ny, nx) < least:
        raise CalibrationError(
            f"the white image has {ny} x {nx} pixels but 3 x 3 lenslets need at least {least} x {least}. "
            "Use the whole sensor's picture."
        )
    picture = grey(white)
    low, high = float(picture.min()), float(picture.max())
    if high - low <= 1e-4 * max(abs(low), abs(high)):
        raise CalibrationError(
            f"the white image is flat: all its values lie between {low:g} and {high:g}. "
            "Take it through the lenslets, neither dark nor saturated."
        )
    return picture


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
