"""Whether a raw image stands on the lattice of a calibration, by the dark gaps that it carries itself."""

import math
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from scipy import ndimage

from lumigraph.core.arrays import WORKERS, Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.gaps import logarithm, valleys
from lumigraph.errors import CalibrationError, SamplingWarning

_SIZE = 1024  # px of the middle of the picture that is looked at
_FEWEST = 8.0  # lenslets across it
_RANGE, _TURN = 0.25, math.radians(6)  # of the pitch, and angles, that are searched
_STEP = 0.35  # lenslets over the picture: steps of the search, below half a line's width
_EVIDENCE = 12.0  # of a lattice's lines over the median of all tried: 18 and more with gaps, 5 to 10 without
_LINE = 8.0  # of a single line over that median
_SHARPEST, _HIGHEST = 0.14, 4.0  # 1/px, and orders, of the lines that gaps have after smoothing
_CERTAIN, _LIKELY = 0.5, 0.2  # pitches between the lattices at the border of the picture
_CLEAR, _SLIGHT = (
    18.5,
    0.1,
)  # evidence from which a slip of few pitches is told; self-made lattices reach 0.08
_BLOCKS, _EVERYWHERE = (
    8,
    0.45,
)  # parts along each axis; real lattices have shares over 0.55, single points 0.36
_CONTRAST = 0.15  # of the mean micro-image from which its place is told
_SHIFTED = 0.25  # of a pitch


@dataclass(frozen=True, slots=True)
class Drift:
    """The lattice that a raw image carries itself, beside that of a calibration.

    Parameters
    ----------
    pitch, expected_pitch
        Seen on the raw image, and of the calibration [px].
    rotation, expected_rotation
        The same of the rows, from +x towards +y [rad].
    slip
        How far the two lattices are apart at the border of the picture where they agree in its middle
        [pitches]; from a half on, pixels there belong to another lenslet.
    shift
        Of the mean micro-image from where the calibration has it (y, x) [px]; None where it is not seen.
    evidence
        Lines of the lattice in the spectrum of the raw image's gaps over their surroundings.
    """

    pitch: float
    expected_pitch: float
    rotation: float
    expected_rotation: float
    slip: float
    shift: tuple[float, float] | None
    evidence: float

    def told(self) -> str:
        """How well the lattices agree, in one line."""
        return f"the raw image's own lattice slips by {self.slip:.2f} of a pitch towards the border"

    def report(self) -> str:
        """Both lattices in one line."""
        turn, expected = math.degrees(self.rotation), math.degrees(self.expected_rotation)
        return (
            f"the raw image repeats every {self.pitch:.3f} px, turned by {turn:+.2f} deg, but the "
            f"calibration has a pitch of {self.expected_pitch:.3f} px, turned by {expected:+.2f} deg: "
            f"they slip by {self.slip:.2f} of a pitch towards the border"
        )


def drift(data: Array, calibration: Calibration) -> Drift | None:
    """The lattice that a raw image (y, x[, c]) carries itself; None where it shows none for certain.

    Dark gaps between micro-images leave lines in the spectrum at the lattice's harmonics. The lattice is
    searched for by its first ones, within 25 % of the calibration's pitch and 6° of its rotation, and
    refined on those that follow. A raw image without gaps, or of fewer than some 14 lenslets across, tells
    nothing.
    """
    picture, corner = _middle(to_numpy(data))
    basis, waves = _expected(calibration, picture.shape, corner)
    pitch = math.sqrt(abs(float(np.linalg.det(basis))))
    if min(picture.shape) < _FEWEST * pitch or float(np.ptp(picture)) <= 0:
        return None
    gaps = valleys(picture, 1.0)
    found = followed(gaps, basis, calibration.lattice.layout == "hex")
    if found is None:
        return None
    seen_basis, evidence = found
    seen = np.linalg.inv(seen_basis)
    if _share(gaps, seen) < _EVERYWHERE:  # spots of a few points repeat, too, by what depth they are at
        return None
    half = np.array([(y, x) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * calibration.shape
    return Drift(
        float(np.hypot(*seen_basis).mean()), float(np.hypot(*basis).mean()),
        math.atan2(*seen_basis[:, 1]), math.atan2(*basis[:, 1]),
        float(np.abs(half @ (seen - waves).T).max()),
        _shift(picture, seen, basis, np.array(calibration.lattice.origin) - corner), evidence,
    )  # fmt: skip


def followed(feature: np.ndarray, basis: np.ndarray, is_hex: bool) -> tuple[np.ndarray, float] | None:
    """The lattice near another one that a feature (y, x) repeats on, by the lines of its spectrum.

    Parameters
    ----------
    feature
        Gaps, or light, of all micro-images.
    basis
        Lattice vectors (y, x) of i and j in columns [px].
    is_hex
        Whether there are three first harmonics.

    Returns
    -------
    tuple or None
        Basis, and its lines over their surroundings; None where they do not stand out.
    """
    pitch = math.sqrt(abs(float(np.linalg.det(basis))))
    lines = _Lines.of(feature)
    found = _nearest(lines, np.linalg.inv(basis), is_hex, min(feature.shape) / pitch)
    if found is None or found.evidence < _EVIDENCE:
        return None
    return np.linalg.inv(_refined(lines, found, pitch)), found.evidence


def check_drift(data: Array, calibration: Calibration) -> Drift | None:
    """Refuse a raw image (y, x[, c]) that carries another lattice than the calibration's.

    Returns
    -------
    Drift or None
        As `drift` found it.

    Warns
    -----
    SamplingWarning
        The lattices slip by 0.1 (0.2 where lines are faint) to 0.5 of a pitch, or the micro-images are
        shifted by more than a quarter.

    Raises
    ------
    CalibrationError
        They slip by more than half a pitch, so that pixels belong to other lenslets; both are told.
    """
    found = drift(data, calibration)
    if found is not None:
        _tell(found)
    return found


def _tell(found: Drift) -> None:
    if found.slip >= _CERTAIN:
        raise CalibrationError(
            f"{found.report()}. Calibrate on a white image taken with the settings of the raw image."
        )
    if found.slip >= (_SLIGHT if found.evidence >= _CLEAR else _LIKELY):
        warnings.warn(
            f"{found.report()}. A white image taken with the settings of the raw image would fit better.",
            SamplingWarning,
            stacklevel=4,
        )
    elif found.shift is not None and max(map(abs, found.shift)) > _SHIFTED * found.pitch:
        warnings.warn(
            f"the micro-images of the raw image stand ({found.shift[0]:+.1f}, {found.shift[1]:+.1f}) px "
            f"(y, x) from where the calibration has them, with a pitch of {found.pitch:.2f} px. A white "
            "image taken with the settings of the raw image would fit better.",
            SamplingWarning,
            stacklevel=4,
        )


def _middle(data: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The middle of a picture as grey float32 (y, x), and its first pixel (y, x)."""
    first = [max(0, (n - _SIZE) // 2) for n in data.shape[:2]]
    part = data[first[0] : first[0] + _SIZE, first[1] : first[1] + _SIZE]
    part = part.mean(-1) if part.ndim == 3 else part
    return np.asarray(part, np.float32), np.array(first)


def _expected(
    calibration: Calibration, shape: tuple[int, ...], corner: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Basis of the calibration over a part of the picture, (y, x) [px] of i and j in columns; its inverse."""
    basis = calibration.lattice.matrix
    if calibration.warp is not None:
        (y, x), (ny, nx) = corner, shape
        indices = calibration.indices_within((y, y + ny - 1), (x, x + nx - 1))
        points = calibration.position(indices)
        # As the window of the spectrum weighs them.
        weights = np.prod(np.sin(np.pi * (points - corner + 0.5) / shape), -1)[:, None]
        design = np.concatenate([np.ones((len(indices), 1)), indices], -1)
        basis = np.linalg.lstsq(design * weights, points * weights, rcond=None)[0][1:].T
    return basis, np.linalg.inv(basis)


@dataclass(frozen=True, slots=True)
class _Lines:
    """Amplitudes of a windowed picture's spectrum, between its own bins too; x is not below 0."""

    amplitude: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, picture: np.ndarray) -> "_Lines":
        window = [np.hanning(n + 2)[1:-1].astype(np.float32) for n in picture.shape]
        wave = (picture - picture.mean()) * window[0][:, None] * window[1]
        size = [scipy.fft.next_fast_len(3 * n // 2, real=True) for n in picture.shape]
        spectrum: Any = scipy.fft.rfft2(wave, size, workers=WORKERS)
        return cls(np.abs(spectrum).astype(np.float32), np.array(size))

    def heights(self, waves: np.ndarray) -> np.ndarray:
        """Amplitudes (...) at waves (..., 2) as (y, x) [1/px]."""
        waves = np.where(waves[..., 1:] < 0, -waves, waves) * self.size
        return ndimage.map_coordinates(self.amplitude, np.moveaxis(waves, -1, 0), order=1, mode="grid-wrap")

    def peaks(self, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Maxima (k, 2) within two samples of waves (k, 2) [1/px], by parabolas, and their heights (k,)."""
        near = np.arange(-2, 3)
        middle = np.rint(waves * self.size).astype(int)
        rows, columns = np.broadcast_arrays(
            middle[:, 0, None, None] + near[:, None], middle[:, 1, None, None] + near
        )
        turned = np.where(columns < 0, -1, 1)
        heights = self.amplitude[turned * rows % self.size[0], turned * columns % self.size[1]]
        place = heights[:, 1:4, 1:4].reshape(len(waves), -1).argmax(1)
        y, x, k = place // 3 + 1, place % 3 + 1, np.arange(len(waves))
        logarithms = np.log(np.maximum(heights, 1e-30))
        dy = _top(*(logarithms[k, y + step, x] for step in (-1, 0, 1)))
        dx = _top(*(logarithms[k, y, x + step] for step in (-1, 0, 1)))
        return (middle - 2 + np.stack([y + dy, x + dx], -1)) / self.size, heights[k, y, x]


def _top(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Where a parabola through three samples is highest, from the middle one."""
    return np.clip((after - before) / (2 * np.maximum(2 * here - before - after, 1e-6)), -0.6, 0.6)


class _Found(NamedTuple):
    """Waves of i and j (2, 2), their height over the surroundings, and those surroundings."""

    waves: np.ndarray
    evidence: float
    surroundings: float


def _nearest(lines: _Lines, waves: np.ndarray, is_hex: bool, lenslets: float) -> _Found | None:
    """The lattice around the expected one, stretched and turned, whose first harmonics are strongest."""
    stretch, turn = (
        np.arange(-int(reach * lenslets / _STEP), int(reach * lenslets / _STEP) + 1) * _STEP / lenslets
        for reach in (_RANGE, _TURN)
    )
    first = waves
    if is_hex:
        third = min(waves[0] + waves[1], waves[0] - waves[1], key=lambda wave: float(np.hypot(*wave)))
        first = np.stack([*waves, third])
    size, angle = 1 / (1 + stretch[:, None]), turn[None, :]
    y, x = (first[:, k, None, None] * np.cos(angle) for k in (0, 1))
    ty, tx = (first[:, k, None, None] * np.sin(angle) for k in (0, 1))
    tried = np.stack([(y + tx) * size, (x - ty) * size], -1)
    score = np.exp(np.log(np.maximum(lines.heights(tried), 1e-30)).mean(0))
    best = np.unravel_index(int(np.argmax(score)), score.shape)
    around = float(np.median(score))
    if around <= 0:
        return None
    return _Found(tried[:2, best[0], best[1]], float(score[best]) / around, around)


def _refined(lines: _Lines, found: _Found, pitch: float) -> np.ndarray:
    """Waves of i and j (2, 2) by least squares over ever more harmonics, each at its own maximum."""
    highest, waves = float(np.clip(_SHARPEST * pitch, 1.0, _HIGHEST)), found.waves
    reach = np.arange(-5, 6)
    orders = np.stack(np.meshgrid(reach, reach, indexing="ij"), -1).reshape(-1, 2)
    orders = orders[61:]  # half a plane: the rest mirrors it
    for limit in np.arange(1.1, highest + 0.2, 0.9):
        expected = orders @ waves
        used = np.hypot(*expected.T) <= limit * 1.1 * math.sqrt(abs(np.linalg.det(waves)))
        places, heights = lines.peaks(expected[used])
        weights = np.where(heights > _LINE * found.surroundings, heights, 0)[:, None]
        if (weights > 0).sum() < 2:
            break
        better = np.linalg.lstsq(orders[used] * weights, places * weights, rcond=None)[0]
        if np.linalg.matrix_rank(orders[used] * (weights > 0)) < 2:
            break
        waves = better
    return waves


def _share(gaps: np.ndarray, waves: np.ndarray) -> float:
    """Part of the picture that both waves are seen in: 1 where all blocks have alike amplitudes."""
    shares = []
    edges = [np.linspace(0, n, _BLOCKS + 1)[:-1].astype(int) for n in gaps.shape]
    even = gaps - gaps.mean()
    for wave in waves:
        y, x = (np.exp(-2j * np.pi * k * np.arange(n)).astype(np.complex64)
                for k, n in zip(wave, gaps.shape, strict=True))  # fmt: skip
        blocks = np.add.reduceat(np.add.reduceat(even * x, edges[1], 1) * y[:, None], edges[0], 0)
        sizes = np.abs(blocks)
        shares.append(float(sizes.mean() ** 2 / np.square(sizes).mean()))
    return min(shares)


def _shift(
    picture: np.ndarray, waves: np.ndarray, basis: np.ndarray, origin: np.ndarray
) -> tuple[float, float] | None:
    """Way (y, x) [px] from the expected centres to the mean micro-image's, in the middle of the picture."""
    window = [np.hanning(n + 2)[1:-1].astype(np.float32) for n in picture.shape]
    light = logarithm(picture)
    light -= light.mean()
    middle = np.array([n // 2 for n in picture.shape])
    center = origin + basis @ np.rint(np.linalg.solve(basis, middle - origin))
    steps, contrast = [], []
    for wave in waves:
        along = [
            (w * np.exp(-2j * np.pi * k * (np.arange(len(w)) - c))).astype(np.complex64)
            for w, k, c in zip(window, wave, center, strict=True)
        ]
        value = complex(along[0] @ (light @ along[1]))
        steps.append(-np.angle(value) / (2 * np.pi))
        contrast.append(abs(value) / (window[0].sum() * window[1].sum()))
    if min(contrast) < _CONTRAST * float(light.std()):
        return None
    y, x = basis @ np.array(steps)
    return float(y), float(x)
