"""Borders between micro-images on a raw image without dark gaps: `aligned`."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lumigraph.calibration.devignette import as_raw, grey
from lumigraph.calibration.template import mean_cell
from lumigraph.core.arrays import Array
from lumigraph.core.calibration import Calibration
from lumigraph.core.gaps import logarithm
from lumigraph.core.lattice import Lattice
from lumigraph.core.raw import RawImage

_CLEAR = (
    0.5  # correlation of the mean cell's edges with its border: 0.76 on a real camera, 0.2 for gaps there
)
_STEADY = 0.04  # of the pitch: spread over the quarters of the picture
_FARTHEST = 0.25  # of the pitch: farther, the lattice may be another one


class Border(NamedTuple):
    """Way (y, x) [px] from a lattice's cells to those on a picture, its spread, and how clear it is."""

    move: np.ndarray
    spread: float
    clearness: float


def aligned(calibration: Calibration, raw: RawImage | Array) -> Calibration:
    """The calibration moved to where a raw image shows the borders of its micro-images.

    A maker's file gives pitch and rotation well, but not where a picture was cropped. Neighbouring
    micro-images of a camera 2.0 show different places of the scene, so that edges gather on the borders
    between them whatever the scene is. The lattice is moved where the four quarters of the picture agree, by
    a quarter of a pitch at most, and a note says by how much; otherwise the calibration comes back as it is.

    Parameters
    ----------
    calibration
        Whose pitch and rotation are right.
    raw
        Picture (y, x[, c]) of the same size.

    Raises
    ------
    CalibrationError
        Another size.
    """
    raw = as_raw(raw)
    calibration.check_fits(raw.shape)
    found, pitch = border(edges(grey(raw)), calibration), calibration.lattice.pitch
    far = float(np.hypot(*found.move))
    if found.clearness < _CLEAR or found.spread > _STEADY * pitch or far > _FARTHEST * pitch:
        return calibration
    y, x = (float(v) for v in found.move)
    note = f"moved by ({y:+.1f}, {x:+.1f}) px (y, x) to the borders of micro-images on the raw image"
    return replace(
        calibration,
        lattice=calibration.lattice.moved(y, x),
        centers=calibration.centers + found.move,
        notes=(*calibration.notes, note),
        by_maker=False,
    )


def border(feature: np.ndarray, model: Calibration) -> Border:
    """Position of a feature (y, x), edges or gaps, within the cell of a lattice."""
    (ny, nx), lattice = (n // 2 * 2 for n in feature.shape), model.lattice  # quarters of one size
    cells = []
    for rows in (slice(0, ny // 2), slice(ny // 2, ny)):
        for columns in (slice(0, nx // 2), slice(nx // 2, nx)):
            part = feature[rows, columns]
            moved = lattice.moved(-rows.start, -columns.start)
            none = model.indices[:0]
            quarter = replace(
                model, lattice=moved, shape=part.shape, indices=none, centers=none.astype(float),
                light=None, missing=none, warp=None,
            )  # fmt: skip
            cells.append(mean_cell(part, quarter))
    whole = np.mean(cells, axis=0)
    move, clearness = _place(whole, lattice)
    away = []
    for cell in cells:
        steps = np.linalg.solve(lattice.matrix, _place(cell, lattice)[0] - move)
        away.append(lattice.matrix @ (steps - np.rint(steps)))
    return Border(move, float(np.sqrt(np.square(away).sum(-1).mean())), clearness)


def edges(picture: np.ndarray) -> np.ndarray:
    """Slope of a picture's logarithm, strong edges not above others."""
    slopes = np.hypot(*np.gradient(logarithm(picture)))
    return np.minimum(slopes, np.percentile(slopes[::2, ::2], 90)).astype(np.float32)


def _place(cell: np.ndarray, lattice: Lattice) -> tuple[np.ndarray, float]:
    """Offset [px] at which the border of a lattice's cell fits a mean cell best, and the correlation."""
    size = len(cell)
    at = np.arange(size) / size
    steps = np.stack(np.meshgrid(at, at, indexing="ij"), -1) @ lattice.matrix.T
    line = np.exp(-(to_border(steps, replace(lattice, origin=(0.0, 0.0))) ** 2) / 2)
    line, even = line - line.mean(), cell - cell.mean()
    match = np.fft.ifft2(np.fft.fft2(even) * np.conj(np.fft.fft2(line))).real
    top = np.unravel_index(int(np.argmax(match)), match.shape)
    place = [k + _between(np.take(match, range(k - 1, k + 2), axis, mode="wrap"), top, axis) for axis, k in
             enumerate(int(t) for t in top)]  # fmt: skip
    part = np.array(place) / size
    energy = float(np.square(line).sum() * np.square(even).sum())
    return lattice.matrix @ (part - np.rint(part)), float(match[top]) / max(energy, 1e-300) ** 0.5


def _between(three: np.ndarray, top: tuple[np.intp, ...], axis: int) -> float:
    """Top of the parabola through three samples along an axis."""
    before, here, after = np.take(three, int(top[1 - axis]), 1 - axis)
    return float((after - before) / (2 * max(2 * here - before - after, 1e-30)))


def to_border(points: np.ndarray, lattice: Lattice) -> np.ndarray:
    """Distances of points (..., 2) in a lattice's first cell to the nearest border of micro-images [px]."""
    near = np.stack(np.meshgrid([-1, 0, 1, 2], [-1, 0, 1, 2], indexing="ij"), -1).reshape(-1, 2)
    away = np.linalg.norm(points[..., None, :] - lattice.position(near), axis=-1)
    away.partition(1, axis=-1)
    return (away[..., 1] - away[..., 0]) / 2
