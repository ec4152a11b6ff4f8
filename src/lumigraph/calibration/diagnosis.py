"""Diagnosis of a camera's assembly from a white image: `diagnose` names the fault."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import j1

from lumigraph.calibration.devignette import as_raw, grey
from lumigraph.calibration.fitting import surrounded
from lumigraph.calibration.lattice_fit import calibrate
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError

LEAST_ROTATION = math.radians(0.02)
LEAST_OFFSET = 0.25
"""Pixels."""
LEAST_STRETCH = 3e-4
"""Smallest relative change of the pitch that is a fault."""
LEAST_TILT = math.radians(0.1)
LEAST_BEND = 0.02
"""Pixels that a tilt moves centres at the border: half of what a neighbour that is missing there does."""
LEAST_PULL = 0.05
"""The same of another pitch: what overlapping neighbours that are missing on all sides do."""
LEAST_GAP = 0.03
"""Smallest change of the gap, over the pitch. Below these limits a difference is no fault."""

_CELL = 32  # samples of a folded micro-image per axis
_SIGMAS = 4.0  # of their standard errors must pitch and tilt differ, too
_PUPIL = 64  # samples over a lenslet
_ORDERS = 3  # harmonics of the lattice that the width is fitted to


class _Lenslets(Protocol):
    @property
    def pitch(self) -> float: ...

    @property
    def focal_length(self) -> Sequence[float]: ...

    @property
    def shape(self) -> str | None: ...


class IntendedCamera(Protocol):
    """Protocol of a camera that `diagnose` compares with: its design."""

    @cached_property
    def calibration(self) -> Calibration:
        """Design positions of the micro-images [px]."""
        ...

    @property
    def lenslets(self) -> _Lenslets:
        """Pitch and focal lengths of the lenslets [m], and their shape."""
        ...

    @property
    def wavelength(self) -> float:
        """Wavelength in vacuum [m]."""
        ...

    @property
    def micro_image_width(self) -> float:
        """Width of the micro-images by ray optics [m]."""
        ...

    @property
    def micro_image_pitch(self) -> float:
        """Distance between neighbouring micro-images [m]."""
        ...


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Deviations of a camera from its design, in the frame of its raw image.

    Parameters
    ----------
    rotation
        Rotation of the lenslets, from +x towards +y [rad].
    offset
        Offset of the micro-image nearest to the axis (y, x) [m]; whole pitches cannot be seen.
    lenslet_distance
        Lenslets to sensor that explain the pitch, b [m].
    intended_distance
        The same as it was meant [m].
    tilt
        Angles (y, x) of the lenslets [rad]: positive where the side of positive y (x) is nearer to the
        sensor, and the pitch smaller.
    pitch_gradient
        Change of the pitch over the height and width of the picture (y, x) [m], which the tilt explains.
    width
        Width of the micro-images by ray optics: the main lens seen through a lenslet [m].
    gap
        Pitch minus width [m]: dark between micro-images, below 0 an overlap.
    intended_gap
        The same as the camera has it, of this pitch [m].
    diameter, intended_diameter
        Diameter of the main lens that explains the width, and the one that makes the intended gap [m].
    faults
        The names of what is wrong; empty for a good camera. "gap": a wider one than intended, "overlap":
        micro-images overlap more than intended, "wide": a narrower gap than intended.
    """

    rotation: float
    offset: tuple[float, float]
    lenslet_distance: float
    intended_distance: float
    tilt: tuple[float, float]
    pitch_gradient: tuple[float, float]
    width: float
    gap: float
    intended_gap: float
    diameter: float
    intended_diameter: float
    faults: tuple[str, ...]

    def report(self) -> str:
        """One line for each fault, with its size and what to do."""
        um, mm = 1e6, 1e3
        moved = self.lenslet_distance - self.intended_distance
        stop = f"the main lens from {self.diameter * mm:.2f} to {self.intended_diameter * mm:.2f} mm"
        meant = f"{_gap_text(self.gap)} between micro-images, {_gap_text(self.intended_gap)} intended"
        texts = {
            "rotation": f"the lenslets are turned by {math.degrees(self.rotation):+.3f} deg: turn them back",
            "offset": f"the lenslets are shifted by ({self.offset[0] * um:+.1f}, {self.offset[1] * um:+.1f}) "
            "µm (y, x): move them back",
            "distance": f"the sensor stands {self.lenslet_distance * mm:.3f} mm behind the lenslets, "
            f"{moved * mm:+.3f} mm from where it was meant",
            "tilt": f"the lenslets are tilted by ({math.degrees(self.tilt[0]):+.2f}, "
            f"{math.degrees(self.tilt[1]):+.2f}) deg: the pitch changes by "
            f"({self.pitch_gradient[0] * um:+.2f}, {self.pitch_gradient[1] * um:+.2f}) µm over the picture",
            "gap": f"{meant}: open {stop}",
            "overlap": f"{meant}: close {stop}",
            "wide": f"{meant}: close {stop}",
        }
        return "\n".join(texts[fault] for fault in self.faults) or "the camera is as it was meant"


def _gap_text(gap: float) -> str:
    return f"{'gaps' if gap >= 0 else 'overlaps'} of {abs(gap) * 1e6:.1f} µm"


def diagnose(white: RawImage | Array, camera: IntendedCamera) -> Diagnosis:
    r"""Faults in the assembly of the camera that took a white image.

    The lattice gives rotation, offset and, by its pitch p (1 + b/L), the distance b. A tilted array has
    another b for each lenslet: with T = L + b, micro-images stand at

    .. math:: s = s_0 - s_0 \, (\theta \cdot s_0) / T

    which is fitted to their centres together with the lattice. Their width D b/L is fitted to the mean
    micro-image: a disc, blurred as a lenslet blurs the main lens, by defocus and diffraction. Gaps and
    overlaps are compared with the camera's own, whichever of `design.matching` it follows.

    Parameters
    ----------
    white
        Picture of an evenly lit surface, of the camera's sensor.
    camera
        Intended camera, such as an instrument.

    Micro-images 1.22 pitches wide leave no contrast between them and the places in between: near it, from
    1.17 to 1.27, the distance is not reliable. Where the array ends near the border of the picture, missing
    neighbours move centres by up to 0.04 px, as a tilt does: on 11 lenslets across tilts from 1° on are
    named, on 29 from 0.13° on.

    Raises
    ------
    CalibrationError
        The white image shows no lattice, has another size than the camera's sensor, or the camera's
        distances are not known.

    References
    ----------
    The thesis, section 6.3, figures 6.5 to 6.7, where this is done by eye.
    """
    white, intended = as_raw(white), camera.calibration
    intended.check_fits(white.shape)
    pixel, separation, distance = _lengths(intended)
    found = calibrate(white, intended.lattice.layout)
    axis = np.array([n // 2 for n in found.shape], float)
    lattice, tilt, error = _tilted(found, axis, (separation + distance) / pixel)
    stretch = _stretch(lattice, tilt, intended.lattice)
    new_distance = (separation + distance) * stretch - separation
    pitch = lattice.pitch * pixel
    cell, blur = _mean_cell(grey(white), found.lattice), _Blur(camera, (new_distance, separation), pitch)
    ratio, between = _width(cell, blur)
    width = pitch * ratio
    gradient = tuple(-2 * angle * pitch * n * pixel / (separation + distance) for angle, n in zip(
        tilt, found.shape, strict=True))  # fmt: skip
    diameter = width * separation / new_distance
    fill = camera.micro_image_width / camera.micro_image_pitch
    rotation = _turn(found.lattice, intended.lattice)
    offset = _offset(_between(lattice) if between else lattice, intended.lattice, axis)
    sizes = {
        "rotation": abs(rotation) / LEAST_ROTATION,
        "offset": float(np.hypot(*offset)) / LEAST_OFFSET,
        "distance": abs(stretch - 1) / max(LEAST_STRETCH, LEAST_PULL / error.border, _SIGMAS * error.stretch),
        "tilt": math.hypot(*tilt)
        / max(LEAST_TILT, LEAST_BEND * error.total / error.border**2, _SIGMAS * error.tilt),
        "gap": (fill - ratio) / LEAST_GAP,
        "overlap" if ratio > 1 else "wide": (ratio - fill) / LEAST_GAP,
    }
    return Diagnosis(
        rotation, (offset[0] * pixel, offset[1] * pixel), new_distance, distance, tilt,
        (gradient[0], gradient[1]), width, pitch - width, pitch * (1 - fill),
        diameter, pitch * fill * separation / new_distance,
        tuple(name for name, size in sizes.items() if size > 1),
    )  # fmt: skip


def _lengths(intended: Calibration) -> tuple[float, float, float]:
    pixel, separation, distance = (
        intended.pixel_pitch,
        intended.separation,
        intended.lenslet_distance,
    )
    if pixel is None or separation is None or distance is None:
        raise CalibrationError(
            "the camera's pixel_pitch, separation or lenslet_distance is not known, and a white image alone "
            "does not show them. Give a camera that has all three."
        )
    return pixel, separation, distance


class _Errors(NamedTuple):
    """Standard errors of the pitch, relative, and of the tilt [rad]; farthest centre, and T [px]."""

    stretch: float
    tilt: float
    border: float
    total: float


def _tilted(
    found: Calibration, axis: np.ndarray, total: float
) -> tuple[Lattice, tuple[float, float], _Errors]:
    """Lattice without the distortion of a tilt, and the tilt (y, x) [rad]; lengths in pixels."""
    inner = surrounded(found.indices)  # a missing neighbour's light moves the centres at the border
    index, centers = found.indices[inner].astype(float), found.centers[inner] - axis
    design = np.zeros((2 * len(index), 8))
    ideal = found.lattice.position(found.indices[inner]) - axis
    for k in range(2):
        rows = slice(k * len(index), (k + 1) * len(index))
        design[rows, 3 * k] = 1
        design[rows, 3 * k + 1 : 3 * k + 3] = index
        design[rows, 6:] = -ideal[:, [k]] * ideal / total
    measured = centers.T.ravel()
    fit = np.linalg.lstsq(design, measured, rcond=None)[0]
    variance = np.square(measured - design @ fit).sum() / max(len(measured) - 8, 1)
    errors = np.sqrt(variance * np.diag(np.linalg.pinv(design.T @ design)))
    origin = (float(fit[0] + axis[0]), float(fit[3] + axis[1]))
    basis = (float(fit[2]), float(fit[5])), (float(fit[1]), float(fit[4]))
    lattice = Lattice(basis, origin, found.lattice.layout, found.lattice.kinds)
    error = _Errors(
        float(errors[[1, 2, 4, 5]].max()) / lattice.pitch,
        float(errors[6:].max()),
        float(np.abs(ideal).max()),
        total,
    )
    return lattice, (float(fit[6]), float(fit[7])), error


def _stretch(lattice: Lattice, tilt: tuple[float, float], intended: Lattice) -> float:
    """Pitch over the intended one; a tilt by itself foreshortens one axis."""
    shortened = math.sqrt(math.cos(tilt[0]) * math.cos(tilt[1]))
    return math.sqrt(lattice.cell_area / intended.cell_area) / shortened


def _turn(lattice: Lattice, intended: Lattice) -> float:
    """Rotation between two lattices, to the nearest symmetry [rad]."""
    return math.remainder(
        lattice.rotation - intended.rotation, math.pi / (3 if lattice.layout == "hex" else 2)
    )


def _offset(lattice: Lattice, intended: Lattice, axis: np.ndarray) -> tuple[float, float]:
    """Way from the intended to the found micro-image nearest to the axis (y, x) [px]."""
    target = intended.position(np.stack(intended.index(axis[0], axis[1]), -1))
    nearest = lattice.position(np.stack(lattice.index(target[0], target[1]), -1))
    return float(nearest[0] - target[0]), float(nearest[1] - target[1])


def _between(lattice: Lattice) -> Lattice:
    """The lattice of the places between four micro-images."""
    (y0, x0), (y1, x1) = lattice.basis
    return lattice.moved((y0 + y1) / 2, (x0 + x1) / 2)


class _Blur:
    """Blur of the main lens' image by a lenslet, as a function of the lattice's harmonics."""

    def __init__(self, camera: IntendedCamera, distances: tuple[float, float], pitch: float) -> None:
        b, separation = distances
        lenslets = camera.lenslets
        u = (np.arange(_PUPIL) + 0.5 - _PUPIL / 2) * 1.02 * lenslets.pitch / _PUPIL
        defocus = math.pi / camera.wavelength * (1 / b + 1 / separation - 1 / lenslets.focal_length[0])
        self._round = lenslets.shape == "round"
        self._half, self._u, self._defocus = lenslets.pitch / 2, u, defocus
        self._shift = camera.wavelength * b / pitch

    def __call__(self, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Optical transfer function of the lenslet, the normalised autocorrelation of its pupil (k,)."""
        whole = self._overlap(0.0, 0.0)
        return np.array([self._overlap(*pair) for pair in zip(i, j, strict=True)]) / whole

    def _overlap(self, i: float, j: float) -> float:
        dy, dx = i * self._shift / 2, j * self._shift / 2
        inside = self._inside(dy, dx) & self._inside(-dy, -dx)
        phase = 4 * self._defocus * (self._u[:, None] * dy + self._u * dx)
        return float(np.cos(phase[inside]).sum())

    def _inside(self, dy: float, dx: float) -> np.ndarray:
        y, x = self._u[:, None] + dy, self._u + dx
        if self._round:
            return y**2 + x**2 <= self._half**2
        return (np.abs(y) <= self._half) & (np.abs(x) <= self._half)


def _mean_cell(picture: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Mean of all micro-images in coordinates of the lattice's cell (_CELL, _CELL), its centre first."""
    ny, nx = picture.shape
    y, x = np.mgrid[:ny, :nx].reshape(2, -1)
    margin = lattice.pitch
    inside = (y > margin) & (y < ny - 1 - margin) & (x > margin) & (x < nx - 1 - margin)
    points = np.stack([y, x])[:, inside] - np.array(lattice.origin)[:, None]
    cell = np.floor((np.linalg.inv(lattice.matrix) @ points % 1.0) * _CELL + 0.5).astype(int) % _CELL
    place = cell[0] * _CELL + cell[1]
    light = np.bincount(place, picture.ravel()[inside], _CELL**2)
    return (light / np.maximum(np.bincount(place, minlength=_CELL**2), 1)).reshape(_CELL, _CELL)


def _width(cell: np.ndarray, blur: _Blur) -> tuple[float, bool]:
    """Width of the micro-images over the pitch, and whether the lattice stands between them.

    It is that of the disc whose harmonics, blurred, are those of the cell. Harmonics show overlapping
    micro-images too: light adds up. Beyond 1.22 pitches the brightest places are between micro-images.
    """
    spectrum = np.fft.fft2(cell) / cell.sum()
    k = np.arange(-_ORDERS, _ORDERS + 1)
    i, j = (a.ravel() for a in np.meshgrid(k, k, indexing="ij"))
    order = np.hypot(i, j)
    used = (order > 0) & (order <= _ORDERS)
    i, j, order = i[used], j[used], order[used]
    measured = spectrum[i, j].real / (np.sinc(i / _CELL) * np.sinc(j / _CELL))
    passed = blur(i, j)
    best, found = math.inf, (0.0, False)
    for candidate in np.arange(0.2, 2.0, 0.0025):
        model = _disc(candidate * order) * passed
        for between in (False, True):
            sign = (-1.0) ** (i + j) if between else 1.0
            error = float(np.square(measured - sign * model).sum())
            if error < best:
                best, found = error, (float(candidate), between)
    return found


def _disc(argument: np.ndarray) -> np.ndarray:
    """Transform of a disc of diameter 1 and light 1."""
    x = np.pi * np.maximum(np.abs(argument), 1e-9)
    return 2 * j1(x) / x
