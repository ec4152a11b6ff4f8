"""The thin lens: 1/z1 + 1/z2 = 1/f."""

from lumigraph.core import checks
from lumigraph.errors import GeometryError


def image_distance(focal_length: float, object_distance: float) -> float:
    r"""Distance from a lens to the image of an object [m]; negative for a virtual image before the lens.

    .. math:: z_2 = \frac{f z_1}{z_1 - f}

    Parameters
    ----------
    focal_length
        f [m], above zero.
    object_distance
        Object to lens, z1 [m]; negative for a virtual object behind the lens.

    Raises
    ------
    GeometryError
        The object is in the focal plane: its image is at infinity.

    References
    ----------
    Hecht, *Optics*, Gaussian lens formula; thesis eq. 4.12 and, with the sign corrected, 5.6.

    Examples
    --------
    >>> image_distance(0.06, 0.12)
    0.12
    """
    f, z1 = checks.positive("focal_length", focal_length), checks.finite("object_distance", object_distance)
    if abs(z1 - f) <= 1e-12 * f:
        raise GeometryError(
            f"the object stands in the focal plane ({z1 * 1e3:.6g} mm): its image is at infinity. "
            "Move the object away from the focal plane."
        )
    return f * z1 / (z1 - f)


def object_distance(focal_length: float, image_distance: float) -> float:
    """Distance from the object to a lens whose image lies at `image_distance` [m]; see `image_distance`.

    Raises
    ------
    GeometryError
        The image is in the focal plane: its object is at infinity.

    Examples
    --------
    >>> round(object_distance(0.06, 0.09), 12)
    0.18
    """
    f, z2 = checks.positive("focal_length", focal_length), checks.finite("image_distance", image_distance)
    if abs(z2 - f) <= 1e-12 * f:
        raise GeometryError(
            f"the image stands in the focal plane ({z2 * 1e3:.6g} mm): its object is at infinity. "
            "Move the image away from the focal plane."
        )
    return f * z2 / (z2 - f)


def focal_length(object_distance: float, image_distance: float) -> float:
    """Focal length that images z1 to z2, f = z1 z2 / (z1 + z2) [m]; both distances above zero.

    Examples
    --------
    >>> focal_length(0.12, 0.12)
    0.06
    """
    z1 = checks.positive("object_distance", object_distance)
    z2 = checks.positive("image_distance", image_distance)
    return z1 * z2 / (z1 + z2)


def magnification(object_distance: float, image_distance: float) -> float:
    """Size of the image over that of the object, z2 / z1; positive stands for an inverted real image.

    Examples
    --------
    >>> magnification(0.18, 0.09)
    0.5
    """
    return checks.finite("image_distance", image_distance) / checks.positive(
        "object_distance", object_distance
    )


def plano_convex_focal_length(radius: float, index: float) -> float:
    """Focal length of a lens with one plane side, f = r/(n - 1) [m].

    References
    ----------
    Thesis eq. 6.1.

    Examples
    --------
    Lenslets of silica.

    >>> round(plano_convex_focal_length(sag_radius(1.184e-6, 150e-6), 1.457) * 1e3, 2)
    5.2
    """
    n = checks.positive("index", index)
    if n <= 1:
        raise GeometryError(f"index is {n:g} but a lens in air needs more than 1, such as 1.457 of silica.")
    return checks.positive("radius", radius) / (n - 1)


def sag_radius(sag: float, width: float) -> float:
    """Radius of a sphere that rises by `sag` over the half of a lenslet's width, (s² + p²/4)/(2s) [m].

    References
    ----------
    Thesis eq. 6.2.

    Examples
    --------
    >>> sag_radius(1.0, 2.0)
    1.0
    """
    s, p = checks.positive("sag", sag), checks.positive("width", width)
    if s > p / 2:
        raise GeometryError(f"sag is {s:g} m but a sphere of width {p:g} m rises by half of that at most.")
    return (s**2 + p**2 / 4) / (2 * s)
