"""A calibration drawn over the white image it was made from."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from lumigraph.core.arrays import Array, to_numpy
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage
from lumigraph.errors import CalibrationError
from lumigraph.plots.axes import canvas, check_image, draw

_MOST_ARROWS = 600


def _stretched(image: np.ndarray) -> np.ndarray:
    """The picture between its 0.5th and 99.5th percentile: a raw image may hold a few bright points."""
    low, high = np.percentile(image, (0.5, 99.5))
    return np.clip((image - low) / ((high - low) or 1.0), 0.0, 1.0)


def lattice(white: RawImage | Array, calibration: Calibration, *, cells: int = 6) -> Figure:
    """Figure of the micro-images that a calibration found: residuals everywhere, cells near the middle.

    Left, the whole image with an arrow from each lattice point (of many, every second, third ...) towards
    the measured centre, enlarged so that the root mean square one is a quarter of their distance. Right,
    `cells` pitches around the middle with the borders of the micro-images and both kinds of centres.

    Parameters
    ----------
    white
        The white image, or any raw image of the same camera.
    calibration
        Found on an image of the same size.
    cells
        Lenslets across the enlarged part.

    Raises
    ------
    CalibrationError
        The image has another size than the calibration's, or `cells` is below 1.
    """
    image = check_image(white.data if isinstance(white, RawImage) else white)
    calibration.check_fits(image.shape[:2])
    if cells < 1:
        raise CalibrationError(f"cells is {cells} but must be at least 1.")
    figure, (whole, part) = canvas(1, 2, width=6.4, height=5.4)
    image = _stretched(image)
    draw(whole, image)
    _arrows(whole, calibration)
    draw(part, image)
    _cells(part, calibration, cells)
    figure.suptitle(
        f"{calibration.lattice.layout} lattice, pitch {calibration.lattice.pitch:.3f} px, "
        + (
            f"residual {calibration.residual_px:.3f} px rms"
            if calibration.measured
            else "residual not measured"
        )
    )
    return figure


def cell_outline(lattice: Lattice) -> np.ndarray:
    """Corners (k, 2) as (y, x), around (0, 0), of the region nearest to one lattice point."""
    from scipy.spatial import Voronoi

    steps = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3), indexing="ij"), -1).reshape(-1, 2)
    diagram = Voronoi(steps @ lattice.matrix.T)
    region = diagram.regions[diagram.point_region[len(steps) // 2]]
    corners = diagram.vertices[region]
    return corners[np.argsort(np.arctan2(corners[:, 0], corners[:, 1]))]


def _arrows(axes: Axes, calibration: Calibration) -> None:
    residuals, points = calibration.residuals, calibration.position(calibration.indices)
    axes.set_title(f"{len(points)} lenslets")
    rms = float(np.sqrt(np.mean(np.sum(residuals**2, axis=1)))) if len(points) else 0.0
    if rms < 1e-9:  # computed from a camera file: nothing was measured
        return
    every = math.ceil(math.sqrt(len(points) / _MOST_ARROWS))
    factor = 0.25 * every * calibration.lattice.pitch / rms
    drawn = (calibration.indices % every == 0).all(axis=1)
    (y, x), (dy, dx) = points[drawn].T, residuals[drawn].T * factor
    axes.quiver(x, y, dx, dy, angles="xy", scale_units="xy", scale=1, color="#ff5b1f", width=0.003)
    axes.set_title(f"{len(points)} lenslets, residuals x {factor:.0f}")


def _cells(axes: Axes, calibration: Calibration, count: int) -> None:
    lattice, half = calibration.lattice, calibration.lattice.pitch * count / 2
    middle = [(n - 1) / 2 for n in calibration.shape]
    (y0, y1), (x0, x1) = [
        (max(m - half, -0.5), min(m + half, n - 0.5)) for m, n in zip(middle, calibration.shape, strict=True)
    ]
    points = calibration.centers_within(
        (y0 - lattice.pitch, y1 + lattice.pitch), (x0 - lattice.pitch, x1 + lattice.pitch)
    )
    outlines = [(point + cell_outline(lattice))[:, ::-1] for point in points]
    axes.add_collection(PolyCollection(outlines, facecolors="none", edgecolors="#35c2ff", linewidths=1.0))
    axes.plot(points[:, 1], points[:, 0], "+", color="#35c2ff", markersize=9, label="lattice")
    measured = to_numpy(calibration.centers)
    if calibration.measured:
        axes.plot(measured[:, 1], measured[:, 0], ".", color="#ff5b1f", markersize=4, label="measured")
    axes.set(xlim=(x0, x1), ylim=(y1, y0), title=f"{count} pitches around the middle")
    axes.legend(loc="upper right", fontsize="small")
