"""The focused plenoptic camera 2.0: lenslets relay the main-lens image onto the sensor, m = b/a.

m > 0 is Keplerian: the main-lens image is real, a = b/m > 0 before the lenslets, and each micro-image
shows it upside down. m < 0 is Galilean: the image would fall -a behind the lenslets. L = z2 + a is the
distance from the main lens to the lenslets.
"""

from lumigraph.core import checks
from lumigraph.design import thin_lens
from lumigraph.design.resolution import AIRY_ZERO
from lumigraph.errors import GeometryError


def lenslet_distance(focal_length: float, magnification: float) -> float:
    """Lenslets to sensor, b = f_µ (1 + m) [m].

    Raises
    ------
    GeometryError
        m = 0, which images infinity (a plenoptic camera 1.0), or m at or below -1, which leaves no room
        for the sensor.

    References
    ----------
    Thesis eq. 5.13.

    Examples
    --------
    >>> round(lenslet_distance(5.2e-3, 0.5) * 1e3, 3), round(lenslet_distance(5.2e-3, -0.25) * 1e3, 3)
    (7.8, 3.9)
    """
    f, m = checks.positive("focal_length", focal_length), checks.finite("magnification", magnification, "1")
    if m == 0 or m <= -1:
        raise GeometryError(
            f"magnification is {m:g} but must be above 0 (Keplerian) or between -1 and 0 (Galilean)."
        )
    return f * (1 + m)


def relay_distance(focal_length: float, magnification: float) -> float:
    """Main-lens image to lenslets, a = b/m = f_µ (1 + 1/m) [m]; negative for a Galilean camera.

    References
    ----------
    1/a + 1/b = 1/f_µ; thesis eq. 5.14.

    Examples
    --------
    >>> round(relay_distance(5.2e-3, 0.5) * 1e3, 3), round(relay_distance(5.2e-3, -0.25) * 1e3, 3)
    (15.6, -15.6)
    """
    return lenslet_distance(focal_length, magnification) / magnification


def translators(focal_length: float, magnification: float) -> tuple[float, float]:
    """Settings c = b and d = a - b of a bench's two translation stages [m].

    c sets the lenslets' distance from the sensor. d is how much farther the main-lens image is from the
    lenslets, 0 at m = 1; the sensor then stands a + b behind that image.

    References
    ----------
    Thesis table 6.1, columns c and d; its text has them the other way round.

    Examples
    --------
    >>> [round(each * 1e3, 2) for each in translators(5.2e-3, 0.25)]
    [6.5, 19.5]
    """
    b = lenslet_distance(focal_length, magnification)
    return b, b / magnification - b


def patch(pitch: float, magnification: float, image_distance: float, separation: float) -> float:
    """Width on the sensor of the piece that tiles the picture without seams, m p z2 / L [m], signed.

    Neighbouring micro-images are centred on main-image points p z2 / L apart, and show them m times that
    apart. Negative for a Galilean camera, whose patches are not turned.

    References
    ----------
    Georgiev and Lumsdaine, *Focused plenoptic camera and rendering*, J. Electron. Imaging 19, 021106
    (2010); with the factor z2 / L that thesis eq. 5.5 leaves out.

    Examples
    --------
    >>> round(patch(150e-6, 0.5, 0.12, 0.1356) * 1e6, 2)
    66.37
    """
    p, m = checks.positive("pitch", pitch), checks.finite("magnification", magnification, "1")
    z2, length = checks.positive("image_distance", image_distance), checks.positive("separation", separation)
    return m * p * z2 / length


def magnification_at(
    focal_length: float, object_distance: float, separation: float, lenslet_distance: float
) -> float:
    """Lenslet magnification of an object at another distance, m' = b / a'; the sensor does not move.

    Parameters
    ----------
    focal_length
        Of the main lens [m].
    object_distance
        Object to main lens [m], beyond the focal length.
    separation
        Main lens to lenslets, L [m].
    lenslet_distance
        Lenslets to sensor, b [m].

    Raises
    ------
    GeometryError
        The object is inside the focal length, or its image falls on the lenslets themselves.

    References
    ----------
    a' = L - z2' with z2' from the thin lens; thesis eq. 5.9 with b for b'.

    Examples
    --------
    >>> round(magnification_at(0.06, 0.12, 0.1356, 7.8e-3), 12)
    0.5
    >>> round(magnification_at(0.06, 0.13, 0.1356, 7.8e-3), 3)
    0.323
    """
    object_distance = checks.positive("object_distance", object_distance)
    separation = checks.positive("separation", separation)
    if object_distance <= checks.positive("focal_length", focal_length):
        raise GeometryError(
            f"the object is {object_distance * 1e3:.6g} mm from the main lens, inside its focal length of "
            f"{focal_length * 1e3:.6g} mm: no real image. Move it beyond the focal length."
        )
    relay = separation - thin_lens.image_distance(focal_length, object_distance)
    if abs(relay) <= 1e-9 * separation:
        raise GeometryError(
            f"the image of an object at {object_distance * 1e3:.6g} mm falls on the lenslets: there is no "
            "magnification. Choose another depth."
        )
    return checks.positive("lenslet_distance", lenslet_distance) / relay


def views_per_axis(magnification: float) -> float:
    """Lenslets per axis that see the same point, `1 / |m|`, for a matched main lens.

    References
    ----------
    Thesis eq. 5.1.

    Examples
    --------
    >>> views_per_axis(-0.25)
    4.0
    """
    if checks.finite("magnification", magnification, "1") == 0:
        raise GeometryError(
            "magnification is 0 but must not be: such lenslets image infinity. Use plenoptic1."
        )
    return 1 / abs(magnification)


def rendered_cutoff(wavelength: float, pitch: float, magnification: float, lenslet_distance: float) -> float:
    """Highest frequency that a lenslet lets into the rendered picture, `|m| p / (λ b)` [1/m].

    Measured on the main-lens image; the lenslet's own cut-off p / (λ b), seen through its magnification.

    References
    ----------
    Goodman, *Introduction to Fourier Optics*, chapter 6; thesis eq. 5.18 prints b/p for p/b.

    Examples
    --------
    >>> round(rendered_cutoff(632.8e-9, 150e-6, 0.5, 7.8e-3))
    15195
    """
    wave, b = checks.positive("wavelength", wavelength), checks.positive("lenslet_distance", lenslet_distance)
    return (
        abs(checks.finite("magnification", magnification, "1")) * checks.positive("pitch", pitch) / (wave * b)
    )


def rendered_lobe(wavelength: float, pitch: float, relay_distance: float) -> float:
    """Width of a point's central lobe in the rendered picture, `2.44 λ |a| / p` [m], on the main-lens image.

    References
    ----------
    Airy pattern of a lenslet of width p; thesis eq. 5.16 has b, which is its width on the sensor.

    Examples
    --------
    >>> round(rendered_lobe(633e-9, 150e-6, 15.6e-3) * 1e6, 1)
    160.6
    """
    wave, p = checks.positive("wavelength", wavelength), checks.positive("pitch", pitch)
    return 2 * AIRY_ZERO * wave * abs(checks.finite("relay_distance", relay_distance)) / p
