"""A main lens of glass: Zernike terms over field and wavelength, fitted to the rays of its prescription.

The path Φ(l, m) = s + (w_0 - w) · (l, m) + δ n of plane waves that arrive at the image is fitted over the
ellipse as which the stop's rim appears, on the stop of the camera's thin lens. docs/theory/instruments.md
derives it.
"""

import hashlib
import math
from dataclasses import dataclass, fields
from functools import lru_cache
from importlib import metadata
from pathlib import Path

import numpy as np

from lumigraph.design import thin_lens
from lumigraph.elements import noll_to_nm, zernike
from lumigraph.elements.field_plate import VignettedPupil, ZernikeMap
from lumigraph.errors import GeometryError
from lumigraph.io.prescription import FirstOrder, Prescription, Rays, content
from lumigraph.store import array_cache

VERSION = 1
"""Version of the cached arrays: another one discards them."""

ORDER = 10
"""Highest radial order of the fit."""

FIELDS = (9, 17, 33, 65)
"""Numbers of fields that are tried; every second field gives the error of the interpolation."""

BETWEEN = 0.02
"""Waves rms that every second field may be off by, between the others: with all of them it is far less."""

UNFITTED = 0.05
"""Waves rms that the fit may leave."""

SAME_FOCUS = 0.005
"""Relative difference allowed between the focal lengths of camera file and prescription."""

MARGIN = 1.05
"""Factor by which fields beyond the object's corner are traced."""

VISIBLE = (400e-9, 700e-9)
"""Wavelengths that are traced at least where the glasses are known there [m]."""

_RADII, _ANGLES = 12, 14

TERMS = tuple(j for j in range(2, (ORDER + 1) * (ORDER + 2) // 2 + 1) if noll_to_nm(j)[1] >= 0)
"""Noll's indices of what a round lens has where the field lies along x; no piston."""


@dataclass(frozen=True, slots=True, eq=False)
class GlassRequest:
    """Requirements of a camera on its glass.

    Parameters
    ----------
    wavelength
        [m].
    object_distance
        From the front principal plane [m].
    focal_length, diameter
        Focal length and diameter of the camera's thin lens [m].
    reach
        Farthest field of the camera, a tangent.
    """

    wavelength: float
    object_distance: float
    focal_length: float
    diameter: float
    reach: float

    @property
    def image_distance(self) -> float:
        """Image distance of the thin lens [m]."""
        return thin_lens.image_distance(self.focal_length, self.object_distance)


@dataclass(frozen=True, slots=True, eq=False)
class LensGlass:
    """Ray-traced properties of a prescription.

    Parameters
    ----------
    first_order
        At the camera's wavelength.
    aberrations, openings
        Terms and openings of the camera's plate.
    entrance_pupil
        Diameter of what the camera uses [m].
    defocus
        From the paraxial image to the plane of the least rms wavefront on the axis, positive behind [m].
    moved
        Distances of the fields' chief rays from the thin lens' image, positive outwards [m].
    turned
        Directions of the pupil's middle from the thin lens', for the fields [rad], positive outwards.
    left
        Rms path that the fit leaves at worst [m].
    between
        Rms path by which terms at a field are off at worst that are interpolated from fields twice as far
        apart [m].
    rim
        Farthest place of the stop's rim from its ellipse, over the radius.
    notes
        Parts of the file that were not used.
    """

    first_order: FirstOrder
    aberrations: ZernikeMap
    openings: VignettedPupil
    entrance_pupil: float
    defocus: float
    moved: np.ndarray
    turned: np.ndarray
    left: float
    between: float
    rim: float
    notes: tuple[str, ...]

    def rms(self, field: float, wavelength: float) -> float:
        """Waves rms of the wavefront at a field, a tangent, but for tilt, which only moves the image."""
        waves = self.aberrations.at(0.0, field, wavelength)
        return math.sqrt(sum(c**2 for j, c in waves.items() if j > 3))


def first_order(path: Path, wavelength: float) -> FirstOrder:
    """First-order properties of a prescription at a wavelength [m]; errors as of `glass`."""
    return _first_order(path, hashlib.sha256(content(path)).hexdigest(), wavelength)


@lru_cache(16)
def _first_order(path: Path, digest: str, wavelength: float) -> FirstOrder:
    """`first_order`; traced by Optiland once, and kept."""

    def traced() -> dict[str, np.ndarray]:
        lens = Prescription(path)
        _check_wavelength(lens, wavelength)
        found = lens.first_order(wavelength)
        return {"first_order": np.array([getattr(found, field.name) for field in fields(found)])}

    key = hashlib.sha256(repr((VERSION, _version(), digest, wavelength)).encode()).hexdigest()
    return FirstOrder(*array_cache.kept(f"glass-first-{key}", traced)["first_order"].tolist())


def _version() -> str:
    """Version of Optiland."""
    try:
        return metadata.version("optiland")
    except metadata.PackageNotFoundError:
        return ""  # it is refused when it is needed


def glass(path: Path, wanted: GlassRequest) -> LensGlass:
    """Ray-traced properties of a prescription for a camera; cached.

    Raises
    ------
    FormatError
        A file that is not read.
    GeometryError
        A prescription that contradicts the camera, a lens that is not followed, rays that do not arrive.
    LumigraphError
        Optiland is not installed.
    """
    return _glass(path, hashlib.sha256(content(path)).hexdigest(), tuple(_numbers(wanted)))


def _numbers(wanted: GlassRequest) -> list[float]:
    return [getattr(wanted, field.name) for field in fields(wanted)]


@lru_cache(16)
def _glass(path: Path, digest: str, numbers: tuple[float, ...]) -> LensGlass:
    wanted = GlassRequest(*numbers)
    key = hashlib.sha256(repr((VERSION, _version(), digest, numbers)).encode()).hexdigest()
    kept = array_cache.kept(f"glass-{key}", lambda: _traced(path, wanted))
    return _of(kept)


def _of(kept: dict[str, np.ndarray]) -> LensGlass:
    numbers = dict(zip(_SCALARS, kept["numbers"].tolist(), strict=True))
    first = FirstOrder(*kept["first_order"].tolist())
    x = tuple(kept["fields"].tolist())
    aberrations = ZernikeMap(
        TERMS, np.array(kept["terms"])[:, None], x, None, tuple(kept["wavelengths"].tolist()), metres=True
    )
    notes = tuple(str(note) for note in kept["notes"].tolist() if note)
    openings = VignettedPupil(x, tuple(kept["wavelengths"].tolist()), np.array(kept["axes"]))
    return LensGlass(
        first, aberrations, openings, moved=np.array(kept["moved"]), turned=np.array(kept["turned"]),
        notes=notes, **numbers,
    )  # fmt: skip


_SCALARS = ("entrance_pupil", "defocus", "left", "between", "rim")


def _traced(path: Path, wanted: GlassRequest) -> dict[str, np.ndarray]:
    """Everything about a prescription, as arrays."""
    lens = Prescription(path)
    wavelengths = _wavelengths(lens, wanted.wavelength)
    first = lens.first_order(wanted.wavelength)
    pupil = _entrance_pupil(lens, first, wanted)
    lens.focus(wanted.object_distance, _image_distance(first, wanted), pupil)
    at, found = _enough(lens, wanted, wavelengths)
    numbers = [pupil, *(float(found[name]) for name in _SCALARS[1:])]
    return {
        "numbers": np.array(numbers),
        "first_order": np.array([getattr(first, field.name) for field in fields(first)]),
        "fields": at,
        "wavelengths": wavelengths,
        "notes": np.array(lens.notes or ("",)),
        **{name: found[name] for name in ("terms", "axes", "moved", "turned")},
    }


def _enough(lens: Prescription, wanted: GlassRequest, wavelengths: np.ndarray) -> tuple[np.ndarray, dict]:
    """Fields that are close enough to each other, and what their rays say."""
    between = math.inf
    for count in FIELDS:
        at = np.linspace(0, wanted.reach * MARGIN, count)
        found = _fitted(lens, wanted, at, wavelengths)
        between = found["between"] / wanted.wavelength
        if between <= BETWEEN:
            return at, found
    raise GeometryError(
        f"the aberrations of {lens.name!r} change so fast over the field that {FIELDS[-1] // 2 + 1} fields "
        f"leave {between:.2g} waves rms between them. Use a smaller field."
    )


def _check_wavelength(lens: Prescription, own: float) -> tuple[float, float]:
    """Range of wavelengths in which all glasses are known [m]; the camera's own must lie in it."""
    low, high = lens.wavelengths()
    if not low <= own <= high:
        raise GeometryError(
            f"the wavelength is {own * 1e9:.6g} nm but glasses of {lens.name!r} are known from "
            f"{low * 1e9:.6g} to {high * 1e9:.6g} nm. Use another wavelength."
        )
    return low, high


def _wavelengths(lens: Prescription, own: float) -> np.ndarray:
    low, high = _check_wavelength(lens, own)
    ends = max(low, min(VISIBLE[0], 0.9 * own)), min(high, max(VISIBLE[1], 1.1 * own))
    return np.unique([*np.linspace(ends[0], own, 4), *np.linspace(own, ends[1], 4)])


def _image_distance(first: FirstOrder, wanted: GlassRequest) -> float:
    return thin_lens.image_distance(first.focal_length, wanted.object_distance)


def _entrance_pupil(lens: Prescription, first: FirstOrder, wanted: GlassRequest) -> float:
    """Diameter that has the thin lens' aperture at the image [m]."""
    if abs(first.focal_length - wanted.focal_length) > SAME_FOCUS * wanted.focal_length:
        raise GeometryError(
            f"focal_length is {wanted.focal_length * 1e3:.6g} mm but {lens.name!r} has "
            f"{first.focal_length * 1e3:.6g} mm at {wanted.wavelength * 1e9:.6g} nm. Write that."
        )
    m, ratio = _image_distance(first, wanted) / wanted.object_distance, first.pupil_magnification
    wider = (ratio + m) / (ratio * (1 + m))
    if wanted.diameter * wider > first.widest * (1 + 1e-3):
        raise GeometryError(
            f"the main lens is {wanted.diameter * 1e3:.6g} mm wide but {lens.name!r} opens to "
            f"{first.widest / wider * 1e3:.6g} mm of a thin lens at this distance. Use a smaller diameter."
        )
    return wanted.diameter * wider


def _pupil() -> np.ndarray:
    """Points (n, 2) of half the stop, its rim last: the other half is the same in the mirror."""
    rho = np.sqrt((np.arange(_RADII) + 0.5) / _RADII)
    rho = np.append(rho, 1.0)
    angle = np.linspace(0, math.pi, _ANGLES)
    return np.stack([np.outer(rho, np.cos(angle)).ravel(), np.outer(rho, np.sin(angle)).ravel()], axis=-1)


def _fitted(lens: Prescription, wanted: GlassRequest, at: np.ndarray, wavelengths: np.ndarray) -> dict:
    """Terms (wavelengths, fields, terms) and what else the rays at some fields say."""
    points, own = np.concatenate(([[0.0, 0.0]], _pupil())), wanted.wavelength
    bundles = {w: _arrived(lens, w, wanted, at, points) for w in wavelengths.tolist()}
    mine = bundles[min(bundles, key=lambda w: abs(w - own))]
    defocus = _best_focus(mine, wanted)
    heights, chief, turn = _at_chief(mine, defocus)
    places = _places(mine, chief, wanted)
    middles = _ellipses(places)[:, 0]
    terms, axes = np.zeros((len(wavelengths), len(at), len(TERMS))), np.zeros((len(wavelengths), len(at), 2))
    left = rim = 0.0
    for n, bundle in enumerate(bundles.values()):
        path = _path(bundle, heights, defocus)
        along, across = _places(bundle, chief, wanted)
        for k, (center, *axes[n, k]) in enumerate(_ellipses((along, across))):
            u, v = (along[k] - center) / axes[n, k, 0], across[k] / axes[n, k, 1]
            rim = max(rim, float(np.abs(np.hypot(u, v)[-_ANGLES:] - 1).max()))
            terms[n, k], off = _terms(u[1:], v[1:], path[k, 1:])
            left = max(left, off)
    if left > UNFITTED * own:
        raise GeometryError(
            f"{lens.name!r} has aberrations of which {len(TERMS)} Zernike terms leave {left / own:.2g} waves "
            f"rms; {UNFITTED:g} are allowed. Use a smaller diameter or field."
        )
    turning = np.array([noll_to_nm(j)[1] != 0 for j in TERMS])
    terms[:, 0, turning] = 0.0  # rounding: a round lens has none on the axis
    magnification = wanted.image_distance / wanted.object_distance
    own_height = magnification * at * wanted.object_distance
    middle = turn - middles * wanted.diameter / 2 / wanted.image_distance
    return {
        "terms": terms, "axes": axes, "defocus": defocus, "left": left, "rim": rim,
        "between": _between(at, terms), "moved": -heights - own_height,
        "turned": -middle - own_height / wanted.image_distance,
    }  # fmt: skip


def _arrived(
    lens: Prescription, wavelength: float, wanted: GlassRequest, at: np.ndarray, points: np.ndarray
) -> Rays:
    rays = lens.trace(wavelength, at * wanted.object_distance, points)
    through = np.isfinite(rays.path).all(axis=1) & np.isfinite(rays.along).all(axis=1)
    if not through.all():
        first = int(np.argmin(through))
        if first:
            told = f"whole to {math.degrees(math.atan(at[first - 1])):.3g} degrees"
        else:
            told = "not whole on the axis"
        raise GeometryError(
            f"rays of {lens.name!r} at {math.degrees(math.atan(at[first])):.3g} degrees miss a surface or "
            f"end at an aperture; light that is cut off is not followed, and the stop is {told}. "
            "Use a smaller field or diameter."
        )
    return rays


def _cosine(rays: Rays) -> np.ndarray:
    return np.sqrt(1 - rays.along**2 - rays.across**2)


def _at_chief(rays: Rays, defocus: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights where the fields' chief rays meet a plane behind the image's, their cosines and slopes."""
    chief = rays.along[:, 0]
    slope = chief / _cosine(rays)[:, 0]
    return rays.height[:, 0] + defocus * slope, chief, slope


def _path(rays: Rays, heights: np.ndarray, defocus: float) -> np.ndarray:
    """Φ (fields, rays) at places on a plane behind the image's [m]."""
    moved = (heights[:, None] - rays.height) * rays.along - rays.beside * rays.across
    return rays.path + moved + defocus * _cosine(rays)


def _places(rays: Rays, chief: np.ndarray, wanted: GlassRequest) -> tuple[np.ndarray, np.ndarray]:
    """Positions of rays in the thin lens' stop, along and across the field, over its radius."""
    scale = -2 * wanted.image_distance / wanted.diameter
    return scale * (rays.along - chief[:, None]), scale * rays.across


def _best_focus(rays: Rays, wanted: GlassRequest) -> float:
    """Plane behind the image's in which the wavefront on the axis has no defocus [m]."""
    u, v = (each[0, 1:] for each in _places(rays, rays.along[:, 0], wanted))
    radius, at = float(np.hypot(u, v).max()), TERMS.index(4)
    own, depth = (
        _terms(u / radius, v / radius, each[0, 1:])[0][at]
        for each in (_path(rays, np.zeros(len(rays.path)), 0.0), _cosine(rays))
    )
    return float(-own / depth)


def _ellipses(places: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Centre along the field and half axes (fields, 3) of the ellipse as which the stop's rim appears."""
    found = np.array([_ellipse(*rim) for rim in zip(*(each[:, -_ANGLES:] for each in places), strict=True)])
    found[0, 0] = 0.0
    found[0, 1:] = found[0, 1:].mean()
    return found


def _ellipse(u: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
    """Centre along u and half axes of the ellipse a u² + b v² + c u = 1 through points."""
    (a, b, c), *_ = np.linalg.lstsq(np.stack([u**2, v**2, u], axis=-1), np.ones(len(u)), rcond=None)
    center, size = -c / (2 * a), 1 + c**2 / (4 * a)
    return center, math.sqrt(size / a), math.sqrt(size / b)


def _terms(u: np.ndarray, v: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients of `TERMS` of a path, and the rms that they leave."""
    rho, theta = np.hypot(u, v), np.arctan2(v, u)
    basis = np.stack([zernike(j, rho, theta) for j in (1, *TERMS)], axis=-1)
    path = path - path.mean()
    found, *_ = np.linalg.lstsq(basis, path, rcond=None)
    return found[1:], float(np.sqrt(np.mean((basis @ found - path) ** 2)))


def _between(at: np.ndarray, terms: np.ndarray) -> float:
    """Rms path by which fields are off at worst that are interpolated from every second one [m]."""
    coarse = ZernikeMap(TERMS, terms[:, None, ::2], tuple(at[::2]), None, tuple(range(1, len(terms) + 1)))
    worst = 0.0
    for n in range(len(terms)):
        for k in range(1, len(at), 2):
            found = coarse.at(0.0, float(at[k]), float(n + 1))
            worst = max(worst, float(np.linalg.norm([found[j] for j in TERMS] - terms[n, k])))
    return worst
