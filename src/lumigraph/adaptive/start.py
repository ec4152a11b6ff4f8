r"""A first wavefront from the shifts of views: a light field is a Shack-Hartmann sensor of its scene.

Each view looks through a part of the pupil at q. There a wavefront W (in waves) moves the picture by
Δ = -λ ∂W/∂q in the object, as a slope of it does on a Shack-Hartmann sensor, whatever the scene is: views are
compared with the mean of all, moved back. Depth moves pictures in proportion to q, as defocus does.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, shift

from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.elements.zernike import noll_to_nm, zernike
from lumigraph.errors import CalibrationError, GeometryError
from lumigraph.instruments import LensletCamera, LightFieldMicroscope, PlenopticCamera
from lumigraph.instruments.capabilities import Decoded, WithPupil
from lumigraph.rendering import decode

EDGE = 0.9
"""Of the pupil's radius, within which views count: beyond it they are dark, or half of them is."""

SMOOTH = (2.0, 1.2, 0.7, 0.5)
"""Standard deviations by which pictures are smoothed, in turn: large shifts come first [lenslets]."""

TURNS = 8
"""Of comparing and moving, for each of them."""

BASE = (2, 3, 4)
"""Tilts and defocus, which are the scene's place and depth: fitted and dropped."""

STEP = 1e-4
"""Of central differences, in pupil radii."""


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Shifts of views, and the wavefront that has these slopes.

    Parameters
    ----------
    coefficients
        Noll index to waves rms.
    deviations
        Their standard deviations, from what the wavefront leaves of the shifts [waves rms].
    places
        Where the views stand in the pupil (views, 2), y and x [pupil radii].
    shifts
        Of their pictures in the object (views, 2), y and x [m].
    residual
        Rms of what the wavefront leaves of the shifts [m].
    """

    coefficients: dict[int, float]
    deviations: dict[int, float]
    places: np.ndarray
    shifts: np.ndarray
    residual: float

    __repr__ = brief

    @property
    def rms(self) -> float:
        """Of the wavefront [waves]."""
        return float(np.linalg.norm(list(self.coefficients.values())))


def start(
    raw: RawImage | np.ndarray,
    instrument: LightFieldMicroscope | PlenopticCamera,
    terms: Sequence[int],
    *,
    pixels: Calibration | None = None,
) -> Slopes:
    """The wavefront of a light-field microscope or camera from the shifts of its views, as rays see it.

    A start for `estimate`, which knows diffraction: some tenths of it are left. Any object with texture.
    Before a camera of kind "plenoptic" it is a wavefront sensor for scenes; see `sense` for a point of light.

    Parameters
    ----------
    raw
        As it was read, without background.
    instrument
        A microscope of configuration "1.0", or a `PlenopticCamera`. Aberrations of its description are not
        taken away.
    terms
        Noll indices from 4 on; 4, defocus, where all of the scene is known to stand in the focused plane.
    pixels
        Calibration of a real camera.

    Raises
    ------
    GeometryError
        Another configuration, terms that are none or that the scene explains.
    CalibrationError
        A raw image of another shape, a dark or even one, too few lenslets.
    """
    size, aperture = _seen(instrument)
    asked = tuple(dict.fromkeys(int(j) for j in terms))
    for j in asked:
        noll_to_nm(j)
    if not asked or min(asked) < 4:
        raise GeometryError(f"terms are {asked} but the scene's place explains 1 to 3. Give others.")
    calibration = instrument.calibration if pixels is None else pixels
    places, pictures = _views(raw, aperture / instrument.magnification, calibration)
    base = tuple(j for j in BASE if j not in asked)
    every = (*base, *asked)
    slopes = -_slopes(places, every) * (instrument.wavelength / aperture / size)
    found, left = np.zeros(len(every)), np.zeros_like(places)
    for sigma in SMOOTH:
        smooth = gaussian_filter(pictures, (0, sigma, sigma))
        for _ in range(TURNS):
            left = _left(smooth, slopes @ found)
            found = found + np.linalg.lstsq(slopes.reshape(-1, len(every)), left.ravel(), rcond=1e-6)[0]
    flat = slopes.reshape(-1, len(every))
    variance = float(np.square(left).sum()) / max(left.size - len(every), 1)
    known = np.sqrt(variance * np.diag(np.linalg.pinv(flat.T @ flat)))
    n = len(base)
    return Slopes(
        {j: float(c) for j, c in zip(asked, found[n:], strict=True)},
        {j: float(d) for j, d in zip(asked, known[n:], strict=True)},
        places, (slopes @ found + left) * size, float(np.sqrt(np.mean(np.square(left).sum(1)))) * size,
    )  # fmt: skip


def _seen(instrument: LightFieldMicroscope | PlenopticCamera) -> tuple[float, float]:
    """Size of a lenslet in the object [m], and numerical aperture towards it."""
    if isinstance(instrument, LensletCamera) and isinstance(instrument, Decoded):
        distance = instrument.object_distance
        return instrument.lenslets.pitch / instrument.magnification, instrument.pupil_diameter / 2 / distance
    if not isinstance(instrument, WithPupil) or instrument.configuration != "1.0":
        raise GeometryError(
            "slopes are those of a PlenopticCamera or a LightFieldMicroscope of configuration '1.0'."
        )
    return instrument.lenslet_size, instrument.objective.numerical_aperture


def _views(
    raw: RawImage | np.ndarray, aperture: float, calibration: Calibration
) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 2) of the views in the pupil, in radii, and their contrasts (k, t, s).

    By the numerical aperture of the light on the lenslets.
    """
    data = np.asarray(raw.data if isinstance(raw, RawImage) else raw, np.float32)
    if data.shape != calibration.shape:
        raise CalibrationError(
            f"the raw image has shape {data.shape} but the instrument's {calibration.shape}."
        )
    checks.finite_array("the raw image", data, CalibrationError)
    views = decode(data, calibration)
    radius = views.separation * aperture
    v, u = np.meshgrid(views.aperture.y / radius, views.aperture.x / radius, indexing="ij")
    inside = np.hypot(v, u) < EDGE
    pictures = np.asarray(views.data)[inside]
    if min(pictures.shape[1:]) < 5:
        raise CalibrationError(f"views have {pictures.shape[1:]} lenslets but shifts need at least 5 x 5.")
    means = pictures.mean((1, 2), keepdims=True)
    if not means.min() > 0:
        raise CalibrationError("the raw image is dark: views without light have no shifts.")
    contrast = pictures / means - 1
    if contrast.std() < 1e-5:  # rounding
        raise CalibrationError("the raw image is even: without texture there are no shifts.")
    return -np.stack([v[inside], u[inside]], 1), contrast  # raw images are turned by 180°, objects are not


def _slopes(places: np.ndarray, terms: Sequence[int]) -> np.ndarray:
    """Slopes (k, 2, terms) of Zernike terms along y and x, per pupil radius."""
    found = []
    for ahead in (np.array([STEP, 0.0]), np.array([0.0, STEP])):
        ends = [_polynomials(places + side * ahead, terms) for side in (1, -1)]
        found.append((ends[0] - ends[1]) / (2 * STEP))
    return np.stack(found, 1)


def _polynomials(places: np.ndarray, terms: Sequence[int]) -> np.ndarray:
    rho, angle = np.hypot(*places.T), np.arctan2(places[:, 0], places[:, 1])
    return np.stack([zernike(j, rho, angle) for j in terms], 1)


def _left(pictures: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Shifts (k, 2) of pictures (k, t, s) from their mean, beyond those given; by Lucas and Kanade [px]."""
    back = np.stack(
        [shift(one, -d, order=1, mode="nearest") for one, d in zip(pictures, shifts, strict=True)]
    )
    mean = back.mean(0)
    slope = np.stack(np.gradient(mean))[:, 1:-1, 1:-1]
    square = np.tensordot(slope, slope, ((1, 2), (1, 2)))
    off = (back - mean)[:, 1:-1, 1:-1]
    right = -np.tensordot(off, slope, ((1, 2), (1, 2)))
    ridge = 1e-3 * np.trace(square) * np.eye(2)
    found = np.linalg.solve(square + ridge, right.T).T
    return found / np.maximum(1.0, np.linalg.norm(found, axis=1, keepdims=True))
