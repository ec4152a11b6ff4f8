"""Agreement of a raw image with the lattice of a calibration, by its own dark gaps."""

import math
import warnings
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from lumigraph.calibration import followed
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.gaps import logarithm, valleys
from lumigraph.core.lattice import Lattice
from lumigraph.errors import CalibrationError, SamplingWarning
from lumigraph.preparation.agreement import Described

_SIZE = 1024  # px of the middle of the picture that is looked at
_FEWEST = 8.0  # lenslets across it
_CERTAIN, _SLIGHT = 0.5, 0.1  # pitches between the lattices at the border; right pairs reach 0.06
_SIGMAS = 3.0  # of its standard error from which a slip counts; a specimen pulls at the lines of gaps
_STRIPS = 8  # of the picture are left out, one after the other
_STUDENT = 4.53 / 3  # what is as unlikely as three standard errors where seven strips tell them
# Harmonics that are looked at in each part; both signs, since a basis may lean either way.
_ORDERS = np.array([(1, 0), (0, 1), (1, 1), (1, -1), (2, 0), (0, 2), (2, 1), (1, 2), (2, -1), (1, -2)])
_FAINT = 0.25  # of the strongest line: fainter ones are left out
_BLOCKS, _EVERYWHERE = (
    8,
    0.45,
)  # parts along each axis; real lattices have shares over 0.55, single points 0.36
_DIM, _LIT = 0.05, 0.5  # of a bright lenslet's light; part of the lenslets that must have it
_CONTRAST = 0.15  # of the mean micro-image from which its place is found
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
        Distance between the two lattices at the border of the picture where they agree in its middle
        [pitches]; from a half on, pixels there belong to another lenslet.
    shift
        Shift of the mean micro-image from its calibrated place (y, x) [px]; None where it is not visible.
    evidence
        Lines of the lattice in the spectrum of the raw image's gaps over their surroundings.
    error
        Standard error of the slip [pitches], by how far the lines scatter about those of one lattice where
        there are enough of them. From a slip of 0.1 on, by how far they move when parts of the picture are
        left out, too.
    """

    pitch: float
    expected_pitch: float
    rotation: float
    expected_rotation: float
    slip: float
    shift: tuple[float, float] | None
    evidence: float
    error: float = 0.0

    @property
    def share(self) -> float:
        """The pitch seen over the expected one."""
        return self.pitch / self.expected_pitch

    def seen(self, expected: Lattice) -> Lattice:
        """The expected lattice with the pitch and the rotation that are seen."""
        turn = self.rotation - self.expected_rotation
        cos, sin = math.cos(turn), math.sin(turn)
        basis = np.array([[cos, sin], [-sin, cos]]) @ expected.matrix * self.share
        (yi, yj), (xi, xj) = basis.tolist()
        return replace(expected, basis=((yj, xj), (yi, xi)))

    def told(self) -> str:
        """Agreement of the lattices, in one line."""
        unsure = self.slip >= _SLIGHT and self.slip < _SIGMAS * self.error
        doubt = f", known only to ±{_SIGMAS * self.error:.2f}" if unsure else ""
        return f"the raw image's own lattice slips by {self.slip:.2f} of a pitch towards the border{doubt}"

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

    Only a picture with light behind lenslets all over is judged: points before a dark ground repeat, too.
    Dark gaps between micro-images leave lines in the spectrum at the lattice's harmonics. The lattice is
    searched for by its first ones, within 25 % of the calibration's pitch and 6° of its rotation, and
    refined on those that follow. A raw image without gaps, or of fewer than some 14 lenslets across, gives
    None.
    """
    picture, corner = _middle(to_numpy(data))
    basis, waves = _expected(calibration, picture.shape, corner)
    pitch = math.sqrt(abs(float(np.linalg.det(basis))))
    if min(picture.shape) < _FEWEST * pitch or float(np.ptp(picture)) <= 0 or _lit(picture, pitch) < _LIT:
        return None
    gaps = valleys(picture, 1.0)
    found = followed(gaps, basis, calibration.lattice.layout == "hex")
    if found is None:
        return None
    seen_basis, seen = found.basis, np.linalg.inv(found.basis)
    if _share(gaps, seen) < _EVERYWHERE:  # spots of a few points repeat, too, by what depth they are at
        return None
    half = np.array([(y, x) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * calibration.shape
    slip, error = float(np.abs(half @ (seen - waves).T).max()), _at_border(found.errors, calibration.shape)
    if slip >= _SLIGHT:
        between = _STUDENT * _between_parts(gaps, seen)
        error = math.hypot(error, _at_border(between, calibration.shape))
    return Drift(
        float(np.hypot(*seen_basis).mean()), float(np.hypot(*basis).mean()),
        math.atan2(*seen_basis[:, 1]), math.atan2(*basis[:, 1]),
        slip,
        _shift(picture, seen, basis, np.array(calibration.lattice.origin) - corner), found.evidence,
        error,
    )  # fmt: skip


def check_drift(data: Array, calibration: Calibration, camera: Described | None = None) -> Drift | None:
    """Refuse a raw image (y, x[, c]) that carries another lattice than the calibration's.

    If that lattice is a camera file's, the error also names the change of the file that would explain it.

    Returns
    -------
    Drift or None
        As `drift` found it.

    Warns
    -----
    SamplingWarning
        The lattices slip by 0.1 to 0.5 of a pitch, or the micro-images are shifted by more than a quarter.

    Raises
    ------
    CalibrationError
        They slip by more than half a pitch, so that pixels belong to other lenslets; the message has both.
    """
    found = drift(data, calibration)
    if found is not None:
        _tell(found, "" if camera is None else f" This would be {camera.would_be(found.share)}.")
    return found


def verdict(found: Drift) -> str:
    """Verdict of a drift on a calibration: "refused", "warned", "shifted" or "fits"."""
    sure = found.slip >= _SIGMAS * found.error
    if sure and found.slip >= _CERTAIN:
        return "refused"
    if sure and found.slip >= _SLIGHT:
        return "warned"
    if found.shift is not None and max(map(abs, found.shift)) > _SHIFTED * found.pitch:
        return "shifted"
    return "fits"


def _tell(found: Drift, implied: str) -> None:
    said = verdict(found)
    if said == "refused":
        raise CalibrationError(
            f"{found.report()}.{implied} Calibrate on a white image taken with the settings of the raw image."
        )
    if said == "warned":
        warnings.warn(
            f"{found.report()}.{implied} "
            "A white image taken with the settings of the raw image would fit better.",
            SamplingWarning,
            stacklevel=4,
        )
    elif said == "shifted" and found.shift is not None:
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
    if calibration.warp is not None or calibration.aside is not None:
        (y, x), (ny, nx) = corner, shape
        indices = calibration.indices_within((y, y + ny - 1), (x, x + nx - 1))
        points = calibration.position(indices)
        # As the window of the spectrum weighs them.
        weights = np.prod(np.sin(np.pi * (points - corner + 0.5) / shape), -1)[:, None]
        design = np.concatenate([np.ones((len(indices), 1)), indices], -1)
        basis = np.linalg.lstsq(design * weights, points * weights, rcond=None)[0][1:].T
    return basis, np.linalg.inv(basis)


def _lit(picture: np.ndarray, pitch: float) -> float:
    """Part of the places on the picture, a pitch apart, that are lit."""
    size = round(pitch)
    light = ndimage.uniform_filter(picture - np.float32(np.percentile(picture, 0.5)), size)
    light = light[size // 2 :: size, size // 2 :: size]
    return float(np.mean(light > _DIM * np.percentile(light, 99)))


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


def _between_parts(gaps: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """Standard errors (2, 2) of both waves along y and x [1/px], by leaving out strips of the picture.

    A lattice goes on all over the picture; what an edge adds to its lines stands in a few strips. By the
    jackknife over strips along y and along x; the larger ones count.
    """
    even = gaps - gaps.mean()
    lines = _ORDERS @ waves
    steps, heights = zip(*(_without(even, line) for line in lines), strict=True)
    across = [_without(even.T, line[::-1])[0][:, ::-1] for line in lines]
    weights = np.where(heights > _FAINT * np.max(heights), heights, 0)
    fit = np.linalg.pinv(_ORDERS * weights[:, None]) * weights  # of both waves, through those of all lines
    moved = np.einsum("wl,alsy->wasy", fit, np.array([steps, across]))
    return np.sqrt((_STRIPS - 1) * moved.var(2)).max(1)


def _without(gaps: np.ndarray, wave: np.ndarray) -> tuple[np.ndarray, float]:
    """Steps (strip, 2) from a wave to the top of its line without each strip across y; the line's height.

    One step of Newton's up the line's logarithm, by the moments of the windowed picture times the wave.
    """
    places = [np.arange(n) - (n - 1) / 2 for n in gaps.shape]
    turned = [np.hanning(len(p) + 2)[1:-1] * np.exp(-2j * np.pi * k * p)
              for p, k in zip(places, wave, strict=True)]  # fmt: skip
    powers = [turn[:, None] * p[:, None] ** np.arange(3) for turn, p in zip(turned, places, strict=True)]
    rows = gaps @ powers[1].astype(np.complex64)
    strips = places[0] / len(gaps) * _STRIPS - np.arange(_STRIPS)[:, None] + (_STRIPS - 1) / 2
    kept = 1 - np.cos(np.pi / 2 * np.clip(strips, -1, 1)) ** 2
    moments = np.einsum("sn,ni,nj->sij", kept, powers[0], rows, optimize=True)
    moments = moments / moments[:, :1, :1]
    mean = moments[:, [1, 0], [0, 1]]
    spread = moments[:, [[2, 1], [1, 0]], [[0, 1], [1, 2]]] - mean[:, :, None] * mean[:, None, :]
    steps = np.linalg.pinv(spread.real) @ mean.imag[..., None] / (2 * np.pi)
    return steps[..., 0], float(np.abs(powers[0][:, 0] @ rows[:, 0]))


def _at_border(errors: np.ndarray, shape: tuple[int, int]) -> float:
    """Standard error of the slip at the border of a picture, of those of the waves (2, 2) [1/px]."""
    found = float(np.hypot(*(errors * shape / 2).T).max())
    return 0.0 if math.isnan(found) else found


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
