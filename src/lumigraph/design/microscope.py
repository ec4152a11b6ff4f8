"""The light-field microscope: matching, resolution, depth of field and the band limit at each depth.

Lengths are in object space unless a function says otherwise. M is the magnification from the object to the
lenslets, d their pitch, λ the wavelength in vacuum, n the index of the medium.
"""

import math

from lumigraph.core import checks
from lumigraph.design.resolution import AIRY_ZERO
from lumigraph.errors import GeometryError

TUBE_LENSES = {
    "Nikon": 0.2,
    "Leica": 0.2,
    "Mitutoyo": 0.2,
    "Thorlabs": 0.2,
    "Olympus": 0.18,
    "Evident": 0.18,
    "Zeiss": 0.165,
}
"""Focal length [m] of the tube lens for which each maker states the magnification of an objective."""

SPARROW = 0.47
"""Distance of two points that just merge into one peak, in units of λ/NA (Sparrow's criterion)."""


def depth_per_alpha(
    magnification: float, aperture: tuple[float, float], distances: tuple[float, float]
) -> float:
    r"""Depth of an object over α' - 1 of the picture that it is sharp in [m], positive farther.

    .. math:: \frac{\Delta z}{\alpha' - 1} = \frac{n (F + b)}{k M^2}, \qquad
              k = \frac{4}{s^4} \left(\frac{2}{3} - c + \frac{c^3}{3}\right)

    A view sees the object under sin θ = s' and moves it by Δz tan θ; k is the slope of tan θ over sin θ by
    least squares in the pupil, with s = NA/n and c² = 1 - s²: 1 for a small aperture.

    Parameters
    ----------
    magnification
        From the object to the lenslets, M.
    aperture
        Numerical aperture and index of the medium (NA, n).
    distances
        Views to lenslets as the light field counts it, F (`LightField.separation`), and lenslets to sensor,
        b [m].

    Examples
    --------
    >>> round(depth_per_alpha(20, (0.01, 1.0), (0.04, 0.002)) * 1e6, 2)
    105.0
    """
    (na, index), (separation, b) = aperture, distances
    s = checks.positive("the numerical aperture", na, "1") / checks.positive("index", index, "1")
    if s >= 1:
        raise GeometryError(f"the numerical aperture {na:g} is not below the index {index:g}. Change one.")
    c = math.sqrt(1 - s**2)
    # 2/3 - c + c³/3 = (1 - c)² (2 + c)/3 and s² = (1 - c)(1 + c): nothing cancels in a small aperture.
    slope = 4 * (2 + c) / (3 * (1 + c) ** 2)
    return index * (separation + b) / (slope * magnification**2)


def tube_lens(maker: str) -> float:
    """Focal length of the maker's tube lens [m].

    Raises
    ------
    GeometryError
        A maker that is not in `TUBE_LENSES`.

    Examples
    --------
    >>> tube_lens("Olympus")
    0.18
    """
    for known, focal_length in TUBE_LENSES.items():
        if isinstance(maker, str) and maker.lower() == known.lower():
            return focal_length
    raise GeometryError(
        f"the tube lens of maker {maker!r} is not known. Give its focal length, or one of "
        f"{', '.join(TUBE_LENSES)}."
    )


def objective_focal_length(magnification: float, tube_focal_length: float) -> float:
    """Focal length of an objective, that of the tube lens it is made for over its magnification [m].

    Examples
    --------
    >>> round(objective_focal_length(60, 0.2) * 1e3, 4)
    3.3333
    """
    magnification = checks.positive("magnification", magnification, "1")
    return checks.positive("tube_focal_length", tube_focal_length) / magnification


def sine(numerical_aperture: float, index: float) -> float:
    """Sine of the half angle that an objective accepts, NA/n.

    Raises
    ------
    GeometryError
        The aperture is not below the index.

    Examples
    --------
    >>> round(math.degrees(math.asin(sine(1.2, 1.35))), 1)
    62.7
    """
    aperture = checks.positive("numerical_aperture", numerical_aperture, "1")
    if aperture >= checks.positive("index", index, "1"):
        raise GeometryError(
            f"the numerical aperture {aperture:g} is not below the medium's refractive index {index:g}. "
            "Check the immersion."
        )
    return aperture / index


def matched_f_number(numerical_aperture: float, magnification: float) -> float:
    """F-number of lenslets whose micro-images just touch, M / (2 NA).

    Faster lenslets leave pixels dark, slower ones let micro-images overlap.

    References
    ----------
    M. Levoy et al., "Light field microscopy", ACM Trans. Graph. 25, 924 (2006): image-side f-number.

    Examples
    --------
    >>> matched_f_number(1.2, 60)
    25.0
    """
    aperture = checks.positive("numerical_aperture", numerical_aperture, "1")
    return checks.positive("magnification", magnification, "1") / (2 * aperture)


def lateral_resolution(wavelength: float, numerical_aperture: float) -> float:
    """Radius of the first dark ring, 0.61 λ/NA [m]: what the objective alone resolves (Rayleigh).

    Examples
    --------
    >>> round(lateral_resolution(525e-9, 0.5) * 1e6, 4)
    0.6403
    """
    aperture = checks.positive("numerical_aperture", numerical_aperture, "1")
    return AIRY_ZERO / 2 * checks.positive("wavelength", wavelength) / aperture


def axial_resolution(wavelength: float, numerical_aperture: float, index: float) -> float:
    """First zero along the axis, λ / (n - sqrt(n² - NA²)) [m]; 2 n λ/NA² for small apertures.

    The phase between the axial and the marginal ray, k z (n - n cos θ), is 2π there: exact for light that is
    even over the cosine of its angle.

    Examples
    --------
    >>> round(axial_resolution(525e-9, 0.5, 1.0) * 1e6, 3)
    3.919
    """
    squared = sine(numerical_aperture, index) ** 2
    versine = squared / (1 + math.sqrt(1 - squared))  # 1 - cos θ, exact for small angles too
    return checks.positive("wavelength", wavelength) / (index * versine)


def depth_of_field(wavelength: float, numerical_aperture: float, index: float, spot: float = 0.0) -> float:
    """Depth of field of the objective alone, λ n/NA² + n e/NA [m].

    Parameters
    ----------
    wavelength, numerical_aperture, index
        Of the objective.
    spot
        e, the smallest detail the detector resolves, divided by the magnification [m].

    References
    ----------
    S. Inoué & K. R. Spring, *Video Microscopy*, 2nd ed., Plenum 1997.

    Examples
    --------
    >>> round(depth_of_field(593e-9, 1.2, 1.35) * 1e6, 3)
    0.556
    """
    sine(numerical_aperture, index)
    diffraction = checks.positive("wavelength", wavelength) * index / numerical_aperture**2
    return diffraction + index * checks.finite("spot", spot) / numerical_aperture


def directions(wavelength: float, numerical_aperture: float, magnification: float, pitch: float) -> float:
    """Resolvable directions per axis, N = d NA / (0.47 λ M): lenslet over resolved spot.

    References
    ----------
    M. Levoy et al., ACM Trans. Graph. 25, 924 (2006).

    Examples
    --------
    >>> round(directions(593e-9, 1.2, 60, 100e-6), 2)
    7.18
    """
    spot = SPARROW * checks.positive("wavelength", wavelength) / numerical_aperture
    return checks.positive("pitch", pitch) / (checks.positive("magnification", magnification, "1") * spot)


def refocus_range(wavelength: float, numerical_aperture: float, index: float, directions: float) -> float:
    """Depth over which a light field can be refocused sharply, (2 + N²) λ n / (2 NA²) [m], N directions.

    References
    ----------
    M. Levoy et al., ACM Trans. Graph. 25, 924 (2006).

    Examples
    --------
    >>> round(refocus_range(593e-9, 1.2, 1.35, 7.18) * 1e6, 1)
    14.9
    """
    sine(numerical_aperture, index)
    return (2 + directions**2) * wavelength * index / (2 * numerical_aperture**2)


def band_limit(wavelength: float, magnification: float, pitch: float, dz: float) -> float:
    """Highest lateral frequency of an object at depth dz that a lenslet passes, `d / (0.94 λ M |dz|)` [1/m].

    A lenslet's image in object space is an aperture of width d/M at distance `|dz|`. Its period is twice
    Sparrow's distance 0.47 λ/NA for that aperture. It holds where a point lights more than its own lenslet,
    `|dz| ≥ d² / (2 M² λ)` (`near_field`). The objective's own cut-off 2 NA/λ bounds it.

    References
    ----------
    M. Broxton et al., Opt. Express 21, 25418 (2013), derive such a limit. Here it follows from the aperture;
    USAF targets that are simulated and reconstructed at 25 and 50 um agree (`microscope-usaf`).

    Raises
    ------
    GeometryError
        The plane is nearer than `near_field`.

    Examples
    --------
    >>> round(band_limit(525e-9, 20, 125e-6, 50e-6) / 1e3)  # line pairs per mm
    253
    """
    near = near_field(wavelength, magnification, pitch)
    if abs(checks.finite("dz", dz)) < near * (1 - 1e-9):
        raise GeometryError(
            f"dz is {dz * 1e6:.4g} µm but the band limit holds from {near * 1e6:.4g} µm on either side. "
            "Use sampling_distance, which holds everywhere."
        )
    return pitch / (2 * SPARROW * wavelength * magnification * abs(dz))


def near_field(wavelength: float, magnification: float, pitch: float) -> float:
    """Depth on either side of the focused plane within which `band_limit` says nothing, d² / (2 M² λ) [m].

    References
    ----------
    M. Broxton et al., Opt. Express 21, 25418 (2013).

    Examples
    --------
    >>> round(near_field(525e-9, 20, 125e-6) * 1e6, 1)
    37.2
    """
    size = checks.positive("pitch", pitch) / checks.positive("magnification", magnification, "1")
    return size**2 / (2 * checks.positive("wavelength", wavelength))


def sampling_distance(wavelength: float, aperture: tuple[float, float], lenslet: float, dz: float) -> float:
    r"""Distance between the samples that a light field takes of a plane at depth dz [m].

    .. math:: \frac{d}{M} \text{ for } |dz| \le \frac{d}{2 M \tan\theta}, \text{ else }
              \max\left(\frac{0.47 \lambda M |dz|}{d},\ \frac{\lambda}{4\,\mathrm{NA}}\right)

    Near the focused plane the light of a point is not wider than a lenslet: which lenslet is lit shows where
    it is, one sample per lenslet. Beyond that, neighbouring lenslets see a point from sides that overlap, and
    what a lenslet resolves (`band_limit`) is the limit. Finer structure in a reconstruction is not measured.

    Parameters
    ----------
    wavelength
        In vacuum [m].
    aperture
        NA and index n of the objective, sin θ = NA/n.
    lenslet
        Pitch in object space, d/M [m].
    dz
        Depth from the focused plane [m].

    References
    ----------
    The last two bounds as M. Broxton et al. (2013); A. Stefanoiu et al., Opt. Express 27, 31644 (2019), use
    such a distance for a filter against lenslet-shaped artefacts.

    Examples
    --------
    >>> [round(sampling_distance(593e-9, (1.2, 1.35), 100e-6 / 60, dz * 1e-6) * 1e6, 2) for dz in (0, .4, 10)]
    [1.67, 1.67, 1.67]
    >>> round(sampling_distance(593e-9, (1.2, 1.35), 100e-6 / 60, 1e-6) * 1e6, 2)
    0.17
    """
    number, index = aperture
    tangent = math.tan(math.asin(sine(number, index)))
    size, away = checks.positive("lenslet", lenslet), abs(checks.finite("dz", dz))
    wave = checks.positive("wavelength", wavelength)
    beyond = max(SPARROW * wave * away / size, wave / (4 * number))
    return max(size, beyond) if 2 * away * tangent <= size * (1 + 1e-9) else beyond


def low_pass_distance(wavelength: float, aperture: tuple[float, float], lenslet: float, dz: float) -> float:
    r"""Width of a low-pass that keeps lenslet-shaped artefacts out of a plane at depth dz [m].

    .. math:: \max\left(\text{sampling distance},\ \frac{d}{M}\,\frac{4 - |dz|/z_0}{3}\right),
              \qquad z_0 = \frac{d}{2 M \tan\theta}

    Up to z_0 it is `sampling_distance`. Then it falls to nothing at 4 z_0, where `sampling_distance` allows
    more at once: single targets at a known depth show that finer structure is measured there, but beside
    other planes and a model's errors it is the lattice that comes through. 4 is by trial, on the real vesicle
    of `lfm-guv` and on simulated ones.

    Parameters
    ----------
    wavelength, aperture, lenslet, dz
        As in `sampling_distance`.

    Examples
    --------
    >>> [round(low_pass_distance(593e-9, (1.2, 1.35), 1.67e-6, dz * 1e-6) * 1e6, 2) for dz in (0, 1, 2)]
    [1.67, 0.93, 0.33]
    """
    fine = sampling_distance(wavelength, aperture, lenslet, dz)
    edge = lenslet / (2 * math.tan(math.asin(sine(*aperture))))
    return max(fine, lenslet * min(1.0, (4 - abs(dz) / edge) / 3))


def fourier_field(relay: float, magnification: float, pitch: float, focal_length: float) -> float:
    """Field of view of a Fourier light-field microscope, d f_F / (f_µ M) [m].

    Each lenslet stands in the pupil and images the whole field with magnification M f_µ / f_F: neighbouring
    images touch where they are a pitch wide.

    Parameters
    ----------
    relay
        Focal length f_F of the lens that images the pupil onto the lenslets [m].
    magnification
        M, from the object to the native image plane.
    pitch, focal_length
        Of the lenslets, d and f_µ [m].

    References
    ----------
    C. Guo et al., "Fourier light-field microscopy", Opt. Express 27, 25573 (2019).

    Examples
    --------
    >>> round(fourier_field(0.15, 20, 1e-3, 0.03) * 1e6)
    250
    """
    size = checks.positive("relay", relay) * checks.positive("pitch", pitch)
    shrunk = checks.positive("magnification", magnification, "1") * checks.positive(
        "focal_length", focal_length
    )
    return size / shrunk


def fourier_resolution(wavelength: float, relay: float, magnification: float, pitch: float) -> float:
    """Lateral resolution of a Fourier light-field microscope, λ f_F / (d M) [m].

    References
    ----------
    C. Guo et al., Opt. Express 27, 25573 (2019): λ / (2 NA) for the aperture d M / (2 f_F) of one lenslet.

    Examples
    --------
    >>> round(fourier_resolution(525e-9, 0.15, 20, 1e-3) * 1e6, 2)
    3.94
    """
    wave = checks.positive("wavelength", wavelength) * checks.positive("relay", relay)
    return wave / (checks.positive("pitch", pitch) * checks.positive("magnification", magnification, "1"))
