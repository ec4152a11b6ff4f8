r"""LFToolbox' `CalInfo.json`: the 5 x 5 matrix that turns samples of a decoded light field into rays.

.. math:: (s, t, u, v, 1)^T = H \, (i, j, k, l, 1)^T

with views i, j and lenslets k, l counted from 1, and distortion k1, k2, k3, b1, b2. H and the pitch of the
micro-images give f, L, b and E, given the pixel pitch: docs/theory/metric.md.

D. G. Dansereau, O. Pizarro and S. B. Williams, "Decoding, calibration and rectification for lenselet-based
plenoptic cameras", CVPR 2013, has the model; the toolbox counts from 1 where the paper counts from 0.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from lumigraph.core import checks
from lumigraph.core.calibration import Calibration
from lumigraph.core.lattice import Lattice
from lumigraph.errors import FormatError
from lumigraph.metrology.boards.camera import MetricCamera

_SIN60 = math.sqrt(3) / 2
_NEAR = 0.02  # of a view, by which a middle may be off without a note


def is_info(found: dict[str, Any]) -> bool:
    """True if a JSON object is such a file, of version 0.4 or with a CameraModel as 0.5 has it."""
    return "EstCamIntrinsicsH" in found or "EstCamIntrinsicsH" in (found.get("CameraModel") or {})


def camera_of(
    found: dict[str, Any], pixel_pitch: float | None = None, view_pitch: float | None = None
) -> tuple[MetricCamera, Calibration]:
    """Camera and micro-images of a file's JSON object.

    Parameters
    ----------
    found
        The object.
    pixel_pitch
        Of the sensor [m]; that of LFMetadata.devices.sensor.pixelPitch if left out.
    view_pitch
        From view to view [px of the raw image]; the pitch of the micro-images over the views if left out.

    Raises
    ------
    FormatError
        Matrices of no camera with a main lens, or no pixel pitch.
    """
    model = found.get("CameraModel") or found
    matrix = _finite("EstCamIntrinsicsH", model["EstCamIntrinsicsH"], (5, 5))
    grid, size = found["LensletGridModel"], [int(n) for n in found["CalOptions"]["LFSize"]]
    pixel = checks.positive("pixel_pitch", _pixel(found, pixel_pitch), error=FormatError)
    lattice = _lattice(grid)
    hexagons = lattice.layout == "hex"
    step = lattice.pitches[1] * _SIN60 if hexagons else math.sqrt(lattice.cell_area)
    apart = (lattice.pitches[1] if hexagons else step) / size[1] if view_pitch is None else view_pitch
    f, L, b, E = _lengths(matrix, pixel, step / apart, step)
    radial, tangential = _distortion(model)
    at = _axis(matrix, (size[1] + 1) / 2)
    axis = _place(lattice, at)
    camera = MetricCamera(f, L, b, E, pixel, axis, radial=radial, tangential=tangential)
    shape = _shape(found)
    notes = _told(matrix, at, (size[1] + 1) / 2, known=shape is not None)
    return camera, _calibration(lattice, shape or _guess(lattice, size), camera, notes)


def info_of(
    camera: MetricCamera, calibration: Calibration, views: int
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The JSON object of a camera, and what it leaves out, one sentence each.

    Parameters
    ----------
    camera, calibration
        Lengths, and the micro-images of a square array that belong to them.
    views
        Along an axis: the micro-images' pitch is divided into so many, as ``lg.decode(directions=)`` does.

    Raises
    ------
    FormatError
        A hexagonal or rectangular array, or fewer than two views.
    """
    lattice = calibration.lattice
    if lattice.layout != "square":
        raise FormatError(
            f"the lattice is {lattice.layout} but LFToolbox' matrix counts on a square one. "
            "Give a square array."
        )
    if views < 2:
        raise FormatError(f"views is {views} but must be at least 2.")
    pairs = calibration.indices_within((0, calibration.shape[0] - 1), (0, calibration.shape[1] - 1))
    first, last = pairs.min(0), pairs.max(0)
    row, column = (np.array(vector[::-1]) for vector in lattice.basis)
    grid = {
        "HSpacing": math.hypot(*row), "VSpacing": math.hypot(*column), "Rot": lattice.rotation,
        "Orientation": "horz",
        "HOffset": lattice.position(first)[1] + 1, "VOffset": lattice.position(first)[0] + 1,
        "UMax": int(last[1] - first[1] + 1), "VMax": int(last[0] - first[0] + 1), "Layout": "square",
    }  # fmt: skip
    k1, k2, k3 = camera.radial
    middle = (
        [0.0, 0.0]
        if not any(camera.tangential)
        else [-p / k1 for p in camera.tangential[::-1]]
        if k1
        else None
    )
    plain = {
        "EstCamIntrinsicsH": _matrix(camera, lattice, first, views).tolist(),
        "EstCamDistortionV": [*_inverted(k1, k2, k3), *(middle or [0.0, 0.0])],
        "LensletGridModel": grid,
        "CalOptions": {"LFSize": [views, views, grid["VMax"], grid["UMax"], 1]},
        "LFMetadata": {
            "devices": {"sensor": {"pixelPitch": camera.pixel_pitch}},
            "image": {"height": calibration.shape[0], "width": calibration.shape[1]},
        },
    }  # fmt: skip
    return plain, tuple(_left_out(camera, calibration, middle))


def _left_out(camera: MetricCamera, calibration: Calibration, middle: Any) -> Iterator[str]:
    yield "uncertainties, noise and the board's poses are not in LFToolbox' CalInfo"
    if any(camera.radial):
        yield "distortion is inverted as a series to the seventh power of the field angle"
    if middle is None:
        yield f"tangential distortion {camera.tangential} is not held where k1 is 0"
    if any(camera.tilt):
        shown = ", ".join(f"{t * 1e3:.3g}" for t in camera.tilt)
        yield f"the array's tilt ({shown} mrad) is not held: rays of a matrix know none"
    if len(camera.gains) > 1:
        yield f"{len(camera.gains)} kinds of lenslets are not held"
    if calibration.warp is not None:
        yield "the warp of the micro-images' lattice is not held"
    if calibration.aside is not None:
        yield "places of single lenslets beside the lattice are not held"
    if abs(skew := _skew(calibration.lattice)) * max(calibration.shape) > 1e-6:
        yield f"the lattice's shear, {skew * 1e3:.3g} mrad, is in the matrix but not in LensletGridModel"


def _skew(lattice: Lattice) -> float:
    row, column = (np.array(vector) for vector in lattice.basis)
    return float(row @ column / (np.hypot(*row) * np.hypot(*column)))


def _matrix(camera: MetricCamera, lattice: Lattice, first: np.ndarray, views: int) -> np.ndarray:
    """H (5, 5)."""
    f, L, b, E = camera.focal_length, camera.separation, camera.lenslet_distance, camera.exit_pupil
    steps = np.array([vector[::-1] for vector in lattice.basis]).T * camera.pixel_pitch  # (x, y) by (k, l)
    lens, way = steps * E / (E + b), steps / views
    slope = 1 / E + (1 - L / E) / f
    H = np.eye(5)
    H[:2, :2], H[:2, 2:4] = way * L / b, -lens * (1 - L / E)
    H[2:4, :2], H[2:4, 2:4] = way / b * (1 - L / f), lens * slope
    start = (lattice.position(first) - camera.axis)[::-1] * camera.pixel_pitch * E / (E + b)
    middle, ones = np.full(2, (views + 1) / 2), np.ones(2)
    H[:2, 4] = -start * (1 - L / E) - H[:2, :2] @ middle - H[:2, 2:4] @ ones
    H[2:4, 4] = start * slope - H[2:4, :2] @ middle - H[2:4, 2:4] @ ones
    return H


def _lengths(H: np.ndarray, pixel: float, views: float, step: float) -> tuple[float, float, float, float]:
    """f, L, b and E [m] of H, by the ways from lenslet to lenslet [px] in views and in all."""
    of_view, of_lenslet, way, slope = H[:2, :2], H[:2, 2:4], H[2:4, :2], H[2:4, 2:4]
    length = float(np.sqrt(np.abs(np.linalg.det(of_view))))
    if not length > 0:
        raise FormatError("EstCamIntrinsicsH moves s and t by nothing from view to view: it is of no camera.")
    steps = of_view * (step * pixel / length)
    far = length * views / (step * pixel)  # L / b
    bend = _part(way, of_view)  # 1 / L - 1 / f
    alpha, beta = -_part(of_lenslet, steps), _part(slope, steps)
    with np.errstate(all="ignore"):
        L = ((1 - alpha) / (1 + 1 / far) + alpha) / (beta + alpha * bend)
        f, b = 1 / (1 / L - bend), L / far
        reach = (1 - alpha) / (L + b)  # κ / E
        kappa = 1 - b * reach
        found = (float(f), float(L), float(b), float(kappa / reach))
    if not all(0 < one < 1e3 for one in found):
        shown = ", ".join(
            f"{name} {one:.4g} m" for name, one in zip(("f", "L", "b", "E"), found, strict=True)
        )
        raise FormatError(
            f"EstCamIntrinsicsH gives {shown}, which no camera has. Check pixel_pitch, and give view_pitch."
        )
    return found


def _part(matrix: np.ndarray, unit: np.ndarray) -> float:
    """Best factor by which a matrix is `unit`, by least squares."""
    return float(np.sum(matrix * unit) / np.sum(unit * unit))


def _axis(H: np.ndarray, middle: float) -> np.ndarray:
    """Lenslet (k, l), from 1, whose middle view looks along the axis."""
    return np.linalg.solve(H[2:4, 2:4], -H[2:4, 4] - H[2:4, :2] @ np.full(2, middle))


def _place(lattice: Lattice, at: np.ndarray) -> tuple[float, float]:
    """Micro-image's centre (y, x) [px] of lenslet (k, l), of decoded light fields of hexagonal arrays too."""
    row, column = (np.array(vector) for vector in lattice.basis)
    if lattice.layout == "hex":
        column, row = column - row / 2, row * _SIN60
    y, x = np.array(lattice.origin) + (at[0] - 1) * row + (at[1] - 1) * column
    return float(y), float(x)


def _lattice(grid: dict[str, Any]) -> Lattice:
    """Lattice of the micro-images; rows lead across, the toolbox' horz."""
    if grid.get("Orientation", "horz") != "horz":
        raise FormatError(f"LensletGridModel.Orientation is {grid['Orientation']!r} but must be 'horz'.")
    across, down, turn, x, y = (
        float(_finite(name, grid[name], ())) for name in ("HSpacing", "VSpacing", "Rot", "HOffset", "VOffset")
    )
    sin, cos = math.sin(turn), math.cos(turn)
    row, column = np.array([across * sin, across * cos]), np.array([down * cos, -down * sin])
    layout: Any = "square" if grid.get("Layout") == "square" or abs(down / across - 1) < 0.05 else "hex"
    if layout == "hex":
        column = column + row / 2
    return Lattice(((row[0], row[1]), (column[0], column[1])), (y - 1, x - 1), layout)


def _shape(found: dict[str, Any]) -> tuple[int, int] | None:
    """Rows and columns of the raw images, where the camera's metadata says so."""
    image = (found.get("LFMetadata") or {}).get("image") or {}
    if "height" not in image or "width" not in image:
        return None
    return checks.shape("LFMetadata.image", (image["height"], image["width"]))


def _guess(lattice: Lattice, size: list[int]) -> tuple[int, int]:
    """The same from where the last micro-image stands."""
    last = np.array(_place(lattice, np.array([size[3], size[2]]))) + lattice.pitch / 2
    return max(1, round(last[0])), max(1, round(last[1]))


def _calibration(
    lattice: Lattice, shape: tuple[int, int], camera: MetricCamera, notes: Iterator[str]
) -> Calibration:
    indices = lattice.indices((0, shape[0] - 1), (0, shape[1] - 1))
    return Calibration(
        lattice, shape, indices, lattice.position(indices), math.nan, camera.pixel_pitch, camera.separation,
        camera.lenslet_distance, notes=tuple(notes),
    )  # fmt: skip


def _told(H: np.ndarray, at: np.ndarray, middle: float, *, known: bool) -> Iterator[str]:
    yield "lattice and lengths are LFToolbox', not measured on a picture; it gives no uncertainties"
    if not known:
        yield "the size of the raw images is a guess from the lenslets: the file does not say"
    ray = H @ np.array([middle, middle, *at, 1.0])
    off = float(np.hypot(*ray[:2]) / np.sqrt(np.abs(np.linalg.det(H[:2, :2]))))
    if off > _NEAR:
        yield f"the middle view looks {off:.2g} views past the middle of the lens, which is left out"


def _pixel(found: dict[str, Any], given: float | None) -> float:
    if given is not None:
        return given
    try:
        return float(found["LFMetadata"]["devices"]["sensor"]["pixelPitch"])
    except (KeyError, TypeError, ValueError):
        raise FormatError(
            "the file does not say how wide pixels are. Give pixel_pitch, such as '1.4 um'."
        ) from None


def _distortion(model: dict[str, Any]) -> Any:
    """Radial and tangential of `MetricCamera`."""
    values = model.get("EstCamDistortionV", model.get("Distortion")) or []
    known = np.concatenate([_finite("EstCamDistortionV", values, (len(values),)), np.zeros(5)])[:5]
    radial = _inverted(*known[:3])
    across, down = (-radial[0] * float(b) for b in known[3:])
    return radial, (down, across)


def _inverted(k1: float, k2: float, k3: float) -> tuple[float, float, float]:
    """Inverse of r (1 + k1 r² + k2 r⁴ + k3 r⁶), as such a series."""
    return -float(k1), float(3 * k1**2 - k2), float(8 * k1 * k2 - 12 * k1**3 - k3)


def _finite(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise FormatError(f"{name} has shape {numbers.shape} but must be {shape}, finite numbers.")
    return numbers
