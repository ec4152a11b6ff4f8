"""Test targets in object space; each function draws a scene on a grid in the focused plane.

Intensities lie between 0 and 1. The first row of a picture has the most negative y and is shown on top.
Edges are grey: a sample takes the fraction of its area that the target covers.
"""

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from lumigraph.core import checks, coverage, memory
from lumigraph.core.arrays import to_numpy
from lumigraph.core.grid import Grid
from lumigraph.errors import GeometryError, LumigraphError, SamplingWarning
from lumigraph.scene.volumes import Diffuser, Points, Scene, Slice

Pair = tuple[float, float]

THESIS_FREQUENCIES = (0.10e4, 0.80e4, 1.52e4, 2.22e4, 2.94e4)
"""The five frequencies of the thesis' grating [1/m] (Table 5.5)."""


def pinhole(grid: Grid, diameter: float = 10e-6, position: Pair = (0.0, 0.0)) -> Scene:
    """A bright disc.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    diameter
        [m]; a hole smaller than a sample gives it the intensity of its share of the area.
    position
        Of the middle (y, x) [m].

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
    _check_grid(grid)
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
    _check_grid(grid)
    center = checks.pair("position", position)
    normal = coverage.sides(checks.finite("angle", angle, "rad"))
    distance = (grid.y - center[0])[:, None] * normal[0] + (grid.x - center[1]) * normal[1]
    return Scene([Slice(coverage.half_plane(distance, normal, grid.pitch), grid)])


def slanted_edge(grid: Grid, angle: float = math.radians(5), position: Pair = (0.0, 0.0)) -> Scene:
    """An `edge` turned by 5°, for measuring a transfer function (ISO 12233)."""
    return edge(grid, angle, position)


def usaf1951(
    grid: Grid,
    groups: int | tuple[int, int] = (2, 4),
    position: Pair = (0.0, 0.0),
    *,
    dark_bars: bool = False,
) -> Scene:
    r"""USAF-1951 resolution target: elements of three bars, upright and lying.

    Element e = 1 to 6 of group g has

    .. math:: 2^{g + (e - 1)/6}\ \text{line pairs per mm},

    bars five times as long as wide, and gaps as wide as bars. The first group fills the left column, its
    largest element on top; the following groups stand one below the other in the right column.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    groups
        First and last group, both drawn; one number for one group.
    position
        Middle of the chart (y, x) [m].
    dark_bars
        Dark bars on a bright ground, instead of bright bars.

    Raises
    ------
    GeometryError
        A chart that does not fit in the grid; the message says the size needed.

    Warns
    -----
    SamplingWarning
        Bars narrower than a sample.

    References
    ----------
    MIL-STD-150A, 1959, section 5.1.1.7.

    Examples
    --------
    >>> chart = usaf1951(Grid.square(300, 20e-6), groups=2).parts[0]
    >>> [round(float(bar_width(2, e)) * 1e6, 2) for e in (1, 6)]
    [125.0, 70.15]
    """
    _check_grid(grid)
    first, last = _first_and_last(groups)
    if first > last:
        raise GeometryError(f"groups are {first} to {last}: give the coarser (smaller) number first.")
    elements = list(_usaf_elements(first, last))
    height = max(y + 5 * width for y, _, width in elements)
    breadth = max(x + 12 * width for _, x, width in elements)
    center = checks.pair("position", position)
    top, left = center[0] - height / 2, center[1] - breadth / 2
    _check_fits(grid, (top, left), (height, breadth), f"USAF groups {first} to {last}")
    _warn_if_narrow(grid, elements[-1][2])
    picture = np.zeros(grid.shape)
    for y, x, width in elements:
        for k in (0, 2, 4):
            _add_bar(picture, grid, (top + y, left + x + k * width), (5 * width, width))
            _add_bar(picture, grid, (top + y + k * width, left + x + 7 * width), (width, 5 * width))
    return Scene([Slice(1.0 - picture if dark_bars else np.minimum(picture, 1.0), grid)])


def usaf_elements(
    groups: int | tuple[int, int] = (2, 4), position: Pair = (0.0, 0.0)
) -> list[tuple[int, int, Pair, float]]:
    """Group, element, corner (y, x) and bar width [m] of each element of `usaf1951`, coarse to fine.

    From a corner the upright bars extend to +x, 5 widths in all; the lying ones begin 7 widths from it.

    Examples
    --------
    >>> [(group, e, round(width * 1e6, 2)) for group, e, _, width in usaf_elements(7)][:2]
    [(7, 1, 3.91), (7, 2, 3.48)]
    """
    first, last = _first_and_last(groups)
    elements = list(_usaf_elements(first, last))
    height = max(y + 5 * width for y, _, width in elements)
    breadth = max(x + 12 * width for _, x, width in elements)
    center = checks.pair("position", position)
    top, left = center[0] - height / 2, center[1] - breadth / 2
    return [
        (first + k // 6, k % 6 + 1, (top + y, left + x), width) for k, (y, x, width) in enumerate(elements)
    ]


def bar_width(group: int, element: int) -> float:
    """Width of a bar of the USAF-1951 target [m]: half a line pair."""
    return 1e-3 / (2 * 2 ** (group + (element - 1) / 6))


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
    _check_grid(grid)
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
        Of the middle (y, x) [m].

    Raises
    ------
    GeometryError
        Fewer than one spoke, or a diameter that is not above zero.
    """
    _check_grid(grid)
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
    """A board of squares on white paper, such as `lumigraph.metric.find_corners` looks for.

    Parameters
    ----------
    grid
        Samples of the focused plane.
    corners
        Inner corners down and across: one less than squares.
    spacing
        Width of a square [m]; None for a board that fills the grid but for a margin of a square.
    angle
        By which the board is turned, from +x towards +y [rad].
    position
        Of the middle of the board (y, x) [m].

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
    _check_grid(grid)
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
    _check_grid(grid)
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
        (y, x) or (y, x, dz) of each [m]; dz from the focused plane, positive farther from the camera.
    intensities
        Of each; None for 1.

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
        rows.append((*position, 0.0)[:3])
    weights = np.ones(len(rows)) if intensities is None else intensities
    return Scene([Points(rows or np.zeros((0, 3)), weights)])  # type: ignore[arg-type]


def white(intensity: float = 1.0) -> Scene:
    """An evenly lit diffuser before the main lens: the scene of a white image."""
    return Scene([Diffuser(intensity)])


def _check_grid(grid: Grid) -> None:
    """Refuse what is no grid, or one whose picture would not fit in memory."""
    checks.instance("grid", grid, Grid)
    memory.require_plane(grid.shape, 32, "a target")


def _first_and_last(groups: int | tuple[int, int]) -> tuple[int, int]:
    """First and last USAF group, whole numbers from -10 to 20."""
    both: tuple[Any, ...] = (
        tuple(groups) if isinstance(groups, Sequence | np.ndarray) and np.ndim(groups) else (groups, groups)
    )
    if len(both) != 2 or any(
        isinstance(n, bool) or not isinstance(n, int | np.integer) or not -10 <= n <= 20 for n in both
    ):
        raise GeometryError(f"groups is {groups!r} but must be one or two whole numbers from -10 to 20.")
    return int(both[0]), int(both[1])


def _usaf_elements(first: int, last: int):
    """Top, left and bar width of each element, from the chart's corner, coarse to fine."""
    unit, below = bar_width(first, 1), 0.0
    for group in range(first, last + 1):
        y, x = (0.0, 0.0) if group == first else (below, 16 * unit)
        for element in range(1, 7):
            width = bar_width(group, element)
            yield y, x, width
            y += 7 * width
        below = y + bar_width(group, 1) if group > first else 0.0


def _add_bar(picture: np.ndarray, grid: Grid, corner: Pair, size: Pair) -> None:
    rows = coverage.interval(grid.y, grid.pitch[0], corner[0], corner[0] + size[0])
    columns = coverage.interval(grid.x, grid.pitch[1], corner[1], corner[1] + size[1])
    y, x = np.flatnonzero(rows), np.flatnonzero(columns)
    picture[y[0] : y[-1] + 1, x[0] : x[-1] + 1] += np.outer(rows[y], columns[x])


def _check_fits(grid: Grid, corner: Pair, size: Pair, what: str) -> None:
    left, right, bottom, top = grid.extent
    slack = 1e-9 * max(size)
    inside_y = top - slack <= corner[0] and corner[0] + size[0] <= bottom + slack
    if not (inside_y and left - slack <= corner[1] and corner[1] + size[1] <= right + slack):
        raise GeometryError(
            f"{what} take {size[0] * 1e3:.4g} x {size[1] * 1e3:.4g} mm but the grid has "
            f"{grid.size[0] * 1e3:.4g} x {grid.size[1] * 1e3:.4g} mm. Enlarge it, or start at a finer group."
        )


def _warn_if_narrow(grid: Grid, width: float) -> None:
    if width < max(grid.pitch):
        warnings.warn(
            f"the finest bars are {width * 1e6:.4g} µm wide, samples {max(grid.pitch) * 1e6:.4g} µm apart. "
            "Use a finer grid, or leave the last groups out.",
            SamplingWarning,
            stacklevel=3,
        )
