"""Illumination of a transmitting sample: Köhler's, its aperture, and how coherent its light is."""

from typing import NamedTuple

from lumigraph.core import checks
from lumigraph.design.resolution import AIRY_ZERO


class Koehler(NamedTuple):
    """Köhler illumination of a bench: the lamp's image stands on the main lens, never on the sample.

    `source_image` is its width there [m]; `numerical_aperture` that of the light at each point of the sample.
    """

    source_image: float
    numerical_aperture: float


def koehler(source_width: float, condenser: float, koehler_lens: float, object_distance: float) -> Koehler:
    """Illumination by a lamp in the front focal plane of its condenser, and a lens that focuses what follows.

    Parameters
    ----------
    source_width
        Width of the lamp, or of the diffuser before it [m].
    condenser
        Its focal length, as far as the lamp stands from it [m].
    koehler_lens
        Focal length of the Köhler lens, as far as the main lens stands behind it [m].
    object_distance
        Sample to main lens [m].

    References
    ----------
    Thesis figure 6.1: a condenser of 27 mm; its lamp's image on the main lens.

    Examples
    --------
    >>> found = koehler(10e-3, 27e-3, 240e-3, 120e-3)
    >>> round(found.source_image * 1e3, 1), round(found.numerical_aperture, 2)
    (88.9, 0.37)
    """
    width = checks.positive("source_width", source_width)
    image = width * checks.positive("koehler_lens", koehler_lens) / checks.positive("condenser", condenser)
    return Koehler(image, image / 2 / checks.positive("object_distance", object_distance))


def coherence_width(wavelength: float, numerical_aperture: float) -> float:
    """Distance of two points of the sample whose light is incoherent, 0.61 λ/NA [m].

    References
    ----------
    Van Cittert and Zernike: first zero of 2 J1(v)/v; with thesis eq. 3.5 it is where fringes vanish.

    Examples
    --------
    >>> round(coherence_width(630e-9, 0.01) * 1e6, 1)
    38.4
    """
    wave, na = (
        checks.positive("wavelength", wavelength),
        checks.positive("numerical_aperture", numerical_aperture),
    )
    return AIRY_ZERO * wave / (2 * na)


def coherence_area(wavelength: float, source_width: float, distance: float) -> float:
    """Area in which light of a square lamp still interferes, R²λ²/S [m²]; thesis eq. 3.6, corrected.

    Examples
    --------
    >>> round(coherence_area(633e-9, 1e-3, 1.0) * 1e6, 3)
    0.401
    """
    wave, far = checks.positive("wavelength", wavelength), checks.positive("distance", distance)
    return (wave * far / checks.positive("source_width", source_width)) ** 2


def coherence_time(wavelength: float, bandwidth: float) -> float:
    """Time in which light stays in phase with itself, τ = λ²/(c Δλ) [s]; thesis eq. 3.8, corrected.

    Examples
    --------
    >>> round(coherence_time(630e-9, 20e-9) * 1e15, 1)
    66.2
    """
    wave, width = checks.positive("wavelength", wavelength), checks.positive("bandwidth", bandwidth)
    return wave**2 / (299_792_458.0 * width)
