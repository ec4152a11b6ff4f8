r"""Misalignment of a bench by its white images: `twin` compares them with those of the camera file.

White images of the camera file are simulated with small misalignments and measured as the real ones are.
Differences y and derivatives J give the causes, by Gauss and Newton,

.. math:: x = (J^T C^{-1} J)^{-1} J^T C^{-1} (y - y_0)

A tilted sensor before an upright array looks like a tilted array; the array is taken to be tilted.
Rays through a moved and turned array: docs/theory/metric.md.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.optimize import least_squares
from scipy.stats import chi2

from lumigraph.analysis import pupil_edge
from lumigraph.calibration import calibrate
from lumigraph.core import checks, upper_floors
from lumigraph.core.arrays import to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Layout
from lumigraph.core.progress import Progress, silent
from lumigraph.core.raw import RawImage
from lumigraph.core.result import Quantity
from lumigraph.core.short_repr import brief
from lumigraph.design import thin_lens
from lumigraph.elements import Train
from lumigraph.errors import CalibrationError
from lumigraph.instruments import Built, LensletCamera
from lumigraph.instruments.capabilities import Rendered
from lumigraph.operators.periodic.white import white_image

CAUSES = ("height", "tilt_y", "tilt_x", "shift_y", "shift_x", "turn", "aperture")
"""Possible misalignments.

- height: of the array above its place, away from the sensor [m]
- tilt: of the array, positive where it is farther from the sensor at larger y (x) of the raw image [rad]
- shift: of the array along y and x of the raw image, up to whole lenslets [m]
- turn: of the array, from +x towards +y of the raw image [rad]
- aperture: diameter of the stop over that of the file, less 1
"""

UNITS = ("m", "rad", "rad", "m", "m", "rad", "1")

SURE = 3.0
"""Standard deviations from which on an instruction is given."""

PITCH_ERROR = 3e-4
"""Standard deviation of the lenslets' pitch over the pixels', unless one is given.

A moulded array's scale changes by 7e-5 a kelvin (PMMA), which white images cannot separate from its height.
"""

_STEPS = (50e-6, 2e-3, 2e-3, 3e-6, 3e-6, 2e-3, 0.01)  # of the derivatives
_PLACED = 1e-3  # px: of the lattice's origin, by what pixels do to all places alike (benchmarks.twin)
_USED = slice(9)  # of what is shown: the blur is looked at afterwards
_ROUNDS = 3
_BLUR = 0.03  # part by which the blur of micro-images may differ before it is a cause of its own
_ACCURACY = 1e-3
_FARTHEST = 0.1
"""Largest misplacement of an array, over its distance from the sensor: beyond, it is another camera."""


@dataclass(frozen=True, slots=True, eq=False)
class _ShownWhite:
    """Measures of a white image: two lattice vectors, origin and slope [px], width and blur [px].

    `reach` is the largest distance of a lenslet from the middle along an axis [px], which the slope refers
    to; `found` are the micro-images.
    """

    values: np.ndarray
    errors: np.ndarray
    reach: float = 0.0
    found: Calibration | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Twin:
    """Misalignment of a bench.

    Parameters
    ----------
    values
        Of each of `CAUSES`.
    covariance
        Of the values; larger by what the rest exceeds the noise.
    blur
        Of the micro-images' edges over that of the camera file at these values, and its standard deviation.
    misfit
        Probability of so large a rest if the causes explain everything.
    notes
        What to know, one sentence each.
    doubtful
        Causes that are too far out for an instruction: others may explain as much.
    """

    values: np.ndarray
    covariance: np.ndarray
    blur: tuple[float, float]
    misfit: float
    notes: tuple[str, ...]
    doubtful: tuple[str, ...] = ()

    __repr__ = brief

    @property
    def errors(self) -> np.ndarray:
        """Standard deviations of the values."""
        return np.sqrt(np.diag(self.covariance))

    def __getitem__(self, cause: str) -> float:
        return float(self.values[CAUSES.index(cause)])

    def quantities(self) -> tuple[Quantity, ...]:
        """The causes with their 95 % intervals."""
        rows = zip(CAUSES, UNITS, self.values.tolist(), (1.96 * self.errors).tolist(), strict=True)
        found = [Quantity(name, value, unit, (value - e, value + e)) for name, unit, value, e in rows]
        ratio, error = self.blur
        blur = Quantity("blur_over_expected", ratio, "1", (ratio - 1.96 * error, ratio + 1.96 * error))
        return (*found, blur, Quantity("misfit_probability", self.misfit))

    def instructions(self) -> tuple[str, ...]:
        """Instructions for the bench, the surest first; none for values within three deviations of 0."""
        sure = np.abs(self.values) / np.maximum(self.errors, 1e-300)
        found = zip(CAUSES, self.values.tolist(), (1.96 * self.errors).tolist(), strict=True)
        told = [_told(*one) for one in found]
        trusted = [one not in self.doubtful for one in CAUSES]
        return tuple(told[k] for k in np.argsort(-sure) if sure[k] > SURE and trusted[k])


def _told(cause: str, value: float, half: float) -> str:
    away = abs(value)
    match cause:
        case "height":
            way = "lower" if value > 0 else "raise"
            goal = "towards the sensor" if value > 0 else "away from the sensor"
            return f"{way} the array by {away * 1e3:.3f} ± {half * 1e3:.3f} mm, {goal}"
        case "tilt_y" | "tilt_x":
            side = {"tilt_y": ("bottom", "top"), "tilt_x": ("right", "left")}[cause][value < 0]
            return (
                f"tilt the array by {math.degrees(away):.3f} ± {math.degrees(half):.3f}°: its side at the "
                f"{side} of the raw image towards the sensor"
            )
        case "shift_y" | "shift_x":
            way = {"shift_y": ("up", "down"), "shift_x": ("left", "right")}[cause][value < 0]
            return f"shift the array by {away * 1e6:.1f} ± {half * 1e6:.1f} µm, {way} in the raw image"
        case "turn":
            way = "anticlockwise" if value > 0 else "clockwise"
            return f"turn the array by {away * 1e3:.3f} ± {half * 1e3:.3f} mrad {way} in the raw image"
        case _:
            way = "close" if value > 0 else "open"
            return f"{way} the stop by {100 * away:.2f} ± {100 * half:.2f} % of its diameter"


@dataclass(frozen=True, eq=False)  # without slots: it keeps what is computed
class BenchModel:
    """A camera whose array and stop may be out of place.

    Parameters
    ----------
    camera
        What it is meant to be.
    """

    camera: LensletCamera

    def white(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """White image (y, x) of the misaligned camera by wave optics, with `CAUSES` of these values."""
        height, tilt_y, tilt_x, shift_y, shift_x, turn, aperture = (float(v) for v in values)
        optics = self.camera.optics()
        b, L = optics.lenslet_distance, optics.separation
        assert b is not None  # it has lenslets
        moved = replace(
            optics, lenslet_distance=b + height, separation=L - height,
            pupil_diameter=optics.pupil_diameter * (1 + aperture), lens=_stopped(self.camera, aperture),
        )  # fmt: skip
        image = np.asarray(to_numpy(white_image(moved, _ACCURACY)), float)
        if not any((tilt_y, tilt_x, shift_y, shift_x, turn)):
            return image
        pixel = self.camera.sensor.pixel_pitch
        middle = [n // 2 for n in image.shape]
        y, x = ((np.arange(n) - m) * pixel for n, m in zip(image.shape, middle, strict=True))
        y, x = np.meshgrid(y, x, indexing="ij")
        slope = math.tan(math.hypot(tilt_y, tilt_x)) / max(math.hypot(tilt_y, tilt_x), 1e-300)
        part = 1 / (1 + slope * (tilt_y * y + tilt_x * x) / (L + b))
        y, x = _drawn_out(y * part, x * part, (tilt_y, tilt_x))
        scale = (L + b) / (L - height)
        y, x = y - shift_y * scale, x - shift_x * scale
        cos, sin = math.cos(turn), math.sin(turn)
        back = [(cos * y - sin * x) / pixel + middle[0], (cos * x + sin * y) / pixel + middle[1]]
        return np.maximum(map_coordinates(image, back, order=5, mode="nearest"), 0)

    @cached_property
    def start(self) -> _ShownWhite:
        """Measures of the white image of the camera file."""
        return shown(self.white(np.zeros(len(CAUSES))))

    @cached_property
    def slopes(self) -> np.ndarray:
        """Derivatives of what is shown (10, 7)."""
        columns = []
        for k, step in enumerate(_STEPS):
            ends = [shown(self.white(np.eye(len(CAUSES))[k] * sign * step)).values for sign in (1, -1)]
            columns.append((ends[0] - ends[1]) / (2 * step))
        return np.stack(columns, 1)


def _drawn_out(y: np.ndarray, x: np.ndarray, tilt: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Places along a tilted array, of those seen from the axis."""
    angle = math.hypot(*tilt)
    if angle == 0:
        return y, x
    ny, nx = (one / angle for one in tilt)
    along = (ny * y + nx * x) * (1 / math.cos(angle) - 1)
    return y + ny * along, x + nx * along


def corrected(camera: LensletCamera, found: Twin) -> tuple[LensletCamera, tuple[str, ...]]:
    """The camera file as the bench stands, and what a camera file cannot hold.

    Diameter, turn and offset of the lenslets go in, and for a camera 2.0 the distances. The sensor of a
    camera 1.0 stands in its lenslets' focal plane by definition, and arrays in camera files do not lean.
    """
    left = ["camera files hold no tilt of the array"] if _sure(found, "tilt_y", "tilt_x") else []
    pitch = camera.lenslets.pitch
    offset = [one - found[f"shift_{axis}"] for one, axis in zip(camera.lenslets.offset, "yx", strict=True)]
    offset = [one - pitch * round(one / pitch) for one in offset]  # the raw image is turned by 180°
    lenslets: dict[str, Any] = {"rotation": camera.lenslets.rotation + found["turn"], "offset": tuple(offset)}
    diameter = camera.pupil_diameter * (1 + found["aperture"])
    changes: dict[str, Any] = {"main_lens": {"diameter": diameter}, "sensor": {"shape": camera.sensor.shape}}
    changes["built"] = Built()  # its distances go into the description
    if isinstance(camera, Rendered):
        b = camera.lenslet_distance + found["height"]
        m = b / camera.lenslets.focal_length[0] - 1
        image = camera.separation - found["height"] - b / m
        lenslets["magnification"] = m
        changes["object_distance"] = thin_lens.object_distance(camera.main_lens.focal_length, image)
    elif _sure(found, "height"):
        left.append("a camera 1.0 has its sensor in the lenslets' focal plane: the height was left out")
    return camera.replace(**changes, lenslets=lenslets), tuple(left)


def _sure(found: Twin, *causes: str) -> bool:
    return any(abs(found[one]) > SURE * found.errors[CAUSES.index(one)] for one in causes)


def _stopped(camera: LensletCamera, aperture: float) -> Train:
    return camera.replace(main_lens={"diameter": camera.pupil_diameter * (1 + aperture)}).optics().lens


def shown(white: np.ndarray, layout: Layout | None = None, pitch: float | None = None) -> _ShownWhite:
    """Lattice, slope, width and blur of a white image, with their standard deviations.

    Layout and pitch [px] are found more quickly where they are given.
    """
    found = calibrate(white, layout, pitch)
    index = found.indices.astype(float)
    middle = np.array([n // 2 for n in white.shape], float)
    nearest = index[np.argmin(np.hypot(*(found.centers - middle).T))]
    index = index - nearest
    reach = float(np.abs(found.centers - middle).max())
    basis = found.lattice.matrix.T
    start = np.concatenate([basis.ravel(), found.centers[np.argmin(np.hypot(*index.T))] - middle, [0.0, 0.0]])
    numbers, errors = leaning_lattice(found.centers - middle, index, reach, start)
    edge = pupil_edge(white, found)
    half = [edge.width_error / 1.96, edge.blur_error / 1.96]
    values = np.concatenate([numbers, [edge.width, edge.blur]])
    return _ShownWhite(values, np.concatenate([errors, half]), reach, found)


def leaning_lattice(
    centers: np.ndarray, index: np.ndarray, reach: float, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lattice vectors, origin and slope (8,) of centres (k, 2) from the picture's middle, and errors."""

    def off(numbers: np.ndarray) -> np.ndarray:
        return (leaning_centers(numbers, index, reach) - centers).ravel()

    fit = least_squares(off, start, method="lm")
    spread = 2 * fit.cost / max(len(fit.fun) - len(fit.x), 1)
    return fit.x, np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)) * spread)


def leaning_centers(numbers: np.ndarray, index: np.ndarray, reach: float) -> np.ndarray:
    """Centres (k, 2) from the picture's middle, of lattice vectors, origin and slope (8,)."""
    flat = index @ numbers[:4].reshape(2, 2) + numbers[4:6]
    return flat / (1 - flat @ numbers[6:8] / reach**2)[:, None]


def twin(
    whites: Sequence[RawImage],
    camera: LensletCamera | BenchModel | str | PathLike[str],
    *,
    dark: RawImage | None = None,
    pitch_error: float | None = None,
    progress: Progress = silent,
) -> Twin:
    """Misalignment by white images of one state of the bench.

    Parameters
    ----------
    whites
        White images.
    camera
        What the bench is meant to be; a `BenchModel` of it keeps what is computed for further pictures.
    dark
        Picture without light.
    pitch_error
        How well the lenslets' pitch over the pixels' is known, one standard deviation: the array's height is
        known no better than this part of its distance from the main lens, and the stop's diameter no better
        than the height over the lenslets' distance from the sensor. `PITCH_ERROR` and a note if None.
    progress
        Called as ``progress(fraction)``.

    Raises
    ------
    CalibrationError
        No white images, or of another size than the camera's sensor; micro-images without edges; a lattice
        that is not the camera's.
    """
    camera = upper_floors.camera(camera)
    bench = camera if isinstance(camera, BenchModel) else BenchModel(camera)
    known = PITCH_ERROR if pitch_error is None else checks.positive("pitch_error", pitch_error, "1")
    seen = _mean([shown(_bare(one, dark, bench.camera)) for one in whites])
    progress(0.1)
    expected = bench.start
    _check_pitch(seen, expected)
    slopes = bench.slopes
    progress(0.7)
    weight = _weight(seen, expected, known)
    normal = slopes[_USED].T @ weight @ slopes[_USED]
    values = np.zeros(len(CAUSES))
    for k in range(_ROUNDS):
        rest = _whole(seen.values - expected.values, expected)[_USED]
        values = values + np.linalg.solve(normal, slopes[_USED].T @ weight @ rest)
        expected = shown(bench.white(values))
        progress(0.7 + 0.3 * (k + 1) / _ROUNDS)
    rest = _whole(seen.values - expected.values, expected)[_USED]
    left = float(rest @ weight @ rest)
    ratio = float(seen.values[9] / expected.values[9])
    error = ratio * float(math.hypot(seen.errors[9], expected.errors[9]) / seen.values[9])
    freedom = len(rest) - len(CAUSES)
    covariance = np.linalg.inv(normal) * max(1.0, left / freedom)
    misfit, far = float(chi2.sf(left, freedom)), _far(float(values[0]), bench.camera.lenslet_distance)
    doubtful = ("height", "aperture") if far else ()
    notes = (*_notes(ratio, error, misfit), *far, *(_of_pitch(covariance) if pitch_error is None else ()))
    return Twin(values, covariance, (ratio, error), misfit, notes, doubtful)


def _weight(seen: _ShownWhite, expected: _ShownWhite, pitch_error: float) -> np.ndarray:
    """Inverse covariance of what is used; an unknown pitch scales both lattice vectors alike."""
    scale = np.concatenate([seen.values[:4], np.zeros(5)])
    variance = (seen.errors**2 + expected.errors**2)[_USED]
    variance[4:6] += _PLACED**2
    return np.linalg.inv(np.diag(variance) + pitch_error**2 * np.outer(scale, scale))


def _far(height: float, b: float) -> tuple[str, ...]:
    """A note where an array would be farther from its place than benches are."""
    if abs(height) <= _FARTHEST * b:
        return ()
    return (
        f"the pitch of the micro-images implies an array {abs(height) * 1e3:.3g} mm from its place, "
        f"{b * 1e3:.4g} mm above the sensor: more likely the camera file's pitch, pixels or distances "
        "are wrong, so height and stop have no instructions",
    )


def _of_pitch(covariance: np.ndarray) -> Iterator[str]:
    """Remark on the height and the stop where the error of the pitch is not given."""
    height, stop = 1.96 * np.sqrt(covariance[[0, -1], [0, -1]])
    yield (
        f"the lenslets' pitch over the pixels' is taken as known to {PITCH_ERROR:.2%}, so the height is known"
        f" to ± {height * 1e3:.3g} mm and the stop to ± {stop:.2g} of its diameter: no white image tells "
        "pitch from height. Give the error of the pitch (pitch_error) if you have measured it"
    )


def _notes(ratio: float, error: float, misfit: float) -> Iterator[str]:
    if abs(ratio - 1) > max(_BLUR, SURE * error):
        more = "more" if ratio > 1 else "less"
        yield (
            f"micro-images are blurred {abs(ratio - 1):.1%} {more} than expected: the sensor is out of "
            "focus of the lenslets, the light has another wavelength, or a lens has aberrations"
        )
    if misfit < 1e-4:
        yield (
            f"these causes do not explain all of the white image (probability {misfit:.1g}): check the "
            "camera file's pitch and layout"
        )


def _mean(found: list[_ShownWhite]) -> _ShownWhite:
    if not found:
        raise CalibrationError("there is no white image. Give one or more of the bench as it stands.")
    values = np.mean([one.values for one in found], 0)
    return _ShownWhite(values, np.sqrt(np.mean([one.errors**2 for one in found], 0) / len(found)))


def _bare(white: RawImage, dark: RawImage | None, camera: LensletCamera) -> np.ndarray:
    if white.shape != camera.sensor.shape:
        raise CalibrationError(
            f"the white image has {white.shape[0]} x {white.shape[1]} pixels but the camera file "
            f"{camera.sensor.shape[0]} x {camera.sensor.shape[1]}. Correct its [sensor] shape."
        )
    data = np.asarray(to_numpy(white.data), float)
    return data - (0.0 if dark is None else np.asarray(to_numpy(dark.data), float))


def _check_pitch(seen: _ShownWhite, expected: _ShownWhite) -> None:
    sizes = [math.sqrt(abs(float(np.linalg.det(one.values[:4].reshape(2, 2))))) for one in (seen, expected)]
    if abs(sizes[0] / sizes[1] - 1) > 0.03:
        raise CalibrationError(
            f"micro-images stand {sizes[0]:.3f} px apart where the camera file has {sizes[1]:.3f} px: this "
            "is another camera. Correct its pitch, pixels or distances."
        )


def _whole(rest: np.ndarray, expected: _ShownWhite) -> np.ndarray:
    """Differences with the origin brought to the nearest lenslet."""
    basis = expected.values[:4].reshape(2, 2)
    steps = np.rint(rest[4:6] @ np.linalg.inv(basis))
    return np.concatenate([rest[:4], rest[4:6] - steps @ basis, rest[6:]])
