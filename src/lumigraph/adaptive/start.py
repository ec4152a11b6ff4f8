r"""A first wavefront from the shifts of views: a light field is a Shack-Hartmann sensor of its scene.

Each view looks through a part of the pupil at q. There a wavefront W (in waves) moves the picture by
Δ = -λ ∂W/∂q in the object, as a slope of it does on a Shack-Hartmann sensor, whatever the scene is: views are
compared with the mean of all, moved back. Depth moves pictures in proportion to q, as defocus does.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import gaussian_filter, shift

from lumigraph.adaptive.checked import bent, known_of
from lumigraph.core import checks
from lumigraph.core.brief import brief
from lumigraph.core.calibration import Calibration
from lumigraph.core.raw import RawImage
from lumigraph.deconvolution.problem import Problem
from lumigraph.elements.zernike import noll_to_nm, zernike
from lumigraph.errors import CalibrationError, GeometryError, SamplingError
from lumigraph.instruments import LensletCamera, LightFieldMicroscope, PlenopticCamera
from lumigraph.instruments.capabilities import Decoded, WithPupil
from lumigraph.rendering import decode

EDGE = 0.9
"""Part of the pupil's radius within which views count: beyond it they are dark, or half of them is."""

SMOOTH = (2.0, 1.2, 0.7, 0.5)
"""Standard deviations by which pictures are smoothed, in turn: large shifts come first [lenslets]."""

TURNS = 8
"""Rounds of comparing and moving, for each of them."""

DEFOCUS = 4
"""Noll's index."""

BASE = (2, 3, DEFOCUS)
"""Tilts and defocus, which are the scene's place and depth: fitted and dropped."""

STEP = 1e-4
"""Step of central differences, in pupil radii."""

TILE, TILES = 2, 8
"""Least lenslets along a side of the parts whose scatter gives the deviations, for neighbours share light and
texture; and most parts along a side."""

RAYS = 0.15
"""Part of a wavefront, rms over all terms, that rays get wrong whatever the scene is: 0.1 to 0.2 rad of 1 rad
behind lenslets of 120 and 80 µm (`python -m benchmarks.wavefront_sensor scenes`)."""

NEAR = 2
"""Lenslets, along each axis, whose spilled light counts."""

FINE = 0.4
"""Samples of the pupil's image for it [half widths of a lenslet's spot]."""


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Shifts of views, and the wavefront that has these slopes.

    Parameters
    ----------
    coefficients
        Noll index to waves rms.
    deviations
        Their standard deviations, by the scatter between parts of the picture, and by what rays get wrong
        [waves rms].
    covariance
        Of the coefficients, in order (terms, terms) [waves² rms].
    places
        Where the views stand in the pupil (views, 2), y and x [pupil radii].
    shifts
        Of their pictures in the object (views, 2), y and x [m].
    residual
        Rms of what the wavefront leaves of the shifts [m].
    instrument
        The description with these aberrations in place of its own.
    """

    coefficients: dict[int, float]
    deviations: dict[int, float]
    covariance: np.ndarray
    places: np.ndarray
    shifts: np.ndarray
    residual: float
    instrument: LightFieldMicroscope | PlenopticCamera

    __repr__ = brief

    @property
    def rms(self) -> float:
        """Rms of the wavefront [waves]."""
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
    Errors are alike in neighbouring views, so that residuals of shifts say too little of them. Deviations are
    from the scatter of what parts of the picture add to the coefficients, with 15 % of the wavefront,
    spread evenly over the terms, for what rays get wrong. Light that lenslets spill into their neighbours'
    micro-images moves views of cameras, too, as defocus does: that is known, and taken away.
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

    References
    ----------
    K.-Y. Liang & S. L. Zeger, Biometrika 73, 13 (1986): covariance by clusters of residuals.
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
    found, left, smooth = np.zeros(len(every)), np.zeros_like(places), pictures
    spilled = _spilled(places, instrument, aperture / instrument.magnification)
    inverse = np.linalg.pinv(slopes.reshape(-1, len(every)), rcond=1e-6)
    for sigma in SMOOTH:
        smooth = gaussian_filter(pictures, (0, sigma, sigma))
        for _ in range(TURNS):
            left = _left(smooth, slopes @ found + spilled)
            found = found + inverse @ left.ravel()
    n, scatter = len(base), _scatter(smooth, slopes @ found + spilled, inverse)
    covariance = scatter[n:, n:] + RAYS**2 * float(np.mean(found[n:] ** 2)) * np.eye(len(asked))
    return Slopes(
        {j: float(c) for j, c in zip(asked, found[n:], strict=True)},
        {j: float(d) for j, d in zip(asked, np.sqrt(np.diag(covariance)), strict=True)},
        covariance, places, (slopes @ found + left) * size,
        float(np.sqrt(np.mean(np.square(left).sum(1)))) * size, _with(instrument, asked, found[n:]),
    )  # fmt: skip


def starts(
    problem: Problem,
    instrument: LightFieldMicroscope | PlenopticCamera,
    terms: Sequence[int],
    pixels: Calibration | None,
    own_defocus: float = 0.0,
) -> list[np.ndarray]:
    """Coefficients (terms,) to begin with, from the views' shifts: all, and those above the second order.

    Less the defocus that is due to the scene's own depth [waves rms], where defocus is one of the terms.
    None of an image whose views cannot be compared. A scene of few things passes for astigmatism if those
    along y and those along x stand at other depths.
    """
    try:
        slopes = start(problem.light.astype(np.float32), instrument, terms, pixels=pixels)
    except (CalibrationError, SamplingError):
        return []
    found = np.array([slopes.coefficients[j] for j in terms]) - _known(instrument, terms)
    found = found - own_defocus * (np.array(terms) == DEFOCUS)
    high = np.array([noll_to_nm(j)[0] > 2 for j in terms])
    return [found, found * high] if high.any() and not high.all() else [found]


def _with(
    instrument: LightFieldMicroscope | PlenopticCamera, terms: Sequence[int], found: np.ndarray
) -> LightFieldMicroscope | PlenopticCamera:
    """The instrument with these coefficients in place of its own."""
    return bent(instrument, terms, found - _known(instrument, terms))


def _known(instrument: LightFieldMicroscope | PlenopticCamera, terms: Sequence[int]) -> np.ndarray:
    return np.array([known_of(instrument).get(j, 0.0) for j in terms])


def _seen(instrument: LightFieldMicroscope | PlenopticCamera) -> tuple[float, float]:
    """Size of a lenslet in the object [m], and numerical aperture towards it."""
    if isinstance(instrument, LensletCamera) and isinstance(instrument, Decoded):
        distance = instrument.object_distance
        return instrument.lenslets.pitch / instrument.magnification, instrument.pupil_diameter / 2 / distance
    if not isinstance(instrument, WithPupil) or instrument.configuration != "1.0":
        raise GeometryError(
            "only a PlenopticCamera or a LightFieldMicroscope of configuration '1.0' has slopes of views."
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


def _spilled(
    places: np.ndarray, instrument: LightFieldMicroscope | PlenopticCamera, aperture: float
) -> np.ndarray:
    """Displacement (k, 2) of pictures, seen from places in the pupil, by light from neighbouring lenslets.

    In lenslets, behind square ones of a camera. Each lenslet's image of the pupil is blurred by its spot,
    sinc² along y and x; what falls into a neighbour's micro-image is a picture that is moved by a lenslet.
    `aperture` is of the light on the lenslets.
    """
    if not isinstance(instrument, LensletCamera) or instrument.lenslets.layout != "square":
        return np.zeros_like(places)  # before microscopes nothing was gained: their pupils are not evenly lit
    pitch, wavelength = instrument.lenslets.pitch, instrument.wavelength
    edge = aperture * pitch / wavelength  # in half widths of a spot, from its middle to its first zero
    apart = pitch**2 / (wavelength * float(np.mean(instrument.lenslets.focal_length)))
    at = np.linspace(-edge, edge, math.ceil(2 * edge / FINE))
    y, x = np.meshgrid(at, at, indexing="ij")
    lit = np.stack([y, x], -1)[np.hypot(y, x) <= edge]
    moved, total = np.zeros_like(places), np.zeros(len(places))
    for n in product(range(-NEAR, NEAR + 1), repeat=2):
        off = (edge * places - apart * np.array(n))[:, None] - lit
        light = np.square(np.sinc(off).prod(-1)).sum(1)
        total += light
        moved -= light[:, None] * np.array(n)
    return moved / total[:, None]


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


def _compared(pictures: np.ndarray, shifts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differences of pictures (k, t, s), moved back, from their mean; its slopes (2, t, s), and their square.

    Inside the border, with a ridge that bounds shifts where there is little texture.
    """
    back = np.stack(
        [shift(one, -d, order=1, mode="nearest") for one, d in zip(pictures, shifts, strict=True)]
    )
    mean = back.mean(0)
    slope = np.stack(np.gradient(mean))[:, 1:-1, 1:-1]
    square = np.tensordot(slope, slope, ((1, 2), (1, 2)))
    return (back - mean)[:, 1:-1, 1:-1], slope, square + 1e-3 * np.trace(square) * np.eye(2)


def _left(pictures: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Shifts (k, 2) of pictures (k, t, s) from their mean, beyond those given; by Lucas and Kanade [px]."""
    off, slope, square = _compared(pictures, shifts)
    found = np.linalg.solve(square, -np.tensordot(slope, off, ((1, 2), (1, 2)))).T
    return found / np.maximum(1.0, np.linalg.norm(found, axis=1, keepdims=True))


def _scatter(pictures: np.ndarray, shifts: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Covariance (terms, terms) of coefficients, by the scatter of what parts of the pictures add to them.

    `inverse` (terms, 2 k) makes coefficients of shifts. A part adds by all views together, so that errors
    that are alike in many views count in full.
    """
    off, slope, square = _compared(pictures, shifts)
    right = np.stack([_tiled(off * one) for one in slope])  # (2, k, tiles)
    moved = np.linalg.solve(square, -right.reshape(2, -1)).reshape(right.shape)
    added = inverse @ moved.transpose(1, 0, 2).reshape(inverse.shape[1], -1)
    added -= added.mean(1, keepdims=True)
    n = added.shape[1]
    return added @ added.T * (n / (n - 1))


def _tiled(planes: np.ndarray) -> np.ndarray:
    """Sums (k, tiles) of planes (k, t, s) over `TILES` along a side, fewer where they would be too small."""
    for axis in (1, 2):
        size = planes.shape[axis]
        count = min(max(size // TILE, 2), TILES)
        planes = np.add.reduceat(planes, np.arange(count) * size // count, axis)
    return planes.reshape(len(planes), -1)
