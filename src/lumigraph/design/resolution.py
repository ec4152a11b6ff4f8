"""Limits by diffraction: f-number, numerical aperture, cut-off frequencies, Airy pattern, depth of field.

The f-number is the working one, distance over diameter, of the side on which lengths are measured: with
z2/D results hold in the image, with z1/D in the object.
"""

import math

from lumigraph.core import checks

AIRY_ZERO = 3.8317059702075125 / math.pi
"""First zero of the Airy pattern in units of λ F#: 1.2197, the zero of J1 over π, usually written 1.22."""


def f_number(distance: float, diameter: float) -> float:
    """Working f-number, distance over diameter.

    References
    ----------
    Thesis eq. 1.2 and 3.1.

    Examples
    --------
    >>> f_number(0.316, 0.005)
    63.2
    """
    return checks.positive("distance", distance) / checks.positive("diameter", diameter)


def numerical_aperture(f_number: float) -> float:
    """Numerical aperture in air, NA = 1 / (2 F#), for small angles.

    References
    ----------
    Born and Wolf, *Principles of Optics*, 8.6; thesis eq. 1.3 prints 2/F#.

    Examples
    --------
    >>> round(numerical_aperture(52.0), 4)
    0.0096
    """
    return 1 / (2 * checks.positive("f_number", f_number, "1"))


def incoherent_cutoff(wavelength: float, f_number: float) -> float:
    """Highest frequency in an incoherent image, 1 / (λ F#) [1/m].

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, chapter 6; thesis eq. 3.2.

    Examples
    --------
    >>> round(incoherent_cutoff(633e-9, 63.2))
    24997
    """
    return 1 / (checks.positive("wavelength", wavelength) * checks.positive("f_number", f_number, "1"))


def coherent_cutoff(wavelength: float, f_number: float) -> float:
    """Highest frequency in a coherent image's amplitude, 1 / (2 λ F#) [1/m].

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, chapter 6.
    """
    return incoherent_cutoff(wavelength, f_number) / 2


def airy_first_zero(wavelength: float, f_number: float) -> float:
    """Radius of the first dark ring of a round aperture, 1.22 λ F# [m]; half the central lobe.

    References
    ----------
    Born and Wolf, *Principles of Optics*, 8.5.2; thesis eq. 5.16 gives the lobe, 2.44 λ F#.

    Examples
    --------
    >>> round(airy_first_zero(633e-9, 63.2) * 1e6, 1)
    48.8
    """
    return AIRY_ZERO * checks.positive("wavelength", wavelength) * checks.positive("f_number", f_number, "1")


def depth_of_field(wavelength: float, f_number: float) -> float:
    """Whole range of focus over which the wavefront errs by a quarter wave at most, 4 λ F#² [m].

    With z1/D it is the depth of field in the object, with z2/D the depth of focus at the image.

    References
    ----------
    Born and Wolf, *Principles of Optics*, 8.8 (Rayleigh's quarter-wave tolerance, ± 2 λ F#²).

    Examples
    --------
    >>> round(depth_of_field(633e-9, 10.0) * 1e6, 1)
    253.2
    """
    return 4 * checks.positive("wavelength", wavelength) * checks.positive("f_number", f_number, "1") ** 2
