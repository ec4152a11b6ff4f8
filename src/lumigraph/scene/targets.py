"""Test targets in object space; each function draws a scene on a grid in the focused plane.

Intensities lie between 0 and 1. The first row of a picture has the most negative y and is shown on top.
Edges are grey: a sample takes the fraction of its area that the target covers.
"""

import math
import warnings
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from lumigraph.core import checks, coverage
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError, SamplingWarning
from lumigraph.scene.rgbd import rgbd
from lumigraph.scene.usaf import bar_width, usaf1951, usaf_elements
from lumigraph.scene.volumes import Diffuser, Points, Scene, Slice

Pair = tuple[float, float]

THESIS_FREQUENCIES = (0.10e4, 0.80e4, 1.52e4, 2.22e4, 2.94e4)
"""The five frequencies of the thesis' grating [1/m] (Table 5.5)."""


__all__ = [
    "THESIS_FREQUENCIES",
    "bar_width",
    "chessboard",
    "edge",
    "gratings",
    "photo",
    "pinhole",
    "points",
    "rgbd",
    "siemens_star",
    "slanted_edge",
    "texture",
    "usaf1951",
    "usaf_elements",
    "white",
]


def pinhole(grid: Grid, diameter: float = 10e-6, position: Pair = (0.0, 0.0)) -> Scene:
    """A bright disc.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    diameter
        [m]; a hole smaller than a sample gives it the intensity of its share of the area.
    position
        Position of the middle (y, x) [m].

    Raises
    ------
    GeometryError
        A diameter that is not above zero, or a hole outside the grid.

    Examples
    --------
    >>> hole = pinhole(Grid.square(64, 1e-6), 20e-6).parts[0]
    >>> round(float(hole.intensity.sum()) * 1e-12 / (math.pi * 10e-6**2), 9)
    1.0
    """
    coverage.check_canvas(grid)
    radius = checks.positive("diameter", diameter) / 2
    center = checks.pair("position", position)
    picture = coverage.disc((grid.y - center[0])[:, None], grid.x - center[1], radius, grid.pitch)
    if not picture.any():
        raise GeometryError(
            f"the pinhole at ({center[0]:.4g}, {center[1]:.4g}) m lies outside the grid of "
            f"{grid.size[0]:.4g} x {grid.size[1]:.4g} m. Move it, or enlarge the grid."
        )
    return Scene([Slice(picture, grid)])


def edge(grid: Grid, angle: float = 0.0, position: Pair = (0.0, 0.0)) -> Scene:
    """A straight edge: dark to the left, bright to the right.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    angle
        [rad] that the edge is turned, from +x towards +y; 0 is vertical, π/2 bright below (positive y).
    position
        A point of the edge (y, x) [m].

    Examples
    --------
    >>> edge(Grid((1, 4), 1.0)).parts[0].intensity.tolist()
    [[0.0, 0.0, 0.5, 1.0]]
    """
    coverage.check_canvas(grid)
    center = checks.pair("position", position)
    normal = coverage.sides(checks.finite("angle", angle, "rad"))
    distance = (grid.y - center[0])[:, None] * normal[0] + (grid.x - center[1]) * normal[1]
    return Scene([Slice(coverage.half_plane(distance, normal, grid.pitch), grid)])


def slanted_edge(grid: Grid, angle: float = math.radians(5), position: Pair = (0.0, 0.0)) -> Scene:
    """An `edge` turned by 5°, for measuring a transfer function (ISO 12233)."""
    return edge(grid, angle, position)


def gratings(grid: Grid, frequencies: Sequence[float] = THESIS_FREQUENCIES, *, stacked: bool = True) -> Scene:
    """Upright sinusoidal lines of several frequencies, 0.5 + 0.5 cos(2πfx), in bands of equal size.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    frequencies
        [1/m]; default those of the thesis, 0.10, 0.80, 1.52, 2.22 and 2.94e4.
    stacked
        Bands one below the other, each over the grid's whole width; False puts them side by side.

    Raises
    ------
    GeometryError
        No frequency, or one that is not above zero.

    Warns
    -----
    SamplingWarning
        A frequency at or above the grid's highest, 1/(2dx).

    References
    ----------
    The thesis, section 5.6, Table 5.5 and Figure 5.20.

    Examples
    --------
    >>> gratings(Grid((2, 4), 1.0), (0.25, 0.01)).parts[0].intensity[0].round(6).tolist()
    [0.0, 0.5, 1.0, 0.5]
    """
    coverage.check_canvas(grid)
    if not isinstance(frequencies, Sequence | np.ndarray) or not np.size(frequencies):
        raise GeometryError("no frequencies were given. Give at least one [1/m].")
    for frequency in frequencies:
        if checks.positive("frequency", frequency, "1/m") >= (limit := 1 / (2 * grid.pitch[1])):
            warnings.warn(
                f"a grating of {frequency:.4g} /m is drawn on samples {grid.pitch[1] * 1e6:.4g} µm apart, "
                f"which hold less than {limit:.4g} /m. Use a pitch below {5e5 / frequency:.4g} µm.",
                SamplingWarning,
                stacklevel=2,
            )
    count, axis = len(frequencies), 0 if stacked else 1
    band = np.arange(grid.shape[axis]) * count // grid.shape[axis]
    waves = 0.5 + 0.5 * np.cos(2 * np.pi * np.outer(frequencies, grid.x))
    picture = waves[band] if stacked else np.broadcast_to(waves[band, np.arange(len(band))], grid.shape)
    return Scene([Slice(np.clip(picture, 0.0, 1.0), grid)])


def siemens_star(
    grid: Grid, spokes: int = 36, diameter: float | None = None, position: Pair = (0.0, 0.0)
) -> Scene:
    """A star of bright and dark sectors of equal angle, its finest lines in the middle.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    spokes
        Bright sectors; at radius r there are spokes / (2πr) line pairs per metre. One is centred on +x.
    diameter
        [m]; None for nine tenths of the grid.
    position
        Position of the middle (y, x) [m].

    Raises
    ------
    GeometryError
        Fewer than one spoke, or a diameter that is not above zero.
    """
    coverage.check_canvas(grid)
    if isinstance(spokes, bool) or not isinstance(spokes, int | np.integer) or spokes < 1:
        raise GeometryError(f"spokes is {spokes!r} but must be a whole number of at least 1.")
    radius = checks.positive("diameter", 0.9 * min(grid.size) if diameter is None else diameter) / 2
    center = checks.pair("position", position)

    def bright(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        y, x = y - center[0], x - center[1]
        return (y**2 + x**2 <= radius**2) & (np.cos(spokes * np.arctan2(y, x)) > 0)

    return Scene([Slice(coverage.supersampled(grid, bright), grid)])


def chessboard(
    grid: Grid,
    corners: tuple[int, int] = (5, 8),
    spacing: float | None = None,
    *,
    angle: float = 0.0,
    position: Pair = (0.0, 0.0),
) -> Scene:
    """A board of squares on white paper, such as `lumigraph.metrology.find_corners` looks for.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    corners
        Inner corners down and across: one less than squares.
    spacing
        Width of a square [m]; None for a board that fills the grid but for a margin of a square.
    angle
        Rotation of the board, from +x towards +y [rad].
    position
        Position of the middle of the board (y, x) [m].

    Raises
    ------
    GeometryError
        No corners, or a spacing that is not above 0.

    Examples
    --------
    >>> board = chessboard(Grid.square(120, 1e-4), (3, 5), 1.5e-3).parts[0].intensity
    >>> float(board.min()), float(board.max()), float(board[60, 60]), float(board[62, 62])
    (0.0, 1.0, 0.5, 1.0)
    """
    coverage.check_canvas(grid)
    counts, center = checks.shape("corners", corners), checks.pair("position", position)
    if spacing is None:
        spacing = min(size / (n + 3) for size, n in zip(grid.size, counts, strict=True))
    spacing = checks.positive("spacing", spacing)
    sin, cos = math.sin(checks.finite("angle", angle, "rad")), math.cos(angle)

    def bright(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        y, x = y - center[0], x - center[1]
        row = np.floor((cos * y - sin * x) / spacing + (counts[0] + 1) / 2)
        column = np.floor((cos * x + sin * y) / spacing + (counts[1] + 1) / 2)
        outside = (row < 0) | (row > counts[0]) | (column < 0) | (column > counts[1])
        return outside | ((row + column) % 2 == 1)

    return Scene([Slice(coverage.supersampled(grid, bright), grid)])


def photo(grid: Grid, image: np.ndarray | None = None) -> Scene:
    """A photograph, as large as fits in the grid, resampled to its samples.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    image
        (y, x) or (y, x, c): whole numbers (the type's highest becomes 1), or floats taken as intensities.
        None takes scikit-image's photographer (``pip install 'lumigraph[photo]'``).

    Raises
    ------
    GeometryError
        An image of another shape.
    LumigraphError
        Negative, NaN or infinite values, or no image and no scikit-image.

    Examples
    --------
    >>> photo(Grid((40, 60), 1e-6)).parts[0].intensity.shape
    (40, 40)
    """
    coverage.check_canvas(grid)
    image = _photographer() if image is None else image
    pixels = np.asarray(to_numpy(image))
    if pixels.ndim not in (2, 3) or min(pixels.shape) < 1:
        raise GeometryError(f"a photo has shape (y, x) or (y, x, c), not {pixels.shape}.")
    highest = np.iinfo(pixels.dtype).max if pixels.dtype.kind in "iu" else 1
    values = pixels / highest
    checks.finite_array("the photo", values)
    size = min(grid.size[0] / pixels.shape[0], grid.size[1] / pixels.shape[1])
    shape = tuple(max(1, min(grid.shape[k], round(size * pixels.shape[k] / grid.pitch[k]))) for k in (0, 1))
    resized = _resized(values, (shape[0], shape[1]))
    return Scene([Slice(resized, grid.resized((shape[0], shape[1])))])


def _photographer() -> np.ndarray:
    try:
        from skimage.data import camera
    except ImportError as error:
        raise LumigraphError(
            "the photographer comes with scikit-image: pip install 'lumigraph[photo]'. Or give an image."
        ) from error
    return camera()


def _resized(picture: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Linear interpolation between samples, after a Gaussian that keeps finer detail from aliasing."""
    from scipy.ndimage import gaussian_filter, zoom

    factors = [new / old for new, old in zip(shape, picture.shape, strict=False)]
    spread = [max(0.0, (1 / factor - 1) / 2) for factor in factors]
    rest = picture.ndim - 2
    smooth = gaussian_filter(picture, [*spread, *[0.0] * rest], mode="mirror")
    return np.asarray(zoom(smooth, [*factors, *[1.0] * rest], order=1, mode="mirror", grid_mode=True))


def points(positions: Sequence[Sequence[float]], intensities: Sequence[float] | None = None) -> Scene:
    """Points of light.

    Parameters
    ----------
    positions
        (y, x) or (y, x, dz) of each [m], or text with a unit; dz from the focused plane, positive farther
        from the camera.
    intensities
        Intensity of each; None for 1.

    Raises
    ------
    GeometryError
        A position that has neither two nor three numbers, or another number of intensities than points.

    Examples
    --------
    >>> points([(0, 0), (1e-3, 0, 5e-3)]).parts[0].positions.tolist()
    [[0.0, 0.0, 0.0], [0.001, 0.0, 0.005]]
    """
    rows = []
    if not isinstance(positions, Sequence | np.ndarray):
        raise GeometryError(f"positions are {positions!r} but must be a list of (y, x) or (y, x, dz).")
    for number, position in enumerate(positions):
        if not isinstance(position, Sequence | np.ndarray):
            raise GeometryError(f"point {number} is {position!r} but must be (y, x) or (y, x, dz).")
        if len(position) not in (2, 3):
            raise GeometryError(f"point {number} has {len(position)} numbers but needs (y, x) or (y, x, dz).")
        places = [checks.finite(f"point {number}", one) if isinstance(one, str) else one for one in position]
        rows.append((*places, 0.0)[:3])
    weights = np.ones(len(rows)) if intensities is None else intensities
    return Scene([Points(rows or np.zeros((0, 3)), weights)])  # type: ignore[arg-type]


def texture(grid: Grid, width: float, *, seed: int = 0) -> Scene:
    """A random grey pattern without edges or period, as charts for depth need it.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    width
        Size of its grains, the standard deviation of the blur that makes them from noise [m].
    seed
        Seed of the random numbers.

    Examples
    --------
    >>> grains = texture(Grid.square(64, 1e-5), 3e-5).parts[0].intensity
    >>> bool(0 <= grains.min() < 0.1), bool(0.9 < grains.max() <= 1)
    (True, True)
    """
    coverage.check_canvas(grid)
    blur = [checks.positive("width", width) / pitch for pitch in grid.pitch]
    noise = np.random.default_rng(checks.whole("seed", seed, 0)).standard_normal(grid.shape)
    grains = gaussian_filter(noise, blur, mode="wrap")
    return Scene([Slice(np.clip(0.5 + 0.25 * grains / max(float(grains.std()), 1e-30), 0, 1), grid)])


def white(intensity: float = 1.0) -> Scene:
    """An evenly lit diffuser before the main lens: the scene of a white image."""
    return Scene([Diffuser(intensity)])
