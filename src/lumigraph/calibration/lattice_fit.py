"""From a white image to its lattice: period, spots, robust least squares."""

import numpy as np

from lumigraph.calibration.centres import Spots, measure
from lumigraph.calibration.devignette import as_raw, grey
from lumigraph.calibration.period import SMALLEST_PITCH, Surface, Vectors, flattened, lattice_vectors
from lumigraph.core import checks
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice, Layout, Vector
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError


def calibrate(
    white: RawImage | Array,
    layout: Layout | None = None,
    pitch: float | None = None,
    *,
    pixel_pitch: float | None = None,
    separation: float | None = None,
    lenslet_distance: float | None = None,
) -> Calibration:
    """Micro-image lattice of a white image, with the centre of every micro-image.

    The period comes from the autocorrelation, the centres from the phase of each micro-image's first
    harmonic, the lattice from least squares with two free basis vectors; micro-images farther from it
    than four standard deviations (dust, broken lenslets) are left out of the result.

    Parameters
    ----------
    white
        Picture (y, x[, c]) of an evenly lit surface; a Bayer pattern is scaled to grey first.
    layout
        "square" or "hex"; found by itself where None.
    pitch
        Distance of neighbouring micro-images [px], to 10 %; found by itself where None.
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
        NaN, no light, no lattice, fewer than 3 × 3 lenslets, several pitches, or a pitch or layout that
        the picture does not support.

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
    """
    white = as_raw(white)
    _check_request(layout, pitch)
    checks.finite_array("the white image", white.data, CalibrationError)
    original = _picture(white)
    picture = flattened(original)
    vectors = lattice_vectors(picture, layout, pitch)
    lattice = _starting_lattice(picture, vectors)
    _check_count(lattice, picture.shape)
    spots, lattice = _fit_outwards(picture, original - np.float32(original.min()), lattice)
    residuals = spots.centers - lattice.position(spots.indices)
    return Calibration(
        lattice, picture.shape, spots.indices, spots.centers, float(np.sqrt((residuals**2).sum(-1).mean())),
        pixel_pitch if pixel_pitch is not None else white.pixel_pitch, separation, lenslet_distance,
    )  # fmt: skip


def _check_request(layout: str | None, pitch: float | None) -> None:
    if not (layout is None or isinstance(layout, str)) or layout not in (None, "square", "hex"):
        raise CalibrationError(f"layout is {layout!r} but must be 'square' or 'hex', or left out.")
    if pitch is not None and checks.positive("pitch", pitch, "px", CalibrationError) < SMALLEST_PITCH:
        raise CalibrationError(
            f"pitch is {pitch:g} px but micro-images below {SMALLEST_PITCH:g} px cannot be told apart. "
            "Use a sensor with smaller pixels, or lenslets farther apart."
        )


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
    lattice = Lattice((_vector(vectors.row), _vector(vectors.column)), _vector(origin), vectors.layout)
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


def _fit_outwards(picture: np.ndarray, original: np.ndarray, lattice: Lattice) -> tuple[Spots, Lattice]:
    """Fit the middle first, so that the error of the first guess does not grow over many lenslets."""
    for part, source in ((0.3, picture), (0.6, picture), (1.0, original)):
        spots = measure(source, lattice, part=part)
        if part < 1 and len(spots.indices) < 50:
            continue
        spots, lattice = _robust_fit(spots, lattice)
    spots, lattice = _robust_fit(measure(_evenly_lit(original, spots), lattice), lattice)
    centred = _centred(lattice, picture.shape)
    moved = np.stack(lattice.index(*np.array(centred.origin)), -1)
    return Spots(spots.indices - moved, spots.centers, spots.light), centred


def _evenly_lit(picture: np.ndarray, spots: Spots) -> np.ndarray:
    """Picture without the vignetting of its micro-images' brightness, which would move their centres."""
    ny, nx = picture.shape
    y, x = (2 * spots.centers[:, axis] / (n - 1) - 1 for axis, n in enumerate((ny, nx)))
    surface = Surface(4 if len(y) > 100 else 2 if len(y) > 20 else 1).fit(
        y, x, spots.light / spots.light.mean()
    )
    rows, columns = np.linspace(-1, 1, ny, dtype=np.float32), np.linspace(-1, 1, nx, dtype=np.float32)
    return picture / surface(rows[:, None], columns[None, :])


def _robust_fit(spots: Spots, lattice: Lattice) -> tuple[Spots, Lattice]:
    """Least squares over the spots, leaving out those beyond four standard deviations, until it settles."""
    _check_spots(spots, lattice, "lit micro-images")
    design = np.concatenate([np.ones((len(spots.indices), 1)), spots.indices], -1)
    keep, distance, weights = np.ones(len(design), bool), np.zeros(len(design)), np.zeros((3, 2))
    inner = surrounded(spots.indices)
    for _ in range(10):
        used = keep & inner
        weights = np.linalg.lstsq(design[used], spots.centers[used], rcond=None)[0]
        distance = np.hypot(*(spots.centers - design @ weights).T)
        spread = 0.85 * float(
            np.median(distance[used])
        )  # of one coordinate: the Rayleigh median is 1.18 of it
        closer = distance <= max(4 * spread, 0.02)
        if np.array_equal(closer, keep) or np.linalg.matrix_rank(design[closer & inner]) < 3:
            break
        keep = closer
    kept = Spots(*(column[keep] for column in spots))
    rms = float(np.sqrt((distance[keep] ** 2).mean()))
    if keep.mean() < 0.5:
        raise CalibrationError(
            f"only {keep.sum()} of {len(keep)} micro-images stand on one lattice of pitch "
            f"{lattice.pitch:.1f} px. Check the white image, or pass pitch= and layout=."
        )
    if rms > 0.1 * lattice.pitch:
        raise CalibrationError(
            f"the micro-images stand {rms:.2f} px rms away from a lattice of pitch {lattice.pitch:.1f} px, "
            "where a tenth of the pitch is too much. Check the white image, or pass pitch= and layout=."
        )
    _check_spots(kept, lattice, "micro-images on one lattice")
    origin, column, row = (_vector(w) for w in weights)
    return kept, Lattice((row, column), origin, lattice.layout, lattice.kinds)


def surrounded(indices: np.ndarray) -> np.ndarray:
    """Spots with neighbours on all sides, or all spots where fewer than 5 x 5 are left.

    At the border of an array the light of the missing neighbours is missing too, which moves a
    micro-image's centre inwards: by half a pixel where diffraction blurs micro-images into each other.
    """
    first = indices.min(0) - 1
    present = np.zeros(indices.max(0) - first + 2, bool)
    i, j = (indices - first).T
    present[i, j] = True
    inner = np.ones(len(indices), bool)
    for di, dj in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, -1), (-1, 1)):
        inner &= present[i + di, j + dj]
    return inner if inner.sum() >= 25 else np.ones(len(indices), bool)


def _check_spots(spots: Spots, lattice: Lattice, what: str) -> None:
    count = [len(np.unique(spots.indices[:, axis])) for axis in (0, 1)]
    if min(count) < 3 or len(spots.indices) < 9:
        raise CalibrationError(
            f"the white image has {len(spots.indices)} {what} of pitch {lattice.pitch:.1f} px, "
            f"in {count[0]} rows and {count[1]} columns, but a lattice needs at least 3 x 3. "
            "Use the whole sensor's picture, evenly lit."
        )
