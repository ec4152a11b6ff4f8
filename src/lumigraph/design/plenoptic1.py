"""The plenoptic camera 1.0: lenslets at the main-lens image, F = z2, and the sensor in their focal plane."""

import math

from lumigraph.core import checks
from lumigraph.design import thin_lens
from lumigraph.design.resolution import AIRY_ZERO
from lumigraph.errors import GeometryError


def micro_image_pitch(pitch: float, separation: float, lenslet_distance: float) -> float:
    """Distance between neighbouring micro-images, p (1 + b/F) [m]; holds for 2.0 too, with F = z2 + a.

    Micro-images are projections of the lenslets from the centre of the main lens, so that they stand
    farther apart than the lenslets.

    Parameters
    ----------
    pitch
        Of the lenslets, p [m].
    separation
        Main lens to lenslets, F [m].
    lenslet_distance
        Lenslets to sensor, b [m].

    References
    ----------
    Similar triangles; thesis eq. 5.3 (its 1.0 chapter takes p).

    Examples
    --------
    >>> round(micro_image_pitch(150e-6, 0.24, 0.01) * 1e6, 2)
    156.25
    """
    p, big_f = checks.positive("pitch", pitch), checks.positive("separation", separation)
    return p * (1 + checks.positive("lenslet_distance", lenslet_distance) / big_f)


def smallest_lenslet(wavelength: float, focal_length: float) -> float:
    """Lenslet diameter below which its Airy lobe is wider than itself, sqrt(2.44 λ f_µ) [m].

    A wider lenslet keeps most of its light in its own micro-image; at this diameter it resolves only two
    directions (`resolvable_directions`).

    References
    ----------
    Thesis eq. 4.3, where the lenslet diameter is written D.

    Examples
    --------
    >>> round(smallest_lenslet(633e-9, 0.01) * 1e6, 1)
    124.3
    """
    wave, f = checks.positive("wavelength", wavelength), checks.positive("focal_length", focal_length)
    return math.sqrt(2 * AIRY_ZERO * wave * f)


def resolvable_directions(wavelength: float, diameter: float, focal_length: float) -> float:
    """Directions per axis that diffraction at a lenslet leaves apart, d² / (1.22 λ f_µ).

    The micro-image's width d over the Rayleigh distance 1.22 λ f_µ / d: pixels beyond that number see
    the same directions again.

    References
    ----------
    Rayleigh's criterion at the lenslet.

    Examples
    --------
    >>> round(resolvable_directions(633e-9, 150e-6, 0.01), 1)
    2.9
    """
    wave, f = checks.positive("wavelength", wavelength), checks.positive("focal_length", focal_length)
    return checks.positive("diameter", diameter) ** 2 / (AIRY_ZERO * wave * f)


def angular_resolution(f_number: float, samples: float) -> float:
    """Angle between neighbouring directions, Δθ / N = 1 / (F# N) [rad], of N samples per micro-image.

    References
    ----------
    Thesis eq. 4.11 with Δθ = 1/F#; diffraction limits it to `diffraction_angle`.

    Examples
    --------
    >>> round(angular_resolution(240 / 3.6, 30), 6)
    0.0005
    """
    return 1 / (checks.positive("f_number", f_number, "1") * checks.positive("samples", samples, "1"))


def diffraction_angle(wavelength: float, diameter: float) -> float:
    """Angle to which a lenslet spreads one direction, λ / d [rad].

    Examples
    --------
    >>> round(diffraction_angle(633e-9, 150e-6), 5)
    0.00422
    """
    return checks.positive("wavelength", wavelength) / checks.positive("diameter", diameter)


def refocus_factor(focal_length: float, object_distance: float, defocus: float) -> float:
    r"""Refocus factor α' = F/F' that brings an object at z1 + Δz into focus.

    .. math:: \alpha' = \frac{F}{F'} = \frac{z_1 (z_1 + \Delta z - f)}{(z_1 - f)(z_1 + \Delta z)}

    which is (2f + 2Δz) / (2f + Δz) at unit magnification, z1 = 2f.

    Parameters
    ----------
    focal_length
        Of the main lens, f [m].
    object_distance
        Where the camera is focused, z1 [m], beyond the focal length.
    defocus
        Δz of the object from there [m]; positive is farther from the camera.

    Raises
    ------
    GeometryError
        The focused plane or the object is not beyond the focal length: no real image.

    References
    ----------
    Thesis eq. 4.7 and 4.12; 4.14 is its 2f case with s = 2.

    Examples
    --------
    >>> [round(refocus_factor(0.12, 0.24, dz), 4) for dz in (-0.05, -0.025, 0.025, 0.05)]
    [0.7368, 0.8837, 1.0943, 1.1724]
    """
    f = checks.positive("focal_length", focal_length)
    dz = checks.finite("defocus", defocus)
    z1 = checks.positive("object_distance", object_distance)
    for name, value in (("the focused plane", z1), ("the object", z1 + dz)):
        if value <= f:
            raise GeometryError(
                f"{name} is {value * 1e3:.6g} mm from the main lens, inside its focal length of "
                f"{f * 1e3:.6g} mm: no real image. Use a distance above the focal length."
            )
    return thin_lens.image_distance(f, z1) / thin_lens.image_distance(f, z1 + dz)


def defocus(focal_length: float, object_distance: float, refocus_factor: float) -> float:
    """Distance from the focused plane of the object that `refocus_factor` brings into focus, Δz [m].

    The inverse of `refocus_factor`; positive is farther from the camera.

    Raises
    ------
    GeometryError
        The factor implies an image inside the focal length, beyond objects at infinity.

    Examples
    --------
    >>> round(defocus(0.12, 0.24, 14 / 19), 12)
    -0.05
    """
    alpha = checks.positive("refocus_factor", refocus_factor, "1")
    image = thin_lens.image_distance(focal_length, object_distance)
    if image / alpha <= focal_length:
        raise GeometryError(
            f"refocus factor {alpha:.6g} is beyond infinity: objects at infinity have "
            f"{image / focal_length:.6g}. Use a smaller factor."
        )
    return thin_lens.object_distance(focal_length, image / alpha) - object_distance
