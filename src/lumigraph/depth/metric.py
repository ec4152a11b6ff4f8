"""Distances in metres through the camera's geometry, and points in space."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lumigraph.core import checks
from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.cloud import PointCloud
from lumigraph.core.depth_map import DepthMap
from lumigraph.core.grid import Grid
from lumigraph.core.lightfield import LightField
from lumigraph.depth.mesh import triangles
from lumigraph.depth.quantities import alpha_of
from lumigraph.design import thin_lens
from lumigraph.errors import CalibrationError, GeometryError
from lumigraph.rendering.geometry import Frame
from lumigraph.rendering.patches import lenslet_indices

PULL = 2.4
"""How far diffraction pulls disparities of plenoptic cameras 1.0, in λ F/A² of the refocus factor.

Light that lenslets diffract into their neighbours' outermost pixels looks as if it moved from view to view.
Nine views at p²/(λb) = 11 and 5.5 show textures nearer by 0.1 to 1.3 of this, the more so the farther they
are.
"""


def metric(
    found: DepthMap,
    source: LightField | Calibration,
    *,
    focal_length: float,
    object_distance: float | None = None,
    correction: Callable[[Array], np.ndarray] | None = None,
    wavelength: float = 550e-9,
) -> DepthMap:
    r"""Depth of each place from the focused plane [m], positive farther from the camera.

    The image of a place lies at F' = F/α' behind the main lens (plenoptic 1.0), or at L - a' (2.0), where

    .. math:: patch = \frac{b}{a'} \, p \, \frac{L - a'}{L} ;

    the thin lens equation takes it to the object.

    Parameters
    ----------
    found
        Disparities, refocus factors or patches.
    source
        What they were measured on: the light field of a 1.0 camera, decoded with a calibration that knows
        the camera's lengths; for patches the calibration of a 2.0 camera.
    focal_length
        Of the main lens [m].
    object_distance
        Of the plane in focus from the main lens [m]; for a 1.0 camera it follows from the separation.
    correction
        What diffraction does to refocus factors, such as a `BiasCurve`, for the method that measured them.
    wavelength
        Of the light [m]: what diffraction does without a correction is part of the expected error (`PULL`).

    Returns
    -------
    DepthMap
        NaN, with confidence 0, beyond infinity.

    Raises
    ------
    GeometryError
        No quantity that has a distance, lengths not above zero, or an object inside the focal length.
    CalibrationError
        Patches, and a calibration without its three lengths.

    References
    ----------
    Thesis eq. 4.7, 5.5 and 5.10; docs/reference/conventions.md.

    Examples
    --------
    >>> from lumigraph.core.grid import Grid
    >>> views = LightField(np.zeros((3, 3, 1, 1)), Grid((3, 3), 2e-3), Grid((1, 1), 1e-4), 0.24)
    >>> alpha = DepthMap(np.array([[1.0, 14 / 19]]), np.ones((1, 2)), "alpha")
    >>> metric(alpha, views, focal_length=0.12).values.round(6).tolist()
    [[0.0, -0.05]]
    """
    f = checks.positive("focal_length", focal_length)
    found.check("disparity", "alpha", "patch")
    if found.quantity == "patch":
        image, image_per_value = _image_of_patches(found, _calibration(source))
        focused = object_distance
        if focused is None:
            raise GeometryError("patches do not say where the camera is focused. Give object_distance= [m].")
    else:
        views = _views(source)
        found = _with_pull(alpha_of(found, views), views, checks.positive("wavelength", wavelength))
        alpha = to_numpy(found.values).astype(float)
        alpha = alpha if correction is None else np.asarray(correction(alpha), float)
        image = views.separation / np.where(alpha > 0, alpha, np.nan)
        image_per_value = image / np.where(alpha > 0, alpha, np.nan)
        focused = object_distance or thin_lens.object_distance(f, views.separation)
    distance = 1 / (1 / f - 1 / np.where(image > f, image, np.nan))
    slope = (distance / image) ** 2 * image_per_value if correction is None else None
    return found.replaced(distance - checks.positive("object_distance", focused), "depth", slope)


def _with_pull(found: DepthMap, views: LightField, wavelength: float) -> DepthMap:
    r"""Refocus factors, whose expected error holds what diffraction does to them.

    .. math:: \Delta\alpha' = 2.4 \, \frac{\lambda F}{A^2} \, \frac{n}{n - 1}

    with n views Δu apart over A = n Δu of the main lens.
    """
    n, step = views.aperture.shape[1], views.aperture.pitch[1]
    if found.error is None or n < 2:
        return found
    pull = PULL * wavelength * views.separation / (n * step) ** 2 * n / (n - 1)
    return replace(found, error=np.hypot(to_numpy(found.error), pull))


def defocus(found: DepthMap, views: LightField, depth_per_alpha: Callable[[float], float]) -> DepthMap:
    """Depth of each place before a microscope from the focused plane [m], positive farther.

    Parameters
    ----------
    found
        Disparities or refocus factors.
    views
        What they were measured on.
    depth_per_alpha
        Metres per unit of α' of views with a separation [m]: `LightFieldMicroscope.depth_per_alpha`.
    """
    found, per = alpha_of(found, views), depth_per_alpha(views.separation)
    return found.replaced((to_numpy(found.values).astype(float) - 1) * per, "depth", per)


def _views(source: LightField | Calibration) -> LightField:
    checks.instance("source", source, LightField)
    assert isinstance(source, LightField)
    return source


def _calibration(source: LightField | Calibration) -> Calibration:
    checks.instance("source", source, Calibration, CalibrationError)
    assert isinstance(source, Calibration)
    return source


def virtual_depth(found: DepthMap, calibration: Calibration) -> DepthMap:
    """Virtual depth, the size of a'/b, of each lenslet's patch, as the maker of multi-focus cameras counts.

    Pitch over patch where the calibration does not know the distances b and L, as for a main lens far away.
    """
    found.check("patch")
    c, patch = calibration, np.abs(to_numpy(found.values))
    if c.pixel_pitch and c.separation and c.lenslet_distance:
        return found.replaced(np.abs(_relay(found, c)) / c.lenslet_distance, "virtual depth")
    return found.replaced(c.lattice.pitch / patch, "virtual depth")


def _relay(found: DepthMap, calibration: Calibration) -> np.ndarray:
    """Main-lens image to lenslets, a' [m]."""
    pixel, length, b = calibration.pixel_pitch, calibration.separation, calibration.lenslet_distance
    if pixel is None or length is None or b is None:
        raise CalibrationError(
            "distances need the camera's lengths, but the calibration has no "
            f"{'pixel_pitch' if pixel is None else 'separation' if length is None else 'lenslet_distance'}. "
            "Give them by dataclasses.replace(calibration, pixel_pitch=..., separation=..., ...)."
        )
    pitch = calibration.lattice.pitch * pixel / (1 + b / length)
    below = to_numpy(found.values).astype(float) * pixel * length + b * pitch
    return b * pitch * length / np.where(below == 0, np.nan, below)


def _image_of_patches(found: DepthMap, calibration: Calibration) -> tuple[np.ndarray, np.ndarray]:
    """Main lens to its image, z2' = L - a' [m], and how much it moves with the patch [m/px]."""
    relay, c = _relay(found, calibration), calibration
    assert c.separation is not None  # _relay has seen to it
    assert c.lenslet_distance is not None
    ratio = 1 + c.lenslet_distance / c.separation
    return c.separation - relay, relay**2 * ratio / (c.lenslet_distance * c.lattice.pitch)


def cloud(
    depth: DepthMap,
    source: LightField | Calibration,
    *,
    object_distance: float,
    colours: Array | None = None,
    min_confidence: float = 0.5,
    grid: Grid | None = None,
    faces: bool = False,
) -> PointCloud:
    """Points (z, y, x) in space [m] of a map of depths; the main lens' middle is the origin.

    A ray through the middle of the main lens goes on straight: the image at x, F behind the lens, is that of
    a point at x z / F. Pictures stand upright, so its sign stays.

    Parameters
    ----------
    depth
        From `metric`.
    source
        As for `metric`: the light field, or the calibration whose lenslets the map belongs to.
    object_distance
        Of the plane in focus from the main lens [m].
    colours
        Picture (y, x) or (y, x, 3) of the map's shape, uint8 or 0 to 1; None for none.
    min_confidence
        Confidence below which a point is left out. 0.5 is an expected error of 0.45 px of `epi`, in the
        outermost view if that is less, and 0.55 px of `dense`.
    grid
        Of a map of the samples of a picture, by `dense`: `lumigraph.rendering.sight_grid`.
    faces
        Join neighbours by triangles to a mesh, which is cut where depth jumps; see `mesh.triangles`.

    Raises
    ------
    GeometryError
        No depths, or shapes that differ.
    """
    depth.check("depth")
    y, x, separation = _places(source, depth, grid)
    distance = to_numpy(depth.values).astype(float) + checks.positive("object_distance", object_distance)
    trust = to_numpy(depth.confidence)
    kept = np.isfinite(distance) & (trust >= min_confidence)
    points = np.stack([distance, y * distance / separation, x * distance / separation], -1)
    paint = None if colours is None else _painted(colours, depth.shape)[kept]
    joined = triangles(points, kept, depth.usual_error or 0.0) if faces else None
    return PointCloud(points[kept].astype(np.float32), paint, trust[kept].astype(np.float32), joined)


def _places(
    source: LightField | Calibration, depth: DepthMap, grid: Grid | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Places (y, x) of the map's samples at the lenslets [m], and their distance behind the main lens."""
    if isinstance(source, LightField) or grid is not None:
        places = source.lenslets if isinstance(source, LightField) else grid
        assert places is not None
        y, x = np.meshgrid(places.y, places.x, indexing="ij")
        separation = source.separation if isinstance(source, LightField) else Frame.of(source).separation
    else:
        source = _calibration(source)
        frame = Frame.of(source)
        places = (source.position(lenslet_indices(source)) - frame.axis) * frame.lenslet_per_px
        y, x, separation = places[..., 0], places[..., 1], frame.separation
    if y.shape != depth.shape:
        raise GeometryError(f"the map has shape {depth.shape} but its source has {y.shape} places.")
    return y, x, separation


def _painted(colours: Array, shape: tuple[int, int]) -> np.ndarray:
    paint = to_numpy(colours)
    if paint.shape[:2] != shape or paint.shape[2:] not in ((), (1,), (3,)):
        raise GeometryError(f"colours have shape {paint.shape} but must be {shape} or {(*shape, 3)}.")
    paint = paint[..., None] if paint.ndim == 2 else paint
    paint = np.broadcast_to(paint, (*shape, 3))
    return np.clip(paint, 0, 1).astype(np.float32) if paint.dtype.kind == "f" else paint
